"""Modules and feet are where the record and the gait have them."""

import math

import numpy as np
import pytest

from chilopod.errors import ParameterError
from chilopod.show.scene.frames import body_frames, scene
from helpers.walks import ROBOT, on_course, walk


def standing_through(frames, robot=0):
    """Whether each foot stands at both ends of a step of time."""
    return frames.stands[:-1, robot] & frames.stands[1:, robot] & (np.diff(frames.time)[:, None, None] < 0.1)


@pytest.mark.parametrize("times", [None, np.arange(0.0, 6.0, 0.0137)])
def test_standing_feet_of_a_straight_walk_do_not_move(times):
    frames = body_frames(walk(0.0), times)
    moved = np.diff(frames.feet[:, 0], axis=0)[standing_through(frames)]
    assert len(moved) > 1000
    np.testing.assert_allclose(moved, 0.0, atol=1e-12)


def test_feet_follow_the_gait():
    record = walk(0.0, duration=0.6, step=0.01)
    frames = body_frames(record)
    robot, stride = frames.robot, frames.robot.gait.stride
    local = frames.feet[:, 0] - frames.centres[:, 0, :, None]
    np.testing.assert_allclose(
        local[..., 1], np.broadcast_to(robot.legs.half_width * np.array([1, -1]), local[..., 1].shape), atol=1e-12
    )
    ahead = local[..., 0] - robot.legs.forward_offset
    assert frames.stands[0, 0, 0].tolist() == [True, True]  # phases 0 and 1/2, while a foot stands for 0.517
    np.testing.assert_allclose(ahead[0, 0], [0.5 * stride, stride * (0.5 - 0.3 / 0.31)], atol=1e-12)
    np.testing.assert_allclose(ahead[31, 0, 0], -0.5 * stride, atol=1e-9)
    assert np.abs(ahead).max() <= 0.5 * stride + 1e-12
    np.testing.assert_allclose(np.abs(np.diff(ahead, axis=0)).max(), 0.0, atol=0.06 * stride)  # no jumps
    np.testing.assert_allclose(frames.stands.mean(), robot.gait.duty, atol=0.02)


def test_modules_of_a_circling_robot_lie_on_the_circle():
    for curvature in (0.8, -0.8):
        frames = body_frames(walk(curvature))
        np.testing.assert_allclose(np.linalg.norm(frames.centres - [0.0, 1.0 / curvature], axis=-1), 1.25, atol=1e-12)
        joints = np.linalg.norm(frames.spine - [0.0, 1.0 / curvature], axis=-1)
        np.testing.assert_allclose(joints, math.hypot(1.25, 0.1125), atol=1e-12)
        # A robot that turns left has its front further left than its rear.
        assert (np.diff(frames.headings, axis=-1) * curvature < 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(np.diff(frames.spine, axis=-2), axis=-1), 0.225, atol=1e-12)
    np.testing.assert_allclose(0.5 * (frames.spine[..., :-1, :] + frames.spine[..., 1:, :]), frames.centres, atol=1e-12)


def test_mirrored_record_gives_mirrored_feet():
    record = walk(0.5, -0.3, leg_yaw=0.2)
    record["leg_yaw"][:, :, 1] = 0.35
    mirrored = record.copy()
    mirrored["position"] = record.position.copy(data=record.position * [1.0, -1.0])
    for name in ("heading", "joint_angle"):
        mirrored[name] = record[name].copy(data=-record[name])
    mirrored["leg_yaw"] = record.leg_yaw.copy(data=-record.leg_yaw.values[..., ::-1])
    # In the mirror the left legs step when the right ones did, half a period earlier.
    mirrored = mirrored.assign_coords(time=record.time + 0.3)
    here, there = body_frames(record), body_frames(mirrored)
    np.testing.assert_allclose(there.feet[..., ::-1, :] * [1.0, -1.0], here.feet, atol=1e-9)
    np.testing.assert_array_equal(there.stands[..., ::-1], here.stands)
    np.testing.assert_allclose(there.spine * [1.0, -1.0], here.spine, atol=1e-12)


def test_leg_yaw_turns_the_stroke_of_module_1_about_its_middle():
    straight, yawed = body_frames(walk(0.0)), body_frames(walk(0.0, leg_yaw=0.3))
    np.testing.assert_array_equal(yawed.feet[:, :, 1:], straight.feet[:, :, 1:])
    legs = straight.robot.legs
    feet = [[legs.forward_offset, side * legs.half_width] for side in (1, -1)]
    middle = straight.centres[:, :, 0, None] + np.array(feet)
    ahead = (straight.feet[:, :, 0] - middle)[..., 0]
    expected = ahead[..., None] * [math.cos(0.3), math.sin(0.3)]  # ahead is to the left of before
    np.testing.assert_allclose(yawed.feet[:, :, 0] - middle, expected, atol=1e-12)


def test_time_between_samples_is_interpolated():
    record = walk(0.4, duration=4.0, step=0.02)
    coarse = body_frames(record, np.arange(0.0, 3.99, 0.007))
    fine = body_frames(walk(0.4, duration=4.0, step=0.001), coarse.time)
    np.testing.assert_allclose(coarse.feet, fine.feet, atol=1e-6)
    np.testing.assert_array_equal(body_frames(record, record.time.values).feet, body_frames(record).feet)


def test_a_robot_that_stopped_stays_as_it_was():
    record = walk(0.0, 0.5, 0.0, stops=[(1, 2.01), (2, 0.0)])
    frames = body_frames(record)
    np.testing.assert_array_equal(frames.walks[:, 1], record.time.values < 2.01)
    last = np.flatnonzero(frames.walks[:, 1])[-1]
    for values in (frames.spine, frames.feet, frames.stands, frames.headings):
        np.testing.assert_array_equal(values[last:, 1], np.broadcast_to(values[last, 1], values[last:, 1].shape))
        assert np.isfinite(values[:, :2]).all()
    np.testing.assert_array_equal(frames.feet[:, 0], body_frames(walk(0.0)).feet[:, 0])
    assert np.isnan(frames.spine[:, 2]).all()
    assert not frames.walks[:, 2].any()
    assert not frames.stands[:, 2].any()
    # A time between the last sample with values and the first without has none.
    assert body_frames(record, [2.0, 2.005]).walks[:, 1].tolist() == [True, False]


def test_outcomes():
    record = walk(
        0.0, 0.5, 0.0, 0.0, stops=[(1, 2.01), (2, 0.0)], targets=[[0.5, 0.0], [3.0, 0.0], [3.0, 0.0], [9.0, 0.0]]
    )
    arrived, stopped, never, ended = scene(record, ["a", "b", "c", "d"]).outcomes
    assert (arrived.text, arrived.kind) == ("arrived at 3.6 s", "arrived")
    assert arrived.time == pytest.approx(0.35 / ROBOT.gait.speed, abs=1e-9)
    assert (stopped.text, stopped.kind, stopped.time) == ("diverged at 2.0 s", "stopped", 2.0)
    assert (never.text, never.kind, never.time) == ("diverged", "stopped", 0.0)
    assert (ended.text, ended.kind, ended.time) == ("target not reached", "ended", 6.0)
    (ended,) = scene(walk(0.0), ["a"]).outcomes
    assert (ended.text, ended.kind, ended.time) == ("walked", "ended", 6.0)


def test_targets_of_a_course_have_their_turns():
    nan = [np.nan, np.nan]
    record = on_course(
        walk(0.0, 0.0, stops=[(1, 4.0)]),
        [[[0.3, 0.0], [0.5, 0.0]], [[0.3, 0.0], nan]],
        [[[0.0, 3.0], [3.0, 5.0]], [[0.0, 4.0], nan]],
        [["arrived", "arrived"], ["given up", "not tried"]],
    )
    record["status"].values[1] = "halted"
    shown = scene(record, ["a", "b"])
    assert [aim.place for aim in shown.begun(0, 2.9)] == [(0.3, 0.0)]
    assert [aim.place for aim in shown.begun(0, 3.0)] == [(0.3, 0.0), (0.5, 0.0)]
    assert [aim.is_reached(3.0) for aim in shown.begun(0, 3.0)] == [True, False]
    assert [aim.reached for aim in shown.begun(1, 6.0)] == [None]
    told = [(each.text, each.kind, each.time) for each in shown.outcomes]
    assert told == [("all 2 targets by 5.0 s", "arrived", 5.0), ("0 of 2 targets", "ended", pytest.approx(3.98))]


def test_floor_holds_all_that_happens_and_nothing_absurd():
    shown = scene(walk(0.0, 0.5, targets=[[4.0, 1.0], [np.nan, np.nan]]), ["a", "b"])
    floor = shown.floor
    for points in (shown.frames.feet, shown.frames.spine, np.array([[4.15, 1.15]])):
        assert floor.x0 < points[..., 0].min()
        assert points[..., 0].max() < floor.x1
        assert floor.y0 < points[..., 1].min()
        assert points[..., 1].max() < floor.y1
    assert 0.79 < (floor.x1 - floor.x0) / (floor.y1 - floor.y0) < 2.41
    assert floor.grid == 1.0
    record = walk(0.0, 0.5, stops=[(1, 4.0)])
    record["position"][195:200, 1] = [[1.0, 1.0], [1e3, 7.0], [1e9, 1e9], [1e200, 0.0], [np.inf, 0.0]]
    assert scene(record, ["a", "b"]).floor.x1 < 3.0
    assert scene(walk(0.0, stops=[(0, 0.0)]), ["a"]).floor.x1 > 0.0


def test_titles_by_label_or_in_order():
    record = walk(0.0, 0.5).assign_coords(robot=["soft", "stiff"])
    assert scene(record, {"stiff": "B", "soft": "A"}).titles == ("A", "B")
    assert scene(record, ["A", "B"]).titles == ("A", "B")
    with pytest.raises(ParameterError, match="must name robot 'stiff' too"):
        scene(record, {"soft": "A"})
    with pytest.raises(ParameterError, match="allowed: 2"):
        scene(record, ["A"])


def test_record_must_go_with_its_robot():
    record = walk(0.0)
    with pytest.raises(ParameterError, match="has 4 joints"):
        body_frames(record.isel(joint=slice(4)))
    del record.attrs["robot"]
    with pytest.raises(ParameterError, match="has no robot"):
        body_frames(record)
