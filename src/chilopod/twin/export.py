"""Export of the robot for other programs: MJCF, the same model to the bit, and URDF, which is incomplete."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from chilopod.engine.arguments import require
from chilopod.robot import Robot
from chilopod.twin.legs import servo_targets, twin_of
from chilopod.twin.model import SIDES, TwinModel, build

# A link of URDF has one joint only, so that one more stands between the yaw and the hip of a leg; programs want it to
# have a mass: this part of the upper link's, which loses it.
_CARRIER = 1e-6
_GAIT_KEYS = 100  # keyframes of the servo targets in a period
_SENSOR, _JOINT = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_JOINT
_FASTEST = 100.0  # rad/s: URDF wants a limit, the model has none

# Attributes that MuJoCo writes of each named element, with their names in the compiled model where they differ.
_NUMBERS = {
    "body": {"pos": "pos"},
    "inertial": {"pos": "ipos", "mass": "mass", "diaginertia": "inertia"},
    "joint": {name: name for name in ("pos", "axis", "stiffness", "damping", "armature", "frictionloss")},
    "geom": {name: name for name in ("size", "pos", "friction", "solref", "solimp")},
    "site": {"size": "size", "pos": "pos"},
    "general": {"gainprm": "gainprm", "biasprm": "biasprm"},
    "key": {"qpos": "qpos", "ctrl": "ctrl", "time": "time"},
}
_KINDS = {"inertial": "body", "general": "actuator"}


def mjcf(robot: Robot) -> str:
    """Return a robot with a twin as the text of an MJCF file.

    MuJoCo builds from it the model of :func:`chilopod.twin.simulate`, every number to the bit. For the viewer it has a
    visible floor, a light, a camera that follows the robot, sensors of the joint angles and of the place of module 1,
    and keyframes: ``start`` is the robot at time 0 with its servo targets, ``gait0`` and so on are 100 of the servo
    targets of a period at their times; :class:`chilopod.twin.CycleMap` has all. ParameterError if there is no twin.
    """
    twin = TwinModel(robot)
    spec = build(robot)
    _decorate(spec, robot)
    start = twin.initial_positions()
    targets = np.zeros(twin.model.nu)
    targets[twin.leg_controls] = start[twin.leg_positions]
    spec.add_key(name="start", qpos=start, ctrl=targets)
    for i, time in enumerate(np.arange(_GAIT_KEYS) * robot.gait.period / _GAIT_KEYS):
        targets[twin.leg_controls] = servo_targets(robot, [time])[0]
        spec.add_key(name=f"gait{i}", time=time, qpos=start, ctrl=targets)
    for i in range(1, robot.body.modules):
        spec.add_sensor(name=f"yaw{i}", type=_SENSOR.mjSENS_JOINTPOS, objtype=_JOINT, objname=f"yaw{i}")
    for name, kind in (("position", _SENSOR.mjSENS_FRAMEPOS), ("orientation", _SENSOR.mjSENS_FRAMEQUAT)):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_BODY, objname="module1")
    model = spec.compile()
    root = ET.fromstring(spec.to_xml())
    _write_all_digits(root, model)
    return _text(root)


def urdf(robot: Robot) -> str:
    """Return the robot as the text of a URDF file; ParameterError as for :func:`mjcf`.

    Links are named as in MuJoCo; that of module 1 is the root and floats. Feet alone collide. URDF has no springs,
    servos or floor friction; a comment in the file lists them.
    """
    twin, model = twin_of(robot), TwinModel(robot).model
    root = ET.Element("robot", name=robot.name)
    stiffness = " ".join(map(repr, robot.springs.stiffness))
    root.append(
        ET.Comment(
            " SI units. The root link floats. URDF cannot say, and this file does not:\n"
            f"       stiffness of the passive joints yaw1 to yaw{robot.body.modules - 1}, N*m/rad: {stiffness};\n"
            f"       position servos of all other joints: {twin.servo_stiffness!r} N*m/rad, {twin.servo_damping!r} "
            f"N*m*s/rad, rotor inertia {twin.joint_inertia!r} kg*m^2;\n"
            f"       Coulomb friction between feet and floor: {twin.sliding_friction!r}.\n"
            "       Effort and velocity limits are not known; the numbers are there because URDF asks for them. "
        )
    )
    # MuJoCo's own extension, which other programs pass over: keep the root a link of its own, and what is to be seen.
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", fusestatic="false", discardvisual="false")
    length = robot.module_length
    for i in range(robot.body.modules):
        # The frame of a link is at its joint: for modules behind the first that is their front end.
        back = 0.0 if i == 0 else -0.5 * length
        name = f"module{i + 1}"
        _add_link(root, model, name, [back, 0.0, 0.0])
        if i:
            ahead = -0.5 * length if i == 1 else -length
            _add_joint(root, model, f"yaw{i}", f"module{i}", name, [ahead, 0.0, 0.0])
        for side in SIDES:
            _add_leg(root, model, f"leg{i + 1}_{side}", name, back, steered=i == 0)
    ET.indent(root)
    return _text(root)


FORMATS: dict[str, tuple[str, Callable[[Robot], str]]] = {".xml": ("MJCF", mjcf), ".urdf": ("URDF", urdf)}
"""Name of the format and its writer, by suffix of the file."""


def format_of(suffix: str) -> tuple[str, Callable[[Robot], str]]:
    """Return the format of a suffix, such as ``.urdf``; ParameterError for another suffix."""
    allowed = " or ".join(f"{end} ({name})" for end, (name, _) in FORMATS.items())
    require(suffix.lower() in FORMATS, f"must end with {allowed}", "out", suffix)
    return FORMATS[suffix.lower()]


def _decorate(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Add parts that are only visible."""
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.93, 0.93, 0.91],
        rgb2=[0.87, 0.87, 0.85],
        width=256,
        height=256,
    )
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = "floor"
    # Squares of 10 cm: a texture has two by two.
    spec.add_material(name="floor", textures=textures, texrepeat=[5.0, 5.0], texuniform=True)
    spec.geom("floor").material = "floor"
    light = spec.worldbody.add_light(name="sun", pos=[0.0, 0.0, 5.0], dir=[0.2, 0.3, -1.0])
    light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    away = robot.body.length
    spec.body("module1").add_camera(
        name="follow",
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM,
        pos=[-0.4 * away, -1.2 * away, 0.9 * away],
        xyaxes=[1.0, 0.0, 0.0, 0.0, 0.6, 0.8],
    )
    spec.stat.center, spec.stat.extent = [-0.4 * away, 0.0, 0.0], away


def _write_all_digits(root: ET.Element, model: mujoco.MjModel) -> None:
    """Replace the numbers that MuJoCo rounded to six digits by those of the compiled model."""
    option = root.find("option")
    assert option is not None
    for each in ("timestep", "impratio"):
        option.set(each, repr(float(getattr(model.opt, each))))
    for parent in root.iter():
        for element in parent:
            attributes = _NUMBERS.get(element.tag)
            # Without a name there are the class defaults, and the inertia of the body it stands in.
            name = parent.get("name") if element.tag == "inertial" else element.get("name")
            if attributes is None or name is None:
                continue
            compiled = getattr(model, _KINDS.get(element.tag, element.tag))(name)
            for attribute, field in attributes.items():
                if attribute in element.attrib:
                    count = len(element.attrib[attribute].split())
                    element.set(attribute, _numbers(np.ravel(getattr(compiled, field))[:count]))


def _add_leg(root: ET.Element, model: mujoco.MjModel, leg: str, module: str, back: float, steered: bool) -> None:
    upper, lower, parent = f"{leg}_upper", f"{leg}_lower", module
    place = np.add(model.body(upper).pos, [back, 0.0, 0.0])
    rest = 1.0
    if steered:
        parent, rest = f"{leg}_carrier", 1.0 - _CARRIER
        link = ET.SubElement(root, "link", name=parent)
        _inertial(link, [0.0] * 3, _CARRIER * model.body(upper).mass[0], _CARRIER * model.body(upper).inertia)
        _add_joint(root, model, f"{leg}_yaw", module, parent, place)
        place = np.zeros(3)
    _add_link(root, model, upper, [0.0] * 3, rest)
    _add_joint(root, model, f"{leg}_hip", parent, upper, place)
    _add_link(root, model, lower, [0.0] * 3)
    _add_joint(root, model, f"{leg}_knee", upper, lower, model.body(lower).pos)


def _add_link(root: ET.Element, model: mujoco.MjModel, name: str, shift: Sequence[float], part: float = 1.0) -> None:
    """Add a body of the model as a link, `shift` (m) from its frame, with a part of its mass."""
    link, body = ET.SubElement(root, "link", name=name), model.body(name)
    _inertial(link, body.ipos + shift, part * body.mass[0], part * body.inertia)
    for number in range(int(body.geomadr[0]), int(body.geomadr[0] + body.geomnum[0])):
        geom = model.geom(number)
        for kind in ("visual", "collision") if geom.name.endswith("_foot") else ("visual",):
            # Only collision geometry gets names; MuJoCo warns if visible geometry has the same one.
            element = ET.SubElement(link, kind, {"name": geom.name} if kind == "collision" else {})
            ET.SubElement(element, "origin", xyz=_numbers(geom.pos + shift), rpy="0 0 0")
            _shape(ET.SubElement(element, "geometry"), geom)
            if kind == "visual":
                material = ET.SubElement(element, "material", name=f"{geom.name}_colour")
                ET.SubElement(material, "color", rgba=" ".join(f"{number:.3g}" for number in geom.rgba))


def _shape(parent: ET.Element, geom: Any) -> None:
    size = geom.size
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_BOX:
        ET.SubElement(parent, "box", size=_numbers(2.0 * size))
    elif geom.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE:
        ET.SubElement(parent, "sphere", radius=repr(float(size[0])))
    else:  # URDF has no capsules
        ET.SubElement(parent, "cylinder", radius=repr(float(size[0])), length=repr(float(2.0 * size[1])))


def _inertial(link: ET.Element, place: ArrayLike, mass: float, inertia: ArrayLike) -> None:
    element = ET.SubElement(link, "inertial")
    ET.SubElement(element, "origin", xyz=_numbers(place), rpy="0 0 0")
    ET.SubElement(element, "mass", value=repr(float(mass)))
    ixx, iyy, izz = _numbers(inertia).split()
    ET.SubElement(element, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")


def _add_joint(root: ET.Element, model: mujoco.MjModel, name: str, parent: str, child: str, place: ArrayLike) -> None:
    """Add a yaw joint between modules, which bends to a right angle, or one with a servo: it turns all the way round,
    with the torque at an error of half a turn."""
    joint, compiled = ET.SubElement(root, "joint", name=name, type="revolute"), model.joint(name)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_numbers(place), rpy="0 0 0")
    ET.SubElement(joint, "axis", xyz=_numbers(compiled.axis))
    damping, friction = _numbers(compiled.damping), _numbers(compiled.frictionloss)
    ET.SubElement(joint, "dynamics", damping=damping, friction=friction)
    free = child.startswith("module")
    most, effort = (0.5 * math.pi, 0.0) if free else (math.pi, math.pi * float(model.actuator(name).gainprm[0]))
    limits = {"lower": -most, "upper": most, "effort": effort, "velocity": _FASTEST}
    ET.SubElement(joint, "limit", {key: repr(value) for key, value in limits.items()})


def _numbers(values: ArrayLike) -> str:
    """Numbers with all digits that reproduce them, without negative zeros."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in np.ravel(values))


def _text(root: ET.Element) -> str:
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
