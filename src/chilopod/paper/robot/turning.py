"""The paper's turning experiments with its own springs, as trials of the twin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from chilopod.paper import printed
from chilopod.paper.section import QUICK_REPEATS, Context, Size
from chilopod.paper.turning.trials import DURATION, TurningTask, strategy_tasks, without_leg_yaw
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot

SPRINGS = (10.0, 15.0, 17.0, 21.0, 26.0, 28.0, 34.0, 41.0, 75.0)
"""k1 of the tasks, N*mm/deg: the paper's and some between."""

SHOWN = (15.0, 21.0, 41.0)
"""k1 of the paths that the paper shows, N*mm/deg."""

HOPF_SPRINGS = (8.7, 11.0, 15.0, 21.0, 41.0)
"""All springs, of the strategy by Hopf bifurcation, N*mm/deg: the paper's."""

TASK_DURATION = 1.5 * DURATION
"""Duration of the tasks, s. The paper prints the earliest arrival only; in 1.5 times this time a robot of the same
speed arrives, or passes the target."""


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
