"""The spring law: what it makes of one observation, and what it must not know."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.engine import Event, Observation
from chilopod.errors import ParameterError
from chilopod.steering import RadiusLaw, SpringLaw

LAW = RadiusLaw(np.array([0.3, 0.5, 0.6, 0.7]), np.array([0.25, 0.4, 0.8, np.inf]), "N*mm/deg")
ROBOT = load_robot("aoi2022-planar").override("springs.adjustable[0]", True)
SPRING = SpringLaw.of(ROBOT, LAW)
LEFT, RIGHT = Event("left", 0.7, 0.1), Event("right", 0.2, 0.1)


def seen(bearing=0.0, distance=1.0, bend=0.0, yaw=0.0) -> Observation:
    """One robot whose joints share a bend, rad, to the left."""
    return Observation(
        3.0,
        np.array([bearing]),
        np.array([distance]),
        np.full((1, 5), -bend / 5.0),
        np.full((1, 2), yaw),
        np.array([ROBOT.springs.stiffness]),
    )


def spring(**what) -> float:
    """That is commanded with the left leg."""
    return float(np.asarray(SPRING.act(LEFT, seen(**what)).stiffness)[0, 0])


def wanted(bearing: float, distance: float) -> float:
    """The bend of a circle by pure pursuit, rad."""
    return 2.0 * np.sin(bearing) / min(distance, 2.0 * ROBOT.module_length) * 5.0 * ROBOT.module_length


def test_goes_from_the_tightest_of_the_law_to_the_stiffest_of_the_axis():
    assert (SPRING.softest, SPRING.stiffest) == (0.3, max(ROBOT.springs.stiffness))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_is_soft_until_the_bend_is_there_then_steady_then_stiff(side):
    bend = wanted(0.3, 1.0)
    steady = LAW.value(5.0 * ROBOT.module_length / bend)
    for part, expected in ((0.0, 0.3), (0.5, 0.3), (1.0, steady), (1.5, SPRING.stiffest), (-0.2, SPRING.stiffest)):
        # The table is straight between the points of the law, and the law is not.
        assert spring(bearing=0.3 * side, bend=part * bend * side) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(
    "what",
    [{"bearing": 0.01}, {"bearing": 1.2, "bend": 7.0}, {"bearing": 1.5, "distance": 0.2, "bend": 2.0}],
    ids=["the target is ahead", "a joint is bent too far", "the tightest circle leads round the target"],
)
def test_straightens(what):
    assert spring(**what) == SPRING.stiffest


def test_looks_for_what_it_does_not_see_to_the_side_it_steered_to_last():
    lost = {"bearing": np.nan, "distance": np.nan}
    for yaw, side in ((0.05, 1.0), (-0.05, -1.0), (0.0, 1.0)):
        assert spring(**lost, yaw=yaw, bend=0.5 * side) == SPRING.softest
        assert spring(**lost, yaw=yaw, bend=-0.5 * side) == SPRING.stiffest
        assert np.sign(np.asarray(SPRING.act(LEFT, seen(**lost, yaw=yaw)).leg_yaw)[0, 0]) == side


def test_mirrored_robots_do_the_same():
    random = np.random.default_rng(0)
    for _ in range(50):
        bearing, distance, bend = random.uniform([-3.0, 0.1, -3.0], [3.0, 3.0, 3.0])
        assert spring(bearing=bearing, distance=distance, bend=bend) == spring(
            bearing=-bearing, distance=distance, bend=-bend
        )


def test_the_spring_is_commanded_once_a_cycle_and_what_a_robot_is_told_hangs_on_it_alone():
    assert SPRING.act(RIGHT, seen(0.4)).stiffness is None
    alone = [seen(0.4), seen(np.nan, np.nan), seen(-1.0, 0.3, bend=1.0)]
    rows = [np.concatenate([getattr(each, name) for each in alone]) for name in vars(alone[0]) if name != "time"]
    together = SPRING.act(LEFT, Observation(3.0, *rows))
    for row, each in enumerate(alone):
        told = SPRING.act(LEFT, each)
        np.testing.assert_array_equal(np.asarray(together.stiffness)[row], np.asarray(told.stiffness)[0])
        np.testing.assert_array_equal(np.asarray(together.leg_yaw)[row], np.asarray(told.leg_yaw)[0])


def test_what_the_actuator_keeps_from_it_is_said():
    assert SPRING.remarks(LAW) == []
    soft = SpringLaw.of(ROBOT.override("springs.softest", 0.55), LAW)
    (said,) = soft.remarks(LAW)
    assert "circles of 0.5" in said
    assert soft.tightest == pytest.approx(LAW.radius(0.55))
    (said,) = SpringLaw.of(ROBOT.override("springs.softest", 0.75), LAW).remarks(LAW)
    assert "does not bend the straight walk" in said
    (said,) = SpringLaw.of(ROBOT.override("springs.stiffest", 0.65), LAW).remarks(LAW)
    assert "does not keep the walk straight" in said
    with pytest.raises(ParameterError, match="a range to steer"):
        SpringLaw.of(ROBOT.override("springs.softest", 3.0), LAW)


def test_a_robot_that_has_stopped_is_no_trouble():
    gone = replace(seen(), bearing=np.array([np.nan]), joint_angles=np.full((1, 5), np.nan))
    with np.errstate(all="raise"):
        SPRING.act(LEFT, gone)
