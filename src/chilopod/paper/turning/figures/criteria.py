"""The three criteria of turning tasks over the first spring, beside the spring of the radius law."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from chilopod.paper import printed
from chilopod.paper.printed import CRITERION_NAMES
from chilopod.paper.turning import hopf
from chilopod.paper.turning.minima import SCALES, minima
from chilopod.paper.turning.study import Turning
from chilopod.paper.turning.trials import TurningTask, outcome_words, span, springs_by_outcome
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, listing, number, spring, typeset
from chilopod.steering import Outcome

_LAYOUTS = (style.Layout("ABC", 3.9), style.Layout("A;B;C", 9.9))
_AXES = {
    "distance": "ε1: target distance (m)",
    "angle": "ε2: target angle (deg)",
    "effort": "ε3: leg yaw (rad²·s)",
}
_TOP = (41, 15, 10, 7, 5)  # N*mm/deg, on the upper axis


def criteria(found: Turning) -> Panel:
    """Fig. "turning" E: task A."""
    task = found.tasks["A"]
    low = minima(task.criteria)
    flat = low.sel(criterion="effort")
    whole = low.sel(criterion="effort_until_arrival")
    return Panel(
        name="turning-criteria",
        title="Task A: the paper's three criteria over the spring",
        draw=lambda narrow: draw_criteria(task, found.laws.k_hat(task.target.radius)[0], narrow),
        alt=_alt(found, "A"),
        text=(
            _said(found, "A"),
            f"ε3 has no clear minimum within this task: from {flat.softest:g} to {flat.stiffest:g}\u00a0{SPRING_UNIT} "
            "it is the same within two standard errors, because the legs stand at their limit of 5° until the target "
            "is passed, to whichever side. Integrated until each "
            "robot arrives, when its task is done, it is smallest "
            f"at {spring(float(whole['at']), 2)}. A farther target shows a minimum (last figure).",
        ),
        data=task.criteria,
    )


def another(found: Turning) -> Panel:
    """Fig. "another": task B."""
    task = found.tasks["B"]
    return Panel(
        name="turning-another",
        title=f"Task B ({task.target.bearing * 180.0 / np.pi:g}°, {task.target.distance:g} m): the criteria again",
        draw=lambda narrow: draw_criteria(task, found.laws.k_hat(task.target.radius)[0], narrow),
        alt=_alt(found, "B"),
        text=(_said(found, "B"),),
        data=task.criteria,
    )


def comparison(found: Turning) -> Panel:
    """Fig. "comparison": pitchfork against Hopf."""
    task = found.tasks["A"]
    ever = int(np.isfinite(found.hopf.criteria.arrival.values).sum())
    return Panel(
        name="turning-hopf",
        title="Pitchfork against Hopf",
        draw=lambda narrow: draw_comparison(task, found.hopf, narrow),
        alt="The three criteria over the spring for the two strategies; the pitchfork's smallest values lie below.",
        text=(
            "The earlier strategy softens all springs together, so that the straight walk gives way to an undulation "
            f"(below {spring(found.hopf_point, 3)} in the planar model, the robot's Hopf point is "
            f"{printed.UNIFORM.value:g}). Same task, same time, same disturbances: "
            f"at best, pitchfork against Hopf: {typeset(hopf.words(task, found.hopf))}. "
            + {
                True: "Every minimum of the pitchfork is lower, as in the paper.",
                False: "Not every minimum of the pitchfork is lower, unlike in the paper.",
                None: "Whether every minimum of the pitchfork is lower, as in the paper, these walks leave open.",
            }[hopf.all_lower(task, found.hopf)],
            f"With uniform springs {ever} of {found.hopf.criteria.arrival.size} walks arrive. Their criteria are "
            f"smallest at {typeset(hopf.softest_minima(found.hopf, found.hopf_point)[0])}; there the walks scatter: "
            "how the body swings when it passes the target decides. ε3 tells the two apart least: "
            f"{typeset(hopf.saturation(task, found.hopf))} (its axis does not start at zero).",
        ),
        data=both_strategies(task, found.hopf),
    )


def both_strategies(*tasks: TurningTask) -> xr.Dataset:
    """The criteria of several tasks in one table."""
    each = [task.criteria.assign_coords(strategy=task.criteria.attrs["strategy"]) for task in tasks]
    return xr.concat(each, dim="strategy", join="outer", combine_attrs="drop_conflicts")


def _shown(low: xr.Dataset, name: str) -> float:
    return SCALES[name][0] * float(low["mean"].sel(criterion=name))


def _alt(found: Turning, letter: str) -> str:
    low = minima(found.tasks[letter].criteria)
    return (
        "Distance, angle and leg yaw over the compliance of the first spring, smallest at "
        + listing(number(float(low["at"].sel(criterion=name)), 2) for name in CRITERION_NAMES)
        + f" {SPRING_UNIT}."
    )


def _said(found: Turning, letter: str) -> str:
    task = found.tasks[letter]
    low, k_hat = minima(task.criteria), found.laws.k_hat(task.target.radius)[0]
    arrived = springs_by_outcome(task.criteria)[Outcome.ARRIVED]
    if not arrived:
        return f"No robot arrives within {task.criteria.attrs['duration_s']:g}\u00a0s."
    parts = [float(low["at"].sel(criterion=name)) / k_hat for name in CRITERION_NAMES]
    return (
        f"Means and standard errors of {task.criteria.sizes['repeat']} walks, at {number(task.time)}\u00a0s. Robots "
        f"arrive with {min(arrived):g} to {max(arrived):g}\u00a0{SPRING_UNIT} (shaded); most have "
        f"{outcome_words(task.criteria, span)}. The minima (parabola through the lowest mean and its neighbours): "
        f"{places(task)}\u00a0{SPRING_UNIT}. The dashed line is the spring of the radius law, {spring(k_hat)}; "
        f"for the robot the paper's is {printed.TASKS[letter].k_hat.value:g}, with all three minima around it. In the "
        f"model they lie at {listing(number(part, 2) for part in parts)} of the law's spring: next to the pitchfork a "
        "bend that starts from straight grows too slowly for the task. The axis of ε3 does not start at zero."
    )


def places(task: TurningTask) -> str:
    """Where the criteria are smallest."""
    at = minima(task.criteria)["at"]
    return listing(
        f"{title.partition(',')[0]} at {number(float(at.sel(criterion=name)), 3)}"
        for name, title in CRITERION_NAMES.items()
    )


def draw_criteria(task: TurningTask, k_hat: float, narrow: bool, top: tuple[float, ...] = _TOP) -> Figure:
    """The three criteria over 1/k1, with the spring of a radius law (N*mm/deg) and springs to mark on the top axis."""
    figure, axes = style.figure(*_LAYOUTS, narrow)
    arrived = springs_by_outcome(task.criteria)[Outcome.ARRIVED]
    for place, name in zip("ABC", CRITERION_NAMES, strict=True):
        if arrived:
            axes[place].axvspan(1.0 / max(arrived), 1.0 / min(arrived), color=style.PALE, zorder=0)
        _points(axes[place], task.criteria, name, style.BLUE, "o")
        axes[place].axvline(1.0 / k_hat, color=style.VERMILLION, lw=1.2, linestyle=(0, (4, 2)))
        _finish(axes[place], name, place, top)
    handles = [
        Line2D([], [], color=style.BLUE, marker="o", markersize=5),
        Line2D([], [], color=style.VERMILLION, lw=1.2, linestyle=(0, (4, 2))),
        Line2D([], [], color=style.PALE, lw=8),
    ]
    labels = [
        f"mean of {task.criteria.sizes['repeat']} walks ± standard error",
        f"radius law, k̂₁ = {number(k_hat, 4)}",
        "arrives",
    ]
    figure.legend(handles, labels, loc="outside lower center", ncols=1 if narrow else 3)
    return figure


def draw_comparison(
    task: TurningTask, hopf: TurningTask, narrow: bool, top: tuple[float, ...] = (41, 10, 5, 3, 2)
) -> Figure:
    """The three criteria over 1/k of the two strategies."""
    figure, axes = style.figure(*_LAYOUTS, narrow)
    for place, name in zip("ABC", CRITERION_NAMES, strict=True):
        _points(axes[place], task.criteria, name, style.BLUE, "o")
        _points(axes[place], hopf.criteria, name, style.ORANGE, "s")
        low = minima(task.criteria)
        axes[place].axhline(_shown(low, name), color=style.BLUE, lw=0.9, linestyle=(0, (1, 1.5)))
        _finish(axes[place], name, place, top)
        axes[place].set_xlabel("1/k (deg/(N·mm))")
    handles = [
        Line2D([], [], color=style.BLUE, marker="o", markersize=5),
        Line2D([], [], color=style.ORANGE, marker="s", markersize=5, markerfacecolor="white"),
    ]
    labels = ["pitchfork: first spring alone", "Hopf: all springs alike"]
    figure.legend(handles, labels, loc="outside lower center", ncols=1 if narrow else 2)
    return figure


def _points(axes: Axes, data: xr.Dataset, name: str, color: str, marker: str) -> None:
    factor = SCALES[name][0]
    axes.errorbar(
        1.0 / data.spring.values,
        factor * data[f"{name}_mean"].isel(instant=0, missing_dims="ignore").values,
        factor * data[f"{name}_error"].isel(instant=0, missing_dims="ignore").values,
        color=color,
        marker=marker,
        markersize=5,
        markerfacecolor=color if marker == "o" else "white",
        lw=1.2,
        capsize=2.5,
    )


def _finish(axes: Axes, name: str, place: str, top: tuple[float, ...] = _TOP) -> None:
    axes.set(
        title=f"{place}  {_AXES[name].partition(' (')[0]}",
        ylabel=_AXES[name].partition(": ")[2],
        xlabel="1/k₁ (deg/(N·mm))",
    )
    axes.set_xlim(left=0.0)
    if name == "effort":
        # It hardly differs: not from zero, as the text says.
        axes.set_ylim(0.95 * axes.dataLim.y0, 1.02 * axes.dataLim.y1)
    else:
        axes.set_ylim(bottom=0.0)
    axes.spines["top"].set_visible(True)
    upper = axes.secondary_xaxis("top")
    upper.set_xticks([1.0 / each for each in top], [f"{each:g}" for each in top])
    upper.tick_params(pad=1)
    upper.set_xlabel(f"k ({SPRING_UNIT})", fontsize=style.SMALL)
    style.grid(axes, "y")
