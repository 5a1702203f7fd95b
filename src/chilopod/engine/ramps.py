"""Values that ramp to setpoints."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import Array


class Ramps:
    """Values of any shape that move from a start to their setpoints at constant rates, independently; with ``keep`` the
    setpoints are logged, for :meth:`over`.

    A repeated setpoint does not restart the ramp of a value, which then arrives no later than the new command demands.
    """

    def __init__(self, start: Array, keep: bool = False) -> None:
        begun = np.array(start, dtype=np.float64)
        # Start and end of each ramp, and their times; never written into, only replaced.
        self._ramps = np.stack([begun, begun, 0.0 * begun, 0.0 * begun])
        self._history: list[tuple[float, Array]] | None = [(0.0, self._ramps)] if keep else None

    @property
    def goal(self) -> Array:
        """Setpoint of the last command."""
        return self._ramps[1]

    def to(self, goal: Array, now: float, within: float) -> None:
        """Move to ``goal`` (NaN: unchanged), from a time on and within a duration, both in any unit."""
        changed = ~np.isnan(goal) & ((goal != self.goal) | (now + within < self._ramps[3]))
        if changed.any():
            begun = np.broadcast_arrays(_at(self._ramps, now), goal, now, now + within)
            self._ramps = np.where(changed, begun, self._ramps)
            if self._history is not None:
                self._history.append((now, self._ramps))

    def at(self, times: Array) -> Array:
        """Values at times (T,) since the last command, shape (T, ...)."""
        return _at(self._ramps, times.reshape(-1, *[1] * self.goal.ndim))

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Set some values to 0 from now on, in place of their setpoints; only without a log (``keep``)."""
        ramps = self._ramps.copy()
        ramps[:, which] = 0.0
        self._ramps = ramps

    def over(self, times: Array) -> Array:
        """Values at any rising times (T,), shape (T, ...); at the time of a command, the values before it."""
        history = self._history or [(0.0, self._ramps)]
        values = np.empty((len(times), *self.goal.shape))
        ends = np.searchsorted(times, [when for when, _ in history[1:]] + [np.inf], side="right")
        first = 0
        for (_, ramps), last in zip(history, ends, strict=True):
            if last > first:
                values[first:last] = _at(ramps, times[first:last].reshape(-1, *[1] * self.goal.ndim))
                first = last
        return values

    def state(self) -> dict[str, Array]:
        """Complete state, for :meth:`restore`."""
        if self._history is None:
            return {"now": self._ramps}
        history = np.array([each for _, each in self._history])
        return {"now": self._ramps, "times": np.array([when for when, _ in self._history]), "history": history}

    def restore(self, state: dict[str, Array]) -> None:
        """Take over the state of other ramps."""
        self._ramps = state["now"]
        if self._history is not None:
            self._history = list(zip(state["times"].tolist(), state["history"], strict=True))


def _at(ramps: Array, times: Any) -> Array:
    start, goal, since, until = ramps
    length = until - since
    part = np.minimum(np.maximum((times - since) / np.where(length > 0.0, length, 1.0), 0.0), 1.0)
    return np.where(times >= until, goal, start + part * (goal - start))
