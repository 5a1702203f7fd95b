"""The solution of dx/dt = f(t, x) over an interval, with its derivative, through switches and events, in compiled code.

A step (:func:`advance`) expands the series of the state and its derivative, chooses its length, evaluates the series
at its end, multiplies the derivative so far by its own (:mod:`.product`), and passes the switch that it met, if any
(:mod:`.switching`). Times within a step are counted in a unit of about its length, so that the coefficients of the
series do not overflow.

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

from chilopod.compiled import assign, fused_njit
from chilopod.flows.carrying import BUDGET, CHATTERS, DONE, GRAZES, NOT_FINITE, SHORT, STALLED, TIME_OVER
from chilopod.flows.taylor.crossing import first_crossing
from chilopod.flows.taylor.product import BLOCK, ROUNDING, Product, absorb, bound_error, multiply
from chilopod.flows.taylor.step_length import agrees, step_size
from chilopod.flows.taylor.switching import Motion, await_events, cross, enlarge_scales, settle, start
from chilopod.flows.tracing.series import expand, loaded

_FIRST = 0.37  # longest first step of the second computation, relative to the interval
_BORDER = 1e-9  # part of an interval at its ends in which passages do not count: rounding may put them beyond
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
    """Results that an integration fills in, beside the state."""

    derivative: Any  # shape (n, columns), multiplied by the derivative; shape (n, 0) for none
    bound: Any  # bound of its error where steps compute their own derivatives, shape (n, n); shape (0, 0) for none
    met: Any  # numbers of passages of the switches, shape (switches,)


@fused_njit(error_model="numpy")
def advance(
    tape: Any, directions: Any, clock: Any, params: Any, x: Any, span: Any, control: Any, outcome: Any
) -> tuple[int, int, float]:
    """Carry a state x, shape (n,), from the start to the end of a span in place; return the status, the number of steps
    and the time reached. The ``directions`` of the events are None for a tape without switches, whose code is then not
    compiled; a ``clock`` has functions of time on a grid over the period, each with its largest modulus last, and the
    period."""
    t0, t1 = span
    n, order, switches, columns = tape.layout[0], control.order, tape.switches.shape[1], outcome.derivative.shape[1]
    series = loaded(tape, params, order + 1, columns, np.zeros(switches))
    seeds = np.eye(n) if control.stepwise and columns > 0 else outcome.derivative
    motion = Motion(x, seeds, series, np.zeros(switches))
    with_bound, factor, work = outcome.bound.shape[0] > 0, np.empty((n, columns)), np.empty(order + 1)
    blocks = BLOCK if with_bound else 0
    product = Product(outcome.derivative, outcome.bound, np.empty((blocks, n, n)), np.empty((blocks, n, n)))
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
            return status, steps, t
        finite, unit = _expanded(tape, motion, control, t, steps, unit)
        if not finite:
            return NOT_FINITE, steps, t
        remaining, soon = (t1 - t) / unit, at_once / unit
        when = t, unit, remaining, soon
        h, crossing, direction = _chosen(tape, directions, clock, motion, control, when, steps, work)
        reached = t1 if h >= remaining else min(t + h * unit, t1)
        if crossing >= 0:
            crowded = crowded + 1 if reached - last <= at_once else 0
        elif reached - t <= control.shortest * (t1 - t0) and reached < t1:
            return STALLED if reached == t else SHORT, steps, t
        if crowded > 2 * switches + 8:
            return CHATTERS, steps, t
        h = (reached - t) / unit
        enlarge_scales(tape, motion, order, h)
        noise = _step(tape, motion, control, h, noise, factor)
        if with_bound:
            bound_error(series.tangents, order, h, product.errors[in_block])
        in_block = multiply(product, in_block, factor, control.stepwise)
        t = reached
        unit *= min(max(h, 1e-3), 1e3) if h > 0.0 else 1.0
        if directions is not None and crossing >= 0:
            outcome.met[crossing] += min(t - t0, t1 - t) > _BORDER * (t1 - t0)
            status = cross(tape, directions, motion, crossing, direction, unit, t, factor)
            if status == GRAZES and t - last <= 1e-6 * (t - t0):
                status = CHATTERS
            last = t
            if with_bound:
                assign(product.errors[in_block], 16.0 * ROUNDING * np.abs(factor))
            in_block = multiply(product, in_block, factor, control.stepwise)
    if in_block > 0:
        absorb(product, in_block)
    return status, steps, t


@fused_njit(error_model="numpy")
def advance_each(
    tape: Any, directions: Any, clock: Any, params: Any, states: Any, span: Any, control: Any, outcome: Any
) -> tuple[int, int, float]:
    """Carry several states, shape (states, n), without derivatives, up to the first that does not reach the end."""
    for i in range(states.shape[0]):  # a loop over the rows would compile `advance` once more, for strided arrays
        status, steps, t = advance(tape, directions, clock, params, states[i], span, control, outcome)
        if status != DONE:
            return status, steps, t
    return DONE, 0, span[1]


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
        h, crossing, direction = first_crossing(tape, series, order, h, remaining, soon, work)
    shorter = agrees(tape, clock, series, order, t, h, unit)
    while shorter < h:
        h, crossing = shorter, -1
        shorter = agrees(tape, clock, series, order, t, h, unit)
    return h, crossing, direction


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
