"""Finding the constants of the three-dimensional robot that the paper does not print, from its base series alone.

The base series is what the paper prints of the walks with k2 to k5 = 41 N*mm/deg and a stride of 3 cm: straight at
k1 = 75 and 41, curved at 28, 21, 17 and 15, set in at 34 by a square-root fit to the bend of joint 1, radius 1.2 m at
26 and 0.88 m at 21. Everything else (other springs, strides and phases, uniform springs, turning) is left to predict.

Three numbers and six yes-or-no answers do not determine eight constants. Every constant therefore has a plausible
range, and where the data leave it open the middle of the range is preferred: what is minimised is the misfit to the
data plus a weak prior, by evolution strategies from several starts, with every evaluation kept. Evaluations begin near
the bends that the paper's numbers ask for, which saves the minute that a bend takes to grow; the preset is the best of
those whose walks from straight on get there too. All others that meet the data as well say how far the data determine
each constant, and how far to trust what is predicted.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cmaes import CMA
from numpy.typing import NDArray

from chilopod import units
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.output import prepare_folder, write_atomic
from chilopod.robot import Robot
from chilopod.studies.floquet import K1, PAPER_UNIT, Progress, silent, stiffness
from chilopod.studies.known_fits import known_fits
from chilopod.studies.paper import printed
from chilopod.studies.square_root import square_root_fit
from chilopod.studies.trials import Trial, run
from chilopod.studies.twin_constants import FREE, with_constants
from chilopod.twin import initial_states, simulate
from chilopod.twin.simulate import TOLERANCE

Array = NDArray[np.float64]

VERSION = 2
"""Goes up whenever the same constants would give other bends; evaluations of other versions are left alone."""


SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0, 41.0, 75.0)
"""k1 of the walks that an evaluation runs, N*mm/deg."""

GOOD = 1.0
"""A set of constants does as well as any if its misfit is below this: then each datum is within its tolerance."""

RESIDUALS = (
    "radius at 21",
    "radius at 26",
    "onset",
    "straight at 41",
    "straight at 75",
    "curved at 28",
    "steady",
)
"""What the data are."""

_CURVED = (15.0, 17.0, 21.0, 28.0)
_STRAIGHT = (41.0, 75.0)
_DURATION = 36.0  # s
_AVERAGED = 4.8  # s, whole periods near the paper's 5 s
_TOLERANCE = 0.05  # of printed numbers: half of what the report calls agreeing
_STEADY = 0.1  # rad that the summed bend may move between the last two averages
_LAW = (9.7, 0.030)  # rad*sqrt(N*mm/deg), deg/(N*mm): summed bend over 1/k1 that meets both printed radii; a start only
_SHAPE = np.array([0.64, 0.36, 0.48, 0.46, 0.16]) / 2.10
_PRIOR = 0.25  # of its range: standard deviation of a constant about the middle
_LOST = 30.0  # misfit of constants with which the robot does not walk
_POPULATION = 10
_NEAR_ONSET, _PATIENCE = (26.0, 28.0), 100.0  # N*mm/deg, s
_SURELY_CURVED = 0.6  # rad in all
_MOST_CONFIRMED = 20


@dataclass(frozen=True)
class Fit:
    """One set of constants and what comes of it.

    Attributes
    ----------
    constants
        SI, in the order of :data:`FREE`.
    bends
        Mean angle of each joint over the last 4.8 s, rad, over :data:`SPRINGS`, shape (7, joints); NaN where a walk
        failed.
    residuals
        Of the data in units of their tolerance, see :func:`residuals`.
    """

    constants: Array
    bends: Array
    residuals: Array

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def objective(self) -> float:
        """What the search makes small: sum of the squared residuals, and of the constants' distances from the middle of
        their ranges over a quarter of them."""
        parts = np.array([each.part(value) for each, value in zip(FREE, self.constants, strict=True)])
        return float(np.sum(self.residuals**2) + np.sum(((parts - 0.5) / _PRIOR) ** 2))

    def as_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {
            "constants": dict(zip([each.path for each in FREE], self.constants.tolist(), strict=True)),
            "bends_rad": self.bends.tolist(),
            "residuals": self.residuals.tolist(),
            "misfit": self.misfit,
            "objective": self.objective,
        }


@dataclass(frozen=True)
class TwinIdentification:
    """What a search found.

    Attributes
    ----------
    given
        The robot, for what is not fitted.
    fits
        All evaluations; first the best of those that walk into the curve from straight on, then by their objective.
    """

    given: Robot
    fits: list[Fit]

    @property
    def best(self) -> Robot:
        """The robot with the best constants."""
        return with_constants(self.given, self.fits[0].constants)

    @property
    def good(self) -> list[Fit]:
        """Those that meet the data within their tolerance."""
        return [fit for fit in self.fits if fit.misfit <= GOOD]

    def ranges(self) -> dict[str, tuple[float, float]]:
        """From the smallest to the largest value of each constant among the good fits, SI."""
        values = np.array([fit.constants for fit in self.good or self.fits[:1]])
        return {
            each.path: (float(low), float(high))
            for each, low, high in zip(FREE, values.min(axis=0), values.max(axis=0), strict=True)
        }

    def as_json(self) -> dict[str, Any]:
        """Constants with the ranges of the good fits, and the best fits, as plain numbers and text."""
        constants = {}
        for (path, (low, high)), value in zip(self.ranges().items(), self.fits[0].constants, strict=True):
            unit = self.given.unit_of(path)
            constants[path] = {
                "value_si": float(value),
                "text": units.format(float(value), unit, digits=3),
                "good_fits_si": [low, high],
                "good_fits_text": f"{units.format(low, unit, digits=2)} to {units.format(high, unit, digits=2)}",
            }
        return {
            "constants": constants,
            "misfit": self.fits[0].misfit,
            "residuals": dict(zip(RESIDUALS, self.fits[0].residuals.tolist(), strict=True)),
            "evaluations": len(self.fits),
            "good": len(self.good),
            "fits": [fit.as_json() for fit in (self.good or self.fits[:1])],
        }


def base_series(
    robot: Robot, springs: Sequence[float] = SPRINGS, duration: float = _DURATION, tolerance: float = TOLERANCE
) -> Array:
    """Bends that the walks of the base series end in, begun near those that the paper's numbers ask for.

    Returns
    -------
    Mean joint angles over the last two stretches of 4.8 s, rad, shape (2, springs, joints); NaN where a walk failed.
    """
    robots = [robot.with_value(K1, stiffness(spring)) for spring in springs]
    law = _LAW[0] * np.sqrt(np.maximum(1.0 / np.array(springs) - _LAW[1], 0.0))
    start = np.maximum(law, 0.1)[:, None] * _SHAPE
    rate = 6.0 / robot.gait.period
    walked = simulate(robots, duration, initial=initial_states(robot, start), rate=rate, tolerance=tolerance)
    angles, samples = walked.joint_angle.transpose("time", "robot", "joint").values, round(_AVERAGED * rate)
    return np.stack([angles[-2 * samples : -samples].mean(0), angles[-samples:].mean(0)])


def residuals(robot: Robot, bends: Array) -> Array:
    """The base series' data, computed less printed.

    Parameters
    ----------
    robot
        For its size.
    bends
        From :func:`base_series`.

    Returns
    -------
    Shape (7,): radius at 21 and 26 and onset (each over 5 % of it); bend at 41 and 75 beyond 0.1 rad in all (over
    0.05 rad); lacking bend at 28; motion between the averages (over 0.1 rad).
    """
    summed = np.abs(bends[1]).sum(-1)
    at = dict(zip(SPRINGS, summed, strict=True))
    if not np.isfinite(bends).all():
        return np.full(7, _LOST)
    wanted = printed()["curved"]["radius"]
    radius = [units.parse(wanted[key], "m") for key in ("21", "26")]
    length = (robot.body.modules - 1) * robot.module_length
    # Of curvatures, which are finite where a walk is straight.
    found = [(at[k] * r / length - 1.0) / _TOLERANCE for k, r in zip((21.0, 26.0), radius, strict=True)]
    onset = printed_onset()
    curved = [SPRINGS.index(k) for k in _CURVED]
    try:
        fitted = square_root_fit(1.0 / np.array(_CURVED), np.abs(bends[1, curved, 0]), resampled=0).critical
    except AnalysisError:
        fitted = 0.5 * onset
    found.append((fitted / onset - 1.0) / _TOLERANCE)
    found += [max(at[k] - 0.1, 0.0) / 0.05 for k in _STRAIGHT]
    found.append(max(0.3 - at[28.0], 0.0) / 0.05)
    moved = np.abs(bends[1].sum(-1) - bends[0].sum(-1))
    found.append(max(float(moved.max()) - _STEADY, 0.0) / _STEADY)
    return np.array(found)


def printed_onset() -> float:
    """The robot's critical k1 by the paper, N*mm/deg."""
    return units.from_si(units.parse(printed()["pitchfork"]["robot_critical_k1"], "N*m/rad"), PAPER_UNIT)


def evaluate(robot: Robot, constants: Array, folder: Path | None = None) -> Fit:
    """Walk the base series with a set of constants, or read what came of it before."""
    given = with_constants(robot, constants)
    text = json.dumps([VERSION, given.with_(name="robot", provenance={}).to_toml(), SPRINGS, _DURATION])
    path = None if folder is None else folder / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.json"
    if path is not None and path.exists():
        try:
            bends = np.array(json.loads(path.read_text())["bends"], dtype=np.float64)
            return Fit(constants, bends[1], residuals(given, bends))
        except (OSError, ValueError, KeyError):
            pass
    try:
        bends = base_series(given)
    except ChilopodError:  # legs too short, say
        bends = np.full((2, len(SPRINGS), given.body.modules - 1), np.nan)
    if path is not None:
        write_atomic(path, json.dumps({"constants": constants.tolist(), "bends": bends.tolist()}))
    return Fit(constants, bends[1], residuals(given, bends))


def search(
    robot: Robot,
    starts: int = 3,
    generations: int = 9,
    seed: int = 1,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> list[Fit]:
    """Look for constants by evolution strategies (CMA-ES) from several starts.

    Parameters
    ----------
    robot
        What is not fitted.
    starts
        How many, spread over the ranges of the constants.
    generations
        Of ten evaluations each, from every start.
    seed
        Of starts and evolution.
    folder
        Where evaluations are kept; a search that was stopped goes on where it was, because it asks for the same ones.
    progress
        Called as evaluations are done.

    Returns
    -------
    All evaluations, best first.
    """
    kept = None if folder is None else prepare_folder(folder)
    rng = np.random.default_rng(seed)
    fits: list[Fit] = []
    for start in range(starts):
        mean = np.full(len(FREE), 0.5) if start == 0 else rng.uniform(0.25, 0.75, len(FREE))
        strategy = CMA(
            mean=mean,
            sigma=0.15,
            bounds=np.tile([0.0, 1.0], (len(FREE), 1)),
            population_size=_POPULATION,
            seed=seed + start,
        )
        for generation in range(generations):
            told = []
            for _ in range(_POPULATION):
                parts = strategy.ask()
                fit = evaluate(
                    robot, np.array([each.value(part) for each, part in zip(FREE, parts, strict=True)]), kept
                )
                told.append((parts, fit.objective))
                fits.append(fit)
                best = min(fits, key=lambda each: each.objective)
                done = len(fits) / (starts * generations * _POPULATION)
                progress(done, f"start {start + 1}, generation {generation + 1}: best misfit {best.misfit:.2f}")
            strategy.tell(told)
    return sorted(fits, key=lambda fit: fit.objective)


def known() -> list[Fit]:
    """The sets of constants that come with chilopod, best first."""
    return [
        Fit(
            np.array([each["constants"][free.path] for free in FREE]),
            np.array(each["bends_rad"]),
            np.array(each["residuals"]),
        )
        for each in known_fits()
    ]


def confirmed(robot: Robot) -> bool:
    """Whether walks from straight on end in the curves that evaluations begin near: at 26 and 28 N*mm/deg, two each."""
    asked = [
        Trial(robot.with_value(K1, stiffness(spring)), _PATIENCE, seed, rate=10.0, engine="twin")
        for spring in _NEAR_ONSET
        for seed in (1, 2)
    ]
    ends = [np.abs(each.joint_angle.isel(robot=0)[-50:].mean("time").values).sum() for each in run(asked)]
    return bool(min(ends) > _SURELY_CURVED)


def identify_twin(
    robot: Robot,
    starts: int = 3,
    generations: int = 9,
    seed: int = 1,
    folder: str | Path | None = None,
    fresh: bool = False,
    progress: Progress = silent,
) -> TwinIdentification:
    """Find the constants: the known ones first, then a :func:`search`, then the best of all that walk into the curve
    from straight on, as the paper's robot did.

    Parameters
    ----------
    robot, starts, generations, seed, folder, progress
        As for :func:`search`.
    fresh
        Whether to begin without the known ones.
    """
    kept = None if folder is None else prepare_folder(folder)
    fits = [] if fresh else [evaluate(robot, fit.constants, kept) for fit in known()]
    fits += search(robot, starts, generations, seed, folder, lambda done, words: progress(0.95 * done, words))
    fits.sort(key=lambda fit: fit.objective)
    progress(0.95, "walks from straight on")
    for index, fit in enumerate(fits[:_MOST_CONFIRMED]):
        if fit.misfit <= GOOD and confirmed(with_constants(robot, fit.constants)):
            return TwinIdentification(robot, [fit, *fits[:index], *fits[index + 1 :]])
    return TwinIdentification(robot, fits)
