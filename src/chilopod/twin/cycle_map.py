"""Map of a walk in MuJoCo over one cycle of its gait, in coordinates without the place and heading of the body."""

from __future__ import annotations

import copy
import math
import re
from itertools import product
from operator import attrgetter
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from chilopod.cores import cores
from chilopod.engine.arguments import as_array, require
from chilopod.errors import AnalysisError
from chilopod.frozen import Array, read_only
from chilopod.robot import Robot
from chilopod.twin.legs import servo_targets, twin_of
from chilopod.twin.model import Edit, compiled, silence

_TOLERANCE = 1e-15
"""Tolerance of the contact solver: its first guess (the warm start) then changes an image by some 1e-8 or less."""

_FREE, *_PLAIN = map(int, (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
_WHOLE = 1e-9  # of a cycle
_ELSEWHERE = 1.0, (math.sqrt(5.0) - 1.0) / 2.0  # m or rad; no world repeats at both, however short its period
_ALIKE = 1e-7  # largest change of a coordinate by rounding
_UPRIGHT = 0.5  # cosine of the tilt beyond which the body has fallen
_PARTS = re.compile(
    "(actuator|body|dof|eq|flex|geom|hfield|jnt|mesh_vert|pair|qpos|site|tendon|wrap)_?(?!.*(user|rgba))"
)
"""Names of a model's numbers that may change its motion; others are for pictures and users."""
_SPEEDS = ("ahead", "left", "up", "roll", "pitch", "yaw")


class CycleMap:
    """Map of a walk over one cycle, for any model in MuJoCo whose controls repeat.

    Coordinates of a state in m, rad and per second: height, roll and pitch of a free body (heading, then pitch, then
    roll turn the world's axes into its own), and positions of the other joints, without those of ``travel``; then
    velocities of the free body ahead, to the left (both horizontal, along its heading) and up, its angular velocity in
    its own frame, and rates of all other joints. MuJoCo's solver starts every cycle without a memory of the last one,
    so the map is a function of the state. ``names`` and ``units`` are those of the coordinates, ``period`` is a
    cycle in s, and ``control`` are the controls before every step, which are exact for a robot's :func:`walk_cycle`.

    The model is copied. Its joints are hinges and slides, beside one free joint in front; gravity is vertical, and
    actuators and sensors have no states and no delays. Others are refused by a ParameterError. Controls before every
    step of a cycle have the shape (steps, nu). ``travel`` names joints along which the world looks the same, such as
    the slide ahead of a planar walker. It must also look the same from wherever a free body stands;
    :meth:`depends_on_place` tells.
    """

    def __init__(self, model: mujoco.MjModel, control: ArrayLike, travel: tuple[str, ...] = ()) -> None:
        require(isinstance(model, mujoco.MjModel), "must be a mujoco.MjModel", "model", type(model).__name__)
        self.model, self.control = copy.copy(model), read_only(as_array("control", control))
        _check(self.model)
        kinds = self.model.jnt_type.tolist()
        self._free = free = kinds[0] == _FREE
        fits = self.control.ndim == 2 and self.control.shape[1] == self.model.nu and len(self.control)
        allowed = f"a row for each step, {self.model.nu} columns"
        require(fits, "must be a table", "control", self.control.shape, allowed)
        finite = np.isfinite(self.control)
        require(finite.all(), "must be finite", "control", next(iter(self.control[~finite].tolist()), None))
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.model.opt.tolerance = _TOLERANCE
        self._joints = joints = [self.model.joint(i).name or f"joint {i}" for i in range(free, len(kinds))]
        named = type(travel) in (tuple, list) and len(set(joints).intersection(travel)) == len(travel)
        require(named, "must name joints", "travel", travel, ", ".join(joints))
        self._kept = np.array([i for i, name in enumerate(joints) if name not in travel], dtype=np.intp)
        measures = ["m" if kind == _PLAIN[1] else "rad" for kind in kinds[free:]]
        rates = [f"rate of {name}" for name in (*_SPEEDS[: 6 * free], *joints)]
        self.names = (*("height", "roll", "pitch")[: 3 * free], *(joints[i] for i in self._kept), *rates)
        units = ["m/s"] * 3 * free + ["rad/s"] * 3 * free + [f"{unit}/s" for unit in measures]
        self.units = (*("m", "rad", "rad")[: 3 * free], *(measures[i] for i in self._kept), *units)

    @property
    def period(self) -> float:
        """Length of a cycle in s."""
        return len(self.control) * float(self.model.opt.timestep)

    def reduced(self, positions: ArrayLike, rates: ArrayLike) -> Array:
        """Coordinates, shape (runs, n) or (n,), from MuJoCo's ``qpos`` (..., nq) and ``qvel`` (..., nv)."""
        positions, rates = as_array("positions", positions), as_array("rates", rates)
        fits = (positions.shape[-1:], rates.shape) == ((self.model.nq,), (*positions.shape[:-1], self.model.nv))
        allowed = f"(..., {self.model.nq}) and (..., {self.model.nv})"
        require(fits, "must have the shapes of states", "positions, rates", (positions.shape, rates.shape), allowed)
        if not self._free:
            return np.concatenate([positions[..., self._kept], rates], axis=-1)
        turn = Rotation.from_quat(positions[..., 3:7], scalar_first=True).as_euler("ZYX")
        speed = np.exp(-1j * turn[..., 0]) * (rates[..., 0] + 1j * rates[..., 1])
        parts = (positions[..., 2], turn[..., 2], turn[..., 1]), (speed.real, speed.imag)
        body, ahead = (np.stack(each, axis=-1) for each in parts)
        return np.concatenate([body, positions[..., 7 + self._kept], ahead, rates[..., 2:]], axis=-1)

    def full(self, x: ArrayLike) -> tuple[Array, Array]:
        """``qpos`` (..., nq) and ``qvel`` (..., nv) at the origin along x, from coordinates (runs, n) or (n,)."""
        x = as_array("x", x)
        fits = x.size and x.shape[-1:] == (len(self.names),) and x.ndim <= 2
        require(fits, "must be coordinates", "x", x.shape, f"(runs, {len(self.names)})")
        positions = np.zeros((*x.shape[:-1], self.model.nq))
        angles, rates = np.split(x, [len(self.names) - self.model.nv], axis=-1)
        positions[..., 7 * self._free + self._kept] = angles[..., 3 * self._free :]
        if self._free:
            positions[..., 2] = x[..., 0]
            positions[..., 3:7] = Rotation.from_euler("YX", x[..., [2, 1]]).as_quat(scalar_first=True)
        return positions, rates

    def __call__(self, x: ArrayLike) -> tuple[Array, NDArray[np.int32]]:
        """States after a cycle, and the number of contacts and joint limits that act in each step, shape (runs, steps),
        from states before it, shape (runs, n) or (n,); AnalysisError if one falls."""
        return self._run(*map(np.atleast_2d, self.full(x)))

    def path(self, x: ArrayLike) -> Array:
        """States after every step of a cycle, (steps, n), from the state before it, (n,)."""
        seen = self._rolled(*self.full(self._one(x)), ["qpos", "qvel"])[1]
        return self.reduced(seen["qpos"][0], seen["qvel"][0])

    def _one(self, x: ArrayLike) -> Array:
        """A single state as an array (1, n)."""
        x = as_array("x", x)
        require(x.ndim == 1, "must be the coordinates of a state", "x", x.shape, f"({len(self.names)},)")
        return x[None]

    def _rolled(self, positions: Array, rates: Array, record: list[str]) -> tuple[Batch, dict[Any, NDArray[Any]]]:
        """Walks at the end of a cycle, and what is recorded of each of their steps."""
        batch = Batch(self.model, len(positions), cores())
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        batch.bind("qpos")[:], batch.bind("qvel")[:] = positions, rates
        with silence():
            return batch, batch.rollout(len(self.control), self.control, record=record)

    def _run(self, positions: Array, rates: Array) -> tuple[Array, NDArray[np.int32]]:
        batch, seen = self._rolled(positions, rates, ["ncon", "nl"])
        image = self.reduced(batch.bind("qpos"), batch.bind("qvel"))
        fallen = self._free and (np.cos(image[:, 1]) * np.cos(image[:, 2]) < _UPRIGHT).any()
        if fallen or batch.warning.any() or not np.isfinite(image).all():
            said = "the walk falls, or becomes too fast to follow, within a cycle"
            allowed = "a gait that walks, with steps that are short enough"
            raise AnalysisError(said, field="multipliers", allowed=allowed)
        return image, (seen["ncon"] + seen["nl"]).reshape(len(positions), -1)

    def depends_on_place(self, x: ArrayLike) -> str:
        """Name of a place ("x", "y" or "the heading" of a free body, or a joint of ``travel``) on which the cycle from
        a state (n,) depends, or "": the cycle is repeated from 1 and from 0.618... m or rad away, where no world that
        repeats itself looks the same twice, and must end with the same coordinates."""
        places = {"x": 0, "y": 1, "the heading": 3} if self._free else {}
        places |= {name: 7 * self._free + i for i, name in enumerate(self._joints) if i not in self._kept}
        moved = list(product(places, _ELSEWHERE))
        positions, rates = self.full(np.repeat(self._one(x), len(moved) + 1, axis=0))
        for row, (name, far) in enumerate(moved, 1):
            if name == "the heading":
                turned = Rotation.from_rotvec([0.0, 0.0, far])
                rates[row, :3] = turned.apply(rates[row, :3])
                body = turned * Rotation.from_quat(positions[row, 3:7], scalar_first=True)
                positions[row, 3:7] = body.as_quat(scalar_first=True)
            else:
                positions[row, places[name]] += far
        images = self._run(positions, rates)[0]
        off = np.abs(images - images[0]).max(axis=1)
        return next((name for (name, _), change in zip(moved, off[1:], strict=True) if change > _ALIKE), "")

    def changing(self, states: ArrayLike) -> tuple[str, ...]:
        """Geoms of moving bodies whose contacts differ between the cycles from states (runs, n), and joints whose
        limits do, and when, in words; first those that differ for longest."""
        states = np.atleast_2d(as_array("states", states))
        geoms, limit = self.model.ngeom, int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)
        touching = np.zeros((len(states), len(self.control), geoms + self.model.njnt), dtype=np.bool_)
        for one, state in zip(touching, states, strict=True):
            data = mujoco.MjData(self.model)
            data.qpos[:], data.qvel[:] = self.full(state)
            for row, data.ctrl[:] in zip(one, self.control, strict=True):
                mujoco.mj_step(self.model, data)
                row[data.contact.geom.ravel()] = True
                row[geoms + data.efc_id[data.efc_type == limit]] = True
        moving = np.append(self.model.geom_bodyid > 0, np.ones(self.model.njnt, dtype=np.bool_))
        differs = (touching != touching[0]).any(axis=0) & moving
        found, timestep = [], float(self.model.opt.timestep)
        for geom in sorted(np.flatnonzero(differs.any(axis=0)), key=lambda geom: -differs[:, geom].sum()):
            first, last = np.flatnonzero(differs[:, geom])[[0, -1]] * timestep
            joint = geom - geoms
            name = self.model.geom(geom).name or geom if joint < 0 else f"limit of {self._joints[joint - self._free]}"
            found.append(f"{name} at {first:.3f} to {last + timestep:.3f} s")
        return tuple(found)


def _check(model: mujoco.MjModel) -> None:
    """ParameterError unless a model's numbers are finite, and its state, positions and rates alone, can be divided by
    its place."""
    timestep, parts = float(model.opt.timestep), [f"model.{name}" for name in dir(model) if _PARTS.match(name)]
    require(0.0 < timestep < np.inf, "must be a time step in s", "model.opt.timestep", timestep, "above 0")
    for name in (*(f"model.opt.{name}" for name in dir(model.opt) if name[0] != "_"), *parts):
        values = np.asarray(attrgetter(name.partition(".")[2])(model))
        if values.dtype.kind == "f":
            wrong = np.isnan(values) if name.endswith("range") else ~np.isfinite(values)  # no limit may be infinite
            at = np.argwhere(wrong)[:1].tolist()
            require(not at, "must be finite", f"{name}{(at or [''])[0] or ''}", values[wrong][0] if at else None)
    kinds, sleep = model.jnt_type.tolist(), int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    require(kinds, "must have a joint", "model")
    hidden = (
        ("joint", [kind not in (_FREE, *_PLAIN) for kind in kinds], "must be a hinge or a slide, not a ball"),
        ("joint", [i and kind == _FREE for i, kind in enumerate(kinds)], "must not be free: only the first joint may"),
        ("actuator", model.actuator_actnum, "must have no state"),
        ("actuator", model.actuator_history[:, 0], "must have no delay"),
        ("sensor", model.sensor_history[:, 0], "must have no delay"),
        ("joint", model.jnt_springyield, "must have a spring that does not yield"),
        ("tendon", model.tendon_springyield, "must have a spring that does not yield"),
        ("flex", model.flex_yield, "must not yield"),
        ("plugin", model.plugin_statenum, "must have no state"),
    )
    for what, has, said in hidden:
        for i in np.flatnonzero(has)[:1].tolist():
            name = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{what.upper()}"), i) or i
            allowed = "a state that is positions and rates alone, of one free body at most"
            require(False, said, f"model {what} {name}", allowed=allowed)
    require(not model.opt.enableflags & sleep, "must not let bodies sleep", "model.opt.enableflags")
    gravity = model.opt.gravity
    require(not gravity[:2].any(), "must be vertical", "model.opt.gravity", gravity.tolist())


def walk_cycle(robot: Robot, edit: Edit | None = None) -> tuple[CycleMap, Array]:
    """Cycle map of the robot in three dimensions with all its servo targets, changed by an edit as of
    :class:`chilopod.twin.Edited`, and the coordinates of the robot as it stands; ParameterError if a gait cycle is no
    whole number of control intervals, or steps are too coarse for the servos."""
    twin = twin_of(robot)
    count = robot.gait.period / twin.control_interval
    whole, interval = abs(count - round(count)) <= _WHOLE * count, f"{twin.control_interval:g} s"
    allowed = "a whole part of a gait cycle"
    require(whole, "must repeat with the gait", "twin.control_interval", interval, allowed)
    coarse = 2.0 * twin.joint_inertia / max(twin.servo_damping, 1e-300)
    said, allowed = "must be shorter for the damping of the servos", f"at most {1e3 * coarse:.3g} ms"
    require(twin.timestep <= coarse, said, "twin.timestep", f"{1e3 * twin.timestep:g} ms", allowed)
    plan = compiled(robot, edit=edit)
    control = np.zeros((round(count), plan.model.nu))
    targets = servo_targets(robot, np.arange(len(control)) * twin.control_interval)
    control[:, plan.leg_controls.ravel()] = targets.reshape(len(control), -1)
    cycle = CycleMap(plan.model, np.repeat(control, plan.steps_per_control, axis=0))
    return cycle, cycle.reduced(plan.initial_positions(), np.zeros(plan.model.nv))
