"""Courses: targets one after another, walked with a strategy, and what became of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from chilopod.engine import Controller, engine_named
from chilopod.engine.named import check_controller, path_of
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Short
from chilopod.notebook import block, table, words
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import (
    Course,
    RadiusLaw,
    Strategy,
    Verdict,
    random_course,
)
from chilopod.tasks.radius_law import radius_law
from chilopod.tasks.shown import paths
from chilopod.tasks.walk import check_repeats, foot_creep, repeated
from chilopod.trials import NONE, Trial, check_fits, run

GRAVITY = 9.81
"""m/s^2"""

_RATE = 20.0  # Hz, of records: looks of the referee fall on samples
_PATIENCE = 25.0  # s for a target, of an engine whose walks are as fast as the straight walk without slip


@dataclass(frozen=True)
class Driver(Short):
    """A robot made ready for courses.

    Attributes
    ----------
    robot
        With the springs of the strategy, and the actuator that it needs.
    strategy
        As given to :func:`drive`.
    controller
        Controller of the walk; None without steering.
    law
        The robot's radius law; None where it has none and the strategy needs none.
    engine
        Name of the engine that the law belongs to and that walks.
    remarks
        Remarks on the result, a sentence each.
    """

    robot: Robot
    strategy: Strategy
    controller: Controller | None
    law: RadiusLaw | None
    engine: str
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Driven(Short):
    """Walks along a course, and what became of its targets.

    Attributes
    ----------
    driver
        Driver of the walks.
    course
        As given to :func:`drive`.
    trials
        With all that makes each walk.
    records
        Records of every walk, up to where it ended, see :func:`chilopod.steering.of_course`.
    """

    driver: Driver
    course: Course
    trials: tuple[Trial, ...]
    records: tuple[xr.Dataset, ...]

    @property
    def robot(self) -> Robot:
        """Robot that walked."""
        return self.driver.robot

    @property
    def engine(self) -> str:
        """Name of the engine."""
        return self.driver.engine

    @property
    def strategy(self) -> Strategy:
        """Strategy of the walk."""
        return self.driver.strategy

    @property
    def pitchfork(self) -> float | None:
        """First spring below which the straight walk bends, N*m/rad; None where it is not known."""
        return self.driver.law.pitchfork if self.driver.law else None

    @cached_property
    def record(self) -> xr.Dataset:
        """Record of all walks together, NaN from where each ended."""
        longest = max(self.records, key=lambda each: each.sizes.get("time", 0))
        joined = xr.concat(
            self.records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="outer"
        ).assign_coords(robot=np.arange(len(self.records)))
        return joined.assign(within=longest.within) if "within" in longest else joined

    @cached_property
    def foot_creep(self) -> float | None:
        """See :func:`chilopod.tasks.walk.foot_creep`."""
        return foot_creep(self.robot, self.engine)

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; null for what there is not."""
        first = self.trials[0]
        return {
            "robot": self.robot.name,
            "engine": self.engine,
            "strategy": self.strategy.name,
            "controller": None if first.controller is None else path_of(type(first.controller)),
            "patience_s": self.course.patience,
            "tightest_radius_m": self.course.tightest,
            "pitchfork_N_m_rad": self.pitchfork,
            "remarks": list(self.driver.remarks),
            "walks": [_walk_json(*each) for each in zip(self.trials, self.records, strict=True)],
            "foot_creep_N_s_m": self.foot_creep,
        }

    def _repr_html_(self) -> str:
        goals = self.record.sizes["goal"]
        rows = []
        for trial, record in zip(self.trials, self.records, strict=True):
            ends = record.goal_end.values
            rows.append(
                (
                    "-" if trial.disturbance == NONE else trial.seed,
                    f"{int((record.goal_verdict == Verdict.ARRIVED.label).sum())} of {goals}",
                    f"{np.nanmax(ends):.1f}" if np.isfinite(ends).any() else "-",
                )
            )
        return block(
            f"{self.robot.name}, {self.engine}: a course of {goals} targets by {self.strategy.name}",
            paths(self.record),
            *(words(remark) for remark in self.driver.remarks),
            table(("seed", "targets reached", "after (s)"), rows),
        )


def _walk_json(trial: Trial, record: xr.Dataset) -> dict[str, Any]:
    def plain(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    sentences = {verdict.label: verdict.sentence for verdict in Verdict}
    goals = []
    for goal in record.isel(robot=0).transpose("goal", ...).goal.values:
        found = record.isel(robot=0).sel(goal=goal)
        verdict = str(found.goal_verdict.item())
        goals.append(
            {
                "verdict": verdict,
                "sentence": sentences[verdict],
                "place_m": [plain(each) for each in found.goal_place.values],
                "begin_s": plain(found.goal_begin.item()),
                "end_s": plain(found.goal_end.item()),
                "nearest_m": plain(found.goal_nearest.item()),
                "path_m": plain(found.goal_path.item()),
                "shortest_m": plain(found.goal_shortest.item()),
                "leg_yaw_effort_rad2_s": plain(found.goal_effort.item()),
                "spring_work_J": plain(found.goal_spring_work.item()),
                "drive_work_J": plain(found.goal_drive_work.item()),
            }
        )
    return {
        "seed": None if trial.disturbance == NONE else trial.seed,
        "status": str(record.status.values[0]),
        "arrived": int((record.goal_verdict == Verdict.ARRIVED.label).sum()),
        "time_s": plain(float(np.nanmax(record.goal_end.values))),
        "spring_work_J": float(record.goal_spring_work.sum()),
        "drive_work_J": float(record.goal_drive_work.sum()),
        "steering_cost_of_transport": plain(steering_cost(trial.robot, record)),
        "targets": goals,
    }


def steering_cost(robot: Robot, record: xr.Dataset) -> float:
    """Work that the spring's actuator and the joints' torques did on a course, over weight and way: the part of the
    cost of transport that steering adds to walking. NaN of a robot that went nowhere."""
    work = float(record.goal_spring_work.sum() + record.goal_drive_work.sum())
    way = float(record.goal_path.sum())
    return work / (robot.body.mass * GRAVITY * way) if way > 0.0 else np.nan


def driver(
    robot: Robot,
    strategy: Strategy,
    spring: float | None = None,
    *,
    engine: str = "planar",
    controller: Controller | None = None,
    law: RadiusLaw | None = None,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> Driver:
    """Make a robot ready for courses.

    Parameters
    ----------
    robot
        The robot.
    strategy
        One of :data:`chilopod.steering.ON_COURSES`.
    spring
        Spring with which the strategies ``pitchfork`` and ``hopf`` walk, N*m/rad.
    engine
        Engine of the radius law, see :func:`chilopod.tasks.radius_law`.
    controller
        In place of the strategy's.
    law
        The robot's radius law, where it is known already.
    folder
        Folder of the trials of the radius law.
    progress
        Called with the part done (0 to 1) and a few words.

    Raises
    ------
    ParameterError
        If the strategy wants a spring and has none, or has one and wants none; if the spring has no actuator.
    AnalysisError
        If the strategy stands on the pitchfork and the robot has none.
    """
    strategy.fitted(robot, spring)  # refuses before the law takes its time
    unknown: tuple[str, ...] = ()
    try:
        law = law or radius_law(robot, engine, folder, progress)
    except AnalysisError as error:
        if strategy.needs_law and controller is None:
            raise AnalysisError(
                f"the strategy {strategy.name} stands on how tightly the first spring turns the robot: {error.problem}",
                allowed="a robot that bends (narrower, softer behind, with a longer stride), or the strategy leg-yaw",
            ) from error
        unknown = (f"how tightly the robot turns is not known, so shortest paths are straight lines: {error.problem}",)
    ready = strategy.prepare(robot, law, spring, controller)
    return Driver(ready.robot, strategy, ready.controller, law, engine, (*unknown, *ready.remarks))


def drive(
    driver: Driver,
    course: Course,
    *,
    seed: int | None = None,
    repeats: int = 1,
    engine: str | None = None,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> Driven:
    """Let a robot walk a course.

    Parameters
    ----------
    driver
        The robot and what steers it.
    course
        With any radius of the tightest circle: that of the robot takes its place where it is known.
    seed, repeats, folder, progress
        As for :func:`chilopod.tasks.walk`.
    engine
        Name of the driver's engine, which is also the default.

    Raises
    ------
    ParameterError
        If memory cannot hold the records, or something is out of range.
    """
    if engine not in (None, driver.engine):
        raise ParameterError(
            "the driver was made ready for another engine", field="engine", value=engine, allowed=driver.engine
        )
    engine = driver.engine
    check_drive(driver.robot, course, seed=seed, repeats=repeats, engine=engine)
    if driver.controller is not None:
        check_controller(driver.controller)
    if driver.law is not None:
        course = replace(course, tightest=driver.law.tightest)
    trials = repeated(trial_of(driver, course, poses=engine_named(engine).traits.poses), seed, repeats)
    records = run(trials, folder, progress)
    return Driven(driver, course, trials, tuple(records))


def check_drive(
    robot: Robot, course: Course, *, seed: int | None = None, repeats: int = 1, engine: str = "planar"
) -> None:
    """Refuse what :func:`drive` would refuse of a robot, before :func:`driver` takes its time.

    Raises
    ------
    ParameterError
        If the engine does not know such a robot, several walks are all alike, or memory cannot hold their records.
    """
    check_repeats(seed, repeats)
    one = Trial(robot, course.duration, target=course, rate=_RATE, engine=engine)
    check_fits([one] * repeats)


def trial_of(driver: Driver, course: Course, seed: int = 0, *, poses: bool = False, brief: bool = False) -> Trial:
    """The trial of a course, with the disturbance that all studies have."""
    return Trial(
        driver.robot,
        course.duration,
        seed,
        target=course,
        controller=driver.controller,
        rate=_RATE,
        engine=driver.engine,
        poses=poses,
        brief=brief,
    )


def patience_of(engine: str) -> float:
    """For one target, s: more than a minute where walks slip, 40 s in the planar model."""
    return _PATIENCE * engine_named(engine).traits.haste


def random_courses(seeds: Sequence[int], engine: str = "planar") -> list[Course]:
    """Random courses of five targets, see :func:`chilopod.steering.random_course`, with the engine's patience."""
    return [random_course(seed, patience_of(engine)) for seed in seeds]
