"""Motion of the legs: path of the tip, angles of the two pitch joints, servo targets over time.

The tip stands for a straight line from the AEP to the PEP at constant speed, and swings back along the upper half of
an ellipse (paper, section Robot). Angles are measured from a straight leg that hangs down: the hip's swings the leg
forward, the knee's swings the lower link forward of the upper one; it is negative here, knees point ahead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.robot import Robot, Twin


def tip_path(robot: Robot, phase: ArrayLike) -> Array:
    """Desired position of the tip of a leg at a phase in cycles, any shape (0 is touch-down at the AEP): ahead of and
    above the middle of the stance line, m, shape (..., 2)."""
    gait, clearance = robot.gait, twin_of(robot).clearance
    cycles = np.asarray(phase, dtype=np.float64) % 1.0
    above = np.where(gait.stands(cycles), 0.0, clearance * np.sin(gait.swing_angle(cycles)))
    return np.stack([gait.stroke(cycles), above], axis=-1)


def joint_angles(twin: Twin, ahead: ArrayLike, below: ArrayLike) -> Array:
    """Inverse kinematics of the two pitch joints: hip and knee, rad, shape (..., 2), for a position of the foot's
    centre ahead of and below the hip, m, which the leg can reach (:func:`check_reach`)."""
    x, z = np.broadcast_arrays(np.asarray(ahead, dtype=np.float64), np.asarray(below, dtype=np.float64))
    upper, lower = twin.upper_link, twin.lower_link
    distance = np.hypot(x, z)
    knee = -np.arccos(np.clip((distance**2 - upper**2 - lower**2) / (2.0 * upper * lower), -1.0, 1.0))
    hip = np.arctan2(x, z) - np.arctan2(lower * np.sin(knee), upper + lower * np.cos(knee))
    return np.stack([hip, knee], axis=-1)


def servo_targets(robot: Robot, times: ArrayLike) -> Array:
    """Angles of hip and knee of every leg at times (s, shape (T,)), rad, shape (T, modules, 2 sides, 2 joints)."""
    twin = twin_of(robot)
    tip = tip_path(robot, robot.gait.phases(times, robot.body.modules))
    return joint_angles(twin, tip[..., 0], twin.hip_height - tip[..., 1])


def check_reach(robot: Robot) -> None:
    """Check, before any simulation, that the legs reach their whole path; ParameterError otherwise."""
    twin, (ahead, above) = twin_of(robot), tip_path(robot, np.linspace(0.0, 1.0, 721)).T
    folded, stretched = abs(twin.upper_link - twin.lower_link), twin.upper_link + twin.lower_link
    distance = np.hypot(ahead, twin.hip_height - above)
    if folded <= distance.min() and distance.max() <= stretched:
        return
    # Heights of the hip over a foot that is as near as the folded leg lets it be, and as far as the stretched one does.
    low, high = (above + np.sqrt(np.maximum(end**2 - ahead**2, 0.0)) for end in (folded, stretched))
    least, most = np.ceil(1e5 * low.max()) / 100.0, np.floor(1e5 * high.min()) / 100.0
    fits = least <= most and np.abs(ahead).max() <= stretched
    heights = f"{least:g} to {most:g} mm with these links" if fits else "other links"
    problem = f"must fit gait.stride = {1e3 * robot.gait.stride:.4g} mm: the leg cannot reach its path"
    given, allowed = f"{1e3 * twin.hip_height:.4g} mm", f"{heights}, or a shorter gait.stride"
    raise ParameterError(problem, field="twin.hip_height", value=given, allowed=allowed)


def twin_of(robot: Robot) -> Twin:
    """The table [twin] of the robot; ParameterError if it is missing."""
    if robot.twin is None:
        problem = "the table [twin] must be given in the robot file for the three-dimensional model"
        allowed = "the preset aoi2022, or a file of `chilopod robot new FILE --twin`"
        raise ParameterError(problem, field="twin", allowed=allowed)
    return robot.twin
