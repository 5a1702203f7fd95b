"""What a curve of bifurcation points in two parameters consists of, and why it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays, Short
from chilopod.labels import Labelled
from chilopod.notebook import Line, Mark, block, plot, table
from chilopod.stability.codimension_two.codimension2 import Codimension2
from chilopod.stability.points import Kind

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class CurveEnd(Labelled):
    """Why a curve ends where it does; each member's ``sentence`` says it in words."""

    START = "start", "the curve was followed from here, the other way only"
    LEFT_BOX = "left the box", "a parameter reached an end of its interval"
    CLOSED = "closed", "the curve came back to where it started"
    RESONANCE = "resonance", "the two multipliers of the pair meet: here the curve ends indeed"
    ENOUGH_POINTS = "enough points", "as many points as were asked for"
    OUT_OF_BUDGET = "out of budget", "as many return maps as were allowed have been evaluated"
    LOST = "lost", "the step became too small: the curve could not be followed further"


@dataclass(frozen=True)
class Point2(ReadOnlyArrays):
    """A bifurcation point on a curve.

    Attributes
    ----------
    values
        Of both parameters, shape (2,).
    error_bound
        How far both may be off, shape (2,), at right angles to the curve (in units of the box).
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
        Of the normal form, of the map that a :class:`BifurcationPoint` has it of (of two periods at a period doubling):
        the quadratic one of a fold or a transcritical point, the cubic one of all others; None where there is none or
        it was not asked for.
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
class Curve2(Short):
    """A curve of bifurcation points.

    Attributes
    ----------
    kind
        What happens along it.
    points
        In order.
    special
        Points of codimension two, in order.
    endings
        Why it ends, at its first point and at its last.
    reasons
        What was the matter where it was lost, else empty: one for each end.
    """

    kind: Kind
    points: tuple[Point2, ...]
    special: tuple[Codimension2, ...]
    endings: tuple[CurveEnd, CurveEnd]
    reasons: tuple[str, str] = ("", "")

    @property
    def values(self) -> Array:
        """Of both parameters at all points, shape (points, 2)."""
        return np.array([point.values for point in self.points])

    def _repr_html_(self) -> str:
        heading = f"{self.kind.label} in two parameters: {len(self.points)} points"
        picture = plot(
            [Line([(float(first), float(second)) for first, second in self.values])],
            [Mark(float(point.values[0]), float(point.values[1])) for point in self.special],
            x="first parameter",
            y="second parameter",
            alt=heading,
        )
        special = [
            (
                point.kind.label,
                *(f"{value:.10g} ± {off:.1e}" for value, off in zip(point.values, point.error_bound, strict=True)),
            )
            for point in self.special
        ]
        return block(heading, picture, table(("on it", "first", "second"), special) if special else "")
