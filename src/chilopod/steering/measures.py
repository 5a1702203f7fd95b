"""Measures of a walk along a course, target by target: time, path length, and cost of steering."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import Array

if TYPE_CHECKING:
    import xarray as xr

_SAME_INSTANT = 1e-9  # s
_NONE = np.zeros(0)
_UNITS = {"path": "m", "effort": "rad^2*s", "spring_work": "J", "drive_work": "J"}


def lengths(data: xr.Dataset) -> dict[str, NDArray[np.intp]]:
    """Numbers of samples, ``time``, and commands, ``event``, to the end of each robot's course, shape (robots,)."""
    last = np.nanmax(data.goal_end.values, axis=1) + _SAME_INSTANT
    commands = data.event.values if "event" in data.dims else _NONE
    return {"time": np.searchsorted(data.time.values, last, "right"), "event": np.searchsorted(commands, last)}


def add_measures(data: xr.Dataset, period: float) -> None:
    """Add measures of every target to the record of robots on courses, in place.

    :class:`chilopod.steering.CourseReferee` has completed the record; ``period`` is that of the gait, s. The measures
    over (robot, goal) cover the time from the setting of a target to its end:

    ``goal_path``
        Path length of module 1, m, from gait cycle to gait cycle; sway within a cycle is not counted.
    ``goal_effort``
        Integral of the squared yaw of both legs, as commanded, rad^2 s.
    ``goal_spring_work``
        Positive work of actuators on springs, 1/2 theta^2 dk, J; they recover no energy.
    ``goal_drive_work``
        Work of joint torques, joint by joint and command by command, where it is positive, J.
    """
    place, yaw, angles = (data[name].values for name in ("position", "leg_yaw", "joint_angle"))
    springs, torques, seen, commands = (
        np.broadcast_to(data.stiffness.values, angles.shape),
        angles[:0],
        angles[:0],
        _NONE,
    )
    if "command_torque" in data:
        torques, seen, commands = (data[name].values for name in ("command_torque", "seen_joint_angles", "event"))
    samples, counts = data.time.values, lengths(data)
    found = np.empty((len(_UNITS), *data.goal_end.shape))
    for robot, (begin, end) in enumerate(zip(data.goal_begin.values, data.goal_end.values, strict=True)):
        # The time that other robots of its batch walked on does not count.
        moving, commanded = ((slice(counts[name][robot]), robot) for name in ("time", "event"))
        times = samples[moving[0]]
        sums = (
            _path(times, place[moving], period),
            _effort(times, yaw[moving]),
            _spring_work(times, angles[moving], springs[moving]),
            _drive_work(commands[commanded[0]], seen[commanded], torques[commanded]),
        )
        found[:, robot] = [np.interp(end, *so_far) - np.interp(begin, *so_far) for so_far in sums]
    units = zip(_UNITS.items(), found, strict=True)
    data.update({f"goal_{name}": (("robot", "goal"), values, {"units": unit}) for (name, unit), values in units})


def _so_far(times: Array, steps: Array) -> tuple[Array, Array]:
    """Times, and cumulative sums of the increments between them; NaN counts 0."""
    return times, np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])


def _path(recorded: Array, place: Array, period: float) -> tuple[Array, Array]:
    times = np.append(np.arange(recorded[0], recorded[-1], period), recorded[-1])
    known = np.isfinite(place[:, 0])
    at = np.stack([np.interp(times, recorded[known], each) for each in place[known].T], axis=1)
    return _so_far(times, np.linalg.norm(np.diff(at, axis=0), axis=1))


def _effort(times: Array, yaw: Array) -> tuple[Array, Array]:
    # Exact where the yaw is straight between samples.
    square = (yaw[1:] ** 2 + yaw[1:] * yaw[:-1] + yaw[:-1] ** 2).sum(axis=1) / 3.0
    return _so_far(times, square * np.diff(times))


def _spring_work(times: Array, angles: Array, springs: Array) -> tuple[Array, Array]:
    squares = 0.5 * angles**2
    work = 0.5 * (squares[1:] + squares[:-1]) * np.diff(springs, axis=0)
    return _so_far(times, np.maximum(work, 0.0).sum(axis=1))


def _drive_work(events: Array, seen: Array, torques: Array) -> tuple[Array, Array]:
    if len(events) < 2:
        return np.zeros(1), np.zeros(1)
    # A torque is held from one command to the next, so its work is exact.
    work = torques[:-1] * np.diff(seen, axis=0)
    return _so_far(events, np.maximum(work, 0.0).sum(axis=1))
