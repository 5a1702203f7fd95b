"""Length of a step of a Taylor series, for :mod:`.stepping`.

Every series that matters, of a state, a switching function or an entry of the derivative, limits the step by its last
terms. Two kinds of functions hide from these: those that are flat where the step starts, as tanh of a large number, and
pulses in time. :func:`step_size` lets the argument of a flat function change little, and :func:`agrees` compares
functions of time with their values on a grid.
"""

from __future__ import annotations

import math
from typing import Any

from chilopod.compiled import fused_njit
from chilopod.flows.tracing import tape as ops

_FAR, _FAR_TANH = 36.0, 9.0
"""Sizes of arguments beyond which exp and the like, and tanh, may be constant to round-off beside other terms."""
_CHANGE = 0.25  # largest relative change of such an argument in a step
_UNDERFLOW = 1e-290  # limit below which numbers lose precision: their round-off would look like a singularity
_SAME = 3e-13
"""Round-off in a pulse of a thousandth of the period; a narrower one costs a step at each of its grid points."""


@fused_njit(error_model="numpy", inline="always")
def step_size(tape: Any, series: Any, columns: int, order: int, h: float, epsilon: float) -> float:
    """The largest step up to h with series exact to epsilon, in which no function leaves saturation unseen."""
    values, tangents = series.values, series.tangents
    for i in range(tape.layout[0]):
        h = _allowed(values[i], order, h, epsilon)
    for s in range(tape.switches.shape[1]):
        h = _allowed(values[tape.switches[1, s]], order, h, epsilon)
    for i in range(tape.layout[0]):
        for j in range(columns):
            h = _allowed(tangents[i, :, j], order, h, epsilon)
    return _unsaturated(tape, values, order, h)


@fused_njit(error_model="numpy", inline="always")
def agrees(tape: Any, clock: Any, series: Any, order: int, t: float, h: float, unit: float) -> float:
    """A step within which the series of functions of time agree with their values on a grid over the period."""
    clocks, values = tape.clocks, series.values
    table, period = clock
    if clocks.size == 0 or table.shape[1] < 2:
        return h
    spacing = period / (table.shape[1] - 1)
    at = math.floor(t / spacing) + 1
    while True:
        u = at * spacing - t
        if u >= h * unit * (1.0 - 1e-9):
            return h
        if u > 1e-9 * spacing:
            z = u / unit
            row = int(at % (table.shape[1] - 1))
            for c in range(clocks.size):
                s = 0.0
                size = 0.0
                for k in range(order, -1, -1):
                    s = s * z + values[clocks[c], k]
                    size = size * z + abs(values[clocks[c], k])
                value = table[c, row]
                # Only this part of the largest value may be neglected.
                if not abs(s - value) <= _SAME * abs(value) + 1e-15 * size + 1e-17 * table[c, table.shape[1] - 1]:
                    before = (u - spacing) / unit
                    return before if before > 0.1 * z else 0.5 * min(h, z)
        at += 1


@fused_njit(error_model="numpy")
def _allowed(coefficients: Any, order: int, h: float, epsilon: float) -> float:
    """The largest step up to h at which the last two terms are below epsilon times the largest of the first half."""
    for q in range(order, order - 2, -1):
        last = abs(coefficients[q])
        if last < _UNDERFLOW:
            continue
        first = 0
        while first < 3 and coefficients[first] == 0.0:
            first += 1
        # A series that starts with a high power (the far end of a chain) is small within a step and does not matter.
        if first == 3:
            continue
        # Newton's method for the logarithms, which are convex: it converges from below in a few rounds.
        best = 0.0
        while True:
            z = best if best > 0.0 else h
            power = 1.0 if first == 0 else z if first == 1 else z * z
            biggest = abs(coefficients[first]) * power
            at = first
            for k in range(first + 1, q // 2 + 1):
                power *= z
                size = abs(coefficients[k]) * power
                if size > biggest:
                    biggest = size
                    at = k
            last_power = power * power * (z if q % 2 == 1 else 1.0)  # z**q, without a call
            if best == 0.0 and last * last_power <= 2.0 * epsilon * biggest:
                best = h
                break
            better = (epsilon * abs(coefficients[at]) / last) ** (1.0 / (q - at))
            if better <= best:
                break
            best = better
        h = min(h, best)
    return h


@fused_njit(error_model="numpy")
def _unsaturated(tape: Any, values: Any, order: int, h: float) -> float:
    """The largest step up to h at which no function jumps over a transition that its series at a flat end hides."""
    program = tape.program
    for i in range(tape.layout[3], tape.layout[4]):
        code = program[0, i]
        if code == ops.EXP or code == ops.SINH or code == ops.COSH or code == ops.TANH or code == ops.BERNOULLI:
            argument = values[program[1, i]]
            size = abs(argument[0])
            if size > (_FAR_TANH if code == ops.TANH else _FAR):
                change = math.inf
                while change > _CHANGE:
                    change = 0.0
                    for k in range(order, 0, -1):
                        change = (change + abs(argument[k]) / size) * h
                    if change > _CHANGE:
                        h *= max(_CHANGE / change, 0.5)
    return h
