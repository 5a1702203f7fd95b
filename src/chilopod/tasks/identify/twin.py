"""Identification of constants of the three-dimensional robot from one series of its walks.

The series is walks with several first springs (:class:`chilopod.tasks.identify.BaseSeries`): which of them curve and
which are straight, how tightly some turn, and where by a square-root fit to the bend of joint 1 the curve sets in.
All other results serve as predictions. A few numbers and yes-or-no answers do not determine nine constants. Every
constant therefore has a plausible range, and its middle is preferred where the data do not determine it: the misfit to
the data plus a weak prior is minimised by evolution strategies from several starts, with every evaluation kept.
Evaluations begin near the bends of the data, which saves the minute in which a bend grows; the best is chosen among
those whose straight starts reach the same bends. The other evaluations that meet the data show how well the data
determine each constant.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from cmaes import CMA

from chilopod import units
from chilopod.analysis.parameters import K1, stiffness
from chilopod.engine import engine_named
from chilopod.errors import ChilopodError
from chilopod.frozen import Array, Short
from chilopod.output import check_folder, write_atomic
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.data import BaseSeries
from chilopod.tasks.identify.twin_constants import FREE, parts_of, values_at, with_constants
from chilopod.tasks.identify.twin_series import DURATION, Series, base_series, residuals
from chilopod.tasks.radius_law import DURATION as LONG
from chilopod.tasks.radius_law import end_of_walk
from chilopod.trials import Trial, run

VERSION = 3
"""Version of evaluations, increased whenever the same constants would give other bends; other versions are ignored."""

GOOD = 1.0
"""Largest residual of a good set of constants: each datum is then within its tolerance."""

_PRIOR = 0.25  # of its range: standard deviation of a constant about the middle
_POPULATION = 10
_NEAR = 3.5  # misfit of evaluations that a linear law is fitted to
_REFINED, _STEPS = 12, 3  # evaluations that are refined, and steps of each
_CLOSE = 0.5  # misfit at which that ends
_TRIALS = 10  # walks from a straight start at each of two springs
_MOST_CONFIRMED = 20


@dataclass(frozen=True)
class Fit:
    """One set of constants (SI, in the order of :data:`FREE`), its :class:`Series` and its :func:`residuals`."""

    constants: Array
    bends: Array
    speeds: Array
    residuals: Array

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals; below 1 some data may be off by more than their tolerance."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def largest(self) -> float:
        """Largest residual, without its sign; 1 is what the tolerances allow."""
        return float(np.abs(self.residuals).max())

    @property
    def objective(self) -> float:
        """Objective of the search: sum of the squared residuals and of the squared penalties, the constants' distances
        from the middle of their ranges over a quarter of the ranges."""
        return float(np.sum(self.residuals**2) + np.sum(((parts_of(self.constants) - 0.5) / _PRIOR) ** 2))

    def as_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {
            "constants": dict(zip([each.path for each in FREE], self.constants.tolist(), strict=True)),
            "bends_rad": self.bends.tolist(),
            "speeds_m_s": self.speeds.tolist(),
            "residuals": self.residuals.tolist(),
            "misfit": self.misfit,
            "largest_residual": self.largest,
            "objective": self.objective,
        }


@dataclass(frozen=True)
class TwinIdentification(Short):
    """Result of a search for the constants of the twin: robot with the constants that are not fitted, data, and all
    evaluations, first the best of those that reach the curve from a straight start, then by objective."""

    given: Robot
    data: BaseSeries
    fits: list[Fit]

    @property
    def best(self) -> Robot:
        """The robot with the best constants."""
        return with_constants(self.given, self.fits[0].constants)

    @property
    def good(self) -> list[Fit]:
        """Fits that meet every datum within its tolerance."""
        return [fit for fit in self.fits if fit.largest <= GOOD]

    @property
    def nearest(self) -> Fit:
        """The fit whose largest residual is smallest."""
        return min(self.fits, key=lambda fit: fit.largest)

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Smallest and largest value of each constant among the good fits, SI; empty if there is none."""
        if not self.good:
            return {}
        values = np.array([fit.constants for fit in self.good])
        ends = zip(values.min(axis=0).tolist(), values.max(axis=0).tolist(), strict=True)
        return {each.path: span for each, span in zip(FREE, ends, strict=True)}

    def words(self) -> str:
        """How many fits meet all data, or how near the nearest comes, and which datum it misses."""
        best, nearest = self.fits[0], self.nearest
        said = f"largest residual {best.largest:.2f} (1: every datum within its tolerance), misfit {best.misfit:.2f}; "
        if self.good:
            return said + f"{len(self.good)} of {len(self.fits)} evaluations meet every datum"
        missed = self.data.names[int(np.abs(nearest.residuals).argmax())]
        return said + (
            f"no evaluation of {len(self.fits)} meets every datum; the nearest misses the {missed} by "
            f"{nearest.largest:.2f} tolerances"
        )

    def as_json(self) -> dict[str, Any]:
        """Constants with the ranges of the good fits, and the best fits, as plain numbers and text."""
        constants, ranges = {}, self.ranges()
        for each, value in zip(FREE, self.fits[0].constants.tolist(), strict=True):
            unit, span = self.given.unit_of(each.path), ranges.get(each.path, ())
            constants[each.path] = {
                "value_si": value,
                "text": units.format(value, unit, digits=3),
                "good_fits_si": list(span) or None,
                "good_fits_text": " to ".join(units.format(end, unit, digits=2) for end in span) or "none found",
            }
        return {
            "constants": constants,
            "misfit": self.fits[0].misfit,
            "largest_residual": self.fits[0].largest,
            "smallest_largest_residual": self.nearest.largest,
            "residuals": dict(zip(self.data.names, self.fits[0].residuals.tolist(), strict=True)),
            "evaluations": len(self.fits),
            "good": len(self.good),
            "fits": [fit.as_json() for fit in (self.good or self.fits[:1])],
        }


def evaluate(robot: Robot, constants: Array, data: BaseSeries, folder: Path | None = None) -> Fit:
    """Walk the series with a set of constants, or read an earlier result."""
    given = with_constants(robot, constants)
    series = [data.springs, data.law, data.shape]
    text = json.dumps([VERSION, given.with_(name="robot", provenance={}).to_toml(), series, DURATION])
    path = None if folder is None else folder / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.json"
    found = None if path is None else _read(path)
    if found is None:
        try:
            found = base_series(given, data)
        except ChilopodError:  # legs too short, for example
            lost = np.full((len(data.springs), given.body.modules - 1), np.nan)
            found = Series(lost, lost, lost[:, 0])
        if path is not None:
            kept = {name: each.tolist() for name, each in vars(found).items()}
            write_atomic(path, json.dumps({"constants": constants.tolist(), **kept}))
    return Fit(constants, found.bends, found.speeds, residuals(given, found, data))


def _read(path: Path) -> Series | None:
    try:
        kept = json.loads(path.read_text())
        return Series(*(np.array(kept[each.name], dtype=np.float64) for each in fields(Series)))
    except (OSError, ValueError, KeyError):
        return None


def search(
    robot: Robot,
    data: BaseSeries,
    starts: int = 3,
    generations: int = 14,
    seed: int = 1,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> list[Fit]:
    """Search for constants by evolution strategies (CMA-ES) from several starts.

    Parameters
    ----------
    robot, data
        Robot with the constants that are not fitted, and data of its walks.
    starts, generations, seed
        Number of starts, spread over the ranges of the constants, and of generations of ten evaluations from each; seed
        of both.
    folder
        Folder of the evaluations; a stopped search resumes, because it repeats the same ones.
    progress
        Function that receives the progress.

    Returns
    -------
    All evaluations, best first.
    """
    kept = None if folder is None else check_folder(folder)
    rng = np.random.default_rng(seed)
    fits: list[Fit] = []
    for number in range(starts):
        mean = np.full(len(FREE), 0.5) if number == 0 else rng.uniform(0.25, 0.75, len(FREE))
        bounds = np.tile([0.0, 1.0], (len(FREE), 1))
        strategy = CMA(mean=mean, sigma=0.15, bounds=bounds, population_size=_POPULATION, seed=seed + number)
        for generation in range(generations):
            results = []
            for _ in range(_POPULATION):
                parts = strategy.ask()
                fit = evaluate(robot, values_at(parts), data, kept)
                results.append((parts, fit.objective))
                fits.append(fit)
                best = min(fits, key=lambda each: each.objective)
                done = len(fits) / (starts * generations * _POPULATION)
                progress(done, f"start {number + 1}, generation {generation + 1}: best misfit {best.misfit:.2f}")
            strategy.tell(results)
    return sorted(fits, key=lambda fit: fit.objective)


def unlike(fits: Sequence[Fit], count: int) -> list[Fit]:
    """The first of some fits, and the fits farthest from it and from each other, relative to the constants' ranges."""
    places = np.array([parts_of(fit.constants) for fit in fits])
    chosen = [0]
    while len(chosen) < min(count, len(fits)):
        apart = np.linalg.norm(places[:, None] - places[chosen], axis=2).min(axis=1)
        chosen.append(int(apart.argmax()))
    return [fits[i] for i in chosen]


def damped_step(law: Array, off: Array, moved: Array | float = 0.0) -> Array:
    """Step of damped least squares (Levenberg), in parts of the constants' ranges, from the slopes of the residuals,
    shape (residuals, constants), the residuals, and how far the constants have moved before."""
    normal = law.T @ law + np.eye(len(FREE)) / _PRIOR**2
    return np.asarray(-np.linalg.solve(normal, law.T @ off + moved / _PRIOR**2), dtype=np.float64)


def corrected(law: Array, step: Array, change: Array) -> Array:
    """Linear law corrected by the result of a step (Broyden's update)."""
    better: Array = law + np.outer(change - law @ step, step) / max(float(step @ step), 1e-12)
    return better


def refined(
    robot: Robot, data: BaseSeries, fits: Sequence[Fit], folder: Path | None = None, progress: Progress = silent
) -> list[Fit]:
    """Evaluations on the way from ``fits`` near the data to a fit within the tolerances; empty if too few are near.

    Starting from the near fits that differ most, damped least squares (Levenberg) move the constants along a linear law
    of the residuals, which is fitted to all near fits and corrected by every step (Broyden). The steps do not use the
    middle of the ranges, so the results spread along the valley that the data leave open.
    """
    near = [fit for fit in fits if fit.misfit <= _NEAR]
    if len(near) <= 2 * len(FREE):
        return []
    smooth = len(data.radii) + len(data.speeds) + 1  # the other residuals are zero where they are met
    places = np.array([parts_of(fit.constants) for fit in near])
    off = np.array([fit.residuals[:smooth] for fit in near])
    slopes = np.linalg.lstsq(np.c_[np.ones(len(near)), places], off, rcond=None)[0][1:].T
    found = []
    for number, fit in enumerate(chosen := unlike(near, _REFINED)):
        law: Array = slopes.copy()
        here = fit
        for _ in range(_STEPS):
            if here.misfit <= _CLOSE:
                break
            place, rest = parts_of(here.constants), here.residuals[:smooth]
            step = np.clip(place + damped_step(law, rest), 0.0, 1.0) - place
            here = evaluate(robot, values_at(place + step), data, folder)
            law = corrected(law, step, here.residuals[:smooth] - rest)
            found.append(here)
        progress((number + 1) / len(chosen), f"refined {number + 1} of {len(chosen)}: misfit {here.misfit:.2f}")
    return found


def known() -> list[Fit]:
    """Sets of constants included in chilopod, best first, with the residuals of the paper's series."""
    text = files("chilopod.tasks.identify").joinpath("twin_fits.json").read_text(encoding="utf-8")
    return [
        Fit(
            np.array([each["constants"][free.path] for free in FREE]),
            *(np.array(each[name]) for name in ("bends_rad", "speeds_m_s", "residuals")),
        )
        for each in json.loads(text)["fits"]
    ]


def confirmed(robot: Robot, data: BaseSeries) -> bool:
    """True if walks from a straight start agree with the data: at the stiffest curved spring most of them curve, to
    both sides, and at the softest straight spring most of them stay straight."""
    curves, stays = max(data.curved), min(data.straight)
    trials = [
        Trial(robot.with_value(K1, stiffness(spring)), LONG, seed, rate=10.0, engine="twin")
        for spring in (curves, stays)
        for seed in range(_TRIALS)
    ]
    ends = xr.concat([end_of_walk(record, robot) for record in run(trials)], "trial")
    sides = ends.direction.values.reshape(2, _TRIALS)
    bent = np.isin(sides, ("left", "right")).sum(axis=1)
    return bool(2 * bent[0] > _TRIALS > 2 * bent[1] and {"left", "right"} <= set(sides[0]))


def identify_twin(
    robot: Robot,
    data: BaseSeries,
    starts: int = 3,
    generations: int = 14,
    seed: int = 1,
    folder: str | Path | None = None,
    fresh: bool = False,
    progress: Progress = silent,
) -> TwinIdentification:
    """Identify the constants: the known sets first, then a :func:`search`, whose best are :func:`refined`, then the
    best of those that reach the curve from a straight start, like the robot.

    ``fresh`` ignores the known sets; for the other arguments see :func:`search`.
    """
    engine_named("twin").common(robot)  # refuses a robot without a twin
    kept, fits = None if folder is None else check_folder(folder), []
    for number, fit in enumerate([] if fresh else known()):
        progress(0.0, f"known constants, set {number + 1}")
        fits.append(evaluate(robot, fit.constants, data, kept))
    fits += search(robot, data, starts, generations, seed, folder, part(progress, 0.0, 0.85))
    fits.sort(key=lambda fit: fit.objective)
    fits += refined(robot, data, fits, kept, part(progress, 0.85, 0.95))
    fits.sort(key=lambda fit: fit.objective)
    progress(0.95, "walks from straight on")
    for index, fit in enumerate(fits[:_MOST_CONFIRMED]):
        if fit.largest <= GOOD and confirmed(with_constants(robot, fit.constants), data):
            return TwinIdentification(robot, data, [fit, *fits[:index], *fits[index + 1 :]])
    return TwinIdentification(robot, data, fits)
