"""The orbit at a multiplier +1 of the return map H, where H - 1 is singular, from the orbits beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.crossing_points.place import SAFETY, Course, Sample
from chilopod.stability.orbits.orbit import Orbit
from chilopod.stability.problem.returns import ReturnMap
from chilopod.stability.spectrum.eigenvalues import spectrum
from chilopod.stability.unit_circle.critical import Crossing
from chilopod.stability.unit_circle.spectra import Event

Array = NDArray[np.float64]

_AROUND = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0]) / 4.0  # of the reach
_ASIDE = np.arange(1.0, 9.0) / 4.0  # where there is room on one side only
_REACH, _LEAST_REACH = 0.02, 1e-5  # of the course
_SHORTER = 0.25
_AGREES = 1e-6  # of the reach, between two interpolations
_AT_HOME = 0.01  # of the reach, from where the root finder saw the point

Bounded = Callable[[float, Array, Array, ReturnMap], Orbit]
"""The orbit at a place, with error bounds: from what was interpolated, how far that may be off, and a return map
near."""


@dataclass(frozen=True)
class Regular(ReadOnlyArrays):
    """A singular orbit that was interpolated: its place with an error bound, what samples have as their ``orbit``
    there, and the orbit itself."""

    place: float
    error_bound: float
    sampled: Array
    orbit: Orbit


def past_singular(course: Course, crossing: Crossing, bounded: Bounded) -> Regular | None:
    """Place and orbit at a multiplier +1 of an orbit that is solved for.

    There H - 1 is singular, and Newton's method stops anywhere along the mode where the residual is round-off; so the
    orbit and the determinant of H' - 1 are interpolated from places to both sides where that is not so, or to one side
    at an end. They are taken closer together until interpolations of two orders agree. None where it is not singular,
    or there is no room.
    """
    if crossing.event is not Event.PLUS or crossing.multiplicity > 1 or crossing.collision:
        return None
    best: tuple[float, float, _Interpolation] | None = None
    for nodes, reach in _nodes(course, crossing.value):
        found = _interpolated(course, crossing.value, nodes, reach)
        if found is None:
            continue
        # Where they do not agree, the root finder's value is not to be thrown away.
        far = 0.0 if found.converged else abs(found.place)
        bound = reach * (found.between + far)
        if best is None or bound < best[0]:
            best = bound, reach, found
        if found.converged:
            break
    if best is None:
        return None
    bound, reach, found = best
    place = crossing.value + reach * found.place
    orbit = bounded(place, found.orbit, found.orbit_error, found.beside.image)
    spec = spectrum(orbit.image)
    distances = np.abs(spec.values - 1.0)
    uncertain = float(sum(error * np.delete(distances, i).prod() for i, error in enumerate(spec.error)))
    return Regular(place, bound + SAFETY * uncertain * reach / found.slope, found.orbit, orbit)


def _nodes(course: Course, place: float) -> Iterator[tuple[Array, float]]:
    """Nodes around a place, or on the side where there is more room, and the reach that they are parts of."""
    below, above = place - course.low, course.high - place
    aside = _ASIDE if above > below else -_ASIDE
    for nodes, room in ((_AROUND, min(below, above)), (aside, max(below, above) / _ASIDE[-1])):
        reach = min(_REACH * course.width, room)
        while reach >= _LEAST_REACH * course.width:
            yield nodes, reach
            reach *= _SHORTER


class _Interpolation:
    """Polynomials through the determinant of H' - 1 and the orbit at all nodes, and at all but the outermost."""

    def __init__(self, beside: Sequence[Sample], nodes: Array, fine: Polynomial, roots: list[float]) -> None:
        # Zero of the determinant and its slope, in units of the reach from where the multiplier was seen.
        self.place, self.between = roots[0], abs(roots[0] - roots[1])
        self.slope = abs(float(fine.deriv()(self.place)))
        columns = np.array([each.orbit for each in beside]).T
        fits = [np.array([_fit(nodes[part], column[part])(self.place) for column in columns]) for part in _parts(nodes)]
        self.orbit: Array = fits[0]
        self.orbit_error: Array = np.abs(fits[0] - fits[1])
        self.beside = beside[int(np.abs(nodes).argmin())]

    @property
    def converged(self) -> bool:
        return self.between <= _AGREES and abs(self.place) <= _AT_HOME


def _interpolated(course: Course, place: float, nodes: Array, reach: float) -> _Interpolation | None:
    try:
        beside = course.at(place + reach * nodes)
    except AnalysisError:
        return None
    # A product over all multipliers stays smooth where the critical one meets another, however close by.
    values = np.array([(spectrum(each.image).values - 1.0).prod().real for each in beside])
    fits = [_fit(nodes[part], values[part]) for part in _parts(nodes)]
    roots = [root for fit in fits if (root := _root_near_zero(fit, nodes)) is not None]
    return _Interpolation(beside, nodes, fits[0], roots) if len(roots) == 2 else None


def _parts(nodes: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """All nodes, and all but the two outermost."""
    return np.ones(nodes.size, dtype=bool), np.abs(nodes) < np.sort(np.abs(nodes))[-2]


def _fit(nodes: Array, values: Array) -> Polynomial:
    return Polynomial.fit(nodes, values, nodes.size - 1)


def _root_near_zero(polynomial: Polynomial, nodes: Array) -> float | None:
    roots = polynomial.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    near = real[np.abs(real) < np.abs(nodes).min()]
    return float(near[np.abs(near).argmin()]) if near.size else None
