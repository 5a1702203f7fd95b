"""Events within a step along a curve of periodic orbits.

The return map is looked at in the ends of a step and at nine places in between. Where polynomials of degree eight
through what vanishes at an event fit, and stay clear of zero or pass it once, nothing else happens; elsewhere the step
is searched, on orbits that are solved for, for all crossings of the unit circle
(:mod:`~chilopod.stability.unit_circle.crossings`).
What is guaranteed is that of an interpolation: a course of the multipliers that the places show is followed however
close its crossings lie; one that is confined between two places, which are a sixth of a step apart at most, is not
seen.

A determinant that changes its sign where no branches meet tells of a step that landed on another curve.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.errors import AnalysisError
from chilopod.stability.branches.branch_points import BranchPoint, Step
from chilopod.stability.branches.curve import Curve
from chilopod.stability.branches.special_points import Place, blocks_along, special_point
from chilopod.stability.orbit_blocks import Blocks, block_of, crossings_in
from chilopod.stability.problem.capabilities import flows_with_error
from chilopod.stability.problem.returns import ReturnMap
from chilopod.stability.spectrum.eigenvalues import counts_outside, spectrum
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.critical import Crossing
from chilopod.stability.unit_circle.crossings import Crossings, SearchStatus, find_crossings
from chilopod.stability.unit_circle.interpolation import DEGREE, DENSE, PLACES, interpolated
from chilopod.stability.unit_circle.spectra import TARGETS, Event, Matrices, factors

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_CLEAR = 4.0  # times what a polynomial is uncertain by
_BESIDE = 2  # fine places on either side of a simple zero that need not be clear
_OFF = 1e-5  # of a step: an orbit that the cubic misses by more is solved for
_AWAY = 0.1  # of a step: the curve between its ends is another one
_LEAVING = 0.05  # of a step off a point where branches meet, where the search begins
_BUDGET = 400  # orbits that are solved for within one step
_ERROR = 1e-10  # relative, of the return map's derivative at an orbit that was solved for
_CLOSE = 1e-9  # of a step: how closely a point is located along the curve
_SIDE = 1e-3  # of a step: how far beside a crossing the curve's sides are looked at
_BRANCHING = 1e-4  # smallest singular value of [H' - 1, dH/dp], in units, where branches meet
_CONFIRMING = 1e-3, 1e-2, 0.1, 0.3  # of a step: how far beside a place its sides are told apart
_SURE = 3.0  # times its error: so far from the circle a multiplier is on one side of it
_COMPLEX = 1e-5  # imaginary part from which a multiplier on the circle is one of a pair
_EVENTS = (Event.MINUS, Event.PLUS, Event.PAIR)

Bracket = tuple[Event, float, float]


@dataclass(frozen=True)
class Found:
    """Events within a step: the special points in order, and a sentence for each thing that could not be made
    out."""

    points: tuple[BranchPoint, ...] = ()
    remarks: tuple[str, ...] = ()


class Within:
    """Orbits within a step, each solved for once."""

    def __init__(self, curve: Curve, step: Step) -> None:
        self.curve, self.step = curve, step
        self.low = _LEAVING * step.size if step.start.leaving else 0.0
        self._known = {step.size: step}

    @functools.cached_property
    def blocks(self) -> Blocks:
        """Blocks of the return map along the step, as the orbits' spatial symmetries make them."""
        return blocks_along(self.curve, self.step)

    def at(self, place: float) -> Step:
        """The part of the step up to a place."""
        if place not in self._known:
            self._known[place] = self.curve.within(self.step, place)
        return self._known[place]

    def sides(self, place: float) -> tuple[Step, Step]:
        """Parts of the step that end a little before and a little after a place."""
        beside = _SIDE * self.step.size
        return self.at(max(place - beside, self.low)), self.at(min(place + beside, self.step.size))


def inspect(curve: Curve, step: Step, closely: bool) -> Found:
    """Find what happens within a step.

    Parameters
    ----------
    curve, step
        The step and its curve.
    closely
        True to look between its ends even where these give no reason to.

    Raises
    ------
    AnalysisError
        If the step landed on another curve, or the curve cannot be solved for in between.
    """
    within = Within(curve, step)
    leaving = step.start.leaving
    rising = float(step.start.last.tangent[-1])
    # What starts at a fold does not find it again.
    turned = not leaving and abs(rising) > _CLOSE and rising * float(step.tangent[-1]) < 0.0
    flipped = not leaving and _sign(step.start.matrix) != _sign(step.matrix)
    brackets = _brackets_from_places(within) if closely else _brackets_from_ends(within, turned)
    if brackets == [] and not turned and not flipped:
        return Found()
    places, remarks = _places(within, brackets, turned)
    if flipped and not any(place.branching for place in places):
        raise AnalysisError("the step landed on another curve", field="step")
    between = within.low, step.size
    sure = flows_with_error(curve.system(step.end.last.value))
    points: tuple[BranchPoint, ...] = ()
    for place in places:
        near, event = within.at(place.crossing.value).end.last.value, place.crossing.event
        if (sure or (leaving and place.crossing.event is Event.PLUS)) and not _confirmed(within, place):
            remarks += (f"near {near:.9g}: {event.sentence} by no more than its error, which is no event",)
            continue
        point = special_point(curve, within.at, place, between, within.blocks)
        if point is None:
            remarks += (f"near {near:.9g}: {event.sentence}, but no multiplier of the orbit found there is critical",)
        else:
            points += (point,)
    return Found(points, remarks)


def _confirmed(within: Within, place: Place) -> bool:
    """True if what passes at a place is on the other side behind it, by more than the errors of the multipliers.

    Where two meet at +1 or -1 and leave along the circle, as without damping, either of them is on any side: that one
    passed is told by the product of their distances. Beside a point where branches meet a multiplier is critical within
    its error, and rounding makes it cross.
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


def _side(within: Within, at: float, place: Place) -> tuple[float, ...]:
    """On which side of the circle the critical multiplier is, and of a real one the sign of the product of all
    distances from it; 0 each if the errors of multipliers and orbit do not tell."""
    curve, step, crossing = within.curve, within.at(at), place.crossing
    last, section = step.end.last, within.step.start.section
    units = curve.units(last.orbit.size)

    def off(x: Array, value: float) -> tuple[Array, Array, ReturnMap]:
        image = curve.image(x, value, section, with_error=True)
        spec = spectrum(image)
        index = int(np.abs(spec.values - crossing.multiplier).argmin())
        nu = spec.values[index]
        if crossing.event is Event.PAIR:
            return np.array([abs(nu) - 1.0]), spec.error[[index]], image
        target = TARGETS[crossing.event]
        distances = np.abs(spec.values - target)
        others = np.array([np.delete(distances, i).prod() for i in range(distances.size)])
        away = np.array([nu.real - target, (spec.values - target).prod().real])
        return away, np.array([spec.error[index], spec.error @ others]), image

    away, error, image = off(last.orbit, last.value)
    # The orbit is least sure in the direction in which the matrix is weakest: along it the margin is asked anew.
    wrong = np.abs(image.state - last.orbit) + np.broadcast_to(image.error, step.image.jacobian.shape) @ units[:-1]
    left, sizes, right = np.linalg.svd(step.matrix)
    if not sizes[-1] > 0.0:
        return (0.0,) * away.size
    shift = units * right[-1] * float(np.abs(left[:-1, -1]) @ (wrong / units[:-1])) / sizes[-1]
    beside, other, _ = off(last.orbit + shift[:-1], last.value + float(shift[-1]))
    uncertain = _SURE * (np.maximum(error, other) + np.abs(beside - away))
    return tuple(np.where(np.abs(away) > uncertain, np.sign(away), 0.0).tolist())


def _places(within: Within, brackets: list[Bracket] | None, turned: bool) -> tuple[list[Place], tuple[str, ...]]:
    """Where something happens within a step, in order; ``brackets`` None: anything may."""
    step = within.step
    remarks: tuple[str, ...] = ()
    roots: list[tuple[Crossing, Block | None]] = []
    single = None if brackets is None else [_root(within, *bracket) for bracket in brackets]
    if single is None or None in single:
        for block, found in _searched(within):
            if found.status in (SearchStatus.BUDGET, SearchStatus.INCOMPLETE):
                remarks += tuple(f"near {step.end.last.value:.6g}: {remark}" for remark in found.remarks)
            roots += [(crossing, block) for crossing in found.crossings]
    else:
        for crossing in filter(None, single):
            matrix = within.at(crossing.value).image.jacobian
            roots.append((crossing, block_of(within.blocks, matrix, crossing.multiplier)))
    places = [_placed(within, crossing, block) for crossing, block in roots if crossing.value > _CLOSE * step.size]
    if turned and not any(place.fold or place.branching for place in places):
        fold = _fold(within, 0.0, step.size)
        # Where branches meet the tangent is uncertain, and may seem to turn.
        places.append(
            replace(fold, fold=False, branching=True) if _branches_meet(within.at(fold.crossing.value)) else fold
        )
    return sorted(places, key=lambda place: place.crossing.value), remarks


def _placed(within: Within, crossing: Crossing, block: Block | None) -> Place:
    """Place where multipliers cross."""
    if crossing.event is not Event.PLUS:
        return Place(crossing, block)
    before, after = within.sides(crossing.value)
    branching = _branches_meet(within.at(crossing.value))
    if float(before.tangent[-1] * after.tangent[-1]) < 0.0 and not branching:
        return _fold(within, before.size, after.size)
    return Place(crossing, block, branching=branching)


def _fold(within: Within, a: float, b: float) -> Place:
    """Where the tangent has no part along the parameter; it changes its sign between two places."""

    def along(place: float) -> float:
        tangent = within.step.start.last.tangent if place == 0.0 else within.at(place).tangent
        return float(tangent[-1])

    place = float(brentq(along, a, b, xtol=_CLOSE * within.step.size))
    return Place(Crossing(place, (place, place), Event.PLUS, 1, 1, 1.0 + 0.0j), fold=True)


def _branches_meet(step: Step) -> bool:
    """True if the curve is not the only one through the end of a step."""
    return bool(np.linalg.svd(step.matrix[:-1], compute_uv=False)[-1] <= _BRANCHING)


def _sign(matrix: Array) -> float:
    return float(np.linalg.slogdet(matrix)[0])


def _searched(within: Within) -> list[tuple[Block | None, Crossings]]:
    """All crossings within a step, in every block of the return map."""
    curve, step = within.curve, within.step

    def matrices(places: Array) -> tuple[Array, Array]:
        found = [_start_jacobian(within) if place == 0.0 else within.at(place).image.jacobian for place in places]
        return np.array(found), np.full(places.size, _ERROR)

    def parameter(place: float) -> float:
        return step.start.last.value + curve.scale * float(step.between(place)[0][-1])

    def search(matrices: Matrices) -> Crossings:
        budget = int(min(_BUDGET, curve.budget.left))
        return find_crossings(matrices, within.low, step.size, budget=max(budget, 30), shown=parameter)

    return [(block, crossings_in(block, matrices, search)) for block in within.blocks]


def _root(within: Within, event: Event, a: float, b: float) -> Crossing | None:
    """Where one multiplier, or one pair, crosses between two places at which a test function has opposite signs; None
    where two real ones cross as one, which the function of a pair does not tell from a pair."""

    def spectrum(place: float) -> ComplexArray:
        jacobian = _start_jacobian(within) if place == 0.0 else within.at(place).image.jacobian
        return np.linalg.eigvals(jacobian).astype(np.complex128)

    def test(place: float) -> float:
        return float(_tests(spectrum(place)[None])[0, _EVENTS.index(event)])

    if test(a) * test(b) > 0.0:
        raise AnalysisError("the curve is not smooth within the step", field="step")
    root = float(brentq(test, a, b, xtol=1e-3 * _CLOSE * within.step.size))
    nu = spectrum(root)
    if event is Event.PAIR:
        nu = nu[nu.imag > _COMPLEX]
        if not nu.size:
            return None
        away = np.abs(np.abs(nu) - 1.0)
        if not away.min() <= _COMPLEX:  # those that cross are real, and others complex
            return None
    else:
        away = np.abs(nu - TARGETS[event])
    multiplier = complex(nu[away.argmin()])
    return Crossing(root, (root, root), event, 2 if event is Event.PAIR else 1, 1, multiplier)


def _start_jacobian(within: Within) -> Array:
    """Derivative of the return map at the start of a step."""
    matrix = within.step.start.matrix[:-1, :-1]
    sizes = within.curve.units(len(matrix))[:-1]
    jacobian: Array = (matrix + np.eye(len(matrix))) * sizes[:, None] / sizes
    return jacobian


def _tests(nu: ComplexArray) -> Array:
    """Test functions, which change sign at the events, shape (places, 3), from multipliers, shape (places, n)."""
    with np.errstate(all="ignore"):
        return np.stack([factors(nu, event).prod(axis=1).real for event in _EVENTS], axis=1)


def _brackets_from_places(within: Within) -> list[Bracket] | None:
    """The one event that happens within a step between places that separate it from the others, none if none does; None
    where this is not clear."""
    low, size = within.low, within.step.size
    places = low + 0.5 * (1.0 + PLACES) * (size - low)
    places[DEGREE] = size
    nu = np.linalg.eigvals(np.array([_jacobian_at(within, place) for place in places.tolist()])).astype(np.complex128)
    tests = _tests(nu)
    if not np.isfinite(tests).all():
        return None
    _, uncertain, fine = interpolated(tests)
    unclear = np.abs(fine) <= _CLEAR * uncertain
    outside = (np.abs(nu) > 1.0).sum(axis=1)
    changes = [np.flatnonzero(fine[1:, i] * fine[:-1, i] <= 0.0) for i in range(len(_EVENTS))]
    passed = [i for i, change in enumerate(changes) if change.size]
    if not passed:
        return [] if not unclear.any() and (outside == outside[0]).all() else None
    (i,), change = passed[:1], changes[passed[0]]
    if len(passed) > 1 or change.size > 1 or abs(int(outside[DEGREE]) - int(outside[0])) != (2 if i == 2 else 1):
        return None
    left, right = int(change[0]) - _BESIDE, int(change[0]) + 1 + _BESIDE
    unclear[max(left, 0) : right + 1, i] = False
    if unclear.any() or left < 0 or right >= DENSE.size:
        return None
    a, b = (low + 0.5 * (1.0 + DENSE[j]) * (size - low) for j in (left, right))
    return [(_EVENTS[i], float(a), float(b))]


def _jacobian_at(within: Within, place: float) -> Array:
    """Derivative of the return map within a step, on the cubic through its ends where that is close enough."""
    curve, step = within.curve, within.step
    if place == step.size:
        return step.image.jacobian
    if place == 0.0:
        return _start_jacobian(within)
    moved, matrix = step.between(place)
    last, n = step.start.last, step.image.state.size
    units = curve.units(n)
    x, value = last.orbit + units[:n] * moved[:n], last.value + curve.scale * float(moved[n])
    try:
        image = curve.image(x, value, step.start.section)
        off = float(np.abs(np.linalg.solve(matrix, np.append((image.state - x) / units[:n], 0.0))).max())
    except (AnalysisError, np.linalg.LinAlgError):  # a return may magnify what the cubic misses
        off = np.inf
    if not off <= _OFF * step.size:
        exact = within.at(place)
        if not float(np.linalg.norm(exact.moved - moved)) <= _AWAY * step.size:
            raise AnalysisError("the curve is not smooth within the step", field="step")
        image = exact.image
    return image.jacobian


def _brackets_from_ends(within: Within, turned: bool) -> list[Bracket] | None:
    """As :func:`_brackets_from_places`, from the ends of a step alone."""
    step = within.step
    start, end = (np.linalg.eigvals(jacobian) for jacobian in (_start_jacobian(within), step.image.jacobian))
    if step.start.leaving:
        critical = int(np.abs(start - 1.0).argmin()), int(np.abs(end - 1.0).argmin())
        start, end = np.delete(start, critical[0]), np.delete(end, critical[1])
    before, after = counts_outside(start.astype(np.complex128)), counts_outside(end.astype(np.complex128))
    changed = [i for i in range(len(_EVENTS)) if before[i] != after[i]]
    if turned and before[1] != after[1]:
        changed.remove(1)  # the fold itself
    if not changed:
        return []
    (i,) = changed[:1]
    tests = _tests(np.array([start, end], dtype=np.complex128))
    if len(changed) > 1 or step.start.leaving or abs(before[i] - after[i]) > 1 or tests[0, i] * tests[1, i] >= 0.0:
        return None
    return [(_EVENTS[i], 0.0, step.size)]
