"""A periodic system from its right-hand side."""

from __future__ import annotations

import functools
import itertools
import warnings
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability.arguments import check_shape, check_symmetry, checked_arguments, finite_array
from chilopod.stability.capabilities import spatial_symmetries
from chilopod.stability.jumps import warn_of_jumps
from chilopod.stability.system import PeriodicSystem

Array = NDArray[np.float64]

TOLERANCE = 1e-14
_COMPLEX_STEP = 1e-40
_OTHER = 5.0  # two independent errors differ by less than a fifth of them rarely enough


class NotAnalytic(UserWarning):
    """A compiled right-hand side cannot be differentiated by a complex step."""


@runtime_checkable
class Compiled(Protocol):
    """A function that numba has compiled."""

    @property
    def py_func(self) -> Callable[..., ArrayLike]:
        """The function as it was written."""
        ...

    def __call__(self, *args: Any) -> Any:
        """Run the compiled code."""
        ...


def from_rhs(
    rhs: Callable[..., ArrayLike],
    dimension: int,
    period: float,
    *,
    args: tuple[Any, ...] = (),
    switch_times: Sequence[float] = (),
    jacobian: Callable[..., ArrayLike] | None = None,
    symmetry: ArrayLike | None = None,
    spatial_symmetry: ArrayLike | None = None,
    orbit: ArrayLike | None = None,
    tolerance: float = TOLERANCE,
) -> PeriodicSystem:
    """Build a :class:`PeriodicSystem` from dx/dt = rhs(t, x, *args).

    The derivative of the flow is integrated along with the state, and the step is controlled on both. A function
    compiled with ``numba.njit`` is integrated by compiled code, tens of times faster; a plain Python function by
    scipy's DOP853.

    Parameters
    ----------
    rhs
        ``rhs(t, x, *args)`` -> dx/dt, shape (n,); T-periodic in t.
    dimension, period
        n and T.
    args
        Parameters of the right-hand side.
    switch_times
        Times in [0, T) at which ``rhs`` jumps or has a kink. Integration stops and restarts there; within an interval
        the function is only ever asked at times strictly inside it. A jump that is not declared costs time and
        digits: jumps found on a fine grid are warned of.
    jacobian
        ``jacobian(t, x, *args)`` -> (n, n). Without it the derivative is taken by a complex step, exact for analytic
        functions; where ``rhs`` does not accept complex states, by central differences, with about nine digits.
    symmetry, spatial_symmetry, orbit
        See :class:`PeriodicSystem`.
    tolerance
        Local error per step, relative to max(1, |x|).

    Warns
    -----
    UndeclaredSwitch
        If the right-hand side jumps elsewhere than at ``switch_times``.
    NotAnalytic
        If a compiled right-hand side does not take a complex step.
    """
    dimension, period, args, tolerance = checked_arguments(rhs, dimension, period, args, tolerance)
    edges = _edges(switch_times, period)
    start = None if orbit is None else finite_array(orbit, (dimension,), "orbit")
    base = np.zeros(dimension) if start is None else start
    times = np.asarray(edges[:-1] + 0.4142 * np.diff(edges))  # one inside every interval
    check_shape(rhs, args, times, base, (dimension,), "rhs")
    if jacobian is not None:
        check_shape(jacobian, args, times, base, (dimension, dimension), "jacobian")
    segments: _CompiledSegments | _PythonSegments
    if isinstance(rhs, Compiled) and jacobian is None:
        if _is_analytic(rhs, args, base, times):
            segments = _CompiledSegments(rhs, args)
        else:
            warnings.warn(
                "the compiled right-hand side is not differentiable by a complex step (numba evaluates x**3 of a "
                "negative number through its logarithm: write x*x*x), so it is run as plain Python",
                NotAnalytic,
                stacklevel=2,
            )
            segments = _PythonSegments(rhs.py_func, args, None, times)
    else:
        segments = _PythonSegments(rhs, args, jacobian, times)
    warn_of_jumps(rhs, args, dimension, edges, start)

    def flow_at(x: Array, pieces: list[tuple[float, float]], tol: float) -> tuple[Array, Array]:
        state, derivative = np.array(x, dtype=np.float64), np.eye(dimension)
        for a, b in pieces:
            state, derivative = segments.advance(state, derivative, a, b, tol)
        return state, derivative

    def flow(x: Array, t0: float, t1: float) -> tuple[Array, Array]:
        return flow_at(x, _pieces(edges, period, t0, t1), tolerance)

    def flow_with_error(x: Array, t0: float, t1: float) -> tuple[Array, Array, float]:
        pieces = _pieces(edges, period, t0, t1)
        state, derivative = flow_at(x, pieces, tolerance)
        # The same with a tolerance a hundred times as large errs at least ten times as much, so the difference bounds
        # the error. Except where the step control is deceived: its estimate passes through zero now and then, and lets
        # a step through that is too long. Other steps, from other starts, are not deceived alike.
        _, coarse = flow_at(x, pieces, 100.0 * tolerance)
        _, shifted = flow_at(x, _cut(pieces), tolerance)
        size = max(1.0, float(np.abs(derivative).max()))
        error = max(float(np.abs(coarse - derivative).max()), _OTHER * float(np.abs(shifted - derivative).max()))
        return state, derivative, error + segments.floor * size

    system = PeriodicSystem(
        dimension=dimension,
        period=period,
        flow=flow,
        symmetry=None if symmetry is None else np.asarray(symmetry, dtype=np.float64),
        spatial_symmetry=None if spatial_symmetry is None else np.asarray(spatial_symmetry, dtype=np.float64),
        orbit=start,
        flow_with_error=flow_with_error,
        flow_states=lambda states, t0, t1: np.array(
            [segments.carry(x, _pieces(edges, period, t0, t1), tolerance) for x in states]
        ),
    )
    if system.symmetry is not None:
        check_symmetry("symmetry", system.symmetry, period / system.symmetry_order, rhs, args, times, base, period)
    for matrix in spatial_symmetries(system):
        check_symmetry("spatial_symmetry", matrix, 0.0, rhs, args, times, base, period)
    return system


def _edges(switch_times: Sequence[float], period: float) -> Array:
    try:
        switches = np.unique(np.array(switch_times, dtype=np.float64))
        valid = np.ndim(switch_times) == 1 and bool(((switches >= 0) & (switches < period)).all())
    except (TypeError, ValueError):
        valid = False
    if not valid:
        raise ParameterError(
            "must be times within one period", field="switch_times", value=switch_times, allowed=f"[0, {period:g})"
        )
    return np.unique(np.concatenate([[0.0], switches, [period]]))


def _pieces(edges: Array, period: float, t0: float, t1: float) -> list[tuple[float, float]]:
    """Cut [t0, t1] at the switches."""
    first, last = int(np.floor(t0 / period)), int(np.ceil(t1 / period))
    switches = [float(k * period + e) for k in range(first, last + 1) for e in edges[:-1]]
    inside = [t for t in switches if t0 + 1e-12 * period < t < t1 - 1e-12 * period]
    cuts = [t0, *inside, t1]
    return [(a, b) for a, b in zip(cuts, cuts[1:], strict=False) if b > a]


def _cut(pieces: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same pieces, each in three parts, so that the steps fall elsewhere almost from the start."""
    cuts = [[a + part * (b - a) for part in (0.0, 0.0477, 0.382)] + [b] for a, b in pieces]
    return [part for times in cuts for part in zip(times, times[1:], strict=False)]


class _PythonSegments:
    """State and tangent over one smooth interval by scipy's DOP853."""

    def __init__(
        self,
        rhs: Callable[..., ArrayLike],
        args: tuple[Any, ...],
        jacobian: Callable[..., ArrayLike] | None,
        times: Array,
    ) -> None:
        self.rhs = rhs
        self.args = args
        self.jacobian = jacobian
        self.times = times
        self.floor = 1e-14
        self._analytic: bool | None = None

    def advance(self, x: Array, derivative: Array, a: float, b: float, tolerance: float) -> tuple[Array, Array]:
        n = x.size
        inner_a, inner_b = np.nextafter(a, b), np.nextafter(b, a)

        def both(t: float, y: Array) -> Array:
            t = min(max(t, inner_a), inner_b)  # at a switch itself it is anybody's guess which side counts
            return np.concatenate([self._slope(t, y[:n]), (self._gradient(t, y[:n]) @ y[n:].reshape(n, n)).ravel()])

        y = _solve(both, np.concatenate([x, derivative.ravel()]), a, b, tolerance)
        return y[:n], y[n:].reshape(n, n)

    def carry(self, x: Array, pieces: list[tuple[float, float]], tolerance: float) -> Array:
        x = np.array(x, dtype=np.float64)
        for a, b in pieces:
            inner_a, inner_b = np.nextafter(a, b), np.nextafter(b, a)
            x = _solve(lambda t, y, lo=inner_a, hi=inner_b: self._slope(min(max(t, lo), hi), y), x, a, b, tolerance)
        return x

    def _slope(self, t: float, x: Array) -> Array:
        return np.asarray(self.rhs(t, x, *self.args), dtype=np.float64)

    def _gradient(self, t: float, x: Array) -> Array:
        if self.jacobian is not None:
            return np.asarray(self.jacobian(t, x, *self.args), dtype=np.float64)
        if self._analytic is None:
            self._analytic = _is_analytic(self.rhs, self.args, x, self.times)
            if not self._analytic:
                self.floor = 1e-8
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


class _CompiledSegments:
    """The same by the compiled integrator, the tangents by complex steps."""

    floor = 1e-14

    def __init__(self, rhs: Any, args: tuple[Any, ...]) -> None:
        self._advance = _compiled_advance(rhs)
        self.args = args

    def advance(self, x: Array, derivative: Array, a: float, b: float, tolerance: float) -> tuple[Array, Array]:
        batch = x + 1j * _COMPLEX_STEP * derivative.T
        self._run(batch, a, b, tolerance)
        return batch[0].real.copy(), batch.imag.T / _COMPLEX_STEP

    def carry(self, x: Array, pieces: list[tuple[float, float]], tolerance: float) -> Array:
        batch = np.array(x, dtype=np.float64)[None].copy()
        # Normal forms divide by powers of small states, so those are to keep their digits; tighter than this, round-off
        # would only shorten the steps.
        tolerance *= min(1.0, max(0.01, float(np.abs(batch).max())))
        for a, b in pieces:
            self._run(batch, a, b, tolerance)
        return batch[0]

    def _run(self, batch: Any, a: float, b: float, tolerance: float) -> None:
        if not self._advance(batch, a, b, float(np.nextafter(a, b)), float(np.nextafter(b, a)), tolerance, self.args):
            raise AnalysisError(f"the integration from {a:g} to {b:g} stopped short", field="rhs")


@functools.cache
def _compiled_advance(rhs: Any) -> Callable[..., bool]:
    # numba takes half a second to import, and only this path needs it.
    import numba

    from chilopod.integrate import integrator

    @numba.njit
    def inside(t: float, x: Any, args: Any, out: Any) -> None:
        low, high, own = args
        slope = rhs(min(max(t, low), high), x, *own)
        for i in range(x.size):
            out[i] = slope[i]

    integrate = integrator(inside, on_disk=False)

    @numba.njit
    def advance(batch: Any, a: float, b: float, low: float, high: float, tolerance: float, own: Any) -> bool:
        work = np.empty((16, batch.shape[1]), batch.dtype)
        for r in range(batch.shape[0]):
            _, reached = integrate((low, high, own), batch[r], a, b, 0.0, tolerance, work)
            if not reached:
                return False
        return True

    return advance
