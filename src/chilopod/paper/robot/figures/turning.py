"""The whole robot's turning tasks as the paper arranges them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from chilopod.paper import printed
from chilopod.paper.measures import spring_for
from chilopod.paper.printed import CRITERION_NAMES
from chilopod.paper.robot.turning import INSTANTS, RobotTurning, verdict
from chilopod.paper.robot.walks import RobotWalks
from chilopod.paper.shapes import DASHED, finish
from chilopod.paper.statements import listed
from chilopod.paper.turning import figures as planar
from chilopod.paper.turning.study import in_words, saturation
from chilopod.paper.turning.trials import TurningTask, by_leg_yaw, counted, outcome_words
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number, typeset

_TOP = (75, 41, 28, 21, 15, 10)
_TOP_HOPF = (75, 41, 21, 15, 11, 8.7)


def panels(found: RobotTurning, walks: RobotWalks | None) -> Iterator[Panel]:
    """All figures, in the paper's order."""
    yield turning(found)
    for letter in found.tasks:
        yield criteria(found, letter, walks)
    yield without(found)
    if found.hopf is not None:
        yield comparison(found, found.hopf)


def turning(found: RobotTurning) -> Panel:
    """Fig. "turning" A to D."""
    task = found.tasks["A"]
    paper = [f"{what.label} with {spring:g}" for what, spring in printed.TASKS["A"].outcomes.items()]
    return Panel(
        name="robot-turning",
        title="The robot in three dimensions: turning task A",
        draw=planar.draw_turning(found.robot, task),
        alt="The circle to the target; paths, distance and angle of the target over time with three springs.",
        text=(
            "The twin sees the target with its scanner, as the robot does, and yaws the legs of module 1 towards it; "
            f"nothing of this was fitted but the walking speed. {task.criteria.sizes['repeat']} walks with each of "
            f"three springs: {planar.usual_outcomes(task)}. The paper's robot {listing(paper)}\u00a0{SPRING_UNIT}. The "
            f"earliest arrival, when the criteria are taken, is at {number(task.time)}\u00a0s; the robot took "
            f"{typeset(str(printed.ARRIVAL))}.",
        ),
        data=task.paths,
    )


def criteria(found: RobotTurning, letter: str, walks: RobotWalks | None) -> Panel:
    """Fig. "turning" E and "another"."""
    task, paper = found.tasks[letter], printed.TASKS[letter].k_hat.value
    own = spring_for(walks.base, task.target.radius).value if walks else float("nan")
    k_hat = own if np.isfinite(own) else paper
    return Panel(
        name=f"robot-criteria-{letter.lower()}",
        title=f"The robot in three dimensions: the three criteria, task {letter}",
        draw=planar.draw_criteria({planar.walks_of(task): task}, _TOP, k_hat=k_hat),
        alt=f"Distance, angle and leg yaw over 1/{k(1)}: {planar.places(task)}.",
        text=(
            f"Means and standard errors of {task.criteria.sizes['repeat']} walks at {number(task.time)}\u00a0s. "
            f"Most walks with each spring: {outcome_words(task.criteria, listed)}. The minima: {planar.places(task)}"
            f"\u00a0{SPRING_UNIT}; the paper has all three around {paper:g}. The dashed line is the spring whose "
            f"settled walk has the radius of the circle, {number(k_hat, 3)}\u00a0{SPRING_UNIT}"
            + (", by the twin's own walks." if np.isfinite(own) else ", by the paper.")
            + " The axis of ε3 does not start at zero.",
        ),
        data=task.criteria,
    )


def without(found: RobotTurning) -> Panel:
    """Fig. "without"."""
    data, (case,) = found.without, by_leg_yaw(found.without)
    return Panel(
        name="robot-without",
        title="The robot in three dimensions: with and without leg yaw",
        draw=lambda narrow: planar.draw_without(data, narrow),
        alt="Paths of module 1 with and without leg yaw.",
        text=(
            f"Task A with {k(1)} = {case.spring:g}\u00a0{SPRING_UNIT}. Without leg yaw {counted(case.alone)} arrive, "
            f"{planar.sides(case)}: the bend takes its time, and chance has the side. With it {counted(case.helped)} "
            "arrive. The paper's robot: many of nine fail, all of five do not.",
        ),
        data=data,
    )


def comparison(found: RobotTurning, hopf: TurningTask) -> Panel:
    """Comparison of the two strategies (the paper's Fig. "comparison")."""
    task = found.tasks["A"]
    return Panel(
        name="robot-hopf",
        title="The robot in three dimensions: pitchfork against Hopf",
        draw=planar.draw_comparison(task, hopf, _TOP_HOPF),
        alt="The three criteria over the spring for the two strategies.",
        text=(
            "Task A with all springs alike, the paper's five values, with the same disturbances. Criteria are taken at "
            "the earliest arrival over both strategies. "
            f"At best, pitchfork against Hopf: {typeset(in_words(task, hopf))}. In the paper all three are "
            "lower for the pitchfork. The t test of the differences, seed by seed, decides here, and counts how many "
            "springs are no worse than the best. The "
            f"third says little where it is nearly saturated: {typeset(saturation(task, hopf))}.",
        ),
        data=planar.both_strategies(task, hopf),
    )


def strategies(data: xr.Dataset) -> Panel:
    """Comparison of the two strategies with more trials, for legs that yaw less."""
    parts = []
    for limit in data.limit.values:
        at = data.sel(limit=limit, instant=INSTANTS[0])
        numbers = [f"{number(one, 3)} ({number(low, 3)} to {number(high, 3)})"
                   for one, low, high in zip(at.ratio, at.low, at.high, strict=True)]  # fmt: skip
        parts.append(f"{limit:g}° {listing(numbers)}")
    return Panel(
        name="robot-strategies",
        title="The robot in three dimensions: pitchfork against Hopf, by how far legs yaw",
        draw=_draw_strategies(data),
        alt="Ratio of the smallest criteria of the two strategies, with intervals, for three limits of the leg yaw.",
        text=(
            f"Task A, {data.attrs['repeats']} walks with each spring. {verdict(data)}. Smallest ε1, ε2 and ε3 of the "
            f"pitchfork over those of Hopf at the earliest arrival over both, with intervals of 95\u00a0% by "
            f"bootstrap over the trials, by the largest yaw of the legs: {'; '.join(parts)}. The paper has all three "
            "below 1. Its legs are told to yaw by 5°; by how much they do is not printed.",
        ),
        data=data,
    )


@style.in_layouts(style.Layout("A", 3.6), style.Layout("A", 4.0))
def _draw_strategies(axes: style.Mosaic, data: xr.Dataset) -> None:
    rows, at = np.arange(data.sizes["criterion"]), data.sel(instant=INSTANTS[0])
    for index, limit in enumerate(data.limit.values):
        one = at.sel(limit=limit)
        span = np.abs(np.array([one.low, one.high]) - one.ratio.values)
        place, color = rows + 0.2 * (index - 1), style.CURVES[index % len(style.CURVES)]
        axes["A"].errorbar(one.ratio, place, xerr=span, fmt="o", color=color, capsize=3.0, label=f"{limit:g}°")
    axes["A"].axvline(1.0, color=style.GREY, lw=1.2, linestyle=DASHED)
    axes["A"].set_yticks(rows, list(CRITERION_NAMES.values()))
    axes["A"].invert_yaxis()
    finish(axes["A"], "x", xlabel="pitchfork over Hopf")
    axes.legend_below("A", 3, 3)
