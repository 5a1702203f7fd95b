"""Record of a walk, with the same names and units for every engine; errors are ParameterErrors."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod import memory
from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.units.quantity import as_number

if TYPE_CHECKING:
    import xarray as xr


RATE = 100.0
"""Default sampling rate of records, Hz."""

LONGEST = 1e5
"""Largest duration, s, more than a day: longer ones are typing errors."""

MOST_NUMBERS = 5e8
"""Largest number of values of a record (4 GB)."""

LARGEST = 1e100
"""Largest number in a record, in its unit: sums of squares stay finite."""

_MOVING, _TOLD = ("time", "robot"), ("event", "robot")
MOTION = {
    "position": ((*_MOVING, "axis"), "m", ""),
    "heading": (_MOVING, "rad", ""),
    "velocity": ((*_MOVING, "axis"), "m/s", ""),
    "heading_rate": (_MOVING, "rad/s", ""),
    "joint_angle": ((*_MOVING, "joint"), "rad", ""),
    "joint_rate": ((*_MOVING, "joint"), "rad/s", ""),
    "leg_yaw": ((*_MOVING, "side"), "rad", ""),
}
"""Quantities of :func:`walk_record`, as in :data:`QUANTITIES`."""

QUANTITIES = MOTION | {
    "time": (("time",), "s", ""),
    "status": (("robot",), "", ""),
    "stiffness": ((*_MOVING, "joint"), "N*m/rad", ""),
    "target": ((*_MOVING, "axis"), "m", "target"),
    "distance": (_MOVING, "m", "target"),
    "bearing": (_MOVING, "rad", "target"),
    "foot_force": ((*_MOVING, "module", "side", "axis"), "N", "forces"),
    "foot_load": ((*_MOVING, "module", "side"), "N", "forces"),
    "pose": ((*_MOVING, "coordinate"), "m, 1, rad: MuJoCo's qpos", "poses"),
    "event": (("event",), "s", "commands"),
    "within": (("event",), "s", "commands"),
    "command": ((*_TOLD, "side"), "rad", "commands"),
    "command_stiffness": ((*_TOLD, "joint"), "N*m/rad", "commands"),
    "command_torque": ((*_TOLD, "joint"), "N*m", "commands"),
    "seen_bearing": (_TOLD, "rad", "commands"),
    "seen_distance": (_TOLD, "m", "commands"),
}
"""All quantities that an engine can record: dimensions, unit, and the condition of optional ones. Springs that are not
adjustable, and fixed targets, have no dimension of time."""


@dataclass(frozen=True)
class Recording:
    """Contents of a record.

    Attributes
    ----------
    rate
        Samples per second.
    forces
        True to add the force on every foot.
    poses
        True to add the positions of all joints, from which the robot can be drawn, where an engine has them.
    """

    rate: float = RATE
    forces: bool = False
    poses: bool = False

    def __post_init__(self) -> None:
        rate = in_range("rate", self.rate, 1e6, "Hz")
        if not isinstance(self.rate, int | float):
            object.__setattr__(self, "rate", rate)
        for name in ("forces", "poses"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise ParameterError("must be True or False", field=name, value=getattr(self, name))
            object.__setattr__(self, name, bool(getattr(self, name)))

    def samples(self, until: float) -> Array:
        """Times of all samples up to a time, s."""
        return np.arange(int(np.floor(until * self.rate * (1.0 + 1e-12))) + 1) / self.rate

    def least_bytes(self, modules: int, until: float) -> float:
        """Least memory of a robot's record up to a time, s, in every engine."""
        # Place, heading and their rates; joints and theirs; leg yaw; forces along the floor.
        numbers = 6 + 2 * (modules - 1) + 2 + (4 * modules if self.forces else 0)
        return 8.0 * numbers * (until * self.rate + 1.0)


def in_range(name: str, value: object, most: float, unit: str = "") -> float:
    """A plain number that is positive and at most ``high``, both in this unit."""
    value = as_number(name, value)
    if not 0.0 < value <= most:
        allowed = f"more than 0, at most {most:g} {unit}".strip()
        raise ParameterError(
            "is out of range", field=name, value=f"{value:g} {unit}" if unit else value, allowed=allowed
        )
    return value


def check_size(record: Recording | None, until: float, numbers: int) -> None:
    """Refuse a duration that is not a time, and a record of ``numbers`` at every sample that is too large."""
    if not (isinstance(until, Real) and until >= 0.0):
        raise ParameterError("must be a duration in s", field="expected", value=until, allowed="0 s or more")
    if record is not None and (until * record.rate + 1.0) * numbers > MOST_NUMBERS:
        problem, allowed = "must be lower: the record would be too large", "fewer robots, samples or seconds"
        raise ParameterError(problem, field="rate", value=record.rate, allowed=allowed)


def check_memory(needed: float) -> None:
    """Refuse records that need more bytes than the memory has."""
    if needed > memory.available():
        problem = f"would take {memory.in_words(needed)} of memory, and {memory.in_words(memory.available())} are free"
        raise ParameterError(problem, field="record", allowed="fewer walks, samples or seconds")


class Samples:
    """Array of rows that grows with a walk.

    Parameters
    ----------
    shape
        Shape of a row.
    expected
        Expected number of rows; more may come.
    """

    def __init__(self, shape: tuple[int, ...], expected: int = 0) -> None:
        self.count = 0
        self._rows = np.full((max(expected, 16), *shape), np.nan)

    @property
    def rows(self) -> Array:
        """Rows so far, shape (count, ...), as a read-only view."""
        rows = self._rows[: self.count]
        rows.flags.writeable = False
        return rows

    def cut(self, count: int) -> None:
        """Drop the rows from a number on."""
        self._rows[count : self.count] = np.nan
        self.count = min(self.count, count)

    def grown(self, count: int) -> Array:
        """Writable view of at least ``count`` rows, new ones NaN, valid until the next call."""
        if count > len(self._rows):
            longer = np.full((max(count, 2 * len(self._rows)), *self._rows.shape[1:]), np.nan)
            longer[: self.count] = self._rows[: self.count]
            self._rows = longer
        self.count = max(self.count, count)
        return self._rows[: self.count]


def bearing_and_distance(position: Array, heading: Array, target: Array) -> tuple[Array, Array]:
    """Bearing and distance of a target, seen from module 1.

    Parameters
    ----------
    position, target
        On the floor, m, shape (..., 2).
    heading
        rad, shape (...).

    Returns
    -------
    Direction relative to the heading, rad in [-pi, pi), and distance, m.
    """
    away = target - position
    angle = np.arctan2(away[..., 1], away[..., 0]) - heading
    return (angle + np.pi) % (2.0 * np.pi) - np.pi, np.hypot(away[..., 0], away[..., 1])


def load_xarray() -> None:
    """Load xarray and, where it is installed, dask, a part of which xarray loads at its first dataset.

    Two threads cannot make their first dataset at once, as modules of dask import each other in a circle.
    """
    import_module("xarray")  # takes a third of a second, and only writers of records need it
    with suppress(ImportError):
        import_module("dask.array")


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
        Times of the samples, s, shape (T,).
    position, velocity
        Position and velocity of the centre of module 1, m and m/s, shape (T, robots, 2).
    heading, heading_rate
        Heading and heading rate of module 1, rad and rad/s, shape (T, robots).
    joint_angle, joint_rate
        Joint angle and joint rate of the yaw joints, rad and rad/s, shape (T, robots, N-1).
    leg_yaw
        Leg yaw of the legs of module 1, rad, shape (T, robots, 2).
    """
    load_xarray()
    import xarray as xr

    values = position, heading, velocity, heading_rate, joint_angle, joint_rate, leg_yaw
    named = zip(MOTION.items(), values, strict=True)
    coords = {
        "time": ("time", time, {"units": "s"}),
        "robot": np.arange(heading.shape[1]),
        "joint": np.arange(1, joint_angle.shape[2] + 1),
        "side": ["left", "right"],
        "axis": ["x", "y"],
    }
    return xr.Dataset({name: (over, each, {"units": unit}) for (name, (over, unit, _)), each in named}, coords=coords)


def quantity(name: str, values: Any) -> tuple[tuple[str, ...], Any, dict[str, str]]:
    """Variable of a record with one of the names of :data:`QUANTITIES`, without time where the values have none."""
    over, unit, _ = QUANTITIES[name]
    return over[-values.ndim :], values, {"units": unit}


def add_outcome(data: xr.Dataset, found: dict[str, Any], statuses: Sequence[str], target: Array | None) -> None:
    """Add variables, status and target to a record, and set the samples after a robot's failure to NaN.

    Parameters
    ----------
    data
        Record of :func:`walk_record`; changed in place.
    found
        All other variables.
    statuses
        Labels, one a robot.
    target
        m, shape (robots, 2), (times, robots, 2) if they moved, or None.
    """
    found = {**found, "status": ("robot", np.array(statuses, dtype=object))}
    if target is not None:
        over = ("time", "robot", "axis")[3 - target.ndim :]
        found["target"] = (over, target.copy(), {"units": "m"})
        angle, away = bearing_and_distance(data.position.values, data.heading.values, target)
        found["distance"] = (("time", "robot"), away, {"units": "m"})
        found["bearing"] = (("time", "robot"), angle, {"units": "rad"})
    data.update(found)
    failed = np.isnan(data.heading.values)
    for each in data.variables.values() if failed.any() else ():
        if each.dims[:2] == ("time", "robot"):
            np.copyto(each.values, np.nan, where=failed.reshape(*failed.shape, *[1] * (each.ndim - 2)))


def spring_work(data: xr.Dataset) -> xr.DataArray:
    """Work of changing stiffness on the springs of every robot of a record, J, over (robot).

    It is the integral of 1/2 theta^2 dk over the motion, by the mean of theta^2 between samples: of second order in the
    sampling where a spring ramps, of first order where it steps, and 0 for constant springs.
    """
    if "time" not in data.stiffness.dims:
        return (data.stiffness * 0.0).sum("joint").assign_attrs(units="J")
    stored = 0.5 * data.joint_angle**2
    mean = 0.5 * (stored + stored.shift(time=1))
    return (mean * data.stiffness.diff("time")).sum(("time", "joint"), skipna=True).assign_attrs(units="J")
