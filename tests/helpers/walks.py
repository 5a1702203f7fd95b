"""Records of walks that need no simulation: straight ahead, and round a circle, without any slip of the body."""

import math

import numpy as np
import xarray as xr

from chilopod import load_robot
from chilopod.record import bearing_and_distance

ROBOT = load_robot("aoi2022-planar")


def walk(*curvatures, duration=6.0, step=0.02, stops=(), targets=None, robot=ROBOT, start=0.0, leg_yaw=0.0):
    """Robots that walk at the gait's speed, each on its circle.

    Parameters
    ----------
    curvatures
        Of the path of module 1, 1/m, left positive, one for each robot.
    duration, step, start
        Of the record, s.
    stops
        Pairs of a robot's index and the time (s) from which on its values are NaN.
    targets
        (R, 2) m.
    leg_yaw
        Of both legs of module 1, rad.
    """
    time = start + step * np.arange(round(duration / step) + 1)
    count, joints = len(curvatures), robot.body.modules - 1
    position, heading = np.zeros((len(time), count, 2)), np.zeros((len(time), count))
    angles, status = np.zeros((len(time), count, joints)), np.array(["walked"] * count, dtype=object)
    for index, curvature in enumerate(curvatures):
        path = robot.gait.speed * (time - start)
        heading[:, index] = curvature * path
        if curvature:
            turn = heading[:, index]
            position[:, index] = np.stack([np.sin(turn), 1.0 - np.cos(turn)], axis=-1) / curvature
        else:
            position[:, index, 0] = path
        # The centres of all rods lie on the circle that their joints go round outside.
        angles[:, index] = -2.0 * math.atan(0.5 * robot.module_length * curvature)
    yaw = np.full((len(time), count, 2), leg_yaw)
    for index, when in stops:
        status[index] = "diverged"
        for values in (position, heading, angles, yaw):
            values[time >= when, index] = np.nan
    data = {
        "position": (("time", "robot", "axis"), position, {"units": "m"}),
        "heading": (("time", "robot"), heading, {"units": "rad"}),
        "joint_angle": (("time", "robot", "joint"), angles, {"units": "rad"}),
        "leg_yaw": (("time", "robot", "side"), yaw, {"units": "rad"}),
        "status": (("robot",), status),
    }
    attrs = {"robot": robot.to_toml()}
    if targets is not None:
        data["target"] = (("robot", "axis"), np.asarray(targets, dtype=float), {"units": "m"})
        away = np.linalg.norm(position - np.asarray(targets), axis=-1)
        data["distance"] = (("time", "robot"), away, {"units": "m"})
    coords = {"time": time, "robot": np.arange(count), "axis": ["x", "y"]}
    return xr.Dataset(data, {**coords, "joint": np.arange(1, joints + 1), "side": ["left", "right"]}, attrs)


def on_course(record, places, turns, verdicts):
    """The record with goals.

    Parameters
    ----------
    record
        As from :func:`walk`.
    places
        (R, G, 2) m.
    turns
        (R, G, 2) s, when each began and ended.
    verdicts
        (R, G) text.
    """
    places, turns = np.asarray(places, dtype=float), np.asarray(turns, dtype=float)
    target = np.full((record.sizes["time"], record.sizes["robot"], 2), np.nan)
    for robot, goal in np.ndindex(*turns.shape[:2]):
        begin, end = turns[robot, goal]
        target[(record.time.values >= begin) & (record.time.values <= end), robot] = places[robot, goal]
    stiffness = np.tile(ROBOT.springs.stiffness, (record.sizes["robot"], 1))
    bearing, away = bearing_and_distance(record.position.values, record.heading.values, target)
    return record.assign(
        distance=(("time", "robot"), away, {"units": "m"}),
        bearing=(("time", "robot"), bearing, {"units": "rad"}),
        target=(("time", "robot", "axis"), target, {"units": "m"}),
        stiffness=(("robot", "joint"), stiffness, {"units": "N*m/rad"}),
        goal_place=(("robot", "goal", "axis"), places, {"units": "m"}),
        goal_begin=(("robot", "goal"), turns[..., 0], {"units": "s"}),
        goal_end=(("robot", "goal"), turns[..., 1], {"units": "s"}),
        goal_verdict=(("robot", "goal"), np.array(verdicts, dtype=object)),
    )


def reduced(record):
    """States of the only robot of a record, shape (time, 2N+1)."""
    c, s = np.cos(record.heading.values[:, 0]), np.sin(record.heading.values[:, 0])
    vx, vy = record.velocity.values[:, 0].T
    front = np.stack([c * vx + s * vy, c * vy - s * vx, record.heading_rate.values[:, 0]], -1)
    return np.concatenate([front, record.joint_angle.values[:, 0], record.joint_rate.values[:, 0]], axis=1)
