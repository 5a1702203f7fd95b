"""Error bounds of the places at which multipliers cross, along a coordinate in which orbits are smooth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.problem.returns import ReturnMap
from chilopod.stability.spectrum import errors
from chilopod.stability.spectrum.eigenvalues import Spectrum, return_multipliers, spectrum
from chilopod.stability.unit_circle.critical import Crossing
from chilopod.stability.unit_circle.spectra import TARGETS, Event, distances

Array = NDArray[np.float64]

SAFETY = 1.5
"""Factor on the error of a multiplier, for that of its rate of change."""

_TOUCH_STEP = 1e-3
_EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Sample(ReadOnlyArrays):
    """The return map on the orbit at a value of the parameter."""

    value: float
    orbit: Array
    image: ReturnMap

    @property
    def off_plus_one(self) -> float:
        """Distance of the return map's multipliers from +1, that along the motion left aside."""
        return float(np.abs(return_multipliers(self.image) - 1.0).min(initial=np.inf))

    @property
    def beside_plus_one(self) -> float:
        """Signed distance of the nearest real multiplier from +1; NaN if a pair is nearer."""
        off = return_multipliers(self.image) - 1.0
        nearest = complex(off[np.abs(off).argmin()]) if off.size else np.nan
        return nearest.real if nearest.imag == 0.0 else np.nan

    def passes(self, other: Sample) -> bool:
        """True if the multiplier nearest +1 is on its other side in another sample."""
        return self.beside_plus_one * other.beside_plus_one < 0.0


@dataclass(frozen=True)
class Course:
    """Orbits along a coordinate in which they are smooth: the parameter, or the way along a curve.

    Attributes
    ----------
    at
        ``at(places)``: samples with the coordinate as their ``value``; ``orbit`` may hold more than the state.
    low, high, width
        Ends of the course, and width of what is looked at, which may be more.
    beside
        Distance from a place at which rates of change are taken.
    """

    at: Callable[[Array], Sequence[Sample]]
    low: float
    high: float
    width: float
    beside: float

    def jacobians(self, place: float) -> tuple[Array, Array, float]:
        """Derivatives of the return map to both sides of a place, and how far these are apart."""
        a, b = max(place - self.beside, self.low), min(place + self.beside, self.high)
        before, after = self.at(np.array([a, b]))
        return before.image.jacobian, after.image.jacobian, b - a


def critical_multipliers(spec: Spectrum, crossing: Crossing) -> NDArray[np.intp]:
    """Indices of the multipliers that are critical at a crossing, the nearest first."""
    if crossing.event is not Event.PAIR:
        return np.argsort(distances(spec.values, crossing.event), kind="stable")[: crossing.multiplicity]
    # Of both of a pair, the one asked for first.
    nu = crossing.multiplier
    distance = np.minimum(np.abs(spec.values - nu), np.abs(spec.values - nu.conjugate()))
    return np.lexsort((np.abs(spec.values - nu), np.round(distance, 12)))[: crossing.multiplicity]


def place_error(course: Course, crossing: Crossing, image: ReturnMap) -> float:
    """Bound on the error of the place of a crossing on a course, from the return map there with its error bounds: that
    of the critical multipliers over their rate of change."""
    width = 0.5 * (crossing.bracket[1] - crossing.bracket[0])
    try:
        if crossing.collision:
            return width + _collision_error(course, crossing, image)
        spec = spectrum(image)
        critical = critical_multipliers(spec, crossing)
        uncertain = float((spec.error[critical] + distances(spec.values[critical], crossing.event)).max())
        slope = _slope(course, crossing, image)
        along = SAFETY * uncertain / slope if slope > 0.0 else np.inf
        if crossing.change == 0 and crossing.multiplicity <= 2:
            along = min(along, _touch_error(course, crossing, uncertain))
    except AnalysisError:
        return np.inf
    return width + along


def _slope(course: Course, crossing: Crossing, image: ReturnMap) -> float:
    """d nu = left^H dH' right, which holds however close another multiplier is; of several, the slowest."""
    before, after, apart = course.jacobians(crossing.value)
    between = spectrum(replace(image, jacobian=0.5 * (before + after), error=0.0))
    critical = critical_multipliers(between, crossing)
    left, right = between.left[:, critical], between.right[:, critical]
    if crossing.event is Event.PAIR:
        nu = between.values[critical]
        moved = np.einsum("ik,ij,jk->k", left.conj(), after - before, right)
        return float(np.abs((nu.conj() * moved).real / np.abs(nu)).min()) / apart
    change = left.conj().T @ (after - before) @ right
    return float(np.abs(np.linalg.eigvals(change)).min()) / apart if np.isfinite(change).all() else 0.0


def _touch_error(course: Course, crossing: Crossing, uncertain: float) -> float:
    """Error of the place where a multiplier touches the circle and turns back: its distance is a parabola."""
    step = _TOUCH_STEP * course.width
    away = []
    for each in course.at(np.clip(crossing.value + step * np.array([-1.0, 0.0, 1.0]), course.low, course.high)):
        values = np.linalg.eigvals(each.image.jacobian)
        away.append(float(np.abs(values[np.abs(values - crossing.multiplier).argmin()])))
    # The step is left out of the root: its square may be no number.
    bend = abs(away[0] - 2.0 * away[1] + away[2])
    return SAFETY * step * float(np.sqrt(2.0 * uncertain / bend)) if bend > 0.0 else np.inf


def _collision_error(course: Course, crossing: Crossing, image: ReturnMap) -> float:
    """Error of the place where two multipliers meet. They move as a square root, but their product does not: det(H' -
    nu), or the squared difference of nu + 1/nu of two pairs, by how uncertain and how steep it is."""
    matrix = image.jacobian
    error = np.broadcast_to(image.error, matrix.shape) + 4.0 * _EPSILON * np.abs(matrix)
    here = _collision(matrix, crossing)
    moved = max(abs(_collision(other, crossing) - here) for other in errors.disturbed(matrix, error))
    before, after, apart = course.jacobians(crossing.value)
    slope = abs(_collision(after, crossing) - _collision(before, crossing)) / apart
    # All of eight draws are less than a third of the root mean square in one case of 50 000.
    uncertain = 3.0 * moved + abs(here)
    return SAFETY * uncertain / slope if slope > 0.0 else np.inf


def _collision(matrix: Array, crossing: Crossing) -> float:
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    if crossing.event is not Event.PAIR:
        near = np.argsort(distances(values, crossing.event))[:2]
        return float(np.prod(values[near] - TARGETS[crossing.event]).real)
    sums = values + 1.0 / values
    critical = crossing.multiplier + 1.0 / crossing.multiplier
    a, *others = sums[np.argsort(np.abs(sums - critical))]
    # Both of a pair have the same sum: the next pair is two further on.
    return float(((a - others[1]) ** 2).real)
