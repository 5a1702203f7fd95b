"""Points along a branch of periodic orbits, anchors of steps, their matrices and tangents; and returns of a family."""

from __future__ import annotations

import functools
import math
from dataclasses import KW_ONLY, dataclass, field
from typing import NamedTuple

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays, read_only
from chilopod.stability import returns
from chilopod.stability.continuation.equations import Before
from chilopod.stability.interface import Family, SystemLike, system_of
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.returns import ReturnMap, Section
from chilopod.stability.spectrum import stable_within
from chilopod.stability.symmetry.groups import symmetric_basis


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
    """A point from which steps start: see :class:`chilopod.stability.continuation.equations.Anchor`."""

    last: BranchPoint  # the point
    matrix: Array  # Jacobian of [H - x; tangent . step] by state and parameter, in units, shape (n+1, n+1)
    before: Before | None = None  # previous point in coordinates of this one
    section: Section | None = None  # section of returns during the step, for a system without a period of its own
    space: Array | None = None  # projection onto the states with the orbit's spatial symmetries, if any, shape (n, n)
    leaving: bool = False  # True at a branch point: the matrix then belongs to a place ahead
    lengthening: float = 0.0  # relative change of the period along the curve
    motion: float = 0.0  # largest motion within a period so far, in units

    @property
    def tangent(self) -> Array:
        return self.last.tangent

    @property
    def values(self) -> Array:
        return read_only(np.array([self.last.value]))


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


def in_fold(matrix: Array, tangent: Array) -> bool:
    """True if a curve turns at a point, within its error: a multiplier is +1. In tiny units of the states the parameter
    hardly changes anywhere."""
    if abs(tangent[-1]) > IN_FOLD:
        return False
    away = np.abs(np.linalg.eigvals(matrix[: tangent.size - 1, :-1])).min()
    return bool(away <= math.sqrt(IN_FOLD))


PRECISION = 1e-12  # default precision of orbits, relative to the sizes of the states; the flow's accuracy limits it
IN_FOLD = 1e-6  # component of a unit tangent along the parameter in a fold, within the start's error
_PARAMETER_STEP = 1e-6  # step of differences, in units of the scale
_STEEP = 10.0  # approximate change of the return over that of the parameter, in units, beyond which steps shrink
_KEPT = 8  # cached systems: making one may cost more than a flow


@dataclass(eq=False)
class FamilyReturns:
    """Return maps of the systems of a family along a curve."""

    family: Family
    scale: float  # scale of the parameter
    _: KW_ONLY
    between: tuple[float, float] = (-np.inf, np.inf)  # interval of the values at which the family is called
    periods: int = 1  # number of the systems' periods in one period of the orbits
    symmetric: bool = False  # True for orbits with the systems' symmetry in time
    precision: float = PRECISION  # precision of orbits, relative to the sizes of the states
    budget: Budget = field(default_factory=lambda: Budget(math.inf))
    sizes: Array = field(init=False)  # sizes of the states, shape (n,), set at the first point
    steepness: float = field(default=1.0, init=False)  # of the return map over the parameter, in units
    _dimension: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self.box = np.array([self.between])
        self._own = functools.lru_cache(_KEPT)(functools.partial(system_of, self.family))

    def system(self, value: float) -> SystemLike:
        """System under study, over the periods of the orbits."""
        own = self._own(value)
        self._dimension = self._dimension or own.dimension
        if own.dimension != self._dimension:
            allowed = f"{self._dimension} states"
            raise AnalysisError("changes its dimension", field="family", value=value, allowed=allowed)
        studied = self.symmetric or (own.symmetry is None and self.periods == 1)
        return own if studied else returns.whole_period(own, self.periods)

    @property
    def units(self) -> Array:
        """Sizes of the states and scale of the parameter, shape (n+1,)."""
        return np.append(self.sizes, self.scale)

    def image(self, x: Array, value: float, section: Section | None = None, with_error: bool = False) -> ReturnMap:
        system = self.system(value)
        self.budget.take()
        return returns.return_map(system, x, with_error, section)

    def section_at(self, x: Array, value: float, period: float | None) -> Section | None:
        """Section across the motion at a state, if returns need one; by default the system guesses the full period."""
        system = self.system(value)
        return returns.section_at(system, x, self.sizes, returns.return_duration(system, period))

    def mapped(self, x: Array, value: float, section: Section | None) -> Array:
        """H at a state."""
        self.budget.take()
        return np.asarray(returns.returned_states(self.system(value), x[None], section)[0])

    def by_parameter(self, x: Array, value: float, section: Section | None, mapped: Array | None = None) -> Array:
        """dH/dp at a state, per scale, shape (n,), from H there if it is known. The parabola through a third value is
        needed near branch points, where the matrix of a curve is nearly singular."""
        steepness = self.steepness
        mapped = self.mapped(x, value, section) if mapped is None else mapped
        for last in (False, True):
            step = max(_PARAMETER_STEP * self.scale / max(1.0, steepness / _STEEP), 8.0 * float(np.spacing(abs(value))))
            step = (value + step) - value if value + step <= self.between[1] else (value - step) - value  # exact
            try:
                beside = self.mapped(x, value + step, section)
            except AnalysisError:
                if last:
                    raise
                steepness *= 100.0
                continue
            difference: Array = (beside - mapped) / (step / self.scale)
            found = float(np.abs(difference / self.sizes).max())
            # A return that magnifies needs a smaller step of the parameter.
            if last or not 2.0 * max(_STEEP, steepness) < found < np.inf:
                break
            steepness = found
        other = (value - step) - value if self.between[0] <= value - step <= self.between[1] else 2.0 * step
        try:
            second = (self.mapped(x, value + other, section) - mapped) / (other / self.scale)
        except AnalysisError:  # an edge of the systems' domain
            return difference
        return (difference * other - second * step) / (other - step)
