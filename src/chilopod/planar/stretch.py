"""The compiled loop of a simulation: many robots through one stretch of time in which nobody interferes."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from chilopod.compiled import copy_into, njit, parallel_njit
from chilopod.engine.actuators import FROM, GOAL, RAMPING, SETTLING, SINCE, UNTIL
from chilopod.engine.actuators import SLOPE as RAMP
from chilopod.integrate import integrator
from chilopod.planar.contact import MOMENTS, sum_moments
from chilopod.planar.dynamics import BEHIND, DECAY, LEVEL, ORIGIN, SCRATCH, SLOPE, TORQUE, rhs

WALKING, DIVERGED, OUT_OF_RANGE, HALTED = range(4)
MOST_BENT = 0.5 * np.pi
"""Of a yaw joint, rad: beyond it modules run into each other."""

_integrate = integrator(rhs)


@parallel_njit
def walk(
    rows: Any,
    starts: Any,
    widths: Any,
    interval: Any,
    sample: Any,
    contact: Any,
    stroke: Any,
    scalars: Any,
    feet: Any,
    stiffness: Any,
    damping: Any,
    friction: Any,
    yaw: Any,
    tolerance: float,
    states: Any,
    step: Any,
    status: Any,
    record: Any,
) -> None:
    """Carry robots through all pieces of time, in place, on all cores; each robot on its own, step by step.

    Parameters
    ----------
    rows
        Which robots.
    starts, widths
        Where in its contact interval each piece starts and how long it lasts, s, shape (pieces,).
    interval
        The contact interval each piece belongs to, shape (pieces,).
    sample
        Where in ``record`` the state at the end of a piece goes, -1 for nowhere, shape (pieces,).
    contact, stroke
        By interval: whether each foot stands, and where it is at the start (m ahead of mid-stroke), shape
        (intervals, N, 2).
    scalars, feet
        Of the robots: see ``dynamics.py``, shape (robots, 4); forward offset and half-width, m, shape (robots, 2).
    stiffness, damping
        N*m/rad and N*m*s/rad, shape (robots, N-1).
    friction
        Of every foot, N*s/m, shape (robots, N, 2).
    yaw
        Of the legs of module 1, rad, shape (robots, 2).
    tolerance
        Of the integrator, relative to max(1, |x|).
    states
        Reduced states with poses behind, shape (robots, 2N+4).
    step
        To start with, s; 0 for a guess; the last one is left there, shape (robots,).
    status
        WALKING, DIVERGED, OUT_OF_RANGE or HALTED; robots that no longer walk are left alone, shape (robots,).
    record
        States over (samples, robots, 2N+4); what no robot reached is left alone.
    """
    for row in numba.prange(rows.size):
        walk_alone(
            rows[row], starts, widths, interval, sample, contact, stroke, scalars, feet, stiffness, damping, friction,
            yaw, tolerance, states, step, status, record,
        )  # fmt: skip


@njit
def walk_alone(
    r: int, starts: Any, widths: Any, interval: Any, sample: Any, contact: Any, stroke: Any, scalars: Any, feet: Any,
    stiffness: Any, damping: Any, friction: Any, yaw: Any, tolerance: float, states: Any, step: Any, status: Any,
    record: Any,
) -> None:  # fmt: skip
    """As :func:`walk`, for one robot on this thread: waking the others takes longer than a step of one robot."""
    if status[r] != WALKING:
        return
    n = contact.shape[1]
    x = states[r].copy()
    work = np.empty((16, x.size))
    scratch = np.empty((n, SCRATCH))
    moments = np.empty((n, MOMENTS))
    args = (scalars[r], stiffness[r], damping[r], moments, scratch)
    current = -1
    h = step[r]
    for s in range(widths.size):
        if interval[s] != current:
            current = interval[s]
            sum_moments(contact[current], stroke[current], friction[r], feet[r, 0], feet[r, 1], yaw[r], moments)
        h, reached = _integrate(args, x, starts[s], starts[s] + widths[s], h, tolerance, work)
        status[r] = _judged(x, n, reached)
        if status[r] != WALKING:
            break
        if sample[s] >= 0:
            copy_into(record[sample[s], r], x)
    copy_into(states[r], x)
    step[r] = h


@parallel_njit
def drive(
    rows: Any,
    begins: Any,
    starts: Any,
    widths: Any,
    interval: Any,
    sample: Any,
    contact: Any,
    stroke: Any,
    scalars: Any,
    feet: Any,
    profile: Any,
    lag: Any,
    torque: Any,
    damping: Any,
    friction: Any,
    yaw: Any,
    tolerance: float,
    states: Any,
    step: Any,
    status: Any,
    record: Any,
) -> None:
    """As :func:`walk`, for robots whose springs change or whose joints are driven.

    No step straddles the end of a ramp.

    Parameters
    ----------
    begins
        When each piece begins, s, shape (pieces,).
    profile, lag, torque
        See :class:`chilopod.engine.Actuators`, shapes (7, robots, N-1), (robots, N-1), (robots, N-1).
    """
    for row in numba.prange(rows.size):
        drive_alone(
            rows[row], begins, starts, widths, interval, sample, contact, stroke, scalars, feet, profile, lag, torque,
            damping, friction, yaw, tolerance, states, step, status, record,
        )  # fmt: skip


@njit
def drive_alone(
    r: int, begins: Any, starts: Any, widths: Any, interval: Any, sample: Any, contact: Any, stroke: Any,
    scalars: Any, feet: Any, profile: Any, lag: Any, torque: Any, damping: Any, friction: Any, yaw: Any,
    tolerance: float, states: Any, step: Any, status: Any, record: Any,
) -> None:  # fmt: skip
    """As :func:`drive`, for one robot on this thread."""
    if status[r] != WALKING:
        return
    n = contact.shape[1]
    x = states[r].copy()
    work = np.empty((16, x.size))
    scratch = np.empty((n, SCRATCH))
    moments = np.empty((n, MOMENTS))
    springs = np.empty((n - 1, 6))
    args = (scalars[r], springs, damping[r], moments, scratch)
    current = -1
    h = step[r]
    for s in range(widths.size):
        if interval[s] != current:
            current = interval[s]
            sum_moments(contact[current], stroke[current], friction[r], feet[r, 0], feet[r, 1], yaw[r], moments)
        done = 0.0
        while done < widths[s] and status[r] == WALKING:
            end = widths[s]
            for j in range(n - 1):
                ramp_left = profile[UNTIL, r, j] - begins[s]
                if done < ramp_left < end:
                    end = ramp_left
            middle = begins[s] + 0.5 * (done + end)
            _describe(profile[:, r], lag[r], torque[r], middle, begins[s] - starts[s], springs)
            h, reached = _integrate(args, x, starts[s] + done, starts[s] + end, h, tolerance, work)
            status[r] = _judged(x, n, reached)
            done = end
        if status[r] != WALKING:
            break
        if sample[s] >= 0:
            copy_into(record[sample[s], r], x)
    copy_into(states[r], x)
    step[r] = h


@njit
def _judged(x: Any, n: int, reached: bool) -> int:
    if not reached:
        return DIVERGED
    bent = 0.0
    for j in range(n - 1):
        bent = max(bent, abs(x[3 + j]))
    return OUT_OF_RANGE if bent > MOST_BENT else WALKING


@njit
def _describe(profile: Any, lag: Any, torque: Any, now: float, zero: float, springs: Any) -> None:
    """What the right-hand side wants to know of the springs about ``now`` (s); its own time begins at ``zero``."""
    for j in range(lag.size):
        ramping = now < profile[UNTIL, j]
        springs[j, ORIGIN] = (profile[SINCE, j] if ramping else profile[UNTIL, j]) - zero
        springs[j, LEVEL] = profile[FROM, j] - profile[RAMP, j] * lag[j] if ramping else profile[GOAL, j]
        springs[j, SLOPE] = profile[RAMP, j] if ramping else 0.0
        springs[j, BEHIND] = 0.0
        springs[j, DECAY] = 0.0
        if lag[j] > 0.0:
            springs[j, BEHIND] = profile[RAMPING, j] if ramping else profile[SETTLING, j]
            springs[j, DECAY] = 1.0 / lag[j]
        springs[j, TORQUE] = torque[j]
