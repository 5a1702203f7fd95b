"""Search for jumps of a right-hand side at times that are not declared as switches."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from chilopod.flows import deadline
from chilopod.flows.arguments import Slopes
from chilopod.frozen import Array

_PROBES = 257
_GRID = 4096
_FAST = 0.02
_MARGIN = 8
_STEPS_IN_FAST_PART = 16
_SETTLED = 3  # zooms that leave only the jump of a change with smooth parts


class UndeclaredSwitch(UserWarning):
    """Warning: a right-hand side that cannot be traced has an undeclared jump."""


def fast_parts(slopes: Slopes, base: Array, edges: Array) -> Array:
    """Borders of the parts of the period, shape (parts, 2), in which a right-hand side at a fixed state changes by more
    than a fiftieth of its range in 1/4096 of the period without a switch: an integrator might step over that."""
    period = float(edges[-1])
    times = (np.arange(_GRID) + 0.5) * (period / _GRID)
    x = _beside(base)
    samples = slopes(np.asarray(times, dtype=np.float64), np.repeat(x[:, None], _GRID, axis=1))
    samples = np.asarray(np.where(np.isfinite(samples), samples, 0.0), dtype=np.float64)
    span = np.ptp(samples, axis=1, keepdims=True)
    change = np.abs(np.diff(samples, axis=1)) / np.where(span > 0.0, span, 1.0)
    # Round-off of a constant is not a change.
    change[span[:, 0] <= 1e-12 * np.abs(samples).max(axis=1)] = 0.0
    change[:, np.clip(np.searchsorted(times, edges) - 1, 0, _GRID - 2)] = 0.0
    near = np.convolve(change.max(axis=0) > _FAST, np.ones(2 * _MARGIN + 1), mode="same") > 0.0
    borders = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    return np.asarray(borders.reshape(-1, 2) * (period / _GRID))


def _beside(base: Array, turn: float = 0.0) -> Array:
    """State at about the distance of a state's own size."""
    return base + (float(np.abs(base).max()) or 1.0) * np.cos(3.0 * np.arange(base.size) + 1.0 + turn)


def longest_step(fast: Array, period: float, a: float, b: float) -> float:
    """Longest step from a to b; no border of the fast parts lies between them."""
    middle = (0.5 * (a + b)) % period
    inside = (fast[:, 0] < middle) & (middle < fast[:, 1])
    return (b - a) / _STEPS_IN_FAST_PART if inside.any() else np.inf


def warn_of_jumps(slopes: Slopes, n: int, edges: Array, orbit: Array | None) -> None:
    """Warn of jumps of the right-hand side inside the intervals where it should be smooth.

    Its fourth differences at fixed states away from zero (a jump in a coefficient hides at x = 0) do not fall with the
    spacing at a jump: large ones are bisected down to 1e-12 of the period.
    """
    base = np.zeros(n) if orbit is None else orbit
    states = np.array([_beside(base, s) for s in range(2)]).T
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
    settled = np.inf
    for zoom in itertools.count():
        times = np.linspace(low, high, 17)
        rough = _fourth_differences(np.array([values(t) for t in times]))
        i = int(rough.argmax())
        if zoom == _SETTLED:
            settled = rough[i]
        if rough[i] < smallest or (zoom > _SETTLED and rough[i] < 0.3 * settled):
            return None
        low, high = float(times[i]), float(times[i + 4])
        if high - low < width:
            return 0.5 * (low + high)
    raise AssertionError  # unreachable
