"""Analyses: stability of the straight walk, its bifurcations, and the curved walks beyond them."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.analysis.branch import curved_walks, read_walks, resumed
    from chilopod.analysis.compare import RobotComparison, compare
    from chilopod.analysis.cycle_modes import CycleMultipliers
    from chilopod.analysis.cycle_multipliers import bend_onset, cycle_multipliers, walk_multipliers
    from chilopod.analysis.map import map
    from chilopod.analysis.map_result import StabilityMap
    from chilopod.analysis.parameters import spring_scale
    from chilopod.analysis.quantities import Onset
    from chilopod.analysis.radius_law import RadiusLaws, radius_laws
    from chilopod.analysis.sensitivity import Sensitivity, sensitivity
    from chilopod.analysis.square_root import SquareRootFit, square_root_fit
    from chilopod.analysis.straight_walk import (
        StraightWalk,
        WalkBifurcation,
        bifurcations,
        first_loss,
        pitchfork,
        straight_walk,
    )
    from chilopod.analysis.uncertainty import Uncertainty, uncertainty
    from chilopod.analysis.undulation import undulating_walks
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "branch": ("curved_walks", "read_walks", "resumed"),
            "compare": ("RobotComparison", "compare"),
            "cycle_modes": ("CycleMultipliers",),
            "cycle_multipliers": ("bend_onset", "cycle_multipliers", "walk_multipliers"),
            "parameters": ("spring_scale",),
            "quantities": ("Onset",),
            "map": ("map",),
            "map_result": ("StabilityMap",),
            "radius_law": ("RadiusLaws", "radius_laws"),
            "sensitivity": ("Sensitivity", "sensitivity"),
            "square_root": ("SquareRootFit", "square_root_fit"),
            "straight_walk": (
                "StraightWalk",
                "WalkBifurcation",
                "bifurcations",
                "first_loss",
                "pitchfork",
                "straight_walk",
            ),
            "uncertainty": ("Uncertainty", "uncertainty"),
            "undulation": ("undulating_walks",),
        },
    )

__all__ = [
    "CycleMultipliers",
    "Onset",
    "RadiusLaws",
    "RobotComparison",
    "Sensitivity",
    "SquareRootFit",
    "StabilityMap",
    "StraightWalk",
    "Uncertainty",
    "WalkBifurcation",
    "bend_onset",
    "bifurcations",
    "compare",
    "curved_walks",
    "cycle_multipliers",
    "first_loss",
    "map",
    "pitchfork",
    "radius_laws",
    "read_walks",
    "resumed",
    "sensitivity",
    "spring_scale",
    "square_root_fit",
    "straight_walk",
    "uncertainty",
    "undulating_walks",
    "walk_multipliers",
]
