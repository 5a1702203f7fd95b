"""Courses: targets reached, times, costs, positions of missed targets, contribution of each step of the spring law, and
robustness of the variable spring."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from chilopod.frozen import Array
from chilopod.paper.courses.rows import (
    Summary,
    decisions,
    percent,
    share_of_courses,
    share_of_targets,
    summaries,
    verdicts,
)
from chilopod.paper.courses.study import USUAL, Robust
from chilopod.paper.shapes import finish
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import listing, number, spring
from chilopod.statistics import Interval
from chilopod.steering import STRATEGIES, VARIABLE

_TITLES = {
    VARIABLE.name: "k₁ set on the way",
    "pitchfork": "one k₁",
    "hopf": "springs alike",
    "leg-yaw": "leg yaw alone",
    "actuated": "torques at joints",
}
_BEARINGS = np.linspace(-75.0, 75.0, 11)  # deg
_AWAY = np.linspace(0.8, 2.0, 7)  # m
_FEWEST = 0.1  # of the targets of a field that are missed where the map's text speaks of it
_STEP_TITLES = (
    "spring of\nthe circle",
    "+ the bend\nthere is",
    "+ looking for\nwhat is lost",
    "+ straightening\nfor what is near",
    "+ a place ahead",
)


def panels(data: xr.Dataset) -> list[Panel]:
    """All figures of the planar comparison."""
    return [strategies(data), where(data)]


def strategies(data: xr.Dataset) -> Panel:
    """Shares of targets and courses, time and work of every strategy."""
    found, planar = summaries(data), data.attrs["engine"] == "planar"
    ours = found[VARIABLE.name]
    walks = f"{data.sizes['course']} random courses of {data.sizes['goal']} targets"
    return Panel(
        name="courses" if planar else "robot-courses",
        title="One target after another" + ("" if planar else ": the robot in three dimensions"),
        draw=_draw(found),
        alt=f"A: shares of targets and of whole courses that each strategy reaches. B: time for a target that is "
        f"reached. C: work of the actuators. The spring that is set on the way reaches {percent(ours.targets)} of "
        "targets.",
        text=(
            f"{walks}, the same for all strategies, each within {data.attrs['patience_s']:g}\u00a0s a target and seen "
            "only within the scanner's view. The first spring is set once in every gait cycle by the spring law; "
            f"beside it stand the best spring for all of a course ({spring(found['pitchfork'].spring, 2)}), the best "
            f"for all joints alike ({spring(found['hopf'].spring, 2)}), both found on other courses, leg yaw with the "
            "robot as it is, and a body axis bent by torques at all joints. Bars are intervals of 95 %. B has the time "
            "spent on targets that are reached, and on all of them for every one that is reached.",
            f"The spring that is set on the way reaches {percent(ours.targets)} of targets and "
            f"{percent(ours.courses)} of courses. It {decisions(verdicts(found))}.",
        ),
        data=data,
    )


@style.in_layouts(style.Layout("ABC", 3.4, widths=(1.2, 1.0, 1.0)), style.Layout("A;B;C", 8.6))
def _draw(axes: style.Mosaic, found: dict[str, Summary]) -> None:
    each = list(found.values())
    rows = np.arange(len(each), dtype=np.float64)
    titles = [_TITLES[one.name] + ("" if np.isnan(one.spring) else f" = {one.spring:g}") for one in each]
    _reached(axes["A"], [one.targets for one in each], [one.courses for one in each], "A  Reached")
    axes["A"].legend(loc="best")
    intervals(axes["B"], [one.seconds for one in each], rows - 0.12, "o", color=style.BLUE, label="on it")
    spent, label = [one.spent for one in each], "on it and those missed"
    intervals(axes["B"], spent, rows + 0.12, "s", color=style.ORANGE, label=label)
    finish(axes["B"], "x", "upper right", xlabel="time for a target reached (s)", title="B  Time")
    left = np.zeros(len(each))
    for name, color in (("spring", style.BLUE), ("drive", style.ORANGE)):
        work = np.array([getattr(one, f"{name}_work") for one in each])
        axes["C"].barh(rows, work, 0.5, left=left, color=color, label="springs" if name == "spring" else "joints")
        left += work
    finish(axes["C"], "x", "best", xlabel="work a course (J)", title="C  Work of the actuators")
    for letter, one in axes.items():
        one.set_yticks(rows, titles if axes.narrow or letter == "A" else [""] * len(rows))
        one.set_ylim(len(rows) - 0.5, -0.5)
        if letter != "A":
            one.set_xlim(left=0.0)


def _reached(axes: Axes, targets: Sequence[Interval], courses: Sequence[Interval], title: str) -> None:
    """Shares of targets and of whole courses, a row each."""
    rows = np.arange(len(targets), dtype=np.float64)
    intervals(axes, targets, rows - 0.12, "o", 100.0, color=style.BLUE, label="targets")
    intervals(axes, courses, rows + 0.12, "s", 100.0, color=style.ORANGE, label="whole courses")
    _scaled(axes, len(rows), title)


def _scaled(axes: Axes, rows: int, title: str) -> None:
    finish(axes, "x", xlim=(-3.0, 103.0), ylim=(rows - 0.5, -0.5), xlabel="reached (%)", title=title)


def intervals(axes: Axes, found: Sequence[Interval], rows: Array, marker: str, scale: float = 1.0, **look: Any) -> None:
    """Values with their intervals, a row each."""
    value, low, high = (scale * np.array([getattr(each, name) for each in found]) for name in ("value", "low", "high"))
    bars = np.maximum(0.0, np.array([value - low, high - value]))
    axes.errorbar(value, rows, xerr=bars, fmt=marker, markersize=5, elinewidth=1.4, capsize=2.5, **look)


def where(data: xr.Dataset) -> Panel:
    """Positions of missed targets, with the variable spring and with the best constant one."""
    shown = (VARIABLE.name, STRATEGIES["pitchfork"].name)
    maps = {name: share_map(data.sel(case=name)) for name in shown}
    ours, fixed = (maps[name] for name in shown)
    missed, few = _missed(ours), _percent(_FEWEST)
    said = f"more than {few} are missed {missed}." if missed else f"none misses more than {few}."
    return Panel(
        name="courses-where",
        title="Where targets are missed",
        draw=_draw_where(maps),
        alt="Maps of the share of targets that are reached over angle and distance at which they are put up: with the "
        "spring that is set on the way, and with one spring for all.",
        text=(
            "Targets by the angle and distance at which they are put up. One spring for all of a course is that of one "
            f"circle: fields of its map range from {_percent(np.nanmin(fixed))} to {_percent(np.nanmax(fixed))}. With "
            f"the spring that is set on the way the lowest has {_percent(np.nanmin(ours))}; {said}",
        ),
        data=xr.Dataset(
            {"reached": (("strategy", "away", "bearing"), np.stack(list(maps.values())), {"units": "1"})},
            coords={
                "strategy": list(shown),
                "away": ("away", 0.5 * (_AWAY[1:] + _AWAY[:-1]), {"units": "m"}),
                "bearing": ("bearing", 0.5 * (_BEARINGS[1:] + _BEARINGS[:-1]), {"units": "deg"}),
            },
        ),
    )


def share_map(one: xr.Dataset) -> Array:
    """Share of targets that were reached, over distance and bearing; NaN in fields without targets."""
    at = np.rad2deg(one.bearing.values).ravel(), one.away.values.ravel()
    reached = one.arrived.transpose("course", "goal").values.ravel()
    all_, *_ = np.histogram2d(at[1], at[0], (_AWAY, _BEARINGS))
    those, *_ = np.histogram2d(at[1], at[0], (_AWAY, _BEARINGS), weights=reached)
    return np.asarray(np.where(all_ > 0, those / np.maximum(all_, 1), np.nan))


def _missed(share: Array) -> str:
    """Fields of a map with many missed targets, in words."""
    fields = [
        f"at {abs(_BEARINGS[column]):.0f}° to {abs(_BEARINGS[column + 1]):.0f}° to the "
        f"{'left' if _BEARINGS[column] >= 0.0 else 'right'} and {_AWAY[row]:.1f} to {_AWAY[row + 1]:.1f}\u00a0m"
        for row, column in np.argwhere(share < 1.0 - _FEWEST)
    ]
    return listing(fields[:4]) + (" and elsewhere" if len(fields) > 4 else "")


def _percent(share: float) -> str:
    return f"{number(100.0 * share, 3)}\u00a0%" if share < 1.0 else "100\u00a0%"


@style.in_layouts(style.Layout("AB", 3.9), style.Layout("A;B", 7.4))
def _draw_where(axes: style.Mosaic, maps: dict[str, Array]) -> None:
    for letter, (name, share) in zip("AB", maps.items(), strict=True):
        mesh = axes[letter].pcolormesh(_BEARINGS, _AWAY, 100.0 * share, vmin=0.0, vmax=100.0, cmap="viridis")
        title = f"{letter}  {_TITLES[name]}"
        axes[letter].set(xlabel="angle of the target (deg)", ylabel="distance (m)", title=title)
        axes[letter].set_xticks([-75, -45, -15, 15, 45, 75])
        axes[letter].invert_xaxis()  # left is left
    axes.figure.colorbar(mesh, ax=list(axes.values()), label="targets reached (%)", shrink=0.8)


def robust(found: Robust) -> Panel:
    """Steps of the law, and conditions unknown to it, in the planar model."""
    steps, conditions = found.courses, found.conditions
    grown = listing(f"{name} {percent(share_of_targets(steps.arrived.sel(case=name)))}" for name in steps.case.values)
    return Panel(
        name="courses-robust",
        title="What the spring law owes to its steps, and what it stands",
        draw=_draw_robust(found),
        alt="A: targets and courses reached by the law as it grew. B: the same under conditions that the law does not "
        "know of, beside one spring for all of a course.",
        text=(
            f"A: targets reached on {steps.sizes['course']} courses by the law step by step, each with what those "
            f"before have: {grown}.",
            f"B: the finished law on {conditions.sizes['course']} courses whose conditions it does not know of. "
            + _decided(conditions),
        ),
        data=conditions,
    )


def whole(conditions: xr.Dataset) -> Panel:
    """Conditions of the whole robot."""
    return Panel(
        name="robot-courses-robust",
        title="What the spring that is set on the way stands: the robot in three dimensions",
        draw=_draw_whole(conditions),
        alt="Targets and courses reached under several conditions, with the spring that is set on the way and with one "
        "for all.",
        text=(f"{conditions.sizes['course']} courses under each condition. " + _decided(conditions),),
        data=conditions,
    )


def _decided(data: xr.Dataset) -> str:
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
    fewer = f"with {listing(worse)}" if worse else "under none of these conditions"
    more = f"beyond doubt under {f'these: {listing(better)}' if better else 'none'}"
    if len(better) == data.sizes["condition"]:
        more = "under every one of them"
    return (
        f"As usual it reaches {percent(usual)} of targets; clearly fewer {fewer}. It reaches more than "
        f"{spring(data.attrs['spring'], 2)} all along {more}."
    )


@style.in_layouts(style.Layout("AB", 4.0, widths=(0.8, 1.0)), style.Layout("A;B", 8.4, heights=(0.6, 1.0)))
def _draw_robust(axes: style.Mosaic, found: Robust) -> None:
    arrived = [found.courses.arrived.isel(case=row) for row in range(found.courses.sizes["case"])]
    targets, courses = ([share(each) for each in arrived] for share in (share_of_targets, share_of_courses))
    _reached(axes["A"], targets, courses, "A  The law, step by step")
    axes["A"].set_yticks(range(len(arrived)), list(_STEP_TITLES[: len(arrived)]))
    _conditions(axes["B"], found.conditions, "B  Under other conditions")
    axes.legend_below("B", 4)


@style.in_layouts(style.Layout("A", 2.8), style.Layout("A", 3.4))
def _draw_whole(axes: style.Mosaic, data: xr.Dataset) -> None:
    _conditions(axes["A"], data, "")
    axes.legend_below("A", 4)


def _conditions(axes: Axes, data: xr.Dataset, title: str) -> None:
    rows = np.arange(data.sizes["condition"], dtype=np.float64)
    for strategy, fill, shift in zip(data.strategy.values, (1.0, 0.45), (-0.15, 0.15), strict=True):
        arrived = [data.arrived.sel(strategy=strategy, condition=each) for each in data.condition.values]
        label = "k₁ set on the way" if strategy == VARIABLE.name else f"k₁ = {data.attrs['spring']:g}"
        for share, color, marker, what in (
            (share_of_targets, style.BLUE, "o", "targets"),
            (share_of_courses, style.ORANGE, "s", "courses"),
        ):
            shares, look = [share(each) for each in arrived], {"label": f"{label}, {what}", "alpha": fill}
            intervals(axes, shares, rows + shift, marker, 100.0, color=color, **look)
    axes.set_yticks(rows, [str(each) for each in data.condition.values])
    _scaled(axes, len(rows), title)
