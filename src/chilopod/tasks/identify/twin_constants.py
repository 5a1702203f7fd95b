"""The constants of the whole robot that are hard to measure: which are open, where they are looked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Constant:
    """One that is fitted, and where it is looked for.

    Attributes
    ----------
    path
        In the robot's description.
    low, high
        Ends of the range, SI.
    logarithmic
        Whether it is its logarithm that is searched evenly.
    """

    path: str
    low: float
    high: float
    logarithmic: bool = False

    def value(self, part: float) -> float:
        """The constant at a part (0 to 1) of its range."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** part)
        return self.low + part * (self.high - self.low)

    def part(self, value: float) -> float:
        """The inverse of :meth:`value`."""
        if self.logarithmic:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)


FREE = (
    Constant("legs.forward_offset", 0.02, 0.07),
    Constant("legs.half_width", 0.05, 0.10),
    Constant("springs.damping", 0.005, 0.1, True),
    Constant("twin.sliding_friction", 0.3, 1.0),
    Constant("twin.servo_stiffness", 3.0, 20.0, True),
    Constant("twin.clearance", 0.003, 0.015, True),
    Constant("twin.joint_inertia", 5e-4, 4e-3, True),
    Constant("twin.impedance_ratio", 1.0, 30.0, True),
)
"""The constants that are fitted."""

SERVO_TIME = 0.02
"""s: damping of the leg servos over their stiffness, not fitted."""


def with_constants(robot: Robot, constants: Sequence[float] | Array) -> Robot:
    """The robot with other values of :data:`FREE`; its servos' damping follows their stiffness."""
    for each, value in zip(FREE, constants, strict=True):
        robot = robot.with_value(each.path, float(value))
    return robot.with_value("twin.servo_damping", SERVO_TIME * robot.get("twin.servo_stiffness"))


def constants_of(robot: Robot) -> Array:
    """Its values of :data:`FREE`."""
    return np.array([robot.get(each.path) for each in FREE])
