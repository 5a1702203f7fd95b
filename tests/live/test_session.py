"""The walk behind the live page, without a page."""

import math
import threading

import numpy as np
import pytest

from chilopod.analysis.parameters import stiffness
from chilopod.engine import Status
from chilopod.errors import ParameterError
from chilopod.live import Session, wishes
from chilopod.live.sliders import STRIDES
from chilopod.robot import load_robot
from chilopod.show import replay

PLANAR = load_robot("aoi2022-planar")
SOFT = wishes.Spring(0, stiffness(8.0))


def session(*asked, seed=1, **told):
    begun = Session(PLANAR, seed=seed, **told)
    wish(begun, *asked)
    return begun


def wish(walking, *asked):
    for each in asked:
        walking.box.put(each)
        walking.obey()


def test_a_wish_wakes_who_waits_for_one():
    box = wishes.Box()
    assert not box.wait(0.0)
    box.put(SOFT)
    assert box.wait(3600.0)
    assert box.take() == [SOFT]
    assert not box.wait(0.0)
    box.wake()
    assert box.wait(3600.0)
    assert box.take() == []


def test_nudges_leave_a_stiff_walk_straight_and_a_soft_one_settles_on_the_branch(law):
    walking = session()
    walking.walk_on(30.0)
    assert walking.seen().bend < 0.15
    wish(walking, SOFT)
    walking.walk_on(50.0)
    radius = 5 * PLANAR.module_length / walking.seen().bend
    assert radius == pytest.approx(law.radius(stiffness(8.0)), rel=0.08)


@pytest.mark.parametrize("frame", [1.0 / 30.0, 0.37, 7.0])
def test_the_walk_is_the_same_however_it_is_cut_into_frames(frame):
    whole, cut = session(SOFT), session(SOFT)
    whole.walk_on(14.0)
    for _ in range(int(14.0 / frame)):
        cut.walk_on(frame)
    cut.walk_on(14.0 - cut.seen().time)
    one, other = whole.seen(), cut.seen()
    # The ends of frames differ by round-off, and so does where the last one ends.
    np.testing.assert_allclose(one.joint_angles, other.joint_angles, atol=1e-9)
    np.testing.assert_array_equal(one.mean_angles, other.mean_angles)


def test_seeds():
    angles = []
    for seed in (1, 1, 2):
        walking = session(seed=seed)
        walking.walk_on(3.0)
        angles.append(walking.seen().joint_angles)
    np.testing.assert_array_equal(angles[0], angles[1])
    assert (angles[0] != angles[2]).all()
    again = session(seed=2)
    again.walk_on(5.0)
    wish(again, wishes.Reset(1))
    again.walk_on(3.0)
    np.testing.assert_array_equal(again.seen().joint_angles, angles[0])


def test_floor_and_steps_change_at_the_next_gait_cycle_and_nothing_jumps():
    walking, period = session(), PLANAR.gait.period
    walking.walk_on(2.5 * period)
    wish(walking, wishes.Set("friction", 1.5), wishes.Set("gait.stride", 0.02))
    before = walking.seen()
    assert before.robot.gait.stride == PLANAR.gait.stride
    walking.walk_on(0.49 * period)
    walking.walk_on(0.02 * period)
    after = walking.seen()
    assert after.robot.gait.stride == 0.02
    assert after.robot.ground.friction == pytest.approx(1.5 * PLANAR.ground.friction)
    assert after.time == pytest.approx(before.time + 0.51 * period)
    assert np.abs(after.pose - before.pose).max() < 0.05
    walking.walk_on(5.0)
    speed = np.hypot(*(walking.seen().pose - after.pose)[:2]) / 5.0
    assert speed == pytest.approx(0.02 / PLANAR.gait.stance, rel=0.02)


def test_goes_to_a_target_with_each_strategy_and_is_as_it_was_set_afterwards(law):
    walking = session()
    walking.law = law
    walking.walk_on(1.0)
    for strategy in ("variable", "leg-yaw", "actuated"):
        x, y, heading = walking.seen().pose
        ahead = (float(x + 0.8 * math.cos(heading + 0.3)), float(y + 0.8 * math.sin(heading + 0.3)))
        wish(walking, wishes.Steering(strategy), wishes.Target(ahead))
        walking.walk_on(0.5)
        assert walking.seen().target == ahead
        walking.walk_on(25.0)
        assert walking.seen().target is None, strategy
        assert any("arrived" in sentence for sentence in walking.messages())
        np.testing.assert_allclose(walking.seen().stiffness, PLANAR.springs.stiffness)
        np.testing.assert_allclose(walking.seen().leg_yaw, 0.0, atol=1e-12)


def test_without_a_radius_law_legs_steer_alone_and_that_is_said():
    walking = session(wishes.Target((1.0, 0.3)))
    assert "leg yaw alone" in walking.messages()[0]
    walking.walk_on(5.0)
    np.testing.assert_array_equal(walking.seen().stiffness, PLANAR.springs.stiffness)
    assert (walking.seen().leg_yaw != 0.0).any()


def test_a_pull_bends_a_joint_while_it_lasts():
    walking = session()
    walking.walk_on(3.0)
    wish(walking, wishes.Pull(1, 0.5 * PLANAR.springs.stiffness[1]))
    walking.walk_on(1.5)
    assert walking.seen().mean_angles[1] > 0.2
    wish(walking, wishes.Pull(1, 0.0))
    walking.walk_on(12.0)
    assert abs(walking.seen().mean_angles[1]) < 0.05
    wish(walking, wishes.Pull(1, 0.5 * PLANAR.springs.stiffness[1], 0.6))
    walking.walk_on(1.0)
    assert walking.seen().mean_angles[1] > 0.05
    walking.walk_on(12.0)
    assert abs(walking.seen().mean_angles[1]) < 0.05


def test_a_recording_is_of_one_floor_and_can_be_played():
    walking = session()
    walking.walk_on(1.0)
    wish(walking, wishes.Record(True))
    walking.walk_on(4.0)
    wish(walking, wishes.Set("gait.stride", 0.025))
    walking.walk_on(3.0)
    wish(walking, wishes.Record(False))
    walking.walk_on(2.0)
    first, second = walking.records()
    assert not walking.records()
    assert not walking.settings.recording
    assert "stride = 0.025" in second.attrs["robot"].replace('"', "") or "2.5 cm" in second.attrs["robot"]
    gap = second.position.values[0] - first.position.values[-1]
    assert np.abs(gap).max() < 0.02
    assert "<html" in replay(second, titles=["it"], heading="recorded").html


def test_a_recording_begun_again_at_once_is_another():
    walking = session(wishes.Record(True))
    walking.walk_on(1.3)
    wish(walking, wishes.Record(False), wishes.Record(True))
    walking.walk_on(1.3)
    walking.stop_recording()
    one, other = walking.records()
    assert one.time.values[-1] > 0.5
    assert other.time.values[-1] < 1.0


def test_a_robot_that_fails_stays_until_it_begins_anew():
    walking = session(wishes.Spring(0, stiffness(2.1)))
    walking.walk_on(60.0)
    assert walking.seen().status is Status.OUT_OF_RANGE
    time = walking.seen().time
    walking.walk_on(5.0)
    assert walking.seen().time == time
    stiff = wishes.Spring(0, stiffness(41.0))
    wish(walking, wishes.Target((1.0, 1.0)), wishes.Set("friction", 1.1), stiff, wishes.Reset(3))
    walking.walk_on(5.0)
    assert walking.seen().status is Status.WALKED
    assert walking.settings.friction == 1.1


@pytest.mark.parametrize(
    ("asked", "part"),
    [
        (wishes.Spring(0, float("nan")), "stiffness[0] = nan: must be a finite number"),
        (wishes.Spring(None, -1.0), "springs.stiffness"),
        (wishes.Spring(0, stiffness(99.0)), "springs.stiffness[0] = "),
        (wishes.Spring(17, stiffness(9.0)), "must be a slider"),
        (wishes.Set("frictoin", 1.0), "did you mean 'friction'"),
        (wishes.Set("friction", float("inf")), "friction = inf"),
        (wishes.Set("friction", 7.0), "0.3 to 3"),
        (wishes.Set("gait.stride", 0.0), f"{STRIDES[0] * PLANAR.gait.stride:g} to"),
        (wishes.Set("speed", "fast"), "speed = 'fast'"),
        (wishes.Reset(-3), "whole number"),
        (wishes.Reset(1.5), "whole number"),
        (wishes.Reset(float("inf")), "seed = inf"),
        (wishes.Target((float("nan"), 0.0)), "target = nan"),
        (wishes.Target((1e9, 0.0)), "target"),
        (wishes.Steering("varible"), "did you mean 'variable'"),
        (wishes.Pull(0, float("nan")), "pull = nan"),
        (wishes.Pull(17, 0.1), "joint = 18"),
        (wishes.Pull("1", 0.1), "joint = '1'"),
        (wishes.Pull(0, 0.1, "long"), "time = 'long'"),
        (wishes.Target((1.0, 2.0, 3.0)), "(x, y), m"),
        (wishes.Step(1e9), "0 to 10 gait cycles"),
    ],
)
def test_what_cannot_be_is_said_in_a_line_and_changes_nothing(asked, part):
    walking = session()
    before = walking.settings
    wish(walking, asked)
    (said,) = walking.messages()
    assert part in said
    assert "\n" not in said
    assert walking.settings == before
    walking.walk_on(1.0)
    assert walking.seen().status is Status.WALKED


@pytest.mark.parametrize("seconds", [float("nan"), float("inf"), -1.0, 2e5, "1 s", None, True])
def test_walks_on_for_a_time_only(seconds):
    walking = session()
    walking.walk_on(0.3)
    with pytest.raises(ParameterError, match="seconds"):
        walking.walk_on(seconds)
    assert walking.seen().time == 0.3


def test_a_walk_of_more_than_a_day_goes_on(monkeypatch):
    """The engines walk no more than 1e5 s at a time."""
    monkeypatch.setattr("chilopod.live.session.LONGEST", 2.0)
    walking = session()
    walking.walk_on(1.5)
    walking.walk_on(1.5)
    assert walking.seen().time == pytest.approx(3.0)
    assert walking.seen().clock < 1.9


def test_a_slider_is_one_row_of_a_table():
    begun = session()
    before = begun.settings
    for name, row in begun.sliders.items():
        low, high = row.limits
        assert low <= row.read(before) <= high
        assert row.from_page(row.at_page(high)) == pytest.approx(high, rel=1e-8)
        wish(begun, wishes.Set(name, 0.5 * (low + high)))
        assert row.read(begun.settings) == pytest.approx(0.5 * (low + high))
    assert not begun.messages()
    begun.walk_on(1.5)
    assert begun.seen().status is Status.WALKED


def test_a_flood_of_wishes_takes_no_room_and_the_last_counts():
    walking = session()

    def flood():
        for value in np.linspace(5.0, 60.0, 2000):
            walking.box.put(wishes.Spring(0, stiffness(value)))

    threads = [threading.Thread(target=flood) for _ in range(4)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert len(walking.box.take()) == 1


def test_refuses_what_it_cannot_walk():
    with pytest.raises(ParameterError, match="twin"):
        Session(PLANAR, "twin")
    with pytest.raises(ParameterError, match="leg-yaw"):
        Session(PLANAR, strategy="leg-jaw")


@pytest.mark.parametrize("modules", [7, 30])
def test_other_numbers_of_modules(modules):
    robot = PLANAR.override("body.length", 0.225 * modules).override("body.mass", 1.4 * modules)
    walking = Session(robot.with_value("body.modules", modules))
    walking.walk_on(2.0)
    assert walking.seen().status is Status.WALKED
    assert walking.seen().mean_angles.shape == (modules - 1,)
