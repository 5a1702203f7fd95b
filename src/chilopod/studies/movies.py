"""The walks of the paper's two movies: what the springs do, and three attempts at a turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.robot import Robot
from chilopod.steering import LegYawController, Target
from chilopod.studies.floquet import K1
from chilopod.studies.trials import NONE, Trial, run, together

Progress = Callable[[float, str], None]

TASK_A = Target(float(np.deg2rad(45.0)), 1.3)

_WALK = 45.0  # s
_TASK = 24.0
_BEND = tuple(float(angle) for angle in np.deg2rad([20.0, 10.0, 14.0, 12.0, 4.0]))


@dataclass(frozen=True)
class Movie:
    """A film of walks side by side.

    Attributes
    ----------
    name
        Of its files.
    heading
        Above all panels.
    titles
        Of the panels.
    record
        The walks.
    speed
        Seconds of the walks per second of the film.
    """

    name: str
    heading: str
    titles: tuple[str, ...]
    record: xr.Dataset
    speed: float


def movies(
    robot: Robot,
    springs: tuple[float, float, float],
    best: float,
    folder: str | Path | None = None,
    progress: Progress = lambda done, words: None,
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
        Where records are kept.
    progress
        Called with the part done (0 to 1) and a few words.
    """

    def with_spring(value: float) -> Robot:
        return robot.with_value(K1, value)

    def named(value: float) -> str:
        return f"k1 = {units.format(value, 'N*mm/deg', digits=3).replace('*', '·')}"

    joints = robot.body.modules - 1
    bend = (_BEND + (0.0,) * joints)[:joints]
    walks = [Trial(with_spring(value), _WALK, 0, bend, disturbance=NONE, rate=25.0) for value in springs]
    tried = (4.0 * best, best, 0.7 * best)
    tasks = [Trial(with_spring(value), _TASK, 0, (), TASK_A, LegYawController(), NONE, rate=25.0) for value in tried]
    records = run([*walks, *tasks], folder, progress)
    kinds = ("straight", "curved a little", "curved a lot")
    ends = ("too stiff", "best", "too soft")
    return [
        Movie(
            "movie-1",
            "One spring decides how the robot walks",
            tuple(f"{named(value)}: {kind}" for value, kind in zip(springs, kinds, strict=True)),
            together(records[:3]),
            2.0,
        ),
        Movie(
            "movie-2",
            f"Turning to a target, {TASK_A}",
            tuple(f"{named(value)}: {end}" for value, end in zip(tried, ends, strict=True)),
            together(records[3:]),
            1.0,
        ),
    ]
