"""The solution of dx/dt = f(t, x) over an interval, with its derivative, through switches and events, in compiled code.

Steps are as long as the Taylor series allows: the last coefficients of every state, every entry of the derivative and
every switching function are below the tolerance relative to the largest of its own, so that units do not matter
(compare Jorba and Zou, *Experimental Mathematics* 14, 99, 2005). A step ends where a switching function leaves its
branch. There the derivative is multiplied by the saltation matrix (Leine and Nijmeijer, *Dynamics and Bifurcations of
Non-Smooth Mechanical Systems*, Springer 2004, ch. 7)

    S = Dr + (f+ - r') grad g / g',        r' = r_t + Dr f-,  g' = g_t + grad g f-,

with the state r(t, x) after the event, r = x where only f switches; both r' and g' are first Taylor coefficients.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.stability.taylor import tape as ops
from chilopod.stability.taylor.exits import first_exit
from chilopod.stability.taylor.series import LANES, expand, load
from chilopod.stability.taylor.step_length import agrees, step_size
from chilopod.stability.taylor.switching import (
    BUDGET,
    CHATTERS,
    DONE,
    GRAZES,
    NOT_FINITE,
    STALLED,
    await_events,
    cross,
    is_timed,
    settle,
    start,
)

_ROUNDING = 2.0**-53
_FIRST = 0.37  # of the interval: the first step of the second of two computations is no longer
_BLOCK = 64
_AT_ONCE = 1e-13
"""Smallest difference of two instants, relative to the time: an event nearer to the border of an interval is on it."""


@fused_njit(error_model="numpy")
def _first_crossing(
    program: Any,
    switches: Any,
    order: int,
    h: float,
    remaining: float,
    soon: float,
    values: Any,
    branches: Any,
    work: Any,
) -> tuple[float, int, float]:
    """When the first switch leaves its branch, which, and with which sign of the slope; number -1 if none does.

    Of those within a time ``soon`` of each other, which only rounding tells apart, it is the first of the list. Events
    of guards that know only time are left to the next interval where they happen so shortly before the ``remaining``
    time is over.
    """
    found, crossing, direction = h, -1, 0.0
    for s in range(switches.shape[1]):
        g = values[switches[1, s]]
        ends = 2 if switches[0, s] == ops.FLOOR else 1
        for end in range(ends):
            # What stays positive on the branch: g, -g, g - floor or floor + 1 - g.
            sign = (1.0 - 2.0 * end) if switches[0, s] == ops.FLOOR else branches[s]
            for k in range(order + 1):
                work[k] = sign * g[k]
            if switches[0, s] == ops.FLOOR:
                work[0] -= sign * (branches[s] + end)
            z = first_exit(work, order, found)
            if z > remaining - soon and is_timed(program, switches, s):
                continue
            if z >= 0.0 and (crossing < 0 or z < found - soon):
                found, crossing, direction = z, s, -sign
    return found, crossing, direction


@fused_njit(error_model="numpy")
def _assign(matrix: Any, values: Any) -> None:
    """Write values into a matrix: ``matrix[:] = values`` takes seconds to compile."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = values[i, j]


@fused_njit(error_model="numpy")
def _absorb(factors: Any, errors: Any, count: int, total: Any, bound: Any) -> None:
    """Multiply the derivative by the factors of a block of steps, and carry the bound of its error.

    A step that errs by e_s contributes |P_s| e_s |D_s|, D_s what came before it and P_s what came after it.
    """
    n = total.shape[0]
    before = np.empty((count + 1, n, n))
    for i in range(n):
        for j in range(n):
            before[0, i, j] = 1.0 if i == j else 0.0
    for s in range(count):
        _assign(before[s + 1], factors[s] @ before[s])
    after = np.eye(n)
    fresh = np.zeros((n, n))
    for s in range(count - 1, -1, -1):
        fresh += np.abs(after) @ errors[s] @ np.abs(before[s])
        after = after @ factors[s]
    _assign(bound, np.abs(before[count]) @ bound + fresh @ np.abs(total))
    _assign(total, before[count] @ total)


@fused_njit(error_model="numpy", nogil=True)
def advance(
    tape: Any,
    directions: Any,
    clock: Any,
    params: Any,
    x: Any,
    t0: float,
    t1: float,
    epsilon: float,
    order: int,
    most_steps: int,
    shake: float,
    stepwise: bool,
    derivative: Any,
    bound: Any,
    events: Any,
    report: Any,
) -> int:
    """Carry a state from t0 to t1 > t0 in place.

    Parameters
    ----------
    tape
        program, terms, numbers, layout, slopes, switches, resets, clocks of the tape.
    directions
        Directions of its events; None where the tape has no switches, and what goes through them is not compiled.
    clock
        Values of the functions of time on a grid over the period, the last of each the largest modulus, and the period.
    shake
        Relative error made in every state after every step, and in the time before it: round-off, enlarged.
    stepwise
        Whether every step computes its own derivative, shape (n, n), by which ``derivative`` is then multiplied; else
        it carries the columns of ``derivative`` along, of which there may be any number: directions.
    derivative, bound
        Shape (n, columns), multiplied by the derivative, and (n, n), the bound of its error where ``stepwise``; shapes
        (n, 0) and (0, 0) for none.
    events
        Shape (most, 2): filled with time and number of the events.
    report
        Shape (4,): filled with the number of steps, of crossings, of events, and the time reached.
    """
    program, terms, numbers, layout, slopes, switches, resets, clocks = tape
    table, period = clock
    n = layout[0]
    columns = derivative.shape[1]
    with_tangents = columns > 0
    seeds = np.eye(n) if stepwise and with_tangents else derivative
    lanes = (columns + LANES - 1) // LANES * LANES
    values = np.zeros((layout[5], order + 1))
    tangents = np.zeros((layout[5], order + 1, lanes))
    count_switches = switches.shape[1]
    branches = np.zeros(count_switches)
    scales = np.zeros(count_switches)
    work = np.empty(order + 1)
    factor = np.empty((n, columns))
    with_bound = bound.shape[0] > 0
    factors = np.empty((_BLOCK if with_bound else 0, n, n))
    errors = np.empty((_BLOCK if with_bound else 0, n, n))
    in_block = 0
    load(program, terms, numbers, layout, params, values)
    t = t0
    unit = (t1 - t0) / 8.0
    status = DONE
    steps = 0
    crossings = 0
    passed = 0
    in_place = 0
    last = t0 - (t1 - t0)
    noise = 1
    at_once = _AT_ONCE * max(abs(t0), abs(t1))
    if directions is not None:
        start(layout, x, t, seeds, values, tangents)
        status = settle(program, terms, layout, slopes, switches, unit, values, tangents, branches, scales)
        await_events(
            program,
            terms,
            layout,
            slopes,
            switches,
            resets,
            directions,
            unit,
            at_once / unit,
            x,
            t,
            seeds,
            values,
            tangents,
            branches,
            scales,
        )
    while t < t1 and status == DONE:
        steps += 1
        if steps > most_steps:
            status = BUDGET
            break
        finite = False
        for _ in range(24):
            start(layout, x, t, seeds, values, tangents)
            if shake > 0.0:
                values[n, 0] = t * (1.0 + (0.5 * shake if steps % 3 else -shake))
            expand(program, terms, layout, slopes, order, values, tangents, branches, layout[4], unit)
            s = 0.0
            for i in range(n):
                s += abs(values[i, order]) + abs(values[i, 1])
                for j in range(columns):
                    s += abs(tangents[i, order, j])
            for k in range(count_switches):
                s += abs(values[switches[1, k], 0]) + abs(values[switches[1, k], order])
            finite = s < math.inf
            if finite:
                break
            unit *= 1e-3  # the powers of a unit of time that is far too long overflow
        if not finite:
            status = NOT_FINITE
            break
        remaining = (t1 - t) / unit
        h = step_size(layout, switches, order, remaining, epsilon, values, tangents, columns)
        if shake > 0.0 and steps == 1:  # no step is one of the other computation's, whose rounding would be the same
            h = min(h, _FIRST * remaining)
        elif h < remaining and h > 0.5 * remaining:
            h = 0.5 * remaining
        crossing = -1
        direction = 0.0
        if directions is not None:
            soon = at_once / unit
            h, crossing, direction = _first_crossing(
                program, switches, order, h, remaining, soon, values, branches, work
            )
        shorter = agrees(clocks, table, period, t, h, unit, order, values)
        while shorter < h:
            h = shorter
            crossing = -1
            shorter = agrees(clocks, table, period, t, h, unit, order, values)
        ends = h >= remaining
        reached = t1 if ends else t + h * unit
        if reached > t1:
            reached = t1
        if reached == t:
            in_place += 1
            if crossing < 0:
                status = STALLED
                break
            if in_place > 2 * count_switches + 8:
                status = CHATTERS
                break
        else:
            in_place = 0
        h = (reached - t) / unit
        for s in range(count_switches):
            power = 1.0
            for k in range(order + 1):
                scales[s] = max(scales[s], abs(values[switches[1, s], k]) * power)
                power *= h
        for i in range(n):
            s = 0.0
            for k in range(order, -1, -1):
                s = s * h + values[i, k]
            if shake > 0.0:
                noise = (noise * 1103515245 + 12345) % 2147483648
                s *= 1.0 + (shake if noise >= 1073741824 else -shake)
            x[i] = s
            for j in range(columns):
                s = 0.0
                for k in range(order, -1, -1):
                    s = s * h + tangents[i, k, j]
                factor[i, j] = s
        if with_bound:
            for i in range(n):
                for j in range(n):
                    s = 0.0
                    for k in range(order, 0, -1):
                        s = (s + abs(tangents[i, k, j])) * h
                    errors[in_block, i, j] = 4.0 * _ROUNDING * s + abs(tangents[i, order, j]) * h**order
                    factors[in_block, i, j] = factor[i, j]
                errors[in_block, i, i] += 2.0 * _ROUNDING
            in_block += 1
            if in_block == _BLOCK:
                _absorb(factors, errors, in_block, derivative, bound)
                in_block = 0
        elif with_tangents:
            _assign(derivative, factor @ derivative if stepwise else factor)
        t = reached
        unit *= min(max(h, 1e-3), 1e3) if h > 0.0 else 1.0
        if directions is not None and crossing >= 0:
            crossings += 1
            status, event = cross(
                program,
                terms,
                layout,
                slopes,
                switches,
                resets,
                directions,
                crossing,
                direction,
                unit,
                x,
                t,
                seeds,
                values,
                tangents,
                branches,
                scales,
                factor,
            )
            if status == GRAZES and t - last <= 1e-6 * (t - t0):
                status = CHATTERS
            last = t
            if event >= 0:
                if passed < events.shape[0]:
                    events[passed, 0] = t
                    events[passed, 1] = event
                passed += 1
            if with_bound:
                for i in range(n):
                    for j in range(n):
                        factors[in_block, i, j] = factor[i, j]
                        errors[in_block, i, j] = 16.0 * _ROUNDING * abs(factor[i, j])
                in_block += 1
                if in_block == _BLOCK:
                    _absorb(factors, errors, in_block, derivative, bound)
                    in_block = 0
            elif with_tangents:
                _assign(derivative, factor @ derivative if stepwise else factor)
    if with_bound and in_block > 0:
        _absorb(factors, errors, in_block, derivative, bound)
    report[0], report[1], report[2], report[3] = steps, crossings, passed, t
    return status
