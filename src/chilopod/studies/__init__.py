"""Studies: conditions in, results out. One module for each figure or table of the paper."""

from chilopod.studies.identify import Identification, identify_planar
from chilopod.studies.reproduce import SECTIONS, Results, Row, reproduce
from chilopod.studies.straight_walk import StraightWalk, WalkBifurcation, bifurcations, straight_walk

__all__ = [
    "SECTIONS",
    "Identification",
    "Results",
    "Row",
    "StraightWalk",
    "WalkBifurcation",
    "bifurcations",
    "identify_planar",
    "reproduce",
    "straight_walk",
]
