"""Compiled loop of a simulation: many robots through one stretch of time without commands.

Robots are integrated in parallel, each in a lane (see :mod:`chilopod.lanes`), with its own steps and its own piece of
time; when one arrives or fails, the next waiting robot takes its lane. A single robot in one lane has the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np

from chilopod.compiled import copy_into, njit, parallel_njit
from chilopod.engine.actuators import FROM, GOAL, RAMPING, SETTLING, SINCE, UNTIL
from chilopod.engine.actuators import SLOPE as RAMP
from chilopod.errors import ParameterError
from chilopod.integrate import LANES_WORK, MAX_STEPS, STAGES, first_step, lanes_step, step_factor
from chilopod.lanes import LANES, as_lanes, choose, room
from chilopod.planar.contact import MOMENTS, sum_moments
from chilopod.planar.dynamics import BEHIND, DECAY, LEVEL, ORIGIN, SCRATCH, SLOPE, SPRING, TORQUE, rhs

WALKING, DIVERGED, OUT_OF_RANGE, HALTED = range(4)
MOST_BENT = 0.5 * np.pi
"""Largest bend of a yaw joint, rad: beyond it modules collide."""

_WORTH_WAKING, _A_STEP = 2e-4, 2.5e-7
"""Least work for several threads, and approximate work of a step for one module in lanes, s."""

_TIME, _STEP, _ERROR = range(3)
_NOBODY = -1

_slope = njit(rhs.py_func)
"""Compiler without permission to fuse, see :mod:`chilopod.lanes`."""

_attempt = lanes_step(_slope)


class Pieces(NamedTuple):
    """Pieces of time that all robots walk through.

    Each piece has a begin, a start within its contact interval and a width, s, a contact ``interval``, and the index
    ``sample`` in ``record`` of the state at its end, -1 for none; all of shape (pieces,). For each interval,
    ``contact`` is True for standing feet and ``stroke`` is their position at the start, m ahead of mid-stroke, shape
    (intervals, N, 2).
    """

    begins: Any
    starts: Any
    widths: Any
    interval: Any
    sample: Any
    contact: Any
    stroke: Any


class Robots(NamedTuple):
    """Robots and their commands.

    ``scalars``, see ``dynamics.py``, has shape (robots, 4), ``feet`` (forward offset and half-width, m) and ``yaw`` (of
    the legs of module 1, rad) have shape (robots, 2), ``damping`` (N*m*s/rad) shape (robots, N-1), ``friction`` of
    every foot (N*s/m) shape (robots, N, 2). ``profile``, ``lag`` and ``torque`` are those of
    :class:`chilopod.engine.Actuators`, shapes (7, robots, N-1), (robots, N-1) and (robots, N-1). A robot ends
    OUT_OF_RANGE with a joint beyond ``most_bent``, rad.
    """

    scalars: Any
    feet: Any
    damping: Any
    friction: Any
    profile: Any
    lag: Any
    torque: Any
    yaw: Any
    most_bent: float = MOST_BENT


class _Lanes(NamedTuple):
    """Arguments of the right-hand side, with the lane as last axis; see ``dynamics.py``."""

    x: Any
    scalars: Any
    springs: Any
    damping: Any
    moments: Any


class _Places(NamedTuple):
    """Robot of each lane, or NOBODY, and its progress in its piece.

    A step does not straddle the end of a ramp: a piece is walked in parts, from ``begin`` to ``end`` (s). ``next`` is
    the step to try next (s), 0 for a guess; ``tried`` counts the steps in this part, ``rejected`` is True after a
    rejected step, and ``last`` is True for the last step of the part.
    """

    robot: Any
    piece: Any
    begin: Any
    end: Any
    next: Any
    tried: Any
    rejected: Any
    last: Any


@njit
def _fit(rows: Any, pieces: Any, robots: Any, states: Any, step: Any, status: Any, record: Any) -> bool:
    """True if arguments of :func:`carry` have consistent shapes and are not empty; compiled loops check no index."""
    (count, joints), size = robots.lag.shape, pieces.widths.size
    return bool(
        0 < rows.size <= count
        and 0 < size == pieces.begins.size == pieces.starts.size == pieces.interval.size == pieces.sample.size
        and pieces.contact.shape == pieces.stroke.shape == (len(pieces.contact), joints + 1, 2)
        and record.shape[1:] == states.shape == (count, 2 * joints + 6)
        and step.size == status.size == count
        and robots.scalars.shape == (count, 4)
        and robots.feet.shape == robots.yaw.shape == (count, 2)
        and robots.damping.shape == robots.torque.shape == (count, joints)
        and robots.friction.shape == (count, joints + 1, 2)
        and robots.profile.shape == (7, count, joints)
    )


def _carrier(width: int) -> Callable[..., bool]:
    """The loop on one thread for a number of lanes, with the arguments of :func:`carry`; it returns True if the shapes
    of arrays are consistent, otherwise it does nothing."""

    @njit
    def carry(
        rows: Any, pieces: Any, robots: Any, tolerance: float, states: Any, step: Any, status: Any, record: Any
    ) -> bool:
        if not _fit(rows, pieces, robots, states, step, status, record):
            return False
        n, size = pieces.contact.shape[1], states.shape[1]
        joints = n - 1
        lanes = _Lanes(
            room((size, width)),
            room((4, width)),
            room((joints, SPRING, width)),
            room((joints, width)),
            room((n, MOMENTS, width)),
        )
        x = as_lanes(lanes.x, width)
        args = (
            as_lanes(lanes.scalars, width),
            as_lanes(lanes.springs, width),
            as_lanes(lanes.damping, width),
            as_lanes(lanes.moments, width),
            as_lanes(room((n, SCRATCH, width)), width),
        )
        # Rounded up to whole vectors, in which sums are taken whatever the number of lanes.
        vectors = -(-size * width // LANES)
        wider = room((LANES_WORK, vectors, LANES))
        slope = wider.reshape((LANES_WORK, vectors * LANES // width, width))
        slopes, wide = as_lanes(slope, width), as_lanes(wider, LANES)
        clock = room((3, width))
        clocks = as_lanes(clock, width)
        at = _Places(
            np.full(width, _NOBODY),
            np.zeros(width, np.int64),
            np.zeros(width),
            np.zeros(width),
            np.zeros(width),
            np.zeros(width, np.int64),
            np.zeros(width, np.bool_),
            np.zeros(width, np.bool_),
        )
        walking = min(width, rows.size)
        waiting = walking
        for lane in range(width):
            # An empty lane holds the first robot at rest, whose numbers cost no more than others.
            _put(lane, rows[lane if lane < walking else 0], robots, states, step, lanes, at)
            _begin(lane, at.piece[lane], 0.0, pieces, robots, lanes, clock, at)
            if lane >= walking:
                at.robot[lane] = _NOBODY

        while walking:
            _slope(clocks[_TIME], x, args, slopes[0])
            for lane in range(width):
                if at.robot[lane] != _NOBODY:
                    _choose_step(lane, pieces, lanes, slope[0], clock, at)
            clocks[_ERROR] = _attempt(args, x, clocks[_TIME], clocks[_STEP], tolerance, slopes, wide)
            for i in range(size):
                x[i] = choose(1.0, clocks[_ERROR], x[i], slopes[STAGES, i])
            for lane in range(width):
                r, s = at.robot[lane], at.piece[lane]
                if r == _NOBODY:
                    continue
                begin = 0.0
                if not _judge_step(lane, clock, at):
                    status[r] = DIVERGED
                elif at.rejected[lane] or not at.last[lane]:
                    continue
                elif _most_bent(lanes.x, joints, lane) > robots.most_bent:
                    status[r] = OUT_OF_RANGE
                elif at.end[lane] < pieces.widths[s]:
                    begin = at.end[lane]
                else:
                    if pieces.sample[s] >= 0:
                        copy_into(record[pieces.sample[s], r], lanes.x[:, lane])
                    s += 1
                if status[r] != WALKING or s == pieces.widths.size:
                    copy_into(states[r], lanes.x[:, lane])
                    step[r] = at.next[lane]
                    if waiting == rows.size:
                        at.robot[lane], clock[_STEP, lane] = _NOBODY, 0.0
                        walking -= 1
                        continue
                    _put(lane, rows[waiting], robots, states, step, lanes, at)
                    waiting += 1
                    s = 0
                _begin(lane, s, begin, pieces, robots, lanes, clock, at)
        return True

    return carry


@njit
def _put(lane: int, r: int, robots: Any, states: Any, step: Any, lanes: Any, at: Any) -> None:
    """Put a robot into a lane."""
    at.robot[lane] = r
    at.next[lane] = step[r]
    copy_into(lanes.x[:, lane], states[r])
    copy_into(lanes.scalars[:, lane], robots.scalars[r])
    copy_into(lanes.damping[:, lane], robots.damping[r])


@njit
def _begin(lane: int, s: int, begin: float, pieces: Any, robots: Any, lanes: Any, clock: Any, at: Any) -> None:
    """Begin a part of a piece; it ends with the piece, or with a ramp."""
    r = at.robot[lane]
    end = pieces.widths[s]
    for j in range(robots.lag.shape[1]):
        ramp_left = robots.profile[UNTIL, r, j] - pieces.begins[s]
        if begin < ramp_left < end:
            end = ramp_left
    at.piece[lane], at.begin[lane], at.end[lane] = s, begin, end
    at.tried[lane], at.rejected[lane] = 0, False
    clock[_TIME, lane], clock[_STEP, lane] = pieces.starts[s] + begin, 0.0
    if s == 0 or pieces.interval[s] != pieces.interval[s - 1]:
        contact, stroke = pieces.contact[pieces.interval[s]], pieces.stroke[pieces.interval[s]]
        offset, half_width = robots.feet[r, 0], robots.feet[r, 1]
        sum_moments(contact, stroke, robots.friction[r], offset, half_width, robots.yaw[r], lanes.moments[:, :, lane])
    middle, zero = pieces.begins[s] + 0.5 * (begin + end), pieces.begins[s] - pieces.starts[s]
    _describe(robots.profile[:, r], robots.lag[r], robots.torque[r], middle, zero, lanes.springs[:, :, lane])


@njit(inline="always")
def _choose_step(lane: int, pieces: Any, lanes: Any, slope: Any, clock: Any, at: Any) -> None:
    """Choose the step that the one before suggests, at most the time left; see :func:`chilopod.integrate.integrator`
    for the first guess."""
    left = pieces.starts[at.piece[lane]] + at.end[lane] - clock[_TIME, lane]
    if at.next[lane] <= 0.0:
        scale, steep = 0.0, 0.0
        for i in range(lanes.x.shape[0]):
            scale = max(scale, abs(lanes.x[i, lane]))
            steep = max(steep, abs(slope[i, lane]))
        at.next[lane] = first_step(scale, steep, left)
    at.last[lane] = at.next[lane] >= left * (1.0 - 1e-12)
    clock[_STEP, lane] = left if at.last[lane] else at.next[lane]


@njit(inline="always")
def _judge_step(lane: int, clock: Any, at: Any) -> bool:
    """Advance the time if the step is accepted, and set the next step; return False if that is too small."""
    error, step = clock[_ERROR, lane], clock[_STEP, lane]
    factor = step_factor(error, at.rejected[lane])
    at.tried[lane] += 1
    at.rejected[lane] = error > 1.0
    if at.rejected[lane]:
        at.next[lane] = step * factor
        if at.next[lane] < 1e-14 * max(abs(clock[_TIME, lane]), at.end[lane] - at.begin[lane]):
            return False
    else:
        if not at.last[lane] or factor < 1.0:
            at.next[lane] = step * factor
        clock[_TIME, lane] += step
        if at.last[lane]:
            return True
    return at.tried[lane] < MAX_STEPS


@njit(inline="always")
def _most_bent(x: Any, joints: int, lane: int) -> float:
    bent = 0.0
    for j in range(joints):
        bent = max(bent, abs(x[3 + j, lane]))
    return bent


@njit
def _describe(profile: Any, lag: Any, torque: Any, now: float, zero: float, springs: Any) -> None:
    """Describe the springs about ``now`` (s) for the right-hand side, whose own time begins at ``zero``."""
    for j in range(lag.size):
        ramping = now < profile[UNTIL, j]
        springs[j, ORIGIN] = (profile[SINCE, j] if ramping else profile[UNTIL, j]) - zero
        springs[j, LEVEL] = profile[FROM, j] - profile[RAMP, j] * lag[j] if ramping else profile[GOAL, j]
        springs[j, SLOPE] = profile[RAMP, j] if ramping else 0.0
        springs[j, BEHIND], springs[j, DECAY] = 0.0, 0.0
        if lag[j] > 0.0:
            springs[j, BEHIND] = profile[RAMPING, j] if ramping else profile[SETTLING, j]
            springs[j, DECAY] = 1.0 / lag[j]
        springs[j, TORQUE] = torque[j]


walk_alone = _carrier(1)
""":func:`carry`, one robot after the other on this thread."""

walk_abreast = _carrier(LANES)
""":func:`carry` in lanes on this thread: waking other threads takes longer than a step of a few robots."""


@parallel_njit
def walk(
    groups: int, rows: Any, pieces: Any, robots: Any, tolerance: float, states: Any, step: Any, status: Any, record: Any
) -> bool:
    """Run :func:`carry` in groups of robots, one thread for each group; the results depend on neither."""
    if not _fit(rows, pieces, robots, states, step, status, record):
        return False
    for group in numba.prange(groups):
        mine = rows[group * rows.size // groups : (group + 1) * rows.size // groups]
        walk_abreast(mine, pieces, robots, tolerance, states, step, status, record)
    return True


def carry(
    rows: Any, pieces: Pieces, robots: Robots, tolerance: float, states: Any, step: Any, status: Any, record: Any
) -> None:
    """Carry robots through all pieces of time, in place, on all cores; each robot on its own, step by step.

    ``rows`` are the numbers of the robots that walk, at least one. States have poses behind, shape (robots, 2N+4).
    ``step`` is the first step, s, 0 for a guess, and becomes the last one; ``status`` becomes WALKING, or DIVERGED or
    OUT_OF_RANGE where a robot fails; both of shape (robots,). ``record`` has states over (samples, robots, 2N+4);
    samples that a robot does not reach stay unchanged. ParameterError if the shapes of arrays are inconsistent, or rows
    or pieces are empty.
    """
    what = (rows, pieces, robots, tolerance, states, step, status, record)
    threads = numba.get_num_threads()
    groups = min(rows.size // LANES, threads)  # each thread gets as many, whatever their size, and fills lanes anew
    if threads > 1 and groups > 1 and _work(rows, pieces, step) > _WORTH_WAKING:
        fits = walk(groups, *what)
    elif rows.size > 1:
        fits = walk_abreast(*what)
    else:
        fits = walk_alone(*what)
    if not fits:
        problem = "must fit the number of modules and walks, see carry()"
        raise ParameterError(problem, field="states", value=states.shape)


def _work(rows: Any, pieces: Pieces, step: Any) -> float:
    """Estimated time on one thread, s: at least one step in each piece, each as long as the last one of a robot."""
    steps = rows.size * (pieces.widths.size + pieces.widths.sum() / max(step[rows[0]], 1e-6))
    return float(_A_STEP * pieces.contact.shape[1] * steps)
