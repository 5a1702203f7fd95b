"""Batches: trials that can walk together, and walking them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import planar
from chilopod.engine import event_times
from chilopod.trials.trial import Trial

Array = NDArray[np.float64]

_BATCH = {"planar": 32, "twin": 8}
"""Trials that run, and are lost, together; a few seconds' work."""


def batches(trials: Sequence[tuple[str, Trial]]) -> list[list[tuple[str, Trial]]]:
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


def walked(trials: Sequence[Trial], threads: int = 0) -> list[xr.Dataset]:
    """Records of trials that can walk together.

    Parameters
    ----------
    trials
        Of one batch, see :func:`batches`.
    threads
        That the twin walks on, 0: one for each core; for the planar model ``numba.set_num_threads`` says it.
    """
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
            threads=threads,
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
