"""What actuators make of commands: closed forms against integrated equations, limits, logs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from chilopod import load_robot
from chilopod.engine import Actuators, Command, Ramps
from chilopod.errors import ParameterError

PRESET = load_robot("aoi2022-planar")
FREE = PRESET.override("springs.adjustable", True)
START = PRESET.springs.stiffness[0]
WALKING = np.ones(1, dtype=bool)


def told(actuators, time, first, within=0.0):
    """Command another stiffness of spring 1."""
    stiffness = actuators.stiffness(time)
    stiffness[:, 0] = first
    # The others are told what they were told before, not what they have by now.
    stiffness[:, 1:] = START
    actuators.command(time, Command(stiffness=stiffness, within=within), WALKING)


@given(
    st.lists(st.tuples(st.floats(0.01, 1.0), st.floats(0.2, 5.0), st.floats(0.0, 1.0)), min_size=1, max_size=4),
    st.floats(0.01, 0.5) | st.just(0.0),
    st.floats(0.5, 20.0) | st.none(),
)
def test_stiffness_is_what_the_equations_of_ramp_and_lag_give(commands, lag, rate):
    robot = FREE.override("springs.lag", lag).override("springs.softest", 0.5).override("springs.stiffest", 4.0)
    if rate is not None:
        robot = robot.override("springs.rate", rate)
    actuators, time, k, goal_before, kink = Actuators([robot]), 0.0, START, START, 0.0

    def reference(t):
        return START

    for lasts, goal, within in commands:
        told(actuators, time, goal, within)
        wanted, u = float(np.clip(goal, 0.5, 4.0)), reference(time)
        length = max(within, abs(wanted - u) / rate if rate else 0.0)
        length = length if length >= 1e-9 else 0.0  # a jump, and no interval for a quadrature
        if wanted != goal_before or time + length < kink:  # else it goes on as it was
            kink, goal_before = time + length, wanted

            def reference(t, begun=time, u=u, wanted=wanted, length=length):
                return wanted if t - begun >= length else u + (wanted - u) * (t - begun) / length

        end = time + lasts
        edges = [time, *([kink] if time < kink < end else []), end]
        if lag > 0.0:
            for a, b in zip(edges[:-1], edges[1:], strict=True):
                ode = solve_ivp(
                    lambda t, y, r=reference: (r(t) - y) / lag, (a, b), [k], rtol=1e-11, atol=1e-12, max_step=0.02
                )
                k = ode.y[0, -1]
        else:
            k = reference(end)
        assert actuators.stiffness(end)[0, 0] == pytest.approx(k, rel=1e-7)
        if abs(kink - end) > 1e-3:
            slope = (actuators.stiffness(end + 1e-6) - actuators.stiffness(end - 1e-6))[0, 0] / 2e-6
            assert actuators.stiffness_rate(end)[0, 0] == pytest.approx(slope, rel=1e-4, abs=1e-5)
        mean = sum(
            quad(lambda t: actuators.stiffness(t)[0, 0], a, b)[0] for a, b in zip(edges, edges[1:], strict=False)
        )
        assert actuators.mean_stiffness(np.array([time, end]))[0, 0, 0] == pytest.approx(mean / lasts, rel=1e-6)
        time = end
    np.testing.assert_allclose(actuators.stiffness(time)[0, 1:], START, rtol=1e-12)


def test_a_spring_that_is_told_the_same_again_goes_on_as_it_was():
    actuators = Actuators([FREE])
    told(actuators, 1.0, 1.0, within=1.0)
    told(actuators, 1.5, 1.0, within=5.0)
    assert actuators.stiffness(2.0)[0, 0] == 1.0


def test_what_is_asked_for_and_what_is_done_are_both_known_afterwards():
    import xarray as xr

    actuators = Actuators([FREE.override("springs.softest", 1.0)])
    told(actuators, 0.5, 0.25, within=0.5)
    times = np.array([0.0, 0.5, 0.75, 1.0, 2.0])
    data = xr.Dataset(actuators.recorded(times), coords={"time": times})
    assert data.command_stiffness.values[0, 0, 0] == 0.25
    np.testing.assert_allclose(
        data.stiffness.values[:, 0, 0], [START, START, 0.5 * (START + 1.0), 1.0, 1.0], rtol=1e-12
    )
    assert data.within.attrs == {"units": "s"}


@pytest.mark.parametrize(
    ("command", "field"),
    [
        (Command(leg_yaw=[0.1, 0.1, 0.1]), "command.leg_yaw"),
        (Command(leg_yaw=[np.nan, 0.0]), "command.leg_yaw"),
        (Command(leg_yaw=[2.0, 0.0]), "command.leg_yaw"),
        (Command(leg_yaw="left"), "command.leg_yaw"),
        (Command(stiffness=[1.0, 1.0]), "command.stiffness"),
        (Command(stiffness=[-1.0, START, START, START, START]), "command.stiffness"),
        (Command(stiffness=[0.0, START, START, START, START]), "command.stiffness"),
        (Command(stiffness=[np.inf, START, START, START, START]), "command.stiffness"),
        (Command(stiffness=[1e300, START, START, START, START]), "command.stiffness"),
        (Command(joint_torque=[np.nan] * 5), "command.joint_torque"),
        (Command(joint_torque=[-1e101] * 5), "command.joint_torque"),
        (Command(within=-1.0), "command.within"),
        (Command(within=np.nan), "command.within"),
        (np.zeros(2), "command"),
        (Command(within=None), "command.within"),
        (Command(within="1"), "command.within"),
        (Command(within=[0.1]), "command.within"),
        (Command(within=10**400), "command.within"),
        (Command(within=1e300), "command.within"),
        (Command(leg_yaw=[10**400, 0]), "command.leg_yaw"),
        (Command(leg_yaw=["0.1", "0.1"]), "command.leg_yaw"),
        (Command(leg_yaw=[0.1j, 0]), "command.leg_yaw"),
        (Command(leg_yaw=0.1), "command.leg_yaw"),
    ],
)
def test_what_is_no_command_is_named_and_changes_nothing(command, field):
    actuators = Actuators([FREE])
    with pytest.raises(ParameterError) as caught:
        actuators.command(1.0, command, WALKING)
    assert caught.value.field == field
    assert "\n" not in str(caught.value)
    assert not actuators.driven.any()
    np.testing.assert_array_equal(actuators.stiffness(2.0), [[START] * 5])


def test_only_adjustable_springs_are_adjusted():
    robot = PRESET.set_from_text(["springs.adjustable[0]=true"])
    actuators = Actuators([robot])
    told(actuators, 0.0, 1.0)
    with pytest.raises(ParameterError, match=r"joint 3 is not adjustable.*springs\.adjustable"):
        actuators.command(0.1, Command(stiffness=[1.0, START, 1.0, START, START]), WALKING)
    with pytest.raises(ParameterError, match="joint 1 is not adjustable"):
        Actuators([PRESET]).command(0.0, Command(stiffness=[1.0, START, START, START, START]), WALKING)


def test_robots_that_no_longer_walk_do_not_obey_and_may_be_told_nonsense():
    actuators, walking = Actuators([FREE, FREE]), np.array([True, False])
    stiffness = np.full((2, 5), START)
    stiffness[:, 0] = [1.0, np.nan]
    actuators.command(0.0, Command(stiffness=stiffness, leg_yaw=[[0.1, 0.1], [np.nan, 9.0]]), walking)
    np.testing.assert_array_equal(actuators.stiffness(1.0)[:, 0], [1.0, START])
    np.testing.assert_array_equal(actuators.leg_yaw, [[0.1, 0.1], [0.0, 0.0]])
    assert actuators.driven.tolist() == [True, False]


def test_ramps_start_from_where_they_are_and_arrive_when_told():
    ramps = Ramps(np.zeros(3), keep=True)
    ramps.to(np.array([1.0, 1.0, 1.0]), 0.0, 10.0)
    # Another goal; the same goal again, later and sooner.
    ramps.to(np.array([-1.0, np.nan, np.nan]), 2.0, 4.0)
    ramps.to(np.array([-1.0, 1.0, 1.0]), 3.0, 100.0)
    ramps.to(np.array([-1.0, 1.0, 1.0]), 4.0, 1.0)
    np.testing.assert_allclose(ramps.at(np.array([4.0, 4.5, 5.0, 20.0])), [
        [-0.4, 0.4, 0.4], [-0.7, 0.7, 0.7], [-1.0, 1.0, 1.0], [-1.0, 1.0, 1.0],
    ], atol=1e-15)  # fmt: skip
    times = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.5, 9.0])
    np.testing.assert_allclose(ramps.over(times)[:, 0], [0.0, 0.1, 0.2, -0.1, -0.4, -0.7, -1.0], atol=1e-15)
    again = Ramps(np.zeros(3), keep=True)
    again.restore(ramps.state())
    np.testing.assert_array_equal(again.over(times), ramps.over(times))


def test_leg_yaw_over_time_is_what_it_was_at_every_moment():
    """Looked up as it goes, and afterwards; and it never leaves what was commanded before and after."""
    rng = np.random.default_rng(1)
    actuators, told = Actuators([PRESET, PRESET]), np.zeros((1, 2, 2))
    starts, lengths = np.sort(rng.uniform(0.0, 3.0, 30)), rng.uniform(0.0, 0.8, 30) * (rng.uniform(size=30) > 0.2)
    goals = rng.uniform(-0.5, 0.5, (30, 2, 2))
    goals[10:13] = goals[9]
    for start, length, goal in zip(starts, lengths, goals, strict=True):
        actuators.command(float(start), Command(leg_yaw=goal, within=float(length)), np.ones(2, dtype=bool))
        told = np.concatenate([told, goal[None]])
    times = np.linspace(0.0, 4.0, 4001)
    yaw = actuators.leg_yaw_over(times)
    np.testing.assert_array_equal(yaw[-1], goals[-1])
    assert (np.abs(yaw) <= np.abs(goals).max()).all()
    due = (times > (starts + lengths)[:, None]) & (times < np.append(starts[1:], 4.0)[:, None])
    for event in range(30):
        np.testing.assert_array_equal(yaw[due[event]], np.broadcast_to(goals[event], (due[event].sum(), 2, 2)))
    # Continuous but where it was told to be there at once.
    jumps = np.abs(np.diff(yaw, axis=0)).max(axis=(1, 2)) > 0.05
    at_once = starts[lengths == 0.0]
    assert all(np.abs(at_once - time).min() < 2e-3 for time in times[1:][jumps])
    acting = actuators.leg_yaw_commanded(np.array([0.0, starts[4], starts[4] + 1e-9]))
    np.testing.assert_array_equal(acting, [np.zeros((2, 2)), goals[3], goals[4]])


def test_a_spring_that_is_told_its_goal_again_is_there_no_later():
    actuators = Actuators([FREE.override("springs.lag", 0.5)])
    told(actuators, 0.0, 1.0, within=10.0)
    told(actuators, 1.0, 1.0, within=20.0)
    assert actuators.profile[3, 0, 0] == 10.0
    told(actuators, 2.0, 1.0, within=0.5)
    assert actuators.profile[3, 0, 0] == 2.5
    assert actuators.stiffness(2.0)[0, 0] == pytest.approx(
        START - (2.0 - 0.5 * (1.0 - np.exp(-4.0))) * (START - 1.0) / 10
    )


def test_a_lag_much_longer_than_the_ramp_costs_no_digits():
    """As good as the limit of a step, which it is to 1e-12."""
    for lag in (0.5, 10.0, 1e3):
        stiffness = []
        for within in (2e-9, 0.0):
            actuators = Actuators([FREE.override("springs.lag", lag)])
            told(actuators, 0.0, 1.0, within=within)
            stiffness.append(actuators.stiffness(1.0)[0, 0])
        assert stiffness[0] == pytest.approx(stiffness[1], rel=1e-8 / lag)
