"""Taylor coefficients of the solution of dx/dt = f(t, x) and of its derivative, from a tape.

The recurrences are those of Griewank and Walther, *Evaluating Derivatives*, 2nd ed., SIAM 2008, sec. 13.2, with the
tangents of a function phi(a) from d phi = w da, w = phi'(a), so that each costs one product of series.

A value that nearly overflows is infinite, as exp(a) in 1 / (1 + exp(a)): its own coefficients are meaningless, those of
a quotient by it or of a function that is flat there are zero.

:func:`loaded` makes the series of a tape, :func:`choose` the branches of its switches at a state, and :func:`expand`
fills in all orders, by :func:`values_at` and :func:`tangents_at`. For single values there are :func:`sample`,
:func:`slope_at` and :func:`compose`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from chilopod.compiled import copy_into, fused_njit
from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.bernoulli import bernoulli
from chilopod.lanes import HALF, as_lanes

_INFINITE = 1e300  # value that counts as infinite: it leaves room for derivatives
_NEGLIGIBLE = 1e154  # numerator below which a quotient by such a value is negligible
_STEEP = 0.1  # power from which on a number is negligible, or infinite, where its inverse is so
_TURN = 2.4  # the golden angle: the phases of near operations differ, so that their changes do not cancel


class Series(NamedTuple):
    """Taylor coefficients of all nodes of a tape along a motion."""

    values: Any  # coefficients, shape (nodes, orders)
    # derivatives of the coefficients along some directions of the state at the start, shape (nodes, orders, lanes); the
    # lanes are the directions, padded to a multiple of `HALF`
    tangents: Any
    branches: Any  # branch of every switch, shape (switches,)


@fused_njit(error_model="numpy")
def _function(code: int, a: float, b: float) -> float:
    if code == ops.EXP:
        return math.exp(a) if a < 709.7 else math.inf
    if code == ops.SIN:
        return math.sin(a)
    if code == ops.COS:
        return math.cos(a)
    if code == ops.TAN:
        return math.tan(a)
    if code == ops.SINH:
        return math.sinh(a) if abs(a) < 710.0 else math.inf
    if code == ops.COSH:
        return math.cosh(a) if abs(a) < 710.0 else math.inf
    if code == ops.TANH:
        return math.tanh(a)
    if code == ops.LOG:
        return math.log(a) if 0.0 < a < math.inf else math.nan
    if code == ops.SQRT:
        return math.sqrt(a) if a >= 0.0 else math.nan
    if code == ops.POWER:
        return np.power(a, b) if a < math.inf or abs(b) > _STEEP else math.nan
    if code == ops.ATAN:
        return math.atan(a)
    if code == ops.BERNOULLI:
        return bernoulli(a, int(b))
    return math.asin(a) if abs(a) <= 1.0 else math.nan


@fused_njit(error_model="numpy")
def branch_at(kind: int, value: float) -> float:
    """Branch of a switch where its function has a value: the largest whole number below, or the sign."""
    if kind == ops.FLOOR:
        return math.floor(value)
    return 1.0 if value >= 0.0 else -1.0


@fused_njit(error_model="numpy")
def values_at(
    program: Any, terms: Any, slopes: Any, span: Any, order: int, unit: float, values: Any, branches: Any
) -> None:
    """Coefficients 0 to ``order`` of the operations in a span (first and past-last), and of the states from ``slopes``.
    One call with single arrays does all orders, as counting references to arrays takes long.

    Product: c_k = sum_j a_j b_{k-j}. Quotient: c_k = (a_k - sum_{j>0} b_j c_{k-j}) / b_0. Function with c' = w a':
    k c_k = sum_{j>0} j a_j w_{k-j}.
    """
    for k in range(order + 1):
        for i in range(span[0], span[1]):
            code, a, b = program[0, i], program[1, i], program[2, i]
            s, odd = 0.0, 0.0  # two independent sums run in parallel
            if code == ops.LINEAR:
                for j in range(a, b):
                    s += values[terms[0, j], 0] * values[terms[1, j], k]
            elif code == ops.PRODUCT:
                half = (k + 1) // 2
                for j in range(half):
                    s += values[a, j] * values[b, k - j]
                    odd += values[a, half + j] * values[b, k - half - j]
                if 2 * half == k:
                    s += values[a, k] * values[b, 0]
                s += odd
            elif code == ops.SQUARE:
                half = (k + 1) // 4
                for j in range(half):
                    s += values[a, j] * values[a, k - j]
                    odd += values[a, half + j] * values[a, k - half - j]
                for j in range(2 * half, (k + 1) // 2):
                    s += values[a, j] * values[a, k - j]
                s = 2.0 * (s + odd)
                if k % 2 == 0:
                    s += values[a, k // 2] * values[a, k // 2]
            elif code == ops.QUOTIENT:
                s = values[a, k]
                for j in range(1, k + 1):
                    s -= values[b, j] * values[i, k - j]
                s = s / values[b, 0] if values[b, 0] != 0.0 else math.nan
                if math.isinf(values[b, 0]):
                    s = 0.0 if abs(values[a, 0]) < _NEGLIGIBLE else math.nan
            elif code in (ops.STEP, ops.FLOOR):
                if k == 0:
                    s = branches[b] if b >= 0 else branch_at(code, values[a, 0])
            elif code == ops.SELECT:
                s = values[b, k] if values[a, 0] > 0.0 else values[program[3, i], k]
            elif k == 0:
                s = _function(code, values[a, 0], values[b, 0])
            elif math.isinf(values[a, 0]):
                s = 0.0 if values[program[3, i], 0] == 0.0 else math.nan
            else:
                w = program[3, i]
                half = 0 if program[5, a] != 0 else k // 2
                for j in range(1, half + 1):
                    s += j * values[a, j] * values[w, k - j]
                    odd += (half + j) * values[a, half + j] * values[w, k - half - j]
                for j in range(2 * half + 1, (1 if program[5, a] != 0 else k) + 1):
                    s += j * values[a, j] * values[w, k - j]
                s = (s + odd) / (-k if code == ops.COS else k)
            values[i, k] = math.copysign(math.inf, s) if k == 0 and abs(s) > _INFINITE else s
        if k < order:
            for i in range(slopes.size):
                values[i, k + 1] = values[slopes[i], k] * (unit / (k + 1))


@fused_njit(error_model="numpy", inline="always")
def _add(tangents: Any, i: int, k: int, a: int, factor: float) -> None:
    """Add factor da[k] to the tangents of order k of node i."""
    for lane in range(tangents.shape[2]):
        tangents[i, k, lane] += factor * tangents[a, k, lane]


@fused_njit(error_model="numpy")
def tangents_at(
    program: Any, terms: Any, slopes: Any, span: Any, order: int, unit: float, values: Any, tangents: Any
) -> None:
    """The same for the tangents that are needed, from values computed before. Each is a sum of one or two products of
    series, w du; a single loop computes them all, because calls with arrays, and copies of the loop, take long.

    Product: dc = b da + a db. Quotient: dc_k = (da_k - sum_j c_j db_{k-j} - sum_{j>0} b_j dc_{k-j}) / b_0. Function:
    dc = w da. The loop sums ``factor`` w_j du_{k-j} from j = ``first`` on.
    """
    nodes, orders, lanes = tangents.shape
    tangents = as_lanes(tangents.reshape(nodes, orders, lanes // HALF, HALF), HALF)
    for k in range(order + 1):
        for i in range(span[0], span[1]):
            if program[4, i] == 0:
                continue
            code, a, b = program[0, i], program[1, i], program[2, i]
            for lane in range(tangents.shape[2]):
                tangents[i, k, lane] = 0.0
            if code == ops.LINEAR:
                for j in range(a, b):
                    if program[4, terms[1, j]] != 0:
                        _add(tangents, i, k, terms[1, j], values[terms[0, j], 0])
                continue
            if code == ops.SELECT:
                _add(tangents, i, k, b if values[a, 0] > 0.0 else program[3, i], 1.0)
                continue
            if math.isinf(values[b if code == ops.QUOTIENT else a, 0]) and code not in (ops.PRODUCT, ops.SQUARE):
                continue
            if code == ops.QUOTIENT and program[4, a] != 0:
                _add(tangents, i, k, a, 1.0 / values[b, 0])
            for second in range(2):
                w, u, first, factor = -1, a, 0, 1.0
                if code == ops.PRODUCT:
                    w, u = (a, b) if second else (b, a)
                elif code == ops.QUOTIENT:
                    w, u, first = (b, i, 1) if second else (i, b, 0)
                    factor = -1.0 / values[b, 0]
                elif second == 0:
                    w = a if code == ops.SQUARE else program[3, i]
                    factor = 2.0 if code == ops.SQUARE else -1.0 if code == ops.COS else 1.0
                if w < 0 or first > k or program[4, u] == 0:
                    continue
                half = (k - first) // 2
                for lane in range(tangents.shape[2]):
                    s = values[w, first] * tangents[u, k - first, lane]
                    odd = 0.0 * s  # two independent sums run in parallel
                    for j in range(first + 1, first + 1 + half):
                        s += values[w, j] * tangents[u, k - j, lane]
                        odd += values[w, half + j] * tangents[u, k - half - j, lane]
                    for j in range(first + 1 + 2 * half, k + 1):
                        s += values[w, j] * tangents[u, k - j, lane]
                    tangents[i, k, lane] += factor * (s + odd)
        if k < order:
            for i in range(slopes.size):
                for lane in range(tangents.shape[2]):
                    tangents[i, k + 1, lane] = (unit / (k + 1)) * tangents[slopes[i], k, lane]


@fused_njit(error_model="numpy", inline="always")
def values_between(tape: Any, series: Any, first: int, stop: int) -> None:
    """Values of the operations from ``first`` to before ``stop`` at the state and time of a series."""
    values_at(tape.program, tape.terms, tape.slopes, (first, stop), 0, 1.0, series.values, series.branches)


@fused_njit(error_model="numpy")
def loaded(tape: Any, params: Any, orders: int, directions: int, branches: Any) -> Any:
    """Series with the numbers, the parameters and their functions, and zeros for everything that moves."""
    n, parameters, first, stop, _, nodes = tape.layout
    lanes = -(-directions // HALF) * HALF
    series = Series(np.zeros((nodes, orders)), np.zeros((nodes, orders, lanes)), branches)
    copy_into(series.values[n + 1 : n + 1 + parameters, 0], params)
    copy_into(series.values[n + 1 + parameters : first, 0], tape.numbers)
    values_between(tape, series, first, stop)
    return series


@fused_njit(error_model="numpy")
def choose(tape: Any, series: Any) -> None:
    """Choose the branch of every switch by its function at a state, with the values of f and the guards there."""
    switches, first = tape.switches, tape.layout[3]
    for s in range(switches.shape[1]):
        stop = tape.layout[4] if switches[0, s] == ops.GUARD else switches[2, s]
        values_between(tape, series, first, stop)
        series.branches[s] = branch_at(switches[0, s], series.values[switches[1, s], 0])
        first = stop
    values_between(tape, series, first, tape.layout[4])


@fused_njit(error_model="numpy")
def sample(tape: Any, params: Any, times: Any, states: Any, nodes: Any, found: Any) -> None:
    """Values of nodes, shape (nodes, samples), at times and states, of which all may share one."""
    series = loaded(tape, params, 1, 0, np.zeros(tape.switches.shape[1]))
    n, values = tape.layout[0], series.values
    stop = tape.layout[5] if (nodes >= tape.layout[4]).any() else tape.layout[4]
    for m in range(found.shape[1]):
        copy_into(values[:n, 0], states[:, m % states.shape[1]])
        values[n, 0] = times[m % times.size]
        choose(tape, series)
        values_between(tape, series, tape.layout[4], stop)  # resets
        for i in range(nodes.size):
            found[i, m] = values[nodes[i], 0]


@fused_njit(error_model="numpy")
def slope_at(tape: Any, series: Any, units: Any, t: float, x: Any, shake: Any, slope: Any, jacobian: Any) -> bool:
    """f and its jacobian at a state, in units of the states, with the current branches; False if not finite. Two waves
    over time, states and operations, of amplitudes ``shake``, change them relatively."""
    values, tangents, slopes, span = series.values, series.tangents, tape.slopes, tape.layout[3:5]
    for i in range(x.size):
        values[i, 0] = x[i] * units[i]
    values[x.size, 0] = t
    if shake == (0.0, 0.0):
        values_between(tape, series, span[0], span[1])
    else:
        for i in range(span[1]):
            if i >= span[0]:
                values_between(tape, series, i, i + 1)
            if i >= span[0] or i <= x.size:
                values[i, 0] *= 1.0 + shake[0] * math.cos(_TURN * i) + shake[1] * math.sin(_TURN * i)
    tangents_at(tape.program, tape.terms, slopes, span, 0, 1.0, values, tangents)
    s = 0.0
    for i in range(x.size):
        slope[i] = values[slopes[i], 0] / units[i]
        s += abs(slope[i])
        for j in range(x.size):
            jacobian[i, j] = tangents[slopes[i], 0, j] * (units[j] / units[i])
            s += abs(jacobian[i, j])
    return s < math.inf


@fused_njit(error_model="numpy")
def compose(tape: Any, params: Any, t: float, curve: Any, branches: Any, found: Any) -> None:
    """Coefficients of f at a time along a curve, shapes (orders, n)."""
    orders, n = curve.shape
    series = loaded(tape, params, orders, 0, branches)
    for k in range(orders):
        for i in range(n):
            series.values[i, k] = curve[k, i]
    series.values[n, 0] = t
    nothing, first, stop = np.empty(0, np.int64), tape.layout[3], tape.layout[4]  # no states follow from f
    values_at(tape.program, tape.terms, nothing, (first, stop), orders - 1, 1.0, series.values, branches)
    for k in range(orders):
        for i in range(n):
            found[k, i] = series.values[tape.slopes[i], k]


@fused_njit(error_model="numpy", inline="always")
def expand_values(tape: Any, order: int, stop: int, unit: float, series: Any) -> None:
    """Coefficients 0 to ``order`` of states and operations up to ``stop``, in powers of the time since the start."""
    values, first = series.values, tape.layout[3]
    values[tape.layout[0], 1] = unit
    values_at(tape.program, tape.terms, tape.slopes, (first, stop), order, unit, values, series.branches)


@fused_njit(error_model="numpy", inline="always")
def expand(tape: Any, order: int, stop: int, unit: float, series: Any) -> None:
    """The same with the tangents; those of the states must be set at order 0."""
    expand_values(tape, order, stop, unit, series)
    if series.tangents.shape[2] > 0:
        program, terms, first = tape.program, tape.terms, tape.layout[3]
        tangents_at(program, terms, tape.slopes, (first, stop), order, unit, series.values, series.tangents)
