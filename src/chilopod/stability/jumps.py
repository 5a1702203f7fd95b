"""Finding jumps of a right-hand side at times that were not declared as switches."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_PROBES = 257


class UndeclaredSwitch(UserWarning):
    """A right-hand side jumps at a time that was not declared as a switch."""


def warn_of_jumps(
    rhs: Callable[..., ArrayLike], args: tuple[Any, ...], n: int, edges: Array, orbit: Array | None
) -> None:
    """Look for jumps of the right-hand side inside the intervals where it should be smooth.

    It is sampled at fixed states away from zero (a jump in a coefficient hides at x = 0), and wherever it changes by
    much more than at the neighbours the change is followed down to an interval of 1e-12 of the period.
    """
    base = np.zeros(n) if orbit is None else orbit
    states = [base + np.cos(3.0 * np.arange(n) + 1.0 + s) for s in range(2)]
    period = edges[-1]

    def values(t: float) -> Array:
        return np.concatenate([np.asarray(rhs(t, x, *args), dtype=np.float64).ravel() for x in states])

    found: list[float] = []
    for a, b in zip(edges, edges[1:], strict=False):
        margin = 1e-9 * (b - a)
        times = np.linspace(a + margin, b - margin, max(9, int(_PROBES * (b - a) / period)) + 1)
        samples = np.array([values(t) for t in times])
        changes = np.abs(np.diff(samples, axis=0)).max(axis=1)
        typical = np.median(changes)
        for i in np.flatnonzero(changes > 4.0 * typical + 1e-9 * np.abs(samples).max()):
            low, high, v_low, v_high = times[i], times[i + 1], samples[i], samples[i + 1]
            jump = changes[i]
            while high - low > 1e-12 * period:
                middle = 0.5 * (low + high)
                v = values(middle)
                if np.abs(v - v_low).max() >= np.abs(v_high - v).max():
                    high, v_high = middle, v
                else:
                    low, v_low = middle, v
            if np.abs(v_high - v_low).max() > 0.05 * jump:
                found.append(float(high))
    if found:
        listed = ", ".join(f"{t:.9g}" for t in found[:6]) + (" ..." if len(found) > 6 else "")
        warnings.warn(
            f"the right-hand side jumps at t = {listed}, not among switch_times: results would lose most digits",
            UndeclaredSwitch,
            stacklevel=4,
        )
