"""Energy and power of the planar model, from positions and velocities of every module.

Written without the recursion of :mod:`chilopod.planar.dynamics`, so that the balance of the powers checks it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.kinematics import (
    directions,
    foot_places,
    foot_velocities,
    from_modules,
    module_headings,
    module_velocities,
)

if TYPE_CHECKING:
    from chilopod.planar.model import PlanarModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Powers:
    """Where energy comes from and goes to, W.

    Their sum is the rate of change of the kinetic and elastic energy.

    Attributes
    ----------
    legs
        Delivered by the leg motors: each stance foot is driven back relative to its module against its friction force.
    floor
        Lost to friction at the feet, never positive.
    dampers
        Lost in the yaw joints, never positive.
    springs
        Done on bent springs by stiffening them, 1/2 theta^2 dk/dt.
    drives
        Delivered by torques at the yaw joints.
    """

    legs: float
    floor: float
    dampers: float
    springs: float = 0.0
    drives: float = 0.0

    @property
    def total(self) -> float:
        """Their sum."""
        return self.legs + self.floor + self.dampers + self.springs + self.drives


def module_motion(model: PlanarModel, x: ArrayLike) -> tuple[Array, Array]:
    """Headings of the modules relative to module 1, rad, shape (N,), and velocity of their centres (m/s) and yaw rate
    (rad/s) in module 1's frame, shape (N, 3)."""
    x = np.asarray(x, dtype=np.float64)
    n = model.modules
    heading = module_headings(0.0, x[3 : n + 2])
    rate = module_headings(x[2], x[n + 2 : 2 * n + 1])
    velocity = module_velocities(x[:2], heading, rate, model.robot.module_length)
    return heading, np.column_stack([velocity, rate])


def energy(model: PlanarModel, x: ArrayLike, stiffness: ArrayLike | None = None) -> float:
    """Kinetic and elastic energy, J; with the springs of the model, or of a ``stiffness``, N*m/rad, shape (N-1,)."""
    x = np.asarray(x, dtype=np.float64)
    _, twist = module_motion(model, x)
    robot = model.robot
    kinetic = (
        0.5 * robot.module_mass * (twist[:, :2] ** 2).sum() + 0.5 * robot.module_yaw_inertia * (twist[:, 2] ** 2).sum()
    )
    angles = x[3 : model.modules + 2]
    springs = model.stiffness if stiffness is None else np.asarray(stiffness, dtype=np.float64)
    return float(kinetic + 0.5 * (springs * angles**2).sum())


def powers(
    model: PlanarModel,
    x: ArrayLike,
    t: float,
    stiffness_rate: ArrayLike = 0.0,
    joint_torque: ArrayLike = 0.0,
) -> Powers:
    """Powers at one moment, foot by foot and joint by joint.

    Parameters
    ----------
    model
        The robot.
    x
        Reduced state, shape (2N+1,).
    t
        s.
    stiffness_rate, joint_torque
        Rate at which every spring stiffens, N*m/rad/s, and torque that drives its joint, N*m, shape (N-1,).
    """
    x = np.asarray(x, dtype=np.float64)
    robot, gait = model.robot, model.robot.gait
    heading, twist = module_motion(model, x)
    phase = gait.phases(t, model.modules)
    places = foot_places(robot.legs.forward_offset, robot.legs.half_width, gait.stroke(phase))
    slip = from_modules(twist[:, :2], heading, foot_velocities(places, twist[:, 2], gait.speed))
    friction = np.where(gait.stands(phase), robot.ground.friction, 0.0)
    legs, floor = foot_powers(friction, slip, heading, gait.speed)
    angles, rates = x[3 : model.modules + 2], x[model.modules + 2 :]
    return Powers(
        legs=float(legs),
        floor=float(floor),
        dampers=float(-(model.damping * rates**2).sum()),
        springs=float((0.5 * angles**2 * np.asarray(stiffness_rate, dtype=np.float64)).sum()),
        drives=float((rates * np.asarray(joint_torque, dtype=np.float64)).sum()),
    )


def foot_powers(friction: Array, slip: Array, heading: Array, speed: float) -> tuple[Array, Array]:
    """Powers that the leg motors deliver and the floor takes, with straight legs, W, both of shape (...).

    Friction (0 in the air) is in N*s/m, shape (..., N, 2), slip the velocity of every foot on the floor, m/s, shape
    (..., N, 2, 2), headings are on the same axes, rad, shape (..., N), and standing feet move back at ``speed``, m/s.
    """
    back = -speed * directions(heading)[0][..., None, :]
    force = -friction[..., None] * slip
    # A motor pushes its foot with minus the friction force, at the speed of the stroke.
    return -(force * back).sum((-3, -2, -1)), (force * slip).sum((-3, -2, -1))
