"""Positions and shapes of the parts of a walking robot: boxes, rods, balls and pins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from chilopod.frozen import Array
from chilopod.kinematics import foot_places, from_modules
from chilopod.live.state import Seen
from chilopod.show.scene.frames import bodies
from chilopod.show.scene.outline import SLIMNESS

KINDS = ("box", "rod", "ball", "pin")
"""A cube with sides of 1; a cylinder along z and a ball, both of radius 1 and the cylinder of height 1; and the
cylinders of the yaw joints, front to rear."""


@dataclass(frozen=True)
class Placed:
    """All n parts of a kind: centres (n, 3), m, turns as quaternions (n, 4), the real part first, and sizes along the
    own axes of each (n, 3), m."""

    centres: Array
    turns: Array
    scales: Array


# In parts of the length of a module: the planar robot has no height, and no width but that of its stance.
_WIDTH, _HEIGHT, _GAP, _CLEARANCE, _LIFT = SLIMNESS, 0.22, 0.1, 0.24, 0.1
_LEG, _FOOT, _PIN = 0.028, 0.045, (0.09, 0.26)


def flat_places(seen: Seen) -> Mapping[str, Placed]:
    """Positions by kind of the parts of a robot of an engine that knows only where it is on the floor, module 1 first:
    the body it might have above its feet, which swing forward lifted by a tenth of a module's length."""
    robot = seen.robot
    n, length, legs, gait = robot.body.modules, robot.module_length, robot.legs, robot.gait
    pose, bends, yaw = (each[None, None] for each in (seen.pose, seen.joint_angles, seen.leg_yaw))
    flat = bodies(robot, np.array([seen.clock]), pose[..., :2], pose[..., 2], bends, yaw)
    centres, headings, pins = flat.centres[0, 0], flat.headings[0, 0], flat.spine[0, 0, 1:-1]
    turned = _about_z(headings)

    lift = np.where(flat.stands[0, 0], 0.0, np.sin(gait.swing_angle(gait.phases(seen.clock, n))))
    inside = foot_places(legs.forward_offset, 0.5 * _WIDTH * length, np.zeros((n, 2)))
    hip_height = (_CLEARANCE + 0.5 * _HEIGHT) * length
    feet = _raised(flat.feet[0, 0], (_FOOT + _LIFT * lift) * length).reshape(-1, 3)
    hips = _raised(from_modules(centres, headings, inside), hip_height).reshape(-1, 3)
    sizes = length * np.array([(1.0 - _GAP, _WIDTH, _HEIGHT), (_FOOT,) * 3, (_PIN[0], *_PIN)])
    return {
        "box": Placed(_raised(centres, hip_height), turned, np.tile(sizes[0], (n, 1))),
        "rod": _rods(hips, feet, _LEG * length),
        "ball": Placed(feet, np.tile([1.0, 0.0, 0.0, 0.0], (2 * n, 1)), np.tile(sizes[1], (2 * n, 1))),
        "pin": Placed(_raised(pins, hip_height), turned[:-1], np.tile(sizes[2], (n - 1, 1))),
    }


def _raised(flat: Array, height: float | Array) -> Array:
    return np.concatenate([flat, np.broadcast_to(height, flat.shape[:-1])[..., None]], axis=-1)


def _about_z(angles: Array) -> Array:
    zero = np.zeros_like(angles)
    return np.stack([np.cos(0.5 * angles), zero, zero, np.sin(0.5 * angles)], axis=-1)


def _rods(tops: Array, ends: Array, radius: float) -> Placed:
    """Parts from one end to the other, turned out of z by the shortest way."""
    way = tops - ends
    length = np.linalg.norm(way, axis=-1)
    x, y, z = (way / length[:, None]).T
    turn = np.stack([1.0 + z, -y, x, np.zeros_like(x)], axis=-1)
    turn /= np.linalg.norm(turn, axis=-1, keepdims=True)
    thick = np.full_like(length, radius)
    return Placed(0.5 * (tops + ends), turn, np.stack([thick, thick, length], axis=-1))
