"""Self-test of the identification of the planar constants: robots whose constants are known, identified from data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
from chilopod.tasks.identify.critical import searched
from chilopod.tasks.identify.data import CriticalMode
from chilopod.tasks.identify.planar import (
    CONFIDENCE,
    FREE,
    allowed_ranges,
    confidence_intervals,
    fits_from_every_start,
    scale_of,
    with_constants,
)

_SIZES = 3.0  # largest factor of length, mass and springs
_BESIDE = 1.25  # largest factor of the constants
_DRAWS = 100


@dataclass(frozen=True)
class SelfTest(Shown):
    """Robots whose constants are known, and what was identified from their numbers.

    Attributes
    ----------
    true
        Constants of the robots, SI, shape (robots, 3).
    ranges, intervals
        Ranges from rounded numbers, and 90 % intervals from numbers with normal scatter, SI, shape (robots, 3, 2); NaN
        where nothing is allowed.
    """

    true: Array
    ranges: Array
    intervals: Array

    def covered(self) -> dict[str, Array]:
        """Number of robots whose constant lies within, for each constant, shape (3,), by the kind of numbers."""
        return {
            kind: ((each[..., 0] <= self.true) & (self.true <= each[..., 1])).sum(axis=0)
            for kind, each in (("rounded", self.ranges), ("normal", self.intervals))
        }

    def as_json(self) -> dict[str, Any]:
        """Counts by kind of numbers and constant, with the interval (Clopper and Pearson) of the share."""
        found: dict[str, Any] = {"robots": len(self.true)}
        for kind, counts in self.covered().items():
            found[kind] = {}
            for path, count in zip(FREE, counts.tolist(), strict=True):
                share = binomtest(count, len(self.true)).proportion_ci(LEVEL, "exact")
                found[kind][path] = {"covered": count, "share": [float(share.low), float(share.high)]}
        return found

    def lines(self) -> list[str]:
        """Counts in words."""
        found = self.as_json()
        heads = "in the range of rounded numbers", f"in the {100.0 * CONFIDENCE:.0f} % interval of scattered numbers"
        rows: list[Sequence[str]] = [(f"self-test, {len(self.true)} robots", *heads)]
        for path in FREE:
            cells = [(each["covered"], *each["share"]) for each in (found[kind][path] for kind in self.covered())]
            rows.append((path, *(f"{count} (share {low:.0%} to {high:.0%})" for count, low, high in cells)))
        return aligned(rows)

    def _lines(self) -> list[str]:
        return self.lines()


def self_test(robot: Robot, data: CriticalMode, count: int, seed: int = 0, progress: Progress = silent) -> SelfTest:
    """Identify the constants of robots that are made up around a robot.

    Length, mass and springs differ by factors of a third to three, and constants in units of the robot by factors of
    0.8 to 1.25. Each robot is identified twice. Its critical spring and mode are rounded to twice the tolerances of the
    data; or they scatter normally with the tolerances as standard errors. Robot ``i`` depends on ``seed`` and ``i``
    alone.

    Parameters
    ----------
    robot, data
        Robot with the constants that were identified, and the data that they come from.
    count, seed
        Number of robots, and seed.
    progress
        Function that receives the progress.

    Raises
    ------
    AnalysisError
        If no robots around the given one have a pitchfork.
    """
    true, ranges, intervals = [], [], []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        other, constants, exact = next(_made_up(robot, data, rng))
        true.append(constants)
        ranges.append(allowed_ranges(other, *_fitted(other, rounded(exact)))[0])
        intervals.append(confidence_intervals(other, *_fitted(other, scattered(exact, rng))))
        progress((number + 1) / count, f"self-test, robot {number + 1} of {count}")
    return SelfTest(np.array(true), np.array(ranges), np.array(intervals))


def _fitted(robot: Robot, data: CriticalMode) -> tuple[CriticalMode, Array]:
    return data, min(fits_from_every_start(robot, data), key=lambda fit: float((fit[1] ** 2).sum()))[0]


def _made_up(robot: Robot, data: CriticalMode, rng: np.random.Generator) -> Iterator[tuple[Robot, Array, CriticalMode]]:
    """Robots with their constants, SI, and exact numbers with the tolerances of the data."""
    groups = np.array([robot.get(path) for path in FREE]) / scale_of(robot, data)
    for _ in range(_DRAWS):
        size, mass, spring = _SIZES ** rng.uniform(-1.0, 1.0, 3)
        other = robot.with_value("body.length", size * robot.body.length)
        other = other.with_value("gait.stride", size * robot.gait.stride).with_value(
            "body.mass", mass * robot.body.mass
        )
        for joint, stiffness in enumerate(robot.springs.stiffness):
            other = other.with_value(f"springs.stiffness[{joint}]", spring * stiffness)
        sizes = {name: spring * getattr(data, name) for name in ("k1", "k1_tolerance")}
        exact = data.model_copy(update={**sizes, "between": tuple(spring * each for each in data.between)})
        constants = groups * _BESIDE ** rng.uniform(-1.0, 1.0, len(FREE)) * scale_of(other, exact)
        found = searched(with_constants(other, constants), exact.between)
        if found is not None:
            spring, mode = found
            yield other, constants, exact.model_copy(update={"k1": spring, "components": tuple(mode.tolist())})
    problem = "must have neighbours with a pitchfork on their straight walk"
    raise AnalysisError(problem, field="robot", value=robot.name)


def rounded(data: CriticalMode) -> CriticalMode:
    """The data rounded to twice their tolerances."""

    def grid(value: float, tolerance: float) -> float:
        return 2.0 * tolerance * round(value / (2.0 * tolerance))

    components = tuple(grid(each, data.component_tolerance) for each in data.components)
    return data.model_copy(update={"k1": grid(data.k1, data.k1_tolerance), "components": components})


def scattered(data: CriticalMode, rng: np.random.Generator) -> CriticalMode:
    """The data with normal scatter."""
    k1 = rng.normal(data.k1, data.k1_tolerance)
    components = tuple(rng.normal(data.components, data.component_tolerance).tolist())
    return data.model_copy(update={"k1": float(k1), "components": components})
