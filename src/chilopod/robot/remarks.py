"""Remarks on unusual properties of a valid robot."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from chilopod.robot.files import presets
from chilopod.robot.model import Robot


def remarks(robot: Robot) -> list[str]:
    """Return a sentence for every unusual property of a valid robot; an empty list if there is none."""
    found = []
    if not robot.gait.half_period_symmetric:
        legs = "Left and right legs are not half a period apart"
        found.append(f"{legs}: analyses use the whole period, at twice the work.")
    standing = robot.gait.schedule(robot.body.modules).contact
    if not standing.any(axis=(1, 2)).all():
        found.append("There are moments when no foot of the robot stands.")
    elif not standing.any(axis=2).all():
        found.append("There are moments when a module has no foot on the floor.")
    if abs(robot.legs.forward_offset) + robot.gait.stride / 2.0 > robot.module_length:
        found.append("Feet reach more than a module's length ahead of or behind their module's centre.")
    ahead = robot.gait.stroke(robot.gait.phases(np.linspace(0.0, robot.gait.period, 241), robot.body.modules))
    if (ahead[:, :-1] - ahead[:, 1:] + robot.module_length <= 0.0).any():
        found.append("Legs of neighbouring modules collide: feet on one side pass each other.")
    springs, joints = robot.springs, robot.body.modules - 1
    ranges = zip(springs.softest or (0.0,) * joints, springs.stiffest or (math.inf,) * joints, strict=True)
    kept = enumerate(zip(springs.adjustable or (False,) * joints, springs.stiffness, ranges, strict=True), 1)
    outside = [i for i, (moves, stiffness, (low, high)) in kept if moves and not low <= stiffness <= high]
    if outside:
        found.append(f"Springs {', '.join(map(str, outside))} begin outside the range of their actuators.")
    found += _out_of_proportion(robot)
    own = {path: (shown, origin) for path, shown, origin in robot.listed() if path != "body.yaw_inertia"}
    theirs = [row for name in presets() for row in Robot.load(name).copied().listed() if row[0] in own]
    alike = [row for row in theirs if own[row[0]][1] in (row[2], row[2].partition(": ")[2])]
    stale = {path for path, shown, _ in alike if own[path][0] != shown}
    if stale:
        found.append(f"Numbers that are not those of the preset, with its provenance: {', '.join(sorted(stale))}.")
    unexplained = [path for path in robot.parameters() if robot.provenance_of(path) is None]
    if unexplained:
        found.append(f"Numbers without provenance: {', '.join(unexplained)}.")
    return found


def _out_of_proportion(robot: Robot) -> Iterator[str]:
    """Numbers far from others, mostly of a wrong unit. Ratios fit chains of 2 to 1000 modules, long or short."""
    body, gait, springs, module = robot.body, robot.gait, robot.springs.stiffness, robot.module_length
    soft, stiff = (f"springs.stiffness[{springs.index(each)}]" for each in (min(springs), max(springs)))
    drag = robot.ground.friction * gait.speed * gait.duty * module  # N*m
    feet = ("legs.half_width", "legs.forward_offset")
    rod = robot.module_mass * module**2 / 12.0
    damping = max(robot.springs.damping)
    damper = f"springs.damping[{robot.springs.damping.index(damping)}]"
    lengths = (*feet, "twin.hip_height", "twin.body_width", "twin.body_height") if robot.twin else feet
    pairs = [
        ("body.mass", "body.length", body.mass / (body.length**2 * module), 0.05, 5000.0),  # kg/m^3
        ("body.yaw_inertia", "body.mass", (robot.body.yaw_inertia or rod) / rod, 0.02, 50.0),
        *((path, "body.length", abs(robot.get(path)) / body.length, 0.0, 0.5) for path in lengths),
        ("gait.stride", "body.length", gait.stride / body.length, 1e-3 / body.modules, 1.0),
        ("gait.stance", "gait.swing", gait.stance / gait.swing, 0.02, 50.0),
        ("gait.stride", "gait.stance", gait.speed / module, 0.005, 500.0),  # 1/s
        (soft, "ground.friction", min(springs) / drag, 0.01, math.inf),
        (stiff, "ground.friction", max(springs) / drag, 0.0, body.modules),
        (damper, stiff, damping / (max(springs) * gait.period), 0.0, 100.0),
    ]
    text = {path: shown for path, shown, _ in robot.listed()}
    odd = [each for each in pairs if not each[3] <= each[2] <= each[4]]
    for path, other, ratio, low, _ in odd:
        yield f"{path} = {text[path]} is unusually {'small' if ratio < low else 'large'} for {other} = {text[other]}."
    if odd:
        yield "Are the units right? A number without a unit is SI."
