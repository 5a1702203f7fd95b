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
from chilopod.flows.tracing.series import loaded, slope_at

_PATIENCE, _HOPELESS = 2048, 16.0  # steps, and factor on the budget, beyond which the mean step is hopelessly short
_FASTEST_FALL, _FASTEST_GROWTH, _SAFETY = 0.1, 6.0, 0.9
_MOST_ROUNDS = 10
_CLOSE = 1e-7  # Newton correction after which the next one is round-off
_NOISE = 2.0**-51  # round-off relative to the terms whose difference is the error estimate
_SHAKE = 2.0**-30  # relative change of values that is far above round-off and has a linear effect
_EXACT = 0.0, 0.0  # values without such changes


class Control(NamedTuple):
    """Step control of an integration over an interval of time on which the right-hand side is smooth."""

    t0: float  # start and end
    t1: float
    longest: float  # longest step
    branches: Any  # branches of the switches, shape (switches,)
    tolerance: float  # estimated error of a step over the size of every state and entry of the derivative
    most_steps: int  # budget of steps
    units: Any  # units of the states, shape (n,), positive
    near: Any  # entries of the derivative under step control, shape (n, n)
    stop: Any  # shape (1,); not zero once there is no more time


class Outcome(NamedTuple):
    """Results that an integration fills in, in units of the states."""

    derivative: Any  # shape (n, n), multiplied by the derivative; shape (0, 0) for none
    largest: Any  # largest moduli of the states so far, shape (n,)
    extent: Any  # and of the entries of the derivative
    report: Any  # number of steps, time reached, and logarithm of the growth of volume, which is added, shape (3,)


class Problem(NamedTuple):
    """A right-hand side on an interval, in units of the states."""

    tape: Any  # its operations
    units: Any  # units of the states, shape (n,), positive; everything else here is in these units
    # values and tangents of the tape, with the states' own tangents 1, and the branches of its switches on the interval
    series: Any
    largest: Any  # largest moduli of the states so far, shape (n,)


class Method(NamedTuple):
    """Coefficients of Radau IIA."""

    nodes: Any  # c, rising to 1, shape (s,)
    weights: Any  # a, shape (s, s); the last row has the weights
    start: Any  # values at 0 of the Lagrange polynomials on the nodes, shape (s,): f there as the stages have it
    # of the filter 1 / (1 - h gamma J) in the estimate of the error: the inverse of the real eigenvalue of the inverse
    # of `weights` (Hairer and Wanner, equation IV.8.18)
    gamma: float


class Step(NamedTuple):
    """A step with s stages."""

    slope: Any  # f and its jacobian at the start, shapes (n,) and (n, n)
    jacobian: Any
    moved: Any  # states of the stages less the state at the start, shape (s, n)
    slopes: Any  # f and its jacobian in the stages, shapes (s, n) and (s, n, n)
    jacobians: Any
    matrix: Any  # matrix of Newton's method, shape (s n, s n), overwritten by its elimination
    columns: Any  # derivative of the stages with respect to the state at the start, shape (s n, n)
    reached: Any  # derivative of the stages with respect to the start of the interval, shape (s, n, n)


@fused_njit(error_model="numpy")
def _solve(matrix: Any, columns: Any) -> bool:
    """Solve linear equations for columns, shape (n, m), in place; False for a singular or infinite matrix."""
    n, m = columns.shape
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if not 0.0 < abs(matrix[pivot, k]) < math.inf:
            return False
        if pivot != k:
            for j in range(k, n):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            for j in range(m):
                columns[k, j], columns[pivot, j] = columns[pivot, j], columns[k, j]
        for i in range(k + 1, n):
            f = matrix[i, k] / matrix[k, k]
            if f != 0.0:
                for j in range(k + 1, n):
                    matrix[i, j] -= f * matrix[k, j]
                for j in range(m):
                    columns[i, j] -= f * columns[k, j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            f = matrix[i, k]
            for j in range(m):
                columns[i, j] -= f * columns[k, j]
        f = 1.0 / matrix[i, i]
        for j in range(m):
            columns[i, j] *= f
    return True


@fused_njit(error_model="numpy")
def _newton_matrix(weights: Any, h: float, jacobians: Any, matrix: Any) -> None:
    """Matrix of Newton's method for the stages."""
    s, n = jacobians.shape[:2]
    for i in range(s):
        for j in range(s):
            f = h * weights[i, j]
            for k in range(n):
                for m in range(n):
                    matrix[i * n + k, j * n + m] = -f * jacobians[j, k, m]
    for i in range(s * n):
        matrix[i, i] += 1.0


@fused_njit(error_model="numpy")
def _stages(problem: Any, method: Any, x: Any, t: float, h: float, step: Any) -> bool:
    """Solve for the stages, from ``moved``, with ``columns``, ``slopes``, ``jacobians``; False if that fails."""
    tape, nodes, weights, largest = problem.tape, method.nodes, method.weights, problem.largest
    moved, slopes = step.moved, step.slopes
    s, n = moved.shape
    y = np.empty(n)
    before = math.inf
    close = False
    for _ in range(_MOST_ROUNDS):
        for j in range(s):
            for i in range(n):
                y[i] = x[i] + moved[j, i]
            at = t + nodes[j] * h
            if not slope_at(tape, problem.series, problem.units, at, y, _EXACT, slopes[j], step.jacobians[j]):
                return False
        # The residual and, in the last round, the derivative of the equations with respect to the state at the start.
        right = np.zeros((s * n, 1 + n if close else 1))
        for i in range(s):
            for k in range(n):
                total = 0.0
                for j in range(s):
                    total += weights[i, j] * slopes[j, k]
                right[i * n + k, 0] = h * total - moved[i, k]
                if close:
                    right[i * n + k, 1 + k] = 1.0
        _newton_matrix(weights, h, step.jacobians, step.matrix)
        if not _solve(step.matrix, right):
            return False
        off = 0.0
        for k in range(n):
            size = largest[k]
            for i in range(s):
                size = max(size, abs(x[k] + moved[i, k]))
            for i in range(s):
                move = right[i * n + k, 0]
                moved[i, k] += move
                if move != 0.0:
                    off = max(off, abs(move) / max(size, abs(move)))
        if close:
            for i in range(s * n):
                for k in range(n):
                    step.columns[i, k] = right[i, 1 + k]
            return True
        if off > 2.0 * before:
            return False
        close = off <= _CLOSE or (off >= 0.5 * before and off <= 1e3 * _CLOSE)
        before = off
    return False


@fused_njit(error_model="numpy")
def _defects(x: Any, h: float, method: Any, step: Any, derivative: Any) -> tuple[Any, Any, Any]:
    """Defect of f at the start from the polynomial through its values in the stages, filtered by the inverse of
    1 - h gamma J, of the state and the columns of the derivative, shape (n, 1 + columns); its round-off; and filter."""
    start, gamma = method.start, method.gamma
    s, n = step.moved.shape
    size = derivative.shape[0]
    off, terms = np.empty((n, 1 + size)), np.empty((n, 1 + size))
    filtering, inverse = np.empty((n, n)), np.eye(n)
    for k in range(n):
        total = step.slope[k]
        for j in range(s):
            total -= start[j] * step.slopes[j, k]
        off[k, 0] = h * gamma * total
        terms[k, 0] = abs(x[k])
        for m in range(n):
            filtering[k, m] = (1.0 if k == m else 0.0) - h * gamma * step.jacobian[k, m]
    if size > 0:
        factor = step.jacobian.copy()
        for j in range(s):
            factor -= start[j] * (step.jacobians[j] @ step.columns[j * n : (j + 1) * n])
        entries = factor @ derivative
        for k in range(n):
            for m in range(n):
                off[k, 1 + m] = h * gamma * entries[k, m]
                terms[k, 1 + m] = abs(derivative[k, m])
    if not _solve(filtering, inverse):
        off.fill(math.inf)
        return off, np.zeros(off.shape), inverse
    # No shorter step removes its round-off.
    rounding = (_NOISE * h * gamma) * np.abs(inverse)
    return inverse @ off, rounding @ (np.abs(step.jacobian) @ terms), rounding


@fused_njit(error_model="numpy")
def _swings(problem: Any, t: float, x: Any, step: Any, derivative: Any) -> Any:
    """Changes of f and its jacobian at the end of a step per relative change of all that they are computed from, as
    terms of round-off, if finite. What passes zero at the start, as cos t and 1 - sin t do, shrinks with the step, its
    round-off does not."""
    n, size = x.size, derivative.shape[0]
    y, scale, found = x + step.moved[-1], np.abs(derivative) / _SHAKE, np.zeros((n, 1 + size))
    slopes, jacobians = np.empty((3, n)), np.empty((3, n, n))
    for k, shake in enumerate((_EXACT, (_SHAKE, 0.0), (0.0, _SHAKE))):
        if not slope_at(problem.tape, problem.series, problem.units, t, y, shake, slopes[k], jacobians[k]):
            return 0.0 * found
        for i in range(n):
            found[i, 0] += abs(slopes[k, i] - slopes[0, i]) / _SHAKE
            for j in range(n):
                for m in range(size):
                    found[i, 1 + m] += abs(jacobians[k, i, j] - jacobians[0, i, j]) * scale[j, m]
    return found


@fused_njit(error_model="numpy")
def _estimate(problem: Any, method: Any, x: Any, t: float, h: float, step: Any, control: Any, result: Any) -> float:
    """The error of a step relative to the largest values of states and entries of the derivative so far."""
    off, noise, rounding = _defects(x, h, method, step, result.derivative)
    worst = _worst(x, step, off, noise, control.near, result)
    if control.tolerance < worst < math.inf:
        noise += rounding @ _swings(problem, t + h, x, step, result.derivative)
        worst = _worst(x, step, off, noise, control.near, result)
    return worst


@fused_njit(error_model="numpy")
def _worst(x: Any, step: Any, off: Any, noise: Any, near: Any, result: Any) -> float:
    """The largest relative error that is not noise."""
    largest, reached, derivative, extent = result.largest, step.reached, result.derivative, result.extent
    s, n = step.moved.shape
    end = step.columns[(s - 1) * n :]
    worst = 0.0
    for k in range(n):
        scale = largest[k]
        for i in range(s):
            scale = max(scale, abs(x[k] + step.moved[i, k]))
        for m in range(n):
            scale = max(scale, abs(end[k, m]) * largest[m])
        if abs(off[k, 0]) > noise[k, 0]:
            worst = max(worst, abs(off[k, 0]) / scale)
    if derivative.shape[0] > 0:
        for i in range(s):
            np.dot(step.columns[i * n : (i + 1) * n], derivative, reached[i])
        for k in range(n):
            for j in range(n):
                if not near[k, j] or abs(off[k, 1 + j]) <= noise[k, 1 + j]:
                    continue
                scale = extent[k, j]
                for i in range(s):
                    scale = max(scale, abs(reached[i, k, j]))
                for m in range(n):
                    scale = max(scale, abs(end[k, m]) * extent[m, j])
                worst = max(worst, abs(off[k, 1 + j]) / scale)
    return worst


@fused_njit(error_model="numpy")
def _predict(nodes: Any, ratio: float, last: Any, moved: Any) -> None:
    """Guess the stages by the polynomial of the previous step; ``ratio``: the step over that one, 0 for the first."""
    s, n = moved.shape
    moved.fill(0.0)
    for i in range(s):
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
                    result.derivative[i, k] = step.reached[j, i, k]  # the last remains


@fused_njit(error_model="numpy")
def _room(n: int, s: int) -> Any:
    """An empty step of s stages of n states."""
    jacobians, reached = np.empty((s, n, n)), np.empty((s, n, n))
    matrix, columns = np.empty((s * n, s * n)), np.empty((s * n, n))
    return Step(np.empty(n), np.empty((n, n)), np.zeros((s, n)), np.empty((s, n)), jacobians, matrix, columns, reached)


@fused_njit(error_model="numpy")
def _spent(control: Any, steps: int, t: float) -> int:
    """DONE if time and budget allow another step, unless the mean step is hopelessly short."""
    if control.stop[0] != 0.0:
        return TIME_OVER
    far = steps * (control.t1 - control.t0) > _HOPELESS * control.most_steps * (t - control.t0)
    return BUDGET if steps > control.most_steps or (steps > _PATIENCE and far) else DONE


@fused_njit(error_model="numpy", nogil=True)
def advance(tape: Any, method: Any, params: Any, x: Any, control: Any, result: Any) -> int:
    """Carry a state x, shape (n,), in units, over an interval in place; return the status."""
    n, s, t1 = x.size, method.nodes.size, control.t1
    series = loaded(tape, params, 1, n, control.branches)
    for i in range(n):
        series.tangents[i, 0, i] = 1.0
    problem = Problem(tape, control.units, series, result.largest)
    step = _room(n, s)
    last = np.zeros((s, n))
    t, h, h_last = control.t0, 0.0, 0.0
    steps = 0
    status = DONE
    fresh = True
    while t < t1:
        if fresh:
            if not slope_at(tape, problem.series, problem.units, t, x, _EXACT, step.slope, step.jacobian):
                status = NOT_FINITE
                break
            rate = 0.0
            for i in range(n):
                result.largest[i] = max(result.largest[i], abs(x[i]))
                rate = max(rate, np.abs(step.jacobian[i]).sum())
            if h == 0.0:  # the fastest rate limits the first step
                h = min(t1 - t, 1.0 / rate) if rate > 0.0 else t1 - t
            fresh = False
        steps += 1
        status = _spent(control, steps, t)
        if status != DONE:
            break
        h = min(h, control.longest)
        ends = h >= (1.0 - 1e-10) * (t1 - t)
        if ends:
            h = t1 - t
        elif h > 0.5 * (t1 - t):
            h = 0.5 * (t1 - t)
        if t + method.nodes[0] * h <= t:
            status = STALLED
            break
        _predict(method.nodes, h / h_last if h_last > 0.0 else 0.0, last, step.moved)
        if not _stages(problem, method, x, t, h, step):
            h *= 0.3
            h_last = 0.0
            continue
        off = _estimate(problem, method, x, t, h, step, control, result)
        factor = _FASTEST_GROWTH
        if off > 0.0:
            factor = min(factor, max(_FASTEST_FALL, _SAFETY * (control.tolerance / off) ** (1.0 / (s + 1))))
        if not off <= control.tolerance:
            h *= min(factor, 0.9) if off < math.inf else _FASTEST_FALL
            continue
        _take(x, step, last, result)
        for j in range(s):
            for i in range(n):
                result.report[2] += h * method.weights[s - 1, j] * step.jacobians[j, i, i]
        t = t1 if ends else t + h
        h_last = h
        h *= factor
        fresh = True
    result.report[0], result.report[1] = steps, t
    return status
