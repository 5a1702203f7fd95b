"""The return map of a system, whose fixed points are the periodic orbits.

For a known period T it is H = S flow(T/k), with S the symmetry of order k, if any. If the system does not depend on
time, H carries a state to the next crossing of its motion, turned by S, with a section, a hyperplane, along its normal:
a one-sided Poincare map in the states' coordinates (Parker & Chua, *Practical Numerical Algorithms for Chaotic
Systems*, 1989, ch. 2). Its derivative maps the direction of motion to exactly 0, in place of the trivial multiplier 1.

``return_map`` finds the time of the return (``crossing``), flows there, turns the result by S and projects it onto the
section (``on_section``). ``returned_states`` maps many states without derivatives. A system that depends on time has no
section. ``jumps_at_ends``, ``starts`` and ``event_beside`` concern events that pass time 0.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np

from chilopod.errors import AnalysisError, ChilopodError, ParameterError
from chilopod.flows import deadline
from chilopod.flows.arguments import UserCode, numbers
from chilopod.flows.carrying import REPEATED
from chilopod.frozen import Array, ReadOnlyArrays, read_only
from chilopod.stability.interface import (
    SystemLike,
    check_finite,
    checked_flow,
    is_autonomous,
    offers,
    returns_per_period,
    sizes,
)

_APPROACHES = (1.0 / 16.0, 0.4)  # distances before a section, in returns, from which the crossing is corrected
_FARTHEST = 0.8  # delay, in returns, that makes it another crossing
_CROSSING_ROUNDS = 30
_BENT = 0.5  # largest part of a correction of the time that the change of the speed adds
_LAST_MOVE = 1e-10  # correction of the crossing's time, relative to a return, whose own error is its square
_END, _NEAR_END = 1e-4, 1e-3  # parts of a return, at its ends
_LEAST_JUMP, _CLOSER = 1e-3, 30  # least jump of the derivative there, relative to it, and halvings to its place
_JUST_PAST = 1e-3  # part of these parts beyond the end in which a jump is sought too
_HIDDEN = 1e-3  # change in both halves, relative to that in the whole, that shows a jump at the middle, within rounding
_PARTS = 0.382, 0.236, 0.764  # parts of a return at which an orbit may begin instead
BESIDE = 1e-6  # displacement at which the change of the derivative is computed, relative to the sizes of the states
_NEIGHBOURS = 1e-10 * np.cos(np.arange(9.0))  # uneven distances of neighbours, relative to the sizes of the states
_ROUND_END = 0.99, 1.01  # times just before and after a return, relative to it
_PAST = 1.5e-5  # distance along a curve, in its units, at which an orbit is past a grazing
JUMPS = 0.01  # least jump of a derivative in units, relative to it, at a grazing that changes the events of a return
_JUMPS, _HALVINGS = 0.3, 20  # the same where events are not known, and halvings to the place: half if they are
_FALLING = 0.5  # least fall of the residual that is progress

# Remark on a value of the parameter, and sentences on the end of a curve.
MOVED = "at {:.9g} time 0 was moved along the orbit, away from an event"
EVENT_AT_ZERO = "an event passes time 0 of the orbit: let the right-hand side begin at another time"
GRAZES = "just ahead the orbit grazes an event, which begins or ceases to happen: returns are not smooth there"

JUMPS_AHEAD = "just ahead returns change so fast that they seem to jump, as where an orbit grazes an event"

CUTS = (0.0, 0.0477, 0.382)
"""Fractions of an interval at which it is cut: one near the start, as steps up to the first cut repeat with their
errors."""


class Rule(NamedTuple):
    """Stopping rule: the residual is round-off, or small and no longer halves, which is the equations' accuracy."""

    round_off: float  # residual, relative to the sizes of the unknowns, that is round-off
    settled: float  # residual below which it may stop falling

    def met(self, off: float, best: float) -> bool:
        """True if a residual ends the corrections, given the best earlier one."""
        return off <= self.round_off or (off <= self.settled and off >= _FALLING * best)


RETURN = Rule(8e-16, 1e-10)  # for a return: a flow may err by a thousand times its tolerance
NODES = Rule(1e-13, 1e-9)  # for any node of an orbit: with many nodes and long flows the residual is larger


@dataclass(frozen=True, eq=False)
class Section(ReadOnlyArrays):
    """Hyperplane that the orbit of a system without a period of its own crosses once in a return, along the normal.

    Attributes
    ----------
    point, normal
        State on the section, and normal vector, with normal . (x - point) = 0 on the section, shape (n,) both.
    duration
        Approximate duration of a return.
    """

    point: Array
    normal: Array
    duration: float


@dataclass(frozen=True, eq=False)
class ReturnMap(ReadOnlyArrays):
    """One evaluation of the return map H at a state.

    Attributes
    ----------
    state, jacobian
        H(x), shape (n,), and dH/dx, shape (n, n).
    error
        Bound on the error of every entry of ``jacobian``, shape (n, n), or of all; NaN if not computed.
    returns, period
        Number of returns in the full period, and that period.
    velocity, normal
        dx/dt at H(x), and normal of the section, shape (n,) both, if the system does not depend on time; else None.
    """

    state: Array
    jacobian: Array
    error: float | Array
    returns: int
    period: float
    velocity: Array | None = None
    normal: Array | None = None

    @property
    def duration(self) -> float:
        """Duration of the return."""
        return self.period / self.returns

    @property
    def across(self) -> Array:
        """Projection along the motion onto the section, shape (n, n); the unit matrix without a section."""
        if self.velocity is None or self.normal is None:
            return read_only(np.eye(self.state.size))
        return read_only(_projection(self.velocity, self.normal))


_MISSED = 4.0  # factor on what the image of the motion misses
_KEPT = "dimension", "spatial_symmetry", "scale", "velocity", "flow", "flow_with_error", "flow_states", "flow_tangents"


def whole_period(system: SystemLike, periods: int = 1) -> SystemLike:
    """System for orbits over several periods, or without its symmetry in time and its known orbit."""
    whole: Any = SimpleNamespace(**{name: getattr(system, name, None) for name in (*_KEPT, "flow_events")})
    whole.symmetry, whole.period = None, None if system.period is None else periods * system.period
    if is_autonomous(system):
        whole.guess_period = periods * system.guess_period
    return cast(SystemLike, whole)


def section_at(
    system: SystemLike, x: Array, scale: Array | None = None, duration: float | None = None
) -> Section | None:
    """The section through a state, shape (n,), across its motion, at right angles in units of the states' sizes; None
    if the period is known. The default duration of a return is the system's guess."""
    if not is_autonomous(system):
        return None
    velocity = velocity_at(system, x)
    if not velocity.any():
        raise AnalysisError("is an equilibrium", field="orbit", allowed="a state on an orbit")
    duration = return_duration(system) if duration is None else duration
    scale = sizes(system, x, duration) if scale is None else scale
    normal = velocity / scale**2
    return Section(x, normal / float(np.linalg.norm(normal * scale)), duration)


def return_duration(system: SystemLike, period: float | None = None) -> float:
    """Duration of a return in a full period; by default in that of the system, or its guess."""
    if period is not None:
        return period / returns_per_period(system)
    whole = system.guess_period if is_autonomous(system) else system.period
    if whole is None:
        allowed = "a duration, or a velocity and a guess of the period"
        raise ParameterError("must be given", field="period", value=None, allowed=allowed)
    return whole / returns_per_period(system)


def velocity_at(system: SystemLike, x: Array) -> Array:
    """dx/dt at a state, checked; only of a system that does not depend on time."""
    assert is_autonomous(system)
    with UserCode("velocity"):
        velocity = numbers(system.velocity(np.array(x)), x.shape, "velocity")
    if not np.isfinite(velocity).all():
        raise AnalysisError("the right-hand side is not finite", field="rhs")
    return velocity


def flow_with_error(system: SystemLike, x: Array, t0: float, t1: float) -> tuple[Array, Array, float | Array]:
    """The flow with an error bound, the system's own or an estimate from a computation in parts: a step-controlled
    integrator makes independent errors in the two; one with fixed steps should provide its own bound."""
    if offers(system, "flow_with_error"):
        return checked_flow(system, x, t0, t1, with_error=True)
    state, derivative = checked_flow(system, x, t0, t1, compared=True)
    check_finite(state, derivative)
    passing, product = x, np.eye(x.size)
    for a, b in itertools.pairwise([*(t0 + cut * (t1 - t0) for cut in CUTS), t1]):
        passing, factor = checked_flow(system, passing, a, b)
        product = factor @ product
    # In units of the states' sizes: an entry that agrees by chance is as uncertain as the others.
    size = sizes(system, x, t1 - t0)
    units = size[:, None] / size
    off, largest = (float((np.abs(each) / units).max()) for each in (product - derivative, derivative))
    return state, derivative, (REPEATED * off + 1e-15 * largest) * units


def return_map(system: SystemLike, x: Array, with_error: bool = True, section: Section | None = None) -> ReturnMap:
    """The return map H and its derivative at a state, shape (n,), with a bound on the error if wanted. If the system
    does not depend on time, a return ends on the section: by default across the motion at ``x``."""
    section = section or section_at(system, x)
    error: float | Array = np.nan
    if section is None:
        duration = return_duration(system)
    else:
        start, rest, before, first = crossing(system, x, section)
        duration = start + rest
    if with_error:
        state, jacobian, error = flow_with_error(system, x, 0.0, duration)
    elif section is None:
        state, jacobian = checked_flow(system, x, 0.0, duration)
    else:
        state, second = checked_flow(system, before, 0.0, rest)
        jacobian = second @ first
    if system.symmetry is not None:
        state, jacobian = system.symmetry @ state, system.symmetry @ jacobian
    image = on_section(system, section, state, jacobian, duration, error)
    if not with_error or image.velocity is None or image.normal is None:
        return image
    # The flow maps the motion at the start to that at the end. In a stiff system rounding of the state changes this
    # motion, and so the projection along it.
    off = np.abs(jacobian @ velocity_at(system, x) - image.velocity) / abs(float(image.normal @ image.velocity))
    return replace(image, error=image.error + _MISSED * np.outer(off, np.abs(image.normal @ jacobian)))


def on_section(
    system: SystemLike, section: Section | None, state: Array, matrix: Array, time: float, error: float | Array = np.nan
) -> ReturnMap:
    """The return map from a return, to a section if given, and its derivative; ``error`` bounds that of the flow."""
    check_finite(state, matrix)
    count, growth = returns_per_period(system), None if system.symmetry is None else np.abs(system.symmetry)
    velocity = normal = None
    if section is not None:
        velocity, normal = velocity_at(system, state), section.normal
        across = _projection(velocity, normal)
        matrix, growth = across @ matrix, np.abs(across) if growth is None else np.abs(across) @ growth
    if growth is not None:
        error = growth @ error if isinstance(error, np.ndarray) else error * float(growth.sum(axis=1).max())
    return ReturnMap(state, matrix, error, count, count * time, velocity, normal)


def _projection(velocity: Array, normal: Array) -> Array:
    """Projection along a motion onto the section with a normal, shape (n, n)."""
    return np.asarray(np.eye(normal.size) - np.outer(velocity, normal) / float(normal @ velocity))


def crossing(system: SystemLike, x: Array, section: Section, derived: bool = True) -> tuple[float, float, Array, Array]:
    """Time of a motion's return to the section: a time shortly before, and the rest; the state and, unless it is not
    ``derived``, the derivative at that time."""
    for approach in _APPROACHES:
        start = (1.0 - approach) * section.duration
        if derived:
            before, derivative = checked_flow(system, x, 0.0, start)
        else:
            before, derivative = carried(system, x[None], 0.0, start)[0], np.empty((0, 0))
        check_finite(before, derivative)
        arrival = _arrival(system, before, section, approach * section.duration)
        if arrival is not None:
            return start, arrival[0], before, derivative
    said = f"the motion does not come back to where it started after about {section.duration:.6g}"
    raise AnalysisError(said, field="orbit", allowed="a guess closer to an orbit and its period")


def _arrival(system: SystemLike, before: Array, section: Section, rest: float) -> tuple[float, Array] | None:
    """Remaining time of a state near its return to the section, and the state there, by Newton's method with the change
    of the speed; None if it does not arrive, has passed it or crosses it backwards."""
    earlier: tuple[float, float] | None = None  # time and speed of the round before
    for _ in range(_CROSSING_ROUNDS):
        state = turned(system, carried(system, before[None], 0.0, rest))[0]
        velocity = velocity_at(system, state)
        speed = float(section.normal @ velocity)
        off = float(section.normal @ (state - section.point))
        if speed == 0.0 or not math.isfinite(off):
            return None
        move = off / speed
        if earlier is not None and rest != earlier[0]:
            bent = 0.5 * move * (speed - earlier[1]) / (rest - earlier[0]) / speed
            move *= 1.0 + min(max(bent, -_BENT), _BENT)
        earlier, rest = (rest, speed), rest - move
        if abs(move) <= _LAST_MOVE * section.duration:
            return (rest, state - move * velocity) if speed > 0.0 else None
        if not 0.0 < rest < _FARTHEST * section.duration:
            return None
    return None


def jumps_at_ends(system: SystemLike, x: Array, duration: float, part: float = _END) -> bool:
    """True if the motion jumps within a ``part`` of a return at one of its ends: the derivative over the time round the
    jump does not tend to 1, however short. That of a motion that is merely fast does."""
    size, one = sizes(system, x, duration), np.eye(x.size)

    def at(state: Array, low: float, high: float) -> Array:
        return carried(system, state[None], low * duration, high * duration)[0] if low < high else state

    def change(state: Array, low: float, high: float) -> float:
        derivative = checked_flow(system, state, low * duration, high * duration)[1]
        return float((np.abs(derivative - one) * size / size[:, None]).max())

    def jump(low: float, high: float) -> float:
        there = at(x, 0.0, low)
        most = change(there, low, high)
        for _ in range(_CLOSER):
            if most <= _LEAST_JUMP:
                break
            middle = 0.5 * (low + high)
            between = at(there, low, middle)
            before, after = change(there, low, middle), change(between, middle, high)
            if max(before, after) < _HIDDEN * min(1.0, most):
                break
            low, high, there = (low, middle, there) if before > after else (middle, high, between)
            most = max(before, after)
        return most

    if not has_events(system, x, duration) or any(change(at(x, 0.0, p), p, p + part) == 0.0 for p in _PARTS):
        return False  # a map has no parts, but over several periods is applied within them too
    # Round-off decides whether a state at a jump is before it or after it.
    end = 1.0 + _JUST_PAST * part * is_autonomous(system)
    return max(jump(0.0, part), jump(1.0 - part, end)) > _LEAST_JUMP


def starts(system: SystemLike, x: Array, duration: float) -> Iterator[Array]:
    """Later states of a motion that may be at time 0 instead, if an event passes it and it may be moved."""
    if is_autonomous(system) and jumps_at_ends(system, x, duration, _NEAR_END):
        for part in _PARTS:
            there = carried(system, x[None], 0.0, part * duration)[0]
            if not jumps_at_ends(system, there, duration, _NEAR_END):
                yield there


def events_in(system: SystemLike, x: Array, period: float) -> tuple[float, ...]:
    """Numbers of passages of the events in a period from a state; none if the system has none, or does not count."""
    with UserCode("flow_events"):
        return tuple(system.flow_events(x.copy(), 0.0, period)) if offers(system, "flow_events") else ()


def has_events(system: SystemLike, x: Array, period: float) -> bool:
    """False if a system counts its events, and there are none to count: fast motions may look like jumps."""
    return not offers(system, "flow_events") or bool(events_in(system, x, period))


def event_beside(system: SystemLike, x: Array, time: float, ahead: Callable[[float], tuple[SystemLike, Array]]) -> str:
    """Sentence on the event at which a curve of orbits ends; empty without one. The system and a state are given as
    functions of the distance along the curve from its last orbit."""

    def events(distance: float, part: float = 1.0) -> tuple[float, ...]:
        return events_in(*ahead(distance), part * time)

    def seen(distance: float) -> tuple[tuple[float, ...], Array]:
        there, state = ahead(distance)  # without the event the motion may never return
        return events(distance), checked_flow(there, state, 0.0, time)[1] * size / size[:, None]

    with contextlib.suppress(ChilopodError):
        size = sizes(system, x, time)
        if jumps_at_ends(system, x, time):
            return EVENT_AT_ZERO
        # A very unstable orbit meets other events on both sides.
        if has_events(system, x, time) and jumps_within(seen, 0.0, _PAST) and not jumps_within(seen, 0.0, -_PAST):
            low, high, here = 0.0, _PAST, events(0.0)
            if events(high) == here:
                return JUMPS_AHEAD
            for _ in range(_CLOSER):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if events(middle) == here else (low, middle)
            # An event that is late, as where a motion slows down, passes the end of the time instead.
            return GRAZES if any(events(low, part) != events(high, part) for part in _ROUND_END) else ""
    return ""


def jumps_within(seen: Callable[[float], tuple[tuple[float, ...], Array]], low: float, high: float) -> bool:
    """True if a derivative jumps between two places, where events change or else it changes most: the change remains
    however short the way is. Both are given at a place."""
    (events, before), (others, after) = seen(low), seen(high)
    known, size = events != others, max(1.0, float(np.linalg.norm(before)))
    least = JUMPS * size if known else max(_JUMPS * size, 0.5 * float(np.linalg.norm(after - before)))
    for _ in range(_HALVINGS // (1 + known)):
        if not float(np.linalg.norm(after - before)) > least:
            return False
        here, between = seen(middle := 0.5 * (low + high))
        if here != events if known else np.linalg.norm(between - before) > np.linalg.norm(after - between):
            high, after = middle, between
        else:
            low, before = middle, between
    return True


def carried(system: SystemLike, states: Array, t0: float, t1: float) -> Array:
    """States at t1 of those at t0, shape (states, n) both, by the cheapest way; a SpentError after a limit."""
    deadline.check()
    if offers(system, "flow_states"):
        with UserCode("flow_states"), np.errstate(all="ignore"):
            return numbers(system.flow_states(states, t0, t1), states.shape, "flow_states")
    if offers(system, "flow_tangents"):
        with UserCode("flow_tangents"):
            zero = np.zeros((states.shape[1], 1))
            return np.array([np.array(system.flow_tangents(np.array(x), zero.copy(), t0, t1)[0]) for x in states])
    return np.array([checked_flow(system, x, t0, t1)[0] for x in states])


def in_parts(system: SystemLike, x: Array, duration: float) -> Array:
    """Return of a state, shape (n,), by other steps than those of the flow over the whole return."""
    for part, following in itertools.pairwise((*CUTS, 1.0)):
        x = carried(system, x[None], part * duration, following * duration)[0]
    return np.asarray(turned(system, x[None])[0])


def turned(system: SystemLike, states: Array) -> Array:
    """S of states, shape (states, n); the states themselves without that symmetry."""
    return states if system.symmetry is None else np.asarray(states @ system.symmetry.T)


def returned_states(system: SystemLike, states: Array, section: Section | None = None) -> Array:
    """H of many states, shape (states, n) both; on the section if the system does not depend on time."""
    states = np.array(states)  # a system may write into its argument
    if section is None:
        return turned(system, carried(system, states, 0.0, return_duration(system)))
    approach = _APPROACHES[0]
    before = carried(system, states, 0.0, (1.0 - approach) * section.duration)
    result = np.empty_like(states)
    for i, x in enumerate(before):
        arrival = _arrival(system, x, section, approach * section.duration)
        if arrival is None:
            _, rest, x, _ = crossing(system, states[i], section)
            result[i] = turned(system, carried(system, x[None], 0.0, rest))[0]
        else:
            result[i] = arrival[1]
    return result


def scatter(system: SystemLike, image: ReturnMap, x: Array, size: Array, section: Section | None = None) -> Array:
    """Range, shape (n,), by which returns of neighbours of a state scatter round the plane of their derivative."""
    moves = np.outer(_NEIGHBOURS / max(1.0, float(np.abs(image.jacobian * size / size[:, None]).max())), size)
    off = returned_states(system, x + moves, section) - image.state - moves @ image.jacobian.T
    return np.asarray(np.ptp([0.0 * x, *off], axis=0))


def return_maps(systems: Sequence[SystemLike], orbits: Sequence[Array]) -> list[ReturnMap]:
    """The return maps of many systems at states on their orbits, with errors, together if possible."""
    first = systems[0]
    alike = [each for each in systems if isinstance(each, type(first))]
    if not (1 < len(systems) == len(alike) and offers(first, "flow_many") and all(map(first.can_flow_with, alike))):
        return [return_map(system, orbit) for system, orbit in zip(systems, orbits, strict=True)]
    count, duration = returns_per_period(first), return_duration(first)
    jacobians, errors = first.flow_many(alike, 0.0, duration)
    turn = np.eye(first.dimension) if first.symmetry is None else first.symmetry
    found = zip(orbits, jacobians, errors, strict=True)
    return [ReturnMap(orbit, turn @ matrix, float(error), count, count * duration) for orbit, matrix, error in found]
