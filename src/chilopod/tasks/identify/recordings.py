"""Recorded walks as data for the identification of constants: joint angles or positions over time, with gaps."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import xarray as xr
from pydantic import field_validator

from chilopod import units
from chilopod.errors import ChilopodError, ParameterError, RobotFileError
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.robot.files import read_file
from chilopod.robot.parameters import place_of
from chilopod.text_file import read_text
from chilopod.units import Description

_LARGEST: Final = 100_000_000  # bytes
_CYCLES: Final = 5  # of the gait, which a recording must span
_LONGEST: Final = 3600.0  # s
_UNIT: Final = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")  # at the end of the name of a column
_NETCDF: Final = (b"CDF", b"\x89HDF")
_MISSING: Final = {"": "nan", "NA": "nan", "null": "nan"}


class Trajectory(Description):
    """Table ``[[trajectory]]``: a file with a recorded walk.

    Attributes
    ----------
    file
        CSV or netCDF file, relative to the file of data. The first column is time; the others are all joint angles,
        front to rear, or x and y of the centres of modules.
    unit
        Unit of all columns but time, where the file names none.
    modules
        Numbers of the modules whose positions are recorded, 1 for the front one; by default all.
    settings
        Numbers of the robot in this walk, such as ``springs.stiffness[0]=8 N*mm/deg``.
    """

    file: str
    unit: str | None = None
    modules: tuple[int, ...] = ()
    settings: tuple[str, ...] = ()


class RecordedWalks(Description):
    """Recorded walks of one robot, ``trajectory``, and the range of each constant that is ``free``, SI, by its path."""

    free: Mapping[str, tuple[float, float]]
    trajectory: tuple[Trajectory, ...]

    @field_validator("free", mode="before")
    @classmethod
    def _are_ranges(cls, given: Any) -> dict[str, tuple[float, float]]:
        """Read the ends of ranges with their units."""
        ranges = {}
        for path, ends in given.items() if isinstance(given, Mapping) and given else ():
            quantity, field = place_of(path).quantity, f"[{path}]"
            if not (isinstance(ends, Sequence) and len(ends) == 2 and not isinstance(ends, str)) or quantity.integer:
                raise ParameterError("must be a range of a number that is not whole", field=field, value=ends)
            try:
                low, high = (quantity.read(end) for end in ends)
            except ChilopodError as error:
                error.field = field
                raise
            if not low < high:
                raise ParameterError("must rise", field=field, value=ends)
            ranges[path] = (low, high)
        if not ranges:
            raise ParameterError("must be a table of ranges", value=given, allowed='"PATH" = ["LEAST", "MOST"]')
        return ranges

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a TOML file of the data; RobotFileError, in one line, names the fault."""
        return read_file(cls, path, "file of data")

    def recordings(self, robot: Robot, folder: Path) -> list[Recording]:
        """Walks of a robot, read from files in a folder; RobotFileError, in one line, names the fault."""
        if not self.trajectory:
            raise RobotFileError("must be one table for each walk", field="trajectory")
        return [_read(each, robot, folder / each.file) for each in self.trajectory]


@dataclass(frozen=True, eq=False)
class Recording:
    """Recorded walk.

    Attributes
    ----------
    name
        Path of the file.
    settings
        Numbers of the robot in this walk.
    times
        Times of the samples from the first one on, s, shape (samples,).
    values
        Joint angles, rad, shape (samples, N-1), or x and y of modules, m, shape (samples, 2 * modules); NaN in gaps.
    modules
        Numbers of the modules whose positions are recorded; empty for joint angles.
    """

    name: str
    settings: tuple[str, ...]
    times: Array
    values: Array
    modules: tuple[int, ...]

    @property
    def unit(self) -> str:
        """Unit in which values are shown."""
        return "mm" if self.modules else "deg"


def _read(given: Trajectory, robot: Robot, path: Path) -> Recording:
    source, own = str(path), robot.set_from_text(given.settings)
    try:
        head = path.read_bytes()[:4] if path.is_file() else b""
        table, names = (
            _netcdf(path) if head.startswith(_NETCDF) else _csv(read_text(path, "recording", RobotFileError, _LARGEST))
        )
        sizes, is_length = _sizes(names, given.unit)
        return _checked(given, own, source, table * sizes, is_length)
    except ChilopodError as error:
        raise RobotFileError(
            error.problem, field=error.field, value=error.value, allowed=error.allowed, source=source
        ) from None


def _netcdf(path: Path) -> tuple[Array, list[str]]:
    """Columns of a netCDF file, and their names with units."""
    try:
        data = xr.load_dataset(path, decode_times=False)
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise RobotFileError(f"is not a netCDF file that can be read ({type(error).__name__})") from None
    name = next((each for each in ("joint_angle", "position") if each in data and "time" in data), None)
    if name is None or data.sizes.get("robot", 1) != 1 or data[name].dims[0] != "time":
        raise RobotFileError("must have one walk", allowed="joint_angle or position over time")
    times, values = data["time"], data[name].values.reshape(data.sizes["time"], -1)
    unit, clock = (f"[{each.attrs['units']}]" if "units" in each.attrs else "" for each in (data[name], times))
    return np.column_stack([times.values, values]).astype(np.float64), [
        f"time {clock}",
        *[f"{name} {unit}"] * values.shape[1],
    ]


def _csv(text: str) -> tuple[Array, list[str]]:
    """Columns of a text with a line of names, and these."""
    lines = [(at, line) for at, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    comma = max(",;\t", key=lines[0][1].count)
    names = [cell.strip().strip('"') for cell in lines[0][1].split(comma)]
    rows = []
    for at, line in lines[1:]:
        cells = [cell.strip().strip('"') for cell in line.split(comma)]
        try:
            rows.append([float(_MISSING.get(cell, cell)) for cell in cells])
        except ValueError:
            raise RobotFileError("must be numbers, or empty in gaps", field=f"line {at}", value=line) from None
        if len(cells) != len(names):
            raise RobotFileError(f"must have {len(names)} columns, as the first line", field=f"line {at}", value=line)
    if not rows:
        raise RobotFileError("must have a line of names and lines of numbers", value=lines[0][1])
    return np.array(rows), names


def _sizes(names: Sequence[str], unit: str | None) -> tuple[Array, bool]:
    """SI sizes of the units of columns, of which the first is time, and whether the others are lengths."""
    found = []
    for at, name in enumerate(names):
        own = match[1] if (match := _UNIT.search(name)) else None
        if at and own and unit and units.unit(own) != units.unit(unit):
            raise RobotFileError(f"contradicts unit = {unit!r} in the file of data", field=f"column {name}")
        found.append(units.unit(own or (unit if at else "s") or ""))
    second, length, angle = (units.unit(each).dimension for each in ("s", "m", "rad"))
    kinds = {each.dimension for each in found[1:]}
    if found[0].dimension != second or kinds not in ({length}, {angle}):
        allowed = (
            "time, then angles only or lengths only, with units such as [deg] or [mm] in the names, or the key unit"
        )
        raise RobotFileError("must have consistent units", field="columns", value=", ".join(names), allowed=allowed)
    return np.array([float(each.size) for each in found]), kinds == {length}


def _checked(given: Trajectory, robot: Robot, source: str, table: Array, is_length: bool) -> Recording:
    times, values, count = table[:, 0], np.where(np.isfinite(table[:, 1:]), table[:, 1:], np.nan), robot.body.modules
    modules = (given.modules or tuple(range(1, count + 1))) if is_length else ()
    wanted = 2 * len(modules) or count - 1
    if not all(1 <= each <= count for each in modules) or (given.modules and not is_length):
        raise ParameterError("must be modules whose positions are recorded", field="modules", value=given.modules)
    if values.shape[1] != wanted:
        what = f"x and y of {len(modules)} modules" if is_length else f"one angle for each joint of {robot.name}"
        raise ParameterError(f"must be {wanted} columns besides time, {what}", field="columns", value=values.shape[1])
    if not (np.diff(times) > 0.0).all():
        at = int(np.argmin(np.diff(times) > 0.0))
        raise ParameterError("must rise", field="time", value=times[at : at + 2].tolist())
    known = np.isfinite(values)
    if not known.any(axis=0).all():
        raise ParameterError("must have numbers", field="column", value=int(np.argmin(known.any(axis=0))) + 2)
    if not is_length and np.nanmax(np.abs(values)) > 0.5 * np.pi:
        largest = float(np.nanmax(np.abs(values)))
        raise ParameterError(
            "must be joint angles",
            field="largest angle",
            value=f"{largest:.4g} rad",
            allowed="up to 90 deg; degrees need the unit deg",
        )
    kept = known.any(axis=1)
    times, values = times[kept] - times[kept][0], values[kept]
    if not _CYCLES * robot.gait.period <= times[-1] <= _LONGEST or known.sum() < 10 * (count + 10):
        raise ParameterError(
            "must have enough numbers",
            field="recording",
            value=f"{known.sum()} numbers in {times[-1]:.4g} s",
            allowed=f"{_CYCLES} cycles of the gait, {_CYCLES * robot.gait.period:.4g} s, to {_LONGEST:g} s, and {10 * (count + 10)} numbers or more",
        )
    return Recording(source, given.settings, times, values, modules)
