"""Shapes of the three-dimensional robot, and data of a page that plays its walks from any point of view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np
import xarray as xr

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.show.scene.frames import LARGEST, Scene, encoded, packed
from chilopod.twin.model import POLE_GROUP, TwinModel, compiled

FINE: Final = 10
"""Thin grid lines from one grid line to the next."""

_SHAPES: Final = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
}
_PIN: Final = (0.16, 1.06)  # radius of a drawn yaw joint over the width of a module, its height over the module's
_WILDEST: Final = 10.0  # m and rad: what diverges is drawn no further than that


def drawn(model: mujoco.MjModel) -> dict[int, str]:
    """Geoms of a robot and their kinds: box, capsule, cylinder or sphere; without the pole it walks to."""
    kinds = {geom: _SHAPES.get(int(model.geom_type[geom])) for geom in range(model.ngeom)}
    return {geom: kind for geom, kind in kinds.items() if kind and model.geom_group[geom] != POLE_GROUP}


def yaw_joint(model: mujoco.MjModel) -> tuple[float, float]:
    """Radius and half height of the upright cylinder that represents a yaw joint, m."""
    _, half_width, half_height = model.geom("module1_box").size
    return float(_PIN[0] * 2.0 * half_width), float(_PIN[1] * half_height)


def solid(record: xr.Dataset, shown: Scene) -> dict[str, Any]:
    """Data that the scripts of a page in three dimensions read: the joints' positions as whole numbers of 16 bits
    (little-endian, in base64), from which they put the bodies where they are. A ParameterError if the poses of the
    record are not those of its robot."""
    plan = compiled(shown.frames.robot)
    found = record["pose"].transpose("time", "robot", "coordinate")
    if found.sizes["coordinate"] != plan.model.nq:
        problem = f"has poses of {found.sizes['coordinate']} coordinates"
        raise ParameterError(problem, field="record", allowed=f"{plan.model.nq}, those of its robot")
    free = plan.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
    quaternions = (plan.model.jnt_qposadr[free] + 3).tolist()
    poses = _continued(found.sel(time=shown.frames.time).values, quaternions)
    origin, step = _scale(shown, poses)
    steps = packed(poses, origin, step)
    pole = plan.model.geom("pole").size
    return {
        "fine": FINE,
        "scale": {"origin": origin.tolist(), "step": step.tolist()},
        "length": plan.robot.body.length,
        "pole": {"radius": float(pole[0]), "height": 2.0 * float(pole[1])},
        "bodies": _bodies(plan.model),
        "shapes": _shapes(plan) + _pins(plan),
        "robots": [{"pose": encoded(steps[:, robot])} for robot in range(poses.shape[1])],
    }


def _continued(poses: Array, quaternions: Sequence[int]) -> Array:
    """Poses (T, R, coordinates) that stay as they were once a robot stops; quaternions, which begin at some of the
    coordinates, do not jump."""
    known = np.isfinite(poses).all(axis=-1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(poses))[:, None], 0), axis=0)
    poses = poses[last, np.arange(poses.shape[1])]
    # A quaternion and its opposite are the same rotation, but the way from one to the other is not none.
    for at in quaternions:
        turn = poses[..., at : at + 4]
        turn[:] = turn.clip(-1.0, 1.0)  # of a robot that blows up, anything may be there
        agree = (turn[1:] * turn[:-1]).sum(axis=-1, keepdims=True)
        turn[1:] *= np.cumprod(np.where(agree < 0.0, -1.0, 1.0), axis=0)
    return poses


def _scale(shown: Scene, poses: Array) -> tuple[Array, Array]:
    """Middle and step of every coordinate."""
    with np.errstate(invalid="ignore"):
        finite = np.where(np.isfinite(poses), poses, 0.0).clip(-_WILDEST, _WILDEST)
    low, high = finite.min(axis=(0, 1)), finite.max(axis=(0, 1))
    middle, reach = 0.5 * (low + high), 0.5 * (high - low)
    middle[:2], reach[:2] = shown.floor.span()
    # Of what does not change a step of any size will do.
    return middle, np.maximum(reach, 1e-9) / LARGEST


def _bodies(model: mujoco.MjModel) -> list[dict[str, Any]]:
    """The chain of bodies, each after the one it hangs on: where it is there, and the joints that it moves about."""
    return [
        {
            "parent": int(model.body_parentid[body]),
            "place": model.body_pos[body].tolist(),
            "turn": model.body_quat[body].tolist(),
            "joints": [
                {
                    "free": bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE),
                    "at": int(model.jnt_qposadr[joint]),
                    "axis": model.jnt_axis[joint].tolist(),
                    "anchor": model.jnt_pos[joint].tolist(),
                }
                for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
            ],
        }
        for body in range(model.nbody)
    ]


def _shapes(plan: TwinModel) -> list[dict[str, Any]]:
    """Shapes of the model: body, place, kind and size (half sizes, m) of each."""
    model, feet = plan.model, {int(geom) for geom in plan.feet.ravel()}
    front = int(model.body("module1").id)
    shapes = []
    for geom, kind in drawn(model).items():
        body = int(model.geom_bodyid[geom])
        role = "foot" if geom in feet else "leg"
        if kind == "box":
            role = "front" if body == front else "module"
        place, turn = model.geom_pos[geom].tolist(), model.geom_quat[geom].tolist()
        size = model.geom_size[geom].tolist()
        shapes.append({"body": body, "kind": kind, "role": role, "size": size, "place": place, "turn": turn})
    return shapes


def _pins(plan: TwinModel) -> list[dict[str, Any]]:
    """The yaw joints, which have no geometry in the model."""
    bodies, places = plan.model.jnt_bodyid[plan.yaw_joints].tolist(), plan.model.jnt_pos[plan.yaw_joints].tolist()
    look = {"kind": "cylinder", "role": "joint", "size": [*yaw_joint(plan.model), 0.0], "turn": [1.0, 0.0, 0.0, 0.0]}
    return [{"body": body, "place": place, **look} for body, place in zip(bodies, places, strict=True)]
