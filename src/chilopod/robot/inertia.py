"""Yaw inertia of a module, of its legs and of its body.

One number, ``body.yaw_inertia``, is that of a whole module with its legs about the module's centre, in every engine.
Legs count as they stand at mid-stroke, foot below the hip; while the robot walks, each swings about that posture.
"""

from __future__ import annotations

import math

from chilopod.robot.parts import Body, Legs, Twin


def module_yaw_inertia(body: Body, legs: Legs, twin: Twin | None) -> float:
    """Yaw inertia of one whole module with its legs about its centre, kg*m^2: as given, else of a uniform rod of the
    module's mass and length, or the least possible value where legs and body width of a short module exceed the rod."""
    if body.yaw_inertia is not None:
        return body.yaw_inertia
    rod = body.mass / body.modules * (body.length / body.modules) ** 2 / 12.0
    return rod if twin is None else max(rod, yaw_inertia_range(body, legs, twin)[0])


def yaw_inertia_range(body: Body, legs: Legs, twin: Twin) -> tuple[float, float]:
    """Least and greatest yaw inertia of a module, kg*m^2: body's mass in the middle, or half of it at each end."""
    mass = body_mass(body, twin)
    least = legs_yaw_inertia(legs, twin) + mass * twin.body_width**2 / 12.0
    return least, least + 0.25 * mass * (body.length / body.modules) ** 2


def body_mass(body: Body, twin: Twin) -> float:
    """Mass of a module without its legs, kg; a module has four links."""
    return body.mass / body.modules - 4.0 * twin.link_mass


def body_inertia(body: Body, legs: Legs, twin: Twin) -> tuple[float, float, float]:
    """Inertia of a module's body without its legs, about its long axis, about its transverse axis and in yaw, kg*m^2.
    Across, the body is a uniform box; along, its mass is spread so that body and legs together have the yaw inertia of
    :func:`module_yaw_inertia`. Such a body exists within :func:`yaw_inertia_range`."""
    mass = body_mass(body, twin)
    across, upright = mass * twin.body_width**2 / 12.0, mass * twin.body_height**2 / 12.0
    yaw = module_yaw_inertia(body, legs, twin) - legs_yaw_inertia(legs, twin)
    along = max(yaw - across, 0.0)
    return across + upright, along + upright, along + across


def legs_yaw_inertia(legs: Legs, twin: Twin) -> float:
    """Yaw inertia of the four links of a module about its centre, standing at mid-stroke, kg*m^2."""
    upper, lower, height = twin.upper_link, twin.lower_link, twin.hip_height
    # Distance of the knee ahead of the line from hip to foot; a leg that is too short hangs straight, and is refused
    # where it is built.
    cosine = (height**2 + upper**2 - lower**2) / (2.0 * height * upper)
    knee = upper * math.sqrt(max(1.0 - cosine**2, 0.0))
    total = 0.0
    for length in (upper, lower):
        across, axial = link_inertia(twin, length)
        tilt = min(knee / length, 1.0) ** 2
        place = (legs.forward_offset + 0.5 * knee) ** 2 + legs.half_width**2
        total += 2.0 * (twin.link_mass * place + across * tilt + axial * (1.0 - tilt))
    return total


def link_inertia(twin: Twin, length: float) -> tuple[float, float]:
    """Inertia of a link across and about its own axis, kg*m^2: a uniform rod. About its axis it is as thick as a foot,
    but never more than across: nothing is singular."""
    across = twin.link_mass * length**2 / 12.0
    return across, min(across, 0.5 * twin.link_mass * twin.foot_radius**2)
