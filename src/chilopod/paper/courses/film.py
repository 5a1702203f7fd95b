"""A film of one course, driven with a spring that is set on the way and with the best one for all of it."""

from __future__ import annotations

from pathlib import Path

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.courses.study import without_setting
from chilopod.paper.movies import Movie
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.steering import COURSES, Course
from chilopod.tasks.course import Driven, Driver, drive, patience_of

NAMED = "eight"
"""The course of :data:`chilopod.steering.COURSES` that is filmed."""

_SEED = 0
_SPEED = 10.0
_SIZE = (960, 640)  # two panels, higher than wide


def film(
    robot: Robot,
    variable: Driver,
    best: float,
    folder: str | Path | None = None,
    progress: Progress = silent,
    shorter: float = 1.0,
) -> Movie:
    """Walk what is filmed.

    Parameters
    ----------
    robot
        The robot.
    variable
        It with the spring that is set on the way.
    best
        The spring for all of the course, N*mm/deg.
    folder, progress, shorter
        As for :func:`chilopod.paper.movies.movies`.
    """
    goals = COURSES[NAMED]
    course = Course(goals[: max(1, round(shorter * len(goals)))], patience_of("planar"))
    fixed = without_setting(robot, variable, "pitchfork", best)
    first = drive(variable, course, seed=_SEED, folder=folder, progress=part(progress, 0.0, 0.5))
    second = drive(fixed, course, seed=_SEED, folder=folder, progress=part(progress, 0.5, 1.0))
    both = Driven(first.trials + second.trials, variable, first.records + second.records)
    titles = "k1 set on the way", f"k1 = {best:g} {PAPER_UNIT.replace('*', '·')}"
    return Movie("courses-movie", f"One target after another: {NAMED}", titles, both.record, _SPEED, size=_SIZE)
