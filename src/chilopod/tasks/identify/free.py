"""Constants that are free in an identification, and their ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from chilopod import units
from chilopod.errors import ChilopodError, ParameterError
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.robot.parameters import place_of
from chilopod.units.quantity import is_list

_LOGARITHMIC = 4.0  # ratio of the ends of a range from which its scale is logarithmic
_STEP = 1e-6  # of differences, in parts of ranges


@dataclass(frozen=True)
class Constant:
    """Free constant: its path in the robot's description and the ends of its range, SI; with ``per``, the range is
    that of its ratio to an earlier constant."""

    path: str
    low: float
    high: float
    per: str | None = None

    @property
    def logarithmic(self) -> bool:
        """True if the parts of the range are even in the logarithm: the range is wide and positive."""
        return 0.0 < _LOGARITHMIC * self.low <= self.high


@dataclass(frozen=True)
class FreeConstants:
    """The constants that are fitted, in an order, with their ranges.

    Parts of the ranges are numbers from 0 to 1, shape (constants,); values are in SI units.
    """

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
            try:
                found.append(_constant(str(name), ends, [each.path for each in found]))
            except ChilopodError as error:
                error.field = f"[{name}]"
                raise
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
        pairs = zip(self.each, parts, strict=True)
        values = np.array(
            [c.low * (c.high / c.low) ** x if c.logarithmic else c.low + x * (c.high - c.low) for c, x in pairs]
        )
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
        """ParameterError if the robot cannot have the constants at the ends of their ranges."""
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
        raise ParameterError("must be the ratio to a constant above it", value=per)
    if not is_list(ends) or len(ends) != 2:
        raise ParameterError("must be two ends of a range", value=ends)
    quantity = place_of(path).quantity
    if quantity.integer:
        raise ParameterError("must not be a whole number")
    unit = f"{quantity.si or '1'}/({place_of(per).quantity.si or '1'})" if slash else quantity.si
    low, high = (units.parse(end, unit) if slash else quantity.read(end) for end in ends)
    if not low < high or (slash and low <= 0.0):
        raise ParameterError("must be a rising range", value=ends)
    return Constant(path, low, high, per if slash else None)
