"""The solution of a stiff dx/dt = f(t, x), with its derivative, by collocation at the Radau points, in compiled code.

Radau IIA with s stages is of order 2s - 1 and L-stable, so steps may be as long as the solution is smooth, however fast
disturbances of it decay (Hairer and Wanner, *Solving Ordinary Differential Equations II*, 2nd ed., Springer 1996,
sections IV.5 and IV.8). A step solves

    Y_i = x + h sum_j a_ij f(t + c_j h, Y_j),        x(t + h) = Y_s,

by Newton's method with the jacobian of every stage instead of the start's for all: the matrix of its last round,
1 - h a_ij J_j in block (i, j), then also appears in the derivative of these equations with respect to x,

    dY_i - h sum_j a_ij J_j dY_j = 1,

so one decomposition gives the exact derivative of the discrete map, all columns of it. One step control covers the
state and the columns of the derivative since the start. A disturbance that decays fast causes short steps at the
start until it has decayed, and long steps afterwards.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.flows.carrying import BUDGET, DONE, NOT_FINITE, STALLED, TIME_OVER
from chilopod.flows.implicit.stages import Problem, Step, estimated, stages, turn
from chilopod.flows.tracing.series import loaded, slope_at

_PATIENCE, _HOPELESS = 2048, 16.0  # steps, and factor on the budget, beyond which the mean step is hopelessly short
_FASTEST_FALL, _FASTEST_GROWTH, _SAFETY = 0.1, 6.0, 0.9


class Interval(NamedTuple):
    """An interval of time on which the right-hand side is smooth."""

    # start and end
    t0: float
    t1: float
    longest: float  # longest step
    branches: Any  # branches of the switches, shape (switches,)


class Control(NamedTuple):
    """Step control of an integration."""

    tolerance: float  # estimated error of a step over the size of every state and entry of the derivative
    most_steps: int  # budget of steps in an interval
    units: Any  # units of the states, shape (n,), positive
    near: Any  # entries of the derivative under step control, shape (n, n)
    stop: Any  # shape (1,); not zero once there is no more time


class Outcome(NamedTuple):
    """Results that an integration fills in, in units of the states."""

    derivative: Any  # shape (n, n), multiplied by the derivative; shape (0, 0) for none
    # largest moduli of the states and of the entries of the derivative so far, shapes (n,) and as `derivative`
    largest: Any
    extent: Any
    frame: Any  # orthonormal, shape (n, n), carried along (:func:`.stages.turn`); shape (0, 0) for none
    # logarithm of the growth of each direction of the frame, which is added, and cosine of its largest turn in a
    # step, shape (n,)
    stretch: Any
    turned: Any
    report: Any  # number of steps, and the time reached, shape (2,)


@fused_njit(error_model="numpy")
def _predict(nodes: Any, ratio: float, last: Any, moved: Any) -> None:
    """Guess the stages by extrapolating the polynomial of the previous step: Lagrange polynomials on 0 and its nodes.
    ``ratio`` is the step over the previous one; 0 for the first step."""
    s, n = moved.shape
    for i in range(s):
        for k in range(n):
            moved[i, k] = 0.0
        z = 1.0 + nodes[i] * ratio
        if ratio > 0.0 and z <= 3.0:
            for j in range(s):
                f = z / nodes[j]
                for m in range(s):
                    if m != j:
                        f *= (z - nodes[m]) / (nodes[j] - nodes[m])
                for k in range(n):
                    moved[i, k] += f * last[j, k]
            for k in range(n):
                moved[i, k] -= last[s - 1, k]


@fused_njit(error_model="numpy")
def _take(x: Any, step: Any, last: Any, result: Any) -> None:
    """Advance to the end of a step."""
    s, n = step.moved.shape
    for i in range(n):
        for j in range(s):
            result.largest[i] = max(result.largest[i], abs(x[i] + step.moved[j, i]))
            last[j, i] = step.moved[j, i]
        x[i] += step.moved[s - 1, i]
    if result.derivative.shape[0] > 0:
        for j in range(s):
            for i in range(n):
                for k in range(n):
                    result.extent[i, k] = max(result.extent[i, k], abs(step.reached[j, i, k]))
        result.derivative[:] = step.reached[s - 1]


@fused_njit(error_model="numpy")
def _prepared(tape: Any, units: Any, params: Any, branches: Any, largest: Any) -> Any:
    """A right-hand side with its parameters loaded and room for its values."""
    series = loaded(tape, params, 1, units.size, branches)
    for i in range(units.size):
        series.tangents[i, 0, i] = 1.0
    return Problem(tape, units, series, largest)


@fused_njit(error_model="numpy")
def _room(n: int, s: int) -> Any:
    """An empty step of s stages of n states."""
    return Step(
        np.empty(n),
        np.empty((n, n)),
        np.zeros((s, n)),
        np.empty((s, n)),
        np.empty((s, n, n)),
        np.empty((s * n, s * n)),
        np.empty(s * n, np.int64),
        np.empty((s * n, n)),
        np.empty((s, n, n)),
    )


@fused_njit(error_model="numpy", nogil=True)
def advance(tape: Any, method: Any, params: Any, x: Any, interval: Any, control: Any, result: Any) -> int:
    """Carry a state x, shape (n,), in units, over an interval in place; return the status."""
    n, s, t1 = x.size, method.nodes.size, interval.t1
    problem = _prepared(tape, control.units, params, interval.branches, result.largest)
    step = _room(n, s)
    last = np.zeros((s, n))
    t, h, h_last = interval.t0, 0.0, 0.0
    steps = 0
    status = DONE
    fresh = True
    while t < t1:
        if fresh:
            if not slope_at(tape, problem.series, problem.units, t, x, step.slope, step.jacobian):
                status = NOT_FINITE
                break
            for i in range(n):
                result.largest[i] = max(result.largest[i], abs(x[i]))
            if h == 0.0:  # the fastest rate limits the first step
                rate = np.abs(step.jacobian).sum(axis=1).max()
                h = min(t1 - t, 1.0 / rate) if rate > 0.0 else t1 - t
            fresh = False
        steps += 1
        far = steps * (t1 - interval.t0) > _HOPELESS * control.most_steps * (t - interval.t0)
        if steps > control.most_steps or (steps > _PATIENCE and far):
            status = BUDGET
            break
        if control.stop[0] != 0.0:
            status = TIME_OVER
            break
        h = min(h, interval.longest)
        ends = h >= (1.0 - 1e-10) * (t1 - t)
        if ends:
            h = t1 - t
        elif h > 0.5 * (t1 - t):
            h = 0.5 * (t1 - t)
        if t + method.nodes[0] * h <= t:
            status = STALLED
            break
        _predict(method.nodes, h / h_last if h_last > 0.0 else 0.0, last, step.moved)
        if not stages(problem, method, x, t, h, step):
            h *= 0.3
            h_last = 0.0
            continue
        off = estimated(problem, method, x, h, step, control.near, result.derivative, result.extent)
        factor = _FASTEST_GROWTH
        if off > 0.0:
            factor = min(factor, max(_FASTEST_FALL, _SAFETY * (control.tolerance / off) ** (1.0 / (s + 1))))
        if not off <= control.tolerance:
            h *= min(factor, 0.9) if off < math.inf else _FASTEST_FALL
            continue
        _take(x, step, last, result)
        if result.frame.shape[0] > 0:
            turn(result.frame, step.columns, step.jacobians, method.weights[s - 1], h, result.stretch, result.turned)
        t = t1 if ends else t + h
        h_last = h
        h *= factor
        fresh = True
    result.report[0], result.report[1] = steps, t
    return status
