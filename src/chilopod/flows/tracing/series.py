"""Taylor coefficients of the solution of dx/dt = f(t, x) and of its derivative, from a tape.

The recurrences are those of Griewank and Walther, *Evaluating Derivatives*, 2nd ed., SIAM 2008, sec. 13.2, with the
tangents of a function phi(a) from d phi = w da, w = phi'(a), so that each costs one product of series.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.flows.tracing import tape as ops

LANES = 4
"""Tangents that one instruction can treat at once."""

LINEAR, PRODUCT, SQUARE, QUOTIENT = ops.LINEAR, ops.PRODUCT, ops.SQUARE, ops.QUOTIENT
STEP, FLOOR, SELECT = ops.STEP, ops.FLOOR, ops.SELECT
EXP, SIN, COS, TAN, SINH, COSH, TANH = ops.EXP, ops.SIN, ops.COS, ops.TAN, ops.SINH, ops.COSH, ops.TANH
LOG, SQRT, POWER, ATAN, ASIN = ops.LOG, ops.SQRT, ops.POWER, ops.ATAN, ops.ASIN


class Series(NamedTuple):
    """Taylor coefficients of all nodes of a tape along a motion.

    Attributes
    ----------
    values
        Coefficients, shape (nodes, orders).
    tangents
        Derivatives of the coefficients along some directions of the state at the start, shape (nodes, orders, lanes);
        the lanes are the directions, padded to a multiple of ``LANES``.
    branches
        Branch of every switch, shape (switches,).
    """

    values: Any
    tangents: Any
    branches: Any


@fused_njit(error_model="numpy")
def _function(code: int, a: float, b: float) -> float:
    if code == EXP:
        return math.exp(a) if a < 709.7 else math.inf
    if code == SIN:
        return math.sin(a)
    if code == COS:
        return math.cos(a)
    if code == TAN:
        return math.tan(a)
    if code == SINH:
        return math.sinh(a) if abs(a) < 710.0 else math.inf
    if code == COSH:
        return math.cosh(a) if abs(a) < 710.0 else math.inf
    if code == TANH:
        return math.tanh(a)
    if code == LOG:
        return math.log(a) if a > 0.0 else math.nan
    if code == SQRT:
        return math.sqrt(a) if a >= 0.0 else math.nan
    if code == POWER:
        return np.power(a, b)
    if code == ATAN:
        return math.atan(a)
    return math.asin(a) if abs(a) <= 1.0 else math.nan


@fused_njit(error_model="numpy")
def values_at(program: Any, terms: Any, start: int, stop: int, k: int, values: Any, branches: Any) -> None:
    """Coefficient k of the operations from ``start`` up to ``stop``.

    It takes single arrays: whole tuples would be copied at every call.
    """
    for i in range(start, stop):
        code = program[0, i]
        a = program[1, i]
        b = program[2, i]
        s = 0.0
        if code == LINEAR:
            for j in range(a, b):
                s += values[terms[0, j], 0] * values[terms[1, j], k]
        elif code == PRODUCT:
            # Two sums, as every product would have to wait for the last one.
            half = (k + 1) // 2
            odd = 0.0
            for j in range(half):
                s += values[a, j] * values[b, k - j]
                odd += values[a, half + j] * values[b, k - half - j]
            if 2 * half == k:
                s += values[a, k] * values[b, 0]
            s += odd
        elif code == SQUARE:
            for j in range((k + 1) // 2):
                s += values[a, j] * values[a, k - j]
            s *= 2.0
            if k % 2 == 0:
                s += values[a, k // 2] * values[a, k // 2]
        elif code == QUOTIENT:
            s = values[a, k]
            for j in range(1, k + 1):
                s -= values[b, j] * values[i, k - j]
            s = s / values[b, 0] if values[b, 0] != 0.0 else math.nan
        elif code in (STEP, FLOOR):
            if k == 0:
                s = branches[b]
        elif code == SELECT:
            s = values[b, k] if values[a, 0] > 0.0 else values[program[3, i], k]
        elif k == 0:
            s = _function(code, values[a, 0], values[b, 0])
        else:
            w = program[3, i]
            for j in range(1, (1 if program[5, a] != 0 else k) + 1):
                s += j * values[a, j] * values[w, k - j]
            s /= -k if code == COS else k
        values[i, k] = s


@fused_njit(error_model="numpy")
def _convolve(tangents: Any, values: Any, i: int, w: int, a: int, first: int, k: int, factor: float) -> None:
    """Add factor sum of w[j] da[k - j], j from ``first``, to the tangents of order k of node i."""
    for lane in range(0, tangents.shape[2], LANES):
        s0 = 0.0
        s1 = 0.0
        s2 = 0.0
        s3 = 0.0
        for j in range(first, k + 1):
            f = values[w, j]
            s0 += f * tangents[a, k - j, lane]
            s1 += f * tangents[a, k - j, lane + 1]
            s2 += f * tangents[a, k - j, lane + 2]
            s3 += f * tangents[a, k - j, lane + 3]
        tangents[i, k, lane] += factor * s0
        tangents[i, k, lane + 1] += factor * s1
        tangents[i, k, lane + 2] += factor * s2
        tangents[i, k, lane + 3] += factor * s3


@fused_njit(error_model="numpy")
def tangents_at(program: Any, terms: Any, start: int, stop: int, k: int, values: Any, tangents: Any) -> None:
    """The same for the tangents, where they are needed; the values of order k have to be there."""
    lanes = tangents.shape[2]
    for i in range(start, stop):
        if program[4, i] == 0:
            continue
        code = program[0, i]
        a = program[1, i]
        b = program[2, i]
        if code == SELECT:
            chosen = b if values[a, 0] > 0.0 else program[3, i]
            for lane in range(lanes):
                tangents[i, k, lane] = tangents[chosen, k, lane]
            continue
        for lane in range(lanes):
            tangents[i, k, lane] = 0.0
        if code == LINEAR:
            for j in range(a, b):
                node = terms[1, j]
                if program[4, node] != 0:
                    f = values[terms[0, j], 0]
                    for lane in range(lanes):
                        tangents[i, k, lane] += f * tangents[node, k, lane]
        elif code == PRODUCT:
            if program[4, a] != 0:
                _convolve(tangents, values, i, b, a, 0, k, 1.0)
            if program[4, b] != 0:
                _convolve(tangents, values, i, a, b, 0, k, 1.0)
        elif code == SQUARE:
            _convolve(tangents, values, i, a, a, 0, k, 2.0)
        elif code == QUOTIENT:
            if program[4, a] != 0:
                for lane in range(lanes):
                    tangents[i, k, lane] = tangents[a, k, lane]
            if program[4, b] != 0:
                _convolve(tangents, values, i, i, b, 0, k, -1.0)
            _convolve(tangents, values, i, b, i, 1, k, -1.0)
            f = 1.0 / values[b, 0]
            for lane in range(lanes):
                tangents[i, k, lane] *= f
        else:
            _convolve(tangents, values, i, program[3, i], a, 0, k, -1.0 if code == COS else 1.0)


@fused_njit(error_model="numpy")
def load(tape: Any, params: Any, series: Any) -> None:
    """Numbers, parameters and what depends on them only; the other coefficients of these nodes have to be zero."""
    layout, values = tape.layout, series.values
    n = layout[0]
    for i in range(layout[1]):
        values[n + 1 + i, 0] = params[i]
    for i in range(tape.numbers.size):
        values[n + 1 + layout[1] + i, 0] = tape.numbers[i]
    for i in range(layout[2], layout[3]):
        values_at(tape.program, tape.terms, i, i + 1, 0, values, series.branches)


@fused_njit(error_model="numpy", inline="always")
def expand(tape: Any, order: int, stop: int, unit: float, series: Any) -> None:
    """Coefficients 0 to ``order`` of the states and of all operations up to ``stop``, in powers of the time since the
    start over ``unit``.

    ``values[state, 0]`` and ``values[time, 0]`` have to be set, and the tangents of the states at order 0.
    """
    program, terms, slopes = tape.program, tape.terms, tape.slopes
    values, tangents, branches = series.values, series.tangents, series.branches
    n, first = tape.layout[0], tape.layout[3]
    values[n, 1] = unit
    for k in range(order + 1):
        values_at(program, terms, first, stop, k, values, branches)
        if k < order:
            for i in range(n):
                values[i, k + 1] = values[slopes[i], k] * (unit / (k + 1))
        if tangents.shape[2] > 0:
            tangents_at(program, terms, first, stop, k, values, tangents)
            if k < order:
                for i in range(n):
                    f = unit / (k + 1)
                    for lane in range(tangents.shape[2]):
                        tangents[i, k + 1, lane] = f * tangents[slopes[i], k, lane]
