"""Shapes of the three-dimensional robot: those of its MuJoCo model, and its yaw joints, which have none."""

from __future__ import annotations

from typing import Final

import mujoco

from chilopod.twin.model import POLE_GROUP

_SHAPES: Final = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
}
_PIN: Final = (0.16, 1.06)  # radius of a drawn yaw joint over the width of a module, its height over the module's


def drawn(model: mujoco.MjModel) -> dict[int, str]:
    """Geoms of a robot and their kinds: box, capsule, cylinder or sphere; without the pole it walks to."""
    kinds = {geom: _SHAPES.get(int(model.geom_type[geom])) for geom in range(model.ngeom)}
    return {geom: kind for geom, kind in kinds.items() if kind and model.geom_group[geom] != POLE_GROUP}


def yaw_joint(model: mujoco.MjModel) -> tuple[float, float]:
    """Radius and half height of the upright cylinder that represents a yaw joint, m."""
    _, half_width, half_height = model.geom("module1_box").size
    return float(_PIN[0] * 2.0 * half_width), float(_PIN[1] * half_height)
