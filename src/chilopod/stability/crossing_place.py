"""Crossings in the blocks of an orbit's symmetries, and their places, with error bounds.

:func:`orbit_blocks` splits a return map by the symmetries of the orbit, and :func:`crossings_in` searches one of the
blocks. A :class:`Course` then gives orbits along a coordinate in which they are smooth, each with its return map H as a
:class:`Sample`. :func:`place_error` bounds the error of a crossing's place: the error of its critical multipliers over
their rate of change along the course. At a multiplier +1 the orbit itself is uncertain, because H - 1 is singular;
there :func:`past_singular` interpolates place and orbit from samples beside it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.flows.deadline import SpentError
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.interface import SystemLike, spatial_symmetries
from chilopod.stability.orbits.orbit import Orbit
from chilopod.stability.returns import ReturnMap
from chilopod.stability.spectrum import EPSILON, Spectrum, disturbed, return_multipliers, spectrum
from chilopod.stability.symmetry.groups import centraliser, commutes, finite_group, isotropy
from chilopod.stability.symmetry.isotypic import Block, isotypic
from chilopod.stability.unit_circle.crossings import Crossings
from chilopod.stability.unit_circle.spectra import TARGETS, CircleEvent, Crossing, Matrices, distances

SAFETY = 1.5  # factor on the error of a multiplier, for that of its rate of change

_NEAR = 1e3  # largest distance of known sides of a crossing, relative to the usual one
_TOUCH_STEP = 1e-3  # distance from a touch at which the multiplier is computed, relative to the course
_ASIDE = np.arange(1.0, 9.0) / 4.0  # nodes of the interpolation of a singular orbit on one side, in units of the reach
_AROUND = np.concatenate([-_ASIDE[3::-1], _ASIDE[:4]])  # with room on both sides
_REACH, _LEAST_REACH = 0.02, 1e-5  # first and least reach, relative to the course
_SHORTER = 0.25  # ratio of a reach to the one before
_AGREES = 1e-6  # largest difference of two interpolations, relative to the reach
_TOGETHER = 0.1  # distance of a multiplier from +1, relative to the next one's, at which both cross together
_AT_HOME = 0.01  # largest distance from the root finder's place, relative to the reach


def orbit_blocks(system: SystemLike, orbit: Orbit) -> tuple[tuple[Block | None, ...], tuple[str, ...]]:
    """Blocks of an orbit's symmetries, None for the whole return map, and a sentence if it has none of the system's."""
    generators = spatial_symmetries(system)
    if not generators:
        return (None,), ()
    group = finite_group(np.stack(generators))
    if system.symmetry is not None:
        group = centraliser(group, system.symmetry)
    group = isotropy(group, orbit.state, np.nan_to_num(orbit.error))
    if group.order == 1:
        return (None,), ("the orbit has none of the spatial symmetries",)
    if commutes(group, orbit.image.jacobian, orbit.image.error) > 1.0:
        return (None,), ("the return map does not have the spatial symmetries: they are not used",)
    return isotypic(group), ()


def crossings_in(block: Block | None, matrices: Matrices, search: Callable[[Matrices], Crossings]) -> Crossings:
    """Crossings in a block of return maps, with multiplicities in the whole map."""
    if block is None:
        return search(matrices)

    def reduced(values: Array) -> tuple[Array, Array]:
        whole, errors = matrices(values)
        return block.reduced(whole), block.reduced_error(whole, errors) if errors.ndim == 3 else errors

    found, times = search(reduced), block.repeats
    crossings = tuple(
        replace(each, multiplicity=times * each.multiplicity, change=times * each.change) for each in found.crossings
    )
    return replace(found, crossings=crossings)


@dataclass(frozen=True, eq=False)
class Sample(ReadOnlyArrays):
    """The return map on the orbit at a value of the parameter."""

    value: float
    orbit: Array
    image: ReturnMap
    events: tuple[float, ...] = ()  # numbers of passages of the events in a period

    @functools.cached_property
    def _off(self) -> ComplexArray:
        """Differences of the return map's multipliers from +1, without the one along the motion."""
        return return_multipliers(self.image) - 1.0

    @functools.cached_property
    def _nearest(self) -> complex:
        """Least of the differences."""
        return complex(self._off[np.abs(self._off).argmin()]) if self._off.size else complex(np.inf)

    @functools.cached_property
    def side(self) -> float:
        """Distance of the nearest multiplier from +1, relative to it if large, with a sign that changes where a real
        one passes +1: continuous along a branch, and opposite on another one that crosses it near by."""
        beyond = int(((self._off.imag == 0.0) & (self._off.real > 0.0)).sum())
        return (-1.0) ** beyond * float((np.abs(self._off) / np.maximum(np.abs(self._off + 1.0), 1.0)).min(initial=1.0))

    @property
    def off_plus_one(self) -> float:
        """Distance of the nearest multiplier from +1."""
        return abs(self._nearest)

    @property
    def beside_plus_one(self) -> float:
        """Signed distance of the nearest real multiplier from +1; NaN if a pair is nearer."""
        return self._nearest.real if self._nearest.imag == 0.0 and np.isfinite(self._nearest) else np.nan

    def passes(self, other: Sample) -> bool:
        """True if the multiplier nearest +1 is on the other side of it in another sample."""
        return self.beside_plus_one * other.beside_plus_one < 0.0


@dataclass(frozen=True)
class Course:
    """Orbits along a coordinate in which they are smooth: the parameter, or the arclength of a curve."""

    at: Callable[[Array], Sequence[Sample]]  # samples at places, their values; orbits may hold more than states
    low: float
    high: float
    width: float  # width of the whole search, which may exceed that from low to high
    beside: float  # distance from a place at which rates of change are computed

    def jacobians(self, crossing: Crossing) -> tuple[Array, Array, float]:
        """Derivatives of the return map on both sides of a crossing, at known places if near, and their distance."""
        place, (a, b) = crossing.value, crossing.around
        if not (a < place < b and self.beside <= b - a <= _NEAR * self.beside):
            a, b = max(place - self.beside, self.low), min(place + self.beside, self.high)
        before, after = self.at(np.array([a, b]))
        return before.image.jacobian, after.image.jacobian, b - a


def critical_multipliers(spec: Spectrum, crossing: Crossing) -> NDArray[np.intp]:
    """Indices of the multipliers that are critical at a crossing, the nearest first."""
    if crossing.event is not CircleEvent.PAIR:
        return np.argsort(distances(spec.values, crossing.event), kind="stable")[: crossing.multiplicity]
    # The requested one of a pair comes first.
    nu = crossing.multiplier
    distance = np.minimum(np.abs(spec.values - nu), np.abs(spec.values - nu.conjugate()))
    if crossing.multiplicity > 2:  # pairs of any frequency that cross together
        distance = distances(spec.values, crossing.event)
    return np.lexsort((np.abs(spec.values - nu), np.round(distance, 12)))[: crossing.multiplicity]


def place_error(course: Course, crossing: Crossing, image: ReturnMap) -> float:
    """Bound on the error of the place of a crossing: error of the critical multipliers over their rate of change."""
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
    """d nu = left^H dH' right, which holds also near other multipliers; the slowest of several."""
    before, after, apart = course.jacobians(crossing)
    between = spectrum(replace(image, jacobian=0.5 * (before + after), error=0.0))
    critical = critical_multipliers(between, crossing)
    left, right = between.left[:, critical], between.right[:, critical]
    if crossing.event is CircleEvent.PAIR:
        nu = between.values[critical]
        moved = np.einsum("ik,ij,jk->k", left.conj(), after - before, right)
        return float(np.abs((nu.conj() * moved).real / np.abs(nu)).min()) / apart
    change = left.conj().T @ (after - before) @ right
    return float(np.abs(np.linalg.eigvals(change)).min()) / apart if np.isfinite(change).all() else 0.0


def _touch_error(course: Course, crossing: Crossing, uncertain: float) -> float:
    """Error of the place where a multiplier touches the circle and turns back: its distance is a parabola."""
    step = max(_TOUCH_STEP * course.width, course.beside)
    around = np.clip(crossing.value + step * np.array([-1.0, 0.0, 1.0]), course.low, course.high)
    spectra = [np.linalg.eigvals(each.image.jacobian) for each in course.at(around)]
    away = [float(np.abs(values[np.abs(values - crossing.multiplier).argmin()])) for values in spectra]
    # The step stays outside the root, as its square may underflow.
    bend = abs(away[0] - 2.0 * away[1] + away[2])
    return SAFETY * step * float(np.sqrt(2.0 * uncertain / bend)) if bend > 0.0 else np.inf


def _collision_error(course: Course, crossing: Crossing, image: ReturnMap) -> float:
    """Error of the place where two multipliers meet. They move as a square root, but their product is smooth: det(H' -
    nu), or the squared difference of nu + 1/nu of two pairs, gives the error by its own over its slope."""
    matrix = image.jacobian
    error = np.broadcast_to(image.error, matrix.shape) + 4.0 * EPSILON * np.abs(matrix)
    here = _collision(matrix, crossing)
    moved = max(abs(_collision(other, crossing) - here) for other in disturbed(matrix, error))
    before, after, apart = course.jacobians(crossing)
    slope = abs(_collision(after, crossing) - _collision(before, crossing)) / apart
    # All of eight draws are less than a third of the root mean square in one case of 50 000.
    return SAFETY * (3.0 * moved + abs(here)) / slope if slope > 0.0 else np.inf


def _collision(matrix: Array, crossing: Crossing) -> float:
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    if crossing.event is not CircleEvent.PAIR:
        near = np.argsort(distances(values, crossing.event))[:2]
        return float(np.prod(values[near] - TARGETS[crossing.event]).real)
    sums = values + 1.0 / values
    critical = crossing.multiplier + 1.0 / crossing.multiplier
    a, *others = sums[np.argsort(np.abs(sums - critical))]
    # Both of a pair have the same sum, so the next pair is two places on.
    return float(((a - others[1]) ** 2).real)


Bounded = Callable[[float, Array, Array, float], Orbit]
"""The orbit at a place, with error bounds, from an interpolated one with its error, and the duration of a return."""


class Regular(NamedTuple):
    """An interpolated singular orbit: place, error bound, ``orbit`` of a sample there with its error, distance of the
    samples, and the orbit itself."""

    place: float
    error_bound: float
    sampled: Array
    sampled_error: Array
    reach: float
    orbit: Orbit


def past_singular(course: Course, crossing: Crossing, bounded: Bounded) -> Regular | None:
    """Place and orbit at a multiplier +1, where H - 1 is singular and Newton's method stops anywhere along the mode.

    The orbit and a test function are interpolated from regular places on both sides, or on one side at an end, ever
    closer together until interpolations of two orders agree. The test function of one multiplier, or of two that meet,
    is det(H' - 1); that of several that cross together, as a symmetry makes them do, is their mean distance from +1.
    None if the orbit is regular, there is no room, or another multiplier is as near +1.
    """
    count, smooth = crossing.multiplicity, _is_smooth(crossing)
    if crossing.event is not CircleEvent.PLUS or not (smooth or abs(crossing.change) == count):
        return None
    tried: list[tuple[float, float, _Interpolation]] = []
    for nodes, reach in _nodes(course, crossing.value):
        found = _interpolated(course, crossing, nodes, reach)
        if found is not None:
            # Without agreement the root finder's value remains.
            far = 0.0 if found.converged else abs(found.place)
            tried.append((reach * (found.between + far), reach, found))
            if found.converged:
                break
    if not tried:
        return None
    bound, reach, found = min(tried, key=lambda each: each[0])
    place = crossing.value + reach * found.place
    orbit = bounded(place, found.orbit, found.orbit_error, found.beside.image.duration)
    spec = spectrum(orbit.image)
    distances = np.abs(spec.values - 1.0)
    order = distances.argsort()
    distances, errors = distances[order], spec.error[order]
    if distances[count - 1] > _TOGETHER * distances[count:].min(initial=np.inf):
        return None  # the polynomials do not separate two crossings
    errors += distances  # rounding at the places, larger than at the zero where another one is near
    uncertain = float(errors.prod() if smooth else errors[:count].max())
    bound += SAFETY * uncertain * reach / found.slope
    return Regular(place, bound, found.orbit, found.orbit_error, reach, orbit)


def _nodes(course: Course, place: float) -> Iterator[tuple[Array, float]]:
    """Nodes around a place, or on the side with more room, and their reach."""
    below, above = place - course.low, course.high - place
    aside = _ASIDE if above > below else -_ASIDE
    for nodes, room in ((_AROUND, min(below, above)), (aside, max(below, above) / _ASIDE[-1])):
        reach = min(_REACH * course.width, room)
        while reach >= _LEAST_REACH * course.width:
            yield nodes, reach
            reach *= _SHORTER


class _Interpolation(NamedTuple):
    """Place and orbit by polynomials through the test function and the orbit, in units of the reach."""

    place: float  # zero of the test function
    between: float  # its distance from the zero of the polynomial without the outermost two places
    slope: float  # slope of the test function
    orbit: Array  # orbit at the zero
    orbit_error: Array
    beside: Sample

    @property
    def converged(self) -> bool:
        """True if the polynomials agree, near the root finder's place."""
        return self.between <= _AGREES and abs(self.place) <= _AT_HOME


def _interpolated(course: Course, crossing: Crossing, nodes: Array, reach: float) -> _Interpolation | None:
    try:
        beside = course.at(crossing.value + reach * nodes)
    except (AnalysisError, SpentError):
        return None
    values = np.array([_off_plus_one(spectrum(each.image).values, crossing) for each in beside])
    orbits = np.array([each.orbit for each in beside])
    inner = np.abs(nodes) < np.sort(np.abs(nodes))[-2]
    fine, coarse = (Polynomial.fit(x, y, x.size - 1) for x, y in ((nodes, values), (nodes[inner], values[inner])))
    zero, other = _root_near_zero(fine, nodes), _root_near_zero(coarse, nodes)
    if zero is None or other is None:
        return None
    orbit = through(nodes, orbits, zero)
    off = np.abs(orbit - through(nodes[inner], orbits[inner], zero))
    near = beside[int(np.abs(nodes).argmin())]
    return _Interpolation(zero, abs(zero - other), abs(float(fine.deriv()(zero))), orbit, off, near)


def _is_smooth(crossing: Crossing) -> bool:
    """True if det(H' - 1) passes zero where multipliers do, smoothly also where the critical one meets another."""
    return crossing.multiplicity == 1 or (crossing.collision and crossing.multiplicity == 2)


def _off_plus_one(values: ComplexArray, crossing: Crossing) -> float:
    """Test function of multipliers that pass +1 together, smooth along a course."""
    off = values - 1.0
    if _is_smooth(crossing):
        return float(off.prod().real)
    return float(off[np.abs(off).argsort()[: crossing.multiplicity]].mean().real)


def _root_near_zero(polynomial: Polynomial, nodes: Array) -> float | None:
    roots = polynomial.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    near = real[np.abs(real) < np.abs(nodes).min()]
    return float(near[np.abs(near).argmin()]) if near.size else None


def through(nodes: Array, values: Array, place: float) -> Array:
    """The polynomial through the rows of ``values`` at some nodes, at another place."""
    at = nodes.tolist()
    weights = [math.prod((place - w) / (v - w) for w in at if w != v) for v in at]
    return np.asarray(np.array(weights) @ values)
