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
    last = np.nanmax(data.goal_end.values, axis=1)
    commands = data.event.values if "event" in data.dims else _NONE
    # A look that ends a course precedes an event at its instant, which belongs to those who walk on.
    samples = np.searchsorted(data.time.values, last + _SAME_INSTANT, "right")
    return {"time": samples, "event": np.searchsorted(commands, last)}


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
        Net work of joint torques from one command to the next, joint by joint, where it is positive, J.
    """
    place, yaw, angles = (data[name].values for name in ("position", "leg_yaw", "joint_angle"))
    torques, seen, commands = angles[:0], angles[:0], np.zeros(1)
    if "command_torque" in data:
        torques, seen, commands = (data[name].values for name in ("command_torque", "seen_joint_angles", "event"))
    samples, counts = data.time.values, lengths(data)
    efforts, springs = _effort(samples, yaw), _spring_work(angles, np.broadcast_to(data.stiffness.values, angles.shape))
    drives = _drive_work(seen, torques)
    found = np.empty((len(_UNITS), *data.goal_end.shape))
    for robot, ends in enumerate(np.stack([data.goal_end.values, data.goal_begin.values], axis=1)):
        # The time that other robots of its batch walked on does not count.
        times, told = samples[: counts["time"][robot]], commands[: max(counts["event"][robot], 1)]
        moving = slice(len(times)), robot
        moved = _path(times, place[moving], period), (times, efforts[moving]), (times, springs[moving])
        sums = *moved, (told, drives[: len(told), robot])
        found[:, robot] = [np.subtract(*np.interp(ends, *so_far)) for so_far in sums]
    units = zip(_UNITS.items(), found, strict=True)
    data.update({f"goal_{name}": (("robot", "goal"), values, {"units": unit}) for (name, unit), values in units})


def _so_far(steps: Array) -> Array:
    """Cumulative sums of increments over time, the first axis, from 0; NaN counts 0."""
    return np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(np.nan_to_num(steps), axis=0)])


def _path(recorded: Array, place: Array, period: float) -> tuple[Array, Array]:
    times = np.append(np.arange(recorded[0], recorded[-1], period), recorded[-1])
    known = np.isfinite(place[:, 0])
    at = np.stack([np.interp(times, recorded[known], each) for each in place[known].T], axis=1)
    return times, _so_far(np.linalg.norm(np.diff(at, axis=0), axis=1))


def _effort(times: Array, yaw: Array) -> Array:
    # Exact where the yaw is straight between samples.
    square = (yaw[1:] ** 2 + yaw[1:] * yaw[:-1] + yaw[:-1] ** 2).sum(axis=2) / 3.0
    return _so_far(square * np.diff(times)[:, None])


def _spring_work(angles: Array, springs: Array) -> Array:
    changed = (np.fmax.reduce(springs) > np.fmin.reduce(springs)).any(axis=0)  # other springs take no work
    squares, springs = 0.5 * angles[..., changed] ** 2, springs[..., changed]
    work = 0.5 * (squares[1:] + squares[:-1]) * np.diff(springs, axis=0)
    return _so_far(np.maximum(work, 0.0).sum(axis=2))


def _drive_work(seen: Array, torques: Array) -> Array:
    # A torque is held from one command to the next, so its work is exact.
    return _so_far(np.maximum(torques[:-1] * np.diff(seen, axis=0), 0.0).sum(axis=2))
