"""Whether what an engine gave is what was asked of it: before it is kept, for later nobody looks again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from chilopod.engine import Status, Walk, event_times
from chilopod.errors import AnalysisError
from chilopod.steering import Target
from chilopod.trials.disturbance import Drawn
from chilopod.trials.trial import Trial

_MOTION = {
    "position": ("axis", 2),
    "velocity": ("axis", 2),
    "heading": None,
    "heading_rate": None,
    "joint_angle": ("joint", -1),
    "joint_rate": ("joint", -1),
    "leg_yaw": ("side", 2),
}
_NEAR = 1e-6  # rad, N*m/rad relative, m, s
_STEP = 0.01  # s, that an engine with steps of its own may be off


def check_asked(data: object, walk: Walk, trials: Sequence[Trial], drawn: Sequence[Drawn]) -> xr.Dataset:
    """The record of a batch, if it is that of these trials.

    Parameters
    ----------
    data
        Record that the engine gave, over all robots.
    walk
        Walk that it is of.
    trials, drawn
        What was asked for.

    Raises
    ------
    AnalysisError
        If it is not, naming the engine and what is wrong.
    """
    first = trials[0]
    wrong = "its record is no xarray.Dataset" if not isinstance(data, xr.Dataset) else None
    if isinstance(data, xr.Dataset):
        try:
            wrong = _outline(data, walk, first, len(trials)) or _content(data, walk, trials, drawn)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            wrong = f"its record cannot be understood ({type(error).__name__}: {error})"
    if wrong or not isinstance(data, xr.Dataset):
        raise AnalysisError(f"gave what was not asked for: {wrong}", field=f"engine {first.engine}")
    return data


def _outline(data: xr.Dataset, walk: Walk, first: Trial, robots: int) -> str | None:
    """What is wrong with times, variables or shapes."""
    if not (walk.time == first.duration or (first.course and 0.0 <= walk.time < first.duration)):
        return f"it walked {walk.time:g} s instead of {first.duration:g} s"
    times, wanted = data["time"].values, first.recording.samples(walk.time)
    if times.ndim != 1 or abs(times.size - wanted.size) > 1:  # by rounding one more or less
        return f"{times.size} samples instead of {wanted.size}"
    if not np.all(np.abs(times - np.arange(times.size) / first.rate) <= max(_STEP, 0.5 / first.rate)):
        return f"samples at other times than every {1.0 / first.rate:g} s"
    joints = first.robot.body.modules - 1
    shapes: dict[str, Any] = {
        name: (("time", "robot"), (len(times), robots))
        if more is None
        else (("time", "robot", more[0]), (len(times), robots, joints if more[1] < 0 else more[1]))
        for name, more in _MOTION.items()
    }
    shapes["status"] = ("robot",), (robots,)
    if first.forces:
        shapes["foot_force"] = ("time", "robot", "module", "side", "axis"), (len(times), robots, joints + 1, 2, 2)
    for name, (dims, shape) in shapes.items():
        if name not in data:
            return f"{name} is missing"
        if data[name].dims != dims or data[name].shape != shape:
            return f"{name} is over {data[name].dims} of {data[name].shape}, not {dims} of {shape}"
        if name != "status" and data[name].dtype != np.float64:
            return f"{name} is of type {data[name].dtype}, not float64"
    for name, asked in (("stiffness", True), ("pose", first.poses), ("target", isinstance(first.target, Target))):
        if asked and name not in data:
            return f"{name} is missing"
    return None


def _content(data: xr.Dataset, walk: Walk, trials: Sequence[Trial], drawn: Sequence[Drawn]) -> str | None:
    """What is wrong with numbers."""
    first, status = trials[0], data["status"].values.tolist()
    if status != [each.label for each in walk.status]:
        return f"status is {status}, not that of the walk"
    there = np.isfinite(data["heading"].values)
    for name in _MOTION:
        values = data[name].values
        finite = np.isfinite(values).all(axis=tuple(range(2, values.ndim)))
        for robot, label in enumerate(status):
            # Who failed or was halted is there up to a sample, and then no more.
            count = np.count_nonzero(there[:, robot])
            if label == Status.WALKED.label and not finite[:, robot].all():
                return f"{name} has NaN or infinite values though robot {robot} {label}"
            if not finite[:count, robot].all() or finite[count:, robot].any():
                return f"{name} of robot {robot} has NaN or infinite values before it was {label}, or values afterwards"
    springs = data["stiffness"].transpose(..., "robot", "joint").values.reshape(-1, *data["joint_angle"].shape[1:])[0]
    for robot, (trial, told) in enumerate(zip(trials, drawn, strict=True)):
        off = [
            ("joint_angle", data["joint_angle"].values[0, robot] - told.joint_angles),
            ("heading", np.sin(0.5 * (data["heading"].values[0, robot] - told.heading))),
            ("stiffness", springs[robot] / np.array(trial.robot.springs.stiffness) - 1.0),
        ]
        if isinstance(trial.target, Target):
            place = data["target"].transpose(..., "robot", "axis").values[..., robot, :]
            off.append(("target", place - np.array(trial.target.position)))
        for name, error in off if there[0, robot] else ():
            if not np.all(np.abs(error) <= _NEAR):
                return f"{name} of robot {robot} does not start as asked"
    if first.controller is not None and first.course is None:
        asked = np.array([time for time, _ in event_times(first.controller, first.robot.gait, first.duration)])
        found = data["event"].values if "event" in data else np.zeros(0)
        if found.shape != asked.shape or not np.all(np.abs(found - asked) <= _NEAR):
            return f"{found.size} commands instead of {asked.size}, or at other times"
    return None
