"""Turning tasks together, and the causes of the difference between the best spring and the law's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from chilopod import trials
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.radius_law import RadiusLaws, radius_laws
from chilopod.analysis.straight_walk import first_loss
from chilopod.paper import printed
from chilopod.paper.measures import Folder, over_springs
from chilopod.paper.section import Context, Size
from chilopod.paper.turning.trials import (
    DURATION,
    RATE,
    SPRINGS,
    UNIFORM_SPRINGS,
    TurningTask,
    to_target,
    turning_task,
    without_leg_yaw,
)
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.steering import LegYawController, Target, earliest_arrival, evaluate
from chilopod.trials import NONE, Disturbance, Trial

ROUGH = 3.0
"""Multiples of the usual disturbance, for the check that conclusions do not depend on it."""

FARTHER = (1.3, 2.0, 3.0, 4.5)
"""Distances of targets in the direction of task A, for the effect of a longer way, m."""

FARTHER_SPRINGS = (8, 9, 10, 11, 12, 12.5, 13, 14, 15, 17, 19, 21, 24, 28, 41)
QUICK_SPRINGS = (6, 7, 8, 9, 10, 11, 12, 21)
ROUGH_SPRINGS = (6, 7, 8, 8.5, 9, 9.5, 10, 11, 12, 13, 15, 21)
"""Springs of these trials, of quick ones, and of rough ones, N*mm/deg."""


@dataclass(frozen=True)
class Turning:
    """Results of the turning studies."""

    robot: Robot
    laws: RadiusLaws
    tasks: Mapping[str, TurningTask]  # the paper's two, by letter
    hopf: TurningTask  # task A with uniform springs
    rough: TurningTask  # task A with a disturbance :data:`ROUGH` times as large
    hopf_point: float  # Neimark-Sacker point of uniform springs, N*mm/deg
    without: xr.Dataset  # task A with and without leg yaw, at the best spring and at the law's
    settled: xr.Dataset  # see :func:`settled_start`
    farther: xr.Dataset  # see :func:`farther_targets`


def turning(context: Context, progress: Progress = silent) -> Turning:
    """All turning studies of the robot of the planar model; if not full, fewer springs and fewer, nearer targets."""
    robot, folder, quick = context.robot, context.folder, context.size is not Size.FULL
    springs = QUICK_SPRINGS if quick else SPRINGS
    laws = radius_laws(robot)
    tasks: dict[str, TurningTask] = {}
    for index, (letter, said) in enumerate(printed.TASKS.items()):
        share = part(progress, 0.25 * index, 0.25 * (index + 1), f"task {letter}")
        tasks[letter] = turning_task(robot, said.target, springs, folder=folder, progress=share)
    task = tasks["A"]
    same: dict[str, Any] = {"folder": folder, "progress": part(progress, 0.5, 0.65, "uniform springs")}
    uniform = UNIFORM_SPRINGS[::3] if quick else UNIFORM_SPRINGS
    hopf = turning_task(robot, task.target, uniform, strategy="hopf", time=task.time, **same)
    same["progress"] = part(progress, 0.65, 0.85, "larger disturbances")
    rougher = Disturbance().scaled(ROUGH)
    rough_springs = QUICK_SPRINGS if quick else ROUGH_SPRINGS
    rough = turning_task(robot, task.target, rough_springs, disturbance=rougher, **same)
    springs_ = {"best spring": task.best, "spring of the law": laws.k_hat(task.target.radius)[0]}
    share = part(progress, 0.85, 0.9, "with and without leg yaw")
    without = without_leg_yaw(robot, task.target, springs_, folder=folder, progress=share)
    settled = settled_start(robot, laws, {letter: each.target for letter, each in tasks.items()}, folder)
    distances = FARTHER[:2] if quick else FARTHER
    farther = farther_targets(robot, laws, task.target.bearing, distances, folder)
    progress(1.0, "turning tasks")
    point = first_loss(robot, ALL, None, Kind.NEIMARK_SACKER, normal_form=False)
    return Turning(robot, laws, tasks, hopf, rough, point.value, without, settled, farther)


def settled_start(robot: Robot, laws: RadiusLaws, targets: Mapping[str, Target], folder: Folder = None) -> xr.Dataset:
    """Arrival with the spring of the law if the walk begins on its curve.

    One undisturbed trial without leg yaw for each start, at the spring of the law by the path of module 1: "straight";
    "bent", the settled walk; and "bent, aimed", with the target relative to the motion of module 1 instead of its
    heading.

    Returns
    -------
    Dataset over (task, start): ``start_nearest`` (m); over task: ``law_spring`` (N*mm/deg) and ``slip``, the mean
    angle from heading to motion of module 1 on the settled walk (rad).
    """
    found = []
    for target in targets.values():
        _, spring = laws.k_hat(target.radius)
        walker = robot.with_value(K1, stiffness(spring))
        straight = Trial(walker, DURATION, target=target, disturbance=NONE, rate=RATE)
        bent = replace(straight, joint_angles=laws.joint_angles(spring))
        records = trials.run([straight, bent], folder)
        slip = _slip(records[1])
        aimed = Target(target.bearing + slip, target.distance)
        records += trials.run([replace(bent, target=aimed)], folder)
        found.append((*(float(record.distance.min()) for record in records), spring, slip))
    columns = np.array(found)
    return xr.Dataset(
        {
            "start_nearest": (("task", "start"), columns[:, :3], {"units": "m"}),
            "law_spring": ("task", columns[:, 3], {"units": PAPER_UNIT}),
            "slip": ("task", columns[:, 4], {"units": "rad"}),
        },
        coords={"task": list(targets), "start": ["straight", "bent", "bent, aimed"]},
        attrs={"robot": robot.name},
    )


def _slip(record: xr.Dataset) -> float:
    """Mean angle from heading to velocity of module 1, rad; over the second half of a walk."""
    late = record.isel(robot=0, time=slice(record.sizes["time"] // 2, None))
    moving = np.arctan2(late.velocity.sel(axis="y").values, late.velocity.sel(axis="x").values)
    return float(np.mean((moving - late.heading.values + np.pi) % (2.0 * np.pi) - np.pi))


def farther_targets(
    robot: Robot,
    laws: RadiusLaws,
    bearing: float,
    distances: Sequence[float],
    folder: Folder,
) -> xr.Dataset:
    """Results for targets in one direction at growing distances, with the effect of the time that a bend needs to grow.

    One undisturbed trial each, with leg yaw, with a duration in proportion to the distance.

    Returns
    -------
    Dataset over (away, spring): ``nearest`` (m), ``effort`` until the earliest arrival of that distance, and
    ``effort_part``, its ratio to the effort of legs at their limit all the time (1); over away: ``earliest`` (s),
    ``k_hat`` by the law (N*mm/deg).
    """
    limit, both, found = LegYawController().limit, ("spring",), []
    for away in distances:
        target, duration = Target(bearing, away), DURATION * away / distances[0]
        asked = [to_target(robot, target, spring, duration=duration, disturbance=NONE) for spring in FARTHER_SPRINGS]
        record = trials.together(trials.run(asked, folder))
        earliest = earliest_arrival(record)
        result = evaluate(record, earliest)
        found.append(
            xr.Dataset(
                {
                    "nearest": (both, result.nearest, {"units": "m"}),
                    "effort": (both, result.effort, {"units": "rad^2*s"}),
                    "effort_part": (both, result.effort / (2.0 * limit**2 * earliest), {"units": "1"}),
                    "earliest": ((), earliest, {"units": "s"}),
                    "k_hat": ((), laws.k_hat(target.radius)[0], {"units": PAPER_UNIT}),
                },
                coords={"away": ((), away, {"units": "m"}), "spring": over_springs(FARTHER_SPRINGS)},
                attrs={"robot": robot.name, "bearing_deg": math.degrees(bearing)},
            )
        )
    return xr.concat(found, "away")
