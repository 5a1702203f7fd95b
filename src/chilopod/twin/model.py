"""The robot as a MuJoCo model, built from its description.

Modules are boxes in a row, joined by passive yaw joints with springs. Every leg has two links on two pitch joints, on
module 1 a yaw joint above them; every leg joint has a position servo. Only round feet touch the floor. The frame of a
module is at its centre, at the height of the hips.

Every constant has one owner: springs and their damping the yaw joints (what changes springs, actuators beside them),
servo gains the actuators, friction and contact settings the feet (their priority is above the floor's), ``impratio``
the options.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache

import mujoco
import numpy as np

from chilopod.engine.arguments import require
from chilopod.errors import ParameterError
from chilopod.frozen import Array, read_only
from chilopod.ground import GRAVITY
from chilopod.robot import Robot, Springs, Twin
from chilopod.robot.inertia import body_inertia, body_mass, link_inertia, yaw_inertia_range
from chilopod.twin.legs import check_reach, servo_targets, twin_of
from chilopod.twin.step import with_step

Edit = Callable[[mujoco.MjSpec, Robot], None]
"""Function that changes a robot's description for MuJoCo in place, before it is compiled."""

SIDES = ("left", "right")

POLE_GROUP = 4
"""Geom group of the pole that marks a target, the only geometry that the scanner detects."""

AWAY = (0.0, 0.0, -10.0)
"""Position of that pole without a target, m."""

_POLE_HEIGHT = 0.4  # m
_SCANNER_ABOVE = 0.03  # m, of its beams above the body
_SUNK = 1e-6  # m, depth of feet at the start; at 0 round-off would decide which of them touch the floor
_ROLLING = (0.0, 0.0)  # feet do not resist turning on the spot nor rolling
_UNTOUCHED = {"contype": 0, "conaffinity": 0}  # geoms but the feet and the floor


class TwinModel:
    """A robot with a table [twin], compiled for MuJoCo, and the indices of its parts in MuJoCo's arrays; ParameterError
    if MuJoCo cannot build it.

    With ``forces`` the force on every foot is measured (sensors, in the order of :attr:`feet`). For ``edit`` see
    :class:`chilopod.twin.Edited`.

    Attributes
    ----------
    model
        Compiled model, not to be changed.
    yaw_joints, yaw_positions, yaw_rates
        Numbers of the yaw joints, front to rear, and their indices in ``qpos`` and ``qvel``, (N-1,).
    feet
        Geom of every foot, (N, 2).
    leg_positions, leg_controls, leg_yaw_positions, leg_yaw_controls
        Indices of hip and knee in ``qpos``, and of their servos in ``ctrl``, (N, 2, 2); and likewise of the leg yaw
        joints of module 1, (2,).
    spring_controls
        Indices in ``ctrl`` of the actuators that change the springs, (N-1,), in N*m/rad above the spring's own
        stiffness; empty without such actuators.
    """

    def __init__(self, robot: Robot, forces: bool = False, edit: Edit | None = None) -> None:
        self.robot, self.twin = robot, twin_of(robot)
        spec = build(robot, forces, edit)
        with _in_our_words():
            self.model = spec.compile()
        count = robot.body.modules

        def joint(name: str) -> int:
            return int(self.model.joint(name).id)

        yaw = [joint(f"yaw{i}") for i in range(1, count)]
        legs = [[[joint(f"{leg}_{part}") for part in ("hip", "knee")] for leg in _legs(i)] for i in range(count)]
        leg_yaw = [joint(f"{leg}_yaw") for leg in _legs(0)]
        at, rate = self.model.jnt_qposadr, self.model.jnt_dofadr
        servo_of = {int(self.model.actuator_trnid[i, 0]): i for i in range(self.model.nu)}
        names = [f"spring{i}" for i in range(1, count)] if _adjustable(robot) else []
        feet = [[int(self.model.geom(f"{leg}_foot").id) for leg in _legs(i)] for i in range(count)]
        # Models are shared, so their arrays are read-only.
        self.yaw_joints = read_only(np.array(yaw))
        self.yaw_positions, self.yaw_rates = read_only(at[yaw]), read_only(rate[yaw])
        self.leg_positions, self.leg_yaw_positions = read_only(at[legs]), read_only(at[leg_yaw])
        self.leg_controls = read_only(np.vectorize(servo_of.__getitem__)(legs))
        self.leg_yaw_controls = read_only(np.array([servo_of[i] for i in leg_yaw]))
        self.spring_controls = read_only(np.array([self.model.actuator(name).id for name in names], dtype=np.intp))
        self.feet = read_only(np.array(feet))

    @property
    def steps_per_control(self) -> int:
        """Simulation steps between two servo targets."""
        return round(self.twin.control_interval / self.twin.timestep)

    def initial_positions(self) -> Array:
        """``qpos`` of the robot at time 0: straight, at the origin along x, feet where the gait has them."""
        positions = np.array(self.model.qpos0)
        positions[2] -= _SUNK
        positions[self.leg_positions] = servo_targets(self.robot, np.zeros(1))[0]
        return positions


def build(robot: Robot, forces: bool = False, edit: Edit | None = None) -> mujoco.MjSpec:
    """The robot as an editable MuJoCo description; see :class:`TwinModel`."""
    twin = twin_of(robot)
    check_reach(robot)
    _check_bodies(robot, twin)
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    spec.option.timestep = twin.timestep
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = twin.impedance_ratio
    # The same motion, and the faster for it: a chain with twelve legs has few pairs of joints that act on each other.
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    # A diverging robot must be detected, not reset to its start.
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    world = spec.worldbody
    world.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05], contype=0, conaffinity=1)
    pole = world.add_body(name="pole", mocap=True, pos=AWAY)
    pole.add_geom(
        name="pole",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[twin.pole_radius, 0.5 * _POLE_HEIGHT, 0.0],
        pos=[0.0, 0.0, 0.5 * _POLE_HEIGHT],
        **_UNTOUCHED,
        mass=0.0,
        group=POLE_GROUP,
        rgba=[0.84, 0.37, 0.0, 1.0],
    )
    parent, length = world, robot.module_length
    for i in range(robot.body.modules):
        ahead = [0.0, 0.0, twin.hip_height + twin.foot_radius] if i == 0 else [-length, 0.0, 0.0]
        body = parent.add_body(name=f"module{i + 1}", pos=ahead)
        if i == 0:
            body.add_freejoint(name="root")
            body.add_site(name="scanner", pos=scanner_place(twin), size=[0.005] * 3)
        else:
            body.add_joint(
                name=f"yaw{i}",
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=[0.0, 0.0, 1.0],
                pos=[0.5 * length, 0.0, 0.0],
                stiffness=[robot.springs.stiffness[i - 1], 0.0, 0.0],
                damping=[robot.springs.damping[i - 1], 0.0, 0.0],
                frictionloss=twin.yaw_friction,
            )
            if _adjustable(robot):
                _add_spring_actuator(spec, i)
        _add_box(body, robot, twin)
        for side, leg in enumerate(_legs(i)):
            _add_leg(spec, body, leg, robot, twin, side, steered=i == 0)
        parent = body
    if edit is not None:
        edit(spec, robot)
    with _in_our_words():
        with_step(spec, twin)
    if forces:
        for i in range(robot.body.modules):
            for leg in _legs(i):
                _add_force_sensor(spec, leg)
    return spec


def scanner_place(twin: Twin) -> Array:
    """Origin of the beams of the scanner in the frame of module 1, m."""
    return np.array([twin.scanner_offset, 0.0, 0.5 * twin.body_height + _SCANNER_ABOVE])


@lru_cache(maxsize=64)
def compiled(robot: Robot, forces: bool = False, edit: Edit | None = None) -> TwinModel:
    """Return the model of a robot, shared between calls with the same arguments."""
    return TwinModel(robot, forces, edit)


def without_springs(robot: Robot) -> Robot:
    """The robot without the properties that may differ within a batch."""
    joints = robot.body.modules - 1
    adjustable = (True,) * joints if _adjustable(robot) else None
    same = Springs(stiffness=(1.0,) * joints, damping=(0.0,) * joints, adjustable=adjustable)
    return robot.model_copy(update={"name": "robot", "springs": same, "provenance": type(robot.provenance)()})


@contextmanager
def silence() -> Iterator[None]:
    """Suppress MuJoCo's warnings of diverging robots on stderr and in a file of the current folder."""
    before, silent = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    silent.logto_console = silent.logto_file = False
    silent.set()
    try:
        yield
    finally:
        before.set()


@contextmanager
def _in_our_words() -> Iterator[None]:
    """Turn errors and warnings of MuJoCo into an error of one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
    except (ValueError, UserWarning) as error:  # MuJoCo's own message is the best one
        raise ParameterError(f"MuJoCo cannot build this robot ({error})", field="twin") from None


def _legs(module: int) -> list[str]:
    return [f"leg{module + 1}_{side}" for side in SIDES]


def _check_bodies(robot: Robot, twin: Twin) -> None:
    most = 0.25 * robot.module_mass
    problem, allowed = "must leave mass for the body: a module has four links", f"less than {most:.4g} kg"
    require(twin.link_mass < most, problem, "twin.link_mass", f"{twin.link_mass:g} kg", allowed)
    height, above = twin.body_height, twin.hip_height + twin.foot_radius
    problem, allowed = "must keep the body above the floor", f"less than {2e3 * above:g} mm"
    require(0.5 * height < above, problem, "twin.body_height", f"{1e3 * height:g} mm", allowed)
    (low, high), inertia = yaw_inertia_range(robot.body, robot.legs, twin), robot.module_yaw_inertia
    problem, allowed = "must fit the mass and size of the module and its legs", f"{low:.4g} to {high:.4g} kg*m^2"
    require(low <= inertia <= high, problem, "body.yaw_inertia", f"{inertia:.4g} kg*m^2", allowed)


def _add_box(body: mujoco.MjsBody, robot: Robot, twin: Twin) -> None:
    """Box with a module's mass without its legs, so that both together have the module's yaw inertia."""
    length, width, height = robot.module_length, twin.body_width, twin.body_height
    body.explicitinertial = True
    body.mass, body.ipos = body_mass(robot.body, twin), [0.0, 0.0, 0.0]
    body.inertia = body_inertia(robot.body, robot.legs, twin)
    # Slightly shorter than the module, so that a bend is visible.
    body.add_geom(
        name=f"{body.name}_box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.46 * length, 0.5 * width, 0.5 * height],
        **_UNTOUCHED,
        rgba=[0.62, 0.68, 0.74, 1.0],
    )


def _add_leg(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, leg: str, robot: Robot, twin: Twin, side: int, steered: bool
) -> None:
    width = robot.legs.half_width if side == 0 else -robot.legs.half_width
    upper = body.add_body(name=f"{leg}_upper", pos=[robot.legs.forward_offset, width, 0.0])
    if steered:
        _add_servo(spec, upper, f"{leg}_yaw", [0.0, 0.0, 1.0], twin)
    _add_servo(spec, upper, f"{leg}_hip", [0.0, -1.0, 0.0], twin)
    lower = upper.add_body(name=f"{leg}_lower", pos=[0.0, 0.0, -twin.upper_link])
    _add_servo(spec, lower, f"{leg}_knee", [0.0, -1.0, 0.0], twin)
    for link, length in ((upper, twin.upper_link), (lower, twin.lower_link)):
        across, axial = link_inertia(twin, length)
        link.explicitinertial = True
        link.mass, link.ipos = twin.link_mass, [0.0, 0.0, -0.5 * length]
        link.inertia = [across, across, axial]
        link.add_geom(
            name=link.name,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0.0, 0.0, 0.0, 0.0, 0.0, -length],
            size=[0.8 * twin.foot_radius, 0.0, 0.0],
            **_UNTOUCHED,
            rgba=[0.25, 0.29, 0.34, 1.0],
        )
    lower.add_geom(
        name=f"{leg}_foot",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[twin.foot_radius, 0.0, 0.0],
        pos=[0.0, 0.0, -twin.lower_link],
        contype=1,
        conaffinity=0,
        condim=3,
        priority=1,
        friction=[twin.sliding_friction, *_ROLLING],
        rgba=[0.0, 0.45, 0.70, 1.0],
    )


def _add_servo(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, axis: list[float], twin: Twin) -> None:
    """A hinge and the position servo that drives it: torque = stiffness * (target - angle) - damping * rate."""
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(name=name, type=hinge, axis=axis, armature=twin.joint_inertia, frictionloss=twin.leg_friction)
    spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[twin.servo_stiffness] + [0.0] * 9,
        biasprm=[0.0, -twin.servo_stiffness, -twin.servo_damping] + [0.0] * 7,
    )


def _adjustable(robot: Robot) -> bool:
    return any(robot.springs.adjustable or ())


def _add_spring_actuator(spec: mujoco.MjSpec, joint: int) -> None:
    """Actuator that stiffens a spring: torque = -control * angle, which adds to the joint's own stiffness."""
    spec.add_actuator(
        name=f"spring{joint}",
        target=f"yaw{joint}",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
        biastype=mujoco.mjtBias.mjBIAS_NONE,
        gainprm=[0.0, -1.0] + [0.0] * 8,
    )


def _add_force_sensor(spec: mujoco.MjSpec, leg: str) -> None:
    spec.add_sensor(
        name=f"{leg}_force",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=f"{leg}_foot",
        reftype=mujoco.mjtObj.mjOBJ_GEOM,
        refname="floor",
        intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1],
    )
