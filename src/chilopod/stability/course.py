"""Orbits along a coordinate in which they are smooth, and how sure the places are at which multipliers cross."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.floquet import Spectrum, spectrum
from chilopod.stability.returns import ReturnMap
from chilopod.stability.samples import Sample
from chilopod.stability.unit_circle.crossings import Crossing
from chilopod.stability.unit_circle.spectra import Event

Array = NDArray[np.float64]

SAFETY = 1.5
"""Factor on the error of a multiplier, for that of its rate of change."""

_TOUCH_STEP = 1e-3
_DRAWS = 8
_EPSILON = float(np.finfo(float).eps)

TARGETS = {Event.MINUS: -1.0, Event.PLUS: 1.0}


@dataclass(frozen=True)
class Course:
    """Orbits along a coordinate in which they are smooth: the parameter, or the way along a curve.

    Attributes
    ----------
    at
        ``at(places)``: samples with the coordinate as their ``value``; ``orbit`` may hold more than the state.
    low, high
        Values at which they begin and end.
    width
        Width of what is looked at: from ``low`` to ``high``, or further.
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
        return np.argsort(np.abs(spec.values - TARGETS[crossing.event]), kind="stable")[: crossing.multiplicity]
    # Of both of a pair, the one asked for first.
    nu = crossing.multiplier
    distance = np.minimum(np.abs(spec.values - nu), np.abs(spec.values - nu.conjugate()))
    return np.lexsort((np.abs(spec.values - nu), np.round(distance, 12)))[: crossing.multiplicity]


def place_error(course: Course, crossing: Crossing, image: ReturnMap) -> float:
    """Bound on the error of the place of a crossing: of the critical multipliers over their rate of change.

    Parameters
    ----------
    course
        On which the crossing is.
    crossing
        With its place as ``value``.
    image
        The return map there, with error bounds.
    """
    width = 0.5 * (crossing.bracket[1] - crossing.bracket[0])
    try:
        if crossing.collision:
            return width + _collision_error(course, crossing, image)
        spec = spectrum(image)
        critical = critical_multipliers(spec, crossing)
        nu = spec.values[critical]
        off = np.abs(nu - TARGETS[crossing.event]) if crossing.event is not Event.PAIR else np.abs(np.abs(nu) - 1.0)
        uncertain = float((spec.error[critical] + off).max())
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
    """Of a multiplier that touches the circle and turns back: its distance is a parabola."""
    step = _TOUCH_STEP * course.width
    away = []
    for each in course.at(np.clip(crossing.value + step * np.array([-1.0, 0.0, 1.0]), course.low, course.high)):
        values = np.linalg.eigvals(each.image.jacobian)
        away.append(float(np.abs(values[np.abs(values - crossing.multiplier).argmin()])))
    # The step is left out of the root: its square may be no number.
    bend = abs(away[0] - 2.0 * away[1] + away[2])
    return SAFETY * step * float(np.sqrt(2.0 * uncertain / bend)) if bend > 0.0 else np.inf


def _collision_error(course: Course, crossing: Crossing, image: ReturnMap) -> float:
    """Where two multipliers meet they move as a square root, but their product does not: det(H' - nu), or the squared
    difference of nu + 1/nu of two pairs, by how uncertain and how steep it is."""
    matrix = image.jacobian
    error = np.broadcast_to(image.error, matrix.shape) + 4.0 * _EPSILON * np.abs(matrix)
    random = np.random.default_rng(0)
    here = _collision(matrix, crossing)
    disturbed = [
        _collision(matrix + error * random.choice([-1.0, 1.0], matrix.shape), crossing) - here for _ in range(_DRAWS)
    ]
    before, after, apart = course.jacobians(crossing.value)
    slope = abs(_collision(after, crossing) - _collision(before, crossing)) / apart
    uncertain = 3.0 * float(np.abs(disturbed).max()) + abs(here)
    return SAFETY * uncertain / slope if slope > 0.0 else np.inf


def _collision(matrix: Array, crossing: Crossing) -> float:
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    if crossing.event is not Event.PAIR:
        near = np.argsort(np.abs(values - TARGETS[crossing.event]))[:2]
        return float(np.prod(values[near] - TARGETS[crossing.event]).real)
    sums = values + 1.0 / values
    critical = crossing.multiplier + 1.0 / crossing.multiplier
    a, *others = sums[np.argsort(np.abs(sums - critical))]
    # Both of a pair have the same sum: the next pair is two further on.
    return float(((a - others[1]) ** 2).real)
