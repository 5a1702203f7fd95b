"""The flow of a right-hand side that can only be called, by scipy's DOP853 for state and tangents; and its jumps."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows import deadline
from chilopod.flows.arguments import Slopes, UserCode, as_real, numbers, sampled
from chilopod.flows.carrying import NOT_FINITE, TooManySteps, failure, longest_step, pieces, state_beside
from chilopod.frozen import Array

Parts = list[tuple[float, float]]

Gradient = Callable[[float, Array], Array]
"""``gradient(t, x)`` -> derivative of f with respect to the state, shape (n, n)."""

_COMPLEX_STEP = 1e-40
_DIFFERENCE = 6e-6
_OTHER = 5.0  # factor on the difference of two independent errors for a bound on either
_ANALYTIC_FLOOR = 1e-14
_DIFFERENCE_FLOOR = 1e-8
_SMALL = 1e-4
_DISAGREES = 1e-5
_MOST_CALLS = 2_000_000
_PATIENCE, _HOPELESS = 50_000, 4.0  # calls, and factor on the largest number beyond which no more are tried
_NEAR, _FAR = 1e-6 * np.arange(13.0), 0.1 * np.arange(-2.0, 3.0)  # places beside a state, relative to it
_SCATTERED = 1e-13  # fourth difference between near places, relative to the values at far ones, beyond round-off
_PROBES = 257  # samples over the period at which jumps show
_SETTLED = 3  # zooms that leave only the jump of a change with smooth parts
_DISAGREEMENT = (
    "the derivative of the flow disagrees with its differences: the right-hand side jumps somewhere in the state. "
    "Write it without branches (numpy.where, sign, maximum), and the jumps are crossed exactly"
)


class NotAnalytic(UserWarning):
    """Warning: a right-hand side can neither be traced nor differentiated by a complex step."""


class UndeclaredSwitch(UserWarning):
    """Warning: a right-hand side that cannot be traced has an undeclared jump."""


@dataclass(frozen=True)
class CalledFlow:
    """Flow of dx/dt = rhs(t, x, *args) from calls, with tolerances relative to the largest size of every state."""

    # The derivative comes from a complex step if the function accepts it near the state, else from central differences.
    rhs: Callable[..., ArrayLike]
    args: tuple[Any, ...]
    edges: Array  # times from 0 to the period at which the integration stops and starts anew
    fast: Array  # borders of the parts of the period with fast changes, where steps are limited, shape (parts, 2)
    times: Array  # one inside every interval between edges
    reason: str  # obstacle to tracing the function
    tolerance: float  # local error per step

    def flow(self, x: Array, t0: float, t1: float) -> tuple[Array, Array]:
        """State at t1 and its derivative with respect to the state at t0."""
        x, parts = np.asarray(x, dtype=np.float64), self._parts(t0, t1)
        sizes = self._sizes(x, parts)
        return self._over(x, parts, self.tolerance, sizes, self._gradient(x, sizes)[0])

    def flow_with_error(self, x: Array, t0: float, t1: float) -> tuple[Array, Array, Array]:
        """State and derivative, with a bound on the error of each entry of the derivative."""
        x, parts = np.asarray(x, dtype=np.float64), self._parts(t0, t1)
        sizes = self._sizes(x, parts)
        gradient, floor = self._gradient(x, sizes)
        state, derivative = self._over(x, parts, self.tolerance, sizes, gradient)
        # A flow with a hundred times the tolerance errs at least ten times as much, so the difference bounds the
        # error. The exception is a step whose error estimate passes through zero and accepts a step that is too
        # long; other steps, from other starts, do not repeat that failure.
        _, coarse = self._over(x, parts, 100.0 * self.tolerance, sizes, gradient)
        _, shifted = self._over(x, _cut(parts), self.tolerance, sizes, gradient)
        unit = sizes[None, :] / sizes[:, None]
        rough = float(np.abs((coarse - derivative) * unit).max())
        other = _OTHER * float(np.abs((shifted - derivative) * unit).max())
        error = max(rough, other) + floor * float(np.abs(derivative * unit).max())
        error = max(error, self._missed(x, parts, derivative * unit, sizes))
        return state, derivative, error / unit

    def flow_states(self, states: Array, t0: float, t1: float) -> Array:
        """Many states, shape (states, n), without derivatives."""
        parts = self._parts(t0, t1)
        return np.array([self._over(x, parts, self.tolerance, self._sizes(x, parts))[0] for x in states])

    def _parts(self, t0: float, t1: float) -> Parts:
        return pieces(np.unique(np.concatenate([self.edges, self.fast.ravel()])), float(self.edges[-1]), t0, t1)

    def _sizes(self, x: Array, parts: Parts) -> Array:
        """Rough largest modulus of every state on the way."""
        largest = np.abs(x)
        unit = float(largest.max()) or 1.0
        for a, b in parts:
            answer = self._solved(x.size, x, a, b, 1e-3, 1e-6 * unit)
            largest, x = np.maximum(largest, np.abs(answer).max(axis=1)), answer[:, -1]
        return np.where(largest > 0.0, largest, float(largest.max()) or 1.0)

    def _over(
        self, x: Array, parts: Parts, tolerance: float, sizes: Array, gradient: Gradient | None = None
    ) -> tuple[Array, Array]:
        """State and, with a gradient, derivative at the end of some parts."""
        n, y, scales = x.size, x, sizes
        if gradient is not None:
            y = np.concatenate([x, np.eye(n).ravel()])
            scales = np.concatenate([sizes, (sizes[:, None] / sizes).ravel()])
        for a, b in parts:
            y = self._solved(n, y, a, b, tolerance, 0.01 * tolerance * scales, gradient)[:, -1]
        return y[:n], y[n:].reshape(-1, n)

    def _missed(self, x: Array, parts: Parts, derivative: Array, sizes: Array) -> float:
        """Error of the derivative by small differences of the flow: it remains where f jumps with the state."""
        direction = np.cos(5.0 * np.arange(x.size) + 0.7)
        off = []
        for h in (_SMALL, _SMALL / 3.0):
            shift = h * direction * sizes
            up, down = (self._over(start, parts, self.tolerance, sizes)[0] for start in (x + shift, x - shift))
            off.append(float(np.abs((up - down) / (2.0 * h * sizes) - derivative @ direction).max()))
            if off[-1] <= _DISAGREES * float(np.abs(derivative).max()):
                return 0.0
        if off[1] < 0.5 * off[0]:
            return 0.0  # an error that falls with the difference is curvature
        deadline.warn(_DISAGREEMENT, UndeclaredSwitch)
        return 2.0 * max(off) / float(np.abs(direction).min())

    def _slope(self, t: float, x: Array) -> Array:
        with UserCode("rhs"):
            return numbers(self.rhs(t, x.copy(), *self.args), x.shape, "rhs")  # it may write into its argument

    def _check_precision(self, t: float, x: Array) -> None:
        """Refuse a function whose values scatter beside a state: no step is short enough for them."""
        places = x[:, None] * (1.0 + np.cos(3.0 * np.arange(x.size) + 1.0)[:, None] * np.append(_NEAR, _FAR))
        near, far = np.split(sampled(self.rhs, self.args, x.size)(np.full(places.shape[1], t), places), [_NEAR.size], 1)
        # Terms that cancel here do not do so far away. A jump is in less than half of the fourth differences.
        rough = np.median(np.abs(np.diff(near, n=4)), axis=1)
        if (rough > _SCATTERED * np.abs(far).max(axis=1)).any():
            said = "must be computed in double precision throughout: beside a state its values scatter"
            raise ParameterError(said, field="rhs")

    def _gradient(self, x: Array, sizes: Array) -> tuple[Gradient, float]:
        """The derivative of f near a state, by the best method for f, and its error relative to its largest entry."""
        if _is_analytic(self.rhs, self.args, x, sizes, self.times):
            return lambda t, x: self._by_complex_steps(t, x, sizes), _ANALYTIC_FLOOR
        said = (
            f"the right-hand side cannot be traced ({self.reason}) nor differentiated by a complex step: its "
            "derivative is taken by differences, with about nine digits"
        )
        deadline.warn(said, NotAnalytic)
        return lambda t, x: self._by_differences(t, x, sizes), _DIFFERENCE_FLOOR

    def _by_complex_steps(self, t: float, x: Array, sizes: Array) -> Array:
        columns = []
        for j in range(x.size):
            z = x.astype(np.complex128)
            z[j] += 1j * _COMPLEX_STEP * sizes[j]
            with UserCode("rhs"):
                columns.append(np.asarray(self.rhs(t, z, *self.args)).imag / (_COMPLEX_STEP * sizes[j]))
        return np.array(columns).T

    def _by_differences(self, t: float, x: Array, sizes: Array) -> Array:
        columns = []
        for step in np.diag(_DIFFERENCE * sizes):
            up, down = x + step, x - step
            columns.append((self._slope(t, up) - self._slope(t, down)) / (up - down).sum())
        return np.array(columns).T

    def _solved(
        self, n: int, y: Array, a: float, b: float, tolerance: float, smallest: Any, gradient: Gradient | None = None
    ) -> Array:
        """The n states and, with a gradient, the derivative, at the steps within a part, shape (all, steps)."""
        calls, ended = 0, deadline.stop()
        inner_a, inner_b = np.nextafter(a, b), np.nextafter(b, a)  # the value at a switch may belong to either side

        def finite(t: float, y: Array) -> Array:
            nonlocal calls
            calls += 1
            ahead = calls * (b - a) > _HOPELESS * _MOST_CALLS * (t - a)  # at the mean length of the steps so far
            if calls > _MOST_CALLS or (calls > _PATIENCE and ahead):
                self._check_precision(t, y[:n])
                said = f"takes too many steps: the integration stopped at t = {t:g}"
                allowed = "switch_times at kinks, a less stiff right-hand side, or one that can be traced"
                raise TooManySteps(said, field="rhs", allowed=allowed)
            if ended[0] != 0.0:
                raise deadline.over()
            t, state = min(max(t, inner_a), inner_b), y[:n]
            slope = self._slope(t, state)
            if gradient is not None:
                slope = np.concatenate([slope, (gradient(t, state) @ y[n:].reshape(n, n)).ravel()])
            if not np.isfinite(slope).all():  # scipy would shorten its step without end
                raise failure(NOT_FINITE, t)
            return slope

        if not np.isfinite(y).all():
            raise AnalysisError("the state is not finite", field="rhs")
        # scipy takes no rtol below 100 eps; a small atol keeps the digits of small states and tangents.
        rtol, longest = max(tolerance, 2.3e-14), longest_step(self.fast, float(self.edges[-1]), a, b)
        answer = solve_ivp(finite, (a, b), y, "DOP853", rtol=rtol, atol=smallest, max_step=longest)
        if not answer.success:
            said = f"the integration from {a:g} to {b:g} stopped: the motion is singular, or jumps with the state"
            raise AnalysisError(said, field="rhs")
        return np.asarray(answer.y)


def _cut(parts: Parts) -> Parts:
    """Parts of an integration, each cut in three, so that the steps differ almost from the start."""
    cuts = [[a + part * (b - a) for part in (0.0, 0.0477, 0.382)] + [b] for a, b in parts]
    return [part for times in cuts for part in zip(times, times[1:], strict=False)]


def _is_analytic(rhs: Callable[..., ArrayLike], args: tuple[Any, ...], x: Array, sizes: Array, times: Array) -> bool:
    """True if complex steps are accepted, and agree with differences on both sides of zero at all given times."""
    step = sizes * np.cos(2.0 * np.arange(x.size) + 0.1)
    shift = sizes * np.cos(np.arange(x.size) + 0.3)
    for t, part in itertools.product(times.tolist(), (0.7, -0.7, 3.1, -3.1)):
        probe = x + part * shift
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                tilted = np.array(rhs(t, probe + 1j * _COMPLEX_STEP * step, *args))
                up, down = (as_real(rhs(t, probe + h * step, *args)) for h in (1e-6, -1e-6))
        except Exception:  # any exception on complex input means that the function does not accept it
            return False
        if not np.iscomplexobj(tilted):
            return False
        difference = (up - down) / 2e-6
        # Where terms cancel, the difference holds their round-off: relative to f, in units of the state.
        allowed = 1e-4 * (np.abs(difference) + np.abs(up))
        if not (np.abs(tilted.imag / _COMPLEX_STEP - difference) <= allowed).all():
            return False
    return True


def warn_of_jumps(slopes: Slopes, base: Array, edges: Array) -> None:
    """Warn of jumps of the right-hand side inside the intervals where it should be smooth.

    Its fourth differences at fixed states away from zero (a jump in a coefficient hides at x = 0) do not fall with the
    spacing at a jump: large ones are bisected down to 1e-12 of the period.
    """
    states = np.array([state_beside(base, s) for s in range(2)]).T
    period = float(edges[-1])

    def values(t: float) -> Array:
        samples = slopes(np.full(2, t), states)
        return np.where(np.isfinite(samples), samples, 0.0).T.ravel()

    found: list[float] = []
    for a, b in zip(edges, edges[1:], strict=False):
        margin = 1e-9 * (b - a)
        times = np.linspace(a + margin, b - margin, max(9, int(_PROBES * (b - a) / period)) + 1)
        samples = np.array([values(t) for t in times])
        rough = _fourth_differences(samples)
        smallest = 1e-9 * float(np.abs(samples).max())
        for i in np.flatnonzero(rough > 4.0 * np.median(rough) + smallest):
            at = _zoom(values, float(times[i]), float(times[i + 4]), 1e-12 * period, smallest)
            if at is not None and all(abs(at - t) > 1e-9 * period for t in found):
                found.append(at)
    if found:
        listed = ", ".join(f"{t:.9g}" for t in sorted(found)[:6]) + (" ..." if len(found) > 6 else "")
        said = f"the right-hand side jumps at t = {listed}, not among switch_times: that costs digits and time"
        deadline.warn(said, UndeclaredSwitch)


def _fourth_differences(samples: Array) -> Array:
    """The largest fourth difference of any component over each five successive samples, shape (samples - 4,)."""
    return np.asarray(np.abs(np.diff(samples, n=4, axis=0)).max(axis=1))


def _zoom(values: Callable[[float], Array], low: float, high: float, width: float, smallest: float) -> float | None:
    """Place of a function's jump in an interval, to within ``width``; None if the function is smooth there."""
    zoom, settled = 0, np.inf
    while high - low >= width:
        times = np.linspace(low, high, 17)
        rough = _fourth_differences(np.array([values(t) for t in times]))
        i = int(rough.argmax())
        if zoom == _SETTLED:
            settled = rough[i]
        if rough[i] < smallest or (zoom > _SETTLED and rough[i] < 0.3 * settled):
            return None
        low, high, zoom = float(times[i]), float(times[i + 4]), zoom + 1
    return 0.5 * (low + high)
