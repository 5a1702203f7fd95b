"""Points of a curve of bifurcation points in two parameters, and why it ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.codimension_two.codimension2 import Codimension2
from chilopod.stability.points import Kind
from chilopod.stability.shown import Result, axes_for, bounded, columns, dataset, mark, rows
from chilopod.stability.tracing.ending import Ending

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Point2(ReadOnlyArrays):
    """A bifurcation point on a curve.

    Attributes
    ----------
    values
        Values of both parameters, shape (2,).
    error_bound
        Bounds on the errors of both, shape (2,), at right angles to the curve (in units of the box).
    orbit
        State on the critical orbit at time 0, shape (n,).
    mode
        Unit critical eigenvector, shape (n,), complex for Neimark-Sacker.
    multiplier
        Critical multiplier of the return map.
    multipliers
        All of them, by falling modulus.
    frequency
        Angular frequency (1/s) of the critical mode over the full period, as of a :class:`BifurcationPoint`.
    coefficient, coefficient_error
        Coefficient and coefficient error of the normal form, of the map that a :class:`BifurcationPoint` has it of (of
        two periods at a period doubling): the quadratic one of a fold or a transcritical point, the cubic one of all
        others; None where there is none or it was not asked for.
    """

    values: Array
    error_bound: Array
    orbit: Array
    mode: ComplexArray
    multiplier: complex
    multipliers: ComplexArray
    frequency: float
    coefficient: float | None = None
    coefficient_error: float | None = None


@dataclass(frozen=True)
class Curve2(Result):
    """A curve of bifurcation points.

    Attributes
    ----------
    kind
        Kind of the bifurcation along it.
    points
        In order.
    special
        Points of codimension two, in order.
    endings
        Reasons for which it ends, at its first point and at its last.
    reasons
        Details where it was lost, else empty: one for each end.
    periods
        Number of periods that its orbits take.
    """

    kind: Kind
    points: tuple[Point2, ...]
    special: tuple[Codimension2, ...]
    endings: tuple[Ending, Ending]
    reasons: tuple[str, str] = ("", "")
    periods: int = 1

    @property
    def values(self) -> Array:
        """Values of both parameters at all points, shape (points, 2)."""
        return np.array([point.values for point in self.points])

    def _lines(self) -> list[str]:
        (p, q), (p_end, q_end) = self.values[0], self.values[-1]
        special = [
            (each.kind.label, *(bounded(*pair) for pair in zip(each.values, each.error_bound, strict=True)))
            for each in self.special
        ]
        ends = [" ".join((end.sentence, why)).strip() for end, why in zip(self.endings, self.reasons, strict=True)]
        return [
            f"Curve2: {self.kind.label}, {len(self.points)} points",
            f"from ({p:.9g}, {q:.9g}): {ends[0]}",
            f"to ({p_end:.9g}, {q_end:.9g}): {ends[1]}",
            *(["points of codimension two:", *rows(special)] if special else ["points of codimension two: none"]),
        ]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the curve over both parameters, points of codimension two marked, on axes of matplotlib or on new
        ones."""
        axes = axes_for(axes)
        axes.plot(*self.values.T, label=self.kind.label)
        mark(axes, [(each.kind.label, each.values[0], each.values[1]) for each in self.special])
        axes.set(xlabel="first parameter", ylabel="second parameter")
        return axes

    def to_dataset(self) -> xr.Dataset:
        """The points as a dataset over ``point``, in their order along the curve, those of codimension two among them;
        ``special`` is empty at ordinary ones. Multipliers are those of the return map."""
        points, scale = list[Point2 | Codimension2](self.points), np.ptp(self.values, axis=0)
        scale[scale == 0.0] = 1.0
        for each in self.special:
            places = np.array([point.values for point in points]) / scale
            away = np.linalg.norm(places - each.values / scale, axis=1)
            detours = away[:-1] + away[1:] - np.linalg.norm(np.diff(places, axis=0), axis=1)
            points.insert(int(detours.argmin()) + 1 if detours.size else 1, each)
        kinds = {"special": [getattr(point, "kind", None) for point in points]}
        names = ("values", "error_bound", "coefficient", "coefficient_error", "frequency", "orbit", "multipliers")
        first, last = (end.label for end in self.endings)
        return dataset("point", columns(points, *names) | kinds, kind=self.kind.label, first_end=first, last_end=last)
