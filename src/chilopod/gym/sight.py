"""Observations of a robot as one row of bounded numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Observation
from chilopod.frozen import Array
from chilopod.gym.actions import Actions

_MOST_BENT = 0.5 * np.pi  # rad, of a joint of a robot that walks


@dataclass(frozen=True)
class Sight:
    """Layout of an observation.

    In order: visibility of the target (0 or 1); sine and cosine of its bearing, left positive, and its distance in m,
    all 0 where it is not seen; the yaw joints, rad; the yaw of the left and of the right leg of module 1 as last
    commanded, rad; and the springs that actions set, in the scale of actions. A robot that no longer walks shows
    straight joints. ``range`` is that of the robot's scanner, m.
    """

    actions: Actions
    range: float

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each number."""
        joints = range(1, self.actions.robot.body.modules)
        springs = self.actions.names
        return (
            "target seen", "sine of bearing", "cosine of bearing", "distance",
            *(f"angle of joint {joint}" for joint in joints), *springs[-2:], *springs[:-2],
        )  # fmt: skip

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest value of each number."""
        joints, springs = self.actions.robot.body.modules - 1, len(self.actions.joints)
        bent, yaw, whole = [_MOST_BENT] * joints, [self.actions.legs.limit] * 2, [1.0] * springs
        high = np.array([1.0, 1.0, 1.0, self.range, *bent, *yaw, *whole])
        low = -high
        low[[0, 3]] = 0.0
        return low, high

    def row(self, seen: Observation) -> NDArray[np.float32]:
        """Observations of robots, shape (robots, len(names)), single precision, within the bounds."""
        known = np.isfinite(seen.bearing)
        bearing = np.where(known, seen.bearing, 0.0)
        target = [known, np.where(known, np.sin(bearing), 0.0), np.where(known, np.cos(bearing), 0.0)]
        target.append(np.where(known, seen.distance, 0.0))
        springs = self.actions.set_by(seen.stiffness[:, self.actions.joints])
        row = np.column_stack([*target, np.nan_to_num(seen.joint_angles), seen.leg_yaw, springs])
        low, high = (each.astype(np.float32) for each in self.bounds)
        return np.clip(row.astype(np.float32), low, high)

    def seen(self, rows: NDArray[np.float32], time: float = 0.0) -> Observation:
        """Observation of a controller, from rows of shape (robots, len(names)): the inverse of :meth:`row`.

        Springs that actions do not set are those of the robot file.
        """
        row, joints = rows.astype(np.float64), self.actions.robot.body.modules - 1
        known, (first, legs) = row[:, 0] > 0.5, (4, 4 + joints)
        stiffness = np.tile(self.actions.robot.springs.stiffness, (len(row), 1))
        stiffness[:, self.actions.joints] = self.actions.stiffness(row[:, legs + 2 :])
        bearing = np.where(known, np.arctan2(row[:, 1], row[:, 2]), np.nan)
        distance = np.where(known, row[:, 3], np.nan)
        return Observation(time, bearing, distance, row[:, first:legs], row[:, legs : legs + 2], stiffness)
