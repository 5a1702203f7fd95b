"""Parts of a robot's description: chain of modules, joints, feet, and constants of the twin."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Final, Self

from pydantic import model_validator

from chilopod.errors import ParameterError
from chilopod.units import Description, Flag, Quantity, format, quantities
from chilopod.units.quantity import is_list

MODULES: Final = Quantity("", "", at_least=2, at_most=1000, integer=True)
_STIFFNESS: Final = Quantity("N*m/rad", "N*mm/deg", each=True)


class Body(Description):
    """Chain of equal modules, joined end to end.

    Attributes
    ----------
    modules
        Number of modules, from 2 to 1000.
    length
        Length of the whole chain, m.
    mass
        Mass of the whole chain, kg.
    yaw_inertia
        Yaw inertia of one whole module with its legs about its centre, kg*m^2, in every engine. None means that of a
        uniform rod of the module's mass and length, or the least possible value if legs and body width of [twin] alone
        exceed it (:mod:`chilopod.robot.inertia`).
    """

    modules: Annotated[int, MODULES]
    length: Annotated[float, Quantity("m", "m")]
    mass: Annotated[float, Quantity("kg", "kg")]
    yaw_inertia: Annotated[float | None, Quantity("kg*m^2", "kg*m^2", optional=True)] = None


class Springs(Description):
    """Torsional springs and dampers of the yaw joints, front to rear; and actuators that change springs during a walk.

    All have one value for each joint; a single one stands for all joints.

    Attributes
    ----------
    stiffness
        Stiffness when the walk begins, shape (modules-1,), N*m/rad, positive.
    damping
        (modules-1,) N*m*s/rad, zero or more.
    adjustable
        True if a spring has an actuator that changes its stiffness, (modules-1,); None for no actuators.
    softest, stiffest
        Limits of the stiffness that an actuator sets, (modules-1,) N*m/rad; None for no limit.
    rate
        Largest rate of change of a spring's stiffness, (modules-1,) N*m/rad/s; None for no limit.
    lag
        Time constant with which a spring follows its actuator, (modules-1,) s; None for no lag.
    """

    stiffness: Annotated[tuple[float, ...], _STIFFNESS]
    damping: Annotated[tuple[float, ...], Quantity("N*m*s/rad", "N*m*s/rad", at_least=0.0, each=True)]
    adjustable: Annotated[tuple[bool, ...] | None, Flag(each=True, optional=True)] = None
    softest: Annotated[tuple[float, ...] | None, replace(_STIFFNESS, optional=True)] = None
    stiffest: Annotated[tuple[float, ...] | None, replace(_STIFFNESS, optional=True)] = None
    rate: Annotated[tuple[float, ...] | None, Quantity("N*m/rad/s", "N*mm/deg/s", each=True, optional=True)] = None
    lag: Annotated[tuple[float, ...] | None, Quantity("s", "s", at_least=0.0, each=True, optional=True)] = None

    @model_validator(mode="before")
    @classmethod
    def _spread_to_all(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and is_list(data.get("stiffness")):
            return spread(data, quantities(cls), len(data["stiffness"]))
        return data

    @model_validator(mode="after")
    def _range_in_order(self) -> Self:
        if self.softest is not None and self.stiffest is not None:
            for joint, (low, high) in enumerate(zip(self.softest, self.stiffest, strict=False)):
                if low > high:
                    problem = f"softest must be at most stiffest at joint {joint + 1}"
                    given, most = (format(end, _STIFFNESS.display, digits=6) for end in (low, high))
                    raise ParameterError(problem, value=given, allowed=f"at most {most}")
        return self


class Legs(Description):
    """Position of each foot at mid-stroke, relative to the centre of its module.

    Attributes
    ----------
    forward_offset
        Distance ahead, m, of either sign.
    half_width
        Distance to the side, m, zero or more.
    """

    forward_offset: Annotated[float, Quantity("m", "m", at_least=-1e9)]
    half_width: Annotated[float, Quantity("m", "m", at_least=0.0)]


class Twin(Description):
    """Constants that only the three-dimensional model reads.

    Attributes
    ----------
    hip_height
        Height of a leg's pitch axis at the body above the centre of its foot in stance, m.
    upper_link, lower_link
        Lengths of the two links of a leg, from pitch axis to pitch axis and from there to the foot's centre, m.
    link_mass
        Mass of each link, kg; taken from the mass of the whole robot.
    foot_radius
        Radius of the round foot, m.
    body_width, body_height
        Width and height of the box of a module's body, m; its length is that of the module.
    clearance
        Height of the tip path's half ellipse, m.
    servo_stiffness, servo_damping
        Stiffness and damping of every leg joint's position servo, N*m/rad and N*m*s/rad.
    joint_inertia
        Reflected inertia of every servo's motor, kg*m^2.
    yaw_friction, leg_friction
        Dry friction of every yaw joint and of every leg joint, N*m, zero by default (MuJoCo: frictionloss).
    sliding_friction
        Coulomb coefficient between foot and floor.
    contact_time
        Time constant in which the floor pushes a foot out, s (MuJoCo: first number of solref).
    impedance_ratio
        Impedance ratio of frictional to normal contact constraints; the higher, the less feet creep (MuJoCo: impratio).
    control_interval
        Time between two servo targets, s.
    timestep
        Step of the simulation, s; the control interval is a whole number of steps.
    scanner_view, scanner_step
        Full angle of the scanner's view, centred ahead, and angle between two of its beams, rad.
    scanner_period
        Time between two scans, s.
    scanner_nearest, scanner_range
        Least and greatest distance that the scanner measures, m.
    scanner_resolution, scanner_noise
        Resolution of the scanner's distances, and standard deviation of their error, m.
    scanner_offset
        Distance of the scanner ahead of the centre of module 1, m.
    pole_radius
        Radius of the pole that marks a target, m.
    """

    hip_height: Annotated[float, Quantity("m", "mm")]
    upper_link: Annotated[float, Quantity("m", "mm")]
    lower_link: Annotated[float, Quantity("m", "mm")]
    link_mass: Annotated[float, Quantity("kg", "kg")]
    foot_radius: Annotated[float, Quantity("m", "mm")]
    body_width: Annotated[float, Quantity("m", "mm")]
    body_height: Annotated[float, Quantity("m", "mm")]
    clearance: Annotated[float, Quantity("m", "mm")]
    servo_stiffness: Annotated[float, Quantity("N*m/rad", "N*m/rad", at_most=1e4)]
    servo_damping: Annotated[float, Quantity("N*m*s/rad", "N*m*s/rad", at_most=1e3)]
    joint_inertia: Annotated[float, Quantity("kg*m^2", "kg*m^2", at_least=0.0)]
    sliding_friction: Annotated[float, Quantity("", "", at_most=1e3)]
    contact_time: Annotated[float, Quantity("s", "s")]
    impedance_ratio: Annotated[float, Quantity("", "", at_least=1e-3, at_most=1e4)]
    control_interval: Annotated[float, Quantity("s", "s")]
    timestep: Annotated[float, Quantity("s", "s", at_least=1e-5, at_most=2e-2)]
    scanner_view: Annotated[float, Quantity("rad", "deg", at_most=2.0 * math.pi)]
    scanner_step: Annotated[float, Quantity("rad", "deg", at_least=1e-4)]
    scanner_period: Annotated[float, Quantity("s", "s")]
    scanner_nearest: Annotated[float, Quantity("m", "m", at_least=0.0)]
    scanner_range: Annotated[float, Quantity("m", "m")]
    scanner_resolution: Annotated[float, Quantity("m", "mm", at_least=0.0)]
    scanner_noise: Annotated[float, Quantity("m", "mm", at_least=0.0)]
    scanner_offset: Annotated[float, Quantity("m", "m", at_least=-1e9)]
    pole_radius: Annotated[float, Quantity("m", "m")]
    yaw_friction: Annotated[float, Quantity("N*m", "N*m", at_least=0.0, at_most=1e3)] = 0.0
    leg_friction: Annotated[float, Quantity("N*m", "N*m", at_least=0.0, at_most=1e3)] = 0.0

    @model_validator(mode="after")
    def _whole_steps(self) -> Self:
        steps = self.control_interval / self.timestep
        if not (steps > 0.5 and abs(steps - round(steps)) < 1e-6):
            problem = "must divide twin.control_interval"
            allowed = f"{self.control_interval:g} s divided by a whole number"
            raise ParameterError(problem, field="timestep", value=f"{self.timestep:g} s", allowed=allowed)
        return self


def spread(table: Mapping[str, Any], keys: Iterable[str], count: int) -> Mapping[str, Any]:
    """Return `table` with a single value under any of `keys` repeated `count` times."""
    given = {key: table[key] for key in keys if table.get(key) is not None}
    single = {key: value for key, value in given.items() if not (is_list(value) or isinstance(value, Mapping))}
    return {**table, **{key: [value] * count for key, value in single.items()}}
