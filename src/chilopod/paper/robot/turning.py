"""The paper's turning experiments with its own springs, as trials of the twin, and its two strategies with more trials.

Pitchfork against Hopf, fairly: criteria are taken at the earliest arrival over both strategies, and beside it at each
walk's own arrival. The legs of module 1 are told to yaw by 5 deg at most. By how much those of the robot yawed is not
printed, and backlash or give would leave less, so the tasks are walked with smaller limits too.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from chilopod.paper import printed
from chilopod.paper.printed import CRITERION_NAMES
from chilopod.paper.section import QUICK_REPEATS, Context, Size
from chilopod.paper.turning.study import minima, ratios
from chilopod.paper.turning.trials import DURATION, TurningTask, strategy_tasks, without_leg_yaw
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.show.words import listing

SPRINGS = (10.0, 15.0, 17.0, 21.0, 26.0, 28.0, 34.0, 41.0, 75.0)
"""k1 of the tasks, N*mm/deg: the paper's and some between."""

SHOWN = (15.0, 21.0, 41.0)
"""k1 of the paths that the paper shows, N*mm/deg."""

HOPF_SPRINGS = (8.7, 11.0, 15.0, 21.0, 41.0)
"""All springs, of the strategy by Hopf bifurcation, N*mm/deg: the paper's."""

TASK_DURATION = 1.5 * DURATION
"""Duration of the tasks, s. The paper prints the earliest arrival only; in 1.5 times this time a robot of the same
speed arrives, or passes the target."""

LIMITS = (5.0, 4.2, 3.5)  # largest yaw of the legs of module 1, deg: as commanded, and less
STRATEGY_REPEATS = 12
INSTANTS = ("earliest arrival", "own arrival")  # at which criteria are taken

STRATEGY_SPRINGS = {"pitchfork": (17.0, 21.0, 26.0, 28.0, 34.0), "hopf": (8.7, 11.0, 15.0, 21.0)}
"""Springs by strategy, N*mm/deg, around those of the smallest criteria."""


@dataclass(frozen=True)
class RobotTurning:
    """Results of the paper's tasks, by letter, of task A with uniform springs (None if left out), and of task A
    with and without leg yaw at the paper's spring."""

    robot: Robot
    tasks: Mapping[str, TurningTask]
    hopf: TurningTask | None
    without: xr.Dataset


def robot_turning(context: Context, progress: Progress = silent) -> RobotTurning:
    """All turning tasks of the paper by the whole robot; if quick, task A with the first spring alone, with fewer
    repeats."""
    robot, size = context.whole, context.size
    quick = size is Size.QUICK
    repeats = size.of(printed.REPEATS, QUICK_REPEATS, 2)
    springs, duration = size.cut((SPRINGS, TASK_DURATION), (SHOWN, 6.0))
    same: dict[str, Any] = {"duration": duration, "engine": "twin", "folder": context.folder}
    tasks: dict[str, TurningTask] = {}
    hopf = None
    for index, (letter, task) in enumerate(list(printed.TASKS.items())[: 1 if quick else None]):
        share = part(progress, 0.45 * index, 0.45 * (index + 1), f"task {letter}")
        own = {"pitchfork": springs} | ({} if quick or letter != "A" else {"hopf": HOPF_SPRINGS})
        found = strategy_tasks(robot, task.target, own, repeats, shown=SHOWN, progress=share, **same)
        tasks[letter], hopf = found["pitchfork"], found.get("hopf", hopf)
    one, share = {"paper's spring": printed.TASKS["A"].k_hat.value}, part(progress, 0.9, 1.0, "without leg yaw")
    without = without_leg_yaw(robot, tasks["A"].target, one, progress=share, **same)
    return RobotTurning(robot, tasks, hopf, without)


def robot_strategies(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Task A with both strategies, for every limit of the legs' yaw; if not full, for the first one with fewer trials.

    Dataset over limit (deg), instant and criterion: ``ratio``, ``low`` and ``high``, the results of
    :func:`chilopod.paper.turning.study.ratios`, and, over strategy too, ``smallest`` (m, rad, rad^2*s); over limit
    ``seconds``, the earliest arrival. Attribute: ``repeats``.
    """
    repeats = context.size.of(STRATEGY_REPEATS, QUICK_REPEATS, 2)
    limits = context.size.of(LIMITS, LIMITS[:1], LIMITS[:1])
    springs = context.size.cut(STRATEGY_SPRINGS, {name: each[:1] for name, each in STRATEGY_SPRINGS.items()})
    target, duration = printed.TASKS["A"].target, context.size.cut(TASK_DURATION, 6.0)
    same: dict[str, Any] = {"duration": duration, "engine": "twin", "folder": context.folder}
    found = []
    for index, limit in enumerate(limits):
        same["progress"] = part(progress, index / len(limits), (index + 1) / len(limits), f"{limit:g} deg")
        tasks = strategy_tasks(context.whole, target, springs, repeats, limit=float(np.deg2rad(limit)), **same)
        found.append(compared(tasks).assign_coords(limit=limit))
    return xr.concat(found, "limit").assign_attrs(robot=context.whole.name, repeats=repeats)


def compared(tasks: dict[str, TurningTask]) -> xr.Dataset:
    """Part of the results of :func:`robot_strategies` for one limit."""
    names, both = list(CRITERION_NAMES), (tasks["pitchfork"], tasks["hopf"])
    found = [[ratios(*both, instant)[name] for name in names] for instant in (0, 2)]
    over = ("instant", "criterion")
    columns = {end: (over, [[getattr(one, end) for one in row] for row in found]) for end in ("value", "low", "high")}
    low = [[minima(task.criteria, instant)["mean"].sel(criterion=names).values for instant in (0, 2)] for task in both]
    return xr.Dataset(
        {**columns, "smallest": (("strategy", *over), np.array(low)), "seconds": both[0].time},
        coords={"strategy": ["pitchfork", "hopf"], "instant": list(INSTANTS), "criterion": names},
    ).rename(value="ratio")


def verdict(data: xr.Dataset) -> str:
    """Sentence on whether the paper's claim, all three lower for the pitchfork, holds, and what that hangs on."""
    by: dict[str, list[str]] = {}
    for limit, instant in itertools.product(data.limit.values, INSTANTS):
        at = data.sel(limit=limit, instant=instant)
        said = "holds" if (at.high < 1.0).all() else "fails" if (at.low > 1.0).any() else "is undecided"
        by.setdefault(said, []).append(f"{limit:g}° at the {instant}")
    parts = [f"{said} with legs that yaw by {listing(cases)}" for said, cases in by.items()]
    return f"The claim that all three minima are lower for the pitchfork {'; it '.join(parts)}"
