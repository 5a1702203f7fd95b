"""Springs that change while the robot walks, and joints that are driven: balances, and a second formulation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod import load_robot
from chilopod.compiled import njit
from chilopod.engine import Command
from chilopod.lanes import as_lanes
from chilopod.planar import PlanarModel, energy, initial_states, powers, start
from chilopod.planar.dynamics import BEHIND, DECAY, LEVEL, ORIGIN, SCRATCH, SLOPE, TORQUE
from chilopod.planar.energy import module_motion
from chilopod.planar.stretch import _slope
from chilopod.record import Recording, spring_work
from helpers.free_bodies import FreeBodies
from helpers.planar_strategies import energy_rate, mid_interval, robots, state_of
from helpers.walks import reduced

N_MM_PER_DEG = 1e-3 * 180 / np.pi
PRESET = load_robot("aoi2022-planar").override("springs.adjustable", True)
BENT = np.array([0.3, 0.1, -0.2, 0.15, -0.05])


@njit
def slope_as_walks_have_it(t, x, scalars, springs, damping, moments, scratch, out):
    """The slope of one robot, in numbers of one lane."""
    args = as_lanes(scalars, 1), as_lanes(springs, 1), as_lanes(damping, 1), as_lanes(moments, 1), as_lanes(scratch, 1)
    _slope(as_lanes(t, 1)[0], as_lanes(x, 1), args, as_lanes(out, 1))


@given(robots(), st.integers(0, 1000), st.floats(0.0, 0.999), st.floats(0.1, 0.9))
def test_power_balances_while_springs_change_and_joints_are_driven(robot, seed, fraction, inside):
    """To round-off, at one moment: what legs, floor, dampers, spring actuators and drives do is what energy gains."""
    model, rng = PlanarModel(robot), np.random.default_rng(seed)
    t, x, joints = mid_interval(model, fraction, inside), state_of(model, seed, bend=1.5), robot.body.modules - 1
    since, scale = rng.uniform(0.0, 0.3, joints), np.array(robot.springs.stiffness)
    springs = np.zeros((joints, 6))
    springs[:, DECAY], springs[:, BEHIND] = rng.uniform(0.0, 20.0, joints), 0.3 * scale * rng.uniform(-1, 1, joints)
    springs[:, LEVEL], springs[:, SLOPE] = scale, scale * rng.uniform(-1.0, 1.0, joints)
    springs[:, TORQUE] = scale * rng.uniform(-1.0, 1.0, joints)
    starts, _, interval = model._pieces(t, t + model.period)
    springs[:, ORIGIN] = starts[0] - since
    behind = springs[:, BEHIND] * np.exp(-springs[:, DECAY] * since)
    stiffness, rate = scale + springs[:, SLOPE] * since + behind, springs[:, SLOPE] - springs[:, DECAY] * behind
    slope = np.empty_like(x)
    args = (model.scalars[0], springs, model.damping, model.moments(interval[:1])[0], np.empty((joints + 1, SCRATCH)))
    given = starts[:1], x, *args
    slope_as_walks_have_it(*(np.array(each)[..., None] for each in given), slope[:, None])
    power = powers(model, x, t, rate, springs[:, TORQUE])
    gained = energy_rate(model, x, slope, stiffness) + 0.5 * (x[3 : joints + 3] ** 2 * rate).sum()
    _, twist = module_motion(model, x)
    size = sum(abs(each) for each in (power.legs, power.floor, power.dampers, power.springs, power.drives))
    size += robot.module_mass * np.abs(twist[:, :2]).sum() * np.abs(slope[:2]).max() * model.modules
    size += (np.abs(stiffness * x[3 : joints + 3] * slope[3 : joints + 3])).sum()
    assert abs(power.total - gained) <= 1e-11 * size


def walked(robot, within, torque=None, seconds=4.0, tolerance=1e-12, rate=100.0, goal=8.0):
    """A walk in which spring 1 goes to ``goal`` (N*mm/deg) at 1 s, and joints are driven from 2 s on."""
    walk = start(robot, initial=initial_states(robot, BENT), record=Recording(rate), tolerance=tolerance)
    walk.advance(1.0)
    stiffness = walk.observe().stiffness
    stiffness[:, 0] = goal * N_MM_PER_DEG
    walk.command(Command(stiffness=stiffness, within=within))
    if torque is not None:
        walk.advance(2.0)
        walk.command(Command(joint_torque=torque))
    walk.advance(seconds)
    return walk.to_dataset()


@pytest.mark.parametrize(
    ("changes", "within"),
    [
        ([], 0.7),
        ([], 0.0),
        (["springs.lag=0.15 s"], 0.5),
        (["springs.rate=40 N*mm/deg/s"], 0.1),
        (["springs.rate=40 N*mm/deg/s", "springs.lag=0.02 s", "springs.damping=0.02"], 0.0),
    ],
)
def test_a_ramp_agrees_with_free_bodies_whose_stiffness_is_integrated_too(changes, within):
    robot = PRESET.set_from_text(changes)
    torque = np.array([0.05, 0.0, -0.03, 0.0, 0.02])
    ours = walked(robot, within, torque)
    bodies, lag = FreeBodies(robot), (robot.springs.lag or [0.0])[0]
    before = np.array(robot.springs.stiffness)
    after = before.copy()
    after[0] = 8.0 * N_MM_PER_DEG
    length = max(within, abs(after[0] - before[0]) / (robot.springs.rate or [np.inf])[0])

    def reference(t, middle):
        if middle < 1.0:
            return before
        if middle >= 1.0 + length:
            return after
        return before + (t - 1.0) / length * (after - before)

    x = initial_states(robot, BENT)[0, :13]
    state, stiffness = bodies.from_reduced(x), before
    for t0, t1, drive in ((0.0, 2.0, 0.0 * torque), (2.0, 4.0, torque)):
        kinks = [1.0, 1.0 + length]
        state, stiffness = bodies.carry_driven(state, stiffness, t0, t1, reference, lag, drive, kinks)
        theirs, place = bodies.to_reduced(state)
        at = ours.sel(time=t1, method="nearest")
        np.testing.assert_allclose(at.joint_angle.values[0], theirs[3:8], rtol=0, atol=1e-9)
        np.testing.assert_allclose(at.position.values[0], place[:2], rtol=0, atol=1e-9)
        np.testing.assert_allclose(at.stiffness.values[0], stiffness, rtol=1e-9)


def test_a_step_is_the_limit_of_fast_ramps():
    step = walked(PRESET, 0.0).isel(time=-1)
    apart = [
        float(np.abs(walked(PRESET, within).isel(time=-1).joint_angle - step.joint_angle).max())
        for within in (1e-2, 1e-3, 1e-4, 1e-5)
    ]
    # In proportion to the time that the ramp takes, down to nothing.
    for slower, faster in zip(apart[:-1], apart[1:], strict=True):
        assert 0.08 * slower < faster < 0.12 * slower


def test_energy_is_accounted_for_along_a_walk():
    rate = 4000.0
    record = walked(PRESET.set_from_text(["springs.lag=0.1 s"]), 0.6, [0.05, 0, 0, 0, 0.02], 3.0, rate=rate, goal=60.0)
    model, states = PlanarModel(PRESET), reduced(record)
    stiffness = record.stiffness.values[:, 0]
    rates = np.gradient(stiffness, record.time.values, axis=0)
    torque = np.where(record.time.values[:, None] > 2.0, record.command_torque.values[-1, 0], 0.0)
    total = np.array(
        [
            powers(model, x, t, dk, drive).total
            for x, t, dk, drive in zip(states, record.time.values, rates, torque, strict=True)
        ]
    )
    gained = energy(model, states[-1], stiffness[-1]) - energy(model, states[0], stiffness[0])
    assert np.trapezoid(total, dx=1.0 / rate) == pytest.approx(gained, abs=2e-4 * np.abs(total).max())
    # At 1 s the spring starts to stiffen: that is work on a bent spring, and as much as the record says.
    by_rate = np.trapezoid(0.5 * (record.joint_angle.values[:, 0] ** 2 * rates).sum(1), dx=1.0 / rate)
    assert by_rate > 1e-3
    assert float(spring_work(record)[0]) == pytest.approx(by_rate, rel=1e-4)


def test_springs_that_stay_take_no_work():
    robot = load_robot("aoi2022-planar")
    walk = start(robot, initial=initial_states(robot, BENT))
    walk.advance(1.0)
    assert spring_work(walk.to_dataset()).values.tolist() == [0.0]


def test_softened_far_enough_a_straight_walk_bends_and_stiffened_again_it_straightens():
    robot = PRESET.override("springs.rate", "100 N*mm/deg/s")
    walk = start(robot, initial=initial_states(robot, 0.01), record=Recording(10.0))
    bends = []
    for stiffness in (8.0, 41.0):
        walk.command(Command(stiffness=[stiffness * N_MM_PER_DEG, *robot.springs.stiffness[1:]]))
        walk.advance(walk.time + 90.0)
        bends.append(float(np.abs(walk.observe().joint_angles).sum()))
    assert bends[0] > 2.0
    assert bends[1] < 1e-3
