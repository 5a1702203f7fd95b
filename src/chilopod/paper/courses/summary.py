"""Summaries of courses, strategy by strategy, and the decisions of their intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.paper.courses.statistics import Interval, bootstrap_mean, bootstrap_ratio, wilson
from chilopod.paper.scatter import Answer
from chilopod.steering import ON_COURSES, VARIABLE

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Summary:
    """Summary of one strategy.

    Attributes
    ----------
    name, spring
        The strategy's, and the one it walks with, N*mm/deg; NaN for none.
    targets, courses
        Shares that are reached, of courses as a whole.
    seconds
        For a target that is reached.
    spent
        On all targets, for every one that is reached, s; one that is not reached counts with its whole patience, also
        where the robot has failed before.
    later, course_later
        By how much later than the variable spring, s, at targets that both reach, and of courses that both reach as a
        whole; the mean of the differences.
    work
        Work of the actuators of springs and joints, J a course.
    spring_work, drive_work
        Its two parts, mean, J a course.
    more_work
        By how much more than the variable spring's it is, J a course.
    effort
        Effort of the leg yaw, mean, rad^2 s a course.
    detour
        Path over the shortest with circles of the radius law, of all targets that are reached together.
    cost
        Steering cost of transport.
    """

    name: str
    spring: float
    targets: Interval
    courses: Interval
    seconds: Interval
    spent: Interval
    later: Interval
    course_later: Interval
    work: Interval
    spring_work: float
    drive_work: float
    more_work: Interval
    effort: float
    detour: float
    cost: float

    @property
    def title(self) -> str:
        """Name, or the springs that it walks with."""
        return titled(self.name, self.spring)


def titled(name: str, spring: float) -> str:
    """Title of a strategy: its name, or the spring (N*mm/deg) that it walks with. On courses the best spring of a
    strategy may lie on either side of the bifurcation that it is named for."""
    strategy = ON_COURSES[name]
    if strategy.springs is None or np.isnan(spring):
        return name
    return f"{'first spring' if strategy.springs.endswith(']') else 'all springs'} {spring:g}"


def summaries(data: xr.Dataset) -> dict[str, Summary]:
    """Summaries of all strategies, by name.

    Parameters
    ----------
    data
        See :func:`chilopod.paper.courses.study.compared`.
    """
    variable = data.sel(case=VARIABLE.name)
    return {str(name): _summary(data.sel(case=name), variable) for name in data.case.values}


def _summary(one: xr.Dataset, variable: xr.Dataset) -> Summary:
    arrived, seconds = one.arrived.transpose("course", "goal").values > 0.5, _reached(one, "seconds")
    path, shortest = (float(np.nansum(_reached(one, f"goal_{name}"))) for name in ("path", "shortest"))
    return Summary(
        name=str(one.case.values),
        spring=float(one.spring),
        targets=share_of_targets(one.arrived),
        courses=share_of_courses(one.arrived),
        seconds=bootstrap_mean(seconds),
        spent=bootstrap_ratio(np.where(arrived, seconds, one.attrs["patience_s"]).sum(axis=1), arrived.sum(axis=1)),
        later=bootstrap_mean(seconds - _reached(variable, "seconds")),
        course_later=bootstrap_mean((seconds - _reached(variable, "seconds")).sum(axis=1)),
        work=bootstrap_mean(_work(one)),
        spring_work=float(one.goal_spring_work.sum("goal").mean()),
        drive_work=float(one.goal_drive_work.sum("goal").mean()),
        more_work=bootstrap_mean(_work(one) - _work(variable)),
        effort=float(one.goal_effort.sum("goal").mean()),
        detour=path / shortest if arrived.any() else float("nan"),
        cost=float(one.cost),
    )


def share_of_targets(arrived: xr.DataArray) -> Interval:
    """Share of targets that were reached, over (course, goal)."""
    reached = arrived.values > 0.5
    return wilson(int(reached.sum()), reached.size)


def share_of_courses(arrived: xr.DataArray) -> Interval:
    """Share of courses whose targets were all reached, over (course, goal)."""
    whole = (arrived.transpose("course", "goal").values > 0.5).all(axis=1)
    return wilson(int(whole.sum()), whole.size)


def _reached(one: xr.Dataset, name: str) -> Array:
    """Over (course, goal), NaN where the target was not reached."""
    values = one[name].where(one.arrived > 0.5)
    return np.asarray(values.transpose("course", "goal").values)


def _work(one: xr.Dataset) -> Array:
    return np.asarray((one.goal_spring_work + one.goal_drive_work).sum("goal").values)


@dataclass(frozen=True)
class Verdicts:
    """Decisions of the intervals, each by the names of strategies that the variable spring is held against.

    Attributes
    ----------
    fewer, as_many, more
        Numbers of groups that reach fewer targets, that cannot be told apart, and that reach more.
    slower, as_fast, faster
        In the time spent for every target that is reached.
    later, as_soon, sooner
        At targets that both reach.
    costlier
        Number of groups that do more work, of those that do any.
    """

    fewer: Sequence[str]
    as_many: Sequence[str]
    more: Sequence[str]
    slower: Sequence[str]
    as_fast: Sequence[str]
    faster: Sequence[str]
    later: Sequence[str]
    as_soon: Sequence[str]
    sooner: Sequence[str]
    costlier: Sequence[str]


def verdicts(found: dict[str, Summary]) -> Verdicts:
    """Decisions on the variable spring beside the others."""
    ours, others = found[VARIABLE.name], [each for name, each in found.items() if name != VARIABLE.name]
    reach = _decided(others, lambda each: ours.targets.above(each.targets))
    spent = _decided(others, lambda each: each.spent.above(ours.spent))
    time = _decided(others, lambda each: each.later.sign)
    work = _decided(others, lambda each: each.more_work.sign)
    costlier = [each.title for each in others if ON_COURSES[each.name].needs_torque and each.title in work[0]]
    return Verdicts(*reach, *spent, *time, costlier)


def _decided(others: Sequence[Summary], asked: Callable[[Summary], Answer]) -> tuple[list[str], list[str], list[str]]:
    """Strategies for which the answer is yes, open, and no."""
    yes, open_, no = ([each.title for each in others if asked(each) is answer] for answer in (True, None, False))
    return yes, open_, no
