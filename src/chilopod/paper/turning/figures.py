"""The turning tasks: figures of the paper's section "Turning maneuverability", and reasons of differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle

from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.printed import CRITERION_NAMES
from chilopod.paper.shapes import DASHED, DOTTED, errorbars, finish, over_compliance
from chilopod.paper.statements import listed
from chilopod.paper.turning import trials
from chilopod.paper.turning.study import SCALES, Turning, all_lower, in_words, minima, saturation, softest_minima
from chilopod.paper.turning.trials import LegYaw, TurningTask, arrivals, by_leg_yaw, outcome_words, springs_by_outcome
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.scene.outline import draw_modules
from chilopod.show.words import SPRING_UNIT, k, listing, number, spring, typeset
from chilopod.steering import ARRIVAL_RADIUS, Outcome

_WITHOUT = (style.Layout("AB", 4.0), style.Layout("A;B", 7.4))
_WITHOUT_ONE = (style.Layout("A", 4.4), style.Layout("A", 4.2))
_SHOWN = (style.ORANGE, style.GREEN, style.BLUE)
_DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
_CURVES = tuple(zip(style.CURVES, _DASHES, strict=False))
_AXES = {"distance": ("target distance", "m"), "angle": ("target angle", "deg"), "effort": ("leg yaw", "rad²·s")}
_STRATEGIES = ((style.BLUE, "o"), (style.ORANGE, "s"))
_SLOW = "Below it a bend that starts from straight grows fast enough for the task; next to the pitchfork it does not."
_TOP, _TOP_HOPF = (41, 15, 10, 7, 5), (41, 10, 5, 3, 2)  # N*mm/deg, on the upper axis


def panels(found: Turning) -> list[Panel]:
    """All figures, in the paper's order."""
    return [turning(found), *(criteria(found, each) for each in "AB"), without(found), comparison(found), why(found)]


def turning(found: Turning) -> Panel:
    """Fig. "turning" A to D."""
    task = found.tasks["A"]
    best, entry = float(task.paths.shown[1]), printed.TASKS["A"]
    by_axis, point = (found.laws.k_hat(radius)[0] for radius in (task.target.radius, np.inf))
    psi, away = np.rad2deg(task.target.bearing), task.target.distance
    return Panel(
        name="turning",
        title="Turning task A: a target ahead to the left",
        draw=draw_turning(found.robot, task),
        alt=f"A circle from the robot to a target {away:g} m away at {psi:g} degrees; walks with three springs, "
        f"of which that with {number(best)} {SPRING_UNIT} comes nearest; distance and angle of the target over "
        "time.",
        text=(
            f"A target {away:g}\u00a0m away, {psi:g}° to the left, asks for a circle of radius R/(2 sin ψ) = "
            f"{number(task.target.radius)}\u00a0m (the paper prints {typeset(str(entry.radius))}). The "
            f"robot starts straight; {k(1)} is chosen before it walks, the legs of module 1 yaw towards the target by "
            f"at most 5°. {task.criteria.sizes['repeat']} walks with each of three springs, each with its own small "
            f"disturbance: {usual_outcomes(task)}. Lines are pale after the target has been reached.",
            f"The paper shows the same of its robot with {listed(list(entry.outcomes.values()))}\u00a0{SPRING_UNIT}, "
            f"around the {entry.k_hat.value:g} that its radius law gives. The planar model bends at softer springs "
            f"(its pitchfork is at {number(point, 2)} instead of {printed.ONSET.value:g}) and its law gives "
            f"{spring(by_axis)}. Its earliest arrival, the time at which the paper's criteria are taken, is "
            f"{number(task.time)}\u00a0s; the robot's was {typeset(str(printed.ARRIVAL))}.",
        ),
        data=task.paths,
    )


def usual_outcomes(task: TurningTask) -> str:
    """Outcome of most walks with each spring that is shown."""
    by_outcome = springs_by_outcome(task.criteria).items()
    shown = [float(each) for each in task.paths.shown.values]
    return listing(f"most {what.label} with {spring(k, 2)}" for k in shown for what, those in by_outcome if k in those)


@style.in_layouts(
    style.Layout("AB;CD", 7.6, heights=(1.5, 1.0)), style.Layout("A;B;C;D", 12.6, heights=(1.0, 1.3, 0.9, 0.9))
)
def draw_turning(axes: style.Mosaic, robot: Robot, task: TurningTask) -> None:
    """Circle, paths, distance and angle of a task, as in the paper's Fig. "turning" A to D."""
    _geometry(axes["A"], robot, *task.target.position)
    data, arrival = task.paths, task.criteria.arrival.sel(spring=task.paths.shown).values
    for row, (spring_, color) in enumerate(zip(data.shown.values, _SHOWN, strict=True)):
        for repeat in range(data.sizes["repeat"]):
            one, until = data.isel(shown=row, repeat=repeat), arrival[row, repeat]
            time = one.time.values
            _run(axes["B"], time, one.x.values, one.y.values, until, color)
            _run(axes["C"], time, time, one.distance.values, until, color)
            _run(axes["D"], time, time, np.rad2deg(one.bearing.values), until, color)
        axes["B"].plot([], [], color=color, label=f"{k(1)} = {spring_:g}")
    _floor(axes["B"], data)
    axes["B"].set_title("B  Path of module 1")
    look: dict[str, Any] = {"title": f"springs in {SPRING_UNIT}", "title_fontsize": style.SMALL}
    axes.legend_below("B", 3, 3, **look)
    axes["C"].axhline(ARRIVAL_RADIUS, color=style.BLACK, lw=0.9, linestyle=DASHED)
    style.note(axes["C"], f"arrived, {ARRIVAL_RADIUS:g} m", (0.4, ARRIVAL_RADIUS), (0, 3), va="bottom")
    axes["C"].set(ylim=(0.0, 1.45), ylabel="target distance (m)", title="C  Distance of the target")
    axes["D"].axhline(0.0, color=style.BLACK, lw=0.9)
    axes["D"].set_yticks([-270, -180, -90, 0, 90, 180])
    axes["D"].set(ylim=(-290.0, 200.0), ylabel="target angle (deg)", title="D  Angle of the target")
    for letter in "CD":
        axes[letter].axvline(task.time, color=style.GREY, lw=1.0, linestyle=DOTTED)
        finish(axes[letter], xlim=(0.0, float(data.time[-1])), xlabel="time (s)")
    said = f"earliest arrival, {number(task.time)} s"
    style.note(axes["D"], said, (task.time, -250.0), (-4, 0), ha="right", va="center")


def _run(axes: Axes, time: Array, x: Array, y: Array, until: float, color: str) -> None:
    """Line that is pale after the arrival."""
    after = time > until if np.isfinite(until) else np.zeros(time.size, bool)
    axes.plot(np.where(after, np.nan, x), np.where(after, np.nan, y), color=color, lw=1.1)
    if after.any():
        axes.plot(x[after], y[after], color=color, lw=0.8, alpha=0.3)


def _target(axes: Axes, x: float, y: float) -> None:
    """Target, and circle within which it counts as reached."""
    axes.add_patch(Circle((x, y), ARRIVAL_RADIUS, fill=False, ec=style.BLACK, lw=1.0, linestyle=DASHED, zorder=5))
    axes.plot(x, y, "+", color=style.BLACK, markersize=9, markeredgewidth=1.6, zorder=6)


def _floor(axes: Axes, data: xr.Dataset) -> None:
    """The target, the start, and equal scales."""
    _target(axes, data.attrs["target_x_m"], data.attrs["target_y_m"])
    axes.plot(0.0, 0.0, "o", color=style.BLACK, markersize=5, zorder=6)
    axes.set_aspect("equal", adjustable="datalim")
    finish(axes, xlabel="x, ahead at the start (m)", ylabel="y, to its left (m)")


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
    axes.plot([0.0, x], [0.0, y], color=style.BLACK, lw=1.1, linestyle=DASHED)
    axes.plot([0.0, 1.1 * away], [0.0, 0.0], color=style.GREY, lw=0.9)
    axes.plot([x, 0.0, 0.0], [y, radius, 0.0], color=style.BLUE, lw=1.1)
    axes.plot(0.0, radius, ".", color=style.BLUE, markersize=6)
    axes.add_patch(Arc((0.0, 0.0), 0.7, 0.7, theta1=0.0, theta2=np.rad2deg(psi), color=style.BLACK, lw=1.1))
    _target(axes, x, y)
    axes.text(0.42 * np.cos(0.5 * psi), 0.42 * np.sin(0.5 * psi), "ψ", ha="center", va="center")
    axes.text(0.55 * x, 0.55 * y, "R ", ha="right", va="bottom")
    axes.text(-0.04, 0.5 * radius, "r̂", ha="right", va="center", color=style.BLUE)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set(xlim=(-robot.body.length, 1.15 * away), ylim=(-0.15, 2.05 * radius))
    axes.set_title("A  The circle to the target, to scale")


def criteria(found: Turning, letter: str) -> Panel:
    """Fig. "turning" E, task A, and Fig. "another", task B."""
    task, first = found.tasks[letter], letter == "A"
    flat, whole = (minima(task.criteria).sel(criterion=name) for name in ("effort", "effort_until_arrival"))
    smallest = minima(task.criteria)["at"].sel(criterion=list(CRITERION_NAMES)).values
    psi, away, law = np.rad2deg(task.target.bearing), task.target.distance, found.laws.k_hat(task.target.radius)[0]
    shown = {walks_of(task): task}
    other = f"Task {letter} ({psi:g}°, {away:g} m): the criteria again"
    return Panel(
        name="turning-criteria" if first else "turning-another",
        title="Task A: the paper's three criteria over the spring" if first else other,
        draw=draw_criteria(shown, _TOP, k_hat=law),
        alt="Distance, angle and leg yaw over the compliance of the first spring, smallest at "
        f"{listing(number(each, 2) for each in smallest)} {SPRING_UNIT}.",
        text=(
            _said(found, letter),
            f"ε3 has no clear minimum within this task: from {flat.softest:g} to {flat.stiffest:g}\u00a0{SPRING_UNIT} "
            "no difference is told, because the legs stand at their limit of 5° until the target "
            "is passed, to whichever side. Integrated until each robot arrives, when its task is done, it is smallest "
            f"at {spring(whole['at'], 2)}. A farther target shows a minimum (last figure)."
            if first
            else "",
        ),
        data=task.criteria,
    )


def comparison(found: Turning) -> Panel:
    """Fig. "comparison": pitchfork against Hopf."""
    task = found.tasks["A"]
    ever = int(np.isfinite(found.hopf.criteria.arrival.values).sum())
    return Panel(
        name="turning-hopf",
        title="Pitchfork against Hopf",
        draw=draw_comparison(task, found.hopf, _TOP_HOPF),
        alt="The three criteria over the spring for the two strategies; the pitchfork's smallest values lie below.",
        text=(
            "The earlier strategy softens all springs together, so that the straight walk gives way to an undulation "
            f"(below {spring(found.hopf_point, 3)} in the planar model, the robot's Hopf point is "
            f"{printed.UNIFORM.value:g}). Same task, same time, same disturbances: "
            f"at best, pitchfork against Hopf: {typeset(in_words(task, found.hopf))}. "
            + {
                True: "Every minimum of the pitchfork is lower, as in the paper.",
                False: "Not every minimum of the pitchfork is lower, unlike in the paper.",
                None: "Whether every minimum of the pitchfork is lower, as in the paper, these walks leave open.",
            }[all_lower(task, found.hopf).answer],
            f"With uniform springs {ever} of {found.hopf.criteria.arrival.size} walks arrive. Their criteria are "
            f"smallest at {typeset(softest_minima(found.hopf, found.hopf_point)[0])}; there the walks scatter: "
            "how the body swings when it passes the target decides. ε3 tells the two apart least: "
            f"{typeset(saturation(task, found.hopf))} (its axis does not start at zero).",
        ),
        data=both_strategies(task, found.hopf),
    )


def both_strategies(*tasks: TurningTask) -> xr.Dataset:
    """The criteria of several tasks in one table."""
    each = [task.criteria.assign_coords(strategy=task.criteria.attrs["strategy"]) for task in tasks]
    return xr.concat(each, dim="strategy", join="outer", combine_attrs="drop_conflicts")


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
        f"{outcome_words(task.criteria, trials.span)}. The minima (parabola through the lowest mean and its "
        f"neighbours): {places(task)}\u00a0{SPRING_UNIT}. The dashed line is the spring of the radius law, "
        f"{spring(k_hat)}; for the robot the paper's is {printed.TASKS[letter].k_hat.value:g}, with all three minima "
        f"around it. In the model they lie at {listing(number(part, 2) for part in parts)} of the law's spring."
        + (f" {_SLOW}" if min(parts) < 1.0 else "")
        + " The axis of ε3 does not start at zero."
    )


def places(task: TurningTask) -> str:
    """Springs at the minima of the criteria."""
    at = minima(task.criteria)["at"]
    return listing(
        f"{title.partition(',')[0]} at {number(at.sel(criterion=name), 3)}" for name, title in CRITERION_NAMES.items()
    )


def walks_of(task: TurningTask) -> str:
    """Name of the means of a task."""
    return f"mean of {task.criteria.sizes['repeat']} walks ± standard error"


def draw_comparison(task: TurningTask, hopf: TurningTask, top: Sequence[float]) -> style.Drawing:
    """The three criteria over 1/k of the two strategies, with springs to mark on the top axis."""
    shown = {"pitchfork: first spring alone": task, "Hopf: all springs alike": hopf}
    return draw_criteria(shown, top, "k")


@style.in_layouts(style.Layout("ABC", 3.9), style.Layout("A;B;C", 9.9))
def draw_criteria(
    axes: style.Mosaic,
    shown: Mapping[str, TurningTask],
    top: Sequence[float],
    name: str = k(1),
    k_hat: float | None = None,
) -> None:
    """The three criteria over 1/k of one or two tasks by their names, with some springs (N*mm/deg) on the top axis.

    With the spring of a radius law, ``k_hat`` (N*mm/deg), the springs that arrive are shaded; without it the lowest
    mean of the first task is marked.
    """
    first = next(iter(shown.values()))
    arrived = springs_by_outcome(first.criteria)[Outcome.ARRIVED]
    for place, criterion in zip("ABC", CRITERION_NAMES, strict=True):
        one, factor = axes[place], SCALES[criterion][0]
        for (label, task), (color, marker) in zip(shown.items(), _STRATEGIES, strict=False):
            data = task.criteria.isel(instant=0, missing_dims="ignore")
            mean, error = (factor * data[f"{criterion}_{what}"].values for what in ("mean", "error"))
            errorbars(one, 1.0 / data.spring.values, mean, error, color, marker, label, joined=True)
        if k_hat is None:
            low = factor * float(minima(first.criteria)["mean"].sel(criterion=criterion))
            one.axhline(low, color=style.BLUE, lw=0.9, linestyle=DOTTED)
        else:
            law = f"radius law, k̂₁ = {number(k_hat, 4)}"
            one.axvline(1.0 / k_hat, color=style.VERMILLION, lw=1.2, linestyle=DASHED, label=law)
            if arrived:
                shade = 1.0 / max(arrived), 1.0 / min(arrived)
                one.axvspan(*shade, color=style.PALE, zorder=0, label="arrives")
        title, unit = _AXES[criterion]
        finish(one, "y", title=f"{place}  ε{'ABC'.index(place) + 1}: {title}", ylabel=f"{title} ({unit})")
        one.set_xlim(left=0.0)
        # The third hardly differs: not from zero, as the text says.
        low, high = one.dataLim.y0, one.dataLim.y1
        one.set_ylim(*((0.95 * low, 1.02 * high) if criterion == "effort" else (0.0, None)))
        over_compliance(one, top, name)
    axes.legend_below("A", 3)


def without(found: Turning) -> Panel:
    """Fig. "without": trajectories with and without leg yaw."""
    data, cases = found.without, by_leg_yaw(found.without)
    said = [f"with {spring(case.spring, 3)} {trials.counted(case.alone)} arrive, {sides(case)}" for case in cases]
    helped = [f"{trials.counted(case.helped)} arrive with {spring(case.spring, 3)}" for case in cases]
    largest = float(np.rad2deg(max(np.abs(case.alone.turned).max() for case in cases)))
    return Panel(
        name="turning-without",
        title="With and without leg yaw",
        draw=lambda narrow: draw_without(data, narrow),
        alt="Paths of module 1: without leg yaw they go almost straight, some to the left and some to the right; with "
        "leg yaw they turn to the target.",
        text=(
            f"Without the help of the legs the side is left to chance and the bend grows slowly: {listing(said)}; no "
            f"heading has changed by more than {number(largest, 2)}° after {number(data.time[-1], 2)}\u00a0s. "
            "The paper found the same with its robot: many of nine walks failed, because the bend took long to come or "
            "went the wrong way, and all five with leg yaw arrived.",
            f"With leg yaw {listing(helped)}. The first is the spring that comes nearest to the target, the second "
            "that of the radius law, so close to the pitchfork that its bend hardly grows within the task.",
        ),
        data=data,
    )


def sides(case: LegYaw) -> str:
    """Sides to which the walks without leg yaw turn."""
    left = int((case.alone.turned > 0.0).sum())
    return f"{left} turn left and {arrivals(case.alone)[1] - left} right"


def draw_without(data: xr.Dataset, narrow: bool) -> Figure:
    """Paths with and without leg yaw, a panel for each spring."""
    cases = by_leg_yaw(data)
    axes = style.Mosaic(*(_WITHOUT if len(cases) > 1 else _WITHOUT_ONE), narrow)
    for case, letter in zip(cases, "AB", strict=False):
        for walks, color, name in ((case.alone, style.ORANGE, "without"), (case.helped, style.GREEN, "with")):
            first, *_ = axes[letter].plot(walks.x.values.T, walks.y.values.T, color=color, lw=1.1)
            first.set_label(f"{name} leg yaw, {arrivals(walks)[1]} walks")
        _floor(axes[letter], data)
        axes[letter].set_title(f"{letter}  {case.name.capitalize()}, {number(case.spring, 3)} {SPRING_UNIT}")
    axes.legend_below("A", 2)
    return axes.figure


def why(found: Turning) -> Panel:
    """Reasons why the best spring is not the law's: start and length of the way."""
    settled, farther = found.settled, found.farther
    best = [float(farther.spring[int(row.argmin())]) for row in farther.effort.values]
    cm = 100.0 * settled.start_nearest
    apart = listing(
        f"{number(cm.sel(task=task, start='bent'), 2)} and "
        f"{number(cm.sel(task=task, start='bent, aimed'), 2)}\u00a0cm in task {task}"
        for task in settled.task.values
    )
    return Panel(
        name="turning-why",
        title="Why the best spring is not that of the radius law",
        draw=_draw_why(settled, farther),
        alt="How near the target comes at the spring of the law, starting straight and bent; and the leg yaw needed "
        "for targets at several distances over the spring.",
        text=(
            "The law is not wrong: it speaks of the settled curve. Undisturbed, without leg yaw and at the law's own "
            "spring, a robot that starts straight goes straight on. One that starts bent passes close by the target, "
            "and closer still once it is taken into account that on its curve module 1 does not move where it points, "
            f"but {listing(f'{number(angle, 2)}°' for angle in abs(np.rad2deg(settled.slip)))} to the outside "
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


@style.in_layouts(style.Layout("AB", 4.0), style.Layout("A;B", 7.8))
def _draw_why(axes: style.Mosaic, settled: xr.Dataset, farther: xr.Dataset) -> None:
    rows = np.arange(settled.sizes["start"])
    for task, color, shift in zip(settled.task.values, (style.BLUE, style.ORANGE), (-0.17, 0.17), strict=False):
        values = settled.start_nearest.sel(task=task).values
        axes["A"].barh(rows + shift, values, 0.3, color=color, label=f"task {task}")
        for row, value in zip(rows, values, strict=True):
            style.note(axes["A"], f"{value:.2f}", (value, row + shift), (4, 0), va="center")
    axes["A"].set_yticks(rows, [str(start).replace(", ", ",\n") for start in settled.start.values])
    axes["A"].set(ylim=(rows[-1] + 0.55, -0.55), xlim=(0.0, 1.2 * float(settled.start_nearest.max())))
    axes["A"].axvline(ARRIVAL_RADIUS, color=style.BLACK, lw=0.9, linestyle=DASHED)
    finish(axes["A"], "x", "lower right", xlabel="nearest distance of the target (m)", title="A  Start, no leg yaw")
    for row, (color, dash) in zip(farther.effort_part.values, _CURVES, strict=False):
        look: dict[str, Any] = {"color": color, "linestyle": dash, "marker": "o", "markersize": 4}
        axes["B"].plot(1.0 / farther.spring.values, 100.0 * row, **look)
    title, label = "B  Leg yaw needed, farther targets", "ε3 / legs always at 5° (%)"
    finish(axes["B"], ylim=(0.0, 135.0), xlabel="1/k₁ (deg/(N·mm))", ylabel=label, title=title)
    axes["B"].legend([f"R = {away:g} m" for away in farther.away.values], loc="upper center", ncols=2)
