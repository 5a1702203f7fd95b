"""Robots at random, of a kind that walks."""

from __future__ import annotations

from random import Random

from chilopod.robot import Robot, load_robot


def some_robot(chance: Random, preset: str = "aoi2022-planar") -> Robot:
    """A preset with other springs and, in the plane, other masses, legs and floors."""
    robot = load_robot(preset)
    joints = robot.body.modules - 1
    values = {f"springs.stiffness[{joint}]": spread(chance, 2.0, 10.0) for joint in range(joints)}
    if preset == "aoi2022-planar":
        robot = robot.with_value("body.modules", chance.choice((2, 3, 4, 6, 6, 7)))
        joints = robot.body.modules - 1
        values = {f"springs.stiffness[{joint}]": spread(chance, 2.0, 10.0) for joint in range(joints)}
        values |= {
            "body.mass": spread(chance, 8.5, 3.0),
            "body.length": spread(chance, 1.35, 2.0),
            "springs.damping": spread(chance, 0.03, 10.0) if chance.random() < 0.5 else 0.0,
            "legs.forward_offset": chance.uniform(-0.05, 0.05),
            "legs.half_width": spread(chance, 0.07, 2.0),
            "gait.stride": spread(chance, 0.03, 2.0),
            "gait.stance": spread(chance, 0.31, 1.5),
            "ground.friction": spread(chance, 246.5, 5.0),
        }
    for path, value in values.items():
        robot = robot.with_value(path, value)
    return robot


def spread(chance: Random, about: float, factor: float) -> float:
    """A number between a factor below and a factor above another."""
    return float(about * factor ** chance.uniform(-1.0, 1.0))
