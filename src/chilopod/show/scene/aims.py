"""Times and targets of a robot of a record."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.steering import Verdict, arrivals


@dataclass(frozen=True)
class Aim:
    """A target: place (m), time from which on it is one, and time at which it was reached, None if never (s)."""

    place: tuple[float, float]
    since: float
    reached: float | None

    def is_reached(self, now: float) -> bool:
        """True if it has been, at a time (s)."""
        return self.reached is not None and now >= self.reached - 1e-9


def aims_of(record: xr.Dataset) -> tuple[tuple[Aim, ...], ...]:
    """Targets of every robot of a record in the order of their turns."""
    if "goal_place" in record:
        goals = record[["goal_place", "goal_begin", "goal_end", "goal_verdict"]]
        return tuple(_course(goals.isel(robot=robot)) for robot in range(record.sizes["robot"]))
    if "target" not in record:
        return ((),) * record.sizes["robot"]
    return tuple(_targets(record.isel(robot=[robot])) for robot in range(record.sizes["robot"]))


def places_of(aims: Iterable[Iterable[Aim]]) -> NDArray[np.float64]:
    """Places of all targets of all robots, m, shape (P, 2)."""
    return np.array([aim.place for each in aims for aim in each]).reshape(-1, 2)


def _targets(record: xr.Dataset) -> tuple[Aim, ...]:
    """Aims of one robot, whose target may be over time."""
    target, time = record["target"].isel(robot=0).broadcast_like(record["time"]), record["time"].values
    places = target.transpose("time", "axis").values.astype(np.float64)
    edges = [0, *(np.flatnonzero((np.diff(places, axis=0) != 0.0).any(axis=1)) + 1).tolist(), len(time)]
    aims = []
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        x, y = places[first].tolist()
        if np.isfinite([x, y]).all():
            (reached,) = arrivals(record.isel(time=slice(first, last)))
            aims.append(Aim((x, y), float(time[first]), float(reached) if np.isfinite(reached) else None))
    return tuple(aims)


def _course(goals: xr.Dataset) -> tuple[Aim, ...]:
    aims = []
    for goal in range(goals.sizes["goal"]):
        one = goals.isel(goal=goal)
        x, y = (float(each) for each in one["goal_place"].values)
        begin, end = float(one["goal_begin"]), float(one["goal_end"])
        # What had no turn is nowhere yet.
        if np.isfinite([x, y, begin]).all():
            aims.append(Aim((x, y), begin, end if str(one["goal_verdict"].values) == Verdict.ARRIVED.label else None))
    return tuple(aims)
