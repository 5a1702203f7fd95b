"""Recorded walks as data for the identification of constants: joint angles over time, with gaps."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import units
from chilopod.errors import ChilopodError, ParameterError, RobotFileError, concerning
from chilopod.frozen import Array
from chilopod.planar import PlanarModel
from chilopod.robot import Robot
from chilopod.tasks.identify.data import RecordedWalks, Trajectory
from chilopod.text_file import read_text

_LARGEST, _LONGEST = 50_000_000, 3600.0  # bytes, s
_CYCLES, _NUMBERS = 5, 100  # of the gait, and angles, which a recording must have
_PARTS, _MOST, _PHASES, _FORGOTTEN = (0.25, 0.5, 0.75), 20, 6, 1e-3  # cycles, number, and what is left of rates
_UNIT = re.compile(r"[\[(]([^\[\]()]*)[\])]$")
_NUMBER = re.compile(r"(\d+)\W*$")


@dataclass(frozen=True, eq=False)
class Recording:
    """Recorded walk: name of the file, numbers of the robot in this walk, time in which rates are forgotten, s,
    times from the first sample on, s, shape (samples,), and joint angles, rad, NaN in gaps, shape (samples, N-1)."""

    name: str
    settings: tuple[str, ...]
    forgotten: float
    times: Array
    angles: Array

    @property
    def counts(self) -> NDArray[np.bool_]:
        """True for samples after the rates at the first one, which nothing tells, are forgotten."""
        return self.times >= self.forgotten


def read_recordings(robot: Robot, data: RecordedWalks, folder: Path) -> list[Recording]:
    """Walks of a robot from files in a folder; RobotFileError or ParameterError, in one line, names file and fault."""
    data.free.check(robot)
    robots = []
    for at, each in enumerate(data.trajectory):
        with concerning(within=f"trajectory.{at}.settings"):
            robots.append(own := robot.set_from_text(each.settings))
            fixed = {number for text in each.settings for number in own.numbers(text.partition("=")[0].strip())}
        for path in data.free.paths:
            if fixed.issuperset(own.numbers(path)):
                raise ParameterError("must not be a setting of a walk too", field=f"free[{path}]")
    free = {path.partition("[")[0] for path in data.free.paths}
    walks = [_read(*pair, folder / pair[0].file, free) for pair in zip(data.trajectory, robots, strict=True)]
    for one, other in combinations(walks, 2):
        if np.array_equal(one.times, other.times) and np.array_equal(one.angles, other.angles, equal_nan=True):
            raise ParameterError(f"has the same walk as {one.name}", field="trajectory.file", value=other.name)
    return walks


def _read(given: Trajectory, robot: Robot, path: Path, free: set[str]) -> Recording:
    with concerning(source=str(path)):
        if path.suffix.lower() in (".nc", ".nc4"):
            data = _netcdf(path)
            _check_settings(robot, data, free)
            names, table = _columns(data)
            places = [f"sample {at + 1}" for at in range(len(table))]
        else:
            names, table, places = _csv(read_text(path, "recording", RobotFileError, _LARGEST))
        for sample, at in np.argwhere(np.isinf(table))[:1].tolist():
            said = f"must be finite, or empty in gaps: {places[sample]}"
            raise ParameterError(said, field=f"column {names[at]}", value=table[sample, at])
        used = _units(names, given.unit)
        table_si = table * [float(units.unit(each).size) for each in used]
        for sample, joint in np.argwhere(np.abs(table_si[:, 1:]) > 0.5 * np.pi)[:1].tolist():
            unit, value = used[joint + 1], table[sample, joint + 1]
            allowed = f"at most 90 deg{'; if these are degrees, say so by the unit deg' * (unit == 'rad')}"
            said, field = f"too large: {places[sample]}", f"column {names[joint + 1]}"
            raise ParameterError(said, field=field, value=f"{value:.6g} {unit}", allowed=allowed)
        times, angles = _checked(robot, table_si)
        forgotten = _forgotten(PlanarModel(robot))
        if not 2.0 * forgotten <= times[-1]:
            said = f"too short for this robot, which forgets the rates at its start within {forgotten:.3g} s only"
            raise ParameterError(said, value=f"{times[-1]:.4g} s", allowed=f"{2.0 * forgotten:.3g} s or more")
        return Recording(given.file, given.settings, forgotten, times, angles)


def _forgotten(model: PlanarModel) -> float:
    """Time after which the motion about the straight walk hardly depends on the rates at its start, at any phase, if
    its joint angles there are free: most of a cycle where the legs of a module leave the floor together, several cycles
    for heavy robots with poor grip; infinite if that is far longer. s."""
    joints, phases = range(3, model.modules + 2), model.period * np.arange(_PHASES) / _PHASES
    for time in model.period * np.array([*_PARTS, *range(1, _MOST + 1)]):
        flows = [model.flow(model.orbit, at, at + time)[1] / model.scale[:, None] * model.scale for at in phases]
        pairs = [(np.linalg.qr(flow[:, joints])[0], np.delete(flow, joints, axis=1)) for flow in flows]
        if all(np.abs(rates - known @ (known.T @ rates)).max() < _FORGOTTEN for known, rates in pairs):
            return float(time)
    return np.inf


def _netcdf(path: Path) -> xr.Dataset:
    """Record of one walk, with joint_angle over time and joint."""
    if not path.exists():
        raise RobotFileError("no such file")
    try:
        data = xr.load_dataset(path, decode_times=False)
        data = data.squeeze("robot") if "robot" in data.dims else data
        return data.assign(joint_angle=data["joint_angle"].transpose("time", "joint"))
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        problem = f"must be a netCDF file of one walk, with joint_angle over time and joint ({type(error).__name__})"
        raise RobotFileError(problem) from None


def _columns(data: xr.Dataset) -> tuple[list[str], Array]:
    """Names of columns and the columns of a record."""
    time, angles = data["time"], data["joint_angle"]
    heads = ["time", *(f"joint_angle {joint + 1}" for joint in range(angles.sizes["joint"]))]
    names = [f"{head} [{(angles if at else time).attrs.get('units', '')}]" for at, head in enumerate(heads)]
    return names, np.column_stack([time.values, angles.values])


def _check_settings(robot: Robot, data: xr.Dataset, free: set[str]) -> None:
    """ParameterError if the record of a simulated walk has other springs or another gait than the robot."""
    recorded: dict[str, Array] = {}
    with suppress(ChilopodError, KeyError):
        own = Robot.from_toml(data.attrs["robot"])
        recorded = {path: np.array(own.get(path)) for path in own.parameters() if path.startswith("gait.")}
        springs = np.moveaxis(data["stiffness"].values, data["stiffness"].get_axis_num("joint"), 0)
        recorded |= {f"springs.stiffness[{at}]": each for at, each in enumerate(springs[: robot.body.modules - 1])}
    for path, values in recorded.items():
        if path.partition("[")[0] not in free and not np.allclose(values, robot.get(path), rtol=1e-6, atol=0.0):
            ends, unit = np.unique([values.min(), values.max()]).tolist(), robot.unit_of(path)
            allowed = " to ".join(units.format(end, unit, digits=6) for end in ends) + " in the settings"
            said, value = "must be that of the recording", units.format(robot.get(path), unit, digits=6)
            raise ParameterError(said, field=path, value=value, allowed=allowed)


def _csv(text: str) -> tuple[list[str], Array, list[str]]:
    """Names of columns in the first line, the columns, and places of the rows in words."""
    lines = {at: line for at, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")}
    comma = max(",;\t", key=next(iter(lines.values()), "").count)
    names, *rows = ([cell.strip(' "') for cell in line.split(comma)] for line in lines.values() or [""])
    table = np.empty((len(rows), len(names)))
    for row, at, cells in zip(table, list(lines)[1:], rows, strict=True):
        problem = f"must be a line of names, then lines of {len(names)} numbers with decimal points, empty in gaps"
        if len(cells) != len(names):
            raise RobotFileError(f"{problem}: line {at} has {len(cells)} cells")
        try:
            row[:] = [float(cell or "nan") for cell in cells]
        except ValueError as error:
            raise RobotFileError(f"{problem}: line {at}, {error}") from None
    told = [_NUMBER.search(_UNIT.sub("", name)) for name in names[1:]]
    numbers = [int(each[1]) for each in told if each]
    if len(numbers) == len(told) > 0 and numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        said = "must be the joints, front to rear"
        raise ParameterError(said, field="columns", value=", ".join(names[1:]), allowed="names whose numbers rise by 1")
    return names, table, [f"sample {sample}, line {at}" for sample, at in enumerate(list(lines)[1:], 1)]


def _units(names: list[str], unit: str | None) -> list[str]:
    """Units of columns, of which the first is time."""
    found = []
    for at, name in enumerate(names):
        named = match[1] if (match := _UNIT.search(name)) else ""
        if at and named and unit and units.unit(named) != units.unit(unit):
            raise ParameterError(f"contradicts unit = {unit!r} in the file of data", field="column", value=name)
        used = named or (unit if at else "s") or ""
        if units.unit(used).dimension != units.unit("rad" if at else "s").dimension:
            allowed = "time and joint angles, with a unit such as [deg] in the name of the column, or the key unit"
            raise ParameterError("must have a unit of its kind", field="column", value=name, allowed=allowed)
        found.append(used)
    return found


def _checked(robot: Robot, table: Array) -> tuple[Array, Array]:
    """Times from the first sample on, and joint angles."""
    joints, times, angles = robot.body.modules - 1, table[:, 0], table[:, 1:]
    if angles.shape[1] != joints:
        problem = f"must be {joints} besides time, one for each joint of {robot.name}"
        raise ParameterError(problem, field="columns", value=angles.shape[1])
    if not (np.diff(times) > 0.0).all():
        at = int((np.diff(times) > 0.0).argmin())
        pair = f"times of samples {at + 1} and {at + 2}"
        raise ParameterError("must rise", field=pair, value=times[at : at + 2].tolist())
    known = np.isfinite(angles)
    times, angles = times[known.any(axis=1)], angles[known.any(axis=1)]
    least, span = _CYCLES * robot.gait.period, float(np.ptp(times)) if times.size else 0.0
    if not least <= span <= _LONGEST or known.sum() < _NUMBERS:
        allowed = f"{least:g} s ({_CYCLES} cycles of the gait) to {_LONGEST:g} s, and {_NUMBERS} angles"
        raise ParameterError("too short or too long", value=f"{known.sum()} angles in {span:.4g} s", allowed=allowed)
    return times - times[0], angles
