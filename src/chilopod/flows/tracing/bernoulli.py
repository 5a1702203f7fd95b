"""Derivatives of the Bernoulli function u / (exp(u) - 1), which is smooth at zero.

Rates of ion channels have it, as in Hodgkin and Huxley, *J. Physiol.* 117, 500, 1952. The recurrence of a quotient
divides by exp(u) - 1, which magnifies round-off near zero. There the function is its power series of Bernoulli numbers.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import zeta

from chilopod.compiled import fused_njit

HIGHEST = 26
"""Order above which derivatives count as zero: that of the Taylor series is lower."""
_NEAR = 2.0  # argument up to which the power series is used; it converges up to 2 pi
_EVEN = np.arange(2, 2 * 48, 2)
_NUMBERS = np.zeros(2 * 48)  # B_n / n!
_NUMBERS[:2] = 1.0, -0.5
_NUMBERS[_EVEN] = -2.0 * np.cos(0.5 * np.pi * _EVEN) * zeta(_EVEN) / (2.0 * np.pi) ** _EVEN


@fused_njit(error_model="numpy")
def bernoulli(u: float, order: int) -> float:
    """The derivative of some order at u."""
    s = 0.0
    if abs(u) <= _NEAR:
        for n in range(_NUMBERS.size - 1, order - 1, -1):
            falling = 1.0
            for k in range(order):
                falling *= n - k
            s = s * u + falling * _NUMBERS[n]
        return s
    # Coefficients c of (u + s) e / (e exp(u) exp(s) - e), with e = exp(-u) where that is small.
    scale = math.exp(-abs(u))
    divisor, rising = (-math.expm1(-u), 1.0) if u > 0.0 else (math.expm1(u), scale)
    top = scale if u > 0.0 else 1.0
    c = np.zeros(HIGHEST + 1)
    factorial = 1.0
    for k in range(order + 1):
        s = top * u if k == 0 else top if k == 1 else 0.0
        factor = rising
        for j in range(1, k + 1):
            factor /= j
            s -= factor * c[k - j]
        c[k] = s / divisor
        factorial *= max(k, 1)
    return c[order] * factorial
