"""Descriptions of special points on a branch: what happens there, and how sure its place is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.branches.branch_points import BranchPoint, Step
from chilopod.stability.branches.curve import Curve
from chilopod.stability.crossing_points.description import described
from chilopod.stability.crossing_points.place import SAFETY, Course, Sample, place_error
from chilopod.stability.crossing_points.singular import past_singular
from chilopod.stability.normal_forms.center_manifold import CriticalOrbit
from chilopod.stability.normal_forms.normal_form import NormalForm, normal_form
from chilopod.stability.orbit_blocks import Blocks, orbit_blocks
from chilopod.stability.orbits.orbit import Orbit, bounded, find_orbit
from chilopod.stability.points import Kind
from chilopod.stability.problem.returns import ReturnMap, returned_states
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.critical import Crossing
from chilopod.stability.unit_circle.spectra import TARGETS, Event

Array = NDArray[np.float64]

_CRITICAL = 1e-5  # distance from the circle within which a multiplier is the critical one of a located point
_BESIDE = 1e-3  # of a step: how far beside a point rates of change are taken
_SAME = 1e-6  # of the sizes of the states


@dataclass(frozen=True)
class Place:
    """Where something happens within a step: what passes the circle, with the way along the step's first tangent as its
    value, in which block of the return map; whether the curve turns back there, and whether another one meets it."""

    crossing: Crossing
    block: Block | None = None
    fold: bool = False
    branching: bool = False


def special_point(
    curve: Curve, at: Callable[[float], Step], place: Place, between: tuple[float, float], blocks: Blocks
) -> BranchPoint | None:
    """The special point at a place within a step; None if no multiplier is critical there after all.

    Parameters
    ----------
    curve
        Curve of the step.
    at
        Parts of the step, by where they end.
    place
        Place within the step, with what happens there.
    between
        Places within which the step may be cut.
    blocks
        Blocks of the return map along the step.
    """
    crossing, block = place.crossing, place.block
    low, high = between
    course = Course(
        lambda places: [_sample(at, each) for each in places], low, high, high - low, _BESIDE * (high - low)
    )
    point, regular = at(crossing.value).end.last, None
    if not place.fold and (block is None or block.trivial):

        def bounded_at(_: float, moved: Array, error: Array, image: ReturnMap) -> Orbit:
            x, value = _reached(curve, at(high), moved)
            return bounded(curve.system(value), x, image, error=error[:-1] * curve.units(x.size)[:-1])

        regular = past_singular(course, crossing, bounded_at)
    if regular is None:
        orbit = _orbit(curve, point, place, blocks)
        along = place_error(course, crossing, orbit.image)
    else:
        orbit, along = regular.orbit, regular.error_bound
        point = replace(point, value=_reached(curve, at(high), regular.sampled)[1])
    found = described(
        curve.system(point.value),
        (point.value, _value_error(curve, at, place, between, along, orbit.image)),
        orbit,
        crossing,
        block,
        lambda critical, uncertainty: _form(curve, point, orbit, critical, uncertainty),
        kind=Kind.FOLD if place.fold else None,
    )
    nu = found.multiplier
    off = abs(abs(nu) - 1.0) if crossing.event is Event.PAIR else abs(nu - TARGETS[crossing.event])
    if off > _CRITICAL and not crossing.collision:
        return None
    bound = curve.multipliers(orbit.image)[1]
    return replace(point, orbit=orbit.state, special=found.kind, error_bound=bound, bifurcation=found)


def blocks_along(curve: Curve, step: Step) -> Blocks:
    """The blocks that the spatial symmetries of the orbits on a step make of their return maps."""
    last = step.end.last
    system = curve.system(last.value)
    image = curve.image(last.orbit, last.value, curve.section(last), with_error=True)
    # On a branch orbits are not solved for to the last digit.
    return orbit_blocks(system, Orbit(last.orbit, image, _SAME * curve.units(last.orbit.size)[:-1]))[0]


def _sample(at: Callable[[float], Step], place: float) -> Sample:
    """An orbit on a step, as far as the step moved."""
    part = at(float(place))
    return Sample(float(place), part.moved, part.image)


def _reached(curve: Curve, step: Step, moved: Array) -> tuple[Array, float]:
    """State and parameter so far, in units, from where a step starts."""
    start = step.start.last
    total = curve.units(start.orbit.size) * moved
    return start.orbit + total[:-1], start.value + float(total[-1])


def _orbit(curve: Curve, point: BranchPoint, place: Place, blocks: Blocks) -> Orbit:
    """The orbit with its error bounds, where it is a simple solution."""
    system, section, x = curve.system(point.value), curve.section(point), point.orbit
    if place.block is not None and not place.block.trivial:
        # Solved for where H - 1 is singular it may have strayed along a mode that has not its symmetry.
        x = sum((block.basis @ (block.dual @ x) for block in blocks if block is not None and block.trivial), 0.0 * x)
    if not place.fold:
        try:
            orbit = find_orbit(system, x, section=section)
        except AnalysisError:
            orbit = None
        if orbit is not None and float((np.abs(orbit.state - x) / curve.units(x.size)[:-1]).max()) <= _SAME:
            return orbit
    return Orbit(x, curve.image(x, point.value, section, with_error=True), np.zeros(x.size))


def _value_error(
    curve: Curve,
    at: Callable[[float], Step],
    place: Place,
    between: tuple[float, float],
    along: float,
    image: ReturnMap,
) -> float:
    """Bound on the error of the parameter: that of the place, times the parameter's rate of change; at a fold, where
    the parameter rests, that of the orbit's equation."""
    low, high = between
    beside = _BESIDE * (high - low)
    middle = min(max(place.crossing.value, low + beside), high - beside)
    left, here, right = (at(middle + s * beside) for s in (-1.0, 0.0, 1.0))
    values = [curve.scale * part.moved[-1] for part in (left, here, right)]
    rate = abs(values[2] - values[0]) / (2.0 * beside)
    bend = abs(values[2] - 2.0 * values[1] + values[0]) / beside**2
    if not place.fold:
        return float(rate * along + bend * along**2)
    return float(0.5 * bend * along**2) + _fold_error(curve, at(place.crossing.value), image)


def _fold_error(curve: Curve, here: Step, image: ReturnMap) -> float:
    """left . (H - x) = 0 fixes the parameter at a fold to first order; x itself enters in second order only."""
    x = here.end.last.orbit
    sizes = curve.units(x.size)[:-1]
    matrix = here.matrix[:-1]
    left = np.linalg.svd(matrix[:, :-1])[0][:, -1]
    wrong = image.error if isinstance(image.error, np.ndarray) else np.full((x.size, x.size), image.error)
    off = (np.abs(image.state - x) + wrong @ np.maximum(np.abs(x), sizes)) / sizes
    slope = abs(float(left @ matrix[:, -1]))
    return curve.scale * SAFETY * float(np.abs(left) @ off) / slope if slope > 0.0 else np.inf


def _form(
    curve: Curve, point: BranchPoint, orbit: Orbit, critical: CriticalOrbit, uncertainty: float
) -> NormalForm | None:
    """The normal form; None where the map cannot be evaluated as it would take."""
    system = curve.system(point.value)

    def mapped(states: Array) -> Array:
        curve.budget.take(len(states))
        return returned_states(system, states, orbit.section)

    try:
        return normal_form(mapped, critical, uncertainty=uncertainty, scale=curve.units(critical.state.size)[:-1])
    except (AnalysisError, ValueError, np.linalg.LinAlgError):
        return None
