"""The paper's turning experiments with its own springs, as trials of the twin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from chilopod.paper import printed
from chilopod.paper.section import Context, Size
from chilopod.paper.turning.trials import DURATION, TurningTask, turning_task, without_leg_yaw
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
    """All turning tasks of the paper by the whole robot; if quick, all of task A with the first spring alone."""
    robot, size = context.whole, context.size
    repeats, springs, duration = size.cut((printed.REPEATS, SPRINGS, TASK_DURATION), (2, SHOWN, 6.0))
    quick = size is Size.QUICK
    same: dict[str, Any] = {"duration": duration, "engine": "twin", "folder": context.folder}
    tasks = {}
    for index, (letter, task) in enumerate(list(printed.TASKS.items())[: 1 if quick else None]):
        share = part(progress, 0.35 * index, 0.35 * (index + 1), f"task {letter}")
        tasks[letter] = turning_task(robot, task.target, springs, repeats, shown=SHOWN, progress=share, **same)
    first, share = tasks["A"], part(progress, 0.7, 0.9, "uniform springs")
    how = {"strategy": "hopf", "time": first.time, **same}
    hopf = None if quick else turning_task(robot, first.target, HOPF_SPRINGS, repeats, progress=share, **how)
    one, share = {"paper's spring": printed.TASKS["A"].k_hat.value}, part(progress, 0.9, 1.0, "without leg yaw")
    without = without_leg_yaw(robot, first.target, one, progress=share, **same)
    return RobotTurning(robot, tasks, hopf, without)
