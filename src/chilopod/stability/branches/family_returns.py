"""Returns of a family of systems over a parameter, in units, with their derivative by the parameter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.problem.budget import Budget, UserCode
from chilopod.stability.problem.capabilities import Family, FlowsEach, SystemLike, returns_per_period
from chilopod.stability.problem.returns import (
    CUTS,
    ReturnMap,
    Section,
    carried,
    return_map,
    returned_states,
    section_at,
    turned,
    whole_period,
)

Array = NDArray[np.float64]

_PARAMETER_STEP = 1e-6  # of the difference, in units of the scale
_STEEP = 10.0  # times as far, in units, the difference moves the return, about
_RETRIES, _STEEPER = 1, 100.0  # with a smaller difference, and how much smaller where there is no return
_KEPT = 8  # systems: making one may cost more than a flow


class FamilyReturns:
    """Return maps of the systems of a family, with the scale of the parameter and the sizes of the states along a curve
    (None: their own units), of orbits that take a number of periods, or have the systems' symmetry in time.

    Where systems flow each (see :class:`chilopod.stability.FlowsEach`), the derivative with respect to the
    parameter costs next to nothing on two cores. The family is asked for values of an interval at most.
    """

    def __init__(
        self,
        family: Family,
        scale: float,
        sizes: Array | None = None,
        *,
        between: tuple[float, float] = (-np.inf, np.inf),
        periods: int = 1,
        symmetric: bool = False,
        budget: Budget | None = None,
    ) -> None:
        self._family = family
        self.scale = scale
        self.sizes = sizes
        self.between = between
        self.periods = periods
        self.symmetric = symmetric
        self.budget = Budget(math.inf) if budget is None else budget
        self.steepness = 1.0  # of the return map over the parameter, in units
        self._known: dict[float, tuple[SystemLike, SystemLike]] = {}
        self._each: dict[type, bool] = {}
        self._dimension = 0

    def system(self, value: float) -> SystemLike:
        """System under study: over the full period, or as many as the orbits take."""
        return self._systems(value)[1]

    def _systems(self, value: float) -> tuple[SystemLike, SystemLike]:
        """The family's system, and what is studied of it."""
        known = self._known.get(value)
        if known is None:
            with UserCode("family", value):
                own = self._family(value)
            self._dimension = self._dimension or own.dimension
            if own.dimension != self._dimension:
                raise AnalysisError(
                    "changes its dimension", field="family", value=value, allowed=f"{self._dimension} states"
                )
            whole = self.symmetric or (own.symmetry is None and self.periods == 1)
            known = own, own if whole else whole_period(own, self.periods)
            if len(self._known) >= _KEPT:
                self._known.clear()
            self._known[value] = known
        return known

    def units(self, count: int) -> Array:
        """Sizes of the states and scale of the parameter, shape (n+1,)."""
        return np.append(np.ones(count) if self.sizes is None else self.sizes, self.scale)

    def image(self, x: Array, value: float, section: Section | None = None, with_error: bool = False) -> ReturnMap:
        """The return map and its derivative."""
        system = self.system(value)
        self.budget.take()
        with UserCode("flow", value):
            if section is None and system.period is None:
                section = section_at(system, x, self.sizes)
            return return_map(system, x, with_error, section)

    def section_at(self, x: Array, value: float, period: float | None) -> Section | None:
        """Across the motion in a state, where returns need one; the full period is a guess of the system if None."""
        system = self.system(value)
        duration = None if period is None else period / returns_per_period(system)
        return section_at(system, x, self.sizes, duration)

    def parameter_derivative(self, x: Array, value: float, section: Section | None = None) -> Array:
        """dH/dp at a state, per scale, shape (n,)."""
        mapped, beside = self.mapped(x, value, section)
        return self.difference(x, value, section, mapped, beside)

    def mapped(self, x: Array, value: float, section: Section | None) -> tuple[Array, Array | None]:
        """H at a state, and at a neighbouring value of the parameter if that costs no time."""
        self.budget.take()
        own, system = self._systems(value)
        with UserCode("flow", value):
            period = own.period
            if section is None and period is not None and not self.symmetric and self.periods == 1:
                beside = (
                    self._systems(value + self._parameter_step(value, self.steepness))[0]
                    if self._flows_each(own)
                    else own
                )
                same = beside.period == period
                if self._flows_each(own) and self._flows_each(beside):
                    both: Sequence[FlowsEach] = [own, beside]
                    mapped, moved = own.flow_each(both, np.array([x, x]), 0.0, period)
                    return (mapped, moved) if same else (mapped, None)
            return returned_states(system, x[None], section)[0], None

    def noise(self, x: Array, value: float, section: Section | None) -> float:
        """How far apart two computations of a return end, in units: what the flow's error leaves of a residual."""
        image, system = self.image(x, value, section), self.system(value)
        duration, passing = image.period / image.returns, x[None]
        times = [part * duration for part in CUTS] + [duration]
        with UserCode("flow", value):
            for a, b in zip(times, times[1:], strict=False):
                passing = carried(system, passing, a, b)
        return float(np.abs((turned(system, passing)[0] - image.state) / self.units(x.size)[:-1]).max())

    def _flows_each(self, system: SystemLike) -> TypeGuard[FlowsEach]:
        """True if a system flows each; asked once for each class, for the answer takes longer than some flows."""
        kind = type(system)
        if kind not in self._each:
            self._each[kind] = isinstance(system, FlowsEach)
        return self._each[kind]

    def _parameter_step(self, value: float, steepness: float) -> float:
        """A small change of the parameter that stays within the interval, as the numbers are that differ by it."""
        step = _PARAMETER_STEP * self.scale / max(1.0, steepness / _STEEP)
        step = max(step, 8.0 * float(np.spacing(abs(value))))
        return (value + step) - value if value + step <= self.between[1] else (value - step) - value

    def difference(self, x: Array, value: float, section: Section | None, mapped: Array, beside: Array | None) -> Array:
        """dH/dp per scale, shape (n,), from H at a state, and at a neighbouring value where that is known."""
        units, steepness = self.units(x.size)[:-1], self.steepness
        for last in (*[False] * _RETRIES, True):
            step = self._parameter_step(value, steepness)
            try:
                if beside is None:
                    self.budget.take()
                    with UserCode("flow", value + step):
                        beside = returned_states(self.system(value + step), x[None], section)[0]
            except AnalysisError:
                if last:
                    raise
                steepness *= _STEEPER
                continue
            difference: Array = (beside - mapped) / (step / self.scale)
            found = float(np.abs(difference / units).max())
            # A return that magnifies bends within less of the parameter.
            if last or not 2.0 * max(_STEEP, steepness) < found < np.inf:
                break
            steepness, beside = found, None
        return difference
