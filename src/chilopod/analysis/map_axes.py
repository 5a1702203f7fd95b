"""Axes of maps, and the robots over two of them.

An :class:`Axis` is a number of a robot, a group of springs, or a derived quantity (speed, modules) that changes several
numbers. :func:`axis` reads one from a path and its range. A :class:`Plane` has two, and gives the robot, or its planar
model, at a value of each.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import check_parameter
from chilopod.errors import ChilopodError, ParameterError, concerning, nearest_name
from chilopod.frozen import Array
from chilopod.planar import PlanarModel
from chilopod.robot import Robot

Given = tuple[str, float | str, float | str]
"""Path of a number, or the name of a derived axis, and both ends of its range: in SI units, or text with a unit."""


def _at_speed(robot: Robot, value: float) -> Robot:
    if not (math.isfinite(value) and value > 0.0):
        raise ParameterError("must be positive", field="speed", value=f"{value:g} m/s", allowed="more than 0 m/s")
    slower = robot.gait.speed / value
    for path in ("gait.stance", "gait.swing"):
        robot = robot.with_value(path, robot.get(path) * slower)
    return robot


def with_modules(robot: Robot, modules: float) -> Robot:
    """The robot with another number of modules of the same size and mass, the last spring repeated."""
    longer = modules / robot.body.modules
    grown = robot.with_value("body.modules", modules)
    for path in ("body.length", "body.mass"):
        grown = grown.with_value(path, robot.get(path) * longer)
    return grown


DERIVED: dict[str, tuple[str, tuple[str, ...], Callable[[Robot, float], Robot]]] = {
    "speed": ("m/s", ("gait.stance", "gait.swing"), _at_speed),
    "modules": ("", ("body.modules", "body.length", "body.mass"), with_modules),
}
"""Unit of each derived axis, numbers that it changes, and how. ``speed`` is that of the straight walk: stance and swing
change together, stride and duty factor stay. ``modules`` adds whole modules: length and mass of a module stay."""


@dataclass(frozen=True)
class Axis:
    """A number of the robot that varies from low to high, in SI units; its unit, and its unit in SI."""

    path: str
    low: float
    high: float
    unit: str
    si_unit: str

    @property
    def whole(self) -> bool:
        """True if only whole numbers have a meaning."""
        return self.path in ("modules", "body.modules")

    @property
    def label(self) -> str:
        """Path and unit."""
        return f"{self.path} ({self.unit.replace('*', '·')})" if self.unit else self.path

    def values(self, parts: int) -> Array:
        """Values in SI units: of that many equal parts, or all whole numbers."""
        if self.whole:
            return np.arange(self.low, self.high + 1.0)
        return self.low + (self.high - self.low) * (np.arange(parts + 1) / parts)

    def shown(self, values: Array) -> Array:
        """Values in ``unit``."""
        return np.array([units.from_si(float(value), self.unit) for value in np.ravel(values)]).reshape(values.shape)

    def change(self, robot: Robot, value: float) -> Robot:
        """Robot at a value; a ChilopodError if there is none."""
        return DERIVED[self.path][2](robot, value) if self.path in DERIVED else robot.with_value(self.path, value)

    def numbers(self, robot: Robot) -> set[str]:
        """Paths of all numbers that it changes, springs one by one."""
        if self.path in DERIVED:
            return set(DERIVED[self.path][1])
        return set(robot.numbers(self.path))


def axis(robot: Robot, given: Given, field: str) -> Axis:
    """Read an axis; errors begin with the field."""
    path, *ends = given
    try:
        if path in DERIVED:
            unit = si = DERIVED[path][0]
        else:
            if path != "body.modules":
                check_parameter(robot, path)
            unit, si = robot.unit_of(path), robot.si_unit_of(path)
    except ChilopodError as error:
        error.nearest = nearest_name(path, DERIVED) or error.nearest
        error.allowed = error.allowed and ", ".join((error.allowed, *DERIVED))
        error.field, error.value = f"{field} {path}", path
        raise
    with concerning(f"{field} {path}"):
        low, high = (units.parse(end, si) if isinstance(end, str) else float(end) for end in ends)
        # Axes and files are in the unit in which the range was given.
        found = Axis(path, low, high, units.unit_in(str(ends[1])) or unit, si)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ParameterError("must rise from a lower to a higher value", value=" ".join(map(str, ends)))
        if found.whole and not (low.is_integer() and high.is_integer()):
            raise ParameterError("must be whole numbers of modules", value=" ".join(map(str, ends)))
        return found


@dataclass(frozen=True)
class Plane:
    """Robots over two axes."""

    robot: Robot
    x: Axis
    y: Axis

    @classmethod
    def over(cls, robot: Robot, x: Given, y: Given) -> Plane:
        """Read both axes, and refuse two that change the same number."""
        plane = cls(robot, axis(robot, x, "x"), axis(robot, y, "y"))
        both = plane.x.numbers(robot) & plane.y.numbers(robot)
        if both:
            problem = f"must not change a number that x changes: {', '.join(sorted(both))}"
            raise ParameterError(problem, field=f"y {plane.y.path}", value=plane.y.path)
        return plane

    def at(self, x: float, y: float) -> Robot:
        """Robot at SI values; a ChilopodError if there is none."""
        # Springs of new modules exist only once the modules do.
        first, second = ((self.x, x), (self.y, y)) if self.x.whole else ((self.y, y), (self.x, x))
        return second[0].change(first[0].change(self.robot, first[1]), second[1])

    def model(self, x: float, y: float) -> PlanarModel:
        """Planar model at SI values, of one symmetry in time on the whole plane."""
        symmetric = "gait.side_phase" not in (self.x.path, self.y.path)
        return PlanarModel(self.at(x, y), use_symmetry=symmetric)
