"""Points along a branch of periodic orbits, and anchors of steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.returns import ReturnMap, Section
from chilopod.stability.spectrum.errors import stable_within
from chilopod.stability.tracing.step import Before


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
    units
        Sizes of the states and scale of the parameter, the units of the tangent, shape (n+1,).
    special
        Kind of the bifurcation here; None at ordinary points.
    period
        Full period of the orbit; None if not computed.
    error_bound
        Bound on the absolute error of the multipliers that are not small (below 0.5, and below the largest), from the
        errors of the flow and of the orbit.
    bifurcation
        Bifurcation point with bound, mode, multiplier and normal form; None at ordinary points.
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
        """True if all multipliers lie inside the unit circle by more than the error bound, False if one lies outside by
        more, else None, as at most special points."""
        return stable_within(self.multipliers, self.error_bound)


@dataclass(frozen=True)
class Anchor(ReadOnlyArrays):
    """A point from which steps start: see :class:`chilopod.stability.tracing.step.Anchor`."""

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
