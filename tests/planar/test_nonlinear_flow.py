"""The nonlinear flow: against another formulation of the mechanics, finer steps, and itself in parts."""

import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod import load_robot
from chilopod.analysis.map_axes import with_modules
from chilopod.planar import PlanarModel
from helpers.free_bodies import FreeBodies
from helpers.planar_strategies import mid_interval, robots, state_of

PRESET = load_robot("aoi2022-planar")


CASES = {
    "preset": PRESET,
    "soft front": PRESET.with_value("springs.stiffness[0]", 0.5),
    "two modules, damped": with_modules(PRESET, 2).with_value("springs.damping", 0.02),
    "feet far ahead, duty 0.3": PRESET.with_value("gait.stance", 0.2)
    .with_value("gait.swing", 0.4)
    .with_value("legs.forward_offset", 0.1),
    "duty 0.7, side phase 70 deg": with_modules(PRESET, 4)
    .with_value("gait.stance", 0.42)
    .with_value("gait.swing", 0.18)
    .with_value("gait.side_phase", math.radians(70)),
    "side phase 0, module phase -50 deg": with_modules(PRESET, 3)
    .with_value("gait.side_phase", 0.0)
    .with_value("gait.module_phase", math.radians(-50)),
}


@pytest.mark.parametrize("name", CASES)
def test_it_agrees_with_free_bodies_held_together_by_joint_forces(name):
    robot = CASES[name]
    model, bodies = PlanarModel(robot), FreeBodies(robot)
    x = state_of(model, seed=3, bend=0.6)
    start, end = 0.17 * model.period, 1.17 * model.period
    reduced, _ = bodies.to_reduced(bodies.carry(bodies.from_reduced(x, (0.3, -2.0, 1.1)), start, end))
    np.testing.assert_allclose(model.flow_states([x], start, end)[0], reduced, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["soft front", "duty 0.7, side phase 70 deg"])
def test_drift_is_that_of_the_free_bodies_wherever_they_start_and_composes(name):
    robot = CASES[name]
    model, bodies = PlanarModel(robot), FreeBodies(robot)
    x = state_of(model, seed=4, bend=0.6)
    pose = np.array([0.7, 0.2, -2.0])
    state = bodies.carry(bodies.from_reduced(x, pose), 0.0, 2 * model.period)
    place = pose
    for _ in range(2):
        drift = model.drift(x)
        c, s = np.cos(place[2]), np.sin(place[2])
        place = place + np.array([c * drift.forward - s * drift.left, s * drift.forward + c * drift.left, drift.turn])
        x = model.flow_states([x], 0.0, model.period)[0]
    reduced, end = bodies.to_reduced(state)
    np.testing.assert_allclose(end, place, rtol=0, atol=1e-9)
    np.testing.assert_allclose(reduced, x, rtol=0, atol=1e-9)


@given(robots(st.integers(2, 8)), st.integers(0, 1000), st.floats(0.0, 1.0), st.floats(0.1, 1.2))
def test_the_error_of_its_derivative_is_within_the_claimed_bound(robot, seed, start, duration):
    model = PlanarModel(robot)
    t0 = start * model.period
    t1 = t0 + duration * model.period
    x = state_of(model, seed)
    state, matrix, bound = model.flow_with_error(x, t0, t1)
    finer, finer_matrix = PlanarModel(robot, tolerance=0.1 * model.tolerance).flow(x, t0, t1)
    assert (np.abs(matrix - finer_matrix) <= bound).all()
    np.testing.assert_allclose(state, finer, rtol=0, atol=1e-10 * max(1.0, np.abs(finer).max()))


@pytest.mark.parametrize("tolerance", [1e-8, 1e-10, 1e-12])
def test_the_claimed_bound_follows_the_tolerance(tolerance):
    x = state_of(PlanarModel(PRESET), seed=1)
    _, matrix, bound = PlanarModel(PRESET, tolerance).flow_with_error(x, 0.05, 0.65)
    _, finest = PlanarModel(PRESET, 1e-14).flow(x, 0.05, 0.65)
    error = np.abs(matrix - finest)
    assert (error <= bound).all()
    assert error.any()
    assert np.max(bound) < 1e4 * tolerance


@given(robots(st.integers(2, 8)), st.integers(0, 1000), st.floats(-1.0, 1.0), st.floats(0.0, 0.8), st.floats(0.0, 0.8))
def test_flows_compose(robot, seed, start, first, second):
    model = PlanarModel(robot)
    t0, t1, t2 = np.cumsum([start, first, second]) * model.period
    x = state_of(model, seed)
    at_once, whole, bound = model.flow_with_error(x, t0, t2)
    half_way, one, one_bound = model.flow_with_error(x, t0, t1)
    there, two, two_bound = model.flow_with_error(half_way, t1, t2)
    ones = np.ones_like(one)
    bounds = bound * ones + np.abs(two) @ (one_bound * ones) + (two_bound * ones) @ np.abs(one)
    allowed = float(bounds.max())
    assert np.abs(there - at_once).max() <= allowed * max(1.0, np.abs(x).max())
    # The second factor is taken at a state in error: its own derivative counts, of the order of itself squared.
    assert np.abs(two @ one - whole).max() <= allowed * max(1.0, np.abs(two).max() * np.abs(one).max())


@given(robots(st.integers(2, 8)), st.integers(0, 1000), st.floats(0.0, 0.999), st.floats(0.3, 0.7))
def test_its_slope_is_the_right_hand_side(robot, seed, fraction, inside):
    model = PlanarModel(robot)
    t, x = mid_interval(model, fraction, inside), state_of(model, seed)
    slope = model.rhs(t, x)

    def quotient(h):
        return (model.flow_states([model.flow_states([x], t, t)[0]], t, t + h)[0] - x) / h

    # Extrapolated from three step sizes; the fastest decay sets the first.
    fastest = np.abs(np.linalg.eigvals(model.flow(x, t, t + 1e-9)[1] / 1e-9 - np.eye(model.dimension) / 1e-9)).max()
    h = min(1e-2 / max(fastest, 1.0 / model.period), 0.2 * np.diff(model.schedule.times).max())
    a, b, c = quotient(h), quotient(h / 2), quotient(h / 4)
    extrapolated = a / 3 - 2 * b + 8 * c / 3
    np.testing.assert_allclose(extrapolated, slope, rtol=0, atol=1e-5 * np.abs(slope).max())


@given(robots())
def test_the_straight_walk_stays_straight_for_every_gait(robot):
    model = PlanarModel(robot)
    after = model.flow_states([model.orbit], 0.3 * model.period, 1.8 * model.period)[0]
    np.testing.assert_allclose(after, model.orbit, rtol=1e-13, atol=1e-15 * model.robot.gait.speed)
    for fraction in (0.0, 0.4, 0.9):
        still = model.rhs(mid_interval(model, fraction), model.orbit)
        assert np.abs(still).max() <= 1e-13 * robot.ground.friction / robot.module_mass * robot.gait.speed


def test_the_straight_walk_moves_a_stride_in_a_stance_and_its_path_is_straight():
    model = PlanarModel(PRESET)
    drift = model.drift(model.orbit)
    assert drift.forward == pytest.approx(0.03 * 0.6 / 0.31, rel=1e-13)
    assert drift.left == drift.turn == 0.0
    assert drift.radius == math.inf
    assert drift.speed == pytest.approx(0.03 / 0.31, rel=1e-13)


def test_rows_of_a_batch_do_not_see_each_other():
    model = PlanarModel(PRESET)
    states = np.array([state_of(model, seed) for seed in range(7)])
    together = model.flow_states(states, 0.05, 0.85)
    for row, alone in zip(together, states, strict=True):
        np.testing.assert_array_equal(model.flow_states([alone], 0.05, 0.85)[0], row)
    np.testing.assert_array_equal(model.flow_states(states[::-1], 0.05, 0.85)[::-1], together)
    assert model.flow_states(np.empty((0, 13)), 0.0, 0.6).shape == (0, 13)


def test_joints_may_bend_as_far_as_they_like():
    model = PlanarModel(PRESET)
    states = np.array([state_of(model, seed, bend=3.0) for seed in range(3)])
    assert np.abs(states[:, 3:8]).max() > 0.6 * np.pi
    expected = [model.flow(state, 0.05, 0.35)[0] for state in states]
    np.testing.assert_allclose(model.flow_states(states, 0.05, 0.35), expected, rtol=0, atol=1e-10)


def test_the_number_of_threads_changes_no_bit():
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("one core")
    model = PlanarModel(PRESET)
    states = np.array([state_of(model, seed) for seed in range(9)])
    models = [PlanarModel(PRESET.with_value("springs.stiffness[0]", k)) for k in np.linspace(0.2, 4.0, 9)]
    before = numba.get_num_threads()
    results = []
    try:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            results.append(
                [
                    model.flow_states(states, 0.0, 0.6),
                    *PlanarModel.flow_many(models, 0.0, 0.6),
                    *model.flow(states[0], 0, 1),
                ]
            )
    finally:
        numba.set_num_threads(before)
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_inputs_are_left_alone_and_results_are_fresh():
    model = PlanarModel(PRESET)
    for x in (state_of(model, 5), model.orbit):
        kept = x.copy()
        state, matrix = model.flow(x, 0.0, 0.3)
        again, again_matrix = model.flow(x, 0.0, 0.3)
        np.testing.assert_array_equal(x, kept)
        state[:], matrix[:] = 0.0, 0.0
        third, third_matrix = model.flow(x, 0.0, 0.3)
        np.testing.assert_array_equal(again, third)
        np.testing.assert_array_equal(again_matrix, third_matrix)
