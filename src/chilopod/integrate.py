"""A compiled Dormand-Prince 8(5,3) integrator for real states and for states that carry a tangent.

The state is an array of any length, real or complex. A complex state is a *complex-step* pair: the real part is the
state ``x`` and the imaginary part is ``COMPLEX_STEP`` times a tangent vector ``dx``; every analytic right-hand side
then transports both, and the tangent comes out exact to round-off (Squire & Trapp, SIAM Review 40, 1998). Step size is
controlled on the state *and* on the tangent: on a periodic orbit where the state does not move at all, a control
driven by the state alone would accept any step and silently ruin the derivative.

Method and error estimator: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, section II.10; the
tableau is the one of :class:`scipy.integrate.DOP853`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from scipy.integrate import DOP853

from chilopod.compiled import fused_njit, njit

COMPLEX_STEP = 1e-40
"""Size of the imaginary perturbation; products of two of them underflow harmlessly."""

MAX_STEPS = 1_000_000
"""A single call gives up after this many steps (status ``False``)."""

_A = np.ascontiguousarray(DOP853.A)
_B = np.ascontiguousarray(DOP853.B)
_C = np.ascontiguousarray(DOP853.C)
_E3 = np.ascontiguousarray(DOP853.E3)
_E5 = np.ascontiguousarray(DOP853.E5)
_STAGES = 12
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 6.0


@njit(inline="always")
def _size(value: Any) -> float:
    """Magnitude of a component, its tangent part measured in tangent units."""
    return max(abs(value.real), abs(value.imag) / COMPLEX_STEP)


@functools.cache
def integrator(rhs: Callable[..., None], on_disk: bool = True) -> Callable[..., tuple[float, bool]]:
    """The compiled integrator of one right-hand side (numba keeps it on disk, which it cannot for a function argument).

    Parameters
    ----------
    rhs
        Compiled function ``rhs(t, x, args, out)`` that writes ``dx/dt`` into ``out``; smooth between ``t0`` and ``t1``.
    on_disk
        Whether to keep the compiled code on disk. Not for a function made at run time: its code would never be found
        again, and leave a file behind at every run.

    Returns
    -------
        ``integrate(args, x, t0, t1, h, tolerance, work) -> (h, reached)``, which advances ``x`` in place:

        - args: passed through to ``rhs``;
        - x: state, shape (n,), float64 or complex128 (see the module docstring);
        - t0, t1: interval, ``t1 > t0``;
        - h: first step to try; 0 lets the routine guess. The step to start the next call with is returned;
        - tolerance: bound on the local error of each component, relative to ``max(1, |x|)``, on state and tangent
          alike;
        - work: scratch, shape (16, n), the dtype of ``x``;
        - reached: whether ``t1`` was reached.
    """

    @(fused_njit if on_disk else numba.njit(fastmath={"contract"}))
    def integrate(args: Any, x: Any, t0: float, t1: float, h: float, tolerance: float, work: Any) -> tuple[float, bool]:
        n = x.size
        k = work[:13]
        y = work[13]
        fifth = work[14]
        third = work[15]
        t = t0
        rhs(t, x, args, k[0])
        if h <= 0.0:
            # |x| / |x'| with a tenth of a safety factor: the controller corrects within two steps.
            scale = 0.0
            slope = 0.0
            for i in range(n):
                scale = max(scale, _size(x[i]))
                slope = max(slope, _size(k[0, i]))
            h = 0.01 * max(scale, 1e-3) / slope if slope > 0.0 else t1 - t0
        rejected = False
        for _ in range(MAX_STEPS):
            remaining = t1 - t
            last = h >= remaining * (1.0 - 1e-12)
            step = remaining if last else h
            for s in range(1, _STAGES):
                for i in range(n):
                    y[i] = x[i]
                for j in range(s):
                    a = step * _A[s, j]
                    if a != 0.0:
                        for i in range(n):
                            y[i] += a * k[j, i]
                rhs(t + _C[s] * step, y, args, k[s])
            # y: the new state; third and fifth: the two error estimates.
            for i in range(n):
                y[i] = x[i]
                fifth[i] = 0.0
                third[i] = 0.0
            for s in range(_STAGES):
                b, e5, e3 = step * _B[s], _E5[s], _E3[s]
                if b != 0.0 or e5 != 0.0 or e3 != 0.0:
                    for i in range(n):
                        y[i] += b * k[s, i]
                        fifth[i] += e5 * k[s, i]
                        third[i] += e3 * k[s, i]
            t_new = t1 if last else t + step
            rhs(t_new, y, args, k[12])
            e5, e3 = _E5[_STAGES], _E3[_STAGES]
            err5 = 0.0
            err3 = 0.0
            check = 0.0  # a comparison forgets what is not a number, a sum does not
            for i in range(n):
                scale = tolerance * max(1.0, _size(x[i]), _size(y[i]))
                err5 = max(err5, _size(fifth[i] + e5 * k[12, i]) / scale)
                err3 = max(err3, _size(third[i] + e3 * k[12, i]) / scale)
                check += abs(y[i].real) + abs(y[i].imag) + abs(k[12, i].real) + abs(k[12, i].imag)
            error = 0.0
            if err5 > 0.0 or err3 > 0.0:
                error = step * err5 * err5 / np.sqrt(err5 * err5 + 0.01 * err3 * err3)
            if not np.isfinite(error + check):
                error = 1e300
            if error <= 1.0:
                t = t_new
                for i in range(n):
                    x[i] = y[i]
                    k[0, i] = k[12, i]
                factor = _GROW if error == 0.0 else min(_GROW, _SAFETY * error ** (-0.125))
                if rejected:
                    factor = min(1.0, factor)
                rejected = False
                if not last or factor < 1.0:
                    h = step * factor
                if last:
                    return h, True
            else:
                h = step * max(_SHRINK, _SAFETY * error ** (-0.125))
                rejected = True
                if h < 1e-14 * max(abs(t), t1 - t0):
                    return h, False
        return h, False

    return integrate
