"""Orbits within a step along a branch."""

from __future__ import annotations

import copy
import functools

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.stability.branches.branch_points import Anchor, BranchPoint, OnCurve, Returned
from chilopod.stability.branches.curve import Curve
from chilopod.stability.orbit_blocks import Blocks, orbit_blocks
from chilopod.stability.orbits.orbit import Orbit
from chilopod.stability.tracing.equations import Plane
from chilopod.stability.tracing.step import Step
from chilopod.stability.tracing.tolerances import AWAY
from chilopod.stability.tracing.tracer import Parts

SAME_ORBIT = 1e-6
"""Distance between states of one orbit, relative to the sizes of the states."""

_FURTHER = 0.1  # factor on the precision of orbits within a step
_OFF = 1e-5  # error of the cubic, relative to the step, above which an orbit is corrected
_LEAVING = 0.05  # distance from a branch point at which the search begins, relative to the step
_SIDE = 1e-3  # distance from a crossing at which the curve's sides are compared, relative to the step


class Within(Parts[Anchor, OnCurve, Returned]):
    """Orbits within a step, each corrected once."""

    def __init__(self, curve: Curve, step: Step[Anchor, OnCurve]) -> None:
        closer = copy.copy(curve)  # places of events depend on these orbits more than on the ends
        closer.precision *= _FURTHER
        super().__init__(closer, step)
        self.curve = curve
        self.low = _LEAVING * step.size if step.start.leaving else 0.0

    @functools.cached_property
    def blocks(self) -> Blocks:
        """Blocks of the return map along the step, from the spatial symmetries of its last orbit."""
        curve, last = self.curve, self.step.end.last
        section = curve.section_at(last.orbit, last.value, last.period)
        image = curve.image(last.orbit, last.value, section, with_error=True)
        # On a branch orbits are not corrected to the last digit.
        orbit = Orbit(last.orbit, image, SAME_ORBIT * curve.units(last.orbit.size)[:-1])
        return orbit_blocks(curve.system(last.value), orbit)[0]

    def sides(self, place: float) -> tuple[Step[Anchor, OnCurve], Step[Anchor, OnCurve]]:
        """Parts of the step that end just before and just after a place."""
        beside = _SIDE * self.step.size
        return self.at(max(place - beside, self.low)), self.at(min(place + beside, self.step.size))

    def jacobian(self, place: float) -> Array:
        """Derivative of the return map at a place."""
        if place > 0.0:
            return self.at(place).found.image.jacobian
        matrix = self.step.start.matrix[:-1, :-1]
        sizes = self.curve.units(len(matrix))[:-1]
        return np.asarray((matrix + np.eye(len(matrix))) * sizes[:, None] / sizes)

    def near_jacobian(self, place: float) -> Array:
        """Derivative at a place, by the cubic through the ends of the step if that is close enough."""
        step, start = self.step, self.step.start
        if place in (0.0, step.size):
            return self.jacobian(place)
        moved, matrix = step.between(place)
        matrix[-1] = start.tangent
        x, value = self.curve.reached(start.last, moved)
        try:
            image = self.curve.image(x, value, start.section)
            off = np.append((image.state - x) / self.curve.units(x.size)[:-1], 0.0)
            if float(np.abs(np.linalg.solve(matrix, off)).max()) <= _OFF * step.size:
                return image.jacobian
        except (AnalysisError, np.linalg.LinAlgError):  # a return may magnify the error of the cubic
            pass
        exact = self.at(place)
        if not float(np.linalg.norm(exact.moved - moved)) <= AWAY * step.size:
            raise AnalysisError("the curve is not smooth within the step", field="step")
        return exact.found.image.jacobian

    def ordinary(self, place: float) -> BranchPoint:
        """An ordinary point of the branch."""
        plane = Plane(self.step.start.tangent, place)
        part = self.curve.step(self.step.start, self.step.between(place), plane, bounded=True)
        return self.curve.arrived(part).end.last
