"""Parameters that the paper varies, the unit of its springs, and the check of a parameter of the planar model."""

from __future__ import annotations

from chilopod import units
from chilopod.errors import ParameterError
from chilopod.robot import Robot
from chilopod.robot.inertia import module_yaw_inertia
from chilopod.robot.parameters import QUANTITIES

K1 = "springs.stiffness[0]"
ALL = "springs.stiffness"
PAPER_UNIT = "N*mm/deg"

_READ = (
    *("body.length", "body.mass", "body.yaw_inertia", "springs.stiffness", "springs.damping", "legs.forward_offset"),
    *("legs.half_width", "gait.stride", "gait.stance", "gait.swing", "gait.module_phase", "gait.side_phase"),
    "ground.friction",
)
_OF_INERTIA = ("hip_height", "upper_link", "lower_link", "link_mass", "foot_radius", "body_width")


def stiffness(value: float) -> float:
    """A spring constant in N*mm/deg as SI."""
    return units.parse(f"{float(value)!r} {PAPER_UNIT}", "N*m/rad")


def spring_scale(robot: Robot) -> float:
    """Scale of a robot's springs, friction x speed x duty factor x module length, N*m/rad. Critical springs of robots
    of one shape are about the same in this unit, whatever their size, mass, speed and floor. They also depend on mass /
    (friction x period), but hardly while the feet stop a module within a step."""
    gait = robot.gait
    return robot.ground.friction * gait.speed * gait.duty * robot.module_length


def searched_springs(robot: Robot) -> tuple[float, float]:
    """Interval in which a critical spring is searched by default, N*m/rad: 0.04 to 1.6 of :func:`spring_scale`."""
    scale = spring_scale(robot)
    return 0.04 * scale, 1.6 * scale


def numbers_read(robot: Robot) -> tuple[str, ...]:
    """Paths of all continuous numbers of a robot's file that the planar model reads, springs one by one."""
    read = set(_read(robot))
    if robot.body.yaw_inertia is None:
        read.remove("body.yaw_inertia")  # it follows from other numbers
    return tuple(path for path in robot.parameters() if path.partition("[")[0] in read)


def check_parameter(robot: Robot, parameter: str) -> None:
    """Refuse, with a ParameterError, anything but the path of a continuous number that the planar model reads; of the
    twin it reads those that set the yaw inertia of a module."""
    read = _read(robot)
    try:
        robot.unit_of(parameter)
    except ParameterError as error:
        error.allowed = ", ".join(read) if error.allowed == ", ".join(QUANTITIES) else error.allowed
        raise
    if parameter == "body.modules":
        raise ParameterError("must be a continuous parameter, not a whole number", field="parameter", value=parameter)
    if parameter.partition("[")[0] not in read:
        problem = "must be a number that the planar model reads"
        raise ParameterError(problem, field="parameter", value=parameter, allowed=", ".join(read))


def _read(robot: Robot) -> tuple[str, ...]:
    """Paths of the numbers that the planar model reads. Those of the twin set the yaw inertia of a module if it is not
    given and legs and width exceed a uniform rod."""
    rod = module_yaw_inertia(robot.body, robot.legs, None)
    return (*_READ, *(f"twin.{name}" for name in _OF_INERTIA if robot.module_yaw_inertia > rod))
