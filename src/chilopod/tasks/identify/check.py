"""Self-test of the identification of planar constants: robots whose constants are known, identified from data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.notebook import Shown, aligned
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.statistics import LEVEL
from chilopod.tasks.identify import planar_fit
from chilopod.tasks.identify.constants import CONFIDENCE
from chilopod.tasks.identify.data import CriticalMode
from chilopod.tasks.identify.planar_fit import FREE, scale_of

_SIZES, _BESIDE = 3.0, 1.25  # largest factor of length, mass and springs, and of the constants
_DRAWS = 100


@dataclass(frozen=True)
class SelfTest(Shown):
    """Constants of robots, SI, shape (robots, 3), their ranges from rounded numbers, and their 90 % intervals from
    numbers with normal scatter, SI, shape (robots, 3, 2); NaN where nothing is allowed."""

    true: Array
    ranges: Array
    intervals: Array

    def as_json(self) -> dict[str, Any]:
        """Count of robots whose constant is covered, and interval of that share (Clopper, Pearson), by kind, path."""
        found: dict[str, Any] = {"robots": len(self.true), "rounded": {}, "scattered": {}}
        for kind, ends in (("rounded", self.ranges), ("scattered", self.intervals)):
            covered = (ends[..., 0] <= self.true) & (self.true <= ends[..., 1])
            for path, count in zip(FREE, covered.sum(axis=0).tolist(), strict=True):
                share = binomtest(count, len(covered)).proportion_ci(LEVEL)
                found[kind][path] = {"covered": count, "share": [float(share.low), float(share.high)]}
        return found

    def lines(self) -> list[str]:
        """Counts in words."""
        found = self.as_json()
        heads = "in the range of rounded numbers", f"in the {100.0 * CONFIDENCE:.0f} % interval of scattered numbers"
        rows: list[Sequence[str]] = [(f"self-test, {len(self.true)} robots", *heads)]
        for path in FREE:
            cells = [(each["covered"], *each["share"]) for each in (found["rounded"][path], found["scattered"][path])]
            rows.append((path, *(f"{count} (share {low:.0%} to {high:.0%})" for count, low, high in cells)))
        return aligned(rows)

    _lines = lines


def self_test(robot: Robot, data: CriticalMode, count: int, seed: int = 0, progress: Progress = silent) -> SelfTest:
    """Identify the constants of robots that are made up around a robot. Each depends on ``seed`` and its number alone.
    Length, mass and springs differ by factors of a third to three, and constants in units of the robot by factors of
    0.8 to 1.25. Each is identified from its critical spring and mode rounded to twice the tolerances of the data, and
    once more from ones with these as standard errors of normal scatter. AnalysisError if none has a pitchfork."""
    true, ranges, intervals = [], [], []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        other, constants, exact = made_up(robot, data, rng)
        true.append(constants)
        ranges.append(planar_fit.allowed_ranges(other, *_fitted(other, rounded(exact)))[0])
        intervals.append(planar_fit.confidence_intervals(other, *_fitted(other, scattered(exact, rng)))[0])
        progress((number + 1) / count, f"self-test, robot {number + 1} of {count}")
    return SelfTest(np.array(true), np.array(ranges), np.array(intervals))


def _fitted(robot: Robot, data: CriticalMode) -> tuple[CriticalMode, Array]:
    if data.k1 <= 0.0:
        raise AnalysisError("the tolerance of k1 must leave a spring above 0 to robots that are made up")
    return data, planar_fit.best_of(planar_fit.fits_from_every_start(robot, data))[0]


def made_up(robot: Robot, data: CriticalMode, rng: np.random.Generator) -> tuple[Robot, Array, CriticalMode]:
    """A robot, its constants, SI, and its exact numbers with the tolerances of the data."""
    groups = np.array([robot.get(path) for path in FREE]) / scale_of(robot, data)
    for _ in range(_DRAWS):
        size, mass, spring = _SIZES ** rng.uniform(-1.0, 1.0, 3)
        springs = [f"springs.stiffness[{joint}]" for joint in range(robot.body.modules - 1)]
        factors = {"body.length": size, "gait.stride": size, "body.mass": mass, **dict.fromkeys(springs, spring)}
        other = robot.with_(name="a robot that is made up")
        for path, factor in factors.items():
            other = other.with_value(path, factor * robot.get(path))
        sizes = {name: spring * getattr(data, name) for name in ("k1", "k1_tolerance")}
        exact = data.model_copy(update={**sizes, "between": tuple(spring * each for each in data.between)})
        constants = groups * _BESIDE ** rng.uniform(-1.0, 1.0, len(FREE)) * scale_of(other, exact)
        found = planar_fit.searched(planar_fit.with_constants(other, constants), exact.between)
        if found is not None:
            return other, constants, exact.model_copy(update={"k1": found[0], "components": tuple(found[1].tolist())})
    raise AnalysisError(f"{robot.name} must have neighbours with a pitchfork")


def rounded(data: CriticalMode) -> CriticalMode:
    """The data rounded to twice their tolerances."""
    grids = 2.0 * data.k1_tolerance, 2.0 * data.component_tolerance
    components = tuple(grids[1] * round(each / grids[1]) for each in data.components)
    return data.model_copy(update={"k1": grids[0] * round(data.k1 / grids[0]), "components": components})


def scattered(data: CriticalMode, rng: np.random.Generator) -> CriticalMode:
    """The data with normal scatter."""
    k1 = float(rng.normal(data.k1, data.k1_tolerance))
    components = tuple(rng.normal(data.components, data.component_tolerance).tolist())
    return data.model_copy(update={"k1": k1, "components": components})
