"""What every engine writes down of a walk, under the same names and in the same units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.engine import Event, Status, bearing_and_distance

Array = NDArray[np.float64]

RATE = 100.0
"""Default sampling rate of records, Hz."""

LONGEST = 1e5
"""s, more than a day: anything longer is a slip of the pen."""

MOST_NUMBERS = 5e8
"""Of a record (4 GB)."""


def walk_record(
    time: Array,
    position: Array,
    heading: Array,
    velocity: Array,
    heading_rate: Array,
    joint_angle: Array,
    joint_rate: Array,
    leg_yaw: Array,
) -> xr.Dataset:
    """Motion over time as named quantities on the floor.

    Parameters
    ----------
    time
        s, shape (T,).
    position, velocity
        Of the centre of module 1, m and m/s, shape (T, robots, 2).
    heading, heading_rate
        Of module 1, rad and rad/s, shape (T, robots).
    joint_angle, joint_rate
        Of the yaw joints, rad and rad/s, shape (T, robots, N-1).
    leg_yaw
        Of the legs of module 1, rad, shape (T, robots, 2).
    """
    over = ("time", "robot")
    return xr.Dataset(
        {
            "position": ((*over, "axis"), position, {"units": "m"}),
            "heading": (over, heading, {"units": "rad"}),
            "velocity": ((*over, "axis"), velocity, {"units": "m/s"}),
            "heading_rate": (over, heading_rate, {"units": "rad/s"}),
            "joint_angle": ((*over, "joint"), joint_angle, {"units": "rad"}),
            "joint_rate": ((*over, "joint"), joint_rate, {"units": "rad/s"}),
            "leg_yaw": ((*over, "side"), leg_yaw, {"units": "rad"}),
        },
        coords={
            "time": ("time", time, {"units": "s"}),
            "robot": np.arange(heading.shape[1]),
            "joint": np.arange(1, joint_angle.shape[2] + 1),
            "side": ["left", "right"],
            "axis": ["x", "y"],
        },
    )


def add_outcome(
    data: xr.Dataset,
    statuses: Sequence[Status],
    target: Array | None,
    asked: Sequence[tuple[float, Event]] | None,
    commands: Array,
    within: Array,
) -> None:
    """Add to a record how the walks ended, where the target was, and what a controller said.

    Parameters
    ----------
    data
        From :func:`walk_record`; changed in place.
    statuses
        One a robot.
    target
        m, shape (robots, 2), or None.
    asked
        Instants at which the controller was asked; None if there was none.
    commands, within
        Its answers: leg yaw, rad, shape (events, robots, 2), and the time they were to be reached in, s, (events,).
    """
    data["status"] = ("robot", np.array([status.label for status in statuses], dtype=object))
    if target is not None:
        data["target"] = (("robot", "axis"), target, {"units": "m"})
        angle, away = bearing_and_distance(data.position.values, data.heading.values, target)
        data["distance"] = (("time", "robot"), away, {"units": "m"})
        data["bearing"] = (("time", "robot"), angle, {"units": "rad"})
    if asked is not None:
        data.coords["event"] = ("event", np.array([t for t, _ in asked]), {"units": "s"})
        data["command"] = (("event", "robot", "side"), commands, {"units": "rad"})
        data["within"] = ("event", within, {"units": "s"})


def leg_yaw_at(
    samples: Array, asked: Sequence[tuple[float, Event]], commands: Array, within: Array, count: int
) -> Array:
    """Leg yaw at the samples, shape (samples, robots, 2): ramps from command to command."""
    yaw = np.zeros((len(samples), count, 2))
    previous = np.zeros((count, 2))
    for (t, _), command, duration in zip(asked, commands, within, strict=True):
        part = np.clip((samples - t) / duration if duration > 0.0 else samples >= t, 0.0, 1.0)
        yaw += part[:, None, None] * (command - previous)
        previous = command
    return yaw
