"""Check of an engine's record against its trials, before the record is kept.

The rules are those of :meth:`chilopod.engine.Walk.to_dataset`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from chilopod.engine import Status, Walk, engine_named, event_times
from chilopod.errors import AnalysisError, in_words
from chilopod.record import LARGEST, MOTION, QUANTITIES
from chilopod.steering import Target
from chilopod.trials.description import file_text
from chilopod.trials.trial import Drawn, Trial

_NEAR = 1e-6  # rad, m, of stiffness relative
_SAME_INSTANT = 1e-9  # s
_MAY_LACK = ("foot_load", "command_stiffness", "command_torque", "seen_bearing", "seen_distance")


def check_record(data: Any, walk: Walk, trials: Sequence[Trial], drawn: Sequence[Drawn]) -> xr.Dataset:
    """Return the record that an engine gave of a batch. Raises AnalysisError, which names the engine and the fault, if
    it does not fit these trials and their drawn disturbances."""
    wrong = "its record is no xarray.Dataset"
    if isinstance(data, xr.Dataset):
        try:
            wrong = _outline(data, walk, trials[0], len(trials)) or _content(data, walk, trials, drawn)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            wrong = f"its record cannot be read ({in_words(error)})"
    if wrong:
        problem = f"must return the records of the trials it received: {wrong}"
        raise AnalysisError(problem, field=f"engine {trials[0].engine}")
    return data


def _outline(data: xr.Dataset, walk: Walk, first: Trial, robots: int) -> str:
    """Fault of times, variables or shapes."""
    if not (walk.time == first.duration or (first.course and 0.0 <= walk.time < first.duration)):
        return f"it walked {walk.time:g} s instead of {first.duration:g} s"
    times, wanted, modules = data["time"].values, first.recording.samples(walk.time), first.robot.body.modules
    if times.shape != wanted.shape:
        return f"{times.size} samples instead of {wanted.size}"
    off = 0.5 * first.robot.twin.timestep if first.robot.twin else 0.0
    if not np.all(np.abs(times - wanted) <= off + _SAME_INSTANT):
        return f"samples at other times than every {1.0 / first.rate:g} s"
    # As counted when it walked: three periods of 0.6 s are less than 1.8 s by rounding.
    asked = event_times(first.controller, first.robot.gait, first.duration) if first.controller else ()
    events = np.array([time for time, _ in asked if time < walk.time])
    coords = {"robot": np.arange(robots), "joint": np.arange(1, modules)}
    coords |= {"side": np.array(["left", "right"]), "axis": np.array(["x", "y"])}
    if first.forces:
        coords["module"] = np.arange(1, modules + 1)
    for name, values in coords.items():
        if not np.array_equal(data[name].values, values):
            return f"{name} is {data[name].values}"
    found = data["event"].values if "event" in data else np.zeros(0)
    if found.shape != events.shape or not np.all(np.abs(found - events) <= _NEAR):
        return f"{found.size} commands instead of {events.size}, or at other times"
    sizes = {name: len(values) for name, values in coords.items()} | {"time": times.size, "event": events.size}
    engine = engine_named(first.engine).traits.name
    attributes = {"engine": engine, "robot": file_text(first.robot), "duration": walk.time}
    for name, value in attributes.items():
        if data.attrs.get(name) != value:
            return f"its attribute {name} is {str(data.attrs.get(name))[:40]!r}, not {str(value)[:40]!r}"
    return _quantities(data, first, sizes)


def _quantities(data: xr.Dataset, first: Trial, sizes: Mapping[str, int]) -> str:
    """Fault of variables, in a record of these sizes."""
    aimed, commands = first.target is not None, sizes["event"] > 0
    asked = {"": True, "target": aimed, "forces": first.forces, "poses": first.poses, "commands": commands}
    # A course without a target in reach has none.
    may_lack = {*_MAY_LACK, *(("target", "distance", "bearing") if first.course else ())}
    for name, (_, _, why) in QUANTITIES.items():
        if asked[why] and name not in may_lack and name not in data:
            return f"{name} is missing"
    for name in map(str, data.variables):
        over, unit, why = QUANTITIES.get(name, ((), "", "coordinate"))
        if not asked.get(why, name in sizes):
            return f"{name} is no part of it"
        if why == "coordinate":
            continue
        found = data[name]
        dims = tuple(each for each in over if each in found.dims or name not in ("stiffness", "target"))
        shape = tuple(sizes.get(each, found.sizes.get(each)) for each in dims)
        units = found.attrs.get("units", "")
        kind, unit = found.dtype if name == "status" else np.dtype(np.float64), units if name == "pose" else unit
        if (found.dims, found.shape, found.dtype, units) != (dims, shape, kind, unit):
            actual = f"{found.dtype} over {dict(found.sizes)} in {units!r}"
            return f"{name} is {actual}, not {kind} over {dict(zip(dims, shape, strict=True))} in {unit!r}"
    return ""


def _content(data: xr.Dataset, walk: Walk, trials: Sequence[Trial], drawn: Sequence[Drawn]) -> str:
    """Fault of numbers."""
    first, status = trials[0], data["status"].values.tolist()
    if status != [each.label for each in walk.status]:
        return f"status is {status}, which differs from that of the walk"
    for name, each in data.data_vars.items():
        ends = (choose.reduce(each.values, axis=None, initial=0.0) for choose in (np.fmin, np.fmax))
        if name != "status" and max(map(abs, ends)) > LARGEST:
            return f"{name} has numbers beyond {LARGEST:g}"
    there = np.isfinite(data["heading"].values)
    counts = np.where(np.array(status) == Status.WALKED.label, len(there), there.sum(axis=0))
    walks = np.arange(len(there))[:, None] < counts
    for name in MOTION:
        fits = np.isfinite(data[name].values) == walks.reshape(*walks.shape, *[1] * (data[name].ndim - 2))
        if not fits.all():
            label = status[int(np.argwhere(~fits)[0, 1])]
            return f"{name} of a robot with status {label} must be finite while it walks and NaN afterwards"
    angle, heading, position, yaw = (data[name].values[0] for name in ("joint_angle", "heading", "position", "leg_yaw"))
    places = data["target"].transpose(..., "robot", "axis").values if isinstance(first.target, Target) else None
    springs = data["stiffness"].transpose(..., "robot", "joint").values.reshape(-1, *data["joint_angle"].shape[1:])[0]
    for robot, (trial, draw) in enumerate(zip(trials, drawn, strict=True)):
        off = {
            "position": position[robot],
            "leg_yaw": yaw[robot],
            "joint_angle": angle[robot] - draw.joint_angles,
            "heading": np.sin(0.5 * (heading[robot] - draw.heading)),
            "stiffness": springs[robot] / np.array(trial.robot.springs.stiffness) - 1.0,
        }
        if places is not None and isinstance(trial.target, Target):
            off["target"] = places[..., robot, :] - np.array(trial.target.position)
        for name, error in off.items() if np.isfinite(heading[robot]) else ():
            if not np.all(np.abs(error) <= _NEAR):
                return f"{name} of robot {robot} does not start at the given values"
    return ""
