"""Points along a branch of periodic orbits, anchors of steps, and their matrices and tangents."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.capabilities import SystemLike
from chilopod.stability.problem.returns import ReturnMap, Section
from chilopod.stability.spectrum.eigenvalues import stable_within
from chilopod.stability.symmetry.groups import symmetric_basis
from chilopod.stability.tracing.equations import Before


@dataclass(frozen=True, eq=False)
class BranchPoint(ReadOnlyArrays):
    """A periodic orbit on a branch.

    Attributes
    ----------
    value, orbit
        Value of the parameter, and state at time 0, shape (n,).
    multipliers
        Multipliers of the full period, by falling modulus, shape (n,), or (n-1,) for a system without a period.
    tangent
        Unit tangent of the curve, shape (n+1,): state, then parameter, in ``units``.
    units
        Sizes of the states and scale of the parameter, the units of the tangent, shape (n+1,).
    special, bifurcation
        Kind of the bifurcation here, and its point with bound, mode, multiplier and normal form; None at ordinary ones.
    period
        Full period of the orbit; None if not computed.
    error_bound
        Bound on the absolute error of the multipliers that are not small (below 0.5, and below the largest).
    periods
        Number of the systems' periods in one period of the orbit.
    """

    value: float
    orbit: Array
    multipliers: ComplexArray
    tangent: Array
    units: Array
    special: Kind | None = None
    period: float | None = None
    error_bound: float = 0.0
    bifurcation: BifurcationPoint | None = None
    periods: int = 1

    @property
    def stable(self) -> bool | None:
        """True if all multipliers lie in the unit circle by more than the bound, False if one lies outside, or None."""
        return stable_within(self.multipliers, self.error_bound)


@dataclass(frozen=True, eq=False)
class Anchor(ReadOnlyArrays):
    """A point from which steps start: see :class:`chilopod.stability.tracing.equations.Anchor`."""

    last: BranchPoint  # the point
    # Jacobian of [H - x; tangent . step] with respect to state and parameter in units, shape (n+1, n+1).
    matrix: Array
    before: Before | None = None  # previous point in coordinates of this one
    # Section of returns during the step, for a system without a period of its own.
    section: Section | None = None
    # Projection onto the states with the orbit's spatial symmetries, shape (n, n); None if there are none.
    space: Array | None = None
    leaving: bool = False  # True at a branch point: the matrix then belongs to a place ahead
    lengthening: float = 0.0  # relative change of the period along the curve

    @property
    def tangent(self) -> Array:
        """Unit tangent."""
        return self.last.tangent

    @property
    def values(self) -> Array:
        """Value of the parameter, shape (1,)."""
        return np.array([self.last.value])


class Returned(NamedTuple):
    """A state, the value of the parameter, and the return of the state."""

    x: Array
    value: float
    mapped: Array


class OnCurve(NamedTuple):
    """An orbit on the curve: state, value of the parameter, return map on the section of the step's start, and the
    error of its derivative, in units, due to the orbit (infinite if not computed)."""

    x: Array
    value: float
    image: ReturnMap
    wrong: float


_UNCERTAIN = 1e-6  # singular value that counts as zero: the error of a difference


def symmetric_space(system: SystemLike, state: Array, sizes: Array, mode: Array | None) -> Array | None:
    """Projection onto the states with the spatial symmetries of an orbit, and of the ``mode`` of a leaving branch if
    given, in units of the states' ``sizes``, shape (n, n); None without symmetries.

    In this space the branch is regular where symmetry-breaking branches leave it (Golubitsky, Stewart & Schaeffer,
    *Singularities and Groups in Bifurcation Theory* II, 1988, section XIII.3).
    """
    x = state if mode is None else state + sizes * mode / np.linalg.norm(mode)
    basis = symmetric_basis(system, x, sizes)
    return None if basis is None else basis @ basis.T


def within_space(space: Array | None, matrix: Array) -> Array:
    """The matrix of a curve, with or without its tangent, restricted to a space of states, a contraction across it."""
    if space is None:
        return matrix
    n = len(space)
    across = np.eye(n) - space
    result = np.array(matrix)
    result[:n] = space @ result[:n]
    result[:n, :n] -= result[:n, :n] @ across + across
    return result


def null_vector(bordered: Array) -> Array:
    """Unit null vector of all but the last row of a matrix, on the side of the last row.

    At a branch point the matrix is singular within its errors, and the shortest solution is used. A return that
    magnifies errs along the magnified direction only, so its largest singular value does not matter.
    """
    n = len(bordered) - 1
    if not np.isfinite(bordered).all():
        raise AnalysisError("the return map is not finite", field="flow")
    least = _UNCERTAIN / max(1.0, float(np.linalg.svd(bordered, compute_uv=False)[0]))
    tangent: Array = np.linalg.lstsq(bordered, np.append(np.zeros(n), 1.0), rcond=least)[0]
    if not tangent.any():
        raise AnalysisError("the curve has no direction here", field="step")
    return tangent / np.linalg.norm(tangent)
