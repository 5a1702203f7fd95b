"""Where the parts of the three-dimensional robot are: those of its MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from chilopod.live.body import Placed
from chilopod.live.state import Seen
from chilopod.robot import Robot
from chilopod.twin.model import POLE_GROUP, compiled, without_springs

Array = NDArray[np.float64]

_PIN = (0.16, 1.06)  # radius of a drawn yaw joint over the width of a module, its height over the module's
_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "rod",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "rod",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "ball",
}


class SolidBody:
    """The twin, as its model has it; see :class:`chilopod.live.body.Body`.

    Parameters
    ----------
    robot
        With a twin.
    """

    def __init__(self, robot: Robot) -> None:
        plan = compiled(without_springs(robot))
        model = plan.model
        self._model, self._data, self._yaw_joints = model, mujoco.MjData(model), plan.yaw_joints
        drawn = [geom for geom in range(model.ngeom) if model.geom_group[geom] != POLE_GROUP]
        self._geoms = {
            kind: np.array([geom for geom in drawn if _KINDS.get(int(model.geom_type[geom])) == kind], dtype=np.intp)
            for kind in ("box", "rod", "ball")
        }
        self._scales = {kind: _scales(kind, model.geom_size[geoms]) for kind, geoms in self._geoms.items()}
        _, half_width, half_height = model.geom("module1_box").size
        pin = (_PIN[0] * 2.0 * half_width, _PIN[0] * 2.0 * half_width, 2.0 * _PIN[1] * half_height)
        self._pins = np.tile(pin, (len(self._yaw_joints), 1))

    def places(self, seen: Seen) -> Mapping[str, Placed]:
        """See :class:`chilopod.live.body.Body`."""
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
