"""The paper's walks of its robot (Fig. "curved", "absolute", "different"), as trials of the twin.

Every trial starts straight but for its disturbance, walks for a minute and a half, and is judged by the mean joint
angles of its last 5 s, with the springs, repeats and estimates of the paper: the radius 5L / sum |theta|, and the point
at which curved walks set in from a square-root fit to the bend of joint 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import trials
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.square_root import SquareRootFit, square_root_fit
from chilopod.errors import AnalysisError
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.studies.curved_trials import variant_robots
from chilopod.tasks.radius_law import DURATION, end_of_walk, is_curved
from chilopod.trials import AVERAGED, Disturbance, Trial

Array = NDArray[np.float64]

SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0, 41.0, 75.0)
"""k1 of the base series, N*mm/deg: the paper's, and 26, at which it prints a radius."""

VARIANT_SPRINGS = (12.0, 15.0, 17.0, 19.0, 21.0, 24.0, 28.0, 34.0)
"""k1 of the variants, N*mm/deg."""

UNIFORM_SPRINGS = (8.7, 11.0, 13.0, 15.0, 18.0, 21.0, 30.0)
"""All springs together, N*mm/deg."""

SWINGING = 15.0
"""N*mm/deg: of the paper's uniform springs, those up to here are on the soft side of its Hopf point."""

REPEATS, VARIANT_REPEATS, UNIFORM_REPEATS = 10, 5, 3

UNIFORM_DURATION = 60.0
"""s, of walks with all springs alike, which settle sooner."""

_RATE = 50.0
_EXAMPLES = (41.0, 15.0)
_WINDOW = 24.0  # s, some two cycles of an undulation
_PER_CYCLE = 6  # samples
_SEEDS = 10_000  # between springs


@dataclass(frozen=True)
class RobotWalks:
    """What the walks show.

    Attributes
    ----------
    robot
        As built.
    base
        See :func:`walk_trials`.
    variants
        The same of the paper's three variants, by name.
    examples
        Joint angles (rad) over time of one straight and one curved walk, over (time, spring, joint).
    uniform
        See :func:`undulations`.
    """

    robot: Robot
    base: xr.Dataset
    variants: Mapping[str, xr.Dataset]
    examples: xr.Dataset
    uniform: xr.Dataset

    @property
    def fit(self) -> SquareRootFit | None:
        """The square-root law of the base series."""
        return onset(self.base)


def robot_walks(
    robot: Robot, folder: str | Path | None = None, quick: bool = False, progress: Progress = silent
) -> RobotWalks:
    """All walks of the paper.

    Parameters
    ----------
    robot
        With a twin.
    folder
        Where trials are kept.
    quick
        Two repeats of the base series, one of the variants and of uniform springs, with fewer springs.
    progress
        Called as the work goes on.
    """

    def part(first: float, last: float, name: str) -> Progress:
        return lambda done, words: progress(first + (last - first) * done, f"{name}: {words}")

    repeats, fewer, fewest = (2, 1, 1) if quick else (REPEATS, VARIANT_REPEATS, UNIFORM_REPEATS)
    springs, uniform_springs = (
        (VARIANT_SPRINGS[1::2], UNIFORM_SPRINGS[:4]) if quick else (VARIANT_SPRINGS, UNIFORM_SPRINGS)
    )
    base = walk_trials(robot, SPRINGS, repeats, folder=folder, progress=part(0.0, 0.35, "as built"))
    robots = {name: each for name, each in variant_robots(robot).items() if name != "as built"}
    variants = {}
    for index, (name, variant) in enumerate(robots.items()):
        shown = part(0.35 + 0.18 * index, 0.53 + 0.18 * index, name)
        variants[name] = walk_trials(variant, springs, fewer, folder=folder, progress=shown)
    uniform = undulations(robot, uniform_springs, fewest, folder=folder, progress=part(0.89, 1.0, "uniform springs"))
    return RobotWalks(robot, base, variants, _examples(robot, folder), uniform)


def walk_trials(
    robot: Robot,
    springs: Sequence[float] = SPRINGS,
    repeats: int = REPEATS,
    *,
    disturbance: Disturbance | None = None,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Walks of the twin from straight on.

    Parameters
    ----------
    robot
        With a twin; its first spring does not matter.
    springs
        Values of k1, N*mm/deg.
    repeats
        Trials at each of them, all with seeds of their own.
    disturbance
        By default that of all studies.
    folder
        Where trials are kept.
    progress
        Called as trials are done.

    Returns
    -------
    Dataset over spring (N*mm/deg), repeat and joint: what :func:`chilopod.tasks.radius_law.end_of_walk` makes of each.
    """
    asked = [
        Trial(
            robot.with_value(K1, stiffness(spring)),
            DURATION,
            int(_SEEDS * spring) + repeat,
            disturbance=disturbance or Disturbance(),
            rate=_RATE,
            engine="twin",
        )
        for spring in springs
        for repeat in range(repeats)
    ]
    ends = [end_of_walk(record, robot) for record in trials.run(asked, folder, progress)]
    rows = [xr.concat(ends[i : i + repeats], "repeat") for i in range(0, len(ends), repeats)]
    data = xr.concat(rows, "spring").assign_coords(
        spring=("spring", np.asarray(springs, dtype=np.float64), {"units": PAPER_UNIT}), repeat=np.arange(repeats)
    )
    data.attrs = {"robot": robot.name, "varied": K1, "averaged_s": AVERAGED, "duration_s": DURATION}
    return data


def onset(data: xr.Dataset, joint: int = 1) -> SquareRootFit | None:
    """Where curved walks set in by the paper's method: the square-root fit to trials at springs at which most curve.

    None if they do not determine a point.
    """
    here = is_curved(data)
    here &= here.mean(axis=1)[:, None] > 0.5
    inverse = np.broadcast_to(1.0 / data.spring.values[:, None], here.shape)
    try:
        return square_root_fit(inverse[here], data.mean_angle.sel(joint=joint).values[here])
    except AnalysisError:
        return None


def radius_at(data: xr.Dataset, spring: float) -> tuple[float, float]:
    """Mean radius of the trials at a spring that curve, and its standard error, m; NaN if there are fewer than two."""
    at = data.sel(spring=spring)
    radii = at.axis_radius.values[is_curved(at)]
    if len(radii) < 2:
        return float("nan"), float("nan")
    return float(radii.mean()), float(radii.std(ddof=1) / np.sqrt(len(radii)))


def spring_for(data: xr.Dataset, radius: float) -> float:
    """The paper's k1-hat: the spring whose walks have a radius, between trials, N*mm/deg; NaN outside of them.

    The squared curvature is interpolated in 1/k1, in which it is linear by the square-root law.
    """
    here = is_curved(data)
    curved = here.mean(axis=1) > 0.5
    bend = np.where(here, data.bend.values, np.nan)[curved]
    inverse, squared = 1.0 / data.spring.values[curved], np.nanmean(bend, axis=1) ** 2
    order = np.argsort(squared)
    # bend = (N-1) L / radius, and bend * axis_radius is (N-1) L in every trial.
    wanted = (float(data.bend[0, 0] * data.axis_radius[0, 0]) / radius) ** 2
    found = np.interp(wanted, squared[order], inverse[order], left=np.nan, right=np.nan)
    return float(1.0 / found)


def undulations(
    robot: Robot,
    springs: Sequence[float] = UNIFORM_SPRINGS,
    repeats: int = UNIFORM_REPEATS,
    *,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Walks with all springs alike: how far the body swings once it has settled.

    Returns
    -------
    Dataset over spring (N*mm/deg) and repeat: ``amplitude``, root mean square of the joint angles, averaged over gait
    cycles, about their mean over the last 24 s (rad), and ``status``; attributes ``critical_k``, where by a square-root
    fit to those at most :data:`SWINGING` the undulation sets in, NaN if they determine no point.
    """
    joints = robot.body.modules - 1
    wave = tuple(np.deg2rad(4.0) * np.cos(np.arange(joints) * np.pi / 2.0))
    rate = _PER_CYCLE / robot.gait.period
    asked = [
        Trial(
            robot.with_value(ALL, stiffness(spring)),
            UNIFORM_DURATION,
            int(_SEEDS * spring) + repeat,
            wave,
            engine="twin",
            rate=rate,
        )
        for spring in springs
        for repeat in range(repeats)
    ]
    shape = (len(springs), repeats)
    amplitude, status = np.empty(shape), np.empty(shape, dtype=object)
    last = round(_WINDOW / robot.gait.period)
    for index, record in enumerate(trials.run(asked, folder, progress)):
        angles = record.joint_angle.isel(robot=0).transpose("time", "joint").values[1:]
        cycles = angles[: len(angles) // _PER_CYCLE * _PER_CYCLE].reshape(-1, _PER_CYCLE, joints).mean(axis=1)
        at = np.unravel_index(index, shape)
        amplitude[at] = np.sqrt(cycles[-last:].var(axis=0).sum())
        status[at] = record.status.values[0]
    both = ("spring", "repeat")
    data = xr.Dataset(
        {"amplitude": (both, amplitude, {"units": "rad"}), "status": (both, status)},
        coords={"spring": ("spring", np.asarray(springs, float), {"units": PAPER_UNIT}), "repeat": np.arange(repeats)},
    )
    soft = np.asarray(springs) <= SWINGING
    inverse = np.broadcast_to(1.0 / np.asarray(springs)[:, None], shape)
    try:
        critical = square_root_fit(inverse[soft].ravel(), amplitude[soft].ravel(), resampled=0).critical
    except AnalysisError:
        critical = float("nan")
    data.attrs = {"robot": robot.name, "critical_k": critical}
    return data


def _examples(robot: Robot, folder: str | Path | None) -> xr.Dataset:
    walks = [
        Trial(robot.with_value(K1, stiffness(spring)), DURATION, int(_SEEDS * spring), rate=_RATE, engine="twin")
        for spring in _EXAMPLES
    ]
    angles = xr.concat([each.joint_angle.isel(robot=0, drop=True) for each in trials.run(walks, folder)], dim="spring")
    data = angles.transpose("time", "spring", "joint").to_dataset(name="joint_angle")
    data = data.assign_coords(spring=("spring", np.array(_EXAMPLES), {"units": PAPER_UNIT}))
    data.attrs = {"robot": robot.name, "varied": K1, "about": "yaw joint angles over time"}
    return data
