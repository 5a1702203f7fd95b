"""The walks of the paper's two movies: what the springs do, and three attempts at a turn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

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
    name
        Name of its files.
    heading
        Above all panels.
    titles
        Titles of the panels.
    record
        The walks.
    speed
        Seconds of the walks per second of the film.
    stills
        Moments of it that are pictured in three dimensions, s; none of a film from above.
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
    springs: tuple[float, float, float],
    best: float,
    folder: str | Path | None = None,
    progress: Progress = silent,
    shorter: float = 1.0,
) -> list[Movie]:
    """Walk what is filmed.

    Parameters
    ----------
    robot
        The robot.
    springs
        First springs of the three walks of movie 1, N*m/rad: one that walks straight, one that curves a little, one
        that curves a lot. They start bent in the shape of the critical mode, for from straight it would take them
        minutes to bend.
    best
        First spring for task A, N*m/rad; movie 2 shows it between one that is too stiff and one that is too soft.
    folder
        Folder of the records.
    progress
        Called with the part done (0 to 1) and a few words.
    shorter
        Part of the durations that is walked.
    """

    joints = robot.body.modules - 1
    bend = (_BEND + (0.0,) * joints)[:joints]
    walks = [
        Trial(robot.with_value(K1, value), shorter * _WALK, 0, bend, disturbance=NONE, rate=25.0) for value in springs
    ]
    tried = (4.0 * best, best, 0.7 * best)
    records = run([*walks, *_tasks(robot, tried, shorter * _TASK)], folder, progress)
    return _movies("", (*springs, *tried), records)


def robot_movies(
    robot: Robot,
    springs: tuple[float, float, float],
    tried: tuple[float, float, float],
    folder: str | Path | None = None,
    progress: Progress = silent,
    shorter: float = 1.0,
) -> list[Movie]:
    """The same of the whole robot: the walks of movie 1 start straight but for their disturbance, as the paper's do.

    Parameters
    ----------
    robot
        With a twin.
    springs
        As for :func:`movies`.
    tried
        First springs for task A, N*m/rad: too stiff, best, too soft.
    folder, progress, shorter
        As for :func:`movies`.
    """
    walks = [
        Trial(robot.with_value(K1, value), shorter * _ROBOT_WALK, 1, rate=25.0, engine="twin", poses=True)
        for value in springs
    ]
    tasks = [replace(each, engine="twin", poses=True) for each in _tasks(robot, tried, shorter * _ROBOT_TASK)]
    records = run([*walks, *tasks], folder, progress)
    first, second = _movies("robot-", (*springs, *tried), records, speed=3.0)
    return [
        replace(movie, stills=tuple(shorter * moment for moment in stills))
        for movie, stills in zip((first, second), _ROBOT_STILLS, strict=True)
    ]


def _tasks(robot: Robot, tried: tuple[float, float, float], duration: float) -> list[Trial]:
    return [
        Trial(robot.with_value(K1, value), duration, 0, (), TASK_A, LegYawController(), NONE, rate=25.0)
        for value in tried
    ]


def _movies(prefix: str, springs: tuple[float, ...], records: list[xr.Dataset], speed: float = 2.0) -> list[Movie]:
    kinds = ("straight", "curved a little", "curved a lot", "too stiff", "best", "too soft")
    names = [units.format(value, "N*mm/deg", digits=3).replace("*", "·") for value in springs]
    titles = tuple(f"k1 = {name}: {kind}" for name, kind in zip(names, kinds, strict=True))
    return [
        Movie(f"{prefix}movie-1", "One spring decides how the robot walks", titles[:3], together(records[:3]), speed),
        Movie(f"{prefix}movie-2", f"Turning to a target, {TASK_A}", titles[3:], together(records[3:]), 1.0),
    ]
