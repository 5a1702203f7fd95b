"""Targets that move while robots walk: where they are seen, and what of it stands in the record."""

import numpy as np
import pytest

from chilopod import load_robot, planar, twin
from chilopod.engine import Targets
from chilopod.errors import ParameterError

PLANAR, TWIN = load_robot("aoi2022-planar"), load_robot("aoi2022")
BOTH = pytest.mark.parametrize(("engine", "robot"), [(planar, PLANAR), (twin, TWIN)], ids=["planar", "twin"])
NOWHERE = [np.nan, np.nan]


def test_a_target_at_the_very_moment_of_a_move_is_where_it_was():
    targets = Targets(2, np.array([[1.0, 0.0], [2.0, 0.0]]))
    targets.move(0.5, [[3.0, 0.0], NOWHERE])
    targets.move(0.5, [[4.0, 0.0], NOWHERE])
    found = targets.over(np.array([0.0, 0.5, 0.51]))[..., 0]
    np.testing.assert_array_equal(found, [[1.0, 2.0], [1.0, 2.0], [4.0, np.nan]])
    assert targets.there.tolist() == [True, False]


def test_a_target_that_is_told_where_it_is_has_not_moved():
    never, still = Targets(1), Targets(1, np.array([[1.0, 0.5]]))
    never.move(0.2, NOWHERE)
    still.move(0.2, [1.0, 0.5])
    assert never.recorded(np.zeros(3)) is None
    assert still.recorded(np.zeros(3)).shape == (1, 2)


@BOTH
def test_a_target_that_is_told_at_time_0_is_there_from_the_start(engine, robot):
    began, told = engine.start(robot, target=(0.4, 0.3)), engine.start(robot)
    told.aim((0.4, 0.3))
    for walk in (began, told):
        walk.advance(0.2)
    assert told.to_dataset().equals(began.to_dataset())


@pytest.mark.parametrize(
    "wrong", [None, "there", 1.0, [1.0], [[1.0, 0.0]], [1.0, np.inf], [1.0, np.nan], [1e200, 0.0], [[[1, 2]]]]
)
def test_what_is_no_place_is_refused_and_changes_nothing(wrong):
    targets = Targets(2)
    with pytest.raises(ParameterError) as caught:
        targets.move(0.0, wrong)
    assert caught.value.field == "target"
    assert "\n" not in str(caught.value)
    assert targets.recorded(np.zeros(1)) is None


@BOTH
def test_a_walk_that_was_aimed_sees_what_one_sees_that_began_so(engine, robot):
    first, second = (1.0, 0.6), (0.7, -0.5)
    began, late, moved = engine.start(robot, target=second), engine.start(robot), engine.start(robot, target=first)
    for walk in (began, late, moved):
        walk.advance(0.333)
        walk.observe()
    late.aim(second)
    moved.aim(second)
    for until in (0.333, 0.5):
        for walk in (began, late, moved):
            walk.advance(until)
            assert walk.observe().bearing == began.observe().bearing
            assert walk.observe().distance == began.observe().distance
    moved.aim(NOWHERE)
    assert np.isnan(moved.observe().bearing).all()
    assert engine.resume(late.save()).observe().bearing == late.observe().bearing


def test_seen_bearings_are_those_of_every_event_though_the_target_came_late():
    from chilopod.engine import Command

    walk = twin.start(TWIN)
    walk.command(Command(leg_yaw=[0.0, 0.0]))
    walk.advance(0.2)
    walk.aim((1.0, 0.4))
    walk.command(Command(leg_yaw=[0.0, 0.0]))
    seen = walk.to_dataset().seen_bearing.values[:, 0]
    assert np.isnan(seen[0])
    assert seen[1] == walk.observe().bearing[0]
