"""First place where a Taylor polynomial becomes negative."""

from __future__ import annotations

from typing import Any

import numpy as np

from chilopod.compiled import njit

_DEEPEST = 48


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


@njit(error_model="numpy")
def first_exit(coefficients: Any, order: int, h: float) -> float:
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
        for k in range(1, order + 1):
            if coefficients[k] != 0.0:
                offset = k
                break
        if offset == 0:
            return -1.0  # never leaves zero
        if coefficients[offset] < 0.0:
            return 0.0
    poly = coefficients[offset:]
    order -= offset
    stack = np.empty((_DEEPEST + 2, order + 1))
    lows = np.empty(_DEEPEST + 2)
    widths = np.empty(_DEEPEST + 2)
    _bernstein(poly, order, h, stack[0])
    lows[0], widths[0] = 0.0, h
    top = 0
    while top >= 0:
        changes = 0
        sign = 1.0
        for i in range(order + 1):
            b = stack[top, i]
            if b * sign < 0.0:
                changes += 1
                sign = -sign
        low = lows[top]
        width = widths[top]
        if changes == 0:
            top -= 1
            continue
        if changes == 1:
            return _refined(poly, order, low, low + width)
        if top >= _DEEPEST or width < 1e-15 * h:
            if stack[top, order] < 0.0:
                return low
            top -= 1  # touches zero, or nearly
            continue
        _halve(stack, top, order)
        widths[top] = widths[top + 1] = 0.5 * width
        lows[top + 1] = low
        lows[top] = low + 0.5 * width
        top += 1
    return -1.0
