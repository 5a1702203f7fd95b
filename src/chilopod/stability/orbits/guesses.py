"""Guesses of periodic orbits, as nodes for Newton's method (``shooting``).

A user's guess is a state or a whole orbit (``whole_orbit``). A state where an impact happens may be replaced
(``past_impact``). Where Newton's method fails at it, ``nearer_orbits`` gives further starts, the cheap ones first: with
careful steps, with several nodes, from a state further along, and from where the motion has settled.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.arguments import finite_array, shape_of
from chilopod.frozen import Array
from chilopod.stability.interface import Autonomous, SystemLike, checked_flow, is_autonomous, returns_per_period, sizes
from chilopod.stability.orbits.shooting import Nodes, node_count, nodes_along
from chilopod.stability.returns import carried, return_duration, returned_states, turned, velocity_at

_OF_GUESS = 16  # nodes of a guess that is a whole orbit
_FEWEST_ROWS = 5
_FEWEST_NODES = 3
_SAME_PERIOD = 1e-6
_ONWARD = 0.382  # distance along the motion of the next guess, relative to the guessed return
_EARLIER, _JUMPS = 1e-10, 1e-6  # part of a return round a guess, and a motion within it, relative to it, of a jump
_LONGEST_SETTLING = 300  # returns
_MARCHED, _MARCHES = 48, 8  # steps per guessed period, and guessed periods, within which a motion must return
_COMES_BACK = 0.1  # distance of a return, relative to the size of the motion
_CORRECTIONS, _RETURNS = 4, 1e-3  # of the time of a return, and its distance, relative to the states, on an orbit
_STILL = 1e-3  # motion of a state, relative to the others, that counts as rest


def whole_orbit(guess: Any, system: SystemLike) -> Nodes | None:
    """Nodes of a guess that is a whole orbit, as :func:`~chilopod.stability.find_orbit` takes it, or None."""
    if hasattr(guess, "dims") and len(guess.dims) == 2:
        if "time" not in guess.indexes:
            allowed = "a dimension `time` with its values"
            raise ParameterError("must tell its times", field="orbit", value=guess.dims, allowed=allowed)
        guess = guess.indexes["time"], guess.transpose("time", ...).values
    n, whole = system.dimension, return_duration(system) * returns_per_period(system)
    timed = isinstance(guess, tuple) and len(guess) == 2 and hasattr(guess[1], "__len__")
    times, states = guess if timed else (None, guess)
    shape = shape_of(states)
    if isinstance(shape, str) or len(shape) != 2:
        return None
    states = finite_array(states, (shape[0], n), "orbit")
    if timed:
        times = finite_array(times, shape[:1], "orbit")
    else:
        states = np.vstack([states, states[:1]])
        times = np.linspace(0.0, whole, len(states))
    if len(states) < _FEWEST_ROWS:
        allowed = f"one state, shape ({n},), or a whole orbit: {_FEWEST_ROWS} rows or more, one for each time"
        raise ParameterError("must have more rows", field="orbit", value=guess, allowed=allowed)
    if not (np.diff(times) > 0.0).all():
        raise ParameterError("must have rising times", field="orbit")
    lasts, first = float(times[-1] - times[0]), 0.0
    if not is_autonomous(system):
        if not abs(lasts - whole) <= _SAME_PERIOD * whole:
            raise ParameterError("must cover one period", field="orbit", value=f"{lasts:g}", allowed=f"{whole:g}")
        first = -float(times[0]) % whole  # time 0, from the first state on
    duration = return_duration(system, lasts)
    nodes = (first + np.arange(_OF_GUESS) * duration / _OF_GUESS) % lasts
    return Nodes(CubicSpline(times - times[0], states)(nodes), duration)


def past_impact(system: SystemLike, x: Array, duration: float) -> Array:
    """The state, or one further along its motion if that jumps there and then comes back nearer: round-off decides
    whether the state is before the jump or after it."""
    if not is_autonomous(system):
        return x
    with contextlib.suppress(AnalysisError):
        before = x - _EARLIER * duration * velocity_at(system, x)
        after = carried(system, before[None], 0.0, 2.0 * _EARLIER * duration)[0]
        fastest = np.maximum(*(np.abs(velocity_at(system, each)) for each in (before, after)))
        if (np.abs(after - before) > _JUMPS * np.abs(before) + 20.0 * _EARLIER * duration * fastest).any():
            later = carried(system, before[None], 0.0, _ONWARD * duration)[0]
            both = np.array([x, later])
            missed = np.abs(turned(system, carried(system, both, 0.0, duration)) - both)
            size = np.abs(both).max(axis=0)
            near, far = (missed / np.where(size > 0.0, size, 1.0)).max(axis=1)
            return x if near <= far else later
    return x


def nearer_orbits(system: SystemLike, x: Array) -> Iterator[tuple[Nodes, bool]]:
    """Further starts after Newton's method has failed at a guessed state, each with a flag for careful steps."""
    duration = return_duration(system)
    if is_autonomous(system):
        # An orbit with a strongly stable direction is reached from a section only by guesses on its stable manifold.
        yield Nodes(x[None], duration), True
    with contextlib.suppress(AnalysisError, np.linalg.LinAlgError):
        count = node_count(checked_flow(system, x, 0.0, duration)[1], sizes(system, x, duration))
        if count >= _FEWEST_NODES:  # a return magnifies deviations too much for one
            yield nodes_along(system, x, duration, count), False
    if is_autonomous(system):
        # At an event, such as an impact, round-off decides whether a motion that ends there is before or after it.
        with contextlib.suppress(AnalysisError):
            yield Nodes(carried(system, x[None], 0.0, _ONWARD * duration), duration), False
    for nodes in _settled_autonomous(system, x) if is_autonomous(system) else _settled(system, x):
        yield nodes, False


def _settled(system: SystemLike, x: Array) -> Iterator[Nodes]:
    """States on an attracting orbit of the motion from a state, if any."""
    with contextlib.suppress(AnalysisError):
        for count in (_LONGEST_SETTLING // 10, _LONGEST_SETTLING):
            for _ in range(count):
                x = returned_states(system, x[None])[0]
            if not np.isfinite(x).all():
                return
            yield Nodes(x[None], return_duration(system))


def _settled_autonomous(system: Autonomous, x: Array) -> Iterator[Nodes]:
    """As :func:`_settled`, with a new guess of the period: the first close return of the motion."""
    try:
        for _ in range(_LONGEST_SETTLING // 4):
            x = carried(system, x[None], 0.0, system.guess_period)[0]
        times, _, back = _marched(system, x, _MARCHES)
    except AnalysisError:
        return
    if back:
        yield Nodes(x[None], return_duration(system, float(times[back[0]])))


def own_return(system: SystemLike, x: Array) -> Iterator[Nodes]:
    """A state that its own motion meets again within half to twice the guessed period, with that time, if it does."""
    if not is_autonomous(system):
        return
    try:
        times, states, back = _marched(system, x, 2)
    except AnalysisError:
        return
    units = np.maximum(sizes(system, x, system.guess_period), np.abs(states).max(axis=0))
    for i in (i for i in back if times[i] >= 0.5 * system.guess_period):
        later, there = times[1], states[i]
        for _ in range(_CORRECTIONS):  # to the plane across the motion
            velocity = velocity_at(system, there) / units
            later += float((x - there) / units @ velocity / (velocity @ velocity))
            if not 0.0 <= later <= 2.0 * times[1]:
                break
            there = carried(system, states[i - 1][None], 0.0, later)[0]
        if (np.abs(there - x) <= _RETURNS * units).all():
            yield Nodes(x[None], return_duration(system, float(times[i - 1] + later)))
            return


def _marched(system: Autonomous, x: Array, periods: int) -> tuple[Array, Array, list[int]]:
    """Times of a motion over guessed periods, its states, and the numbers of those that come back near the first."""
    # One step more shows whether the motion goes away again after the last one.
    times = np.linspace(0.0, (periods + 1.0 / _MARCHED) * system.guess_period, periods * _MARCHED + 2)
    path = [x]
    for _ in times[1:]:
        path.append(carried(system, path[-1][None], 0.0, float(times[1]))[0])
    states = np.array(path)
    # A state that hardly moves, relative to its size, gives no information.
    size = sizes(system, x, system.guess_period)
    moves = np.ptp(states, axis=0) / size
    size = size * np.maximum(moves, _STILL * moves.max())
    if not (np.isfinite(states).all() and size.all()):
        return times, states, []
    away = (np.abs(states - x) / size).max(axis=1)
    back = (away[1:-1] <= away[:-2]) & (away[1:-1] <= away[2:]) & (away[1:-1] < _COMES_BACK)
    return times, states, (1 + np.flatnonzero(back)).tolist()
