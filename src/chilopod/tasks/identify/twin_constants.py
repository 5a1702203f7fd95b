"""Free constants of the three-dimensional robot, which are hard to measure, and their ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chilopod.frozen import Array
from chilopod.robot import Robot


@dataclass(frozen=True)
class Constant:
    """Fitted constant: its path in the robot's description and the ends of its range, SI, on a logarithmic scale if
    ``logarithmic``; with ``per``, the range is that of its ratio to an earlier constant of :data:`FREE`."""

    path: str
    low: float
    high: float
    logarithmic: bool = False
    per: str | None = None


FREE = (
    Constant("legs.forward_offset", 0.02, 0.07),
    Constant("legs.half_width", 0.05, 0.10),
    Constant("springs.damping", 0.005, 0.1, True),
    Constant("twin.sliding_friction", 0.3, 1.0),
    Constant("twin.servo_stiffness", 3.0, 20.0, True),
    Constant("twin.clearance", 0.003, 0.015, True),
    Constant("twin.joint_inertia", 5e-4, 4e-3, True),
    Constant("twin.impedance_ratio", 1.0, 30.0, True),
    Constant("twin.servo_damping", 0.02, 0.15, True, per="twin.servo_stiffness"),  # a time, s
)
"""The constants that are fitted."""

_PATHS = [each.path for each in FREE]
_LOW, _HIGH = (np.array([getattr(each, end) for each in FREE]) for end in ("low", "high"))
_LOGARITHMIC = np.array([each.logarithmic for each in FREE])


def values_at(parts: Sequence[float] | Array) -> Array:
    """Constants (SI, in the order of :data:`FREE`) at parts (0 to 1) of their ranges."""
    part = np.asarray(parts, dtype=np.float64)
    values: Array = np.where(_LOGARITHMIC, _LOW * (_HIGH / _LOW) ** part, _LOW + part * (_HIGH - _LOW))
    for index, each in enumerate(FREE):
        if each.per is not None:
            values[index] *= values[_PATHS.index(each.per)]
    return values


def parts_of(values: Sequence[float] | Array) -> Array:
    """The inverse of :func:`values_at`."""
    ratios = np.array(values, dtype=np.float64)
    for index, each in reversed(list(enumerate(FREE))):
        if each.per is not None:
            ratios[index] /= ratios[_PATHS.index(each.per)]
    parts: Array = np.where(
        _LOGARITHMIC, np.log(ratios / _LOW) / np.log(_HIGH / _LOW), (ratios - _LOW) / (_HIGH - _LOW)
    )
    return parts


def with_constants(robot: Robot, constants: Sequence[float] | Array) -> Robot:
    """The robot with other values of :data:`FREE`."""
    for each, value in zip(FREE, constants, strict=True):
        robot = robot.with_value(each.path, float(value))
    return robot


def constants_of(robot: Robot) -> Array:
    """Values of :data:`FREE` of a robot."""
    return np.array([robot.get(path) for path in _PATHS])
