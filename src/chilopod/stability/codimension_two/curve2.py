"""Curves of bifurcation points in two parameters, and their points of codimension two, where a second condition
becomes critical (Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 9.1 to 9.6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.stability.continuation.tracer import Ending
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.shown import Result, axes_for, bounded, columns, dataset, mark, rows

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


class CodimensionTwo(Labelled):
    """Kind of a point of codimension two; each member's ``sentence`` describes it in words."""

    CUSP = "cusp", "two curves of folds meet and vanish: beyond it one orbit is left of three"
    DEGENERATE_FOLD = (
        "degenerate fold",
        "the cubic term vanishes as well, unlike at a cusp: so at an Arnold tongue's tip",
    )
    DEGENERATE_PITCHFORK = "degenerate pitchfork", "it turns from super- to subcritical: folds of new orbits end here"
    DEGENERATE_TRANSCRITICAL = "degenerate transcritical", "the quadratic term vanishes, as in a pitchfork"
    GENERALISED_PERIOD_DOUBLING = "generalised period doubling", "it turns subcritical: folds of new orbits end here"
    CHENCINER = "Chenciner", "the Neimark-Sacker bifurcation turns from super- to subcritical: folds of tori begin here"
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


@dataclass(frozen=True, eq=False)
class Point2(ReadOnlyArrays):
    """A bifurcation point on a curve.

    Attributes
    ----------
    values
        Values of both parameters, shape (2,).
    error_bound
        Bounds on the errors of both, shape (2,), at right angles to the curve (in units of the box).
    orbit, mode, multiplier, frequency, period, coefficient, coefficient_error
        As of a :class:`BifurcationPoint`; the coefficient is the quadratic one at a fold or a transcritical point.
    multipliers
        All multipliers of the return map, by falling modulus.
    """

    values: Array
    error_bound: Array
    orbit: Array
    mode: ComplexArray
    multiplier: complex
    multipliers: ComplexArray
    frequency: float
    period: float = np.nan
    coefficient: float | None = None
    coefficient_error: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class SpecialPoint2(Point2):
    """A point of codimension two on a curve.

    Attributes
    ----------
    kind
        Kind of the point.
    next_coefficient, next_coefficient_error
        Next coefficient where that of the curve's normal form vanishes, for the same map and amplitude, and a bound on
        its error: c of a -> a + c a^3 on folds and transcritical points; e of a -> a + e a^5 at a
        degenerate pitchfork and a generalised period doubling, and of |a| -> |a| + e |a|^5, the second Lyapunov
        coefficient, at a Chenciner point. None elsewhere. Where it is zero within its error, a fold is degenerate and
        no cusp, and the folds that the other kinds name need not exist.
    """

    kind: CodimensionTwo
    next_coefficient: float | None = None
    next_coefficient_error: float | None = None


@dataclass(frozen=True, eq=False)
class Curve2(Result):
    """A curve of bifurcation points.

    Attributes
    ----------
    kind
        Kind of the bifurcation along it.
    points
        Points in order, those of codimension two included.
    endings, reasons
        Reasons for the end at its first point and at its last, and details of a lost curve or spent limit, else empty.
    periods
        Number of the systems' periods in one period of its orbits.
    """

    kind: Kind
    points: tuple[Point2, ...]
    endings: tuple[Ending, Ending]
    reasons: tuple[str, str] = ("", "")
    periods: int = 1

    @property
    def special(self) -> tuple[SpecialPoint2, ...]:
        """Points of codimension two."""
        return tuple(point for point in self.points if isinstance(point, SpecialPoint2))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Reasons for lost or spent ends, a sentence each."""
        return tuple(dict.fromkeys(filter(None, self.reasons)))

    @property
    def values(self) -> Array:
        """Values of both parameters at all points, shape (points, 2)."""
        return np.array([point.values for point in self.points])

    def _lines(self) -> list[str]:
        (p, q), (p_end, q_end) = self.values[0], self.values[-1]
        special = [(each.kind.label, *map(bounded, each.values, each.error_bound)) for each in self.special]
        pairs = zip(self.endings, self.reasons, strict=True)
        ends = [f"{end.sentence} ({why})" if why else end.sentence for end, why in pairs]
        return [
            f"Curve2: {self.kind.label}, {len(self.points)} points",
            f"from ({p:.9g}, {q:.9g}): {ends[0]}",
            f"to ({p_end:.9g}, {q_end:.9g}): {ends[1]}",
            "points of codimension two:" if special else "points of codimension two: none",
            *rows(special),
        ]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the curve over both parameters, with points of codimension two, on given or new axes of matplotlib."""
        axes = axes_for(axes)
        drawn = np.vstack([self.values, self.values[:1]]) if Ending.CLOSED in self.endings else self.values
        axes.plot(*drawn.T, label=self.kind.label)
        mark(axes, [(each.kind.label, each.values[0], each.values[1]) for each in self.special])
        axes.set(xlabel="first parameter", ylabel="second parameter")
        return axes

    def to_dataset(self) -> xr.Dataset:
        """Dataset over ``point``; ``special`` is empty at ordinary points. Multipliers are of the return map."""
        kinds = {"special": [getattr(point, "kind", None) for point in self.points]}
        names = ("values", "error_bound", "coefficient", "coefficient_error")
        more = ("frequency", "period", "orbit", "multipliers")
        first, last = (end.label for end in self.endings)
        about = {"kind": self.kind.label, "first_end": first, "last_end": last, "remarks": "; ".join(self.remarks)}
        return dataset("point", columns(self.points, *names, *more) | kinds, **about)


@dataclass(frozen=True, eq=False)
class Start2(ReadOnlyArrays):
    """Start of a curve that leaves a point of codimension two.

    Attributes
    ----------
    point
        Bifurcation point on the curve, beside the point of codimension two.
    second
        Value of the second parameter there.
    outward
        Direction in which the curve leaves, shape (n + 2,): state, then both parameters.
    periods
        Number of the systems' periods in one period of its orbits, which need not have the symmetry in time.
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
