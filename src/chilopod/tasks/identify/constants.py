"""Constants that are free in an identification: their ranges, how well data know them, and what they leave open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from chilopod import units
from chilopod.errors import ParameterError, concerning
from chilopod.frozen import Array
from chilopod.notebook import Summary
from chilopod.robot import Robot
from chilopod.robot.parameters import place_of
from chilopod.units.quantity import is_list

CONFIDENCE = 0.9
"""Level of all intervals of constants."""

_OPEN = 0.4  # half of an interval, over the range, that leaves a constant open; where all are as likely it is 0.45
_AT = 1e-9  # distance from the end of a range that counts as none, over the range
_ZERO = 0.01  # best value, over the range, below which changes are relative to the range
_HIDDEN = 0.005  # value, over half of its interval, that two digits of this do not show
_SMALL = 0.02  # change in a combination that is not said, over the largest
_LOGARITHMIC = 4.0  # ratio of the ends of a range from which its scale is logarithmic
_STEP = 1e-6  # of differences, in parts of ranges


@dataclass(frozen=True)
class Constant:
    """Free constant: its path and the ends of its range, SI, with ``per`` that of its ratio to an earlier constant. The
    parts of the range are even in the constant, or in its logarithm."""

    path: str
    low: float
    high: float
    per: str | None = None
    logarithmic: bool = False


@dataclass(frozen=True)
class FreeConstants:
    """The constants that are fitted, in an order, with their ranges. Parts of the ranges are numbers from 0 to 1, shape
    (constants,); values are in SI units."""

    each: tuple[Constant, ...]

    @classmethod
    def read(cls, given: object) -> Self:
        """Read a table of ranges by path, ``"path" = [low, high]``, or by the ratio of two paths, ``"path/other"``.

        ParameterError or UnitError names a wrong one."""
        if isinstance(given, cls):
            return given
        if not isinstance(given, Mapping) or not given:
            raise ParameterError("must be a table of paths of a robot's numbers, each with a range", value=given)
        found: list[Constant] = []
        for name, ends in given.items():
            with concerning(f"[{name}]"):
                found.append(_constant(str(name), ends, [each.path for each in found]))
        return cls(tuple(found))

    @property
    def paths(self) -> list[str]:
        """Paths of the constants."""
        return [each.path for each in self.each]

    def _ratios(self) -> list[tuple[int, int]]:
        """Indices of the constants that are ratios, and of what they are ratios to."""
        return [(i, self.paths.index(each.per)) for i, each in enumerate(self.each) if each.per is not None]

    def values_at(self, parts: Sequence[float] | Array) -> Array:
        """Values at parts of the ranges."""
        ends = ((c.low, c.high, c.logarithmic, x) for c, x in zip(self.each, parts, strict=True))
        values = np.array([a * (b / a) ** x if even else a + x * (b - a) for a, b, even, x in ends])
        for index, other in self._ratios():
            values[index] *= values[other]
        return values

    def parts_of(self, values: Sequence[float] | Array) -> Array:
        """The inverse of :meth:`values_at`."""
        ratios = np.array(values, dtype=np.float64)
        for index, other in reversed(self._ratios()):
            ratios[index] /= ratios[other]
        pairs = zip(self.each, ratios.tolist(), strict=True)
        turned = [np.log([max(x, 1e-300), c.low, c.high]) if c.logarithmic else (x, c.low, c.high) for c, x in pairs]
        return np.array([(x - low) / (high - low) for x, low, high in turned])

    def slopes(self, parts: Array) -> Array:
        """Derivatives of the values over the parts, shape (values, parts)."""
        moves = _STEP * np.eye(len(parts))
        return np.array([self.values_at(parts + move) - self.values_at(parts - move) for move in moves]).T / (2 * _STEP)

    def ends(self, parts: Array, half: Array) -> Array:
        """Values of each constant at the ends of an interval of its part alone, which its range may cut, shape
        (constants, 2)."""
        moved = (np.clip(parts + side * np.diag(half), 0.0, 1.0) for side in (-1.0, 1.0))
        return np.array([[self.values_at(row)[at] for at, row in enumerate(rows)] for rows in moved]).T

    def limits(self, values: Array) -> Array:
        """Ends of the range of each constant where the others have their values, shape (constants, 2)."""
        ends = np.array([(each.low, each.high) for each in self.each])
        for index, other in self._ratios():
            ends[index] *= values[other]
        return ends

    def robot_with(self, robot: Robot, values: Sequence[float] | Array) -> Robot:
        """The robot with other values."""
        return with_values(robot, self.paths, values)

    def of(self, robot: Robot) -> Array:
        """Values of a robot."""
        return np.array([robot.get(path) for path in self.paths])

    def check(self, robot: Robot) -> None:
        """ParameterError if two constants change one number, or the robot cannot have the ends of their ranges."""
        taken: set[str] = set()
        for path in self.paths:
            if both := taken & (numbers := {*robot.numbers(path)}):
                said = f"must not change a number that another range changes: {', '.join(sorted(both))}"
                raise ParameterError(said, field=f"free[{path}]")
            taken |= numbers
        for ends in (np.zeros(len(self.each)), np.ones(len(self.each))):
            self.robot_with(robot, self.values_at(ends))


def with_values(robot: Robot, paths: Sequence[str], values: Sequence[float] | Array) -> Robot:
    """The robot with other values of some of its numbers, SI."""
    for path, value in zip(paths, values, strict=True):
        robot = robot.with_value(path, float(value))
    return robot


def _constant(name: str, ends: object, before: Sequence[str]) -> Constant:
    """Constant of an entry in a table of ranges, after others with some paths."""
    path, slash, per = (text.strip() for text in name.partition("/"))
    if path in before:
        raise ParameterError("must be given once")
    if slash and per not in before:
        raise ParameterError("must be the ratio to a constant that stands above it in [free]", value=per)
    if not is_list(ends) or len(ends) != 2:
        raise ParameterError("must be two ends of a range", value=ends)
    quantity = place_of(path).quantity
    if quantity.integer:
        raise ParameterError("must not be a whole number")
    unit = f"{quantity.si or '1'}/({place_of(per).quantity.si or '1'})" if slash else quantity.si
    low, high = (units.parse(end, unit) if slash else quantity.read(end) for end in ends)
    if not low < high or (slash and low <= 0.0):
        raise ParameterError("must be a rising range", value=ends)
    return Constant(path, low, high, per if slash else None, 0.0 < _LOGARITHMIC * low <= high)


@dataclass(frozen=True)
class Estimates:
    """Estimates of the ``free`` constants of a robot, ``given`` with those that are not. ``values`` are the best, shape
    (constants,), and ``ends`` those of their 90 % intervals, shape (constants, 2), SI, NaN where none is found.
    ``spread`` is their covariance, SI, for half of a 90 % interval in place of a standard deviation, shape (constants,
    constants), NaN where it is not known. Provenances end with the ``remark``. ``cut`` is a mask of the ends that lie
    where another constant is at the end of its range, shape (constants, 2)."""

    given: Robot
    free: FreeConstants
    values: Array
    ends: Array
    spread: Array
    remark: str = ""
    cut: Array | bool = False

    @property
    def best(self) -> Robot:
        """The robot with the best values."""
        return self.free.robot_with(self.given, self.values)

    def identified(self, source: str) -> Robot:
        """The same, with the intervals as provenance."""
        best, known = self.best, self.as_json()["constants"]
        texts = {path: text for path, text in best.provenance.items() if path not in known}
        for path, each in known.items():
            text = f"identified from {source}; 90 %: {each['interval_text']}{self.remark}"
            texts |= dict.fromkeys(best.numbers(path), text)
        return best.with_(name="identified", provenance=texts)

    def as_json(self) -> dict[str, Any]:
        """Constants with their intervals, correlations, and combinations that are independent: relative changes by half
        of the 90 % interval along each, best known first, and whether the data leave it open. Changes of constants
        that are about zero, those of ``of_range``, are relative to the range."""
        half, paths = np.sqrt(np.diag(self.spread)), self.free.paths
        found: dict[str, Any] = {path: self._constant(at, self.ends[at]) for at, path in enumerate(paths)}
        found = {"constants": found, "correlations": None, "combinations": [], "of_range": []}
        if np.isfinite(self.spread).all():
            found["correlations"] = (self.spread / np.maximum(np.outer(half, half), 1e-300)).tolist()
            widths = np.ptp(self.free.limits(self.values), axis=1)
            signed = np.array([each.low <= 0.0 for each in self.free.each])
            zero = signed & (np.abs(self.values) < _ZERO * widths)
            found["of_range"] = [path for path, is_zero in zip(paths, zero, strict=True) if is_zero]
            scale = np.where(zero, widths, np.abs(self.values))
            squares, directions = np.linalg.eigh(self.spread / np.outer(scale, scale))
            slopes = self.free.slopes(self.free.parts_of(self.values))
            signs = np.where(directions.sum(axis=0) < 0.0, -1.0, 1.0)
            for change in (signs * np.sqrt(np.abs(squares)) * directions).T:
                changes = dict(zip(paths, change.tolist(), strict=True))
                is_open = bool(np.linalg.norm(np.linalg.solve(slopes, change * scale)) > _OPEN)
                found["combinations"].append({"changes": changes, "open": is_open})
        return found

    def _constant(self, at: int, ends: Array) -> dict[str, Any]:
        value, known = float(self.values[at]), ends.tolist() if np.isfinite(ends).all() else None
        found = {"value_si": value, "text": self._text(at, value, ends), "interval_si": known}
        none = "none found" if np.isnan(self.ends).all() else "no end found"
        cut = np.broadcast_to(self.cut, self.ends.shape)[at]
        return {**found, "interval_text": self.between(at, ends, cut) or none}

    def between(self, at: int, ends: Array, cut: Array) -> str:
        """Range of a constant in words, and whether the data or the search end it; nothing if it is NaN."""
        if not np.isfinite(ends).all():
            return ""
        places = np.where(np.arange(len(self.values)) == at, [[ends[0]], [ends[1]], [self.values[at]]], self.values)
        low, high, best = (float(self.free.parts_of(place)[at]) for place in places)
        cut = np.logical_or(cut, np.abs([low, high - 1.0]) <= _AT)
        which = "" if cut.all() else "lower end " if cut[0] else "upper end "
        remark = f" ({which}cut by the range searched)" if cut.any() else ""
        # At the end of a range the data ask for values beyond it.
        inside = min(best, 1.0 - best) > _AT
        remark = " (left open by the data)" if inside and high - low > 2.0 * _OPEN else remark
        return " to ".join(self._text(at, end, ends) for end in ends.tolist()) + remark

    def _text(self, at: int, value: float, ends: Array) -> str:
        """A value of a constant, with two digits of half of a range."""
        half = 0.5 * float(np.ptp(ends)) or np.nan
        value = 0.0 if abs(value) < _HIDDEN * half and self.free.each[at].low <= 0.0 else value
        digits = 2 + int(np.clip(np.ceil(np.log10(abs(value) / half)), 0, 6)) if value and np.isfinite(half) else 4
        return units.format(value, self.given.unit_of(self.free.paths[at]), digits)


class Identified(Summary):
    """Base of the results of an identification: a title, a table of the constants, and what the data leave open."""

    if TYPE_CHECKING:  # at run time it would be the default of a field

        @property
        def estimates(self) -> Estimates:
            """The constants with their intervals."""

    @property
    def best(self) -> Robot:
        """The robot with the best constants."""
        return self.estimates.best

    def as_json(self) -> dict[str, Any]:
        """Constants with intervals, correlations and combinations, and more numbers."""
        return self.estimates.as_json()

    def _columns(self) -> dict[str, list[str]]:
        """More columns of the table, by their heads."""
        return {}

    def _remarks(self) -> list[str]:
        """Sentences about this identification."""
        return []

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        found, more = self.estimates.as_json(), self._columns()
        cells: list[Sequence[str]] = [("constant", "best", f"{CONFIDENCE:.0%} interval", *more)]
        for (path, each), *texts in zip(found["constants"].items(), *more.values(), strict=True):
            cells.append((path, each["text"], each["interval_text"], *texts))
        said = [f"independent combinations, by half of their {CONFIDENCE:.0%} interval:"] * bool(found["combinations"])
        of = dict.fromkeys(found["of_range"], " of its range")
        for each in found["combinations"]:
            least = 100.0 * _SMALL * max(map(abs, each["changes"].values()))
            shown = [(path, 100.0 * x, ".2g" if abs(x) < 1.0 else ".0f") for path, x in each["changes"].items()]
            texts = [f"{path} {x:+{digits}} %{of.get(path, '')}" for path, x, digits in shown if abs(x) >= least]
            said.append(f"  {', '.join(texts)}{' (left open)' if each['open'] else ''}")
        return [], cells, [*said, *self._remarks()]
