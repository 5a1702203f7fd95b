"""Walks of one robot: one, or many that differ in their disturbances, and their results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import xarray as xr

from chilopod.engine import Controller
from chilopod.progress import Progress, silent
from chilopod.record import RATE
from chilopod.robot import Robot
from chilopod.tasks.runs import Pathed, RunOptions, Runs, runs
from chilopod.trials import Trial, WalkSummary, as_now, run_each, straight, summaries, together


@dataclass(frozen=True)
class Ends(Runs):
    """Ends of walks that differ only in their seed: trials, summaries, and ``straight``, which is True if none of them
    ever bent, see :func:`chilopod.trials.straight`."""

    summaries: Sequence[WalkSummary]
    straight: bool

    @property
    def title(self) -> str:
        """Robot, engine, number of walks and their duration, in words."""
        count = len(self.trials)
        return f"{self.who}: {count} walk{'s' if count > 1 else ''} of {self.first.duration:g} s"

    def _found(self) -> dict[str, Any]:
        ends = zip(self.trials, self.summaries, strict=True)
        return {
            "duration_s": self.first.duration,
            "seeded": self.seeds[0] is not None,
            "walks": [{"seed": trial.seed, **end.as_json()} for trial, end in ends],
        }

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        rows: list[Sequence[str]] = [
            ("seed", "x (m)", "y (m)", "radius (m)", "joint angles, mean of the last 5 s (deg)")
        ]
        for label, end in zip(self.labels, self.summaries, strict=True):
            if end.failed:
                rows.append((label, "-", "-", "-", end.sentence))
                continue
            bends = "  ".join(f"{angle:+7.2f}" for angle in end.joint_angles_deg)
            radius = f"{end.axis_radius:.4g}" if np.isfinite(end.axis_radius) else "straight"
            rows.append((label, f"{end.x:.3f}", f"{end.y:.3f}", radius, bends))
        return [], rows, []

    def _picture(self) -> str:
        return ""


@dataclass(frozen=True)
class Walks(Pathed, Ends):
    """Ends of walks together with the record of all walks."""

    record: xr.Dataset


def walk(
    robot: Robot,
    duration: float,
    *,
    joint_angles: Sequence[float] = (),
    rate: float = RATE,
    forces: bool = False,
    engine: str = "planar",
    controller: Controller | None = None,
    **options: Unpack[RunOptions],
) -> Walks:
    """Simulate one walk of a robot, or several.

    Parameters
    ----------
    robot, duration, joint_angles, rate, forces, engine, controller
        As for :class:`chilopod.trials.Trial`.
    **options
        See :class:`chilopod.tasks.RunOptions`.

    Raises
    ------
    ParameterError
        If a value is out of range, or memory cannot hold the record, which :func:`ends` does not need.
    """
    bends = tuple(joint_angles)
    one = Trial(robot, duration, 0, bends, controller=controller, rate=rate, forces=forces, engine=engine)
    trials, records = runs(one, **options)
    record = together(records)
    return Walks(trials, summaries(robot, record), straight(record), record)


def ends(
    trials: Sequence[Trial],
    folder: str | Path | None = None,
    progress: Progress = silent,
    callback: Callable[[int, xr.Dataset], None] = lambda index, record: None,
) -> Ends:
    """Simulate walks and keep only their summaries, so that memory holds one batch of records, however many walks there
    are. ``callback`` is called with the number of a walk and its record as soon as it is done; for the rest see
    :meth:`chilopod.trials.Trial.repeated` and :class:`chilopod.tasks.RunOptions`."""
    trials = tuple(as_now(trials))
    number = {trial.file_name: index for index, trial in enumerate(trials)}
    found: dict[int, WalkSummary] = {}
    unbent = True
    for trial, record in run_each(trials, folder, progress):
        index = number[trial.file_name]
        (found[index],) = summaries(trial.robot, record)
        unbent = unbent and straight(record)
        callback(index, record)
    return Ends(trials, [found[index] for index in range(len(trials))], unbent)
