"""Studies: conditions in, results out. One module for each figure or table of the paper."""

from chilopod.studies.identify import Identification, identify_planar
from chilopod.studies.reproduce import CHAPTERS, SECTIONS, Results, reproduce
from chilopod.studies.straight_walk import StraightWalk, WalkBifurcation, bifurcations, straight_walk
from chilopod.studies.table import Row

__all__ = [
    "CHAPTERS",
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
