"""A course: the way over the floor from target to target, the spring that bends it, and where the targets were seen."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from chilopod import units
from chilopod.show import style
from chilopod.show.scene.frames import body_frames
from chilopod.show.scene.outline import draw_spines
from chilopod.steering import ARRIVAL_RADIUS, Verdict
from chilopod.tasks.course import Driven

LAYOUTS = (style.Layout("AB;AC", 4.6, widths=(1.5, 1.0)), style.Layout("A;B;C", 9.0, heights=(2.0, 1.0, 1.0)))
_ON_WHITE = {"fc": "white", "ec": "none", "pad": 0.4}
_ARRIVED = Verdict.ARRIVED.label
WAYS = tuple(each for each in style.CURVES if each != style.GREEN)  # which is for targets that were reached


def draw(done: Driven, narrow: bool = False) -> Figure:
    """The figure; call it within :func:`chilopod.show.style.house_style`."""
    figure, axes = style.figure(*LAYOUTS, narrow)
    record = done.record
    _floor(axes["A"], record)
    axes["A"].set_title(title(done))
    for robot in reversed(range(record.sizes["robot"])):
        walk, color = record.isel(robot=robot), WAYS[robot % len(WAYS)]
        # Of springs that nobody changed the record has one value for all times.
        spring = units.from_si(1.0, "N*mm/deg") * walk.stiffness.isel(joint=0).broadcast_like(walk.time).values
        axes["B"].plot(walk.time, spring, color=color, linewidth=1.2)
        if "target" in walk:  # where none can be reached there is none
            axes["C"].plot(walk.time, bearing(walk), color=color, linewidth=1.2)
    axes["B"].set_yscale("log")
    # As on other axes, and not as powers of ten.
    axes["B"].yaxis.set_major_formatter("{x:g}")
    axes["B"].yaxis.set_minor_locator(LogLocator(subs=(2.0, 4.0, 6.0)))
    axes["B"].yaxis.set_minor_formatter("{x:g}")
    if done.pitchfork is not None:
        at = units.from_si(done.pitchfork, "N*mm/deg")
        axes["B"].axhline(at, color=style.VERMILLION, linestyle=(0, (4, 2)), linewidth=1.2)
        where = {"xycoords": ("axes fraction", "data"), "color": style.VERMILLION, "bbox": _ON_WHITE}
        style.note(axes["B"], "bends below", (0.02, at), (0, 3), **where)
    axes["C"].axhline(0.0, color=style.GREY, linewidth=0.8)
    for name, label in (("B", "k1 (N·mm/deg)"), ("C", "target angle (deg)")):
        _turns(axes[name], record.isel(robot=0), numbered=name == "B")
        style.finish(axes[name], "y", xlabel="time (s)", ylabel=label)
    return figure


def title(done: Driven) -> str:
    """Title of the picture."""
    reached = (done.record.goal_verdict == _ARRIVED).values
    return f"{done.strategy.name}: {reached.sum()} of {reached.size} targets"


def bearing(walk: xr.Dataset) -> NDArray[np.float64]:
    """Bearing of the present target, deg, without lines across its jumps."""
    # One that was the target all the time has one place for all times.
    target = walk.target.broadcast_like(walk.position).transpose("time", "axis").values
    angle = np.rad2deg(walk.bearing.values)
    angle[1:][(np.abs(np.diff(angle)) > 180.0) | (np.diff(target, axis=0) != 0.0).any(-1)] = np.nan
    return angle


def _turns(axes: Axes, walk: xr.Dataset, *, numbered: bool) -> None:
    """Bands of the times of each goal of the first walk, with numbers above."""
    begins, ends = walk.goal_begin.values, walk.goal_end.values
    for index, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        if not (np.isfinite(begin) and np.isfinite(end)):
            continue
        if index % 2 == 0:
            axes.axvspan(begin, end, color=style.PALE, alpha=0.5, linewidth=0.0, zorder=0)
        if numbered:
            middle = (0.5 * (begin + end), 1.0)
            look = {"ha": "center", "xycoords": ("data", "axes fraction"), "color": _color(walk, index)}
            style.note(axes, str(index + 1), middle, (0, 2), **look)


def _color(walk: xr.Dataset, goal: int) -> str:
    return style.GREEN if str(walk.goal_verdict.values[goal]) == _ARRIVED else style.VERMILLION


def _floor(axes: Axes, record: xr.Dataset) -> None:
    """Paths and targets, and the first walk's body where it starts, arrives or gives up."""
    axes.set_aspect("equal", adjustable="datalim")
    for robot in reversed(range(record.sizes["robot"])):
        walk = record.isel(robot=robot)
        path = walk.position.transpose("time", "axis").values
        color = WAYS[robot % len(WAYS)]
        axes.plot(path[:, 0], path[:, 1], color=color, zorder=3, linewidth=1.8 if robot == 0 else 1.0)
        _goals(axes, walk, named=robot == 0)
    missed = _missed(record.isel(robot=0))
    if missed and record.sizes["robot"] > 1:
        missed = f"walk 1: {missed}"
    style.note(axes, missed, (0.0, 0.0), (4, 4), xycoords="axes fraction", color=style.VERMILLION, bbox=_ON_WHITE)
    first = record.isel(robot=[0])
    ends, walked = first.goal_end.values[0], first.time.values[np.isfinite(first.heading.values[:, 0])]
    moments = np.unique(np.clip([0.0, *ends[np.isfinite(ends)]], walked[0], walked[-1]))
    draw_spines(axes, body_frames(first, moments).spine[:, 0])
    style.finish(axes, xlabel="x (m)", ylabel="y (m)")


def _goals(axes: Axes, walk: xr.Dataset, *, named: bool) -> None:
    """Rings; those of the highlighted walk have a number."""
    places = walk.goal_place.transpose("goal", "axis").values
    for index, (x, y) in enumerate(places):
        if not np.isfinite([x, y]).all():
            continue
        color = _color(walk, index) if named else style.GREY
        axes.add_patch(Circle((x, y), ARRIVAL_RADIUS, fill=False, ec=color, lw=1.5 if named else 0.8, zorder=4))
        if not named:
            continue
        # A place that comes again, such as the crossing of an eight, has its numbers one above the other.
        again = sum(bool(np.allclose(each, (x, y))) for each in places[:index])
        look = {"color": color, "weight": "bold", "zorder": 6, "bbox": _ON_WHITE}
        style.note(axes, f"{index + 1}", (x, y), (9, 9 + 12 * again), **look)
        axes.plot(x, y, "+", color=color, markersize=6, markeredgewidth=1.5, zorder=4)


def _missed(walk: xr.Dataset) -> str:
    """Targets that were not reached, and why, such as "3, 5 out of time"."""
    numbers: dict[str, list[str]] = {}
    for number, verdict in enumerate(walk.goal_verdict.values, 1):
        if verdict not in (_ARRIVED, ""):
            numbers.setdefault(str(verdict), []).append(str(number))
    return "; ".join(f"{', '.join(each)} {verdict}" for verdict, each in numbers.items())
