"""Map of a walk in MuJoCo over one cycle of its gait, in coordinates without the place and heading of the body."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from chilopod.cores import cores
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array
from chilopod.twin.model import silence

_TOLERANCE = 1e-15
"""Tolerance of the contact solver: its first guess (the warm start) then changes an image by some 1e-8 or less."""

_UPRIGHT = 0.5  # cosine of the tilt beyond which the body has fallen


class CycleMap:
    """Map of a walk over one cycle, for any model in MuJoCo whose controls repeat.

    Coordinates of a state, ``dimension`` numbers in m, rad and per second:

    - of a model whose first joint is free: height, roll and pitch of its body (heading, then pitch, then roll turn the
      world's axes into the body's); its place on the floor and its heading are no coordinates;
    - positions of the other joints in the order of the model, without those of ``travel``;
    - with a free joint, the velocity of its body ahead, to the left (both horizontal, along its heading) and up, and
      its angular velocity in its own frame;
    - rates of all other joints.

    MuJoCo's solver starts every cycle without a memory of the last one, so the map is a function of the state.

    Parameters
    ----------
    model
        Model, which is copied. Joints are hinges and slides, beside one free joint in front; gravity is vertical.
    control
        Controls before every step of a cycle, shape (steps, nu).
    travel
        Names of joints along which the floor looks the same, such as the slide ahead of a planar walker.
    warm_start
        False to let the solver start every step from zero. Images differ by less than 1e-6.
    threads
        Largest number of threads; 0 for all cores.

    Attributes
    ----------
    model, control
        The copy, and the controls.
    names
        Name of every coordinate.

    Raises
    ------
    ParameterError
        If the state of the model cannot be divided by its place, or has parts that are no coordinates.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        control: ArrayLike,
        *,
        travel: tuple[str, ...] = (),
        warm_start: bool = True,
        threads: int = 0,
    ) -> None:
        self.model = copy.copy(model)
        kinds = [mujoco.mjtJoint(kind) for kind in self.model.jnt_type]
        self._free = kinds[:1] == [mujoco.mjtJoint.mjJNT_FREE]
        plain = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
        if not kinds or any(kind not in plain for kind in kinds[self._free :]) or self.model.na:
            allowed = "hinges and slides behind at most one free joint, and actuators without states"
            raise ParameterError("must have a state that can be put back", field="model", allowed=allowed)
        if self.model.opt.gravity[:2].any():
            raise ParameterError("must be vertical", field="model.opt.gravity", value=self.model.opt.gravity.tolist())
        self.control = np.array(control, dtype=np.float64)
        if self.control.ndim != 2 or self.control.shape[1] != self.model.nu or not len(self.control):
            allowed = f"a row for each step, {self.model.nu} columns"
            raise ParameterError("must be a table", field="control", value=self.control.shape, allowed=allowed)
        disabled = mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self.model.opt.disableflags |= int(disabled if warm_start else disabled | mujoco.mjtDisableBit.mjDSBL_WARMSTART)
        self.model.opt.tolerance = _TOLERANCE
        self._threads = threads or cores()
        joints = [self.model.joint(i).name or f"joint {i}" for i in range(self._free, len(kinds))]
        missing = sorted(set(travel) - set(joints))
        if missing:
            raise ParameterError("must name joints", field="travel", value=missing[0], allowed=", ".join(joints))
        self._kept = np.array([i for i, name in enumerate(joints) if name not in travel], dtype=np.intp)
        shown = [joints[i] for i in self._kept]
        body, speeds = ["height", "roll", "pitch"], ["ahead", "left", "up", "roll", "pitch", "yaw"]
        rates = [f"rate of {name}" for name in (*(speeds if self._free else ()), *joints)]
        self.names = (*(body if self._free else ()), *shown, *rates)

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.names)

    def reduced(self, positions: Array, rates: Array) -> Array:
        """Coordinates, shape (..., dimension), from MuJoCo's ``qpos`` (..., nq) and ``qvel`` (..., nv)."""
        if not self._free:
            return np.concatenate([positions[..., self._kept], rates], axis=-1)
        w, x, y, z = np.moveaxis(positions[..., 3:7], -1, 0)
        heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
        roll = np.arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
        pitch = np.arcsin(np.clip(2.0 * (w * y - x * z), -1.0, 1.0))
        c, s, vx, vy = np.cos(heading), np.sin(heading), rates[..., 0], rates[..., 1]
        body = np.stack([positions[..., 2], roll, pitch], axis=-1)
        ahead = np.stack([c * vx + s * vy, c * vy - s * vx], axis=-1)
        return np.concatenate([body, positions[..., 7 + self._kept], ahead, rates[..., 2:]], axis=-1)

    def full(self, x: Array) -> tuple[Array, Array]:
        """``qpos`` (..., nq) and ``qvel`` (..., nv) at the origin along x, from coordinates (..., dimension)."""
        shape = x.shape[:-1]
        split = self.dimension - self.model.nv
        positions = np.zeros((*shape, self.model.nq))
        positions[..., (7 if self._free else 0) + self._kept] = x[..., 3 if self._free else 0 : split]
        if self._free:
            roll, pitch = 0.5 * x[..., 1], 0.5 * x[..., 2]
            c, s, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
            positions[..., 2] = x[..., 0]
            positions[..., 3:7] = np.stack([c * cp, s * cp, c * sp, -s * sp], axis=-1)
        return positions, x[..., split:]

    def __call__(self, x: Array) -> Array:
        """States after a cycle, from states before it, shapes (runs, dimension); AnalysisError if one falls."""
        return self.with_contacts(x)[0]

    def with_contacts(self, x: Array) -> tuple[Array, NDArray[np.int32]]:
        """States after a cycle, (runs, dimension), and the number of contacts in each step, (runs, steps)."""
        batch = Batch(self.model, len(x), self._threads)
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        batch.bind("qpos")[:], batch.bind("qvel")[:] = self.full(x)
        with silence():
            counts = batch.rollout(len(self.control), self.control, record=["ncon"])["ncon"]
        image = self.reduced(batch.bind("qpos"), batch.bind("qvel"))
        upright = np.cos(image[:, 1]) * np.cos(image[:, 2]) if self._free else np.ones(len(x))
        if batch.warning.any() or not np.isfinite(image).all() or (upright < _UPRIGHT).any():
            said = "the walk falls, or becomes too fast to follow, within a cycle"
            raise AnalysisError(
                said, field="multipliers", allowed="a gait that walks, with steps that are short enough"
            )
        return image, counts.reshape(len(x), -1)

    def contacts(self, x: Array) -> dict[str, NDArray[np.bool_]]:
        """Steps of a cycle in which geoms of moving bodies touch, (steps,), by name; from a state (dimension,)."""
        data = mujoco.MjData(self.model)
        touching: dict[str, NDArray[np.bool_]] = {}
        data.qpos[:], data.qvel[:] = self.full(x)
        for step, inputs in enumerate(self.control):
            data.ctrl[:] = inputs
            mujoco.mj_step(self.model, data)
            for geom in set(data.contact.geom.ravel().tolist()):
                if self.model.geom_bodyid[geom]:
                    name = self.model.geom(geom).name or f"geom {geom}"
                    touching.setdefault(name, np.zeros(len(self.control), dtype=np.bool_))[step] = True
        return touching
