"""Analyses: stability of the straight walk, its bifurcations, and the curved walks beyond them."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.analysis.branch import curved_walks as curved_walks
    from chilopod.analysis.branch import read_walks as read_walks
    from chilopod.analysis.branch import resumed as resumed
    from chilopod.analysis.compare import RobotComparison as RobotComparison
    from chilopod.analysis.compare import compare as compare
    from chilopod.analysis.cycle_modes import CycleMultipliers as CycleMultipliers
    from chilopod.analysis.cycle_multipliers import bend_onset as bend_onset
    from chilopod.analysis.cycle_multipliers import cycle_multipliers as cycle_multipliers
    from chilopod.analysis.cycle_multipliers import walk_multipliers as walk_multipliers
    from chilopod.analysis.map import map as map
    from chilopod.analysis.map_result import StabilityMap as StabilityMap
    from chilopod.analysis.parameters import spring_scale as spring_scale
    from chilopod.analysis.quantities import Onset as Onset
    from chilopod.analysis.radius_law import RadiusLaws as RadiusLaws
    from chilopod.analysis.radius_law import radius_laws as radius_laws
    from chilopod.analysis.sensitivity import Sensitivity as Sensitivity
    from chilopod.analysis.sensitivity import sensitivity as sensitivity
    from chilopod.analysis.square_root import SquareRootFit as SquareRootFit
    from chilopod.analysis.square_root import square_root_fit as square_root_fit
    from chilopod.analysis.straight_walk import StraightWalk as StraightWalk
    from chilopod.analysis.straight_walk import WalkBifurcation as WalkBifurcation
    from chilopod.analysis.straight_walk import bifurcations as bifurcations
    from chilopod.analysis.straight_walk import first_loss as first_loss
    from chilopod.analysis.straight_walk import pitchfork as pitchfork
    from chilopod.analysis.straight_walk import straight_walk as straight_walk
    from chilopod.analysis.uncertainty import Uncertainty as Uncertainty
    from chilopod.analysis.uncertainty import uncertainty as uncertainty
    from chilopod.analysis.undulation import undulating_walks as undulating_walks
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
