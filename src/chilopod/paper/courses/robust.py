"""Contribution of each step of the spring law, and robustness of the variable spring to disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

from chilopod.paper.courses import bumps
from chilopod.paper.courses.steps import steps
from chilopod.paper.courses.study import Case, driven, robot_of, without_setting
from chilopod.paper.section import Context
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import VARIABLE, SpringLaw
from chilopod.tasks.course import Driver, driver
from chilopod.trials import Disturbance

USUAL = "as usual"
"""Case that others are compared with."""

PLANAR_COURSES = (range(2000, 2200), range(2000, 2040), range(2000, 2001))
WHOLE_COURSES = (range(2000, 2020), range(2000, 2005), range(2000, 2001))
"""Seeds, by :class:`chilopod.paper.section.Size`."""

_FIXED = "pitchfork"
_OTHER_FIT = ("ground.friction=256.5 N*s/m", "legs.half_width=72.8 mm", "legs.forward_offset=48 mm")
"""Constants that meet the paper's numbers of the planar model nearly as well."""

_ACTUATOR = ("springs.rate=20 N*mm/deg/s", "springs.lag=0.5 s")


@dataclass(frozen=True, eq=False)
class Robust:
    """Courses by the steps of the law (:func:`ablated`), or by all strategies of the whole robot
    (:func:`chilopod.paper.courses.study.compared`), and under disturbed conditions (:func:`under`)."""

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
    :func:`chilopod.paper.courses.study.driven` are its steps."""
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
    (N*mm/deg): as of :func:`chilopod.paper.courses.study.driven`, but over (condition, strategy, course, goal). The
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
