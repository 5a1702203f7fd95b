"""Points of codimension two: where something else becomes critical as well along a curve of critical periodic orbits.

What they are is told in Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 9.1 to 9.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.stability.points import BifurcationPoint, Kind

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class CodimensionTwo(Labelled):
    """Kind of a point of codimension two; each member's ``sentence`` describes it in words."""

    CUSP = "cusp", "two curves of folds meet and vanish: beyond it one orbit is left of three"
    DEGENERATE_PITCHFORK = (
        "degenerate pitchfork",
        "the pitchfork turns from super- to subcritical: a curve of folds of the orbits that branch off ends here",
    )
    DEGENERATE_TRANSCRITICAL = (
        "degenerate transcritical",
        "the quadratic term vanishes: the two orbits exchange stability as in a pitchfork",
    )
    GENERALISED_PERIOD_DOUBLING = (
        "generalised period doubling",
        "the period doubling turns from super- to subcritical: a curve of folds of the doubled orbit ends here",
    )
    CHENCINER = (
        "Chenciner",
        "the Neimark-Sacker bifurcation turns from super- to subcritical: tori that meet and vanish begin here",
    )
    RESONANCE_1_1 = "1:1 resonance", "two multipliers of the return map are +1: the curve of Neimark-Sacker ends here"
    RESONANCE_1_2 = "1:2 resonance", "two multipliers of the return map are -1: the curve of Neimark-Sacker ends here"
    RESONANCE_1_3 = "1:3 resonance", "the pair of the return map is at 120 degrees: orbits of three returns are near"
    RESONANCE_1_4 = "1:4 resonance", "the pair of the return map is at 90 degrees: orbits of four returns are near"
    FOLD_FLIP = "fold-flip", "a fold and a period doubling at once"
    FOLD_NEIMARK_SACKER = "fold-Neimark-Sacker", "a fold and a Neimark-Sacker bifurcation at once"
    FLIP_NEIMARK_SACKER = "flip-Neimark-Sacker", "a period doubling and a Neimark-Sacker bifurcation at once"
    DOUBLE_NEIMARK_SACKER = "double Neimark-Sacker", "two pairs of multipliers are on the unit circle at once"
    PITCHFORK_FOLD = "pitchfork-fold", "a pitchfork and a fold at once"
    PITCHFORK_FLIP = "pitchfork-flip", "a pitchfork and a period doubling at once"
    PITCHFORK_NEIMARK_SACKER = "pitchfork-Neimark-Sacker", "a pitchfork and a Neimark-Sacker bifurcation at once"
    DOUBLE_PITCHFORK = "double pitchfork", "two pitchforks at once"
    SEVERAL_CRITICAL = "several critical", "another multiplier becomes critical as well"


@dataclass(frozen=True)
class Codimension2(ReadOnlyArrays):
    """A located point of codimension two.

    Attributes
    ----------
    kind
        Kind of the point.
    values
        Values of both parameters, shape (2,).
    error_bound
        Bounds on their errors, shape (2,): that of the test function over its rate of change along the curve, and that
        of the curve.
    orbit
        State on the orbit at time 0, shape (n,).
    multipliers
        Multipliers of the return map, by falling modulus.
    next_coefficient, next_coefficient_error
        Next coefficient where that of the curve's normal form vanishes: the first one after it, of the same map and in
        the same amplitude, and a bound on its error. That is c of a -> a + c a^3 at a cusp and a degenerate
        transcritical point; e of a -> a + e a^5 at a degenerate pitchfork and, over two periods, at a generalised
        period doubling; the second Lyapunov coefficient e of |a| -> |a| + e |a|^5 over one period at a Chenciner point.
        None elsewhere.
    """

    kind: CodimensionTwo
    values: Array
    error_bound: Array
    orbit: Array
    multipliers: ComplexArray
    next_coefficient: float | None = None
    next_coefficient_error: float | None = None


@dataclass(frozen=True)
class Start2(ReadOnlyArrays):
    """Where a curve starts that leaves a point of codimension two.

    Attributes
    ----------
    point
        A bifurcation point on the curve, beside the one that is left.
    second
        The value of the second parameter there.
    outward
        Direction in which the curve leaves, shape (n + 2,): of the state, and of both parameters.
    periods
        Number of periods that its orbits take. They need not have the systems' symmetry in time.
    """

    point: BifurcationPoint
    second: float
    outward: Array
    periods: int


DEGENERATE = {
    Kind.FOLD: CodimensionTwo.CUSP,
    Kind.PITCHFORK: CodimensionTwo.DEGENERATE_PITCHFORK,
    Kind.TRANSCRITICAL: CodimensionTwo.DEGENERATE_TRANSCRITICAL,
    Kind.PERIOD_DOUBLING: CodimensionTwo.GENERALISED_PERIOD_DOUBLING,
    Kind.NEIMARK_SACKER: CodimensionTwo.CHENCINER,
}
"""Kind of the point where the coefficient of a curve's normal form vanishes."""

_TOGETHER = {
    frozenset({Kind.FOLD, Kind.PERIOD_DOUBLING}): CodimensionTwo.FOLD_FLIP,
    frozenset({Kind.FOLD, Kind.NEIMARK_SACKER}): CodimensionTwo.FOLD_NEIMARK_SACKER,
    frozenset({Kind.PERIOD_DOUBLING, Kind.NEIMARK_SACKER}): CodimensionTwo.FLIP_NEIMARK_SACKER,
    frozenset({Kind.NEIMARK_SACKER}): CodimensionTwo.DOUBLE_NEIMARK_SACKER,
    frozenset({Kind.PITCHFORK, Kind.FOLD}): CodimensionTwo.PITCHFORK_FOLD,
    frozenset({Kind.PITCHFORK, Kind.PERIOD_DOUBLING}): CodimensionTwo.PITCHFORK_FLIP,
    frozenset({Kind.PITCHFORK, Kind.NEIMARK_SACKER}): CodimensionTwo.PITCHFORK_NEIMARK_SACKER,
    frozenset({Kind.PITCHFORK}): CodimensionTwo.DOUBLE_PITCHFORK,
}


def together(one: Kind, other: Kind) -> CodimensionTwo:
    """Kind of the point where two bifurcations happen at once."""
    return _TOGETHER.get(frozenset({one, other}), CodimensionTwo.SEVERAL_CRITICAL)
