"""Orbits within a step along a branch, and descriptions of its special points: kind, place and error bound."""

from __future__ import annotations

import contextlib
import copy
import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyfit
from scipy.optimize import brentq

from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.stability.branches.branch_points import Anchor, BranchPoint, OnCurve, Returned
from chilopod.stability.branches.curve import Curve
from chilopod.stability.continuation.equations import Plane, Step
from chilopod.stability.continuation.tolerances import AWAY
from chilopod.stability.continuation.tracer import Parts
from chilopod.stability.crossing_place import SAFETY, Course, Sample, orbit_blocks, past_singular, place_error
from chilopod.stability.orbits.orbit import Orbit, searched_orbit, with_bounds
from chilopod.stability.points import Kind, described
from chilopod.stability.returns import ReturnMap, Section
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.spectra import CircleEvent, Crossing, distances

CLOSE = 1e-9  # precision of a located point along the curve, relative to the step
SAME_ORBIT = 1e-6  # distance between states of one orbit, relative to the sizes of the states
_FURTHER = 0.1  # factor on the precision of orbits within a step
_OFF = 1e-5  # error of the cubic, relative to the step, above which an orbit is corrected
_CORRECTED = 3  # returns to correct the cubic, by the matrix between those of the ends, before the corrector does
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
        section, image = step.start.section, step.found.image
        first = self.jacobian(0.0), np.nan if section is None else section.duration
        self._near = {0.0: first, step.size: (image.jacobian, image.duration)}

    @functools.cached_property
    def blocks(self) -> tuple[Block | None, ...]:
        """Blocks of the return map along the step, from the spatial symmetries of its last orbit."""
        curve, last = self.curve, self.step.end.last
        section = curve.section_at(last.orbit, last.value, last.period)
        image = curve.image(last.orbit, last.value, section, with_error=True)
        # On a branch orbits are not corrected to the last digit.
        return orbit_blocks(curve.system(last.value), Orbit(last.orbit, image, SAME_ORBIT * curve.sizes))[0]

    def sides(self, place: float) -> tuple[Step[Anchor, OnCurve], Step[Anchor, OnCurve]]:
        """Parts of the step that end just before and just after a place."""
        beside = _SIDE * self.step.size
        return self.at(max(place - beside, self.low)), self.at(min(place + beside, self.step.size))

    def jacobian(self, place: float) -> Array:
        """Derivative of the return map at a place."""
        if place > 0.0:
            return self.at(place).found.image.jacobian
        sizes, matrix = self.curve.sizes, self.step.start.matrix[:-1, :-1] + np.eye(self.curve.sizes.size)
        return np.asarray(matrix * sizes[:, None] / sizes)

    def near(self, place: float) -> tuple[Array, float]:
        """Derivative and duration of the return at a place, computed once, by the cubic through the step's ends."""
        if place not in self._near:
            image = self._near_image(place)
            self._near[place] = image.jacobian, image.duration
        return self._near[place]

    def _near_image(self, place: float) -> ReturnMap:
        step, start = self.step, self.step.start
        guess, matrix = step.between(place)
        matrix[-1], moved = start.tangent, guess
        try:
            for _ in range(_CORRECTED):
                x, value = self.curve.reached(start.last, moved)
                image = self.curve.image(x, value, start.section)
                correction = np.linalg.solve(matrix, np.append((image.state - x) / self.curve.sizes, 0.0))
                if float(np.abs(correction).max()) <= _OFF * step.size:
                    return image
                moved = moved - correction
                if not float(np.linalg.norm(moved - guess)) <= AWAY * step.size:
                    break
        except (AnalysisError, np.linalg.LinAlgError):  # a return may magnify the error of the cubic
            pass
        exact = self.at(place)
        if not float(np.linalg.norm(exact.moved - guess)) <= AWAY * step.size:
            raise AnalysisError("the curve is not smooth within the step", field="step")
        return exact.found.image

    def ordinary(self, place: float) -> BranchPoint:
        start = self.step.start
        part = self.curve.step(start, self.step.between(place), Plane(start.tangent, place), bounded=True)
        return self.curve.arrived(part).end.last


_CRITICAL = 1e-5  # distance from the circle within which a multiplier is critical at a located point
_AROUND = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0]) / 40.0  # places round a turn, relative to the step
_BESIDE = 1e-3  # distance from a point at which rates of change are computed, relative to the step


@dataclass(frozen=True)
class EventPlace:
    """Place of an event within a step: the crossing, with the distance along the step's first tangent as its value, its
    block of the return map, and flags for a curve that turns back and for another curve that meets it."""

    crossing: Crossing
    block: Block | None = None
    fold: bool = False
    branching: bool = False


def fold_within(within: Within, a: float, b: float) -> EventPlace:
    """Place where the tangent's component along the parameter vanishes; it changes sign between two places."""

    def along(place: float) -> float:
        return float((within.at(place) if place else within.step.start).tangent[-1])

    place = float(brentq(along, a, b, xtol=CLOSE * within.step.size))
    return EventPlace(Crossing(place, (place, place), CircleEvent.PLUS, 1, 1, 1.0 + 0.0j), fold=True)


def special_point(within: Within, place: EventPlace) -> BranchPoint | None:
    """The special point at a place within a step; None without a critical multiplier there."""
    curve, crossing, block = within.curve, place.crossing, place.block
    start, low, high = within.step.start.last, within.low, within.step.size

    def samples(places: Array) -> list[Sample]:
        return [Sample(at, within.at(at).moved, within.at(at).found.image) for at in places.tolist()]

    course = Course(samples, low, high, high - low, _BESIDE * (high - low))
    point, regular = curve.arrived(within.at(crossing.value)).end.last, None
    if place.branching:  # its own tangent is any combination of those of both branches
        before, after = within.sides(crossing.value)
        between = before.tangent + after.tangent
        point = replace(point, tangent=between / np.linalg.norm(between))
    value = point.value
    if not place.fold and (block is None or block.trivial):

        def bounded_at(_: float, moved: Array, error: Array, duration: float) -> Orbit:
            x, value = curve.reached(start, moved)
            return with_bounds(curve.system(value), x, duration, error[:-1] * curve.sizes)

        regular = past_singular(course, crossing, bounded_at)
    if regular is None or crossing.multiplicity > 1:
        orbit = _orbit(within, point, place)
        along = place_error(course, crossing, orbit.image)
        if regular is not None and not regular.error_bound < along:
            regular = None
    if regular is not None:
        orbit, along, value = regular.orbit, regular.error_bound, curve.reached(start, regular.sampled)[1]
    if place.branching and crossing.change == 0:
        value, error = _turn(within, crossing.value)
    else:
        error = _value_error(within, place, along, orbit.image)
        if not place.fold:
            # The orbits beside a singular one, from which it is interpolated, are the less certain the closer they are.
            reach = regular.reach if regular else _BESIDE * (high - low)
            beside = max(crossing.value - reach, low), min(crossing.value + reach, high)
            error += max(_noise(curve, within.at(each), within.step.start.section) for each in beside)
            error += curve.scale * float(regular.sampled_error[-1]) if regular else 0.0
    kind = Kind.FOLD if place.fold else None
    found = described(curve.system(value), (value, error), orbit, crossing, block, kind=kind)
    if place.branching and found.kind is Kind.TRANSCRITICAL:
        before, after = within.sides(crossing.value)
        if float(before.tangent[-1] * after.tangent[-1]) < 0.0:  # a fold near another branch, which it does not meet
            return special_point(within, fold_within(within, before.size, after.size))
    away = distances(np.array(found.multiplier), crossing.event)
    if (away > _CRITICAL and not crossing.collision) or np.isinf(found.error_bound):
        return None
    bound = curve.multipliers(orbit.image)[1]
    point = replace(point, value=value, orbit=orbit.state, error_bound=bound)
    return replace(point, special=found.kind, bifurcation=found)


def _orbit(within: Within, point: BranchPoint, place: EventPlace) -> Orbit:
    """The orbit with its error bounds, if it is a simple solution."""
    curve, x = within.curve, point.orbit
    system = curve.system(point.value)
    section = curve.section_at(x, point.value, point.period)
    if place.block is not None and not place.block.trivial:
        # Where H - 1 is singular the corrected orbit may have moved along a mode without its symmetry.
        trivial = (block for block in within.blocks if block is not None and block.trivial)
        x = sum((block.basis @ (block.dual @ x) for block in trivial), 0.0 * x)
    if not place.fold:
        with contextlib.suppress(AnalysisError):
            orbit = searched_orbit(system, x, section=section)
            if float((np.abs(orbit.state - x) / curve.sizes).max()) <= SAME_ORBIT:
                return orbit
    return Orbit(x, curve.image(x, point.value, section, with_error=True), np.zeros(x.size))


def _value_error(within: Within, place: EventPlace, along: float, image: ReturnMap) -> float:
    """Bound on the error of the parameter: that of the place times its rate, or at a fold from the orbit's equation."""
    curve, low, high, at = within.curve, within.low, within.step.size, within.at
    beside = _BESIDE * (high - low)
    middle = min(max(place.crossing.value, low + beside), high - beside)
    left, here, right = (at(middle + s * beside) for s in (-1.0, 0.0, 1.0))
    values = [curve.scale * part.moved[-1] for part in (left, here, right)]
    rate = abs(values[2] - values[0]) / (2.0 * beside)
    bend = abs(values[2] - 2.0 * values[1] + values[0]) / beside**2
    if not place.fold:
        return float(rate * along + bend * along**2)
    return float(0.5 * bend * along**2) + _fold_error(curve, at(place.crossing.value), image)


def _turn(within: Within, at: float) -> tuple[float, float]:
    """The parameter where a curve turns at a branch point, by polynomials through places round it, and its error.

    Two curves that miss each other leave a term c/u of the distance u: a u^2 + c/u has a fold at 3 (c/2)^(2/3) a^(1/3).
    """
    parts = [within.at(at + each * within.step.size) for each in _AROUND]
    curve, section, values = within.curve, within.step.start.section, np.array([part.moved[-1] for part in parts])
    images = [curve.image(part.found.x, part.found.value, section, with_error=True) for part in parts]
    noise = SAFETY * max(_fold_error(curve, part, image) for part, image in zip(parts, images, strict=True))
    turned, missed, least = [], 0.0, float(np.abs(_AROUND).min()) * noise / curve.scale
    for used in (slice(None), slice(1, -1)):
        miss, *rest = polyfit(_AROUND[used], _AROUND[used] * values[used], values[used].size - 1).tolist()
        through = Polynomial(rest)
        turns = through.deriv().roots()
        turned.append(float(through(turns[np.abs(turns).argmin()].real)))
        missed = max(missed, 3.0 * math.cbrt((0.5 * (abs(miss) + least)) ** 2 * abs(rest[2])))
    error = curve.scale * (abs(turned[0] - turned[1]) + SAFETY * missed) + noise
    return within.step.start.last.value + curve.scale * turned[0], error


def _noise(curve: Curve, here: Step[Anchor, OnCurve], section: Section | None) -> float:
    """Error of the parameter of a regular orbit at a place along the curve, due to the errors of its return."""
    image = curve.image(here.found.x, here.found.value, section, with_error=True)
    try:
        share = np.abs(np.linalg.inv(here.matrix)[-1, :-1])
    except np.linalg.LinAlgError:
        return np.inf
    return curve.scale * SAFETY * float(share @ _off(curve, here.found, section, image))


def _off(curve: Curve, found: OnCurve, section: Section | None, image: ReturnMap) -> Array:
    """Distance by which an orbit may miss its return, in units of the states, shape (n,)."""
    x, sizes = found.x, curve.sizes
    wrong = np.broadcast_to(image.error, image.jacobian.shape)
    off = (np.abs(image.state - x) + wrong @ np.maximum(np.abs(x), sizes)) / sizes
    return np.asarray(off + curve.noise(x, found.value, section))


def _fold_error(curve: Curve, here: Step[Anchor, OnCurve], image: ReturnMap) -> float:
    """Error of the parameter at a fold, from left . (H - x) = 0: to first order x does not enter."""
    matrix = here.matrix[:-1]
    left = np.linalg.svd(matrix[:, :-1])[0][:, -1]
    off = float(np.abs(left) @ _off(curve, here.found, here.start.section, image))
    slope = abs(float(left @ matrix[:, -1]))
    return curve.scale * SAFETY * off / slope if slope > 0.0 else np.inf
