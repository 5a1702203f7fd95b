"""The walks of the paper's two movies: what the springs do, and three attempts at a turn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.parameters import K1
from chilopod.paper import printed
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import LegYawController
from chilopod.trials import NONE, Trial, run, together

TASK_A = printed.TASKS["A"].target
Springs = tuple[float, float, float]

_WALK = 45.0  # s
_ROBOT_STILLS = ((2.0, 30.0, 60.0, 88.0), (0.5, 8.0, 16.0, 24.0))  # s
_ROBOT_WALK = 90.0
_TASK, _ROBOT_TASK = 24.0, 32.0
_BEND = tuple(float(angle) for angle in np.deg2rad([20.0, 10.0, 14.0, 12.0, 4.0]))


@dataclass(frozen=True)
class Movie:
    """A film of walks side by side.

    Attributes
    ----------
    name, heading, titles
        Name of its files, heading above all panels, and titles of these.
    speed, stills
        Seconds of the walks per second of the film, and moments of it that are pictured in three dimensions, s; none of
        a film from above.
    size
        Width and height of a film from above, pixels; that of three panels in a row.
    """

    name: str
    heading: str
    titles: tuple[str, ...]
    record: xr.Dataset
    speed: float
    stills: tuple[float, ...] = ()
    size: tuple[int, int] = (1280, 320)


def movies(
    robot: Robot,
    springs: Springs,
    best: float,
    folder: str | Path | None = None,
    progress: Progress = silent,
    shorter: float = 1.0,
) -> list[Movie]:
    """Walk what is filmed, or a part of it that is ``shorter``.

    Parameters
    ----------
    springs
        First springs of the three walks of movie 1, N*m/rad: one that walks straight, one that curves a little, one
        that curves a lot. They start bent in the shape of the critical mode, for from straight it would take them
        minutes to bend.
    best
        First spring for task A, N*m/rad; movie 2 shows it between one that is too stiff and one that is too soft.
    """
    joints = robot.body.modules - 1
    bend, tried = (_BEND + (0.0,) * joints)[:joints], (4.0 * best, best, 0.7 * best)
    walk = Trial(robot, shorter * _WALK, 0, bend, disturbance=NONE, rate=25.0)
    return _movies("", walk, shorter * _TASK, (springs, tried), folder, progress)


def robot_movies(
    robot: Robot,
    springs: Springs,
    tried: Springs,
    folder: str | Path | None = None,
    progress: Progress = silent,
    shorter: float = 1.0,
) -> list[Movie]:
    """The same of the whole robot: the walks of movie 1 start straight but for their disturbance, as the paper's do;
    those of movie 2 have the springs ``tried``, N*m/rad: too stiff, best, too soft."""
    walk = Trial(robot, shorter * _ROBOT_WALK, 1, rate=25.0, engine="twin", poses=True)
    found = _movies("robot-", walk, shorter * _ROBOT_TASK, (springs, tried), folder, progress, speed=3.0)
    return [
        replace(movie, stills=tuple(shorter * moment for moment in stills))
        for movie, stills in zip(found, _ROBOT_STILLS, strict=True)
    ]


def _movies(
    prefix: str,
    walk: Trial,
    duration: float,
    springs: tuple[Springs, Springs],
    folder: str | Path | None,
    progress: Progress,
    speed: float = 2.0,
) -> list[Movie]:
    """Movie 1 of a walk, and movie 2 of task A, in the same engine and so long, with three springs each."""
    steered: dict[str, Any] = {"target": TASK_A, "controller": LegYawController(), "disturbance": NONE}
    task = replace(walk, duration=duration, seed=0, joint_angles=(), **steered)
    asked = [
        replace(each, robot=walk.robot.with_value(K1, value))
        for each, values in zip((walk, task), springs, strict=True)
        for value in values
    ]
    records = run(asked, folder, progress)
    kinds = ("straight", "curved a little", "curved a lot", "too stiff", "best", "too soft")
    names = [units.format(value, "N*mm/deg", digits=3).replace("*", "·") for values in springs for value in values]
    titles = tuple(f"k1 = {name}: {kind}" for name, kind in zip(names, kinds, strict=True))
    return [
        Movie(f"{prefix}movie-1", "One spring decides how the robot walks", titles[:3], together(records[:3]), speed),
        Movie(f"{prefix}movie-2", f"Turning to a target, {TASK_A}", titles[3:], together(records[3:]), 1.0),
    ]
