"""Remarks on unusual properties of a valid robot."""

from __future__ import annotations

import math

from chilopod.robot.model import Robot


def remarks(robot: Robot) -> list[str]:
    """Return a sentence for every unusual property of a valid robot; an empty list if there is none."""
    found = []
    if not robot.gait.half_period_symmetric:
        found.append(
            "Left and right legs are not half a period apart: analyses use the whole period, at twice the work."
        )
    standing = robot.gait.schedule(robot.body.modules).contact
    if not standing.any(axis=(1, 2)).all():
        found.append("There are moments when no foot of the robot stands.")
    elif not standing.any(axis=2).all():
        found.append("There are moments when a module has no foot on the floor.")
    if abs(robot.legs.forward_offset) + robot.gait.stride / 2.0 > robot.module_length:
        found.append("Feet reach more than a module's length ahead of or behind their module's centre.")
    springs, joints = robot.springs, robot.body.modules - 1
    ranges = zip(springs.softest or (0.0,) * joints, springs.stiffest or (math.inf,) * joints, strict=True)
    kept = zip(springs.adjustable or (False,) * joints, springs.stiffness, ranges, strict=True)
    outside = [
        i + 1 for i, (moves, stiffness, (low, high)) in enumerate(kept) if moves and not low <= stiffness <= high
    ]
    if outside:
        found.append(f"Springs {', '.join(map(str, outside))} begin outside the range of their actuators.")
    unexplained = [path for path in robot.parameters() if robot.provenance_of(path) is None]
    if unexplained:
        found.append(f"Numbers without provenance: {', '.join(unexplained)}.")
    return found
