"""Everything the paper does with its robot and its planar model, done here and put beside what it prints."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import xarray as xr

from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.undulation import undulating_walks
from chilopod.errors import ParameterError, nearest_name
from chilopod.paper.curved import rows as curved_rows
from chilopod.paper.curved.study import CurvedStudy, curved_study
from chilopod.paper.fit_data import critical_mode_data, variant_settings
from chilopod.paper.movies import Movie, movies, robot_movies
from chilopod.paper.robot import numerics as twin_numerics
from chilopod.paper.robot import rows as robot_rows
from chilopod.paper.robot import turning_rows as robot_turning_rows
from chilopod.paper.robot import why as ablation
from chilopod.paper.robot.beside import planar_words
from chilopod.paper.robot.spread import COUNT as SPREAD
from chilopod.paper.robot.spread import twin_spread
from chilopod.paper.robot.structures import structures
from chilopod.paper.robot.table import RobotRow
from chilopod.paper.robot.turning import RobotTurning, robot_turning
from chilopod.paper.robot.walks import RobotWalks, robot_walks
from chilopod.paper.straight import rows as floquet_rows
from chilopod.paper.straight import study as floquet
from chilopod.paper.table import Row
from chilopod.paper.turning import rows as turning_rows
from chilopod.paper.turning.study import Turning, turning
from chilopod.robot import Robot
from chilopod.tasks.identify import Identification, identify_planar

Progress = Callable[[str, float, str], None]
"""Called with the section, the part of it that is done (0 to 1), and a few words."""

SECTIONS: Mapping[str, str] = {
    "mode": "the pitchfork in k1 and its mode",
    "exponents": "Floquet exponents as k1 falls",
    "variants": "critical k1 for the paper's variants",
    "modules": "critical k1 over the number of modules",
    "uniform": "the Neimark-Sacker point of uniform springs",
    "identification": "the constants the paper does not print",
    "branch": "the curved walks beyond the pitchfork",
    "curved": "walks from straight on, trial by trial",
    "undulation": "undulating walks of uniform springs",
    "turning": "turning to targets",
    "movies": "the paper's two movies",
    "robot-walks": "the whole robot in 3-D: its walks",
    "robot-turning": "the whole robot in 3-D: turning to targets",
    "robot-spread": "the whole robot in 3-D: other constants that fit as well",
    "robot-numerics": "the whole robot in 3-D: finer steps",
    "robot-structures": "the whole robot in 3-D: what else it could be made of",
    "robot-why": "why the robot bends earlier than the planar model",
    "robot-movies": "the paper's two movies in 3-D",
}
"""What can be asked for with ``--only``, and what it is."""

ON_REQUEST = ("robot-structures",)
"""Sections that are computed only if they are asked for by name."""

CHAPTERS: Mapping[str, tuple[str, ...]] = {
    "The straight walk and where it bends": ("mode", "exponents", "variants", "modules", "uniform", "identification"),
    "Curved walks": ("branch", "curved", "undulation"),
    "Turning to a target": ("turning", "movies"),
    "The whole robot in three dimensions": (
        "robot-walks",
        "robot-turning",
        "robot-spread",
        "robot-numerics",
        "robot-structures",
        "robot-why",
        "robot-movies",
    ),
}
"""The sections of every chapter of the report."""

_BRANCH = (6.0, 20.0)  # N*mm/deg
_FILMED = (41.0, 11.0, 8.0)  # N*mm/deg: straight, curved a little, curved a lot
_ROBOT_FILMED = (41.0, 26.0, 15.0)  # N*mm/deg, the paper's large, small and very small
_ROBOT_TRIED = (41.0, 21.0, 15.0)  # N*mm/deg, the paper's of task A
_BEST = (
    9.8  # N*mm/deg: what `chilopod turn` finds for task A; the movie takes the best of the trials where there are any
)


@dataclass
class Results:
    """What :func:`reproduce` found, section by section.

    Attributes
    ----------
    robot
        The robot everything was computed for.
    datasets
        By section, see :data:`SECTIONS`, where a section is one dataset.
    identification, curved, turning, movies, robot_walks, robot_turning, robot_movies
        The sections of these names, if they were asked for.
    whole
        The robot that walks in three dimensions, if any does.
    rows
        The table paper | computed, by section.
    robot_rows
        The table robot | twin | planar model, by section.
    seconds
        How long each section took.
    """

    robot: Robot
    datasets: dict[str, xr.Dataset] = field(default_factory=dict)
    identification: Identification | None = None
    curved: CurvedStudy | None = None
    turning: Turning | None = None
    movies: list[Movie] = field(default_factory=list)
    whole: Robot | None = None
    robot_walks: RobotWalks | None = None
    robot_turning: RobotTurning | None = None
    robot_movies: list[Movie] = field(default_factory=list)
    rows: dict[str, list[Row]] = field(default_factory=dict)
    robot_rows: dict[str, list[RobotRow]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def all_rows(self) -> list[Row]:
        """The whole table."""
        return [row for name in SECTIONS for row in self.rows.get(name, ())]

    @property
    def all_robot_rows(self) -> list[RobotRow]:
        """The whole table of the robot."""
        return [row for name in SECTIONS for row in self.robot_rows.get(name, ())]


def chosen(only: Iterable[str] | None) -> list[str]:
    """The sections asked for, in the order they are computed.

    Raises
    ------
    ParameterError
        If one of them does not exist.
    """
    names = [name for name in SECTIONS if name not in ON_REQUEST] if only is None else list(only)
    for name in names:
        if name not in SECTIONS:
            raise ParameterError(
                "no such section",
                field="only",
                value=name,
                allowed=", ".join(SECTIONS),
                nearest=nearest_name(name, SECTIONS),
            )
    return [name for name in SECTIONS if name in names]


def reproduce(
    robot: Robot,
    only: Iterable[str] | None = None,
    quick: bool = False,
    folder: str | Path | None = None,
    progress: Progress = lambda section, done, words: None,
    *,
    whole: Robot | None = None,
) -> Results:
    """Compute the sections of the report.

    Parameters
    ----------
    robot
        The robot; the paper's numbers are those of ``aoi2022-planar``.
    only
        Names of :data:`SECTIONS`; by default all that are not :data:`ON_REQUEST`.
    quick
        Coarser sweeps, fewer module counts, springs and repeats, and no other constants of the robot in three
        dimensions unless asked for; what does not depend on chance is as exact as otherwise.
    folder
        Where the records of trials are kept, so that what was stopped goes on where it was; without one nothing is
        kept.
    progress
        Called as the work goes on.
    whole
        The robot of the sections in three dimensions, with a twin, such as ``aoi2022``; without one these are left out.
    """
    results = Results(robot, whole=whole)
    for name in chosen(only):
        if name.startswith("robot-") and whole is None:
            continue
        if name == "robot-spread" and quick and only is None:
            continue
        started = time.perf_counter()
        progress(name, 0.0, SECTIONS[name])

        def report(done: float, words: str, name: str = name) -> None:
            progress(name, done, words)

        if name.startswith("robot-"):
            results.robot_rows[name] = _robot_section(results, name, quick, folder, report)
        else:
            results.rows[name] = _section(results, name, quick, folder, report)
        results.seconds[name] = time.perf_counter() - started
        progress(name, 1.0, "done")
    return results


def _section(
    results: Results, name: str, quick: bool, folder: str | Path | None, report: Callable[[float, str], None]
) -> list[Row]:
    """Compute a section, leave it in ``results``, and return its lines of the table."""
    robot, data = results.robot, results.datasets
    if name == "mode":
        data[name] = floquet.critical_mode(robot)
        return floquet_rows.mode_rows(results)
    if name == "exponents":
        data[name] = floquet.exponent_sweep(robot, 40 if quick else 160, report)
        return []
    if name == "variants":
        data[name] = floquet.variants(robot, report)
        return floquet_rows.variant_rows(results)
    if name == "modules":
        data[name] = floquet.module_counts(robot, range(3, 11 if quick else 21), report)
        return floquet_rows.module_rows(results)
    if name == "uniform":
        data[name] = floquet.uniform_springs(robot)
        return floquet_rows.uniform_rows(results)
    if name == "identification":
        results.identification = identify_planar(
            robot, critical_mode_data(), 7 if quick else 25, variant_settings(), report
        )
        data[name] = results.identification.profile
        return floquet_rows.identification_rows(results)
    if name == "branch":
        low, high = (stiffness(value) for value in _BRANCH)
        data[name] = curved_walks(robot, K1, (low, high), longest=0.05, progress=report)
        return []
    if name == "curved":
        results.curved = curved_study(robot, 3 if quick else 10, 2 if quick else 5, folder, report)
        return curved_rows.rows(results.curved)
    if name == "undulation":
        data[name] = undulating_walks(robot, progress=report)
        return []
    if name == "turning":
        results.turning = turning(robot, folder, quick, report)
        return turning_rows.rows(results.turning)
    best = results.turning.tasks["A"].best if results.turning else _BEST
    first, second, third = (stiffness(value) for value in _FILMED)
    results.movies = movies(robot, (first, second, third), stiffness(best), folder, report)
    return []


def _robot_section(
    results: Results, name: str, quick: bool, folder: str | Path | None, report: Callable[[float, str], None]
) -> list[RobotRow]:
    """Compute a section in three dimensions, leave it in ``results``, and return its lines of the robot's table."""
    whole = results.whole
    assert whole is not None
    if name == "robot-walks":
        results.robot_walks = robot_walks(whole, folder, quick, report)
        return robot_rows.walk_rows(results.robot_walks, planar_words(results))
    if name == "robot-turning":
        results.robot_turning = robot_turning(whole, folder, quick, report)
        return robot_turning_rows.turning_rows(results.robot_turning, results.robot_walks, planar_words(results))
    if name == "robot-spread":
        results.datasets[name] = twin_spread(whole, folder, 2 if quick else SPREAD, report)
        return []
    if name == "robot-numerics":
        results.datasets[name] = twin_numerics.twin_numerics(whole, quick, report)
        return twin_numerics.rows(results.datasets[name])
    if name == "robot-structures":
        results.datasets[name] = structures(whole, folder, progress=report)
        return []
    if name == "robot-why":
        results.datasets[name] = ablation.ablation(whole, results.robot, folder, quick, report)
        return ablation.rows(results.datasets[name])
    straight, little, lot = (stiffness(value) for value in _ROBOT_FILMED)
    stiff, best, soft = (stiffness(value) for value in _ROBOT_TRIED)
    results.robot_movies = robot_movies(whole, (straight, little, lot), (stiff, best, soft), folder, report)
    return []
