"""Creep of standing feet: MuJoCo's friction lets a foot slip slowly, like a viscous damper.

Below the Coulomb limit a foot that is pushed sideways slips at a speed in proportion to the push. The coefficient
depends on the contact settings and on the inertia that the leg shows the floor, so it is measured on the robot itself:
it stands on all feet at mid-stroke and is pushed at the centre of every module by a few per cent of its weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from chilopod.ground import GRAVITY
from chilopod.robot import Robot
from chilopod.twin.legs import joint_angles
from chilopod.twin.model import compiled, silence

_PUSH = 0.05  # of the weight
_SETTLING, _MEASURED = 1.5, 0.5  # s
_LOOKS = 50  # at whether it still stands, while it settles
_FASTEST = 100.0  # m/s and rad/s
_SUNK = 0.5  # of its height: a robot that is lower does not stand on its feet


@dataclass(frozen=True)
class Creep:
    """Reaction of standing feet to a push: viscous coefficient of one foot, ``along`` for a push ahead and ``across``
    for one to the side, N*s/m; NaN if the robot cannot stand."""

    along: float
    across: float

    def speed(self, force: float) -> float:
        """Speed of the sideways creep of a foot under a force (N), m/s."""
        return force / self.across


def foot_creep(robot: Robot) -> Creep:
    """Measure the creep speed of the standing robot under a push ahead and to the side."""
    with silence():
        return Creep(*(_coefficient(robot, axis) for axis in range(2)))


def _coefficient(robot: Robot, axis: int) -> float:
    plan = compiled(robot)
    model, data = plan.model, mujoco.MjData(plan.model)
    start, stance = plan.initial_positions(), joint_angles(plan.twin, 0.0, plan.twin.hip_height)
    start[plan.leg_positions] = stance
    modules = [model.body(f"module{i}").id for i in range(1, robot.body.modules + 1)]
    push, speeds = _PUSH * robot.module_mass * GRAVITY, []
    # Pushes in both directions cancel a drift.
    for sign in (1.0, -1.0):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = start
        data.ctrl[plan.leg_controls] = stance
        data.xfrc_applied[modules, axis] = sign * push
        for _ in range(_LOOKS):
            mujoco.mj_step(model, data, round(_SETTLING / _LOOKS / model.opt.timestep))
            if not np.abs(data.qvel).max() < _FASTEST:
                return float("nan")
        if data.qpos[2] < _SUNK * start[2]:
            return float("nan")
        before = data.geom_xpos[plan.feet][..., axis].mean()
        mujoco.mj_step(model, data, round(_MEASURED / model.opt.timestep))
        speeds.append(sign * (data.geom_xpos[plan.feet][..., axis].mean() - before) / _MEASURED)
    speed = float(np.mean(speeds))
    return 0.5 * push / speed if speed > 0.0 else float("nan")
