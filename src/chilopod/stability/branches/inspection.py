"""Events within a step along a curve of periodic orbits.

The return map is computed at the ends of a step and at five places in between. If polynomials of degree four through
the test functions fit and stay clear of zero, the step has no event; else four places more and polynomials of degree
eight decide. If these do not, the step is searched, on corrected orbits, for all crossings of the unit circle
(:mod:`~chilopod.stability.unit_circle.crossings`).
The guarantee is that of an interpolation: crossings that the places resolve are found however close they lie; an event
confined between two places, which are at most a fifth of a step apart, is missed.

A determinant that changes its sign without a branch point shows that a step landed on another curve. So do one that
was to change it and does not, a multiplier that only touches +1, and orbits that are missing within a step, unless
shorter steps confirm them. A period that jumps within a step shows it too.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.stability.branches.branch_points import Anchor, BranchPoint, OnCurve
from chilopod.stability.branches.curve import Curve
from chilopod.stability.branches.special_points import CLOSE, EventPlace, Within, fold_within, special_point
from chilopod.stability.continuation.equations import Step, predicted
from chilopod.stability.crossing_place import crossings_in
from chilopod.stability.interface import offers
from chilopod.stability.points import ContinuumError
from chilopod.stability.returns import GRAZES, ReturnMap, events_in, jumps_within
from chilopod.stability.spectrum import spectrum
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.crossings import Crossings, SearchStatus, find_crossings
from chilopod.stability.unit_circle.spectra import TARGETS, CircleEvent, Crossing, Matrices, factors
from chilopod.stability.unit_circle.zeros import FEW_PLACES, PLACES, interpolated

_CLEAR = 4.0  # factor on the error of a polynomial for a certain sign
_BUDGET = 400  # corrected orbits within one step
_ERROR = 1e-10  # relative error of the return map's derivative at a corrected orbit
_BRANCHING = 1e-4  # smallest singular value of [H' - 1, dH/dp], in units, at a branch point
_DIP = 0.3  # the same, relative to the larger one at the ends of the step
_CONFIRMING = 1e-3, 1e-2, 0.1, 0.3  # distances from a place at which its sides are compared, relative to the step
_STEADY = 1e-6  # largest value of the parameter, relative to its scale, along a family by energy
_SURE = 3.0  # factor on the error of a multiplier for a certain side of the circle
_FORESEEN = 5e-3  # error of the predicted period, relative to it, that needs no other orbits within the step
_ROUGH = 0.03  # error of a polynomial through the period, relative to its change, that shows a jump
_TELLING = 1e-3  # step, in units, that is short enough to tell a branch from another one near by


class Inspected(NamedTuple):
    """Special points within a step in order, an ordinary one between any two, and a sentence for each undecided one."""

    points: tuple[BranchPoint, ...] = ()
    remarks: tuple[str, ...] = ()


def inspect(curve: Curve, step: Step[Anchor, OnCurve], closely: bool) -> Inspected:
    """Find the events within a step; with ``closely`` also between ends that show none. An AnalysisError or an
    ArithmeticError if the step landed on another curve, or the corrector fails in between."""
    within = Within(curve, step)
    leaving = step.start.leaving
    rising = float(step.start.tangent[-1])
    # A curve that starts at a fold does not find it again.
    turned = not leaving and abs(rising) > CLOSE and rising * float(step.tangent[-1]) < 0.0
    flipped = not leaving and _sign(step.start.matrix) != _sign(step.matrix)
    foreseen = leaving or _sign(predicted(step.start, step.size).matrix) == _sign(step.matrix)
    if not foreseen and not flipped and step.size > _TELLING:
        raise AnalysisError("the step may have landed on another curve", field="step")
    _check_period(within)
    _check_events(within)
    crossed = _crossed_within(within) if closely else _crossed_between_ends(within, turned)
    if not (crossed or turned or flipped):
        return Inspected()
    places, remarks = _places(within, crossed, turned)
    branching = any(place.branching for place in places)
    touches = any(each.crossing.event is CircleEvent.PLUS and each.crossing.change == 0 for each in places)
    if (flipped and not branching) or (touches and not flipped and step.size > _TELLING):
        raise AnalysisError("the step landed on another curve", field="step")
    sure = offers(curve.system(step.found.value), "flow_with_error")
    points: list[BranchPoint] = []
    last = np.inf
    for place in places:
        at, event = place.crossing.value, place.crossing.event
        near = _near(within, at)
        breaking = place.block is not None and not place.block.trivial
        lone = event is CircleEvent.PLUS and not (place.crossing.collision or place.branching or place.fold or breaking)
        if leaving and event is CircleEvent.PLUS and not _confirmed(within, place):
            continue  # the start itself, whose multiplier is critical beside it within its error
        if lone:
            if place.crossing.change == 0:
                remarks += (f"{near}: a multiplier comes to +1 and goes back, and no other orbit is near",)
            elif not any(each.fold for each in places):  # else it is that of the fold, uncertain because it is flat
                remarks += (f"{near}: a multiplier passes +1, but no fold and no other orbit is near",)
            continue
        if sure and not _confirmed(within, place):
            remarks += (f"{near}: {event.sentence} by no more than its error, which does not count",)
            continue
        try:
            point = special_point(within, place)
        except ContinuumError as error:
            remarks += (f"{near}: {error.problem}, so it is no bifurcation point",)
            continue
        if point is None:
            remarks += (f"{near}: {event.sentence}, which the orbit that is found there does not confirm",)
            continue
        if last < at:  # an ordinary point gives the stability between two special ones
            points.append(within.ordinary(0.5 * (last + at)))
        points.append(point)
        last = at
    return Inspected(tuple(points), remarks)


def _near(within: Within, at: float) -> str:
    """Words for a place within a step: the parameter, or the period along a family by energy."""
    start, found = within.step.start, within.at(at).found
    if start.section is not None and by_energy([start.last.value, found.value], within.curve.scale):
        return f"near the period {found.image.period:.9g}"
    return f"near {found.value:.9g}"


def by_energy(values: list[float], scale: float) -> bool:
    """True for a family of conservative orbits, along which the parameter is zero but for rounding."""
    return len(values) > 1 and max(map(abs, values)) <= _STEADY * scale


def _confirmed(within: Within, place: EventPlace) -> bool:
    """True if the critical multiplier changes sides at a place by more than the errors of the multipliers.

    Two that meet at +1 or -1 and leave along the circle, as without damping, may be on any side: the product of their
    distances shows a passage. Beside a branch point a multiplier is critical within its error: rounding may cross.
    """
    crossing = place.crossing
    if crossing.collision or crossing.change == 0:
        return True
    for part in _CONFIRMING:
        beside = part * within.step.size
        sides = max(crossing.value - beside, within.low), min(crossing.value + beside, within.step.size)
        before, after = (_side(within, each, place) for each in sides)
        known = [(a, b) for a, b in zip(before, after, strict=True) if a and b]
        if any(a != b for a, b in known):
            return True
        if before[0] and after[0] and len(known) == len(before):
            return False
    return False


def _side(within: Within, at: float, place: EventPlace) -> tuple[float, ...]:
    """Side of the critical multiplier and, if it is real, sign of the product of all distances; 0 if undecided."""
    curve, step, crossing = within.curve, within.at(at), place.crossing
    (here, value_here, returned, _), section = step.found, within.step.start.section
    units = curve.units

    def off(x: Array, value: float) -> tuple[Array, Array, ReturnMap]:
        image = curve.image(x, value, section, with_error=True)
        spec = spectrum(image)
        index = int(np.abs(spec.values - crossing.multiplier).argmin())
        nu = spec.values[index]
        if crossing.event is CircleEvent.PAIR:
            return np.array([abs(nu) - 1.0]), spec.error[[index]], image
        target = TARGETS[crossing.event]
        distances = np.abs(spec.values - target)
        others = np.array([np.delete(distances, i).prod() for i in range(distances.size)])
        away = np.array([nu.real - target, (spec.values - target).prod().real])
        return away, np.array([spec.error[index], spec.error @ others]), image

    away, error, image = off(here, value_here)
    # The orbit is least certain in the weakest direction of the matrix: the margin is computed again along it.
    wrong = np.abs(image.state - here) + np.broadcast_to(image.error, returned.jacobian.shape) @ units[:-1]
    left, sizes, right = np.linalg.svd(step.matrix)
    if not sizes[-1] > 0.0:
        return (0.0,) * away.size
    shift = units * right[-1] * float(np.abs(left[:-1, -1]) @ (wrong / units[:-1])) / sizes[-1]
    beside, other, _ = off(here + shift[:-1], value_here + float(shift[-1]))
    uncertain = _SURE * (np.maximum(error, other) + np.abs(beside - away))
    return tuple(np.where(np.abs(away) > uncertain, np.sign(away), 0.0).tolist())


def _places(within: Within, crossed: bool, turned: bool) -> tuple[list[EventPlace], tuple[str, ...]]:
    """Places of events within a step, in order: multipliers cross the circle, or the curve turns."""
    step = within.step
    remarks: tuple[str, ...] = ()
    places = []
    for block, found in _searched(within) if crossed else ():
        if found.status in (SearchStatus.BUDGET, SearchStatus.INCOMPLETE):
            remarks += tuple(f"{_near(within, step.size)}: {remark}" for remark in found.remarks)
        places += [_placed(within, each, block) for each in found.crossings if each.value > CLOSE * step.size]
    if turned and not any(place.fold or place.branching for place in places):
        fold = fold_within(within, 0.0, step.size)
        if _branches_meet(within, fold.crossing.value):  # a branch that leaves there, or an uncertain tangent
            fold = replace(fold, crossing=replace(fold.crossing, change=0), fold=False, branching=True)
        places.append(fold)
    return sorted(places, key=lambda place: place.crossing.value), remarks


def _placed(within: Within, crossing: Crossing, block: Block | None) -> EventPlace:
    if crossing.event is not CircleEvent.PLUS:
        return EventPlace(crossing, block)
    before, after = within.sides(crossing.value)
    branching = _branches_meet(within, crossing.value)
    if float(before.tangent[-1] * after.tangent[-1]) < 0.0 and not branching:
        return fold_within(within, before.size, after.size)
    return EventPlace(crossing, block, branching=branching)


def _branches_meet(within: Within, place: float) -> bool:
    """True if other curves pass through a place of a step: there the equations lose a rank that they have elsewhere. In
    a narrow interval of the parameter they may be nearly singular throughout."""
    step = within.step
    here, *ends = (
        float(np.linalg.svd(each[:-1], compute_uv=False)[-1])
        for each in (within.at(place).matrix, step.start.matrix, step.matrix)
    )
    return here <= min(_BRANCHING, _DIP * max(ends))


def _sign(matrix: Array) -> float:
    return float(np.linalg.slogdet(matrix)[0])


def _searched(within: Within) -> list[tuple[Block | None, Crossings]]:
    """All crossings within a step, in every block of the return map."""
    curve, step = within.curve, within.step

    def matrices(places: Array) -> tuple[Array, Array]:
        try:
            return np.array([within.jacobian(place) for place in places.tolist()]), np.full(places.size, _ERROR)
        except AnalysisError as error:
            if step.size > _TELLING:
                raise ArithmeticError("the corrector fails within the step") from error
            raise

    def parameter(place: float) -> float:
        # Where multipliers jump the curve has a kink, which the cubic through the ends of the step does not show.
        with contextlib.suppress(AnalysisError):
            return within.at(place).found.value
        return curve.reached(step.start.last, step.between(place).moved)[1]

    def search(matrices: Matrices) -> Crossings:
        budget = int(min(_BUDGET, curve.budget.left))
        return find_crossings(matrices, within.low, step.size, budget=max(budget, 30), shown=parameter)

    return [(block, crossings_in(block, matrices, search)) for block in within.blocks]


def _check_period(within: Within) -> None:
    """AnalysisError if the period jumps within a step: on its section another orbit may be near by."""
    start = within.step.start
    if start.section is None:
        return
    first, last = start.section.duration, within.step.found.image.duration
    if abs(last - first * (1.0 + start.lengthening * float(np.linalg.norm(within.step.moved)))) <= _FORESEEN * first:
        return
    for parts in (FEW_PLACES, PLACES):
        times = np.array([[within.near(place)[1]] for place in _at(within, parts)])
        if float(interpolated(times, parts)[1][0]) <= _ROUGH * float(np.ptp(times)):
            return
    raise AnalysisError("the period jumps within the step", field="step")


def _check_events(within: Within) -> None:
    """AnalysisError if an event begins or ceases to happen within a step, unless returns are smooth there."""
    low, high, units = within.low, within.step.size, within.curve.sizes

    def seen(place: float) -> tuple[tuple[float, ...], Array]:
        x, value, image, _ = within.at(place).found
        return events_in(within.curve.system(value), x, image.period), image.jacobian * units / units[:, None]

    if (events := seen(high)[0]) and events != seen(low)[0] and jumps_within(seen, low, high):
        raise AnalysisError(GRAZES)


def _at(within: Within, parts: Array) -> list[float]:
    """Places within a step at parts of it from -1 to 1."""
    low, size = within.low, within.step.size
    return np.where(parts == 1.0, size, low + 0.5 * (1.0 + parts) * (size - low)).tolist()


def _crossed_within(within: Within) -> bool:
    """True unless polynomials through the test functions at the places, few or all, stay clear of zero."""
    for parts in (FEW_PLACES, PLACES):
        nu = np.linalg.eigvals(np.array([within.near(place)[0] for place in _at(within, parts)])).astype(np.complex128)
        with np.errstate(all="ignore"):  # test functions, which change sign at the events
            tests = np.stack([factors(nu, event).prod(axis=1).real for event in CircleEvent], axis=1)
        outside = (np.abs(nu) > 1.0).sum(axis=1)
        if not np.isfinite(tests).all() or (outside != outside[0]).any():
            return True
        _, uncertain, fine = interpolated(tests, parts)
        if (np.abs(fine) > _CLEAR * uncertain).all() and (fine[1:] * fine[:-1] > 0.0).all():
            return False
    return True


def _crossed_between_ends(within: Within, turned: bool) -> bool:
    """True if the multipliers at both ends of a step show a crossing of the circle, beside that of a fold."""
    start, end = (np.linalg.eigvals(within.jacobian(place)) for place in (0.0, within.step.size))
    if within.step.start.leaving:
        start, end = (np.delete(nu, int(np.abs(nu - 1.0).argmin())) for nu in (start, end))
    # Number of multipliers beyond -1, beyond +1, and of pairs outside the circle.
    counts = []
    for nu in (start, end):
        real, outside = np.abs(nu.imag) < 1e-9 * np.maximum(1e-3, np.abs(nu)), np.abs(nu) > 1.0
        beyond = (real & (nu.real < -1.0), real & (nu.real > 1.0), ~real & outside & (nu.imag > 0.0))
        counts.append([int(each.sum()) for each in beyond])
    changed = {event for event, a, b in zip(CircleEvent, *counts, strict=True) if a != b}
    return bool(changed - {CircleEvent.PLUS} if turned else changed)
