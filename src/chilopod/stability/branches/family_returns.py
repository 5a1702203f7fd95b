"""Returns of a family of systems, in units, with their derivative with respect to the parameter."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.stability.problem.arguments import Budget, system_of
from chilopod.stability.problem.capabilities import Family, SystemLike, returns_per_period
from chilopod.stability.problem.returns import (
    ReturnMap,
    Section,
    in_parts,
    return_map,
    returned_states,
    section_at,
    whole_period,
)

PRECISION = 1e-12
"""Default precision of orbits, relative to the sizes of the states; the accuracy of the flow limits it."""

_PARAMETER_STEP = 1e-6  # step of differences, in units of the scale
_STEEP = 10.0  # approximate change of the return over that of the parameter, in units, beyond which steps shrink
_KEPT = 8  # cached systems: making one may cost more than a flow


@dataclass(eq=False)
class FamilyReturns:
    """Return maps of the systems of a family along a curve."""

    family: Family
    scale: float  # scale of the parameter
    sizes: Array | None = None  # sizes of the states; None: their own units
    _: KW_ONLY
    between: tuple[float, float] = (-np.inf, np.inf)  # interval of the values at which the family is called
    periods: int = 1  # number of the systems' periods in one period of the orbits
    symmetric: bool = False  # True for orbits with the systems' symmetry in time
    precision: float = PRECISION  # precision of orbits, relative to the sizes of the states
    budget: Budget = field(default_factory=lambda: Budget(math.inf))
    steepness: float = field(default=1.0, init=False)  # of the return map over the parameter, in units
    _known: dict[float, SystemLike] = field(default_factory=dict, init=False)
    _dimension: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self.box = np.array([self.between])

    def system(self, value: float) -> SystemLike:
        """System under study, over the periods of the orbits."""
        if value not in self._known:
            own = system_of(self.family, value)
            self._dimension = self._dimension or own.dimension
            if own.dimension != self._dimension:
                allowed = f"{self._dimension} states"
                raise AnalysisError("changes its dimension", field="family", value=value, allowed=allowed)
            if len(self._known) >= _KEPT:
                self._known.pop(next(iter(self._known)))
            whole = self.symmetric or (own.symmetry is None and self.periods == 1)
            self._known[value] = own if whole else whole_period(own, self.periods)
        return self._known[value]

    def units(self, count: int) -> Array:
        """Sizes of the states and scale of the parameter, shape (n+1,)."""
        units = np.full(count + 1, self.scale, dtype=np.float64)
        units[:-1] = 1.0 if self.sizes is None else self.sizes
        return units

    def image(self, x: Array, value: float, section: Section | None = None, with_error: bool = False) -> ReturnMap:
        """The return map and its derivative."""
        system = self.system(value)
        self.budget.take()
        if section is None and system.period is None:
            section = section_at(system, x, self.sizes)
        return return_map(system, x, with_error, section)

    def section_at(self, x: Array, value: float, period: float | None) -> Section | None:
        """Section across the motion at a state, if returns need one; by default the system guesses the full period."""
        system = self.system(value)
        duration = None if period is None else period / returns_per_period(system)
        return section_at(system, x, self.sizes, duration)

    def mapped(self, x: Array, value: float, section: Section | None) -> Array:
        """H at a state."""
        self.budget.take()
        return np.asarray(returned_states(self.system(value), x[None], section)[0])

    def noise(self, x: Array, value: float, section: Section | None) -> float:
        """Difference of two computations of a return, in units: the part of a residual due to the flow's error."""
        image, system = self.image(x, value, section), self.system(value)
        other = in_parts(system, x, image.duration)
        return float(np.abs((other - image.state) / self.units(x.size)[:-1]).max())

    def by_parameter(self, x: Array, value: float, section: Section | None, mapped: Array | None = None) -> Array:
        """dH/dp at a state, per scale, shape (n,), from H there if it is known.

        The parabola through a third value is needed near branch points, where the matrix of a curve is nearly singular.
        """
        units, steepness = self.units(x.size)[:-1], self.steepness
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
            found = float(np.abs(difference / units).max())
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
