"""The leg-yaw controller, as the paper's appendix has it."""

import math

import numpy as np
import pytest

from chilopod.engine import Observation, event_times
from chilopod.errors import ParameterError
from chilopod.planar import simulate
from chilopod.robot import load_robot
from chilopod.steering import LegYawController

ROBOT = load_robot("aoi2022-planar")
GAIT = ROBOT.gait
STEP = math.radians(5.0)


def desired(bearing, t, lift_offs, before=0.0):
    """The appendix, equation by equation, for one leg: desired yaw at time t, given when its swings start."""
    start, end, yaw = 0.4 * GAIT.swing, 0.8 * GAIT.swing, before
    for lift_off in lift_offs:
        error = bearing(lift_off + start) - yaw
        change = error if abs(error) < STEP else math.copysign(STEP, error)
        change = min(max(yaw + change, -STEP), STEP) - yaw  # 5 degrees in all
        if t < lift_off + start:
            return yaw
        if t <= lift_off + end:
            return yaw + change * (t - lift_off - start) / (end - start)
        yaw += change
    return yaw


def lift_offs(side, count):
    """Start of the swings: the left leg of module 1 touches down at 0, the right one half a period later."""
    first = (GAIT.stance + side * 0.5 * GAIT.period) % GAIT.period
    return [first + i * GAIT.period for i in range(count)]


def seen(bearing, yaw=(0.0, 0.0)):
    bearing = np.atleast_1d(np.asarray(bearing, float))
    yaw = np.broadcast_to(np.asarray(yaw, float), (len(bearing), 2))
    return Observation(
        0.0, bearing, np.ones_like(bearing), np.zeros((len(bearing), 5)), yaw, np.ones((len(bearing), 5))
    )


def test_each_leg_is_asked_in_its_own_swing():
    controller = LegYawController()
    asked = event_times(controller, GAIT, 3.0)
    for side, name in enumerate(("left", "right")):
        times = [t for t, event in asked if event.name == name]
        expected = [t + 0.4 * GAIT.swing for t in lift_offs(side, len(times))]
        assert times == pytest.approx(expected, abs=1e-12)
    for _, event in asked:
        assert event.window == pytest.approx(0.4 * GAIT.swing)  # to 80 % of the swing


@pytest.mark.parametrize(
    ("bearing", "yaw", "expected"),
    [
        (2.0, 0.0, 2.0),
        (30.0, 0.0, 5.0),
        (-30.0, 0.0, -5.0),  # "5 degrees otherwise" has the sign of the error
        (-30.0, 5.0, 0.0),  # five degrees a cycle
        (-1.0, 5.0, 0.0),
        (0.5, 5.0, 0.5),
        (30.0, 3.0, 5.0),  # five degrees in all
    ],
)
def test_what_one_swing_does(bearing, yaw, expected):
    controller = LegYawController()
    for side, event in enumerate(controller.events(GAIT)):
        command = controller.act(event, seen(math.radians(bearing), np.deg2rad([yaw, yaw])))
        assert np.rad2deg(command.leg_yaw[0, side]) == pytest.approx(expected, abs=1e-12)
        assert np.rad2deg(command.leg_yaw[0, 1 - side]) == pytest.approx(yaw, abs=1e-12)  # the other leg


def test_an_unseen_target_changes_nothing_and_observations_are_left_alone():
    controller = LegYawController()
    given = seen([math.nan, 0.01], [0.02, 0.03])
    before = given.leg_yaw.copy()
    command = controller.act(controller.events(GAIT)[0], given)
    assert command.leg_yaw[0].tolist() == [0.02, 0.03]
    assert (given.leg_yaw == before).all()


def test_a_walk_has_the_yaw_of_the_appendix():
    record = simulate(ROBOT, 9.0, controller=LegYawController(), target=(0.6, 0.1), rate=200.0)
    time, bearing = record.time.values, np.unwrap(record.bearing.values[:, 0])
    assert np.ptp(bearing) > math.pi / 2  # the target is passed
    for side in range(2):
        starts = lift_offs(side, 16)
        expected = [desired(lambda t: np.interp(t, time, bearing), t, starts) for t in time]
        assert record.leg_yaw.values[:, 0, side] == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("wrong", [{"step": -0.1}, {"limit": 2.0}, {"start": 0.9}, {"end": 1.1}, {"step": math.nan}])
def test_wrong_settings(wrong):
    with pytest.raises(ParameterError):
        LegYawController(**wrong)
