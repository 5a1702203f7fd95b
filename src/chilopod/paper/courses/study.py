"""Strategies on the same courses: a spring that is set on the way, one spring for all, none, and torques at all joints.

Courses are random, five targets each, and a course's seed is that of its disturbance too, so that strategies are
compared pair by pair. A strategy with one constant spring gets the best one, found on other courses. Further courses
tell what each step of the spring law contributes, and what the variable spring stands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

from chilopod import trials
from chilopod.analysis.parameters import PAPER_UNIT, stiffness
from chilopod.frozen import Array
from chilopod.paper.courses import bumps
from chilopod.paper.courses.steps import steps
from chilopod.paper.section import Context, Size
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.steering import ON_COURSES, VARIABLE, Course, Goal, SpringLaw, Verdict
from chilopod.tasks.course import Driver, driver, random_courses, steering_cost
from chilopod.trials import Disturbance, Trial

_SUMS = {
    "goal_path": "m",
    "goal_shortest": "m",
    "goal_effort": "rad^2*s",
    "goal_spring_work": "J",
    "goal_drive_work": "J",
}
_UNITS = {"arrived": "1", "seconds": "s", **_SUMS}
_TINY = Course((Goal(0.2, 0.03, relative=True),), patience=6.0)  # of the whole robot, whose walks take seconds

USUAL = "as usual"
"""Case that others are compared with."""

PLANAR_COURSES = (range(2000, 2200), range(2000, 2040), range(2000, 2001))
WHOLE_COURSES = (range(2000, 2020), range(2000, 2005), range(2000, 2001))
"""Seeds, by :class:`chilopod.paper.section.Size`."""

_FIXED = "pitchfork"
_OTHER_FIT = ("ground.friction=256.5 N*s/m", "legs.half_width=72.8 mm", "legs.forward_offset=48 mm")
"""Constants that meet the paper's numbers of the planar model nearly as well."""

_ACTUATOR = ("springs.rate=20 N*mm/deg/s", "springs.lag=0.5 s")


@dataclass(frozen=True)
class Plan:
    """Amount of trials: seeds of the courses that strategies are compared on, seeds of other courses on which the best
    spring of a strategy is found, and the springs that are tried, by strategy, N*mm/deg."""

    courses: range
    others: range
    springs: Mapping[str, Sequence[float]]


_FEW = {"pitchfork": (14, 16), "hopf": (7, 9)}
PLANAR: Mapping[Size, Plan] = {
    Size.FULL: Plan(range(1000, 2000), range(100), {"pitchfork": range(12, 21), "hopf": range(6, 12)}),
    Size.QUICK: Plan(range(1000, 1100), range(20), {"pitchfork": (13, 15, 17), "hopf": (7, 9)}),
    Size.TINY: Plan(range(1000, 1002), range(1), _FEW),
}
WHOLE: Mapping[Size, Plan] = {
    Size.FULL: Plan(range(1000, 1050), range(10), {"pitchfork": (20, 24, 28), "hopf": (11, 14, 17)}),
    Size.QUICK: Plan(range(1000, 1010), range(4), {"pitchfork": (20, 24, 28), "hopf": (11, 14, 17)}),
    Size.TINY: Plan(range(1000, 1001), range(0), {"pitchfork": (24,), "hopf": (11,)}),
}


@dataclass(frozen=True)
class Case:
    """Driver along courses, with a disturbance besides that of the course's seed."""

    name: str
    driver: Driver
    disturbance: Disturbance = field(default_factory=Disturbance)

    def on(self, course: Course, seed: int) -> Trial:
        """Trial of a course."""
        return replace(self.driver.trial(course, seed, brief=True), disturbance=self.disturbance)


def driven(context: Context, cases: Sequence[Case], seeds: Sequence[int], progress: Progress = silent) -> xr.Dataset:
    """Outcome of every target of random courses; if tiny, courses of the whole robot have one near target.

    Parameters
    ----------
    cases, seeds
        Drivers by name, all of the same patience, and seeds of the courses.

    Returns
    -------
    Dataset over (case, course, goal): ``arrived``, ``seconds`` (s), and, as in :func:`chilopod.steering.add_measures`,
    ``goal_path`` and ``goal_shortest`` (m), ``goal_effort`` (rad^2 s), ``goal_spring_work`` and ``goal_drive_work``
    (J); over (course, goal): ``bearing`` (rad) and ``away`` (m) of the target when it is put up.
    """
    engine = cases[0].driver.engine
    tiny = context.size is Size.TINY and engine != "planar"
    courses = [_TINY] * len(seeds) if tiny else random_courses(seeds, engine)
    asked = {
        (row, column): case.on(course, seed)
        for row, case in enumerate(cases)
        for column, (course, seed) in enumerate(zip(courses, seeds, strict=True))
    }
    shape = (len(cases), len(courses), len(courses[0].goals))
    values = {name: np.full(shape, np.nan) for name in _UNITS}
    where: dict[str, list[tuple[int, int]]] = {}
    for place, trial in asked.items():
        where.setdefault(trial.file_name, []).append(place)
    for trial, record in trials.run_each(list(asked.values()), context.folder, progress):
        for place in where[trial.file_name]:
            values["arrived"][place] = record.goal_verdict.values[0] == Verdict.ARRIVED.label
            values["seconds"][place] = record.goal_end.values[0] - record.goal_begin.values[0]
            for name in _SUMS:
                values[name][place] = record[name].values[0]
    seen = np.array([[(goal.x, goal.y) for goal in course.goals] for course in courses])
    over = ("case", "course", "goal")
    return xr.Dataset(
        {
            **{name: (over, each, {"units": _UNITS[name]}) for name, each in values.items()},
            "bearing": (over[1:], np.arctan2(seen[..., 1], seen[..., 0]), {"units": "rad"}),
            "away": (over[1:], np.hypot(seen[..., 0], seen[..., 1]), {"units": "m"}),
        },
        coords={"case": [each.name for each in cases], "course": list(seeds), "goal": np.arange(1, shape[2] + 1)},
        attrs={"robot": cases[0].driver.robot.name, "engine": engine, "patience_s": courses[0].patience},
    )


def compared(context: Context, variable: Driver, plan: Plan, progress: Progress = silent) -> xr.Dataset:
    """All strategies on the same courses; ``variable`` is the one of :func:`prepared`.

    Dataset of :func:`driven` with :data:`chilopod.steering.ON_COURSES` as cases, with their ``spring`` (N*mm/deg, NaN
    without one to choose) and ``cost``, the steering cost of transport of all courses. Over (tried): ``tried_case``,
    ``tried_spring`` (N*mm/deg), and ``tried_arrived``, the share of reached targets of other courses.
    """
    robot = robot_of(context, variable)
    tried = [(name, float(spring)) for name, springs in plan.springs.items() for spring in springs]
    shares = np.full(len(tried), np.nan)
    if len(plan.others) > 0:
        asked = [Case(f"{name} {k:g}", without_setting(robot, variable, name, k)) for name, k in tried]
        done = driven(context, asked, plan.others, part(progress, 0.0, 0.3, "springs"))
        shares = done.arrived.mean(("course", "goal")).values
    best = {name: _best(name, tried, shares) for name in plan.springs}
    cases = [
        Case(name, variable if name == VARIABLE.name else without_setting(robot, variable, name, best.get(name)))
        for name in ON_COURSES
    ]
    data = driven(context, cases, plan.courses, part(progress, 0.3, 1.0))
    costs = [steering_cost(case.driver.robot, data.isel(case=row)) for row, case in enumerate(cases)]
    springs = [best.get(name, np.nan) for name in ON_COURSES]
    return data.assign(
        cost=("case", np.array(costs), {"units": "1"}),
        spring=("case", np.array(springs), {"units": PAPER_UNIT}),
        tried_case=("tried", np.array([name for name, _ in tried], dtype=object)),
        tried_spring=("tried", np.array([spring for _, spring in tried]), {"units": PAPER_UNIT}),
        tried_arrived=("tried", shares, {"units": "1"}),
    )


def robot_of(context: Context, variable: Driver) -> Robot:
    """Robot of a driver of :func:`prepared`, without its variable spring."""
    return context.robot if variable.engine == "planar" else context.whole


def prepared(context: Context, engine: str = "planar") -> Driver:
    """Driver of the robot with the variable spring. A tiny report uses the law of the planar robot, which takes no
    walks."""
    if engine == "planar":
        return driver(context.robot, VARIABLE)
    if context.size is Size.TINY:
        walker = context.whole.override("springs.adjustable[0]", True)
        return replace(driver(context.robot, VARIABLE), robot=walker, engine=engine)
    return driver(context.whole, VARIABLE, engine=engine, folder=context.folder)


def without_setting(robot: Robot, variable: Driver, strategy: str, spring: float | None = None) -> Driver:
    """A strategy that sets no spring on the way, with its spring (N*mm/deg) if it has one."""
    law, plan = variable.law, ON_COURSES[strategy]
    ready = plan.prepare(robot, law, None if spring is None else stiffness(spring))
    return Driver(ready.robot, plan, ready.controller, law, variable.engine)


def _best(strategy: str, tried: Sequence[tuple[str, float]], shares: Array) -> float:
    """Spring of the highest share, N*mm/deg."""
    return max((share, k) for (name, k), share in zip(tried, np.nan_to_num(shares), strict=True) if name == strategy)[1]


@dataclass(frozen=True, eq=False)
class Robust:
    """Courses by the steps of the law (:func:`ablated`), or by all strategies of the whole robot
    (:func:`compared`), and under disturbed conditions (:func:`under`)."""

    courses: xr.Dataset
    conditions: xr.Dataset


@dataclass(frozen=True)
class Condition:
    """Condition that breaks an assumption of the law."""

    name: str  # in a few words
    changes: tuple[str, ...] = ()  # of the robot, as ``--set`` takes them; the law does not know
    disturbance: Disturbance = field(default_factory=Disturbance)  # besides what the course's seed draws
    engine: str = "planar"
    own_law: bool = False  # True if the law is made for what ``changes`` say, and drives the robot as it is
    only_variable: bool = False  # True if it concerns the actuator of the spring alone


def planar_conditions(robot: Robot) -> list[Condition]:
    """Conditions of the planar model."""
    friction, middle = robot.ground.friction, robot.body.modules // 2 - 1
    return [
        Condition(USUAL),
        Condition("friction × 0.7", (f"ground.friction={0.7 * friction!r} N*s/m",)),
        Condition("friction × 1.3", (f"ground.friction={1.3 * friction!r} N*s/m",)),
        Condition("a middle leg dead", disturbance=Disturbance(slick=(middle, 0))),
        Condition("a front leg dead", disturbance=Disturbance(slick=(0, 0))),
        Condition("bearings off by 3°", disturbance=Disturbance(bearing=float(np.deg2rad(3.0)))),
        Condition("30 % of looks missed", disturbance=Disturbance(missed=0.3)),
        Condition("the law of another fit", _OTHER_FIT, own_law=True, only_variable=True),
        Condition("a slow actuator", _ACTUATOR, only_variable=True),
    ]


def whole_conditions(robot: Robot) -> list[Condition]:
    """Conditions of the whole robot."""
    friction = robot.twin.sliding_friction if robot.twin else 1.0
    return [
        Condition(USUAL, engine="twin"),
        Condition("friction × 0.7", (f"twin.sliding_friction={0.7 * friction!r}",), engine="twin"),
        Condition("friction × 1.3", (f"twin.sliding_friction={1.3 * friction!r}",), engine="twin"),
        Condition(f"bumps of {1e3 * bumps.HEIGHT:g} mm", engine=f"{bumps.__name__}:BUMPS"),
    ]


def ablated(context: Context, variable: Driver, seeds: Sequence[int], progress: Progress = silent) -> xr.Dataset:
    """Courses by each step of the law, see :func:`chilopod.paper.courses.steps.steps`: the cases of
    :func:`driven` are its steps."""
    assert isinstance(variable.controller, SpringLaw)
    cases = [Case(name, replace(variable, controller=law)) for name, law in steps(variable.controller).items()]
    return driven(context, cases, seeds, progress)


def under(
    context: Context,
    variable: Driver,
    spring: float,
    conditions: Sequence[Condition],
    seeds: Sequence[int],
    progress: Progress = silent,
) -> xr.Dataset:
    """Courses under conditions that the law does not know of, by the variable spring and by one spring for all
    (N*mm/deg): as of :func:`driven`, but over (condition, strategy, course, goal). The
    engines of all conditions have the same patience."""
    robot, cases = robot_of(context, variable), []
    for condition in conditions:
        changed = robot.set_from_text(condition.changes)
        if condition.own_law:
            set_on_the_way = replace(variable, controller=driver(changed, VARIABLE).controller)
        else:
            set_on_the_way = replace(variable, robot=variable.robot.set_from_text(condition.changes))
        fixed = without_setting(robot if condition.only_variable else changed, variable, _FIXED, spring)
        for each in (set_on_the_way, fixed):
            cases.append(Case(condition.name, replace(each, engine=condition.engine), condition.disturbance))
    data = driven(context, cases, seeds, progress)
    over = ("condition", "strategy", "course", "goal")
    both = {
        name: (over, each.values.reshape(-1, 2, *each.shape[1:]), each.attrs)
        for name, each in data.data_vars.items()
        if "case" in each.dims
    }
    names = {"condition": [each.name for each in conditions], "strategy": [VARIABLE.name, _FIXED]}
    return xr.Dataset(both, names, {**data.attrs, "spring": spring}).merge(data.drop_dims("case"))
