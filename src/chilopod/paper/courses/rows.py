"""Lines of the table on courses: measured results, without printed ones."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.paper.courses.robust import USUAL
from chilopod.paper.courses.summary import Summary, share_of_courses, share_of_targets, summaries, titled, verdicts
from chilopod.paper.table import Row, unprinted
from chilopod.show.words import listing
from chilopod.statistics import Interval
from chilopod.steering import VARIABLE

_WHERE = "section Conclusion and discussion"


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
    return [
        *(unprinted(f"{count}: {each.title}", _words(each), _WHERE, _remark(each)) for each in found.values()),
        unprinted(
            f"{count}: the variable spring",
            decisions(verdicts(found)),
            _WHERE,
            "where the intervals of 95 % decide it, for legs that yaw by 5 deg at most",
        ),
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
    """Decisions of :func:`chilopod.paper.courses.summary.verdicts`, in a sentence."""
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
