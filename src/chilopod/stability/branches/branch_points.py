"""Points along a branch of periodic orbits, and the steps between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.returns import ReturnMap, Section
from chilopod.stability.spectrum.errors import stable_within

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class BranchPoint(ReadOnlyArrays):
    """A periodic orbit on a branch.

    Attributes
    ----------
    value
        Value of the parameter.
    orbit
        State at time 0, shape (n,).
    multipliers
        Multipliers of the full period, by falling modulus, shape (n,), or (n-1,) without the trivial one where the
        system does not depend on time.
    tangent
        Unit tangent of the curve, shape (n+1,): state, then parameter, in ``units``.
    special
        Kind of the bifurcation here; None at ordinary points.
    units
        Sizes of the states and scale of the parameter that the tangent is in, shape (n+1,); None: the states' own.
    period
        The full period of the orbit; None where it was not asked for.
    error_bound
        Bound on the absolute error of the multipliers that are not small (below 0.5, and below the largest): by the
        error of the flow there, and by that of the orbit.
    bifurcation
        Bifurcation point with bound, mode, multiplier and normal form; None at ordinary points.
    """

    value: float
    orbit: Array
    multipliers: ComplexArray
    tangent: Array
    special: Kind | None = None
    units: Array | None = None
    period: float | None = None
    error_bound: float = 0.0
    bifurcation: BifurcationPoint | None = None

    @property
    def stable(self) -> bool | None:
        """True if all multipliers lie inside the unit circle: True or False by more than the error bound, None where it
        leaves that undecided, as at most special points."""
        return stable_within(self.multipliers, self.error_bound)


@dataclass(frozen=True)
class Anchor(ReadOnlyArrays):
    """Where a step starts.

    Attributes
    ----------
    last
        The point it starts from.
    matrix
        Jacobian of [H - x; tangent . step] there with respect to state and parameter in units, shape (n+1, n+1).
    before
        The point before it with its matrix, if there is one.
    section
        Section on which returns end during the step, for a system without a period of its own.
    leaving
        True if the point is one where branches meet: the matrix is then one taken ahead.
    """

    last: BranchPoint
    matrix: Array
    before: tuple[BranchPoint, Array] | None = None
    section: Section | None = None
    leaving: bool = False


@dataclass(frozen=True)
class Step(ReadOnlyArrays):
    """A step that was taken.

    Attributes
    ----------
    start, end
        Anchors where it started and where the next one starts.
    size
        Its length along the first tangent.
    moved
        From start to end, in units, shape (n+1,).
    tangent, matrix
        Tangent and matrix of the curve at the end, on the section of the start; the matrix has the tangent as its last
        row.
    image
        The return map at the end, on the section of the start.
    corrections
        Number of corrections that were needed.
    missed
        Distance from where it was predicted to end, in units.
    """

    start: Anchor
    end: Anchor
    size: float
    moved: Array
    tangent: Array
    matrix: Array
    image: ReturnMap
    corrections: int
    missed: float

    def between(self, place: float) -> tuple[Array, Array]:
        """Displacement from the start at a place (along the first tangent), by the cubic through both ends along their
        tangents, and the matrix there by the straight line."""
        t, size = place / self.size, self.size
        first = self.start.last.tangent
        last = self.tangent / float(first @ self.tangent)
        moved = (
            size * t * (1.0 - t) ** 2 * first + t * t * (3.0 - 2.0 * t) * self.moved - size * t * t * (1.0 - t) * last
        )
        matrix = self.start.matrix + t * (self.matrix - self.start.matrix)
        matrix[-1] = first
        return moved, matrix
