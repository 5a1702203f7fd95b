"""Energy and power of the planar model, from positions and velocities of every module.

Written without the recursion of :mod:`chilopod.planar.dynamics`, so that the balance of the powers checks it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from chilopod.planar.model import PlanarModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Powers:
    """Where energy comes from and goes to, W.

    ``legs`` + ``floor`` + ``dampers`` = rate of change of the kinetic and elastic energy.

    Attributes
    ----------
    legs
        Delivered by the leg motors: each stance foot is driven back relative to its module against its friction force.
    floor
        Lost to friction at the feet, never positive.
    dampers
        Lost in the yaw joints, never positive.
    """

    legs: float
    floor: float
    dampers: float


def module_motion(model: PlanarModel, x: ArrayLike) -> tuple[Array, Array]:
    """Headings and velocities of the modules in module 1's frame.

    Returns
    -------
    heading
        Relative to module 1, rad, shape (N,).
    twist
        Velocity of the centre (m/s) and yaw rate (rad/s) in module 1's frame, shape (N, 3).
    """
    x = np.asarray(x, dtype=np.float64)
    n = model.modules
    half = 0.5 * model.robot.module_length
    heading = np.concatenate([[0.0], np.cumsum(x[3 : n + 2])])
    rate = x[2] + np.concatenate([[0.0], np.cumsum(x[n + 2 : 2 * n + 1])])
    # d/dt of -half (cos, sin) of every module is what its ends add to the velocity of the next centre.
    swing = half * rate[:, None] * np.stack([np.sin(heading), -np.cos(heading)], axis=-1)
    steps = swing[:-1] + swing[1:]
    velocity = x[:2] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return heading, np.column_stack([velocity, rate])


def energy(model: PlanarModel, x: ArrayLike) -> float:
    """Kinetic and elastic energy, J."""
    x = np.asarray(x, dtype=np.float64)
    _, twist = module_motion(model, x)
    robot = model.robot
    kinetic = (
        0.5 * robot.module_mass * (twist[:, :2] ** 2).sum() + 0.5 * robot.module_yaw_inertia * (twist[:, 2] ** 2).sum()
    )
    angles = x[3 : model.modules + 2]
    return float(kinetic + 0.5 * (model.stiffness * angles**2).sum())


def powers(model: PlanarModel, x: ArrayLike, t: float) -> Powers:
    """Powers at time t (s) in state x, foot by foot."""
    x = np.asarray(x, dtype=np.float64)
    robot, gait = model.robot, model.robot.gait
    heading, twist = module_motion(model, x)
    phase = (t / gait.period + gait.leg_phases(model.modules)) % 1.0
    standing = phase < gait.duty
    forward = np.stack([np.cos(heading), np.sin(heading)], axis=-1)[:, None, :]
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)[:, None, :]
    ahead = robot.legs.forward_offset + gait.stride * (0.5 - phase / gait.duty)
    side = robot.legs.half_width * np.array([1.0, -1.0])
    arm = ahead[..., None] * forward + side[:, None] * left
    carried = twist[:, None, :2] + twist[:, None, 2:] * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
    stroke = -gait.speed * forward
    force = -robot.ground.friction * (carried + stroke) * standing[..., None]
    rates = x[model.modules + 2 :]
    return Powers(
        # A motor pushes its foot with minus the friction force, at the speed of the stroke.
        legs=float(-(force * stroke).sum()),
        floor=float((force * (carried + stroke)).sum()),
        dampers=float(-(model.damping * rates**2).sum()),
    )
