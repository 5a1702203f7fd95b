"""Positions of the targets of a batch of robots over time; one object serves one walk of any engine."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.engine.arguments import as_array, require
from chilopod.frozen import Array
from chilopod.record import LARGEST


class Targets:
    """Targets on the floor, one for each of a number of robots, that may be moved while the robots walk.

    They are at ``start`` first, m, shape (robots, 2), or nowhere if None; with ``keep`` their positions are logged, for
    :meth:`recorded`. ``present`` are the positions now, m, shape (robots, 2), NaN for a robot without a target; it is
    never written into, only replaced.
    """

    def __init__(self, robots: int, start: Array | None = None, keep: bool = True) -> None:
        self.present: Array = np.full((robots, 2), np.nan) if start is None else start
        self._given, self._moved = start is not None, False
        self._log: list[tuple[float, Array]] | None = [(0.0, self.present)] if keep else None

    @property
    def there(self) -> NDArray[np.bool_]:
        """Mask of the robots that have a target now, shape (robots,)."""
        return np.asarray(np.isfinite(self.present[:, 0]))

    def move(self, time: float, target: ArrayLike) -> None:
        """Move the targets from a time on, s, not before the last move, to positions, m, shape (robots, 2) or (2,); a
        row of NaN is no target. A move at time 0 changes the start."""
        given, shape = as_array("target", target), self.present.shape
        fits = given.shape in (shape, (2,))
        require(fits, f"has the wrong shape {given.shape}", "target", allowed=f"(2,) or {shape}")
        none = np.isnan(given)
        fits = not (np.abs(given) > LARGEST).any() and (none[..., 0] == none[..., 1]).all()
        allowed = f"x and y in m, up to {LARGEST:g}, or NaN for both without a target"
        require(fits, "must be a finite position", "target", allowed=allowed)
        if ((given == self.present) | (none & np.isnan(self.present))).all():
            return
        places = np.empty(shape)
        places[:] = given
        self.present, self._given, self._moved = places, True, time > 0.0
        if self._log is not None:
            if not self._moved:
                self._log.clear()
            self._log.append((time, places))

    def over(self, times: Array) -> Array:
        """Positions at any rising times of the walk, m, shape (times, robots, 2); at a move, the positions before
        it."""
        log = self._log or [(0.0, self.present)]
        moves = np.array([when for when, _ in log[1:]])
        return np.array([places for _, places in log])[np.searchsorted(moves, times, side="left")]

    def recorded(self, times: Array) -> Array | None:
        """Positions for :func:`chilopod.record.add_outcome`: as of :meth:`over`, without times if no target moved, None
        if there never was one."""
        if not self._given:
            return None
        return self.over(times) if self._moved else self.present

    def state(self) -> dict[str, Array]:
        """Complete state, for :meth:`restore`."""
        state: dict[str, Array] = {"present": self.present, "known": np.array([self._given, self._moved])}
        if self._log is not None:
            state["times"] = np.array([when for when, _ in self._log])
            state["places"] = np.array([places for _, places in self._log])
        return state

    def restore(self, state: dict[str, Any]) -> None:
        """Take over the state of targets of as many robots."""
        self.present = as_array("target", state["present"])
        self._given, self._moved = (bool(each) for each in state["known"])
        if self._log is not None:
            self._log = list(zip(state["times"].tolist(), state["places"], strict=True))
