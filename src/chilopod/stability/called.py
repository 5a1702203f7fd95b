"""The flow of a right-hand side that can only be called: scipy's DOP853 for state and tangents together."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from chilopod.errors import AnalysisError
from chilopod.stability.taylor import pieces

Array = NDArray[np.float64]

_COMPLEX_STEP = 1e-40
_OTHER = 5.0  # two independent errors differ by less than a fifth of them rarely enough
_ANALYTIC_FLOOR = 1e-14
_DIFFERENCE_FLOOR = 1e-8


class NotAnalytic(UserWarning):
    """A right-hand side can neither be traced nor differentiated by a complex step."""


class CalledFlow:
    """Flow and derivative of dx/dt = rhs(t, x, *args) from calls of the function.

    Parameters
    ----------
    rhs, args, jacobian
        As for :func:`chilopod.stability.from_rhs`. Without a jacobian the derivative is taken by a complex step where
        that is right at all of the probed times, else by central differences.
    edges
        Times from 0 to the period at which the integration stops and starts anew.
    times
        One inside every interval between edges.
    tolerance
        Local error per step.
    """

    def __init__(
        self,
        rhs: Callable[..., ArrayLike],
        args: tuple[Any, ...],
        jacobian: Callable[..., ArrayLike] | None,
        edges: Array,
        times: Array,
        tolerance: float,
    ) -> None:
        self.rhs = rhs
        self.args = args
        self.jacobian = jacobian
        self.edges = edges
        self.period = float(edges[-1])
        self.times = times
        self.tolerance = tolerance
        self.floor = _ANALYTIC_FLOOR
        self._analytic: bool | None = None

    def flow(self, x: Array, t0: float, t1: float) -> tuple[Array, Array]:
        """State at t1 and its derivative with respect to the state at t0."""
        return self._over(x, pieces(self.edges, self.period, t0, t1), self.tolerance)

    def flow_with_error(self, x: Array, t0: float, t1: float) -> tuple[Array, Array, float]:
        """The same with a bound on the error of the largest entry of the derivative."""
        parts = pieces(self.edges, self.period, t0, t1)
        state, derivative = self._over(x, parts, self.tolerance)
        # The same with a tolerance a hundred times as large errs at least ten times as much, so the difference bounds
        # the error. Except where the step control is deceived: its estimate passes through zero now and then, and lets
        # a step through that is too long. Other steps, from other starts, are not deceived alike.
        _, coarse = self._over(x, parts, 100.0 * self.tolerance)
        _, shifted = self._over(x, _cut(parts), self.tolerance)
        size = float(np.abs(derivative).max())
        error = max(float(np.abs(coarse - derivative).max()), _OTHER * float(np.abs(shifted - derivative).max()))
        return state, derivative, error + self.floor * size

    def flow_states(self, states: Array, t0: float, t1: float) -> Array:
        """Many states, shape (states, n), without derivatives."""
        parts = pieces(self.edges, self.period, t0, t1)
        return np.array([self._carry(x, parts) for x in states])

    def _over(self, x: Array, parts: list[tuple[float, float]], tolerance: float) -> tuple[Array, Array]:
        state, derivative = np.array(x, dtype=np.float64), np.eye(x.size)
        for a, b in parts:
            state, derivative = self._advance(state, derivative, a, b, tolerance)
        return state, derivative

    def _advance(self, x: Array, derivative: Array, a: float, b: float, tolerance: float) -> tuple[Array, Array]:
        n = x.size
        inner_a, inner_b = np.nextafter(a, b), np.nextafter(b, a)

        def both(t: float, y: Array) -> Array:
            t = min(max(t, inner_a), inner_b)  # at a switch itself it is anybody's guess which side counts
            return np.concatenate([self._slope(t, y[:n]), (self._gradient(t, y[:n]) @ y[n:].reshape(n, n)).ravel()])

        y = _solve(both, np.concatenate([x, derivative.ravel()]), a, b, tolerance)
        return y[:n], y[n:].reshape(n, n)

    def _carry(self, x: Array, parts: list[tuple[float, float]]) -> Array:
        x = np.array(x, dtype=np.float64)
        for a, b in parts:
            inner_a, inner_b = np.nextafter(a, b), np.nextafter(b, a)
            x = _solve(
                lambda t, y, lo=inner_a, hi=inner_b: self._slope(min(max(t, lo), hi), y), x, a, b, self.tolerance
            )
        return x

    def _slope(self, t: float, x: Array) -> Array:
        return np.asarray(self.rhs(t, x, *self.args), dtype=np.float64)

    def _gradient(self, t: float, x: Array) -> Array:
        if self.jacobian is not None:
            return np.asarray(self.jacobian(t, x, *self.args), dtype=np.float64)
        if self._analytic is None:
            self._analytic = _is_analytic(self.rhs, self.args, x, self.times)
            if not self._analytic:
                self.floor = _DIFFERENCE_FLOOR
        columns = []
        for j in range(x.size):
            if self._analytic:
                z = x.astype(np.complex128)
                z[j] += 1j * _COMPLEX_STEP
                columns.append(np.asarray(self.rhs(t, z, *self.args)).imag / _COMPLEX_STEP)
            else:
                h = 6e-6 * max(1.0, abs(x[j]))
                up, down = x.copy(), x.copy()
                up[j] += h
                down[j] -= h
                columns.append((self._slope(t, up) - self._slope(t, down)) / (2 * h))
        return np.array(columns).T


def _cut(pieces: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same pieces, each in three parts, so that the steps fall elsewhere almost from the start."""
    cuts = [[a + part * (b - a) for part in (0.0, 0.0477, 0.382)] + [b] for a, b in pieces]
    return [part for times in cuts for part in zip(times, times[1:], strict=False)]


def _is_analytic(rhs: Callable[..., ArrayLike], args: tuple[Any, ...], x: Array, times: Array) -> bool:
    """Whether a right-hand side takes complex states, and complex steps agree with differences on both sides of zero,
    at all of some times."""
    step = np.cos(2.0 * np.arange(x.size) + 0.1)
    shift = np.cos(np.arange(x.size) + 0.3)
    for t, size in itertools.product(times.tolist(), (0.7, -0.7, 3.1, -3.1)):
        probe = x + size * shift
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                tilted = np.asarray(rhs(t, probe + 1j * _COMPLEX_STEP * step, *args))
                up, down = (np.asarray(rhs(t, probe + h * step, *args), dtype=np.float64) for h in (1e-6, -1e-6))
        except Exception:  # whatever a user's function raises on complex input means the same: it does not take it
            return False
        if not np.iscomplexobj(tilted):
            return False
        difference = (up - down) / 2e-6
        if not np.allclose(
            tilted.imag / _COMPLEX_STEP, difference, rtol=1e-4, atol=1e-4 * (1 + np.abs(difference).max())
        ):
            return False
    return True


def _solve(f: Callable[..., Array], y: Array, a: float, b: float, tolerance: float) -> Array:
    def finite(t: float, y: Array) -> Array:
        slope = f(t, y)
        if not np.isfinite(slope).all():  # scipy would shorten its step for ever
            raise AnalysisError(f"the motion diverges, or the right-hand side is not finite, at t = {t:g}", field="rhs")
        return slope

    if not np.isfinite(y).all():
        raise AnalysisError("the state is not finite", field="rhs")
    # scipy takes no rtol below 100 eps; a small atol keeps the digits of small states and tangents.
    answer = solve_ivp(finite, (a, b), y, method="DOP853", rtol=max(tolerance, 2.3e-14), atol=0.01 * tolerance)
    if not answer.success:
        raise AnalysisError(f"the integration from {a:g} to {b:g} stopped ({answer.message})", field="rhs")
    return np.asarray(answer.y[:, -1])
