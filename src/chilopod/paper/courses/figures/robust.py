"""Courses: what each step of the spring law brings, and what the variable spring stands."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chilopod.paper.courses.figures.courses import intervals
from chilopod.paper.courses.robust import USUAL, Robust
from chilopod.paper.courses.rows import percent
from chilopod.paper.courses.summary import share_of_courses, share_of_targets
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import listing, spring
from chilopod.steering import VARIABLE

_BOTH = (style.Layout("AB", 4.0, widths=(0.8, 1.0)), style.Layout("A;B", 8.4, heights=(0.6, 1.0)))
_ONE = (style.Layout("A", 2.8), style.Layout("A", 3.4))
_STEP_TITLES = (
    "spring of\nthe circle",
    "+ the bend\nthere is",
    "+ looking for\nwhat is lost",
    "+ straightening\nfor what is near",
    "+ a place ahead",
)


def panel(found: Robust) -> Panel:
    """Steps of the law, and conditions that it does not know of, in the planar model."""
    steps, conditions = found.steps, found.conditions
    grown = listing(f"{name} {percent(share_of_targets(steps.arrived.sel(case=name)))}" for name in steps.case.values)
    return Panel(
        name="courses-robust",
        title="What the spring law owes to its steps, and what it stands",
        draw=lambda narrow: _draw(found, narrow),
        alt="A: targets and courses reached by the law as it grew. B: the same under conditions that the law does not "
        "know of, beside one spring for all of a course.",
        text=(
            f"A: targets reached on {steps.sizes['course']} courses by the law step by step, each with what those "
            f"before have: {grown}.",
            f"B: the finished law on {conditions.sizes['course']} courses whose conditions it does not know of. "
            + _said(conditions),
        ),
        data=conditions,
    )


def whole(conditions: xr.Dataset) -> Panel:
    """Conditions of the whole robot."""
    return Panel(
        name="robot-courses-robust",
        title="What the spring that is set on the way stands: the robot in three dimensions",
        draw=lambda narrow: _draw_whole(conditions, narrow),
        alt="Targets and courses reached under several conditions, with the spring that is set on the way and with one "
        "for all.",
        text=(f"{conditions.sizes['course']} courses under each condition. " + _said(conditions),),
        data=conditions,
    )


def _said(data: xr.Dataset) -> str:
    """Decisions of the intervals on every condition."""
    ours = data.sel(strategy=VARIABLE.name)
    usual = share_of_targets(ours.sel(condition=USUAL).arrived)
    worse, better = [], []
    for name in data.condition.values:
        share = share_of_targets(ours.sel(condition=name).arrived)
        if usual.above(share) is True:
            worse.append(f"{name} ({percent(share)})")
        (other,) = (each for each in data.strategy.values if each != VARIABLE.name)
        if share.above(share_of_targets(data.sel(condition=name, strategy=other).arrived)) is True:
            better.append(str(name))
    fixed = spring(data.attrs["spring"], 2)
    return (
        f"As usual it reaches {percent(usual)} of targets; "
        + (f"clearly fewer with {listing(worse)}" if worse else "clearly fewer under none of these conditions")
        + f". It reaches more than {fixed} all along "
        + (
            "under every one of them."
            if len(better) == data.sizes["condition"]
            else f"beyond doubt under these: {listing(better)}."
            if better
            else "beyond doubt under none."
        )
    )


def _draw(found: Robust, narrow: bool) -> Figure:
    figure, axes = style.figure(*_BOTH, narrow)
    arrived = [found.steps.arrived.isel(case=row) for row in range(found.steps.sizes["case"])]
    rows = np.arange(len(arrived), dtype=np.float64)
    targets, courses = ([share(each) for each in arrived] for share in (share_of_targets, share_of_courses))
    intervals(axes["A"], targets, rows - 0.12, style.BLUE, "o", "targets", 100.0)
    intervals(axes["A"], courses, rows + 0.12, style.ORANGE, "s", "whole courses", 100.0)
    axes["A"].set_yticks(rows, list(_STEP_TITLES[: len(rows)]))
    _scaled(axes["A"], len(rows), "A  The law, step by step")
    _conditions(axes["B"], found.conditions, "B  Under other conditions")
    figure.legend(*axes["B"].get_legend_handles_labels(), loc="outside lower center", ncols=1 if narrow else 4)
    return figure


def _draw_whole(data: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(*_ONE, narrow)
    _conditions(axes["A"], data, "")
    figure.legend(*axes["A"].get_legend_handles_labels(), loc="outside lower center", ncols=1 if narrow else 4)
    return figure


def _conditions(axes: Axes, data: xr.Dataset, title: str) -> None:
    rows = np.arange(data.sizes["condition"], dtype=np.float64)
    for strategy, fill, shift in zip(data.strategy.values, (1.0, 0.45), (-0.15, 0.15), strict=True):
        arrived = [data.arrived.sel(strategy=strategy, condition=each) for each in data.condition.values]
        label = "k₁ set on the way" if strategy == VARIABLE.name else f"k₁ = {data.attrs['spring']:g}"
        for share, color, marker, what in (
            (share_of_targets, style.BLUE, "o", "targets"),
            (share_of_courses, style.ORANGE, "s", "courses"),
        ):
            intervals(
                axes, [share(each) for each in arrived], rows + shift, color, marker, f"{label}, {what}", 100.0, fill
            )
    axes.set_yticks(rows, [str(each) for each in data.condition.values])
    _scaled(axes, len(rows), title)


def _scaled(axes: Axes, rows: int, title: str) -> None:
    axes.set(xlim=(-3.0, 103.0), ylim=(rows - 0.5, -0.5), xlabel="reached (%)", title=title)
    style.grid(axes, "x")
