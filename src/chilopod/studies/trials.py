"""Trials: one walk each, with its conditions, its disturbances drawn from a seed, and its file.

A study is a list of trials. They run in batches on all cores, each batch's records are written as soon as it is done,
every file whole or not at all and under a name derived from all that makes the trial, so a study that was stopped in
any way goes on where it was, and a trial that several studies share is run once.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import planar
from chilopod.engine import event_times
from chilopod.errors import ParameterError, nearest_name
from chilopod.output import prepare_folder, write_atomic
from chilopod.robot import Robot
from chilopod.steering import LegYawController, Target

Array = NDArray[np.float64]

RECORD_VERSION = 4
"""Goes up whenever the same trial would give another record; files of other versions are left alone."""

ENGINES = ("planar", "twin")
"""What walks: the planar model, or the whole robot in three dimensions."""

_BATCH = {"planar": 32, "twin": 8}
"""Trials that run, and are lost, together; a few seconds' work."""


@dataclass(frozen=True)
class Disturbance:
    """What differs from trial to trial: standard deviations of independent normal deviates.

    The same for every study and engine. None of it is printed in the paper; the values are what careful setting up by
    hand leaves (joints and heading), what a vinyl mat varies (friction), and the scanner's step of 0.352 deg with an
    extended target (bearing).

    Attributes
    ----------
    joint_angle
        Of every yaw joint at the start, rad.
    heading
        Of module 1 at the start, rad.
    friction
        Of the logarithm of every foot's friction coefficient.
    bearing
        Of every measured bearing, rad. The twin's scanner has noise of its own instead, if this is not zero.
    """

    joint_angle: float = float(np.deg2rad(0.5))
    heading: float = float(np.deg2rad(1.0))
    friction: float = 0.02
    bearing: float = float(np.deg2rad(0.5))

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not 0.0 <= value < 10.0:
                raise ParameterError("is out of range", field=name, value=value, allowed="0 or more, less than 10")


NONE = Disturbance(0.0, 0.0, 0.0, 0.0)
"""No disturbance at all."""


@dataclass(frozen=True)
class Trial:
    """Everything that makes a walk.

    Attributes
    ----------
    robot
        With the springs of this trial.
    duration
        s.
    seed
        Of its disturbances.
    joint_angles
        At the start, before disturbance, rad, (N-1,); empty for straight.
    target
        Where the robot is to go, if anywhere.
    controller
        What steers it, if anything.
    disturbance
        How much differs from trial to trial.
    rate
        Samples per second.
    forces
        Whether the record has the force on every foot.
    engine
        One of :data:`ENGINES`.
    poses
        Whether the record has the positions of all joints, to be drawn (twin only).
    """

    robot: Robot
    duration: float
    seed: int = 0
    joint_angles: tuple[float, ...] = ()
    target: Target | None = None
    controller: LegYawController | None = None
    disturbance: Disturbance = field(default_factory=Disturbance)
    rate: float = 100.0
    forces: bool = False
    engine: str = "planar"
    poses: bool = False

    def __post_init__(self) -> None:
        check_engine(self.engine, self.robot)

    @property
    def description(self) -> dict[str, Any]:
        """All of it as plain data; equal descriptions are equal trials."""
        return {
            "version": RECORD_VERSION,
            "engine": self.engine,
            # What it is called and where its numbers come from makes no difference.
            "robot": self.robot.with_(name="robot", provenance={}).to_toml(),
            "duration": self.duration,
            "seed": self.seed,
            "joint_angles": list(self.joint_angles),
            "target": asdict(self.target) if self.target else None,
            "controller": asdict(self.controller) if self.controller else None,
            "disturbance": asdict(self.disturbance),
            "rate": self.rate,
            "forces": self.forces,
            "poses": self.poses,
        }

    @property
    def file_name(self) -> str:
        """Of its record."""
        text = json.dumps(self.description, sort_keys=True)
        return f"{self.engine}-{hashlib.sha256(text.encode()).hexdigest()[:20]}.nc"


def run(
    trials: Sequence[Trial],
    folder: str | Path | None = None,
    progress: Callable[[float, str], None] = lambda done, words: None,
) -> list[xr.Dataset]:
    """Run trials, or read what has been run before.

    Parameters
    ----------
    trials
        In any order; the same trial may occur twice.
    folder
        Where records are kept; without one nothing is kept.
    progress
        Called with the part done (0 to 1) and a few words.

    Returns
    -------
    The record of every trial, see :func:`chilopod.planar.simulate` and :func:`chilopod.twin.simulate`, with one
    ``robot`` and the trial in the attributes.
    """
    if folder is not None:
        folder = prepare_folder(folder)
    names = [trial.file_name for trial in trials]
    missing = dict(zip(names, trials, strict=True))
    records: dict[str, xr.Dataset] = {}
    if folder is not None:
        for name in list(missing):
            found = _read(folder / name)
            if found is not None:
                records[name] = found
                del missing[name]
    done = len(records)
    for batch in _batches(list(missing.items())):
        progress(done / len(records | missing), f"{done} of {len(records | missing)} trials")
        for (name, _), record in zip(batch, _walked([trial for _, trial in batch]), strict=True):
            if folder is not None:
                write_atomic(folder / name, _bytes(record))
            records[name] = record
            done += 1
    progress(1.0, f"{done} trials")
    return [records[name] for name in names]


def together(records: Sequence[xr.Dataset]) -> xr.Dataset:
    """Records of one duration and rate as one dataset over ``robot``."""
    joined = xr.concat(records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="override")
    return joined.assign_coords(robot=np.arange(len(records)))


def _batches(trials: Sequence[tuple[str, Trial]]) -> list[list[tuple[str, Trial]]]:
    """Those that can walk together, a few at a time."""
    groups: dict[tuple[Any, ...], list[tuple[str, Trial]]] = {}
    for name, trial in trials:
        alike = (
            trial.robot.gait,
            trial.robot.body.modules,
            trial.duration,
            trial.target is None,
            trial.controller,
            # Whether its sensor is noisy is said once for a batch.
            trial.disturbance.bearing > 0.0,
            trial.rate,
            trial.forces,
            trial.engine,
            trial.poses,
            # Robots of the twin share a model, in which only springs differ.
            (trial.robot.body, trial.robot.legs, trial.robot.ground, trial.robot.twin)
            if trial.engine == "twin"
            else None,
        )
        groups.setdefault(alike, []).append((name, trial))
    return [
        group[i : i + size]
        for group in groups.values()
        for size in [_BATCH[group[0][1].engine]]
        for i in range(0, len(group), size)
    ]


def _walked(trials: Sequence[Trial]) -> list[xr.Dataset]:
    """Records of trials that can walk together."""
    first = trials[0]
    asked = event_times(first.controller, first.robot.gait, first.duration) if first.controller else []
    drawn = [_drawn(trial, len(asked)) for trial in trials]
    target = None if first.target is None else np.stack([t.target.position for t in trials if t.target])
    given: dict[str, Any] = {
        "robots": [trial.robot for trial in trials],
        "duration": first.duration,
        "friction": np.stack([each.friction for each in drawn]),
        "controller": first.controller,
        "target": target,
        "rate": first.rate,
        "forces": first.forces,
    }
    angles, heading = np.stack([each.joint_angles for each in drawn]), np.array([each.heading for each in drawn])
    if first.engine == "twin":
        from chilopod import twin  # MuJoCo takes a moment to load

        noisy = target is not None and first.disturbance.bearing > 0.0
        data = twin.simulate(
            **given,
            initial=twin.initial_states(first.robot, angles, heading),
            scan_seeds=[each.scan_seed for each in drawn] if noisy else None,
            poses=first.poses,
        )
    else:
        data = planar.simulate(
            **given,
            initial=planar.initial_states(first.robot, angles, heading),
            bearing_noise=np.stack([each.bearing for each in drawn]),
        )
    records = []
    for index, trial in enumerate(trials):
        record = data.isel(robot=[index]).assign_coords(robot=[0])
        record.attrs["robot"] = trial.robot.to_toml()
        record.attrs["trial"] = json.dumps(trial.description, sort_keys=True)
        records.append(record)
    return records


@dataclass(frozen=True)
class _Drawn:
    joint_angles: Array
    heading: float
    friction: Array
    bearing: Array
    scan_seed: int


def _drawn(trial: Trial, events: int) -> _Drawn:
    """What a trial's seed makes of its disturbance; each kind has its own stream of numbers."""
    n, spread = trial.robot.body.modules, trial.disturbance
    streams = np.random.SeedSequence(trial.seed).spawn(5)
    joints, heading, friction, bearing = (np.random.default_rng(each) for each in streams[:4])
    nominal = np.array(trial.joint_angles) if trial.joint_angles else np.zeros(n - 1)
    return _Drawn(
        nominal + spread.joint_angle * joints.standard_normal(n - 1),
        float(spread.heading * heading.standard_normal()),
        np.exp(spread.friction * friction.standard_normal((n, 2))),
        spread.bearing * bearing.standard_normal(events),
        int(streams[4].generate_state(1)[0]),
    )


def check_engine(engine: str, robot: Robot) -> None:
    """Make sure that there is such an engine and that it knows such a robot.

    Raises
    ------
    ParameterError
        If not.
    """
    if engine not in ENGINES:
        raise ParameterError(
            "there is no such engine",
            field="engine",
            value=engine,
            allowed=", ".join(ENGINES),
            nearest=nearest_name(engine, ENGINES),
        )
    if engine == "twin" and robot.twin is None:
        raise ParameterError(
            "the robot has no [twin], only the planar model knows it",
            field="engine",
            value=engine,
            allowed="planar, or a robot file with a [twin], such as the preset aoi2022",
        )


def _bytes(record: xr.Dataset) -> bytes:
    """A record as a netCDF-3 file: twenty times as fast to write and read as netCDF-4, and a study has hundreds."""
    written: bytes = bytes(record.to_netcdf(engine="scipy", format="NETCDF3_64BIT"))
    return written


def _read(path: Path) -> xr.Dataset | None:
    """A record that is there and whole, else None."""
    try:
        return xr.load_dataset(path, engine="scipy")
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        return None
