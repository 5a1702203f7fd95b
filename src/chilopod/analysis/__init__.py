"""The robot's verbs in the planar theory: when the straight walk holds, what it gives way to, and how that turns."""

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
    from chilopod.analysis.undulation import undulating_walks

__all__ = [
    "RadiusLaws",
    "SquareRootFit",
    "StraightWalk",
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
    "undulating_walks",
]

__getattr__, __dir__ = exports(
    __name__,
    {
        "RadiusLaws": "chilopod.analysis.radius_law",
        "SquareRootFit": "chilopod.analysis.square_root",
        "StraightWalk": "chilopod.analysis.straight_walk",
        "WalkBifurcation": "chilopod.analysis.straight_walk",
        "bifurcations": "chilopod.analysis.straight_walk",
        "curved_walks": "chilopod.analysis.branch",
        "first_loss": "chilopod.analysis.straight_walk",
        "pitchfork": "chilopod.analysis.straight_walk",
        "radius_laws": "chilopod.analysis.radius_law",
        "read_walks": "chilopod.analysis.branch",
        "resumed": "chilopod.analysis.branch",
        "square_root_fit": "chilopod.analysis.square_root",
        "straight_walk": "chilopod.analysis.straight_walk",
        "undulating_walks": "chilopod.analysis.undulation",
    },
)
