"""Running trials: in batches on all cores, each batch's records written as soon as it is done."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import planar
from chilopod.engine import event_times
from chilopod.output import prepare_folder, write_atomic
from chilopod.progress import Progress, silent
from chilopod.trials.store import as_bytes, read
from chilopod.trials.trial import Trial

Array = NDArray[np.float64]

_BATCH = {"planar": 32, "twin": 8}
"""Trials that run, and are lost, together; a few seconds' work."""


def run(
    trials: Sequence[Trial],
    folder: str | Path | None = None,
    progress: Progress = silent,
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
            found = read(folder / name)
            if found is not None:
                records[name] = found
                del missing[name]
    done = len(records)
    for batch in _batches(list(missing.items())):
        progress(done / len(records | missing), f"{done} of {len(records | missing)} trials")
        for (name, _), record in zip(batch, _walked([trial for _, trial in batch]), strict=True):
            if folder is not None:
                write_atomic(folder / name, as_bytes(record))
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
    asked = list(event_times(first.controller, first.robot.gait, first.duration)) if first.controller else []
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
            seeds=[each.scan_seed for each in drawn] if noisy else None,
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
