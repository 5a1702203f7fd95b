"""Measures of a walk along a course, target by target: time, path length, and cost of steering."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.record import Array
from chilopod.robot import Robot

_OVER = ("robot", "goal")
_READ = ("position", "leg_yaw", "joint_angle", "stiffness", "command_torque", "seen_joint_angles")


def of_course(record: xr.Dataset, robot: Robot, brief: bool = False) -> xr.Dataset:
    """Record of one robot on a course, completed by :class:`chilopod.steering.CourseReferee`, up to its end, with
    measures of every target; without variables over time and events if ``brief``.

    The measures over (robot, goal) cover the time from the setting of a target to its end:

    ``goal_path``
        Path length of module 1, m, from gait cycle to gait cycle; sway within a cycle is not counted.
    ``goal_effort``
        Integral of the squared yaw of both legs, as commanded, rad^2 s.
    ``goal_spring_work``
        Positive work of actuators on springs, 1/2 theta^2 dk, J; they recover no energy.
    ``goal_drive_work``
        Work of joint torques, joint by joint and command by command, where it is positive, J.
    """
    begin, end = (record[f"goal_{name}"].values[0] for name in ("begin", "end"))
    over = float(np.nanmax(end))
    last = over + 1e-9
    # The time that other robots of its batch walked on does not count.
    data = (record[[name for name in _READ if name in record]] if brief else record).isel(
        time=record.time.values <= last, **({"event": record.event.values < last} if "event" in record.dims else {})
    )
    sums = {
        "path": (_path(data, robot.gait.period), "m"),
        "effort": (_effort(data), "rad^2*s"),
        "spring_work": (_spring_work(data), "J"),
        "drive_work": (_drive_work(data), "J"),
    }
    found = {}
    for name, ((times, so_far), unit) in sums.items():
        between = np.interp(end, times, so_far) - np.interp(begin, times, so_far)
        found[f"goal_{name}"] = (_OVER, between[None], {"units": unit})
    # All variables at once, because adding them one by one takes several times as long.
    kept = record.drop_dims(["time", "event"], errors="ignore") if brief else data
    return kept.assign(found).assign_attrs(duration=over)


def _so_far(times: Array, steps: Array) -> tuple[Array, Array]:
    """Times, and cumulative sums of the increments between them; NaN counts 0."""
    return times, np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])


def _path(data: xr.Dataset, period: float) -> tuple[Array, Array]:
    recorded = data.time.values
    place = data.position.values[:, 0]
    times = np.append(np.arange(recorded[0], recorded[-1], period), recorded[-1])
    known = np.isfinite(place[:, 0])
    at = np.stack([np.interp(times, recorded[known], each) for each in place[known].T], axis=1)
    return _so_far(times, np.linalg.norm(np.diff(at, axis=0), axis=1))


def _effort(data: xr.Dataset) -> tuple[Array, Array]:
    yaw = data.leg_yaw.values[:, 0]
    # Exact where the yaw is straight between samples.
    square = (yaw[1:] ** 2 + yaw[1:] * yaw[:-1] + yaw[:-1] ** 2).sum(axis=1) / 3.0
    return _so_far(data.time.values, square * np.diff(data.time.values))


def _spring_work(data: xr.Dataset) -> tuple[Array, Array]:
    times = data.time.values
    if "time" not in data.stiffness.dims:
        return _so_far(times, np.zeros(len(times) - 1))
    squares = 0.5 * data.joint_angle.values[:, 0] ** 2
    work = 0.5 * (squares[1:] + squares[:-1]) * np.diff(data.stiffness.values[:, 0], axis=0)
    return _so_far(times, np.maximum(work, 0.0).sum(axis=1))


def _drive_work(data: xr.Dataset) -> tuple[Array, Array]:
    if "command_torque" not in data or len(data.event) < 2:
        return _so_far(data.time.values[:1], np.zeros(0))
    # A torque is held from one command to the next, so its work is exact.
    moved = np.diff(data.seen_joint_angles.values[:, 0], axis=0)
    work = data.command_torque.values[:-1, 0] * moved
    return _so_far(data.event.values, np.maximum(work, 0.0).sum(axis=1))
