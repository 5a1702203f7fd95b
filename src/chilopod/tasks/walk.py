"""Walks of one robot: one, or many that differ in their disturbances; options and results that all tasks share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
import xarray as xr

from chilopod.engine import Controller, HasFootCreep, engine_named
from chilopod.engine.named import path_of
from chilopod.notebook import Summary, axes_for, picture
from chilopod.progress import Progress, silent
from chilopod.record import RATE
from chilopod.robot import Robot
from chilopod.steering import ARRIVAL_RADIUS
from chilopod.trials import AVERAGED, NONE, Trial, WalkSummary, as_now, run, run_each, straight, summaries, together

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHOWN = 0.005  # deg, smallest joint angle that is not shown as zero
_MOST = 12  # walks that are drawn in a notebook


class RunOptions(TypedDict, total=False):
    """Options of every task with walks: ``seed`` of the first walk's disturbances, from which the others count up, None
    (default) for no disturbance; ``repeats``, the number of walks, by default 1; ``folder`` that keeps all trials, if
    any; and ``progress``, a function of the fraction done (0 to 1) and a few words."""

    seed: int | None
    repeats: int
    folder: str | Path | None
    progress: Progress


def runs(
    trial: Trial,
    seed: int | None = None,
    repeats: int = 1,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> tuple[tuple[Trial, ...], list[xr.Dataset]]:
    """Trials of a walk and their records, by :class:`RunOptions`."""
    trials = trial.repeated(seed, repeats)
    return trials, run(trials, folder, progress)


@dataclass(frozen=True)
class Runs(Summary):
    """Walks that differ only in their seed, with their trials."""

    trials: tuple[Trial, ...]

    @property
    def first(self) -> Trial:
        """Trial of the first walk; the others differ only in the seed."""
        return self.trials[0]

    @property
    def robot(self) -> Robot:
        """Robot that walked."""
        return self.first.robot

    @property
    def engine(self) -> str:
        """Name of the engine."""
        return self.first.engine

    @property
    def who(self) -> str:
        """Names of robot and engine."""
        return f"{self.robot.name}, {self.engine}"

    @property
    def seeds(self) -> list[int | None]:
        """Seed of every walk; None for a walk without disturbance."""
        return [None if trial.disturbance == NONE else trial.seed for trial in self.trials]

    @property
    def labels(self) -> list[str]:
        """:attr:`seeds` in words."""
        return ["-" if seed is None else str(seed) for seed in self.seeds]

    @cached_property
    def foot_creep(self) -> float | None:
        """Resistance of the engine's floor to creep: coefficient of the viscous friction across the way that gives the
        same creep of standing feet, N*s/m; None if they do not creep, or the robot cannot stand."""
        engine = engine_named(self.engine)
        found = engine.foot_creep(self.robot).across if isinstance(engine, HasFootCreep) else np.inf
        return found if np.isfinite(found) else None

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; null for missing values."""
        steering = self.first.controller
        controller = None if steering is None else path_of(type(steering))
        shared = {"robot": self.robot.name, "engine": self.engine, "controller": controller, **self._found()}
        return {**shared, "foot_creep_N_s_m": self.foot_creep}

    def _found(self) -> dict[str, Any]:
        return {}


class Pathed(Runs):
    """Base of walks that have a record, and are drawn as paths over the floor."""

    if TYPE_CHECKING:

        @property
        def record(self) -> xr.Dataset: ...

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the path of module 1 in every walk, the first dozen of them, and the targets."""
        axes = axes_for(axes)
        draw_paths(axes, self.record)
        return axes

    def _picture(self) -> str:
        count = self.record.sizes["robot"]
        alt = f"paths of {'a walk' if count == 1 else f'{count} walks'} from above"
        return picture(self.plot, alt if count <= _MOST else f"{alt}, the first {_MOST} drawn")


def draw_paths(axes: Axes, record: xr.Dataset) -> None:
    """Draw the path of module 1 in every walk of a record, the first dozen of them, and the targets."""
    from matplotlib.patches import Circle

    drawn = record.isel(robot=slice(_MOST))
    for way in drawn.position.transpose("robot", "time", "axis").values:
        axes.plot(*way.T)
    for x, y in _targets(drawn):
        if np.isfinite(x + y):
            axes.add_patch(Circle((x, y), ARRIVAL_RADIUS, color="C2", alpha=0.35))
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")


def _targets(record: xr.Dataset) -> np.ndarray:
    """Positions on the floor, shape (targets, 2), each once."""
    if "goal_place" in record:
        places = record.goal_place.transpose("robot", "goal", "axis").values
    elif "target" in record:
        places = record.target.transpose(..., "robot", "axis").values
    else:
        places = np.empty((0, 2))
    return np.unique(places.reshape(-1, 2), axis=0)


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
        averaged = min(max(AVERAGED, self.robot.gait.period), self.first.duration)
        last = f"joint angles, mean of the last {averaged:g} s (deg)"
        rows: list[Sequence[str]] = [("seed", "x (m)", "y (m)", "radius (m)", last)]
        below = []
        for label, end in zip(self.labels, self.summaries, strict=True):
            if end.failed:
                rows.append((label, "-", "-", "-", end.sentence))
                continue
            if np.isnan(end.axis_radius):
                rows.append((label, f"{end.x:.3f}", f"{end.y:.3f}", "-", "-"))
                below = ["too few samples for means over the gait cycle: walk with a higher rate"]
                continue
            bends = "  ".join(f"{angle:+7.2f}" for angle in end.joint_angles_deg)
            shown = np.abs(end.joint_angles_deg).max() >= _SHOWN and np.isfinite(end.axis_radius)
            radius = f"{end.axis_radius:.4g}" if shown else "straight"
            rows.append((label, f"{end.x:.3f}", f"{end.y:.3f}", radius, bends))
        return [], rows, below

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
    """Simulate one walk of a robot, or several, with the arguments of :class:`chilopod.trials.Trial` and
    :class:`chilopod.tasks.RunOptions`. ParameterError if a value is out of range, or memory cannot hold the record,
    which :func:`ends` does not need."""
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
