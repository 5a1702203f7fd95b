"""Springs of the twin that change while it walks: against plain MuJoCo, and in the energy balance."""

import mujoco
import numpy as np
import pytest

from chilopod import load_robot
from chilopod.engine import Actuators, Command
from chilopod.record import Recording, spring_work
from chilopod.twin import TwinModel, initial_states, start
from chilopod.twin.legs import servo_targets

N_MM_PER_DEG = 1e-3 * 180 / np.pi
FREE = load_robot("aoi2022").set_from_text(["springs.adjustable=true", "springs.lag=0.1 s"])
BENT = np.array([0.3, 0.1, -0.2, 0.15, -0.05])
BEGUN, RAMP, GOAL = 0.4, 0.3, 60.0 * N_MM_PER_DEG
TORQUE = np.array([0.3, 0.0, -0.2, 0.0, 0.1])


def wanted(robot):
    stiffness = np.array([robot.springs.stiffness])
    stiffness[:, 0] = GOAL
    return Command(stiffness=stiffness, within=RAMP, joint_torque=TORQUE)


def walked(robot, seconds, rate):
    walk = start(robot, initial=initial_states(robot, BENT), record=Recording(rate, poses=True))
    walk.advance(BEGUN)
    walk.command(wanted(robot))
    walk.advance(seconds)
    return walk.to_dataset()


def plain(robot, seconds):
    """The same walk by a loop over ``mj_step`` on a model without spring actuators, whose stiffness is set before
    every step; yields model and data before each of them, and the stiffness at its beginning and end."""
    plan = TwinModel(robot.with_value("springs.adjustable", False))
    model, data, actuators = plan.model, mujoco.MjData(plan.model), Actuators([robot])
    data.qpos[:] = initial_states(robot, BENT)[0]
    step = model.opt.timestep
    for i in range(round(seconds / step)):
        time = i * step
        if i == round(BEGUN / step):
            actuators.command(BEGUN, wanted(robot), np.ones(1, dtype=bool))
            data.qfrc_applied[plan.yaw_rates] = TORQUE
        ends = actuators.stiffness(time)[0], actuators.stiffness(time + step)[0]
        if actuators.driven.any():
            model.jnt_stiffness[plan.yaw_joints] = actuators.mean_stiffness(np.array([time, time + step]))[0, 0]
        if i % plan.steps_per_control == 0:
            data.ctrl[plan.leg_controls] = servo_targets(robot, np.array([time]))[0]
        yield plan, data, ends
        mujoco.mj_step(model, data)
    yield plan, data, None


def test_a_ramp_moves_the_robot_as_plain_mujoco_does_with_that_stiffness_in_its_joints():
    record = walked(FREE, 1.5, 500.0)
    *_, (plan, data, _) = plain(FREE, 1.5)
    np.testing.assert_allclose(record.pose.values[-1, 0], data.qpos, rtol=0, atol=1e-9)
    assert float(np.abs(record.joint_angle[-1, 0] - walked_straight_on(1.5)).max()) > 0.02
    assert record.stiffness.values[-1, 0, 0] == pytest.approx(GOAL, rel=1e-2)
    assert len(plan.spring_controls) == 0


def walked_straight_on(seconds):
    walk = start(FREE, initial=initial_states(FREE, BENT))
    walk.advance(seconds)
    return walk.observe().joint_angles[0]


def test_a_robot_that_could_but_is_not_told_to_walks_as_one_that_cannot():
    fixed = FREE.with_value("springs.adjustable", False)
    records = []
    for robot in (FREE, fixed):
        walk = start(robot, initial=initial_states(robot, BENT))
        walk.advance(1.0)
        records.append(walk.to_dataset().position.values)
    np.testing.assert_array_equal(*records)


def missing_energy(timestep):
    """What the powers do not account for in 0.9 s of walking, J, and the work on the springs."""
    robot = FREE.with_value("twin.timestep", timestep).with_value("springs.damping", 0.05)
    gained = work = stiffening = 0.0
    before = None
    for plan, data, ends in plain(robot, 0.9):
        model = plan.model
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        mujoco.mj_forward(model, data)
        stiffness = np.array(model.jnt_stiffness)
        model.jnt_stiffness[plan.yaw_joints] = (ends or (stiffness[plan.yaw_joints],))[0]
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        energy = float(data.energy.sum())
        model.jnt_stiffness[:] = stiffness
        gained += energy - before if before is not None else 0.0
        before = energy
        if ends is not None:
            forces = data.qfrc_actuator + data.qfrc_applied + data.qfrc_constraint + data.qfrc_damper
            work += timestep * float(forces @ data.qvel)
            angles = data.qpos[plan.yaw_positions]
            stiffening += float((0.5 * angles**2 * (ends[1] - ends[0])).sum())
    return gained - work - stiffening, stiffening


def test_energy_is_accounted_for_to_the_step():
    """Legs, floor, dampers, drives and the stiffening of bent springs: what is left goes with the step, to nothing."""
    missing, work = zip(*(missing_energy(step) for step in (1e-3, 5e-4, 2.5e-4)), strict=True)
    assert work[-1] > 5e-3
    for coarse, fine in zip(missing[:-1], missing[1:], strict=True):
        assert 0.45 < fine / coarse < 0.55
    assert abs(2.0 * missing[-1] - missing[-2]) < 0.02 * work[-1]


def test_the_record_gives_the_work_of_the_springs():
    record = walked(FREE, 0.9, 500.0)
    _, work = missing_energy(2e-3)
    robot = FREE.with_value("springs.damping", 0.05)
    assert float(spring_work(walked(robot, 0.9, 500.0))[0]) == pytest.approx(work, rel=0.02)
    assert record.attrs["robot"] == FREE.to_toml()
    assert "command_torque" in record


def test_the_record_has_the_springs_the_robots_really_had():
    robots = [FREE.with_value("springs.adjustable", False).with_value("springs.stiffness[0]", k) for k in (0.4, 0.9)]
    walk = start(robots)
    walk.advance(0.1)
    data = walk.to_dataset()
    np.testing.assert_array_equal(data.stiffness.values, [each.springs.stiffness for each in robots])
    assert data.attrs["robot"] == robots[0].to_toml()
