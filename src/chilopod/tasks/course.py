"""Walks along courses of targets with a strategy, and the outcome of each target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Unpack, cast

import numpy as np
import xarray as xr

from chilopod.engine import Controller, engine_named
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Short
from chilopod.notebook import finite
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import Course, RadiusLaw, Strategy, Verdict, random_course
from chilopod.steering.strategies import check_strategy
from chilopod.tasks.radius_law import radius_law
from chilopod.tasks.walk import Pathed, RunOptions, runs
from chilopod.trials import Trial

_RATE = 20.0  # Hz, of records: looks of the referee fall on samples
_PATIENCE = 25.0  # s for a target, of an engine whose walks are as fast as the straight walk without slip
_OF_GOALS = {
    "begin": "begin_s",
    "end": "end_s",
    "nearest": "nearest_m",
    "path": "path_m",
    "shortest": "shortest_m",
    "effort": "leg_yaw_effort_rad2_s",
    "spring_work": "spring_work_J",
    "drive_work": "drive_work_J",
}


@dataclass(frozen=True)
class Driver(Short):
    """Robot prepared for courses.

    Attributes
    ----------
    robot, strategy, controller
        Robot with the springs and the actuator of the strategy; strategy; controller, None without steering.
    law, engine
        Radius law of the robot, or None if it has none and needs none; name of the engine of law and walks.
    remarks
        Remarks on the result, a sentence each.
    """

    robot: Robot
    strategy: Strategy
    controller: Controller | None
    law: RadiusLaw | None
    engine: str
    remarks: tuple[str, ...] = ()

    def trial(self, course: Course, seed: int = 0, *, poses: bool = False, brief: bool = False) -> Trial:
        """Trial of a course, with the disturbance of all studies, and with the robot's tightest circle if known."""
        if not isinstance(course, Course):
            allowed = 'a Course, such as chilopod.steering.course_named("slalom", 40.0)'
            raise ParameterError("must be a course", field="course", value=course, allowed=allowed)
        goals = course if self.law is None else replace(course, tightest=self.law.tightest)
        conditions = self.robot, course.duration, seed, (), goals, self.controller
        return Trial(*conditions, rate=_RATE, engine=self.engine, poses=poses, brief=brief)


@dataclass(frozen=True)
class Driven(Pathed):
    """Walks along a course by a driver; records up to the end of each, see :func:`chilopod.steering.add_measures`."""

    driver: Driver
    records: tuple[xr.Dataset, ...]

    @property
    def course(self) -> Course:
        """Course with the radius of the robot's tightest circle."""
        return cast(Course, self.first.target)

    @property
    def strategy(self) -> Strategy:
        """Strategy of the walk."""
        return self.driver.strategy

    @property
    def pitchfork(self) -> float | None:
        """First spring below which the straight walk bends, N*m/rad; None if unknown."""
        return self.driver.law.pitchfork if self.driver.law else None

    @cached_property
    def record(self) -> xr.Dataset:
        """Record of all walks together, NaN after the end of each."""
        longest = max(self.records, key=lambda each: each.sizes.get("time", 0))
        how: Any = {"data_vars": "minimal", "coords": "minimal", "compat": "override", "join": "outer"}
        joined = xr.concat(self.records, "robot", **how).assign_coords(robot=np.arange(len(self.records)))
        return joined.assign(within=longest.within) if "within" in longest else joined

    def _found(self) -> dict[str, Any]:
        walks = zip(self.trials, self.seeds, self.records, strict=True)
        return {
            "strategy": self.strategy.name,
            "patience_s": self.course.patience,
            "tightest_radius_m": self.course.tightest,
            "pitchfork_N_m_rad": self.pitchfork,
            "remarks": list(self.driver.remarks),
            "walks": [{"seed": seed, **_walk_json(trial.robot, record)} for trial, seed, record in walks],
        }

    @property
    def title(self) -> str:
        """Robot, engine and strategy in words."""
        return f"{self.who}, {self.strategy.name}: {self.strategy.sentence}"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        walks, goals = self._found()["walks"], len(self.course.goals)
        above = [f"{goals} target{'s' * (goals > 1)}, {self.course.patience:g} s for each", *self.driver.remarks]
        missed = {each["verdict"]: each["sentence"] for walk in walks for each in walk["targets"]}
        below = [f"{verdict}: {words}" for verdict, words in missed.items() if verdict != Verdict.ARRIVED.label]
        if len(walks) == 1:
            (walk,) = walks
            work = f"work {walk['spring_work_J']:.3g} J on springs, {walk['drive_work_J']:.3g} J by drives"
            part = f"steering's part of the cost of transport {_shown(walk['steering_cost_of_transport'])}"
            below.append(f"{walk['arrived']} of {goals} targets in {walk['time_s']:.1f} s; {work}; {part}")
            return above, _of_targets(walk["targets"]), below
        reached = [walk["arrived"] for walk in walks]
        whole = f"{reached.count(goals)} of {len(walks)} courses whole"
        below.append(f"{sum(reached)} of {len(walks) * goals} targets, {whole}")
        return above, _of_walks(walks, goals), below


def _of_targets(goals: list[dict[str, Any]]) -> list[Sequence[str]]:
    head = "target", "verdict", "time (s)", "path / shortest", "leg yaw (rad2 s)", "springs (J)", "drives (J)"
    rows: list[Sequence[str]] = [head]
    for number, goal in enumerate(goals, 1):
        cells = ["-"] * 5  # of a target that was never set
        if goal["path_m"]:
            cells = [f"{goal['end_s'] - goal['begin_s']:.1f}", f"{goal['path_m']:.2f} / {goal['shortest_m']:.2f} m"]
            cells.append(f"{goal['leg_yaw_effort_rad2_s']:.4f}")
            cells += [f"{goal[f'{which}_work_J']:.3f}" for which in ("spring", "drive")]
        rows.append((str(number), goal["verdict"], *cells))
    return rows


def _of_walks(walks: list[dict[str, Any]], goals: int) -> list[Sequence[str]]:
    head = "seed", "targets", "time (s)", "springs (J)", "drives (J)", "cost of transport", "status"
    rows: list[Sequence[str]] = [head]
    for walk in walks:
        seed = "-" if walk["seed"] is None else str(walk["seed"])
        works = [f"{walk[f'{which}_work_J']:.3f}" for which in ("spring", "drive")]
        cost = _shown(walk["steering_cost_of_transport"])
        rows.append((seed, f"{walk['arrived']} of {goals}", f"{walk['time_s']:.1f}", *works, cost, walk["status"]))
    return rows


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"


def _walk_json(robot: Robot, record: xr.Dataset) -> dict[str, Any]:
    sentences = {verdict.label: verdict.sentence for verdict in Verdict}
    goals = []
    for goal in record.goal.values:
        found = record.isel(robot=0).sel(goal=goal)
        verdict, place = str(found.goal_verdict.item()), [finite(each) for each in found.goal_place.values]
        measures = {key: finite(found[f"goal_{name}"].item()) for name, key in _OF_GOALS.items()}
        goals.append({"verdict": verdict, "sentence": sentences[verdict], "place_m": place, **measures})
    return {
        "status": str(record.status.values[0]),
        "arrived": int((record.goal_verdict == Verdict.ARRIVED.label).sum()),
        "time_s": finite(float(np.nanmax(record.goal_end.values))),
        "spring_work_J": float(record.goal_spring_work.sum()),
        "drive_work_J": float(record.goal_drive_work.sum()),
        "steering_cost_of_transport": finite(steering_cost(robot, record)),
        "targets": goals,
    }


def steering_cost(robot: Robot, record: xr.Dataset) -> float:
    """Work of the spring's actuator and the joint torques on a course, divided by weight and path length: the part of
    the cost of transport that steering adds to walking. NaN for a robot that did not move."""
    work = float(record.goal_spring_work.sum() + record.goal_drive_work.sum())
    way = float(record.goal_path.sum())
    return work / (robot.weight * way) if way > 0.0 else np.nan


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
    """Prepare a robot for courses.

    ParameterError or AnalysisError if the strategy needs a spring and has none, or has one and needs none; if the
    spring has no actuator; if the strategy needs the pitchfork and the robot has none.

    Parameters
    ----------
    robot, strategy
        Robot, and one of :data:`chilopod.steering.ON_COURSES`.
    spring
        Spring with which the strategies ``pitchfork`` and ``hopf`` walk, N*m/rad.
    engine, folder, progress
        As for :func:`chilopod.tasks.radius_law`.
    controller, law
        Controller in place of the strategy's, and radius law if already computed.
    """
    check_strategy(strategy)
    strategy.fitted(robot, spring)  # refuses wrong arguments before the slow law
    unknown: tuple[str, ...] = ()
    try:
        law = law or radius_law(robot, engine, folder, progress)
    except AnalysisError as error:
        if strategy.needs_law and controller is None:
            problem = f"strategy {strategy.name} needs a radius law of the first spring"
            allowed = "a robot that bends gently (narrower, softer behind, with a longer stride)"
            allowed = f"{allowed}, the strategy pitchfork with a spring, or the strategy leg-yaw"
            raise AnalysisError(f"{problem}: {error.problem}", allowed=allowed) from error
        unknown = (f"how tightly the robot turns is not known, so shortest paths are straight lines: {error.problem}",)
    ready = strategy.prepare(robot, law, spring, controller)
    return Driver(ready.robot, strategy, ready.controller, law, engine, (*unknown, *ready.remarks))


def drive(driver: Driver, course: Course, **options: Unpack[RunOptions]) -> Driven:
    """Run a robot along a course, with any radius of the tightest circle, see :meth:`Driver.trial`, and with
    :class:`chilopod.tasks.RunOptions`. Raises ParameterError if memory cannot hold the records."""
    trial = driver.trial(course, poses=engine_named(driver.engine).traits.poses)
    trials, records = runs(trial, **options)
    return Driven(trials, driver, tuple(records))


def patience_of(engine: str) -> float:
    """Patience for one target, s: 40 s in the planar model, more than a minute where feet slip."""
    return _PATIENCE * engine_named(engine).traits.duration_ratio


def random_courses(seeds: Sequence[int], engine: str = "planar") -> list[Course]:
    """Random courses of five targets, see :func:`chilopod.steering.random_course`, with the engine's patience."""
    return [random_course(seed, patience_of(engine)) for seed in seeds]
