"""Leg kinematics: the two joints put the tip where the path wants it, and paths that cannot be reached are refused."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod import load_robot
from chilopod.errors import ParameterError
from chilopod.twin.legs import check_reach, joint_angles, servo_targets, tip_path
from helpers.leg_tips import tip_place

PRESET = load_robot("aoi2022")
PERIOD = PRESET.gait.period


@given(
    st.floats(5e-3, 0.5),
    st.floats(5e-3, 0.5),
    st.lists(st.tuples(st.floats(1e-3, 1.0 - 1e-3), st.floats(-np.pi, np.pi)), min_size=1, max_size=20),
)
def test_forward_undoes_inverse_kinematics(upper, lower, places):
    twin = PRESET.twin.model_copy(update={"upper_link": upper, "lower_link": lower})
    part, direction = np.array(places).T
    # Anywhere between the shortest and the longest reach.
    distance = abs(upper - lower) + part * (upper + lower - abs(upper - lower))
    place = np.stack([distance * np.sin(direction), distance * np.cos(direction)], axis=-1)
    angles = joint_angles(twin, place[:, 0], place[:, 1])
    np.testing.assert_allclose(tip_place(twin, angles), place, rtol=0, atol=1e-12)
    assert (angles[:, 1] <= 0.0).all()  # knees point ahead


def test_the_tip_stands_at_constant_speed_and_swings_on_half_an_ellipse():
    gait, clearance = PRESET.gait, PRESET.twin.clearance
    stance = tip_path(PRESET, np.linspace(0.0, gait.duty, 1000, endpoint=False))
    assert (stance[:, 1] == 0.0).all()
    speed = np.diff(stance[:, 0]) / (gait.stance / 1000)
    np.testing.assert_allclose(speed, -gait.speed, rtol=1e-9)
    swing = tip_path(PRESET, np.linspace(gait.duty, 1.0, 1000))
    radius = np.hypot(swing[:-1, 0] / (0.5 * gait.stride), swing[:-1, 1] / clearance)
    np.testing.assert_allclose(radius, 1.0, rtol=0, atol=1e-12)
    assert swing[:, 1].max() == pytest.approx(clearance, rel=1e-5)
    assert (np.diff(swing[:-1, 0]) > 0.0).all()


@given(st.floats(-1e3, 1e3), st.floats(0.05, 2.0), st.floats(0.05, 2.0))
def test_the_path_is_closed_and_has_no_jumps(phase, stance, swing):
    robot = PRESET.set_from_text([f"gait.stance={stance!r} s", f"gait.swing={swing!r} s"])
    around = tip_path(robot, phase + np.linspace(0.0, 1.0, 20001))
    np.testing.assert_allclose(around[0], around[-1], rtol=0, atol=1e-9)
    # The longest way in a step of the phase is that of the faster half.
    farthest = np.pi * robot.gait.stride / min(robot.gait.duty, 1.0 - robot.gait.duty) / 20000
    assert np.abs(np.diff(around, axis=0)).max() < 1.01 * farthest


def test_targets_put_every_tip_on_its_path_in_its_phase():
    times = np.linspace(0.0, 2.0 * PERIOD, 97)
    twin, robot = PRESET.twin, PRESET.with_value("body.modules", 4)
    targets = servo_targets(robot, times)
    assert targets.shape == (97, 4, 2, 2)
    place = tip_place(twin, targets)
    for module in range(4):
        for side in range(2):
            phase = times / PERIOD + module * 120.0 / 360.0 + side * 0.5
            tip = tip_path(robot, phase)
            np.testing.assert_allclose(place[:, module, side, 0], tip[:, 0], rtol=0, atol=1e-12)
            np.testing.assert_allclose(twin.hip_height - place[:, module, side, 1], tip[:, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(servo_targets(robot, times + PERIOD), targets, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    "override",
    [
        "twin.hip_height=119.5 mm",  # in the middle yes, at the ends of the stride no
        "twin.hip_height=10 m",
        "twin.lower_link=1 mm",
        "twin.upper_link=400 mm",  # folded as far as it goes, the leg is still too long
        "gait.stride=20 cm",
    ],
)
def test_legs_that_cannot_reach_are_refused(override):
    robot = PRESET.set_from_text([override])
    with pytest.raises(ParameterError, match="cannot reach") as caught:
        check_reach(robot)
    assert caught.value.field == "twin.hip_height"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "heights"),
    [
        (
            ["gait.stride=15 cm"],
            "'98 mm'.* 150 mm: .*allowed: 6.28 to 93.67 mm with these links, or a shorter gait.stride",
        ),
        (["twin.upper_link=400 mm"], "'98 mm'.*allowed: 346.28 to 459.75 mm with"),
        (["gait.stride=40 cm"], "'98 mm'.* 400 mm: .*allowed: other links, or a shorter gait.stride"),
        (["twin.lower_link=1 mm"], "allowed: other links"),
    ],
)
def test_the_height_that_was_given_and_heights_from_which_legs_reach_are_named(changes, heights):
    robot = PRESET.set_from_text(changes)
    with pytest.raises(ParameterError, match=heights):
        check_reach(robot)
    for end in re.findall(r"([\d.]+) (?:to|mm with)", heights):
        check_reach(robot.with_value("twin.hip_height", 1e-3 * float(end)))


def test_a_robot_without_a_twin_is_named():
    with pytest.raises(ParameterError, match="aoi2022") as caught:
        servo_targets(load_robot("aoi2022-planar"), [0.0])
    assert caught.value.field == "twin"
