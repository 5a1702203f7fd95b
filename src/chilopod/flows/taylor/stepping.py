"""The solution of dx/dt = f(t, x) over an interval, with its derivative, through switches and events, in compiled code.

Steps are as long as the Taylor series allows: the last coefficients of every state, entry of the derivative and
switching function are below the tolerance relative to the largest of the same series, so that units do not matter
(compare Jorba and Zou, *Experimental Mathematics* 14, 99, 2005). A step ends where a switching function leaves its
branch. There the derivative is multiplied by the saltation matrix (Leine and Nijmeijer, *Dynamics and Bifurcations of
Non-Smooth Mechanical Systems*, Springer 2004, ch. 7)

    S = Dr + (f+ - r') grad g / g',        r' = r_t + Dr f-,  g' = g_t + grad g f-,

with the state r(t, x) after the event, r = x where only f switches; both r' and g' are first Taylor coefficients.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.flows.carrying import BUDGET, CHATTERS, DONE, GRAZES, NOT_FINITE, SHORT, STALLED, TIME_OVER
from chilopod.flows.taylor.step_length import agrees, first_exit, step_size
from chilopod.flows.taylor.switching import Motion, await_events, cross, is_timed, settle, start
from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.series import expand, loaded

_ROUNDING = 2.0**-53
_FIRST = 0.37  # longest first step of the second computation, relative to the interval
_BLOCK = 64
_AT_ONCE = 1e-13
"""Smallest difference of two instants, relative to the time: an event nearer to an interval's border is on it."""


class Control(NamedTuple):
    """Step control of an integration."""

    epsilon: float  # truncation error of a step relative to the size of each state and entry of the derivative
    order: int  # order of the series
    most_steps: int  # budget of steps in an interval
    # number of steps after which, and at every doubling, the budget must suffice for the rest of the interval at the
    # mean length of a step so far; 0 for no such test
    patience: int
    shortest: float  # step, relative to the interval, at which the caller decides; 0 for none
    shake: float  # relative disturbance of every state after every step, and of the time before it: enlarged round-off
    # True if every step computes its own derivative, which multiplies the derivative so far; else a step carries the
    # columns of the derivative, which may be any directions
    stepwise: bool
    stop: Any  # shape (1,); not zero once there is no more time


class Outcome(NamedTuple):
    """Results that an integration fills in."""

    derivative: Any  # shape (n, columns), multiplied by the derivative; shape (n, 0) for none
    bound: Any  # bound of its error where steps compute their own derivatives, shape (n, n); shape (0, 0) for none
    report: Any  # number of steps, and the time reached, shape (2,)


class _Block(NamedTuple):
    """Derivatives of some steps, and bounds of their errors, shapes (steps, n, n)."""

    factors: Any
    errors: Any


@fused_njit(error_model="numpy")
def _first_crossing(
    tape: Any, series: Any, order: int, h: float, remaining: float, soon: float, work: Any
) -> tuple[float, int, float]:
    """Time, number and sign of the slope of the first switch that leaves its branch; number -1 if none does.

    Among switches within a time ``soon`` of each other, whose order is round-off, the first of the list counts. Events
    of guards that depend on time only belong to the next interval if they happen that shortly before the end.
    """
    switches, branches = tape.switches, series.branches
    found, crossing, direction = h, -1, 0.0
    for s in range(switches.shape[1]):
        g = series.values[switches[1, s]]
        ends = 2 if switches[0, s] == ops.FLOOR else 1
        for end in range(ends):
            # The function that stays positive on the branch: g, -g, g - floor or floor + 1 - g.
            sign = (1.0 - 2.0 * end) if switches[0, s] == ops.FLOOR else branches[s]
            for k in range(order + 1):
                work[k] = sign * g[k]
            if switches[0, s] == ops.FLOOR:
                work[0] -= sign * (branches[s] + end)
            z = first_exit(work, order, found)
            if z > remaining - soon and is_timed(tape, s):
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
def _absorb(block: Any, count: int, total: Any, bound: Any) -> None:
    """Multiply the derivative by the factors of a block of steps, and carry the bound of its error, to which a step
    with error e_s adds |P_s| e_s |D_s|, with D_s the product before it and P_s the product after it."""
    n = total.shape[0]
    before = np.empty((count + 1, n, n))
    _assign(before[0], np.eye(n))
    for s in range(count):
        _assign(before[s + 1], block.factors[s] @ before[s])
    after = np.eye(n)
    fresh = np.zeros((n, n))
    for s in range(count - 1, -1, -1):
        fresh += np.abs(after) @ block.errors[s] @ np.abs(before[s])
        after = after @ block.factors[s]
    _assign(bound, np.abs(before[count]) @ bound + fresh @ np.abs(total))
    _assign(total, before[count] @ total)


@fused_njit(error_model="numpy", inline="always")
def _multiply(block: Any, count: int, factor: Any, stepwise: bool, outcome: Any) -> int:
    """Take a factor, the last of ``count`` + 1 in the block, into the derivative; return the number in the block."""
    if outcome.bound.shape[0] > 0:
        _assign(block.factors[count], factor)
        count += 1
        if count == _BLOCK:
            _absorb(block, count, outcome.derivative, outcome.bound)
            count = 0
    elif factor.shape[1] > 0:
        _assign(outcome.derivative, factor @ outcome.derivative if stepwise else factor)
    return count


@fused_njit(error_model="numpy", inline="always")
def _expanded(tape: Any, motion: Any, control: Any, t: float, steps: int, unit: float) -> tuple[bool, float]:
    """Expand the series of a step; return True if it is finite, and the unit of time in which it is."""
    n, order, switches = tape.layout[0], control.order, tape.switches
    values, tangents, columns = motion.series.values, motion.series.tangents, motion.seeds.shape[1]
    for _ in range(24):
        start(tape, motion, t)
        if control.shake > 0.0:
            values[n, 0] = t * (1.0 + (0.5 * control.shake if steps % 3 else -control.shake))
        expand(tape, order, tape.layout[4], unit, motion.series)
        s = 0.0
        for i in range(n):
            s += abs(values[i, order]) + abs(values[i, 1])
            for j in range(columns):
                s += abs(tangents[i, order, j])
        for k in range(switches.shape[1]):
            s += abs(values[switches[1, k], 0]) + abs(values[switches[1, k], order])
        if s < math.inf:
            return True, unit
        unit *= 1e-3  # the powers of a unit of time that is far too long overflow
    return False, unit


@fused_njit(error_model="numpy", inline="always")
def _step(tape: Any, motion: Any, control: Any, h: float, noise: int, factor: Any) -> int:
    """Take a step: the state at its end, and the derivative along the seeds in ``factor``; return the next noise."""
    values, tangents, order = motion.series.values, motion.series.tangents, control.order
    for i in range(tape.layout[0]):
        s = 0.0
        for k in range(order, -1, -1):
            s = s * h + values[i, k]
        if control.shake > 0.0:
            noise = (noise * 1103515245 + 12345) % 2147483648
            s *= 1.0 + (control.shake if noise >= 1073741824 else -control.shake)
        motion.x[i] = s
        for j in range(factor.shape[1]):
            s = 0.0
            for k in range(order, -1, -1):
                s = s * h + tangents[i, k, j]
            factor[i, j] = s
    return noise


@fused_njit(error_model="numpy", inline="always")
def _bound_step(tangents: Any, order: int, h: float, error: Any) -> None:
    """Bound on the error of the derivative of a step: round-off of its terms, and the last terms."""
    n, last = error.shape[0], h**order
    for i in range(n):
        for j in range(n):
            s = 0.0
            for k in range(order, 0, -1):
                s = (s + abs(tangents[i, k, j])) * h
            error[i, j] = 4.0 * _ROUNDING * s + abs(tangents[i, order, j]) * last
        error[i, i] += 2.0 * _ROUNDING


@fused_njit(error_model="numpy", inline="always")
def _enlarge_scales(tape: Any, motion: Any, order: int, h: float) -> None:
    """Keep the largest values of the switching functions."""
    for s in range(tape.switches.shape[1]):
        power = 1.0
        for k in range(order + 1):
            motion.scales[s] = max(motion.scales[s], abs(motion.series.values[tape.switches[1, s], k]) * power)
            power *= h


@fused_njit(error_model="numpy", inline="always")
def _chosen(
    tape: Any, directions: Any, clock: Any, motion: Any, control: Any, when: Any, steps: int, work: Any
) -> tuple[float, int, float]:
    """Length of a step, and the switch at its end; ``when``: time, its unit, units that remain, and equal ones."""
    t, unit, remaining, soon = when
    series, order = motion.series, control.order
    h = step_size(tape, series, motion.seeds.shape[1], order, remaining, control.epsilon)
    if control.shake > 0.0 and steps == 1:  # no step equals one of the other computation and rounds alike
        h = min(h, _FIRST * remaining)
    elif h < remaining and h > 0.5 * remaining:
        h = 0.5 * remaining
    crossing, direction = -1, 0.0
    if directions is not None:
        h, crossing, direction = _first_crossing(tape, series, order, h, remaining, soon, work)
    shorter = agrees(tape, clock, series, order, t, h, unit)
    while shorter < h:
        h, crossing = shorter, -1
        shorter = agrees(tape, clock, series, order, t, h, unit)
    return h, crossing, direction


@fused_njit(error_model="numpy", inline="always")
def _spent(control: Any, steps: int, done: float, whole: float) -> int:
    """DONE if time and budget allow another step; the budget must last to the end, of which a part is done."""
    if control.stop[0] != 0.0:
        return TIME_OVER
    check = control.patience
    while 0 < check < steps:
        check *= 2
    beyond = check == steps and steps * whole > control.most_steps * done
    return BUDGET if beyond or steps > control.most_steps else DONE


@fused_njit(error_model="numpy")
def _begun(tape: Any, params: Any, x: Any, control: Any, derivative: Any) -> Any:
    """The motion at its start, with room for its series."""
    columns, switches = derivative.shape[1], tape.switches.shape[1]
    series = loaded(tape, params, control.order + 1, columns, np.zeros(switches))
    seeds = np.eye(x.size) if control.stepwise and columns > 0 else derivative
    return Motion(x, seeds, series, np.zeros(switches))


@fused_njit(error_model="numpy", nogil=True)
def advance(tape: Any, directions: Any, clock: Any, params: Any, x: Any, span: Any, control: Any, outcome: Any) -> int:
    """Carry a state x, shape (n,), from the start to the end of a span in place; return the status. The ``directions``
    of the events are None for a tape without switches, whose code is then not compiled; a ``clock`` has functions of
    time on a grid over the period, each with its largest modulus last, and the period."""
    t0, t1 = span
    n, order, switches = tape.layout[0], control.order, tape.switches.shape[1]
    columns = outcome.derivative.shape[1]
    motion = _begun(tape, params, x, control, outcome.derivative)
    with_bound = outcome.bound.shape[0] > 0
    blocks = _BLOCK if with_bound else 0
    block = _Block(np.empty((blocks, n, n)), np.empty((blocks, n, n)))
    factor, work = np.empty((n, columns)), np.empty(order + 1)
    t, last, unit = t0, t0 - (t1 - t0), (t1 - t0) / 8.0
    steps, crowded, in_block, noise, status = 0, 0, 0, 1, DONE
    at_once = _AT_ONCE * max(abs(t0), abs(t1))
    if directions is not None:
        start(tape, motion, t)
        status = settle(tape, motion, unit)
        await_events(tape, directions, motion, unit, at_once / unit, t)
    while t < t1 and status == DONE:
        steps += 1
        status = _spent(control, steps, t - t0, t1 - t0)
        if status != DONE:
            break
        finite, unit = _expanded(tape, motion, control, t, steps, unit)
        if not finite:
            status = NOT_FINITE
            break
        remaining, soon = (t1 - t) / unit, at_once / unit
        when = t, unit, remaining, soon
        h, crossing, direction = _chosen(tape, directions, clock, motion, control, when, steps, work)
        reached = t1 if h >= remaining else min(t + h * unit, t1)
        if crossing >= 0:
            crowded = crowded + 1 if reached - last <= at_once else 0
        elif reached - t <= control.shortest * (t1 - t0) and reached < t1:
            status = STALLED if reached == t else SHORT
            break
        if crowded > 2 * switches + 8:
            status = CHATTERS
            break
        h = (reached - t) / unit
        _enlarge_scales(tape, motion, order, h)
        noise = _step(tape, motion, control, h, noise, factor)
        if with_bound:
            _bound_step(motion.series.tangents, order, h, block.errors[in_block])
        in_block = _multiply(block, in_block, factor, control.stepwise, outcome)
        t = reached
        unit *= min(max(h, 1e-3), 1e3) if h > 0.0 else 1.0
        if directions is not None and crossing >= 0:
            status = cross(tape, directions, motion, crossing, direction, unit, t, factor)
            if status == GRAZES and t - last <= 1e-6 * (t - t0):
                status = CHATTERS
            last = t
            if with_bound:
                _assign(block.errors[in_block], 16.0 * _ROUNDING * np.abs(factor))
            in_block = _multiply(block, in_block, factor, control.stepwise, outcome)
    if with_bound and in_block > 0:
        _absorb(block, in_block, outcome.derivative, outcome.bound)
    outcome.report[0], outcome.report[1] = steps, t
    return status


@fused_njit(error_model="numpy", nogil=True)
def advance_each(
    tape: Any, directions: Any, clock: Any, params: Any, states: Any, span: Any, control: Any, outcome: Any
) -> int:
    """Carry several states, shape (states, n), without derivatives; return the first status that is not DONE."""
    for i in range(states.shape[0]):
        status = advance(tape, directions, clock, params, states[i], span, control, outcome)
        if status != DONE:
            return status
    return DONE
