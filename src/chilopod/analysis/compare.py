"""Comparison of two robots: differing numbers, and the part of each in the difference of onset, growth and radius.

A quantity of the robots between the two, with some of the differing numbers taken from the first and the others from
the second, gives for every number its effect alone on the first robot, its effect as the last change to the second, and
the mean over all orders of the changes (Shapley 1953). The last ones add up to the whole difference.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import numbers_read
from chilopod.analysis.quantities import QUANTITIES, Measured, Onset, unit_of
from chilopod.errors import ChilopodError, ParameterError, concerning, known_names
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.notebook import Summary, finite, tornado
from chilopod.planar.step_count import steps
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.statistics import half_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ORDERS = 64  # that are sampled, where all orders take more robots than these can
_LONG = 60.0  # s: a comparison that takes longer is announced
_MOST_STEPS, _SLOWER = 1e5, 10.0  # of a robot in between and a gait cycle, or so much more than the two robots take
_EXACT = 1e-10  # part of a quantity to which it is computed
_DERIVED = "body.yaw_inertia"


@dataclass(frozen=True, eq=False)
class Effects(ReadOnlyArrays):
    """A quantity of two robots, SI, and the part of each differing number in the difference: alone, as the last change,
    and in the mean over orders, with half its 95 % interval, zero for all orders; shape (numbers,), NaN if none."""

    first: float
    second: float
    alone: Array
    last: Array
    mean: Array
    error: Array


@dataclass(frozen=True, eq=False)
class RobotComparison(Summary):
    """Comparison of two robots.

    Attributes
    ----------
    first, second, onset
        Robots, and the number that bends them, with the value at which walks are studied.
    paths
        Paths of the differing numbers that the planar model reads; ``body.modules`` stands for the number of modules,
        which repeats or drops the last springs.
    others
        Paths of other differing numbers, without an effect on planar walks.
    effects
        :class:`Effects` by the name of the quantity.
    """

    first: Robot
    second: Robot
    onset: Onset
    paths: tuple[str, ...]
    others: tuple[str, ...]
    effects: dict[str, Effects]

    def as_json(self) -> dict[str, Any]:
        """Differences and effects as plain numbers, SI; null where a robot has no such quantity."""
        robots, quantities = (self.first, self.second), {}
        for name, found in self.effects.items():
            parts = {"alone": found.alone, "last": found.last, "mean": found.mean, "error": found.error}
            values = [finite(found.first), finite(found.second)]
            effects = {path: {key: finite(x[at]) for key, x in parts.items()} for at, path in enumerate(self.paths)}
            quantities[name] = {"values_si": values, "effects_si": effects}
            if name == "onset":
                known = zip(robots, values, strict=True)
                fates = [None if x is None else self.onset.fate(robot, x).label for robot, x in known]
                quantities[name]["fates"] = fates
        return {
            "robots": [robot.name for robot in robots],
            "parameter": self.onset.parameter,
            "differences_si": {path: [_number(robot, path) for robot in robots] for path in self.paths},
            "without_effect": list(self.others),
            "quantities": quantities,
        }

    @property
    def title(self) -> str:
        """Both robots with their quantities."""
        said = []
        for name, found in self.effects.items():
            pairs = (self.first, found.first), (self.second, found.second)
            said.append(f"{name} {' and '.join(self.onset.in_words(robot, name, x, 4) for robot, x in pairs)}")
        return f"{self.first.name} and {self.second.name}: {', '.join(said)}"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        tail = [f"no effect on planar walks: {', '.join(self.others)}"] * bool(self.others)
        if not self.paths:
            return [], [], ["no number that the planar model reads differs", *tail]
        shown = {name: unit_of(name, self.first, self.onset) for name in self.effects}
        heads = [f"{name} ({unit})".removesuffix(" ()") for name, unit in shown.items()]
        cells: list[Sequence[str]] = [("number", self.first.name, self.second.name, *heads)]
        first = next(iter(self.effects.values()))
        for at in np.argsort(-np.abs(np.nan_to_num(first.mean))).tolist():
            row = [self.paths[at], *(_text(robot, self.paths[at]) for robot in (self.first, self.second))]
            for name, found in self.effects.items():
                mean, error = (units.from_si(float(x[at]), shown[name]) for x in (found.mean, found.error))
                scatter = f" ± {error:.1g}" if error > 0.0 else ""
                none = abs(found.mean[at]) <= _EXACT * max(abs(found.first), abs(found.second))
                row.append(("0" if none else f"{mean:+.4g}{scatter}") if math.isfinite(mean) else "unknown")
            cells.append(row)
        sampled = any(found.error.any() for found in self.effects.values())
        orders = f"{_ORDERS} of the orders" if sampled else "all orders"
        interval = ", ± half of their 95 % interval" * sampled
        said = [f"parts are means over {orders} of the changes{interval}, and add up to the difference"]
        lacking = [name for name, found in self.effects.items() if not np.isfinite([found.first, found.second]).all()]
        if lacking:
            said.append(f"unknown: not both robots have a value of {', '.join(lacking)}")
        if any(np.isnan(found.mean).any() for name, found in self.effects.items() if name not in lacking):
            said.append("unknown: a robot in between has no such quantity, or its motion is far faster than theirs")
        return [], cells, [*said, *tail]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the parts of the numbers in the difference of the first quantity, largest on top."""
        name, found = next(iter(self.effects.items()))
        unit = unit_of(name, self.first, self.onset)
        parts = {path: units.from_si(float(each), unit) for path, each in zip(self.paths, found.mean, strict=True)}
        said = f"part in the difference of the {name} ({unit})".removesuffix(" ()")
        return tornado(axes, parts, said, self.title.partition(":")[0])


def compare(
    first: Robot,
    second: Robot,
    onset: Onset = Onset(),  # noqa: B008 (frozen)
    quantities: Sequence[str] = ("onset", "growth", "speed"),
    seed: int = 0,
    remark: Callable[[str], None] = lambda sentence: None,
    progress: Progress = silent,
) -> RobotComparison:
    """Compare two robots number by number.

    Parameters
    ----------
    first, second, onset
        Robots, and the number whose change bends them, with the value at which growth and radius are taken, by default
        that of each robot; at one value that number is no difference.
    quantities
        Some of :data:`chilopod.analysis.quantities.QUANTITIES`.
    seed
        Seed of the 64 orders that are sampled for ten or more differences.
    remark
        Function that receives a sentence if a quantity will take long.
    """
    for robot in (first, second):
        with concerning(source=robot.name):
            robot.unit_of(onset.parameter)
    names, measured = known_names(quantities, QUANTITIES, "quantities"), Measured(onset)
    one, other = _comparable(first, second)
    paths, others = differences(one, other, onset)
    effects = {}
    for done, name in enumerate(names):
        show = part(progress, done / len(names), (done + 1) / len(names), name)
        effects[name] = _effects(one, other, paths, measured.function(name), np.random.default_rng(seed), show, remark)
    return RobotComparison(one, other, onset, paths, others, effects)


def differences(first: Robot, second: Robot, onset: Onset) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Paths of differing numbers that the planar model reads, and of others; without that of an onset with a value."""
    resized = first.body.modules != second.body.modules
    alike = first.with_value("body.modules", second.body.modules) if resized else first
    shared = [path for path in second.parameters() if path in alike.parameters() and path != "body.modules"]
    replaced = [path for path in shared if onset.at is not None and onset.parameter in (path, path.partition("[")[0])]
    differing = [path for path in shared if alike.get(path) != second.get(path) and path not in replaced]
    read = {*numbers_read(alike), *numbers_read(second)}
    paths = ["body.modules"] * resized + _grouped([path for path in differing if path in read], alike, second, onset)
    only = sorted({*alike.parameters()} ^ {*second.parameters()})
    return tuple(paths), tuple([path for path in differing if path not in read and path != _DERIVED] + only)


def _grouped(paths: list[str], first: Robot, second: Robot, onset: Onset) -> list[str]:
    """Paths with one for all springs or dampers that are alike in each robot."""
    for stem in ("springs.stiffness", "springs.damping"):
        group = f"{stem}[1:]" if onset.at is not None and onset.parameter == f"{stem}[0]" else stem
        own = [path for path in paths if path.startswith(f"{stem}[")]
        if len(own) > 1 and None not in (_number(first, group), _number(second, group)):
            paths = [group if path == own[0] else path for path in paths if path not in own[1:]]
    return paths


def _number(robot: Robot, path: str) -> float | None:
    """Number of a robot, SI; None if it has none. A group of springs has one if all are alike."""
    try:
        return robot.get(path)
    except ParameterError:
        return None


def _comparable(first: Robot, second: Robot) -> tuple[Robot, Robot]:
    """The robots, both with a yaw inertia of their own and without a twin if only one has either."""
    if len({(robot.twin is None, robot.body.yaw_inertia is None) for robot in (first, second)}) == 1:
        return first, second

    def plain(robot: Robot) -> Robot:
        origins = {path: text for path, text in robot.provenance.items() if not path.startswith("twin.")}
        return robot.with_(twin=None, provenance=origins).with_value(_DERIVED, robot.module_yaw_inertia)

    return plain(first), plain(second)


def _text(robot: Robot, path: str) -> str:
    """A number with its unit; nothing for a spring that a robot does not have."""
    number = _number(robot, path)
    return "-" if number is None else units.format(number, robot.unit_of(path), digits=5)


def _effects(
    first: Robot,
    second: Robot,
    paths: Sequence[str],
    function: Callable[[Robot], float],
    rng: np.random.Generator,
    show: Progress,
    remark: Callable[[str], None],
) -> Effects:
    """Effects of the numbers on a function of a robot; each robot is computed once, while a mean needs it."""
    count, known = len(paths), dict[frozenset[int], float]()
    most = min(2**count, max(1, _ORDERS * count))
    fastest = max(_MOST_STEPS, _SLOWER * max(steps(robot, robot.gait.period) for robot in (first, second)))

    def value(changed: frozenset[int]) -> float:
        """The quantity of the first robot with some numbers of the second; NaN where it has none."""
        if changed not in known:
            try:
                robot = first
                for at in sorted(changed):
                    if _number(robot, paths[at]) is not None:  # a spring of a module that is not there has no effect
                        robot = robot.with_value(paths[at], second.get(paths[at]))
                known[changed] = function(robot) if steps(robot, robot.gait.period) <= fastest else math.nan
            except ChilopodError:
                known[changed] = math.nan
            show(min(1.0, len(known) / most), f"{len(known)} of up to {most} robots")
        return known[changed]

    whole = frozenset(range(count))
    value(frozenset())  # compiles
    begun = time.perf_counter()
    for at in range(count):
        value(frozenset(range(at + 1)))
    left = (most - len(known)) * (time.perf_counter() - begun) / max(count, 1)
    if left > _LONG:
        remark(f"a quantity of up to {most} robots in between takes about {left / 60.0:.1g} minutes")
    ends = value(frozenset()), value(whole)
    alone = [value(frozenset([at])) - ends[0] for at in whole]
    last = [ends[1] - value(whole - {at}) for at in whole]
    means, scatter = np.zeros(count), np.zeros(count)
    if most == 2**count:
        for size in range(count):
            weight = 1.0 / (count * math.comb(count - 1, size))  # part of the orders in which these come first
            for earlier in map(frozenset, itertools.combinations(range(count), size)):
                for at in whole - earlier - {*np.flatnonzero(np.isnan(means)).tolist()}:
                    means[at] += weight * (value(earlier | {at}) - value(earlier))
    else:
        parts = np.zeros((_ORDERS, count))
        for row in parts:
            so_far = frozenset[int]()
            for at in rng.permutation(count).tolist():
                known_yet = not np.isnan(parts[:, at]).any()
                row[at] = value(so_far | {at}) - value(so_far) if known_yet else math.nan
                so_far |= {at}
        means, scatter = parts.mean(axis=0), half_interval(parts)
    return Effects(*ends, np.array(alone), np.array(last), means, scatter)
