"""Values that ramp to where they are told."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Ramps:
    """Values that move to where they are told at constant rate, each on its own.

    What is told the goal that it has already goes on as it was, but is there no later than it is now told to be.

    Parameters
    ----------
    start
        Values before any command, any shape.
    keep
        True to keep what was told, for :meth:`over`.
    """

    def __init__(self, start: Array, keep: bool = False) -> None:
        begun = np.array(start, dtype=np.float64)
        # Where each ramp begins and ends, and when; never written into, only replaced.
        self._ramps = np.stack([begun, begun, 0.0 * begun, 0.0 * begun])
        self._told: list[tuple[float, Array]] | None = [(0.0, self._ramps)] if keep else None

    @property
    def goal(self) -> Array:
        """Setpoint of the last command."""
        return self._ramps[1]

    def to(self, goal: Array, now: float, within: float) -> None:
        """Move to ``goal`` (NaN: as before), from a time on, within a time, both of any unit."""
        changed = ~np.isnan(goal) & ((goal != self.goal) | (now + within < self._ramps[3]))
        if changed.any():
            begun = np.empty_like(self._ramps)
            begun[0], begun[1], begun[2], begun[3] = _at(self._ramps, now), goal, now, now + within
            self._ramps = np.where(changed, begun, self._ramps)
            if self._told is not None:
                self._told.append((now, self._ramps))

    def at(self, times: Array) -> Array:
        """Values at times (T,) since the last command, shape (T, ...)."""
        return _at(self._ramps, times.reshape(-1, *[1] * self.goal.ndim))

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Let some be 0 from now on, whatever they were told; only without what was told (``keep``)."""
        ramps = self._ramps.copy()
        ramps[:, which] = 0.0
        self._ramps = ramps

    def over(self, times: Array) -> Array:
        """Values at any times (T,), rising, shape (T, ...); at the moment of a command they are those before it."""
        history = self._told or [(0.0, self._ramps)]
        values = np.empty((len(times), *self.goal.shape))
        ends = np.searchsorted(times, [when for when, _ in history[1:]] + [np.inf], side="right")
        first = 0
        for (_, ramps), last in zip(history, ends, strict=True):
            if last > first:
                values[first:last] = _at(ramps, times[first:last].reshape(-1, *[1] * self.goal.ndim))
                first = last
        return values

    def state(self) -> dict[str, Array]:
        """All there is to it, for :meth:`restore`."""
        if self._told is None:
            return {"now": self._ramps}
        history = np.array([each for _, each in self._told])
        return {"now": self._ramps, "times": np.array([when for when, _ in self._told]), "history": history}

    def restore(self, state: dict[str, Array]) -> None:
        """Become as another was."""
        self._ramps = state["now"]
        if self._told is not None:
            self._told = list(zip(state["times"].tolist(), state["history"], strict=True))


def _at(ramps: Array, times: Any) -> Array:
    start, goal, since, until = ramps
    length = until - since
    part = np.minimum(np.maximum((times - since) / np.where(length > 0.0, length, 1.0), 0.0), 1.0)
    return np.where(times >= until, goal, start + part * (goal - start))
