"""Energy and power of the planar model, from positions and velocities of every module.

Written without the recursion of :mod:`chilopod.planar.dynamics`, so that the balance of the powers checks it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from chilopod.frozen import Array
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


@dataclass(frozen=True)
class Powers:
    """Powers that enter and leave the robot, W.

    Their sum is the rate of change of the kinetic and elastic energy.

    Attributes
    ----------
    legs
        Power of the leg motors, which drive each stance foot back relative to its module against its friction force.
    floor
        Power of friction at the feet, never positive.
    dampers
        Power of the dampers of the yaw joints, never positive.
    springs
        Power of stiffening bent springs, 1/2 theta^2 dk/dt.
    drives
        Power of torques at the yaw joints.
    """

    legs: float
    floor: float
    dampers: float
    springs: float = 0.0
    drives: float = 0.0

    @property
    def total(self) -> float:
        """Sum of all powers, W."""
        return self.legs + self.floor + self.dampers + self.springs + self.drives


def module_motion(model: PlanarModel, x: ArrayLike) -> tuple[Array, Array]:
    """Headings of the modules relative to module 1, rad, shape (N,), and velocity of their centres (m/s) and yaw rate
    (rad/s) in module 1's frame, shape (N, 3)."""
    state = np.asarray(x, dtype=np.float64)
    heading, rate, velocity = _chain_motion(state, model.modules, model.robot.module_length)
    return heading, np.column_stack([velocity, rate])


def energy(model: PlanarModel, x: ArrayLike, stiffness: ArrayLike | None = None) -> float:
    """Kinetic and elastic energy, J, with the springs of the model or a given ``stiffness``, N*m/rad, shape (N-1,)."""
    x = np.asarray(x, dtype=np.float64)
    _, twist = module_motion(model, x)
    robot = model.robot
    kinetic = robot.module_mass * (twist[:, :2] ** 2).sum() + robot.module_yaw_inertia * (twist[:, 2] ** 2).sum()
    angles = x[3 : model.modules + 2]
    springs = model.stiffness if stiffness is None else np.asarray(stiffness, dtype=np.float64)
    return float(0.5 * (kinetic + (springs * angles**2).sum()))


def powers(
    model: PlanarModel, x: ArrayLike, t: float, stiffness_rate: ArrayLike = 0.0, joint_torque: ArrayLike = 0.0
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
    phase = gait.phases(t, model.modules)
    (heading,), (slip,) = foot_slip([model], x[None], gait.stroke(phase))
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


def foot_slip(models: Sequence[PlanarModel], states: Array, stroke: Array, yaw: ArrayLike = 0.0) -> tuple[Array, Array]:
    """Headings of modules, rad, shape (..., robots, N), and velocities of feet on the floor, m/s, shape (..., robots,
    N, 2, 2).

    They are on the axes of module 1, or on those of the floor where ``states``, shape (..., robots, 2N+1), have poses
    behind; stroke (m) and yaw (rad) are as for :func:`chilopod.kinematics.foot_places`.
    """
    robots = [model.robot for model in models]
    sizes = [(each.module_length, each.legs.forward_offset, each.legs.half_width) for each in robots]
    length, offset, half_width = np.array(sizes).T[..., None]
    heading, rate, velocity = _chain_motion(states, models[0].modules, length)
    places = foot_places(offset[:, None], half_width[:, None], stroke, yaw)
    inside = foot_velocities(places, rate, robots[0].gait.speed, yaw)
    return heading, from_modules(velocity, heading, inside)


def front_velocity(states: Array, heading: Array) -> Array:
    """Velocity of module 1 on the axes that its heading is measured from, m/s, shape (..., 2)."""
    forward, aside, cos, sin = states[..., 0], states[..., 1], np.cos(heading), np.sin(heading)
    return np.stack([forward * cos - aside * sin, forward * sin + aside * cos], axis=-1)


def _chain_motion(states: Array, modules: int, length: ArrayLike) -> tuple[Array, Array, Array]:
    """Headings, yaw rates and velocities of modules, see :func:`foot_slip`."""
    joints = modules - 1
    front = states[..., 2 * joints + 5] if states.shape[-1] > 2 * joints + 3 else np.zeros(states.shape[:-1])
    heading = module_headings(front, states[..., 3 : joints + 3])
    rate = module_headings(states[..., 2], states[..., joints + 3 : 2 * joints + 3])
    return heading, rate, module_velocities(front_velocity(states, front), heading, rate, length)


def foot_powers(friction: Array, slip: Array, heading: Array, speed: float) -> tuple[Array, Array]:
    """Powers that the leg motors deliver and the floor takes, with straight legs, W, both of shape (...).

    Friction (0 in the air) is in N*s/m, shape (..., N, 2), slip the velocity of every foot on the floor, m/s, shape
    (..., N, 2, 2), headings are on the same axes, rad, shape (..., N), and standing feet move back at ``speed``, m/s.
    """
    back = -speed * directions(heading)[0][..., None, :]
    force = -friction[..., None] * slip
    # A motor pushes its foot with minus the friction force, at the speed of the stroke.
    return -(force * back).sum((-3, -2, -1)), (force * slip).sum((-3, -2, -1))
