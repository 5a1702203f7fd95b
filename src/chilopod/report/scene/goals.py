"""Where the targets of a recorded walk were, one after another, and when each was reached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.steering import arrivals

Stage = Literal["ahead", "present", "reached", "behind", "missed"]

_SAME_INSTANT = 1e-9  # s


@dataclass(frozen=True)
class Goal:
    """A robot's target for as long as it stays in its place.

    Attributes
    ----------
    place
        On the floor, m.
    since, until
        From when and up to when it is there, s; until is infinite for a target that stays.
    arrival
        When the robot is first within the arrival radius meanwhile, s; NaN if never.
    """

    place: tuple[float, float]
    since: float
    until: float
    arrival: float

    def stage(self, now: float) -> Stage:
        """What it is at a time, s: to come, the target, the target and reached, a former one: reached, or missed."""
        now += _SAME_INSTANT
        if now < self.since:
            return "ahead"
        if now >= self.until:
            return "missed" if np.isnan(self.arrival) else "behind"
        return "reached" if now >= self.arrival else "present"


def goals(record: xr.Dataset) -> tuple[tuple[Goal, ...], ...]:
    """The targets of every robot of a record, in the order of time; none where there is no ``target``."""
    if "target" not in record:
        return ((),) * record.sizes["robot"]
    time, target = record["time"].values, record["target"]
    if "time" not in target.dims:
        target = target.expand_dims(time=record["time"][:1])
    places = target.transpose("robot", "time", "axis").values.astype(np.float64)
    return tuple(_of_robot(record.isel(robot=[robot]), time, each) for robot, each in enumerate(places))


def places_of(sought: Sequence[Sequence[Goal]]) -> NDArray[np.float64]:
    """Of all targets of all robots, m, (P, 2)."""
    return np.array([goal.place for each in sought for goal in each], dtype=np.float64).reshape(-1, 2)


def _of_robot(record: xr.Dataset, time: NDArray[np.float64], places: NDArray[np.float64]) -> tuple[Goal, ...]:
    """Of one robot, from its places (T, 2), or (1, 2) of a target that never moved."""
    moved = (np.diff(places, axis=0) != 0.0).any(axis=-1) & np.isfinite(places[1:]).all(axis=-1)
    moved |= np.diff(np.isfinite(places).all(axis=-1).astype(int)) != 0
    edges = [0, *(np.flatnonzero(moved) + 1).tolist(), len(time)]
    found = []
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        x, y = places[first].tolist()
        if np.isfinite(x) and np.isfinite(y):
            # A robot that has stopped has no target in the record; it stands before its last one.
            stays = last == len(time) or not np.isfinite(record["heading"].values[last]).all()
            (arrival,) = arrivals(record.isel(time=slice(first, last)))
            until = np.inf if stays else float(time[last])
            found.append(Goal((x, y), float(time[first]), until, float(arrival)))
    return tuple(found)
