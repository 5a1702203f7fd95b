"""First switch that leaves its branch within a step (:mod:`.stepping`).

Every branch is where some polynomials in time are positive, the Taylor series of the switching function up to sign and
a constant. Intervals are halved until one is found in which a polynomial has exactly one root, and no other is before
it; there the root is refined.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from chilopod.compiled import fused_njit, njit
from chilopod.flows.taylor.switching import is_timed
from chilopod.flows.tracing import tape as ops

_DEEPEST = 48


@fused_njit(error_model="numpy")
def first_crossing(
    tape: Any, series: Any, order: int, h: float, remaining: float, soon: float, inside: Any
) -> tuple[float, int, float]:
    """Time, number and sign of the slope of the first switch that leaves its branch; number -1 if none does.

    Among switches within a time ``soon`` of each other, whose order is round-off, the first of the list counts. Events
    of guards that depend on time only belong to the next interval if they happen that shortly before the end. The array
    ``inside`` is room for a polynomial.
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
                inside[k] = sign * g[k]
            if switches[0, s] == ops.FLOOR:
                inside[0] -= sign * (branches[s] + end)
            z = _first_exit(inside, order, found)
            if z > remaining - soon and is_timed(tape, s):
                continue
            if z >= 0.0 and (crossing < 0 or z < found - soon):
                found, crossing, direction = z, s, -sign
    return found, crossing, direction


@njit(error_model="numpy")
def _first_exit(coefficients: Any, order: int, h: float) -> float:
    """The first z in [0, h] after which a polynomial is negative; -1 if it stays nonnegative.

    A polynomial that rises from zero or, by round-off, from just below counts as nonnegative there.

    Intervals are halved until Descartes' rule of signs for the Bernstein coefficients leaves no root or one (Basu,
    Pollack and Roy, *Algorithms in Real Algebraic Geometry*, ch. 10).
    """
    rest = 0.0
    power = 1.0
    for k in range(1, order + 1):
        power *= h
        rest += abs(coefficients[k]) * power
    if coefficients[0] > rest:
        return -1.0
    offset = 0
    if coefficients[0] <= 0.0:
        offset = 1
        while offset <= order and coefficients[offset] == 0.0:
            offset += 1
        if offset > order:
            return -1.0  # never leaves zero
        if coefficients[offset] < 0.0:
            return 0.0
    poly = coefficients[offset:]
    order -= offset
    # The stack of intervals yet to be searched, the first on top, by their starts, widths and Bernstein coefficients.
    starts, widths, stack = np.empty(_DEEPEST + 2), np.empty(_DEEPEST + 2), np.empty((_DEEPEST + 2, order + 1))
    starts[0], widths[0] = 0.0, h
    _bernstein(poly, order, h, stack[0])
    top = 0
    while top >= 0:
        start, width = starts[top], widths[top]
        changes, sign = 0, 1.0
        for b in stack[top]:
            if b * sign < 0.0:
                changes += 1
                sign = -sign
        if changes == 1:
            return _refined(poly, order, start, start + width)
        small = top >= _DEEPEST or width < 1e-15 * h
        if small and stack[top, order] < 0.0:
            return start
        if small or changes == 0:
            top -= 1  # positive, or touches zero, or nearly
            continue
        _halve(stack, top, order)
        widths[top] = widths[top + 1] = 0.5 * width
        starts[top], starts[top + 1] = start + 0.5 * width, start
        top += 1
    return -1.0


@njit(error_model="numpy")
def _bernstein(coefficients: Any, order: int, h: float, out: Any) -> None:
    """Bernstein coefficients on [0, h]: b_i = sum over k of C(i, k) / C(order, k) c_k h^k."""
    for i in range(order + 1):
        s = coefficients[0]
        factor = 1.0
        for k in range(1, i + 1):
            factor *= h * (i - k + 1) / (order - k + 1)
            s += factor * coefficients[k]
        out[i] = s


@njit(error_model="numpy")
def _halve(stack: Any, top: int, order: int) -> None:
    """De Casteljau's halving of the interval of the polynomial on top: the right half stays, the left goes above it."""
    for i in range(order + 1):
        stack[top + 1, i] = stack[top, 0]
        for j in range(order - i):
            stack[top, j] = 0.5 * (stack[top, j] + stack[top, j + 1])


@njit(error_model="numpy")
def _refined(coefficients: Any, order: int, low: float, high: float) -> float:
    """The root between a nonnegative and a negative point of a polynomial, by bisection and Newton's method."""
    z = 0.5 * (low + high)
    for _ in range(80):
        s = 0.0
        slope = 0.0
        for k in range(order, -1, -1):
            slope = slope * z + s
            s = s * z + coefficients[k]
        if s >= 0.0:
            low = z
        else:
            high = z
        better = z - s / slope if slope != 0.0 else low
        if not low < better < high:
            better = 0.5 * (low + high)
        if abs(better - z) <= 2.3e-16 * abs(z) or not low < better < high:
            return better
        z = better
    return z
