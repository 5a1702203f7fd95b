"""Whether what an engine gave is what was asked of it: before it is kept, for later nobody looks again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from chilopod.engine import Status, Walk, event_times
from chilopod.errors import AnalysisError, in_words
from chilopod.record import walk_record
from chilopod.steering import Target
from chilopod.trials.disturbance import Drawn
from chilopod.trials.trial import Trial

_MOTION = ("position", "heading", "velocity", "heading_rate", "joint_angle", "joint_rate", "leg_yaw")
_NEAR = 1e-6  # rad, m, s, of stiffness relative
_STEP = 0.01  # s, that an engine with steps of its own may be off


def check_asked(data: Any, walk: Walk, trials: Sequence[Trial], drawn: Sequence[Drawn]) -> xr.Dataset:
    """The record that an engine gave of a batch, if it is that of these trials and of what was drawn for them.

    Raises
    ------
    AnalysisError
        If it is not, naming the engine and what is wrong.
    """
    first, wrong = trials[0], "its record is no xarray.Dataset"
    if isinstance(data, xr.Dataset):
        try:
            wrong = _outline(data, walk, first, len(trials)) or _content(data, walk, trials, drawn)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            wrong = f"its record cannot be understood ({in_words(error)})"
    if wrong:
        raise AnalysisError(f"gave what was not asked for: {wrong}", field=f"engine {first.engine}")
    asked: xr.Dataset = data
    return asked


def check_finite(values: Mapping[str, Any], engine: str) -> None:
    """Make sure that a robot that walks is somewhere, and one that failed or was halted no more from some sample on.

    Parameters
    ----------
    values
        Variables of its record, by name, shape (times, 1, ...).
    engine
        Name of what gave them.

    Raises
    ------
    AnalysisError
        If not.
    """
    label, there = str(values["status"][0]), np.isfinite(values["heading"][:, 0])
    count = len(there) if label == Status.WALKED.label else np.count_nonzero(there)
    for name in _MOTION:
        if count == len(there) and np.isfinite(values[name].sum()):  # as nearly always
            continue
        finite = np.isfinite(values[name][:, 0]).reshape(len(there), -1).all(axis=1)
        if not finite[:count].all() or finite[count:].any():
            problem = f"{name} of a robot that {label} is not finite as long as it walks, or is so afterwards"
            raise AnalysisError(f"gave what was not asked for: {problem}", field=f"engine {engine}")


def _motion(times: Any, robots: int, joints: int) -> xr.Dataset:
    """Like the motion in a record, without its numbers."""
    over = len(times), robots
    one, two, many = (np.broadcast_to(0.0, (*over, *more)) for more in ((), (2,), (joints,)))
    return walk_record(times, two, one, two, one, many, many, two)


def _outline(data: xr.Dataset, walk: Walk, first: Trial, robots: int) -> str:
    """What is wrong with times, variables or shapes."""
    if not (walk.time == first.duration or (first.course and 0.0 <= walk.time < first.duration)):
        return f"it walked {walk.time:g} s instead of {first.duration:g} s"
    times, wanted = data["time"].values, first.recording.samples(walk.time)
    if times.shape != wanted.shape:
        return f"{times.size} samples instead of {wanted.size}"
    if not np.all(np.abs(times - wanted) <= _STEP) or (np.diff(times) <= 0.0).any():
        return f"samples at other times than every {1.0 / first.rate:g} s"
    if data.attrs.get("duration") != walk.time:
        return f"its duration is {data.attrs.get('duration')}, not {walk.time:g} s"
    modules = first.robot.body.modules
    motion = _motion(times, robots, modules - 1)
    if first.forces:
        over = ("time", "robot", "module", "side", "axis")
        motion["foot_force"] = over, np.broadcast_to(0.0, (times.size, robots, modules, 2, 2))
    others = {"status": True, "stiffness": True, "pose": first.poses, "target": isinstance(first.target, Target)}
    for name in (*motion, *(each for each, asked in others.items() if asked)):
        if name not in data:
            return f"{name} is missing"
    for name, each in motion.items():
        found = data[name]
        if (found.dims, found.shape, found.dtype) != (each.dims, each.shape, each.dtype):
            return f"{name} is {found.dtype} over {dict(found.sizes)}, not {each.dtype} over {dict(each.sizes)}"
    return ""


def _content(data: xr.Dataset, walk: Walk, trials: Sequence[Trial], drawn: Sequence[Drawn]) -> str:
    """What is wrong with numbers."""
    first, status = trials[0], data["status"].values.tolist()
    if status != [each.label for each in walk.status]:
        return f"status is {status}, not that of the walk"
    angle, heading, place, yaw = (data[each].values[0] for each in ("joint_angle", "heading", "position", "leg_yaw"))
    places = data["target"].transpose(..., "robot", "axis").values if isinstance(first.target, Target) else None
    springs = data["stiffness"].transpose(..., "robot", "joint").values.reshape(-1, *data["joint_angle"].shape[1:])[0]
    for robot, (trial, told) in enumerate(zip(trials, drawn, strict=True)):
        off = {
            "joint_angle": angle[robot] - told.joint_angles,
            "heading": np.sin(0.5 * (heading[robot] - told.heading)),
            "position": place[robot],
            "leg_yaw": yaw[robot] if trial.controller is None else 0.0,
            "stiffness": springs[robot] / np.array(trial.robot.springs.stiffness) - 1.0,
        }
        if places is not None and isinstance(trial.target, Target):
            off["target"] = places[..., robot, :] - np.array(trial.target.position)
        for name, error in off.items() if np.isfinite(heading[robot]) else ():
            if not np.all(np.abs(error) <= _NEAR):
                return f"{name} of robot {robot} does not start as asked"
    if first.controller is not None and first.course is None:
        asked = np.array([time for time, _ in event_times(first.controller, first.robot.gait, first.duration)])
        found = data["event"].values if "event" in data else np.zeros(0)
        if found.shape != asked.shape or not np.all(np.abs(found - asked) <= _NEAR):
            return f"{found.size} commands instead of {asked.size}, or at other times"
    return ""
