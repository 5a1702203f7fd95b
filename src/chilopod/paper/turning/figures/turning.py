"""The turning tasks: the figures of the paper's section "Turning maneuverability", and why the model's differ."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Arc, Circle
from numpy.typing import NDArray

from chilopod.paper import printed
from chilopod.paper.statements import listed
from chilopod.paper.turning.figures.criteria import another, comparison, criteria
from chilopod.paper.turning.study import Turning
from chilopod.paper.turning.trials import LegYaw, TurningTask, arrivals, by_leg_yaw, springs_by_outcome
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.scene.outline import draw_modules
from chilopod.show.words import SPRING_UNIT, k, listing, number, spring, typeset
from chilopod.steering import ARRIVAL_RADIUS

Array = NDArray[np.float64]

_TURNING = (
    style.Layout("AB;CD", 7.6, heights=(1.5, 1.0)),
    style.Layout("A;B;C;D", 12.6, heights=(1.0, 1.3, 0.9, 0.9)),
)
_WITHOUT = (style.Layout("AB", 4.0), style.Layout("A;B", 7.4))
_WITHOUT_ONE = (style.Layout("A", 4.4), style.Layout("A", 4.2))
_WHY = (style.Layout("AB", 4.0), style.Layout("A;B", 7.8))
_SHOWN = (style.ORANGE, style.GREEN, style.BLUE)
_DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
_CURVES = tuple(zip(style.CURVES, _DASHES, strict=False))


def panels(found: Turning) -> Iterator[Panel]:
    """All figures, in the paper's order."""
    yield turning(found)
    yield criteria(found)
    yield another(found)
    yield without(found)
    yield comparison(found)
    yield why(found)


def turning(found: Turning) -> Panel:
    """Fig. "turning" A to D."""
    task = found.tasks["A"]
    best, entry = float(task.paths.shown[1]), printed.TASKS["A"]
    by_axis, point = (found.laws.k_hat(radius)[0] for radius in (task.target.radius, np.inf))
    psi, away = np.rad2deg(task.target.bearing), task.target.distance
    return Panel(
        name="turning",
        title="Turning task A: a target ahead to the left",
        draw=lambda narrow: draw_turning(found.robot, task, narrow),
        alt=f"A circle from the robot to a target {away:g} m away at {psi:g} degrees; walks with three springs, "
        f"of which that with {number(best)} {SPRING_UNIT} comes nearest; distance and angle of the target over "
        "time.",
        text=(
            f"A target {away:g}\u00a0m away, {psi:g}° to the left, asks for a circle of radius R/(2 sin ψ) = "
            f"{number(task.target.radius)}\u00a0m (the paper prints {typeset(str(entry.radius))}). The "
            f"robot starts straight; {k(1)} is chosen before it walks, the legs of module 1 yaw towards the target by "
            f"at most 5°. {task.criteria.sizes['repeat']} walks with each of three springs, each with its own small "
            f"disturbance: {became(task)}. Lines are pale after the target has been reached.",
            f"The paper shows the same of its robot with {listed(list(entry.outcomes.values()))}\u00a0{SPRING_UNIT}, "
            f"around the {entry.k_hat.value:g} that its radius law gives. The planar model bends at softer springs "
            f"(its pitchfork is at {number(point, 2)} instead of {printed.ONSET.value:g}) and its law gives "
            f"{spring(by_axis)}. Its earliest arrival, the time at which the paper's criteria are taken, is "
            f"{number(task.time)}\u00a0s; the robot's was {typeset(str(printed.ARRIVAL))}.",
        ),
        data=task.paths,
    )


def became(task: TurningTask) -> str:
    """Outcome of most walks with each spring that is shown."""
    by_outcome = springs_by_outcome(task.criteria).items()
    shown = [float(each) for each in task.paths.shown.values]
    return listing(f"most {what.label} with {spring(k, 2)}" for k in shown for what, those in by_outcome if k in those)


def draw_turning(robot: Robot, task: TurningTask, narrow: bool) -> Figure:
    """Circle, paths, distance and angle of a task, as in the paper's Fig. "turning" A to D."""
    figure, axes = style.figure(*_TURNING, narrow)
    _geometry(axes["A"], robot, *task.target.position)
    data, arrival = task.paths, task.criteria.arrival.sel(spring=task.paths.shown).values
    for row, (spring_, color) in enumerate(zip(data.shown.values, _SHOWN, strict=True)):
        for repeat in range(data.sizes["repeat"]):
            one = data.isel(shown=row, repeat=repeat)
            until = arrival[row, repeat]
            for letter, x, y in (
                ("B", one.x.values, one.y.values),
                ("C", one.time.values, one.distance.values),
                ("D", one.time.values, np.rad2deg(one.bearing.values)),
            ):
                _run(axes[letter], one.time.values, x, y, until, color)
        axes["B"].plot([], [], color=color, label=f"{k(1)} = {spring_:g}")
    _target(axes["B"], data)
    _floor(axes["B"])
    axes["B"].set_title("B  Path of module 1")
    figure.legend(
        *axes["B"].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=3,
        title=f"springs in {SPRING_UNIT}",
        title_fontsize=style.SMALL,
    )
    axes["C"].axhline(ARRIVAL_RADIUS, color=style.BLACK, lw=0.9, linestyle=(0, (4, 2)))
    style.note(axes["C"], f"arrived, {ARRIVAL_RADIUS:g} m", (0.4, ARRIVAL_RADIUS), (0, 3), va="bottom")
    axes["C"].set(ylim=(0.0, 1.45), ylabel="target distance (m)", title="C  Distance of the target")
    axes["D"].axhline(0.0, color=style.BLACK, lw=0.9)
    axes["D"].set_ylabel("target angle (deg)")
    axes["D"].set_yticks([-270, -180, -90, 0, 90, 180])
    axes["D"].set(ylim=(-290.0, 200.0), title="D  Angle of the target")
    for letter in "CD":
        axes[letter].axvline(task.time, color=style.GREY, lw=1.0, linestyle=(0, (1, 1.5)))
        axes[letter].set(xlim=(0.0, float(data.time[-1])), xlabel="time (s)")
        style.grid(axes[letter])
    style.note(
        axes["D"], f"earliest arrival, {number(task.time)} s", (task.time, -250.0), (-4, 0), ha="right", va="center"
    )
    return figure


def _run(axes: Axes, time: Array, x: Array, y: Array, until: float, color: str) -> None:
    """A line that is pale from the arrival on."""
    after = time > until if np.isfinite(until) else np.zeros(time.size, bool)
    axes.plot(np.where(after, np.nan, x), np.where(after, np.nan, y), color=color, lw=1.1)
    if after.any():
        axes.plot(x[after], y[after], color=color, lw=0.8, alpha=0.3)


def _target(axes: Axes, data: xr.Dataset) -> None:
    """The target, the circle within which it counts as reached, and the start."""
    at = data.attrs["target_x_m"], data.attrs["target_y_m"]
    axes.add_patch(Circle(at, ARRIVAL_RADIUS, fill=False, ec=style.BLACK, lw=1.0, linestyle=(0, (4, 2)), zorder=5))
    axes.plot(*at, "+", color=style.BLACK, markersize=9, markeredgewidth=1.6, zorder=6)
    axes.plot(0.0, 0.0, "o", color=style.BLACK, markersize=5, zorder=6)


def _floor(axes: Axes) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x, ahead at the start (m)", ylabel="y, to its left (m)")
    style.grid(axes)


def _geometry(axes: Axes, robot: Robot, x: float, y: float) -> None:
    """The circle that starts along the heading and ends at the target, to scale."""
    away, psi = float(np.hypot(x, y)), float(np.arctan2(y, x))
    radius = away / (2.0 * np.sin(psi))
    n, length = robot.body.modules, robot.module_length
    centres = np.column_stack([-length * np.arange(n), np.zeros(n)])
    draw_modules(axes, centres, np.zeros(n), length, fc=style.PALE, ec=style.GREY)
    axes.add_patch(Circle((0.0, radius), radius, fill=False, ec=style.PALE, lw=1.2, zorder=1))
    swept = np.linspace(0.0, 2.0 * psi, 100)
    axes.plot(radius * np.sin(swept), radius * (1.0 - np.cos(swept)), color=style.GREEN, lw=2.2)
    axes.plot([0.0, x], [0.0, y], color=style.BLACK, lw=1.1, linestyle=(0, (4, 2)))
    axes.plot([0.0, 1.1 * away], [0.0, 0.0], color=style.GREY, lw=0.9)
    axes.plot([x, 0.0, 0.0], [y, radius, 0.0], color=style.BLUE, lw=1.1)
    axes.plot(0.0, radius, ".", color=style.BLUE, markersize=6)
    axes.add_patch(Arc((0.0, 0.0), 0.7, 0.7, theta1=0.0, theta2=np.rad2deg(psi), color=style.BLACK, lw=1.1))
    axes.add_patch(Circle((x, y), ARRIVAL_RADIUS, fill=False, ec=style.BLACK, lw=1.0, linestyle=(0, (4, 2))))
    axes.plot(x, y, "+", color=style.BLACK, markersize=9, markeredgewidth=1.6)
    axes.text(0.42 * np.cos(0.5 * psi), 0.42 * np.sin(0.5 * psi), "ψ", ha="center", va="center")
    axes.text(0.55 * x, 0.55 * y, "R ", ha="right", va="bottom")
    axes.text(-0.04, 0.5 * radius, "r̂", ha="right", va="center", color=style.BLUE)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set(
        title="A  The circle to the target, to scale",
        xlim=(-robot.body.length, 1.15 * away),
        ylim=(-0.15, 2.05 * radius),
    )


def without(found: Turning) -> Panel:
    """Fig. "without": trajectories with and without leg yaw."""
    data, cases = found.without, by_leg_yaw(found.without)
    said = []
    for case in cases:
        arrived, trials = arrivals(case.alone)
        said.append(f"with {spring(case.spring, 3)} {arrived} of {trials} arrive, {sides(case)}")
    largest = float(np.rad2deg(max(np.abs(case.alone.turned).max() for case in cases)))
    helped = [
        f"{arrived} of {trials} arrive with {spring(case.spring, 3)}"
        for case in cases
        for arrived, trials in (arrivals(case.helped),)
    ]
    return Panel(
        name="turning-without",
        title="With and without leg yaw",
        draw=lambda narrow: draw_without(data, narrow),
        alt="Paths of module 1: without leg yaw they go almost straight, some to the left and some to the right; with "
        "leg yaw they turn to the target.",
        text=(
            f"Without the help of the legs the side is left to chance and the bend grows slowly: {listing(said)}; no "
            f"heading has changed by more than {number(largest, 2)}° after {number(float(data.time[-1]), 2)}\u00a0s. "
            "The paper found the same with its robot: many of nine walks failed, because the bend took long to come or "
            "went the wrong way, and all five with leg yaw arrived.",
            "With leg yaw "
            + listing(helped)
            + ". The first is the spring that comes nearest to the target, the second that of the radius law, so close "
            "to the pitchfork that its bend hardly grows within the task.",
        ),
        data=data,
    )


def sides(case: LegYaw) -> str:
    """To which side the walks without leg yaw turn."""
    left = int((case.alone.turned > 0.0).sum())
    return f"{left} turn left and {arrivals(case.alone)[1] - left} right"


def draw_without(data: xr.Dataset, narrow: bool) -> Figure:
    """Paths with and without leg yaw, a panel for each spring."""
    cases = by_leg_yaw(data)
    figure, axes = style.figure(*(_WITHOUT if len(cases) > 1 else _WITHOUT_ONE), narrow)
    for case, letter in zip(cases, "AB", strict=False):
        for walks, color in ((case.alone, style.ORANGE), (case.helped, style.GREEN)):
            axes[letter].plot(walks.x.values.T, walks.y.values.T, color=color, lw=1.1)
        _target(axes[letter], data)
        _floor(axes[letter])
        axes[letter].set_title(f"{letter}  {case.name.capitalize()}, {number(case.spring, 3)} {SPRING_UNIT}")
    handles = [Line2D([], [], color=color) for color in (style.ORANGE, style.GREEN)]
    figure.legend(
        handles,
        [f"without leg yaw, {arrivals(case.alone)[1]} walks", f"with leg yaw, {arrivals(case.helped)[1]} walks"],
        loc="outside lower center",
        ncols=1 if narrow else 2,
    )
    return figure


def why(found: Turning) -> Panel:
    """Why the best spring is not the law's: the start, and the way there is."""
    settled, farther = found.settled, found.farther
    best = [float(farther.spring[int(row.argmin())]) for row in farther.effort.values]
    cm = 100.0 * settled.start_nearest
    apart = listing(
        f"{number(float(cm.sel(task=task, start='bent')), 2)} and "
        f"{number(float(cm.sel(task=task, start='bent, aimed')), 2)}\u00a0cm in task {task}"
        for task in settled.task.values
    )
    return Panel(
        name="turning-why",
        title="Why the best spring is not that of the radius law",
        draw=lambda narrow: _draw_why(settled, farther, narrow),
        alt="How near the target comes at the spring of the law, starting straight and bent; and the leg yaw needed "
        "for targets at several distances over the spring.",
        text=(
            "The law is not wrong: it speaks of the settled curve. Undisturbed, without leg yaw and at the law's own "
            "spring, a robot that starts straight goes straight on. One that starts bent passes close by the target, "
            "and closer still once it is taken into account that on its curve module 1 does not move where it points, "
            f"but {listing(f'{number(float(angle), 2)}°' for angle in abs(np.rad2deg(settled.slip)))} to the outside "
            f"in tasks {listing(str(task) for task in settled.task.values)}: {apart}. What the "
            "law leaves out is the time that the bend needs to grow, which next to the pitchfork is longer than the "
            "task. A softer spring bends faster and makes up for the delay.",
            "In task A the legs are at their limit nearly all the way, so ε3 has little to save. Farther targets leave "
            "more time: of what legs always at their limit would make of it the best spring needs "
            f"{listing(f'{number(100.0 * float(row.min()), 2)} %' for row in farther.effort_part.values)} for targets "
            f"at {listing(f'{away:g}' for away in farther.away.values)}\u00a0m, each smallest at "
            f"{listing(f'{value:g}' for value in best)}\u00a0{SPRING_UNIT}"
            + (
                ": far away it lies on the stiff side of the pitchfork, where the walk is still straight by itself "
                "but follows the legs readily."
                if best[-1] > found.laws.k_hat(np.inf)[0]
                else "."
            ),
        ),
        data=xr.merge([settled, farther], combine_attrs="drop_conflicts"),
    )


def _draw_why(settled: xr.Dataset, farther: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(*_WHY, narrow)
    rows = np.arange(settled.sizes["start"])
    for task, color, shift in zip(settled.task.values, (style.BLUE, style.ORANGE), (-0.17, 0.17), strict=False):
        values = settled.start_nearest.sel(task=task).values
        axes["A"].barh(rows + shift, values, 0.3, color=color, label=f"task {task}")
        for row, value in zip(rows, values, strict=True):
            style.note(axes["A"], f"{value:.2f}", (value, row + shift), (4, 0), va="center")
    axes["A"].set_yticks(rows, [str(start).replace(", ", ",\n") for start in settled.start.values])
    axes["A"].set(ylim=(rows[-1] + 0.55, -0.55), xlim=(0.0, 1.2 * float(settled.start_nearest.max())))
    axes["A"].axvline(ARRIVAL_RADIUS, color=style.BLACK, lw=0.9, linestyle=(0, (4, 2)))
    axes["A"].set(xlabel="nearest distance of the target (m)", title="A  Start, no leg yaw")
    axes["A"].legend(loc="lower right")
    for index, (color, dash) in zip(range(farther.sizes["away"]), _CURVES, strict=False):
        axes["B"].plot(
            1.0 / farther.spring.values,
            100.0 * farther.effort_part.values[index],
            color=color,
            linestyle=dash,
            marker="o",
            markersize=4,
            label=f"R = {float(farther.away[index]):g} m",
        )
    axes["B"].set(
        ylim=(0.0, 135.0),
        xlabel="1/k₁ (deg/(N·mm))",
        ylabel="ε3 / legs always at 5° (%)",
        title="B  Leg yaw needed, farther targets",
    )
    axes["B"].legend(loc="upper center", ncols=2)
    for letter in "AB":
        style.grid(axes[letter], "x" if letter == "A" else "both")
    return figure
