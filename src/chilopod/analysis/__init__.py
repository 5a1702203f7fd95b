"""Analyses in the planar theory: stability of the straight walk, its bifurcations, and the curved walks beyond them."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.analysis.branch import curved_walks, read_walks, resumed
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
            "branch": ("curved_walks", "read_walks", "resumed"),
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
    "RadiusLaws",
    "SquareRootFit",
    "StraightWalk",
    "TransitionCurve",
    "WalkBifurcation",
    "bifurcations",
    "curved_walks",
    "first_loss",
    "pitchfork",
    "radius_laws",
    "read_walks",
    "resumed",
    "square_root_fit",
    "straight_walk",
    "transition_curve",
    "undulating_walks",
]
