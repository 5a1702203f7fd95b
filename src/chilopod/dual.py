"""Functions of numbers that may carry a tangent in their imaginary part, or be in lanes, compiled and inlined.

A complex-step number (see :mod:`chilopod.integrate`) has an imaginary part so small that its square vanishes, so a
function f of one is ``f(a) + i b f'(a)`` exactly: no complex function of a library is needed, and these cost little
more than the real ones. They serve real numbers as well, and numbers in lanes (:mod:`chilopod.lanes`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from chilopod.compiled import fused_njit, njit
from chilopod.lanes import LanesType, absolute, any_less, choose, nearest_integer

_SMALL = 0.25 * math.pi
_NO_TURN = 0.78  # rad: below 45 degrees however that is rounded
_RIGHT_ANGLES = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
"""Their sum is a right angle to 53 + 66 bits; the first two have 33, so that a million times them is exact (fdlibm)."""
_SIN = np.array([(-1.0) ** k / math.factorial(2 * k + 1) for k in range(8)])
_COS = np.array([(-1.0) ** k / math.factorial(2 * k) for k in range(9)])


def _series(a: Any) -> Any:
    """Cosine and sine by Taylor series, to the last bit for angles of up to 45 degrees."""
    z = a * a
    s, c = _SIN[7], _COS[8]
    for k in range(6, 0, -1):
        s = _SIN[k] + z * s
        c = _COS[k + 1] + z * c
    return 1.0 + z * (_COS[1] + z * c), a + a * z * s


_real_series, _lanes_series = (each(forceinline=True)(_series) for each in (fused_njit, njit))


@fused_njit
def _real_cos_sin(a: float) -> Any:
    """Cosine and sine by the series for common joint angles, in half the time."""
    return (np.cos(a), np.sin(a)) if abs(a) > _SMALL else _real_series(a)


@njit
def _lanes_turned(a: Any) -> Any:
    """Cosine and sine in lanes, accurate to the last bits for angles of up to a million; small angles have the bits of
    the series."""
    turns = nearest_integer(a * (2.0 / math.pi))
    one, two, three = _RIGHT_ANGLES
    c, s = _lanes_series(((a - turns * one) - turns * two) - turns * three)
    quarter = turns - 4.0 * nearest_integer(0.25 * turns)  # -2 .. 2
    even = absolute(absolute(quarter) - 1.0)
    c, s = choose(0.5, even, c, s), choose(0.5, even, s, c)
    return choose(absolute(quarter + 0.5), 1.0, c, -c), choose(absolute(quarter - 0.5), 1.0, s, -s)


def cos_sin(a: Any) -> Any:
    """Cosine and sine of an angle, for compiled code only."""
    raise NotImplementedError


def reciprocal(a: Any) -> Any:
    """One over a number, for compiled code only."""
    raise NotImplementedError


@overload(cos_sin, inline="always")
def _cos_sin_of(a: Any) -> Any:
    if isinstance(a, types.Complex):

        def dual(a: Any) -> Any:
            c, s = _real_cos_sin(a.real)
            return complex(c, -s * a.imag), complex(s, c * a.imag)

        return dual

    if isinstance(a, LanesType):

        def in_lanes(a: Any) -> Any:
            if any_less(_NO_TURN, absolute(a)):
                return _lanes_turned(a)
            return _lanes_series(a)

        return in_lanes

    def real(a: Any) -> Any:
        return _real_cos_sin(a)

    return real


@overload(reciprocal, inline="always")
def _reciprocal_of(a: Any) -> Any:
    if isinstance(a, types.Complex):

        def dual(a: Any) -> Any:
            r = 1.0 / a.real
            return complex(r, -a.imag * r * r)

        return dual

    def real(a: Any) -> Any:
        return 1.0 / a

    return real
