"""Identification of constants of the three-dimensional robot from one series of its walks.

The series is walks with several first springs (:class:`chilopod.tasks.identify.BaseSeries`): which of them curve and
which are straight, how tightly some turn, and where by a square-root fit to the bend of joint 1 the curve sets in.
All other results serve as predictions. A few numbers and yes-or-no answers do not determine nine constants: they leave
a valley. Weighted samples of it (:mod:`chilopod.tasks.identify.valley`) give an interval for every constant and for
every prediction. Evaluations begin near the bends of the data, which saves the minute in which a bend grows; the best
set of constants is chosen among those whose straight starts reach the same bends, and near the middle of the ranges
where the data do not determine it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.stats import norm
from scipy.stats.qmc import LatinHypercube

from chilopod.analysis.parameters import K1
from chilopod.engine import engine_named
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.frozen import Array
from chilopod.notebook import axes_for
from chilopod.output import check_folder, keep
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.constants import CONFIDENCE, Estimates, FreeConstants, Identified
from chilopod.tasks.identify.data import FITTED, BaseSeries
from chilopod.tasks.identify.twin_series import DURATION, FAR, LOST, Series, base_series, hopeless, residuals
from chilopod.tasks.identify.valley import LEAST, Samples, Surrogate
from chilopod.tasks.radius_law import CYCLES, SAMPLES, end_of_walk
from chilopod.trials import Trial, run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

VERSION = 3
"""Version of evaluations, increased whenever the same constants would give other bends; other versions are ignored."""

GOOD = 1.0
"""Largest residual of a good set of constants: each datum is then within its standard error."""

PRIOR = 0.25
"""Standard deviation of a constant about the middle of its range, in parts of the range, in the choice of the best."""

_FIRST, _ROUND = 40, 16  # evaluations before the first surrogate, and of each
_TRIALS = 10  # walks from a straight start at each of two springs
_MOST_CONFIRMED = 20


@dataclass(frozen=True)
class Fit:
    """One set of constants, in parts of their ranges, its residuals, its weight in the valley, 0 if not in it, and its
    residuals with those of curvatures in place of radii, whose squares make the likelihood."""

    parts: Array
    residuals: Array
    weight: float = 0.0
    by_curvature: Array = field(default_factory=lambda: np.empty(0))

    @property
    def largest(self) -> float:
        """Largest residual, without its sign."""
        return float(np.abs(self.residuals).max())

    @property
    def objective(self) -> float:
        """Sum of squared residuals and squared distances of the constants from mid-range, over a quarter of ranges."""
        return float(np.sum(self.residuals**2) + np.sum(((self.parts - 0.5) / PRIOR) ** 2))


@dataclass(frozen=True)
class TwinIdentification(Identified):
    """Result of a search for the constants of the twin: robot with the constants that are not fitted, data, all
    evaluations, first the best of those that reach the curve from a straight start, then by objective; and the mean
    square error of the surrogate at the samples, over that which it expected."""

    given: Robot
    data: BaseSeries
    fits: list[Fit]
    misjudged: float = 1.0

    @property
    def good(self) -> list[Fit]:
        """Fits that meet every datum within its standard error."""
        return [fit for fit in self.fits if fit.largest <= GOOD]

    @property
    def nearest(self) -> Fit:
        """The fit whose largest residual is smallest."""
        return min(self.fits, key=lambda fit: fit.largest)

    @property
    def samples(self) -> Samples:
        """The weighted samples of the valley; none if no fit comes within three standard errors of every datum."""
        return samples_of(self.fits if self.nearest.largest <= FAR else [])

    @property
    def estimates(self) -> Estimates:
        """The best constants, with intervals over the samples of the valley."""
        samples, free = self.samples, self.data.free
        count, best = len(free.each), free.values_at(self.fits[0].parts)
        if samples.effective <= count:  # so few span no region
            return Estimates(self.given, free, best, np.full((count, 2), np.nan), np.full((count, count), np.nan))
        values = np.array([free.values_at(parts) for parts in samples.parts]).T
        # Of parts of ranges, in which the samples may fill a range evenly; values of many decades have no such spread.
        off = free.slopes(self.fits[0].parts) @ (samples.parts - samples.weights @ samples.parts).T
        spread = norm.ppf(0.5 + 0.5 * CONFIDENCE) ** 2 * (samples.weights * off) @ off.T
        return Estimates(self.given, free, best, np.array([samples.interval(each) for each in values]), spread)

    @property
    def title(self) -> str:
        """Largest residual, how many fits meet all data, or how near the nearest comes and which datum it misses."""
        nearest = self.nearest
        said = f"{self.given.name}: largest residual {self.fits[0].largest:.2f} (1: every datum within its error); "
        said += f"{len(self.good)} of {len(self.fits)} evaluations meet every datum"
        if not self.good:
            missed = self.data.names[int(np.abs(nearest.residuals).argmax())]
            said += f"; the nearest misses the {missed} by {nearest.largest:.2f} standard errors"
        return said

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the residual of each datum at the best constants."""
        axes = axes_for(axes)
        axes.barh(self.data.names, self.fits[0].residuals)
        axes.invert_yaxis()
        axes.set(xlabel="computed less measured (standard errors)")
        return axes

    def _remarks(self) -> list[str]:
        samples = self.samples
        if self.nearest.largest > FAR:
            return ["no valley: no constants come within three standard errors of every datum"]
        said = f"valley: {samples.effective:.3g} effective samples of {len(samples.weights)}; squared errors of the "
        said += f"surrogate there are {self.misjudged:.2g} times those that it expected"
        if samples.effective <= len(self.data.free.each):
            said += "; no more than constants give no intervals: more --evaluations or --samples are needed"
        elif samples.effective < LEAST:
            said += f"; below {LEAST:.0f} intervals are not reliable: more --evaluations or --samples are needed"
        return [said]

    def as_json(self) -> dict[str, Any]:
        """Constants with their intervals, and the good fits and samples of the valley, as plain numbers and text."""
        kept = [fit for fit in self.fits if fit.weight or fit.largest <= GOOD] or self.fits[:1]
        numbers = [(self.data.free.values_at(fit.parts).tolist(), fit.residuals.tolist(), fit.weight) for fit in kept]
        return {
            **super().as_json(),
            "largest_residual": self.fits[0].largest,
            "smallest_largest_residual": self.nearest.largest,
            "residuals": dict(zip(self.data.names, self.fits[0].residuals.tolist(), strict=True)),
            "evaluations": len(self.fits),
            "good": len(self.good),
            "samples": len(self.samples.weights),
            "effective_samples": self.samples.effective,
            "surrogate_squared_error": self.misjudged,
            "fits": [dict(zip(("constants", "residuals", "weight"), each, strict=True)) for each in numbers],
        }


def samples_of(fits: Sequence[Fit]) -> Samples:
    """The weighted samples among some fits."""
    kept = [fit for fit in fits if fit.weight]
    weights = np.array([fit.weight for fit in kept])
    return Samples(np.array([fit.parts for fit in kept]), weights / max(weights.sum(), 1e-300))


def evaluate(robot: Robot, parts: Array, data: BaseSeries, folder: Path | None = None) -> Fit:
    """Residuals of a set of constants, in parts of their ranges."""
    given, found = walked(robot, parts, data, folder)
    of_radii, of_curvatures = (residuals(given, found, data, by_curvature) for by_curvature in (False, True))
    return Fit(parts, of_radii, by_curvature=of_curvatures)


def walked(robot: Robot, parts: Array, data: BaseSeries, folder: Path | None = None) -> tuple[Robot, Series]:
    """The robot with a set of constants, in parts of their ranges, and its series of walks, or an earlier result."""
    constants = data.free.values_at(parts)
    given = data.free.robot_with(robot, constants)
    series = [data.springs, data.law, data.shape, data.start(robot, data.springs).tolist()]
    text = json.dumps([VERSION, given.with_(name="robot", provenance={}).to_toml(), series, DURATION])
    path = (folder or Path()) / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.json"
    with suppress(OSError, ValueError, KeyError):
        kept = json.loads(path.read_text()) if folder else {}
        before, bends, speeds = (np.array(kept[name], dtype=np.float64) for name in ("before", "bends", "speeds"))
        found = Series(before, bends, speeds, early=kept["early"])
        if not found.early or hopeless(given, found, data):  # not given up for other data, as a wrong number
            return given, found
    try:
        found = base_series(given, data)
    except ChilopodError:  # legs too short, for example
        lost = np.full((len(data.springs), given.body.modules - 1), np.nan)
        found = Series(lost, lost, lost[:, 0])
    if folder:
        kept = {name: np.asarray(each).tolist() for name, each in vars(found).items()}
        keep(path, json.dumps({"constants": constants.tolist(), **kept}), "evaluations")
    return given, found


def known(free: FreeConstants = FITTED) -> list[Fit]:
    """Sets of constants included in chilopod, with the residuals of the paper's series and their weights; those of
    ``FITTED`` begin with the preset's. The others are of ``WITH_FRICTION``."""
    name = "twin" if free is FITTED else "friction"
    shipped = files("chilopod.tasks.identify").joinpath(f"{name}_fits.json").read_text(encoding="utf-8")
    fits = json.loads(shipped)["fits"]
    return [Fit(free.parts_of(each["constants"]), np.array(each["residuals"]), each["weight"]) for each in fits]


def confirmed(robot: Robot, data: BaseSeries) -> bool:
    """True if walks from a straight start agree with the data: at the stiffest curved spring most of them curve, to
    both sides, and at the softest straight spring most of them stay straight."""
    period, robots = robot.gait.period, [robot.with_value(K1, k) for k in (max(data.curved), min(data.straight))]
    how: dict[str, Any] = {"rate": SAMPLES / period, "engine": "twin"}
    trials = [Trial(each, CYCLES * period, seed, **how) for each in robots for seed in range(_TRIALS)]
    ends = xr.concat([end_of_walk(record, robot) for record in run(trials)], "trial")
    sides = ends.direction.values.reshape(2, _TRIALS)
    bent = np.isin(sides, ("left", "right")).sum(axis=1)
    return bool(2 * bent[0] > _TRIALS > 2 * bent[1] and {"left", "right"} <= set(sides[0]))


def search(
    robot: Robot,
    data: BaseSeries,
    starts: Sequence[Array],
    counts: tuple[int, int],
    seed: int = 1,
    folder: Path | None = None,
    progress: Progress = silent,
) -> tuple[list[Fit], float]:
    """Evaluate constants in rounds, each drawn from what a surrogate of all before expects; then draw samples from the
    last surrogate and weight them.

    ``starts`` are evaluated first, in parts of the ranges, and some that are spread evenly if there are few; ``counts``
    are the numbers of evaluations, these among them, and of samples. Evaluations are kept in ``folder``; a stopped
    search resumes, because it repeats the same ones. Returns all evaluations, and the mean square error of the
    surrogate at the samples over that which it expected. AnalysisError if none of the first constants walks.
    """
    rng = np.random.default_rng(seed)
    trained = counts[0]
    few = max(min(_FIRST, trained) - len(starts), 0)
    spread = LatinHypercube(len(data.free.each), rng=rng).random(few)
    fits: list[Fit] = []

    def evaluated(places: Sequence[Array] | Array) -> list[Fit]:
        found: list[Fit] = []
        for place in places:
            found.append(evaluate(robot, place, data, folder))
            largest = min(fit.largest for fit in (*fits, *found))
            count = len(fits) + len(found)
            progress(count / (trained + counts[1]), f"evaluation {count}: best has a largest residual of {largest:.2f}")
        return found

    fits += evaluated([*starts[:trained], *spread])
    if all(fit.largest >= LOST for fit in fits):
        raise AnalysisError("must walk with some constants in their ranges", field="robot")
    surrogate, excess = Surrogate(*_walked(fits)), 1.0
    while (missing := trained - len(fits)) > 0:
        found = evaluated(surrogate.draws(min(_ROUND, missing), rng))
        excess *= float(np.clip(surrogate.misjudged(*_walked(found)), 0.5, 2.0))
        fits += found
        surrogate = Surrogate(*_walked(fits), excess)
    found = evaluated(surrogate.draws(counts[1], rng))
    heights = surrogate.log_likelihood(np.array([fit.parts for fit in found]))
    logs = -0.5 * np.array([np.sum(fit.by_curvature**2) for fit in found]) - heights
    weights = np.exp(logs - max(logs.max(), -np.finfo(float).max))  # all zero if no sample walks
    weights /= max(weights.sum(), 1.0)
    fits += [replace(fit, weight=weight) for fit, weight in zip(found, weights.tolist(), strict=True)]
    return fits, surrogate.misjudged(*_walked(found))


def _walked(fits: Sequence[Fit]) -> tuple[Array, Array]:
    """Constants with which the robot walks, in parts of their ranges, and residuals as in the likelihood."""
    walked = [fit for fit in fits if fit.largest < LOST]
    return np.array([fit.parts for fit in walked]), np.array([fit.by_curvature for fit in walked])


def identify_twin(
    robot: Robot,
    data: BaseSeries,
    evaluations: int = 300,
    samples: int = 100,
    seed: int = 1,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> TwinIdentification:
    """Identify the constants: a :func:`search` from the known sets, then the best of the good fits that reach the curve
    from a straight start, like the robot. The known sets serve if the free constants have theirs among them; other
    constants then begin as in the robot. ``evaluations`` and ``samples`` are the numbers of evaluations that train the
    surrogate and of samples of the valley; for the other arguments see :func:`search`."""
    engine_named("twin").common(robot)  # refuses a robot without a twin
    free = data.free
    free.check(robot)
    data.start(robot, data.springs)  # refuses the shape of another robot
    fitted = known() if set(FITTED.paths) <= set(free.paths) else []
    if len(free.paths) > len(FITTED.paths):  # the weights hold without the others
        fitted = [fit for fit in fitted if fit.largest <= GOOD]
    places = [free.parts_of(free.of(FITTED.robot_with(robot, FITTED.values_at(fit.parts)))) for fit in fitted]
    starts = [parts for parts in places if ((parts >= 0.0) & (parts <= 1.0)).all()]
    kept = None if folder is None else check_folder(folder)
    counts = evaluations, samples
    fits, misjudged = search(robot, data, starts, counts, seed, kept, part(progress, 0.0, 0.95))
    fits.sort(key=lambda fit: fit.objective)
    progress(0.95, "walks from straight on")
    for fit in [fit for fit in fits if fit.largest <= GOOD][:_MOST_CONFIRMED]:
        if confirmed(free.robot_with(robot, free.values_at(fit.parts)), data):
            fits = [fit, *(each for each in fits if each is not fit)]
            break
    return TwinIdentification(robot, data, fits, misjudged)
