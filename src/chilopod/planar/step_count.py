"""Estimated cost of a walk of the planar model before its start: the steps of its integrator."""

from __future__ import annotations

from chilopod.errors import ParameterError
from chilopod.robot import Robot

MOST_STEPS = 2e9
"""Largest number of steps of all modules together: an hour or so of one robot on one core."""

_REACH = 6.0
"""Approximate stability limit of the integrator: fastest rate times longest step."""


def check_steps(robot: Robot, seconds: float) -> None:
    """Refuse a walk that would take too many steps; the error names the property that makes the motion so fast."""
    rates, count = _rates(robot), steps(robot, seconds)
    if count > MOST_STEPS:
        problem = f"the motion is too fast to follow for {seconds:g} s: about {count:.0e} steps of modules"
        allowed = f"at most {MOST_STEPS:.0e} steps of modules"
        raise ParameterError(problem, field=max(rates, key=rates.__getitem__), allowed=allowed)


def steps(robot: Robot, seconds: float) -> float:
    """Approximate number of steps of all modules together."""
    return robot.body.modules * seconds * sum(_rates(robot).values()) / _REACH


def _rates(robot: Robot) -> dict[str, float]:
    """Contribution of each property to a bound on the fastest motion, 1/s, and that of the switches, which end steps.

    The bounds hold for modules without joints. Joints only remove degrees of freedom, and by Rayleigh's principle the
    remaining motion is damped and sprung no more strongly.
    """
    mass, inertia = robot.module_mass, robot.module_yaw_inertia
    legs, springs, friction = robot.legs, robot.springs, robot.ground.friction
    reach = (abs(legs.forward_offset) + 0.5 * robot.gait.stride) ** 2 + legs.half_width**2
    switches = len(robot.gait.schedule(robot.body.modules).times) - 1  # as far as they differ
    return {
        "ground.friction, body.mass": 2.0 * friction / mass,
        "ground.friction, body.yaw_inertia": 2.0 * friction * reach / inertia,
        "springs.stiffness": (4.0 * max(springs.stiffness) / inertia) ** 0.5,
        "springs.damping": 4.0 * max(springs.damping) / inertia,
        "gait.stance, gait.swing": _REACH * switches / robot.gait.period,
    }
