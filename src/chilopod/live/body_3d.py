"""Positions of the parts of the three-dimensional robot, from its MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from chilopod.frozen import Array
from chilopod.live.body import Placed
from chilopod.live.state import Seen
from chilopod.robot import Robot
from chilopod.show.scene.replay_3d import drawn, yaw_joint
from chilopod.twin.model import compiled, without_springs

_KINDS = {"box": "box", "capsule": "rod", "cylinder": "rod", "sphere": "ball"}


class SolidBody:
    """Body of a robot with a twin, as its model has it."""

    def __init__(self, robot: Robot) -> None:
        plan = compiled(without_springs(robot))
        model = plan.model
        self._model, self._data, self._yaw_joints = model, mujoco.MjData(model), plan.yaw_joints
        self._geoms = {
            kind: np.array([geom for geom, shape in drawn(model).items() if _KINDS[shape] == kind], dtype=np.intp)
            for kind in ("box", "rod", "ball")
        }
        self._scales = {kind: _scales(kind, model.geom_size[geoms]) for kind, geoms in self._geoms.items()}
        radius, half_height = yaw_joint(model)
        self._pins = np.tile((radius, radius, 2.0 * half_height), (len(self._yaw_joints), 1))

    def places(self, seen: Seen) -> Mapping[str, Placed]:
        """Positions of its parts by kind, module 1 first."""
        model, data = self._model, self._data
        data.qpos[:] = seen.state[: model.nq]
        mujoco.mj_kinematics(model, data)
        placed = {
            kind: Placed(data.geom_xpos[geoms], _quaternions(data.geom_xmat[geoms]), self._scales[kind])
            for kind, geoms in self._geoms.items()
        }
        behind = model.jnt_bodyid[self._yaw_joints]
        placed["pin"] = Placed(data.xanchor[self._yaw_joints], data.xquat[behind], self._pins)
        return placed


def _scales(kind: str, size: Array) -> Array:
    """From MuJoCo's half sizes and radii."""
    if kind == "box":
        return 2.0 * size
    if kind == "ball":
        return np.repeat(size[:, :1], 3, axis=1)
    return np.stack([size[:, 0], size[:, 0], 2.0 * size[:, 1]], axis=1)


def _quaternions(turns: Array) -> Array:
    found = np.empty((len(turns), 4))
    for row, turn in zip(found, turns, strict=True):
        mujoco.mju_mat2Quat(row, turn)
    return found
