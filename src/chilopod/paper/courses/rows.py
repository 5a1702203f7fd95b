"""Summaries of courses, strategy by strategy, the decisions of their intervals, and lines of the table on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from chilopod.frozen import Array
from chilopod.paper.courses.study import USUAL
from chilopod.paper.table import Row, unprinted
from chilopod.show.words import listing
from chilopod.statistics import Answer, Estimate, Interval, difference, grouped_mean, ratio, share
from chilopod.steering import ON_COURSES, VARIABLE

_WHERE = "section Conclusion and discussion"

# Words for yes, undecided and no.
_REACH = ("reaches more targets than", "reaches as many, for all that can be told, as", "reaches fewer than")
_SPENT = (
    "spends less time for every target reached than",
    "spends as much, for all that can be told, as",
    "spends more than",
)
_LATER = (
    "is sooner at targets that both reach than",
    "is there as soon, for all that can be told, as",
    "is there later than",
)
_WORK = ("does less work than",)


@dataclass(frozen=True)
class Summary:
    """Summary of one strategy; a target that is not reached counts with its whole patience."""

    name: str
    spring: float  # that it walks with, N*mm/deg; NaN for none
    targets: Interval  # share that is reached
    courses: Interval  # share that is reached as a whole
    seconds: Interval  # for a target that is reached, s
    spent: Interval  # on all targets for every one that is reached, s, also where the robot has failed before
    later: Estimate  # mean difference to the variable spring's time, s, at targets that both reach
    spring_work: float  # mean work of the actuators of springs, J a course
    drive_work: float  # and of joints
    more_work: Estimate  # sum of both, less the variable spring's
    effort: float  # mean of the leg yaw, rad^2 s a course
    detour: float  # path over the shortest with circles of the radius law, of all targets reached together
    cost: float  # steering cost of transport

    @property
    def title(self) -> str:
        """Name, or the springs that it walks with."""
        return titled(self.name, self.spring)


def titled(name: str, spring: float) -> str:
    """Title of a strategy: its name, or its spring (N*mm/deg), which may lie on either side of the bifurcation of
    that name."""
    strategy = ON_COURSES[name]
    if strategy.springs is None or np.isnan(spring):
        return name
    return f"{'first spring' if strategy.springs.endswith(']') else 'all springs'} {spring:g}"


def summaries(data: xr.Dataset) -> dict[str, Summary]:
    """Summaries of all strategies of :func:`chilopod.paper.courses.study.compared`, by name."""
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
        seconds=grouped_mean(seconds).interval,
        spent=ratio(np.where(arrived, seconds, one.attrs["patience_s"]).sum(axis=1), arrived.sum(axis=1)).interval,
        later=grouped_mean(seconds - _reached(variable, "seconds")),
        spring_work=float(one.goal_spring_work.sum("goal").mean()),
        drive_work=float(one.goal_drive_work.sum("goal").mean()),
        more_work=difference(_work(one), _work(variable), paired=True),
        effort=float(one.goal_effort.sum("goal").mean()),
        detour=path / shortest if arrived.any() else float("nan"),
        cost=float(one.cost),
    )


def share_of_targets(arrived: xr.DataArray) -> Interval:
    """Share of targets that were reached, over (course, goal)."""
    return share(arrived.transpose("course", "goal").values > 0.5)


def share_of_courses(arrived: xr.DataArray) -> Interval:
    """Share of courses whose targets were all reached, over (course, goal)."""
    return share((arrived.transpose("course", "goal").values > 0.5).all(axis=1))


def _reached(one: xr.Dataset, name: str) -> Array:
    """Values over (course, goal), NaN where the target was not reached."""
    values = one[name].where(one.arrived > 0.5)
    return np.asarray(values.transpose("course", "goal").values)


def _work(one: xr.Dataset) -> Array:
    return np.asarray((one.goal_spring_work + one.goal_drive_work).sum("goal").values)


def verdicts(found: dict[str, Summary]) -> dict[str, list[str]]:
    """Decisions of the intervals on the variable spring beside the others: names of these by the words for it."""
    ours, others = found[VARIABLE.name], [each for name, each in found.items() if name != VARIABLE.name]
    answers: dict[tuple[str, ...], Callable[[Summary], Answer]] = {
        _REACH: lambda each: ours.targets.above(each.targets),
        _SPENT: lambda each: each.spent.above(ours.spent),
        _LATER: lambda each: each.later.above().answer,
        _WORK: lambda each: ON_COURSES[each.name].needs_torque and each.more_work.above().answer,
    }
    return {
        word: [each.title for each in others if answer(each) is wanted]
        for words, answer in answers.items()
        for word, wanted in zip(words, (True, None, False), strict=False)
    }


def percent(share: Interval) -> str:
    """A share with its interval."""
    return f"{100.0 * share.value:.1f} % ({100.0 * share.low:.1f} to {100.0 * share.high:.1f})"


def between(found: Interval, unit: str) -> str:
    """A number with its interval, if it is known."""
    bounds = f"{found.low:.1f} to {found.high:.1f}" if np.isfinite(found.low) else "interval not known"
    return f"{found.value:.1f} {unit} ({bounds})"


def compared_rows(data: xr.Dataset) -> list[Row]:
    """A line for every strategy, and the comparisons that the intervals decide."""
    found, where = summaries(data), "" if data.attrs["engine"] == "planar" else ", the whole robot"
    count = f"{data.sizes['course']} courses of {data.sizes['goal']} targets{where}"
    remark = "where the intervals of 95 % decide it, for legs that yaw by 5 deg at most"
    return [
        *(unprinted(f"{count}: {each.title}", _words(each), _WHERE, _remark(each)) for each in found.values()),
        unprinted(f"{count}: the variable spring", decisions(verdicts(found)), _WHERE, remark),
    ]


def _words(found: Summary) -> str:
    parts = [f"{percent(found.targets)} of targets, {percent(found.courses)} of courses"]
    if np.isfinite(found.seconds.value):
        parts.append(between(found.seconds, "s for a target that is reached"))
        parts.append(between(found.spent, "s spent for each"))
    if np.isfinite(found.later.value) and found.name != VARIABLE.name:
        parts.append(between(found.later.interval, "s later than the variable spring at targets that both reach"))
    return "; ".join(parts)


def _remark(found: Summary) -> str:
    remark = (
        f"a course: springs {found.spring_work:.2f} J, joints {found.drive_work:.2f} J, "
        f"leg yaw {found.effort:.2f} rad² s; steering cost of transport {found.cost:.2g}"
    )
    if np.isfinite(found.detour):
        remark += f", path {found.detour:.2f} of the shortest with circles as tight as the radius law knows"
    return remark


def decisions(found: dict[str, list[str]]) -> str:
    """Decisions of :func:`verdicts`, in a sentence."""
    return "; ".join(f"{words} {listing(names)}" for words, names in found.items() if names)


def robust_rows(steps: xr.Dataset, conditions: xr.Dataset) -> list[Row]:
    """Rows on each step of the law, and on courses under conditions that it does not know."""
    arrived = steps.arrived.transpose("case", "course", "goal")
    grown = "; ".join(
        f"{name} {percent(share_of_targets(each))}" for name, each in zip(steps.case.values, arrived, strict=True)
    )
    quantity = f"{steps.sizes['course']} courses, the law step by step: targets reached"
    return [unprinted(quantity, grown, _WHERE, "each beside those before"), *condition_rows(conditions)]


def condition_rows(data: xr.Dataset) -> list[Row]:
    """Targets and courses reached under every condition, by the variable spring and by one for all."""
    where = "" if data.attrs["engine"] == "planar" else ", the whole robot"
    rows = []
    for name in data.condition.values:
        words = []
        for strategy in data.strategy.values:
            arrived = data.arrived.sel(condition=name, strategy=strategy)
            targets, courses = percent(share_of_targets(arrived)), percent(share_of_courses(arrived))
            title = titled(str(strategy), data.attrs["spring"])
            words.append(f"{title} {targets} of targets, {courses} of courses")
        remark = "" if name == USUAL else "the law does not know"
        rows.append(unprinted(f"{data.sizes['course']} courses{where}, {name}", "; ".join(words), _WHERE, remark))
    return rows
