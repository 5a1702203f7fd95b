"""Functions of numbers that may carry a tangent in their imaginary part, compiled and inlined.

A complex-step number (see :mod:`chilopod.integrate`) has an imaginary part so small that its square vanishes, so a
function f of one is ``f(a) + i b f'(a)`` exactly: no complex function of a library is needed, and these cost little
more than the real ones. They serve real numbers as well.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from chilopod.compiled import fused_njit

_SMALL = 0.25 * math.pi
_SIN = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(8))
_COS = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(9))


@fused_njit
def _real_cos_sin(a: float) -> tuple[float, float]:
    """Taylor series to the last bit for angles of up to 45 degrees, which joints seldom leave; half the time."""
    if abs(a) > _SMALL:
        return np.cos(a), np.sin(a)
    z = a * a
    s = _SIN[7]
    c = _COS[8]
    s = _SIN[6] + z * s
    c = _COS[7] + z * c
    s = _SIN[5] + z * s
    c = _COS[6] + z * c
    s = _SIN[4] + z * s
    c = _COS[5] + z * c
    s = _SIN[3] + z * s
    c = _COS[4] + z * c
    s = _SIN[2] + z * s
    c = _COS[3] + z * c
    s = _SIN[1] + z * s
    c = _COS[2] + z * c
    return 1.0 + z * (_COS[1] + z * c), a + a * z * s


def _cos_sin(a: Any) -> Any:
    raise NotImplementedError


def _reciprocal(a: Any) -> Any:
    raise NotImplementedError


@overload(_cos_sin, inline="always")
def _cos_sin_of(a: Any) -> Any:
    if isinstance(a, types.Complex):

        def dual(a: Any) -> Any:
            c, s = _real_cos_sin(a.real)
            return complex(c, -s * a.imag), complex(s, c * a.imag)

        return dual

    def real(a: Any) -> Any:
        return _real_cos_sin(a)

    return real


@overload(_reciprocal, inline="always")
def _reciprocal_of(a: Any) -> Any:
    if isinstance(a, types.Complex):

        def dual(a: Any) -> Any:
            r = 1.0 / a.real
            return complex(r, -a.imag * r * r)

        return dual

    def real(a: Any) -> Any:
        return 1.0 / a

    return real


@fused_njit
def cos_sin(a: Any) -> Any:
    """Cosine and sine of a real or complex-step angle."""
    return _cos_sin(a)


@fused_njit
def reciprocal(a: Any) -> Any:
    """One over a real or complex-step number."""
    return _reciprocal(a)
