"""Disturbances of trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Engine
from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.robot import Robot

_SLICK = 1e-3
"""Remaining friction of a foot without grip, as a factor."""

_DEVIATIONS = ("joint_angle", "heading", "friction", "bearing")


@dataclass(frozen=True)
class Disturbance:
    """Differences from trial to trial: standard deviations of independent normal deviates.

    None of it is printed in the paper. Of joints at 0.5, 1, 2 deg and feet at 2, 4, 8 % the middle is the smallest
    spread with which the twin agrees with the robot at k1 = 28 N*mm/deg: most walks curve, to both sides (5, 7 and 8 of
    10 after 90 s). A heading of 1 deg corresponds to careful positioning by hand, and the error of the bearing to the
    scanner's step of 0.352 deg with an extended target.

    Attributes
    ----------
    joint_angle, heading
        Deviation of every yaw joint, and of the heading of module 1, at the start, rad.
    friction
        Deviation of the logarithm of every foot's friction coefficient.
    bearing
        Deviation of every measured bearing, rad. The twin's scanner has noise of its own instead, if this is not zero.
    missed
        Fraction of the looks at which the scanner misses the target, on a course.
    slick
        Foot without grip, which simulates a lost leg: module and side (left 0, right 1), counted from 0, or None.
    """

    joint_angle: float = float(np.deg2rad(1.0))
    heading: float = float(np.deg2rad(1.0))
    friction: float = 0.04
    bearing: float = float(np.deg2rad(0.5))
    missed: float = 0.0
    slick: tuple[int, int] | None = None

    def scaled(self, factor: float) -> Disturbance:
        """Disturbance with all standard deviations multiplied by a factor."""
        return replace(self, **{name: factor * getattr(self, name) for name in _DEVIATIONS})

    def __post_init__(self) -> None:
        if not 0.0 <= self.missed <= 1.0:
            raise ParameterError("must be a fraction", field="missed", value=self.missed, allowed="0 to 1")
        for name in _DEVIATIONS:
            value = getattr(self, name)
            if not 0.0 <= value < 10.0:
                raise ParameterError("is out of range", field=name, value=value, allowed="0 or more, less than 10")


NONE = Disturbance(0.0, 0.0, 0.0, 0.0)
"""No disturbance at all."""


@dataclass(frozen=True)
class Drawn:
    """Disturbance of one robot, drawn from a seed.

    Attributes
    ----------
    joint_angles, heading, friction
        Joint angles, shape (N-1,), and heading at the start, rad; factors on the friction coefficients of feet, shape
        (N, 2).
    bearing, missed, scan_seed
        Errors of the measured bearings, rad, and whether the scanner misses the target, shape (looks,); seed of the
        noise of a scanner that has its own.
    """

    joint_angles: Array
    heading: float
    friction: Array
    bearing: Array
    missed: NDArray[np.bool_]
    scan_seed: int


def draw(
    disturbance: Disturbance, seed: int, modules: int, looks: int, joint_angles: Sequence[float] | None = None
) -> Drawn:
    """Draw a disturbance for a number of modules and of looks at the target, each kind from its own stream of random
    numbers. The joint angles at the start scatter about ``joint_angles``, rad, by default straight."""
    streams = np.random.SeedSequence(seed).spawn(6)
    joints, heading, friction, bearing = (np.random.default_rng(each) for each in streams[:4])
    feet = np.exp(disturbance.friction * friction.standard_normal((modules, 2)))
    if disturbance.slick is not None:
        feet[disturbance.slick] *= _SLICK
    missed = np.random.default_rng(streams[5])
    nominal = np.array(joint_angles) if joint_angles else np.zeros(modules - 1)
    return Drawn(
        nominal + disturbance.joint_angle * joints.standard_normal(modules - 1),
        float(disturbance.heading * heading.standard_normal()),
        feet,
        disturbance.bearing * bearing.standard_normal(looks),
        missed.random(looks) < disturbance.missed,
        int(streams[4].generate_state(1)[0]),
    )


def conditions(engine: Engine, robot: Robot, drawn: Sequence[Drawn], noisy: bool) -> dict[str, Any]:
    """Arguments of an engine's ``start`` for drawn walks; a ``noisy`` engine also gets seeds of its sensor noise."""
    angles, headings = np.stack([each.joint_angles for each in drawn]), np.array([each.heading for each in drawn])
    return {
        "initial": engine.initial_states(robot, angles, headings),
        "friction": np.stack([each.friction for each in drawn]),
        "seeds": [each.scan_seed for each in drawn] if noisy and engine.traits.noisy else None,
    }
