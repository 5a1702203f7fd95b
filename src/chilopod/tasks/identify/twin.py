"""Finding the constants of the three-dimensional robot that are hard to measure, from one series of its walks alone.

The series is walks with several first springs (:class:`chilopod.tasks.identify.BaseSeries`): which of them curve and
which are straight, how tightly some turn, and where by a square-root fit to the bend of joint 1 the curve sets in.
Everything else (other springs, strides and phases, uniform springs, turning) is left to predict.

A few numbers and yes-or-no answers do not determine eight constants. Every constant therefore has a plausible
range, and where the data leave it open the middle of the range is preferred: what is minimised is the misfit to the
data plus a weak prior, by evolution strategies from several starts, with every evaluation kept. Evaluations begin near
the bends that the data ask for, which saves the minute that a bend takes to grow; the preset is the best of
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
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.square_root import square_root_fit
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.output import prepare_folder, write_atomic
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.data import BaseSeries
from chilopod.tasks.identify.known_fits import known_fits
from chilopod.tasks.identify.twin_constants import FREE, with_constants
from chilopod.trials import Trial, run
from chilopod.twin import initial_states, simulate
from chilopod.twin.walk import TOLERANCE

Array = NDArray[np.float64]

VERSION = 2
"""Goes up whenever the same constants would give other bends; evaluations of other versions are left alone."""

GOOD = 1.0
"""A set of constants does as well as any if its misfit is below this: then each datum is within its tolerance."""

_DURATION = 36.0  # s
_AVERAGED = 4.8  # s, whole periods near the paper's 5 s
_STEADY = 0.1  # rad that the summed bend may move between the last two averages
_PRIOR = 0.25  # of its range: standard deviation of a constant about the middle
_LOST = 30.0  # misfit of constants with which the robot does not walk
_POPULATION = 10
_PATIENCE = 100.0  # s
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
        Mean angle of each joint over the last 4.8 s, rad, over the springs of the series, shape (springs,
        joints); NaN where a walk failed.
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
    data
        What was fitted.
    fits
        All evaluations; first the best of those that walk into the curve from straight on, then by their objective.
    """

    given: Robot
    data: BaseSeries
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
            "residuals": dict(zip(self.data.names, self.fits[0].residuals.tolist(), strict=True)),
            "evaluations": len(self.fits),
            "good": len(self.good),
            "fits": [fit.as_json() for fit in (self.good or self.fits[:1])],
        }


def base_series(
    robot: Robot,
    data: BaseSeries,
    springs: Sequence[float] | None = None,
    duration: float = _DURATION,
    tolerance: float = TOLERANCE,
) -> Array:
    """Bends that the walks of a series end in, begun near those that the data ask for.

    Parameters
    ----------
    robot
        Its first spring does not matter.
    data
        The series.
    springs
        Values of k1, N*mm/deg, if not those of the series.
    duration
        s.
    tolerance
        Of the contact solver.

    Returns
    -------
    Mean joint angles over the last two stretches of 4.8 s, rad, shape (2, springs, joints); NaN where a walk failed.
    """
    springs = data.springs if springs is None else springs
    robots = [robot.with_value(K1, stiffness(spring)) for spring in springs]
    start = data.start(springs)
    rate = 6.0 / robot.gait.period
    walked = simulate(robots, duration, initial=initial_states(robot, start), rate=rate, tolerance=tolerance)
    angles, samples = walked.joint_angle.transpose("time", "robot", "joint").values, round(_AVERAGED * rate)
    return np.stack([angles[-2 * samples : -samples].mean(0), angles[-samples:].mean(0)])


def residuals(robot: Robot, bends: Array, data: BaseSeries) -> Array:
    """Computed less the data.

    Parameters
    ----------
    robot
        For its size.
    bends
        From :func:`base_series`.
    data
        The series.

    Returns
    -------
    One for each of ``data.names``: radii and onset (each over the tolerance of it); bend where the robot is straight
    beyond 0.1 rad in all (over 0.05 rad); what it lacks at the stiffest spring that curves of 0.3 rad (the same);
    motion between the averages (over 0.1 rad).
    """
    springs = data.springs
    summed = np.abs(bends[1]).sum(-1)
    at = dict(zip(springs, summed, strict=True))
    if not np.isfinite(bends).all():
        return np.full(len(data.names), _LOST)
    length = (robot.body.modules - 1) * robot.module_length
    # Of curvatures, which are finite where a walk is straight.
    found = [(at[k] * r / length - 1.0) / data.tolerance for k, r in data.radii.items()]
    curved = [springs.index(k) for k in data.curved]
    try:
        fitted = square_root_fit(1.0 / np.array(data.curved), np.abs(bends[1, curved, 0]), resampled=0).critical
    except AnalysisError:
        fitted = 0.5 * data.onset
    found.append((fitted / data.onset - 1.0) / data.tolerance)
    found += [max(at[k] - 0.1, 0.0) / 0.05 for k in data.straight]
    found.append(max(0.3 - at[max(data.curved)], 0.0) / 0.05)
    moved = np.abs(bends[1].sum(-1) - bends[0].sum(-1))
    found.append(max(float(moved.max()) - _STEADY, 0.0) / _STEADY)
    return np.array(found)


def evaluate(robot: Robot, constants: Array, data: BaseSeries, folder: Path | None = None) -> Fit:
    """Walk the series with a set of constants, or read what came of it before."""
    given = with_constants(robot, constants)
    series = [data.springs, data.law, data.shape]
    text = json.dumps([VERSION, given.with_(name="robot", provenance={}).to_toml(), series, _DURATION])
    path = None if folder is None else folder / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.json"
    if path is not None and path.exists():
        try:
            bends = np.array(json.loads(path.read_text())["bends"], dtype=np.float64)
            return Fit(constants, bends[1], residuals(given, bends, data))
        except (OSError, ValueError, KeyError):
            pass
    try:
        bends = base_series(given, data)
    except ChilopodError:  # legs too short, say
        bends = np.full((2, len(data.springs), given.body.modules - 1), np.nan)
    if path is not None:
        write_atomic(path, json.dumps({"constants": constants.tolist(), "bends": bends.tolist()}))
    return Fit(constants, bends[1], residuals(given, bends, data))


def search(
    robot: Robot,
    data: BaseSeries,
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
    data
        What the robot's walks came to.
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
                constants = np.array([each.value(part) for each, part in zip(FREE, parts, strict=True)])
                fit = evaluate(robot, constants, data, kept)
                told.append((parts, fit.objective))
                fits.append(fit)
                best = min(fits, key=lambda each: each.objective)
                done = len(fits) / (starts * generations * _POPULATION)
                progress(done, f"start {start + 1}, generation {generation + 1}: best misfit {best.misfit:.2f}")
            strategy.tell(told)
    return sorted(fits, key=lambda fit: fit.objective)


def known() -> list[Fit]:
    """The sets of constants that come with chilopod, best first; their residuals are those of the paper's series."""
    return [
        Fit(
            np.array([each["constants"][free.path] for free in FREE]),
            np.array(each["bends_rad"]),
            np.array(each["residuals"]),
        )
        for each in known_fits()
    ]


def confirmed(robot: Robot, springs: Sequence[float]) -> bool:
    """Whether walks from straight on end in the curves that evaluations begin near: two at each of some springs
    (N*mm/deg)."""
    asked = [
        Trial(robot.with_value(K1, stiffness(spring)), _PATIENCE, seed, rate=10.0, engine="twin")
        for spring in springs
        for seed in (1, 2)
    ]
    ends = [np.abs(each.joint_angle.isel(robot=0)[-50:].mean("time").values).sum() for each in run(asked)]
    return bool(min(ends) > _SURELY_CURVED)


def identify_twin(
    robot: Robot,
    data: BaseSeries,
    starts: int = 3,
    generations: int = 9,
    seed: int = 1,
    folder: str | Path | None = None,
    fresh: bool = False,
    progress: Progress = silent,
) -> TwinIdentification:
    """Find the constants: the known ones first, then a :func:`search`, then the best of all that walk into the curve
    from straight on, as a robot does.

    Parameters
    ----------
    robot, data, starts, generations, seed, folder, progress
        As for :func:`search`.
    fresh
        Whether to begin without the known ones.
    """
    kept = None if folder is None else prepare_folder(folder)
    fits = [] if fresh else [evaluate(robot, fit.constants, data, kept) for fit in known()]
    fits += search(robot, data, starts, generations, seed, folder, lambda done, words: progress(0.95 * done, words))
    fits.sort(key=lambda fit: fit.objective)
    progress(0.95, "walks from straight on")
    for index, fit in enumerate(fits[:_MOST_CONFIRMED]):
        if fit.misfit <= GOOD and confirmed(with_constants(robot, fit.constants), data.near_onset):
            return TwinIdentification(robot, data, [fit, *fits[:index], *fits[index + 1 :]])
    return TwinIdentification(robot, data, fits)
