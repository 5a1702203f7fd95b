"""The linearised flow on the straight walk against independent computations, and what it says of its own error."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chilopod import load_robot
from chilopod.analysis.map_axes import with_modules
from chilopod.planar import PlanarModel
from chilopod.planar.linear import joint_bound, mass_matrix
from helpers.planar_reference import EXTENDED, LD, coordinates, fine_flow
from helpers.planar_strategies import beside, log_floats, robots

import peer_model

PRESET = load_robot("aoi2022-planar")
finer = pytest.mark.skipif(not EXTENDED, reason="this machine has no precision finer than double")


def scaled(stiffness=1.0, friction=1.0, damping=0.0):
    """The preset with its springs and feet multiplied and dampers of N*m*s/rad added."""
    robot = PRESET.with_value("springs.stiffness", stiffness * PRESET.springs.stiffness[0])
    robot = robot.with_value("ground.friction", friction * PRESET.ground.friction)
    return robot.with_value("springs.damping", damping)


def peer_of(robot):
    turn = 2.0 * math.pi
    return peer_model.PeerRobot(
        modules=robot.body.modules,
        length=robot.body.length,
        mass=robot.body.mass,
        stiffness=robot.springs.stiffness,
        damping=robot.springs.damping,
        forward_offset=robot.legs.forward_offset,
        half_width=robot.legs.half_width,
        stride=robot.gait.stride,
        stance=robot.gait.stance,
        swing=robot.gait.swing,
        module_phase=robot.gait.module_phase / turn,
        side_phase=robot.gait.side_phase / turn,
        friction=robot.ground.friction,
    )


def test_the_peers_robot_is_the_preset():
    for name, value in vars(peer_of(PRESET)).items():
        assert getattr(peer_model.PeerRobot(), name) == pytest.approx(value), name


@given(robots(st.integers(2, 8)), st.floats(0.0, 1.0), st.floats(0.05, 1.2))
def test_it_is_the_derivative_of_the_nonlinear_flow(robot, start, duration):
    model = PlanarModel(robot)
    t0 = start * model.period
    t1 = t0 + duration * model.period
    _, linear, linear_error = model.flow_with_error(model.orbit, t0, t1)
    state, nonlinear, error = model.flow_with_error(beside(model.orbit), t0, t1)
    assert (np.abs(nonlinear - linear) <= error + linear_error).all()
    # What goes wrong on the way is magnified by the rest of it.
    np.testing.assert_allclose(state, model.orbit, rtol=1e-12, atol=1e-12 * max(1.0, np.abs(linear).max()))


def test_a_motion_of_many_steps_has_a_larger_error():
    """A light robot with stiff springs swings fifteen times in a period."""
    robot = with_modules(PRESET, 2)
    for path, value in {
        "body.length": 0.736, "body.mass": 2.0, "body.yaw_inertia": 0.0186, "springs.stiffness": 100.0,
        "legs.half_width": 0.0, "legs.forward_offset": 0.0, "gait.stride": 0.368, "gait.stance": 0.5,
        "gait.swing": 0.5, "gait.module_phase": 0.0, "ground.friction": 2.72,
    }.items():  # fmt: skip
        robot = robot.with_value(path, value)
    model = PlanarModel(robot)
    _, linear, linear_error = model.flow_with_error(model.orbit, 0.0, model.period)
    _, nonlinear, error = model.flow_with_error(beside(model.orbit), 0.0, model.period)
    assert (np.abs(nonlinear - linear) <= error + linear_error).all()
    assert np.abs(nonlinear - linear).max() > 1e-11
    assert np.max(error) < 1e-8


@settings(max_examples=4, deadline=None)
@given(robots(st.integers(2, 5), own_inertia=st.none()), st.sampled_from([0.5, 1.0]))
@example(PRESET, 0.5)
@example(PRESET, 1.0)
def test_it_agrees_with_the_model_of_the_benchmarks(robot, periods):
    model = PlanarModel(robot)
    there, back = coordinates(model.modules)
    expected = there @ peer_model.flow(peer_of(robot), periods, LD, reach=4.0) @ back
    _, matrix, error = model.flow_with_error(model.orbit, 0.0, periods * model.period)
    assert np.abs(matrix - expected).max() <= error + 1e-13 * np.abs(expected).max()


def check_bound(robot, t0, t1):
    """The error, the bound that was claimed, and how many times smaller the error is."""
    model = PlanarModel(robot)
    _, matrix, bound = model.flow_with_error(model.orbit, t0, t1)
    error = float(np.abs(matrix - fine_flow(robot, t0, t1)).max())
    assert error <= bound
    assert bound < 1e-7 * max(1.0, np.abs(matrix).max())  # and it says something
    return bound / error if error else math.inf


@finer
@given(robots(), st.floats(0.0, 1.0), st.one_of(st.floats(0.05, 1.5), st.just(1.0), log_floats(1e-15, 0.05)))
@example(PRESET, 0.0, 0.5)
@example(PRESET, 0.0, 1.0)
def test_the_error_never_exceeds_the_claimed_bound(robot, start, duration):
    t0 = start * robot.gait.period
    check_bound(robot, t0, t0 + duration * robot.gait.period)


@finer
@pytest.mark.parametrize(
    ("stiffness", "friction", "damping"),
    [
        (1e3, 1.0, 0.0),  # springs that ring many times within a contact interval
        (1e2, 1e-2, 0.0),  # and with next to no damping
        (1.0, 1.0, 1.0),  # dampers much faster than the feet
        (1.0, 1.0, 30.0),
        (1.0, 30.0, 0.0),
        (1e-3, 1.0, 0.0),
        (1.0, 1e-3, 0.0),
    ],
)
def test_the_bound_holds_for_stiff_and_for_slack_robots(stiffness, friction, damping):
    check_bound(scaled(stiffness, friction, damping), 0.0, 0.3)


@finer
def test_the_bound_holds_when_feet_stride_over_more_than_a_module():
    # Seen from the start of an interval the feet damp far less than where they come from, or go to.
    robot = PRESET.with_value("gait.stride", 0.4).with_value("legs.forward_offset", 0.0).with_value("gait.stance", 0.2)
    check_bound(robot, 0.0, 0.3)
    check_bound(robot.with_value("gait.module_phase", 0.0), 0.0, robot.gait.period)


@finer
@pytest.mark.parametrize("modules", [20, 30])
def test_the_bound_holds_for_long_chains(modules):
    robot = with_modules(PRESET, modules)
    columns = [0, 1, 2, 3, modules, modules + 2, 2 * modules]
    model = PlanarModel(robot)
    _, matrix, bound = model.flow_with_error(model.orbit, 0.0, 0.3)
    assert np.abs(matrix[:, columns] - fine_flow(robot, 0.0, 0.3, columns)).max() <= bound < 1e-10


@finer
def test_the_reference_is_finer_than_what_it_judges():
    robot = scaled(10.0, 0.1, 0.01)
    coarse, fine = fine_flow(robot, 0.1, 0.7, reach=4.0), fine_flow(robot, 0.1, 0.7, reach=1.0)
    model = PlanarModel(robot)
    assert np.abs(coarse - fine).max() < 1e-4 * model.flow_with_error(model.orbit, 0.1, 0.7)[2]


def test_no_time_is_the_identity_and_a_period_later_all_is_the_same():
    model = PlanarModel(PRESET)
    _, matrix, error = model.flow_with_error(model.orbit, 0.2, 0.2)
    np.testing.assert_array_equal(matrix, np.eye(model.dimension))
    assert error < 1e-12
    for shift in (-3, 1, 50):
        _, later, bound = model.flow_with_error(model.orbit, 0.1 + shift * 0.6, 0.5 + shift * 0.6)
        _, now, _ = model.flow_with_error(model.orbit, 0.1, 0.5)
        assert np.abs(later - now).max() <= bound + 1e-12 * abs(shift)


@pytest.mark.parametrize("duration", [1e-16, 1e-15, 1e-14, 1e-13])
def test_the_shortest_times_count(duration):
    model = PlanarModel(scaled(friction=100.0))
    _, matrix = model.flow(model.orbit, 0.0, duration)
    slope = (matrix - np.eye(model.dimension)) / duration
    expected = slope[0, 0] * duration
    assert expected == pytest.approx(-25650.0 * 12 / 2 / 8.5 * duration, abs=3e-16, rel=0.4)


def test_the_mass_matrix_is_that_of_rods():
    n, length, mass, inertia = 5, 0.3, 1.1, 0.02
    matrix, lateral = mass_matrix(n, length, mass, inertia)
    rng = np.random.default_rng(1)
    eta = rng.normal(size=n + 2)
    vy = np.empty(n)
    vy[0] = eta[1]
    for i in range(1, n):  # the rear end of one is the front end of the next
        vy[i] = vy[i - 1] - 0.5 * length * eta[1 + i] - 0.5 * length * eta[2 + i]
    np.testing.assert_allclose(lateral @ eta, vy, rtol=1e-14)
    kinetic = 0.5 * mass * (n * eta[0] ** 2 + (vy**2).sum()) + 0.5 * inertia * (eta[2:] ** 2).sum()
    assert 0.5 * eta @ matrix @ eta == pytest.approx(kinetic, rel=1e-14)


def test_the_bound_on_joint_rates_is_one():
    rng = np.random.default_rng(2)
    for n in range(2, 10):
        root = rng.normal(size=(n, n))
        compliance, torque = root @ root.T, rng.uniform(0.0, 3.0, n)
        assert joint_bound(compliance, torque) >= np.abs(np.linalg.eigvals(compliance * torque)).max() * (1 - 1e-12)
