"""Walks of the twin: against MuJoCo's own loop, Newton's laws, moves and mirror images of the world, and bad input."""

import os

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from chilopod import load_robot
from chilopod.engine import Command, Event
from chilopod.errors import ParameterError
from chilopod.record import Recording
from chilopod.steering import LegYawController
from chilopod.twin import TwinModel, initial_states, simulate, start
from chilopod.twin.legs import servo_targets

PRESET = load_robot("aoi2022")
SOFT = PRESET.set_from_text(["springs.stiffness[0]=15 N*mm/deg"])
BENT = np.array([0.3, 0.1, -0.2, 0.15, -0.05])
GRAVITY = 9.81


class Sideways:
    """Turns both legs of module 1 at once in the middle of the left one's swing, by a part of what the target asks."""

    def events(self, gait):
        return [Event("both", gait.duty + 0.3 * (1.0 - gait.duty), 0.1)]

    def act(self, event, seen):
        wanted = np.where(np.isnan(seen.bearing), 0.0, np.clip(0.3 * seen.bearing, -0.1, 0.1))
        return Command(leg_yaw=np.repeat(wanted[:, None], 2, axis=1), within=event.window)


def looped(robot, start, control, friction=1.0, target=None):
    """States after every step of a plain loop over mj_step."""
    compiled = TwinModel(robot)
    model, data = compiled.model, mujoco.MjData(compiled.model)
    model.geom_friction[compiled.feet, 0] *= friction
    data.qpos[:] = start
    if target is not None:
        data.mocap_pos[0] = [*target, 0.0]
    states = np.empty((len(control), model.nq + model.nv))
    for row, inputs in zip(states, control, strict=True):
        data.ctrl[:] = inputs
        mujoco.mj_step(model, data)
        row[:] = np.concatenate([data.qpos, data.qvel])
    return states


def leg_controls(robot, ticks):
    compiled = TwinModel(robot)
    control = np.zeros((ticks, compiled.model.nu))
    control[:, compiled.leg_controls] = servo_targets(robot, np.arange(ticks) * robot.twin.control_interval)
    return control


@pytest.mark.parametrize("override", ["twin.timestep=2 ms", "twin.timestep=0.5 ms"])
def test_a_straight_walk_is_mujocos_own_to_the_bit(override):
    robot = SOFT.set_from_text([override])
    start = initial_states(robot, BENT, 0.4, (1.0, 2.0))[0]
    friction = np.random.default_rng(0).uniform(0.8, 1.2, (6, 2))
    record = simulate(robot, 1.3, initial=start, friction=friction, poses=True, rate=250.0, threads=1)
    per_tick = round(0.002 / robot.twin.timestep)
    states = looped(robot, start, np.repeat(leg_controls(robot, 650), per_tick, axis=0), friction)
    np.testing.assert_array_equal(record.pose.values[0, 0], start)
    np.testing.assert_array_equal(record.pose.values[1:, 0], states[2 * per_tick - 1 :: 2 * per_tick, :38])
    rates = states[2 * per_tick - 1 :: 2 * per_tick, 38:]
    np.testing.assert_array_equal(record.velocity.values[1:, 0], rates[:, :2])
    np.testing.assert_array_equal(record.joint_rate.values[1:, 0], rates[:, TwinModel(robot).yaw_rates])
    np.testing.assert_allclose(record.time, np.arange(326) / 250.0, rtol=0, atol=1e-12)


def test_a_steered_batch_is_mujocos_loop_with_the_same_controls_to_the_bit(monkeypatch):
    robots = [
        SOFT.with_value("springs.stiffness[0]", k).with_value("springs.damping", c)
        for k, c in [(1.0, 0.05), (2.0, 0.1)]
    ]
    targets, start = np.array([[1.0, 1.0], [1.5, -0.5]]), initial_states(SOFT, [BENT, -BENT])
    given, rollout = [], Batch.rollout

    def listening(self, nstep, control, **keywords):
        given.append(np.array(control))
        return rollout(self, nstep, control, **keywords)

    monkeypatch.setattr(Batch, "rollout", listening)
    record = simulate(
        robots, 3.0, initial=start, controller=Sideways(), target=targets, seeds=[1, 2], poses=True, rate=500.0
    )
    control = np.concatenate(given, axis=1)
    assert control.shape == (2, 1500, 26)
    compiled = TwinModel(SOFT)
    for i, robot in enumerate(robots):
        states = looped(robot, start[i], control[i], target=targets[i])
        np.testing.assert_array_equal(record.pose.values[1:, i], states[:, :38])
        # The legs' own targets are those of the gait, and leg yaw goes from command to command in straight lines.
        plain = leg_controls(robot, 1500)
        legs = compiled.leg_controls.ravel()
        np.testing.assert_array_equal(control[i][:, legs], plain[:, legs])
        begin = np.ceil(record.event.values / 0.002 - 1e-9) * 0.002
        asked = np.concatenate([[0.0], record.command.values[:, i, 0]])
        knots, angles = np.stack([begin, begin + 0.1], -1), np.stack([asked[:-1], asked[1:]], -1)
        expected = np.interp(np.arange(1500) * 0.002, knots.ravel(), angles.ravel())
        for side in range(2):
            yaw = control[i][:, compiled.leg_yaw_controls[side]]
            np.testing.assert_allclose(yaw, expected, rtol=0, atol=1e-12)


def test_neither_company_nor_threads_change_a_bit():
    robots = [SOFT.with_value("springs.stiffness[0]", k) for k in np.linspace(0.4, 3.0, 4)]
    common = {"initial": initial_states(SOFT, BENT), "controller": LegYawController(), "target": (1.0, 1.0)}
    one = simulate(robots, 2.0, **common, seeds=[0, 1, 2, 3], threads=1)
    two = simulate(robots, 2.0, **common, seeds=[0, 1, 2, 3], threads=2)
    assert one.equals(two)
    for i in (0, 3):
        alone = simulate(robots[i], 2.0, **common, seeds=[i], threads=1)
        for name in ("position", "joint_angle", "leg_yaw", "command", "seen_distance"):
            np.testing.assert_array_equal(alone[name].isel(robot=0).values, one[name].isel(robot=i).values)


def test_leg_yaw_reaches_what_was_commanded():
    quick = PRESET.with_value("twin.servo_damping", 0.02 * PRESET.twin.servo_stiffness)  # the preset's lag behind
    record = simulate(quick, 3.0, controller=Sideways(), target=(1.0, 2.0), rate=500.0)
    assert record.event.values == pytest.approx((0.31 + 0.3 * 0.29) + 0.6 * np.arange(5))
    assert float(record.command[0].max()) > 0.05
    for event, when in enumerate(record.event.values):
        # The left leg is in the air; the right one drags its foot, which is what it takes to bend a soft servo.
        reached = record.leg_yaw.sel(time=when + 0.1 + 0.05, method="nearest")[0]
        assert float(abs(reached[0] - record.command[event, 0, 0])) < np.radians(0.5)
        assert float(abs(reached[1] - record.command[event, 0, 1])) < np.radians(2.0)


def test_events_of_both_legs_at_the_same_time_are_both_answered():
    robot = PRESET.set_from_text(["gait.side_phase=0"])
    record = simulate(robot, 2.0, controller=LegYawController(), target=(1.0, 2.0))
    assert record.sizes["event"] == 6
    np.testing.assert_allclose(np.degrees(record.command[1:, 0]), 5.0)
    assert float(record.leg_yaw[-1].min()) > np.radians(4.0)


def test_the_floor_carries_the_weight():
    record = simulate(SOFT, 6.6, initial=initial_states(SOFT, BENT), forces=True, rate=500.0)
    cycles = record.foot_load.sel(time=slice(0.601, 6.6)).sum(("module", "side"))
    assert float(cycles.mean()) == pytest.approx(SOFT.body.mass * GRAVITY, rel=5e-3)
    # Feet push and do not pull, within the cone of friction.
    sideways = np.hypot(*np.moveaxis(record.foot_force.values, -1, 0))
    assert float(record.foot_load.min()) >= 0.0
    assert (sideways <= SOFT.twin.sliding_friction * record.foot_load.values + 1e-9).all()
    assert np.isfinite(record.foot_load).all()  # at time 0 too
    # Of a straight walk every foot carries its part.
    assert float(record.foot_load.mean(("time", "robot")).min()) > 0.3 * SOFT.body.mass * GRAVITY / 12


@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.2), (0.0, 1.0), (0.2, 0.8)])
def test_forces_of_the_feet_move_the_centre_of_mass(begin, end):
    """Over any time, the mean force is mass times the mean acceleration."""
    record = simulate(SOFT, 1.0, initial=initial_states(SOFT, BENT), forces=True, poses=True, rate=500.0)
    model = TwinModel(SOFT).model
    data, centre = mujoco.MjData(model), []
    for pose in record.pose.values[:, 0]:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        centre.append(data.subtree_com[0, :2].copy())
    velocity = np.concatenate([np.zeros((1, 2)), np.diff(centre, axis=0) * 500.0])
    first, last = round(begin * 500), round(end * 500)
    impulse = record.foot_force.values[:, 0].sum((1, 2))[first + 1 : last + 1].sum(0) / 500.0
    # A difference of places is the velocity half a step before the state's.
    half = 0.5 * np.abs(np.diff(velocity, axis=0)).max() * SOFT.body.mass
    change = SOFT.body.mass * (velocity[last] - velocity[first])
    assert np.abs(impulse - change).max() < half
    assert np.abs(change).max() > 10.0 * half


def test_moving_the_world_moves_the_walk():
    turn, shift, target = 2.1, np.array([3.0, -7.0]), np.array([1.0, 0.8])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    start, moved = initial_states(SOFT, BENT, 0.2), initial_states(SOFT, BENT, 0.2 + turn, shift)
    here = simulate(SOFT, 3.0, initial=start, controller=Sideways(), target=target)
    there = simulate(SOFT, 3.0, initial=moved, controller=Sideways(), target=rotation @ target + shift)
    np.testing.assert_allclose(there.position.values, here.position.values @ rotation.T + shift, rtol=0, atol=1e-9)
    np.testing.assert_allclose(there.joint_angle.values, here.joint_angle.values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(there.distance.values, here.distance.values, rtol=0, atol=1e-9)


def test_with_left_and_right_in_phase_the_mirror_image_walks_the_mirror_image():
    robot = SOFT.set_from_text(["gait.side_phase=0"])
    arguments = {"controller": Sideways(), "rate": 50.0}
    left = simulate(robot, 3.0, initial=initial_states(robot, BENT), target=(1.0, 0.5), **arguments)
    right = simulate(robot, 3.0, initial=initial_states(robot, -BENT), target=(1.0, -0.5), **arguments)
    np.testing.assert_allclose(right.joint_angle.values, -left.joint_angle.values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(right.heading.values, -left.heading.values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(right.position.values, left.position.values * [1.0, -1.0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(right.leg_yaw.values, -left.leg_yaw.values[..., ::-1], rtol=0, atol=1e-9)


def test_friction_factors_scale_the_feet():
    doubled = SOFT.with_value("twin.sliding_friction", 2.0 * SOFT.twin.sliding_friction)
    start = initial_states(SOFT, BENT)
    a = simulate(doubled, 1.0, initial=start)
    b = simulate(SOFT, 1.0, initial=start, friction=np.full((6, 2), 2.0))
    np.testing.assert_array_equal(a.position.values, b.position.values)
    assert not np.array_equal(a.position.values, simulate(SOFT, 1.0, initial=start).position.values)


def test_a_walk_that_fails_ends_with_a_status_and_the_others_go_on(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    limp = PRESET.with_value("springs.stiffness[0]", 1e-4)
    straight = initial_states(PRESET)[0]
    wild, tipped = straight.copy(), straight.copy()
    wild[2], tipped[2], tipped[3:5] = 1e200, 0.3, [np.cos(0.6), np.sin(0.6)]
    start = np.stack([initial_states(PRESET, 0.3)[0], wild, tipped, straight])
    record = simulate([limp, PRESET, PRESET, PRESET], 9.0, initial=start, rate=50.0, forces=True, poses=True)
    assert record.status.values.tolist() == ["out of range", "diverged", "fallen", "walked"]
    finite = np.isfinite(record.joint_angle.values).all(2)
    assert finite[0].all()
    assert finite.sum(0).tolist()[3] == 451
    assert 100 < finite[:, 0].sum() < 451
    assert (np.diff(finite.astype(int), axis=0) <= 0).all()
    for name in ("position", "velocity", "heading", "joint_rate", "leg_yaw", "pose", "foot_load", "foot_force"):
        values = np.isfinite(record[name].values).reshape(451, 4, -1)
        np.testing.assert_array_equal(values.all(2), finite, err_msg=name)
        np.testing.assert_array_equal(values.any(2), finite, err_msg=name)
    assert float(np.abs(record.joint_angle[:, 0]).max()) <= np.pi / 2
    alone = simulate(PRESET, 9.0, rate=50.0)
    np.testing.assert_array_equal(alone.position.values[:, 0], record.position.values[:, 3])
    # And it says so in the record, not on the terminal nor in a log file.
    assert os.listdir(tmp_path) == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "overrides",
    [
        ["twin.servo_stiffness=1e4"],  # with 2 ms: more than the step follows
        ["twin.servo_stiffness=1e4", "twin.servo_damping=1e-6", "twin.joint_inertia=0"],
        ["twin.control_interval=20 ms", "twin.timestep=20 ms", "twin.servo_stiffness=1e3"],
        ["twin.control_interval=20 ms", "twin.timestep=20 ms"],
        ["twin.servo_stiffness=1e-6", "twin.servo_damping=1e-6"],
        ["twin.servo_damping=1e3"],
        ["springs.stiffness=1e6"],
        ["twin.link_mass=1e-9 kg", "twin.joint_inertia=0"],
    ],
)
def test_extreme_robots_walk_or_say_that_they_do_not(overrides):
    robot = PRESET.set_from_text(overrides)
    record = simulate(robot, 1.0, controller=Sideways(), target=(1.0, 1.0), forces=True)
    finite = np.isfinite(record.position.values).all((1, 2))
    assert finite[0]
    assert bool(finite.all()) == (record.status.item() == "walked")
    assert (np.diff(finite.astype(int)) <= 0).all()
    assert float(np.nanmax(np.abs(record.joint_rate))) < 100.0
    assert record.sizes["event"] >= 1


def test_samples_between_steps_are_those_of_the_nearest_step():
    often = simulate(SOFT, 0.1, initial=initial_states(SOFT, BENT), rate=2000.0)
    seldom = simulate(SOFT, 0.1, initial=initial_states(SOFT, BENT), rate=500.0)
    assert np.isfinite(often.position).all()
    np.testing.assert_array_equal(often.position[::4].values, seldom.position.values)


def test_progress_goes_from_nothing_to_everything():
    parts = []
    simulate(PRESET, 1.5, progress=lambda part, words: parts.append(part))
    assert parts == sorted(parts)
    assert parts[-1] == 1.0
    assert len(parts) >= 3


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"robots": [PRESET, PRESET.set_from_text(["gait.stride=2 cm"])]}, "robots"),
        ({"robots": [PRESET, PRESET.set_from_text(["twin.servo_stiffness=8"])]}, "robots"),
        ({"robots": [PRESET, load_robot("aoi2022-planar")]}, "twin"),
        ({"robots": load_robot("aoi2022-planar")}, "twin"),
        ({"robots": PRESET.set_from_text(["twin.hip_height=13 cm"])}, "twin.hip_height"),
        ({"initial": np.zeros((0, 38))}, "initial"),
        ({"initial": np.full(38, np.nan)}, "initial"),
        ({"initial": np.zeros((3, 38)), "target": np.zeros((2, 2))}, "target"),
        ({"robots": [PRESET, PRESET], "seeds": [1, 2, 3]}, "robots"),
        ({"friction": np.ones((5, 2))}, "friction"),
    ],
)
def test_bad_arguments_are_named(arguments, field):
    with pytest.raises(ParameterError) as caught:
        simulate(**{"robots": PRESET, "duration": 1.0, "controller": Sideways(), "target": (1.0, 0.0), **arguments})
    assert caught.value.field == field


def test_more_steps_between_two_servo_targets_than_can_be_kept_are_refused():
    with pytest.raises(ParameterError, match="must be shorter: no memory for") as caught:
        simulate(PRESET.set_from_text(["twin.control_interval=1e9 s"]), 1.0)
    assert caught.value.field == "twin.control_interval"


def test_a_record_with_forces_begins_with_one_sample():
    """The forces at time 0 are those of the first step, which is still to come."""
    data = start(PRESET, record=Recording(10.0, forces=True)).to_dataset()
    assert data.sizes["time"] == 1
    assert np.isnan(data.foot_force.values).all()
    assert np.isnan(data.foot_load.values).all()
