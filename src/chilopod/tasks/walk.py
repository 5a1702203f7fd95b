"""Walks of one robot: one, or many that differ in their disturbances, and what they came to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
import xarray as xr

from chilopod.engine import Controller, HasFootCreep, engine_named
from chilopod.engine.named import path_of
from chilopod.errors import ParameterError
from chilopod.frozen import Short
from chilopod.notebook import block, table
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.tasks.shown import paths
from chilopod.trials import NONE, Disturbance, Trial, WalkSummary, as_now, run, run_each, straight, summaries, together

_MOST_BENT = 1.5  # rad; at a right angle modules run into each other


@dataclass(frozen=True)
class Ends(Short):
    """Ends of walks that differ in nothing but their seed.

    Attributes
    ----------
    trials
        With all that makes each of them.
    summaries
        The end of every walk.
    straight
        True if none of them ever bent, see :func:`chilopod.trials.straight`.
    """

    trials: tuple[Trial, ...]
    summaries: Sequence[WalkSummary]
    straight: bool

    @property
    def first(self) -> Trial:
        """All but the seed is the same in the others."""
        return self.trials[0]

    @property
    def seeded(self) -> bool:
        """True if the walks are disturbed."""
        return self.first.disturbance != NONE

    @cached_property
    def foot_creep(self) -> float | None:
        """See :func:`foot_creep`."""
        return foot_creep(self.first.robot, self.first.engine)

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; null for what there is not."""
        first = self.first
        return {
            "robot": first.robot.name,
            "engine": first.engine,
            "controller": None if first.controller is None else path_of(type(first.controller)),
            "duration_s": first.duration,
            "seeded": self.seeded,
            "walks": [
                {"seed": trial.seed, **end.as_json()} for trial, end in zip(self.trials, self.summaries, strict=True)
            ],
            "foot_creep_N_s_m": self.foot_creep,
        }

    def _repr_html_(self) -> str:
        return block(self._heading, self._table)

    @property
    def _heading(self) -> str:
        first, count = self.first, len(self.trials)
        return f"{first.robot.name}, {first.engine}: {count} walk{'s' if count > 1 else ''} of {first.duration:g} s"

    @property
    def _table(self) -> str:
        rows = [
            (
                trial.seed if self.seeded else "-",
                end.sentence,
                f"{end.x:.3f}",
                f"{end.y:.3f}",
                f"{end.axis_radius:.4g}" if np.isfinite(end.axis_radius) else "straight",
            )
            for trial, end in zip(self.trials, self.summaries, strict=True)
        ]
        return table(("seed", "", "x (m)", "y (m)", "radius (m)"), rows)


@dataclass(frozen=True)
class Walks(Ends):
    """Walks that differ in nothing but their seed, and what they came to.

    Attributes
    ----------
    trials, summaries, straight
        As for :class:`Ends`.
    record
        Record of all walks.
    """

    record: xr.Dataset

    def _repr_html_(self) -> str:
        return block(self._heading, paths(self.record), self._table)


class Plan(TypedDict, total=False):
    """Arguments of :func:`walk` and :func:`planned`, all of which may be left out."""

    seed: int | None
    repeats: int
    joint_angles: Sequence[float]
    rate: float
    forces: bool
    engine: str
    controller: Controller | None


def walk(
    robot: Robot,
    duration: float,
    *,
    folder: str | Path | None = None,
    progress: Progress = silent,
    **plan: Unpack[Plan],
) -> Walks:
    """Let a robot walk, once or many times.

    Parameters
    ----------
    robot
        The robot.
    duration
        s.
    folder
        Folder where the trials are kept; without one nothing is kept.
    progress
        Called with the part done (0 to 1) and a few words.
    **plan
        ``seed`` of the first walk's disturbances, the others count up from it; None (default) for no disturbance at
        all. ``repeats``, the number of walks, by default 1. ``joint_angles`` at the start, before disturbance, rad: one
        a joint, front to rear, one for all, or none for straight. ``rate``, samples per second, by default 100.
        ``forces``: whether the record has the force on every foot. ``engine``: one of
        :data:`chilopod.engine.ENGINES`, by default planar, or one's own as ``package.module:object``. ``controller``
        that steers, a frozen dataclass, see :class:`chilopod.trials.Trial`.

    Raises
    ------
    ParameterError
        If something is out of range, or memory cannot hold the record: :func:`ends` needs none.
    """
    trials = planned(robot, duration, **plan)
    record = together(run(trials, folder, progress))
    return Walks(trials, summaries(robot, record), straight(record), record)


def planned(robot: Robot, duration: float, **plan: Unpack[Plan]) -> tuple[Trial, ...]:
    """The trials of :func:`walk`, whose arguments these are.

    Raises
    ------
    ParameterError
        If something is out of range.
    """
    rest: dict[str, Any] = {**plan}
    angles, joints = tuple(rest.pop("joint_angles", ())), robot.body.modules - 1
    seed, repeats = rest.pop("seed", None), rest.pop("repeats", 1)
    if len(angles) == 1:
        angles *= joints
    if len(angles) not in (0, joints):
        raise ParameterError(
            f"are {len(angles)} angles", field="joint_angles", value=angles, allowed=f"{joints}, or one for all"
        )
    if not all(abs(angle) <= _MOST_BENT for angle in angles):
        raise ParameterError(
            "are bent too far", field="joint_angles", value=angles, allowed=f"{_MOST_BENT} rad (85 deg) to either side"
        )
    check_repeats(seed, repeats)
    return repeated(Trial(robot, duration, joint_angles=angles, **rest), seed, repeats)


def ends(
    trials: tuple[Trial, ...],
    folder: str | Path | None = None,
    progress: Progress = silent,
    told: Callable[[int, xr.Dataset], None] = lambda index, record: None,
) -> Ends:
    """Let robots walk and keep only what they came to: memory holds a batch of records, however many walks there are.

    Parameters
    ----------
    trials
        From :func:`planned`.
    folder, progress
        As for :func:`walk`.
    told
        Called with the number of a walk and its record as soon as that is there.
    """
    trials = tuple(as_now(trials))
    number = {trial.file_name: index for index, trial in enumerate(trials)}
    found: dict[int, WalkSummary] = {}
    unbent = True
    for trial, record in run_each(trials, folder, progress):
        index = number[trial.file_name]
        (found[index],) = summaries(trial.robot, record)
        unbent = unbent and straight(record)
        told(index, record)
    return Ends(trials, [found[index] for index in range(len(trials))], unbent)


def check_repeats(seed: int | None, repeats: int) -> None:
    """Make sure that there are walks, and that several differ.

    Raises
    ------
    ParameterError
        If not.
    """
    if repeats < 1:
        raise ParameterError("must be positive", field="repeats", value=repeats)
    if repeats > 1 and seed is None:
        raise ParameterError("are all alike without a seed", field="repeats", value=repeats, allowed="1, or a seed")


def repeated(trial: Trial, seed: int | None, repeats: int) -> tuple[Trial, ...]:
    """A trial so many times, disturbed with seeds that count up; once and undisturbed where the seed is None."""
    spread = NONE if seed is None else Disturbance()
    return tuple(replace(trial, seed=(seed or 0) + i, disturbance=spread) for i in range(repeats))


def foot_creep(robot: Robot, engine: str) -> float | None:
    """How firmly an engine's floor holds standing feet: the coefficient of viscous friction across the way that lets
    them creep as much, N*s/m; None where they do not creep, or the robot does not stand."""
    walks = engine_named(engine)
    if not isinstance(walks, HasFootCreep):
        return None
    found = walks.foot_creep(robot).across
    return found if np.isfinite(found) else None
