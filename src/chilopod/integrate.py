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
from chilopod.lanes import absolute, choose, larger, square_root

COMPLEX_STEP = 1e-40
"""Size of the imaginary perturbation; products of two of them underflow harmlessly."""

MAX_STEPS = 1_000_000
"""A single call gives up after this many steps (status ``False``)."""

_A, _B, _C, _E3, _E5 = map(np.ascontiguousarray, (DOP853.A, DOP853.B, DOP853.C, DOP853.E3, DOP853.E5))
STAGES = 12
"""Slopes that a step needs."""
SAFETY, SHRINK, GROW = 0.9, 0.2, 6.0
"""Safety factor of the next step, and the least and largest ratio of two steps."""


# What is summed of the slopes, row by row without the zeros, in fours: for every stage, the new state and both errors.
_SUMS = np.concatenate([_A[:STAGES, :STAGES], [_B, _E5[:STAGES], _E3[:STAGES]]])
_COLUMNS = np.argsort(_SUMS == 0.0, axis=1, kind="stable")
_WEIGHTS = np.take_along_axis(_SUMS, _COLUMNS, axis=1)
_COLUMNS[_WEIGHTS == 0.0] = 0
_FOURS = -(-np.count_nonzero(_SUMS, axis=1) // 4)
_NEW, _FIFTH, _THIRD = range(STAGES, STAGES + 3)

LANES_WORK = STAGES + 3
"""Rows of scratch of :func:`lanes_step`."""


@njit(inline="always")
def _size(value: Any) -> float:
    """Magnitude of a component, its tangent part measured in tangent units."""
    return max(abs(value.real), abs(value.imag) / COMPLEX_STEP)


@njit(inline="always")
def first_step(size: float, slope: float, left: float) -> float:
    """First guess of the step from the sizes of state and slope; the step control corrects it within two steps."""
    return 0.01 * max(size, 1e-3) / slope if slope > 0.0 else left


@njit(inline="always")
def step_factor(error: float, rejected: bool) -> float:
    """Length of the next step over that of the last one, after its error and whether the one before was rejected."""
    factor = SAFETY / np.sqrt(np.sqrt(np.sqrt(error))) if error > 0.0 else GROW
    return max(SHRINK, min(1.0 if rejected else GROW, factor))


@functools.cache
def integrator(rhs: Callable[..., None], on_disk: bool = True) -> Callable[..., tuple[float, bool]]:
    """Return the compiled integrator of one right-hand side; numba can cache it on disk.

    ``rhs(t, x, args, out)`` writes ``dx/dt`` into ``out`` and is smooth between ``t0`` and ``t1``. A function made at
    run time is not cached, because its code would never be found again.

    Returns ``integrate(args, x, t0, t1, h, tolerance, work) -> (h, reached)``, which advances the state ``x``, shape
    (n,), float64 or complex128, in place. ``h`` is the first step to try, 0 for a guess, and the one to start the next
    call with; ``tolerance`` bounds the local error of each component of state and tangent, relative to ``max(1, |x|)``;
    ``work`` is scratch, shape (16, n), of the dtype of ``x``; ``reached`` says whether ``t1`` was reached.
    """

    @(fused_njit if on_disk else numba.njit(fastmath={"contract"}))
    def integrate(args: Any, x: Any, t0: float, t1: float, h: float, tolerance: float, work: Any) -> tuple[float, bool]:
        n, t = x.size, t0
        k, y, fifth, third = work[:13], work[13], work[14], work[15]
        rhs(t, x, args, k[0])
        if h <= 0.0:
            scale, slope = 0.0, 0.0
            for i in range(n):
                scale = max(scale, _size(x[i]))
                slope = max(slope, _size(k[0, i]))
            h = first_step(scale, slope, t1 - t0)
        rejected = False
        for _ in range(MAX_STEPS):
            remaining = t1 - t
            last = h >= remaining * (1.0 - 1e-12)
            step = remaining if last else h
            for s in range(1, STAGES):
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
                y[i], fifth[i], third[i] = x[i], 0.0, 0.0
            for s in range(STAGES):
                b, e5, e3 = step * _B[s], _E5[s], _E3[s]
                if b != 0.0 or e5 != 0.0 or e3 != 0.0:
                    for i in range(n):
                        y[i] += b * k[s, i]
                        fifth[i] += e5 * k[s, i]
                        third[i] += e3 * k[s, i]
            t_new = t1 if last else t + step
            rhs(t_new, y, args, k[12])
            e5, e3 = _E5[STAGES], _E3[STAGES]
            err5, err3, check = 0.0, 0.0, 0.0  # NaN survives the sum `check` and gets lost in a comparison
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
            factor = step_factor(error, rejected)
            rejected = error > 1.0
            if not rejected:
                t = t_new
                for i in range(n):
                    x[i], k[0, i] = y[i], k[12, i]
                if not last or factor < 1.0:
                    h = step * factor
                if last:
                    return h, True
            else:
                h = step * factor
                if h < 1e-14 * max(abs(t), t1 - t0):
                    return h, False
        return h, False

    return integrate


@njit(inline="always")
def _sum_slopes(k: Any, which: int, i: int, zero: Any) -> Any:
    total = zero
    for four in range(_FOURS[which]):
        j = 4 * four
        total += _WEIGHTS[which, j] * k[_COLUMNS[which, j], i]
        total += _WEIGHTS[which, j + 1] * k[_COLUMNS[which, j + 1], i]
        total += _WEIGHTS[which, j + 2] * k[_COLUMNS[which, j + 2], i]
        total += _WEIGHTS[which, j + 3] * k[_COLUMNS[which, j + 3], i]
    return total


@functools.cache
def lanes_step(rhs: Callable[..., None]) -> Callable[..., Any]:
    """Return a compiled step of states in lanes, each with its own time and step length.

    Returns ``attempt(args, x, t, step, tolerance, work, wide) -> error``, all in lanes but the tolerance, as for
    :func:`integrator`. ``work`` is scratch, shape (LANES_WORK, n or more): row 0 holds the slope at the beginning, and
    row STAGES is left with the new state. ``wide`` is the same memory in ``LANES`` lanes, through which sums of slopes
    go, whatever the number of lanes elsewhere. The error is relative to the tolerance, and 1e300 where the new state is
    not finite.
    """

    @njit
    def attempt(args: Any, x: Any, t: Any, step: Any, tolerance: float, work: Any, wide: Any) -> Any:
        k, new, fifth, third = work[:STAGES], work[_NEW], work[_FIFTH], work[_THIRD]
        zero = wide[0, 0] * 0.0
        for s in range(1, STAGES):
            for i in range(wide.shape[1]):
                wide[_NEW, i] = _sum_slopes(wide, s, i, zero)
            for i in range(x.size):
                new[i] = x[i] + step * new[i]
            rhs(t + _C[s] * step, new, args, k[s])
        for i in range(wide.shape[1]):
            for which in range(_NEW, _THIRD + 1):
                wide[which, i] = _sum_slopes(wide, which, i, zero)
        err5 = err3 = check = step * 0.0  # NaN survives the sum `check` and gets lost in a comparison
        for i in range(x.size):
            new[i] = x[i] + step * new[i]
            share = 1.0 / (tolerance * larger(1.0, larger(absolute(x[i]), absolute(new[i]))))
            err5 = larger(err5, absolute(fifth[i]) * share)
            err3 = larger(err3, absolute(third[i]) * share)
            check += absolute(new[i])
        error = step * err5 * err5 / square_root(larger(1e-300, err5 * err5 + 0.01 * err3 * err3))
        return choose(error + check, np.inf, error, 1e300)

    return attempt
