"""Return maps of robots that differ in everything, against the same maps one by one."""

import numpy as np
import pytest

from chilopod.planar import PlanarModel
from chilopod.planar.many import return_maps, shape
from chilopod.robot import load_robot

ROBOT = load_robot("aoi2022-planar")


def varied(modules, side_phase, seed):
    """A robot with all numbers that the model reads changed by up to 60 %."""
    rng = np.random.default_rng(seed)
    robot = ROBOT.with_value("body.modules", modules).with_value("gait.side_phase", side_phase)
    robot = robot.with_value("springs.stiffness", 2.3).with_value("springs.damping", rng.choice([0.0, 0.02]))
    for path in ("body.length", "body.mass"):
        robot = robot.with_value(path, robot.get(path) * modules / 6.0)
    names = ("body.length", "body.mass", "springs.stiffness[0]", "legs.forward_offset", "legs.half_width")
    for path in (*names, "gait.stride", "gait.stance", "gait.swing", "ground.friction", "body.yaw_inertia"):
        robot = robot.with_value(path, robot.get(path) * rng.uniform(0.6, 1.6))
    return robot


@pytest.mark.parametrize(("modules", "side_phase"), [(2, np.pi), (6, np.pi), (6, 2.0), (12, np.pi)])
def test_each_is_that_of_its_model(modules, side_phase):
    robots = [varied(modules, side_phase, seed) for seed in range(8)]
    groups = {}
    for robot in robots:
        groups.setdefault(shape(robot), []).append(robot)
    for (_, half, _), own in groups.items():
        assert half is (side_phase == np.pi)
        for robot, found, error in zip(own, *return_maps(own), strict=True):
            model = PlanarModel(robot)
            _, matrix, bound = model.flow_with_error(model.orbit, 0.0, robot.gait.period / (2 if half else 1))
            exact = model.reflection @ matrix if half else matrix
            # Both have round-off; the model assembles its equations in extended precision.
            assert np.abs(found - exact).max() < 0.1 * (error + bound)
            assert error < 1e-10 * np.abs(exact).max()


def test_motion_that_is_too_fast_is_left_out():
    stiff = ROBOT.with_value("springs.stiffness", 1e9)
    maps, errors = return_maps([ROBOT, stiff])
    assert np.isnan(errors).tolist() == [False, True]
    assert np.isfinite(maps[0]).all()
