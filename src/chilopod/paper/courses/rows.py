"""Lines of the table on courses: measured, and nothing that the paper prints."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.paper.courses.robust import USUAL
from chilopod.paper.courses.statistics import Interval
from chilopod.paper.courses.summary import (
    Summary,
    Verdicts,
    share_of_courses,
    share_of_targets,
    summaries,
    titled,
    verdicts,
)
from chilopod.paper.table import Result, Row, Verdict
from chilopod.show.words import listing
from chilopod.steering import VARIABLE

_WHERE = "section Conclusion and discussion"


def percent(share: Interval) -> str:
    """A share with its interval."""
    return f"{100.0 * share.value:.1f} % ({100.0 * share.low:.1f} to {100.0 * share.high:.1f})"


def between(found: Interval, unit: str) -> str:
    """A number with its interval."""
    return f"{found.value:.1f} {unit} ({found.low:.1f} to {found.high:.1f})"


def compared_rows(data: xr.Dataset) -> list[Row]:
    """A line for every strategy, and what the intervals decide between them."""
    found, where = summaries(data), "" if data.attrs["engine"] == "planar" else ", the whole robot"
    count = f"{data.sizes['course']} courses of {data.sizes['goal']} targets{where}"
    return [
        *(_row(f"{count}: {each.title}", _words(each), _remark(each)) for each in found.values()),
        _row(f"{count}: the variable spring", said(verdicts(found)), "where the intervals of 95 % decide it"),
    ]


def _words(found: Summary) -> str:
    parts = [f"{percent(found.targets)} of targets, {percent(found.courses)} of courses"]
    if np.isfinite(found.seconds.value):
        parts.append(between(found.seconds, "s for a target that is reached"))
        parts.append(between(found.spent, "s spent for each"))
    if np.isfinite(found.later.value) and found.name != VARIABLE.name:
        parts.append(between(found.later, "s later than the variable spring at targets that both reach"))
    return "; ".join(parts)


def _remark(found: Summary) -> str:
    parts = [
        f"a course: springs {found.spring_work:.2f} J, joints {found.drive_work:.2f} J, "
        f"leg yaw {found.effort:.2f} rad² s; steering cost of transport {found.cost:.2g}"
    ]
    if np.isfinite(found.detour):
        parts.append(f"path {found.detour:.2f} of the shortest with circles as tight as the radius law knows")
    return ", ".join(parts)


def said(found: Verdicts) -> str:
    """Decision of the intervals, in a sentence."""
    groups = {
        "reaches more targets than": found.fewer,
        "reaches as many, for all that can be told, as": found.as_many,
        "reaches fewer than": found.more,
        "spends less time for every target reached than": found.slower,
        "spends as much, for all that can be told, as": found.as_fast,
        "spends more than": found.faster,
        "is sooner at targets that both reach than": found.later,
        "is there as soon, for all that can be told, as": found.as_soon,
        "is there later than": found.sooner,
        "does less work than": found.costlier,
    }
    return "; ".join(f"{words} {listing(names)}" for words, names in groups.items() if names)


def robust_rows(steps: xr.Dataset, conditions: xr.Dataset) -> list[Row]:
    """Rows on each step of the law, and on courses under conditions that it does not know."""
    grown = "; ".join(
        f"{name} {percent(share_of_targets(each))}"
        for name, each in zip(steps.case.values, steps.arrived.transpose("case", "course", "goal"), strict=True)
    )
    return [
        _row(
            f"{steps.sizes['course']} courses, the law step by step: targets reached", grown, "each beside those before"
        ),
        *condition_rows(conditions),
    ]


def condition_rows(data: xr.Dataset) -> list[Row]:
    """Targets and courses reached under every condition, by the variable spring and by one for all."""
    where = "" if data.attrs["engine"] == "planar" else ", the whole robot"
    return [
        _row(
            f"{data.sizes['course']} courses{where}, {name}",
            "; ".join(
                f"{strategy} {percent(share_of_targets(one.arrived))} of targets, "
                f"{percent(share_of_courses(one.arrived))} of courses"
                for strategy, one in (
                    (titled(str(each), data.attrs["spring"]), data.sel(condition=name, strategy=each))
                    for each in data.strategy.values
                )
            ),
            "" if name == USUAL else "the law does not know",
        )
        for name in data.condition.values
    ]


def _row(quantity: str, computed: str, remark: str) -> Row:
    return Row(quantity, Verdict.NOT_PRINTED, Result(computed), _WHERE, Verdict.NOT_PRINTED, remark)
