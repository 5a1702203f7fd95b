"""Analyses: stability of the straight walk, its bifurcations, and the curved walks beyond them."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.analysis.bend_onset import bend_onset
    from chilopod.analysis.branch import curved_walks, read_walks, resumed
    from chilopod.analysis.cycle_modes import CycleMultipliers
    from chilopod.analysis.cycle_multipliers import cycle_multipliers, walk_multipliers
    from chilopod.analysis.radius_law import RadiusLaws, radius_laws
    from chilopod.analysis.square_root import SquareRootFit, square_root_fit
    from chilopod.analysis.straight_walk import (
        StraightWalk,
        WalkBifurcation,
        bifurcations,
        first_loss,
        pitchfork,
        straight_walk,
    )
    from chilopod.analysis.transition_curves import TransitionCurve, transition_curve
    from chilopod.analysis.undulation import undulating_walks
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "bend_onset": ("bend_onset",),
            "branch": ("curved_walks", "read_walks", "resumed"),
            "cycle_modes": ("CycleMultipliers",),
            "cycle_multipliers": ("cycle_multipliers", "walk_multipliers"),
            "radius_law": ("RadiusLaws", "radius_laws"),
            "square_root": ("SquareRootFit", "square_root_fit"),
            "straight_walk": (
                "StraightWalk",
                "WalkBifurcation",
                "bifurcations",
                "first_loss",
                "pitchfork",
                "straight_walk",
            ),
            "transition_curves": ("TransitionCurve", "transition_curve"),
            "undulation": ("undulating_walks",),
        },
    )

__all__ = [
    "CycleMultipliers",
    "RadiusLaws",
    "SquareRootFit",
    "StraightWalk",
    "TransitionCurve",
    "WalkBifurcation",
    "bend_onset",
    "bifurcations",
    "curved_walks",
    "cycle_multipliers",
    "first_loss",
    "pitchfork",
    "radius_laws",
    "read_walks",
    "resumed",
    "square_root_fit",
    "straight_walk",
    "transition_curve",
    "undulating_walks",
    "walk_multipliers",
]
