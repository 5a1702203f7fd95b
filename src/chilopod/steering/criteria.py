"""Evaluation of a turn: the paper's three criteria and the outcome."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.steering.target import ARRIVAL_RADIUS

if TYPE_CHECKING:
    import xarray as xr


class Outcome(Labelled):
    """Outcome of a turning task; each member's ``sentence`` describes it in words."""

    ARRIVED = "arrived", f"came within {ARRIVAL_RADIUS:g} m of the target"
    OUTSIDE = "bulged outside", "passed the target on the outside of the turn"
    INSIDE = "turned inside", "passed the target on the inside of the turn"
    FAILED = "failed", "did not walk to the end"


@dataclass(frozen=True, eq=False)
class Criteria(ReadOnlyArrays):
    """Criteria of turning tasks, one entry for each walk.

    Attributes
    ----------
    time
        Time of the first two criteria and end of the integral of the third, s.
    distance, angle, effort
        Distance of the target, m (epsilon 1); its angle to the heading, unsigned, rad (epsilon 2); integral of the
        squared leg yaw of both legs, rad^2 s (epsilon 3).
    arrival, nearest
        Time at which the target was first within the arrival radius, s, NaN if never; smallest distance of the target,
        m.
    outcome
        Outcome of the task.
    """

    time: float
    distance: Array
    angle: Array
    effort: Array
    arrival: Array
    nearest: Array
    outcome: tuple[Outcome, ...]


def earliest_arrival(record: xr.Dataset) -> float:
    """First time at which any walk of a record arrives, s; NaN if none does."""
    times = arrivals(record)
    return float(np.nanmin(times)) if np.isfinite(times).any() else float("nan")


def arrivals(record: xr.Dataset) -> Array:
    """Time at which each walk first comes within the arrival radius, between samples by linear interpolation, s; NaN if
    never. The record has ``distance`` over (time, robot)."""
    distance, time = record.distance.transpose("time", "robot").values, record.time.values
    inside = distance < ARRIVAL_RADIUS
    found = np.where(inside[0], time[0], np.nan)
    later = np.flatnonzero(inside.any(0) & ~inside[0])
    i = inside.argmax(0)[later]
    before, after = distance[i - 1, later], distance[i, later]
    found[later] = time[i - 1] + (before - ARRIVAL_RADIUS) / (before - after) * (time[i] - time[i - 1])
    return found


def evaluate(record: xr.Dataset, time: float) -> Criteria:
    """Criteria of every walk of a record of turning tasks at a time: in the paper the earliest at which any robot
    arrives, 23 s. A model that walks faster has an earlier one. The record has ``distance`` and ``bearing`` over (time,
    robot), ``status`` and, if the legs were steered, ``command`` over (event, robot, side)."""
    distance = record.distance.transpose("time", "robot").values
    bearing = record.bearing.transpose("time", "robot").values
    walked = np.isfinite(distance).all(0)
    arrival = arrivals(record)
    outcomes = []
    for robot in range(distance.shape[1]):
        if np.isfinite(arrival[robot]):
            outcomes.append(Outcome.ARRIVED)
        elif not walked[robot]:
            outcomes.append(Outcome.FAILED)
        else:
            # A robot that still turns towards the target where it is nearest has it inside the path.
            nearest = int(distance[:, robot].argmin())
            same = bearing[nearest, robot] * bearing[0, robot] >= 0.0
            outcomes.append(Outcome.OUTSIDE if same else Outcome.INSIDE)
    # The position of the target relative to the robot is smooth; its bearing jumps from -pi to pi.
    turning = np.abs(np.array([_at(time, record.time.values, np.unwrap(each)) for each in bearing.T]))
    away = np.array([_at(time, record.time.values, each) for each in distance.T])
    angle = np.minimum(turning % (2.0 * np.pi), -turning % (2.0 * np.pi))
    nearest_ever = np.fmin.reduce(distance, axis=0)
    # The last command of a failed robot does not count as effort.
    effort = np.where(np.isfinite(away), efforts(record, time), np.nan)
    return Criteria(time, away, angle, effort, arrival, nearest_ever, tuple(outcomes))


def _at(time: float, times: Array, values: Array) -> float:
    """Sampled quantity by interpolation, NaN outside."""
    return float(np.interp(time, times, values, left=np.nan, right=np.nan))


def efforts(record: xr.Dataset, time: float) -> Array:
    """Integral of the squared commanded leg yaw from 0 to ``time``, exactly: the yaw is piecewise linear, rad^2 s."""
    count = record.sizes["robot"]
    total = np.zeros(count)
    if "command" not in record:
        return total
    commands = record.command.transpose("event", "robot", "side").values
    starts, within = record.event.values, record.within.values
    for side in range(2):
        yaw, since = np.zeros(count), 0.0
        for start, ramp, command in zip(starts, within, commands[:, :, side], strict=True):
            # Events of the other leg are skipped: the commands of a leg change only at its own events.
            if (command == yaw).all() or start >= time:
                continue
            total += yaw**2 * (start - since)
            end = min(start + ramp, time)
            part = (end - start) / ramp if ramp > 0.0 else 1.0
            reached = yaw + part * (command - yaw)
            total += (yaw**2 + yaw * reached + reached**2) / 3.0 * (end - start)
            yaw, since = reached, end
        total += yaw**2 * (time - since)
    return total
