"""Walks of many robots: against the flow, against Newton's laws foot by foot, and under moves of the world."""

import numba
import numpy as np
import pytest

from chilopod import load_robot
from chilopod.engine import Command, Event, Status
from chilopod.errors import ParameterError
from chilopod.planar import PlanarModel, initial_states, simulate, start
from chilopod.planar.energy import module_motion
from chilopod.record import Recording
from helpers.walks import reduced

PRESET = load_robot("aoi2022-planar")
SOFT = PRESET.set_from_text(["springs.stiffness[0]=10 N*mm/deg"])
BENT = np.array([0.3, 0.1, -0.2, 0.15, -0.05])


class Sideways:
    """Turns both legs of module 1 in the middle of the swing of each, by as much as the target asks."""

    def __init__(self, gain=0.3):
        self.gain = gain

    def events(self, gait):
        at = gait.duty + 0.5 * (1.0 - gait.duty)
        return [Event(str(side), float((at - phase) % 1.0), 0.05) for side, phase in enumerate(gait.leg_phases(1)[0])]

    def act(self, event, seen):
        yaw = seen.leg_yaw.copy()
        yaw[:, int(event.name)] = self.gain * seen.bearing
        return Command(leg_yaw=yaw, within=event.window)


def test_samples_are_states_of_the_flow():
    record = simulate(SOFT, 7.3, initial=initial_states(SOFT, BENT), tolerance=1e-12)
    model = PlanarModel(SOFT)
    x, now = initial_states(SOFT, BENT)[:, :13], 0.0
    for t in (0.01, 0.31, 0.6, 5.0, 7.3):
        x, now = model.flow_states(x, now, t), t
        at = record.sel(time=t, method="nearest")
        np.testing.assert_allclose(at.joint_angle.values[0], x[0, 3:8], rtol=0, atol=1e-10)
        np.testing.assert_allclose(at.joint_rate.values[0], x[0, 8:], rtol=0, atol=1e-9)
        heading = float(at.heading.values[0])
        turned = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        np.testing.assert_allclose(at.velocity.values[0], turned @ x[0, :2], rtol=0, atol=1e-9)
    assert record.status.values[0] == Status.WALKED.label
    assert record.sizes["time"] == 731


@pytest.mark.parametrize("seed", [0, 1])
def test_the_default_step_is_good_to_a_micrometre_over_a_minute(seed):
    rng = np.random.default_rng(seed)
    robots = [SOFT.with_value("springs.stiffness[0]", k) for k in rng.uniform(0.38, 3.0, 4)]
    robots += [SOFT.with_value("springs.stiffness", k) for k in rng.uniform(0.2, 0.6, 2)]  # these undulate
    start = initial_states(SOFT, 0.05 * rng.normal(size=(6, 5)))
    usual = simulate(robots, 60.0, initial=start, rate=1.0)
    finer = simulate(robots, 60.0, initial=start, rate=1.0, tolerance=1e-12)
    assert (usual.status == "walked").all()
    assert float(np.abs(usual.position - finer.position).max()) < 1e-6
    # Sampling makes steps end at the samples, and changes nothing else.
    often = simulate(robots, 60.0, initial=start, rate=100.0).isel(time=slice(None, None, 100))
    assert float(np.abs(usual.position - often.position.values).max()) < 1e-6


@pytest.mark.parametrize(("when", "within"), [(0.05, 0.4), (0.4, 0.5)])
def test_recorded_yaw_is_that_of_the_feet_that_stand(when, within):
    """Force on a foot at rest on its yawed line, by hand: of a leg that stands at the command, and one that swings."""
    walk = start(SOFT, record=Recording(rate=100.0, forces=True))
    walk.advance(when)
    walk.command(Command(leg_yaw=[[0.3, 0.3]], within=within))
    walk.advance(0.75)
    record, gait, legs = walk.to_dataset().isel(robot=0), SOFT.gait, SOFT.legs
    stands = gait.stands(gait.phases(record.time.values, 1)[:, 0])
    after = (record.time.values > when + 1e-9)[:, None] & stands
    assert (record.leg_yaw.values[after] == 0.3).all()
    for i, side in np.argwhere(stands):
        heading, turn = float(record.heading[i]), float(record.heading_rate[i])
        yaw, stroke = record.leg_yaw.values[i, side], gait.stroke(gait.phases(record.time.values[i], 1)[0, side])
        along = np.array([np.cos(yaw), np.sin(yaw)])
        c, s = np.cos(heading), np.sin(heading)
        ahead, left = np.array([c, s]), np.array([-s, c])
        foot = np.array([legs.forward_offset, (1, -1)[side] * legs.half_width]) + stroke * along
        x, y = foot[0] * ahead + foot[1] * left
        back = gait.speed * (along[0] * ahead + along[1] * left)
        slip = record.velocity.values[i] + turn * np.array([-y, x]) - back
        np.testing.assert_allclose(record.foot_force.values[i, 0, side], -SOFT.ground.friction * slip, atol=1e-9)
    swings = (record.time.values > when)[:, None] & ~stands
    assert (record.leg_yaw.values[swings] >= 0.0).all()
    assert (np.diff(record.leg_yaw.values, axis=0) >= 0.0).all()


def test_forces_of_yawed_feet_move_the_robot_as_newton_and_euler_say():
    """The dynamics know feet by their moments only; here every foot's force acts where the foot is."""
    rate = 4000.0
    record = simulate(
        SOFT, 3.0, initial=initial_states(SOFT, BENT, 0.4), controller=Sideways(), target=(2.0, -3.0), rate=rate,
        tolerance=1e-11, forces=True,
    )  # fmt: skip
    assert float(np.abs(record.leg_yaw).max()) > 0.3
    model, n = PlanarModel(SOFT), 6
    mass, inertia = SOFT.module_mass, SOFT.module_yaw_inertia
    states = np.concatenate([reduced(record), record.position.values[:, 0], record.heading.values[:, :1]], axis=1)
    linear, angular, force, moment = [], [], [], []
    for i, state in enumerate(states):
        heading, twist = module_motion(model, state[:13])
        c, s = np.cos(state[15]), np.sin(state[15])
        turn = np.array([[c, -s], [s, c]])
        ahead = np.stack([np.cos(heading), np.sin(heading)], -1) @ turn.T
        left = np.stack([-ahead[:, 1], ahead[:, 0]], -1)
        half = 0.5 * SOFT.module_length
        centre = state[13:15] - np.concatenate([np.zeros((1, 2)), np.cumsum(half * (ahead[:-1] + ahead[1:]), axis=0)])
        velocity = twist[:, :2] @ turn.T
        linear.append(mass * velocity.sum(0))
        angular.append((mass * _cross(centre, velocity) + inertia * twist[:, 2]).sum())
        phase = (record.time.values[i] / SOFT.gait.period + SOFT.gait.leg_phases(n)) % 1.0
        stroke = SOFT.gait.stride * (0.5 - phase / SOFT.gait.duty)
        yaw = np.zeros((n, 2))
        yaw[0] = record.leg_yaw.values[i, 0]
        x = SOFT.legs.forward_offset + stroke * np.cos(yaw)
        y = SOFT.legs.half_width * np.array([1.0, -1.0]) + stroke * np.sin(yaw)
        foot = centre[:, None] + x[..., None] * ahead[:, None] + y[..., None] * left[:, None]
        pushed = record.foot_force.values[i, 0]
        force.append(pushed.sum((0, 1)))
        moment.append(_cross(foot, pushed).sum())
    # Central differences, where no foot switched in between.
    switches = np.concatenate([cycle * 0.6 + model.schedule.times[:-1] for cycle in range(6)])
    t = record.time.values[1:-1]
    smooth = np.abs(t[:, None] - switches).min(1) > 2.0 / rate
    for momentum, cause in ((np.array(linear), np.array(force)), (np.array(angular), np.array(moment))):
        change = (momentum[2:] - momentum[:-2]) * rate / 2.0
        # The difference formula errs by the third derivative, largest in the milliseconds after a switch.
        error = np.abs(change - cause[1:-1])[smooth]
        assert error.max() < 0.03 * np.abs(cause).max()
        assert np.median(error) < 1e-5 * np.abs(cause).max()


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def test_yawed_legs_steer_to_their_side():
    straight = simulate(PRESET, 10.0, rate=1.0)
    for sign in (1.0, -1.0):
        turned = simulate(PRESET, 10.0, controller=Sideways(0.1), target=(5.0, sign * 5.0), rate=1.0)
        assert sign * float(turned.heading[-1, 0]) > 0.05
    assert float(np.abs(straight.heading).max()) == 0.0


def test_neither_company_nor_threads_change_a_bit():
    robots = [SOFT.with_value("springs.stiffness[0]", k) for k in np.linspace(0.4, 3.0, 7)]
    start = initial_states(SOFT, BENT)
    arguments = {"controller": Sideways(), "target": (1.0, 1.0), "rate": 10.0}
    together = simulate(robots, 6.0, initial=start, **arguments)
    for i in (0, 3, 6):
        alone = simulate(robots[i], 6.0, initial=start, **arguments)
        np.testing.assert_array_equal(alone.position.values[:, 0], together.position.values[:, i])
    if numba.config.NUMBA_NUM_THREADS > 1:
        before = numba.get_num_threads()
        try:
            numba.set_num_threads(1)
            one = simulate(robots, 6.0, initial=start, **arguments)
        finally:
            numba.set_num_threads(before)
        assert one.equals(together)


@pytest.mark.parametrize("modules", [2, 3, 20, 30])
def test_robots_abreast_walk_as_each_alone_and_as_the_flow_though_one_fails(modules):
    robot = PRESET.with_value("body.modules", modules)
    rng = np.random.default_rng(modules)
    count = 19  # two groups, both with more robots than lanes, of which some stay empty in the end
    robots = [robot.with_value("springs.stiffness[0]", k) for k in rng.uniform(0.3, 30.0, count)]
    start = initial_states(robot, 0.05 * rng.normal(size=(count, modules - 1)), rng.uniform(-3.0, 3.0, count))
    start[4, 2] = 1e200
    together = simulate(robots, 0.7, initial=start, rate=10.0, tolerance=1e-10)
    assert together.status.values.tolist() == ["walked"] * 4 + ["diverged"] + ["walked"] * (count - 5)
    for i in (0, 4, 11, count - 1):
        alone = simulate(robots[i], 0.7, initial=start[i], rate=10.0, tolerance=1e-10)
        for name in ("position", "heading", "joint_angle", "joint_rate"):
            np.testing.assert_array_equal(alone[name].values[:, 0], together[name].values[:, i])
    for i in (0, count - 1):
        x = PlanarModel(robots[i]).flow_states(start[i : i + 1, : 2 * modules + 1], 0.0, 0.7)[0]
        np.testing.assert_allclose(together.joint_angle.values[-1, i], x[3 : modules + 2], rtol=0, atol=1e-8)
        np.testing.assert_allclose(together.joint_rate.values[-1, i], x[modules + 2 :], rtol=0, atol=1e-7)


def test_a_walk_that_fails_ends_with_a_status_and_the_others_go_on():
    soft = PRESET.with_value("springs.stiffness[0]", 0.02)
    wild = initial_states(PRESET)[0]
    wild[2] = 1e200
    start = np.stack([initial_states(PRESET, 0.05)[0], wild, initial_states(PRESET)[0]])
    record = simulate([soft, PRESET, PRESET], 60.0, initial=start, rate=10.0)
    assert record.status.values.tolist() == ["out of range", "diverged", "walked"]
    assert float(record.position[-1, 2, 0]) == pytest.approx(60.0 * PRESET.gait.speed)
    for robot in (0, 1):
        known = np.isfinite(record.heading.values[:, robot])
        assert known[0]
        assert not known[-1]
        assert (np.diff(known.astype(int)) <= 0).all()
    assert float(np.abs(record.joint_angle[:, 0]).max()) <= np.pi / 2


def test_commands_come_back_as_ramps():
    record = simulate(PRESET, 3.0, controller=Sideways(0.1), target=(0.5, 4.0), rate=1000.0)
    assert record.event.values == pytest.approx(
        np.sort(np.concatenate([0.455 + 0.6 * np.arange(5), 0.155 + 0.6 * np.arange(5)]))
    )
    for e, when in enumerate(record.event.values[:-1]):
        side = int(np.abs(record.command[e, 0].values - (record.command[e - 1, 0].values if e else 0.0)).argmax())
        before = record.command.values[e - 1, 0, side] if e else 0.0
        half = float(record.leg_yaw.sel(time=when + 0.025, method="nearest")[0, side])
        assert half == pytest.approx(0.5 * (before + record.command.values[e, 0, side]), abs=1e-9)
        done = float(record.leg_yaw.sel(time=when + 0.05, method="nearest")[0, side])
        assert done == pytest.approx(record.command.values[e, 0, side], abs=1e-12)


def test_noise_on_the_bearing_reaches_the_controller_only():
    noise = np.array([[0.1, -0.2, 0.3, 0.0, 0.05, 0.4]])
    exact = simulate(PRESET, 1.8, controller=Sideways(1.0), target=(1.0, 0.5), bearing_noise=0 * noise)
    noisy = simulate(PRESET, 1.8, controller=Sideways(1.0), target=(1.0, 0.5), bearing_noise=noise)
    assert float((noisy.command - exact.command)[0, 0].max()) == pytest.approx(0.1)
    same = exact.time < 0.3  # until the leg that was turned in the air touches down
    np.testing.assert_array_equal(noisy.bearing.values[same], exact.bearing.values[same])


def test_friction_factors_scale_the_feet():
    doubled = SOFT.with_value("ground.friction", 2.0 * SOFT.ground.friction)
    start = initial_states(SOFT, BENT)
    a = simulate(doubled, 5.0, initial=start, rate=10.0)
    b = simulate(SOFT, 5.0, initial=start, rate=10.0, friction=np.full((6, 2), 2.0))
    np.testing.assert_allclose(a.position.values, b.position.values, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"tolerance": 1.0}, "tolerance"),
        ({"robots": [PRESET, PRESET.set_from_text(["gait.stride=2 cm"])]}, "robots"),
        ({"initial": np.zeros((0, 16))}, "initial"),
        ({"initial": np.full(16, np.nan)}, "initial"),
        ({"initial": np.zeros((3, 16)), "target": np.zeros((2, 2))}, "target"),
        ({"controller": Sideways(), "bearing_noise": np.zeros((1, 2))}, "bearing_noise"),
    ],
)
def test_bad_arguments_are_named(arguments, field):
    with pytest.raises(ParameterError) as caught:
        simulate(**{"robots": PRESET, "duration": 5.0, **arguments})
    assert caught.value.field == field
