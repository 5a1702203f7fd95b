"""What the planar model refuses, what it takes, and many robots at once."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod import load_robot
from chilopod.analysis.map_axes import with_modules
from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.deadline import Deadline, SpentError
from chilopod.planar import PlanarModel
from chilopod.stability import PeriodicSystem, SystemLike
from helpers.planar_strategies import robots, state_of

PRESET = load_robot("aoi2022-planar")
MODEL = PlanarModel(PRESET)


def one_line(caught):
    text = str(caught.value)
    assert text
    assert "\n" not in text
    return text


@pytest.mark.parametrize("x", [0.0, [], np.zeros(12), np.zeros(16), np.zeros((1, 13)), np.zeros((13, 1))])
def test_states_of_the_wrong_shape_are_refused(x):
    for call in (
        lambda: MODEL.flow(x, 0.0, 0.6),
        lambda: MODEL.flow_states([x, x], 0.0, 0.6),
        lambda: MODEL.rhs(0.0, x),
        lambda: MODEL.drift(x),
    ):
        with pytest.raises(ParameterError) as caught:
            call()
        assert "13" in one_line(caught)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", [0, 4, 12])
def test_states_that_are_not_finite_are_refused(bad, place):
    x = state_of(MODEL, 0)
    x[place] = bad
    for call in (
        lambda: MODEL.flow(x, 0.0, 0.6),
        lambda: MODEL.rhs(0.1, x),
        lambda: MODEL.drift(x),
        lambda: MODEL.flow_states([MODEL.orbit, x], 0.0, 0.6),
    ):
        with pytest.raises(ParameterError) as caught:
            call()
        assert "finite" in one_line(caught)


@pytest.mark.parametrize(("t0", "t1"), [(0.6, 0.0), (0.1, 0.1 - 1e-12), (np.nan, 1.0), (0.0, np.nan), (0.0, np.inf)])
def test_times_must_be_finite_and_in_order(t0, t1):
    for call in (
        lambda: MODEL.flow(MODEL.orbit, t0, t1),
        lambda: MODEL.flow(state_of(MODEL, 0), t0, t1),
        lambda: MODEL.flow_states([MODEL.orbit], t0, t1),
        lambda: PlanarModel.flow_many([MODEL, MODEL], t0, t1),
    ):
        with pytest.raises(ParameterError) as caught:
            call()
        assert "t0" in one_line(caught)


@pytest.mark.parametrize("t", [np.nan, np.inf])
def test_the_right_hand_side_refuses_times_that_are_not_finite(t):
    with pytest.raises(ParameterError):
        MODEL.rhs(t, MODEL.orbit)


@pytest.mark.parametrize(("place", "size"), [(12, 1e200), (0, 1e300), (2, 1e160), (7, 1e20)])
def test_motions_that_cannot_be_followed_are_one_line(place, size):
    x = state_of(MODEL, 0)
    x[place] = size
    for call in (lambda: MODEL.flow(x, 0.0, 0.6), lambda: MODEL.flow_states([MODEL.orbit, x], 0.0, 0.6)):
        with pytest.raises(AnalysisError) as caught:
            call()
        assert "diverges" in one_line(caught)


@pytest.mark.parametrize(
    ("path", "value"),
    [("springs.stiffness", 1e9), ("springs.damping", 1e9), ("ground.friction", 1e9), ("body.mass", 1e-9)],
)
def test_robots_too_stiff_to_follow_say_so_at_once(path, value):
    model = PlanarModel(PRESET.with_value(path, value))
    before = time.perf_counter()
    with pytest.raises(AnalysisError) as caught:
        model.flow(model.orbit, 0.0, 0.6)
    assert time.perf_counter() - before < 1.0
    assert "too fast" in one_line(caught)


def test_the_model_is_a_periodic_system():
    assert isinstance(MODEL, SystemLike)
    PeriodicSystem(MODEL.dimension, MODEL.period, MODEL.flow, MODEL.symmetry, orbit=MODEL.orbit)
    np.testing.assert_array_equal(MODEL.reflection @ MODEL.reflection, np.eye(13))
    assert MODEL.schedule.times[0] == 0.0
    assert (np.diff(MODEL.schedule.times) > 0.0).all()
    assert MODEL.schedule.times[-1] == MODEL.period


# -- many robots at once


@given(robots(), st.lists(st.integers(-3, 3), min_size=1, max_size=5), st.floats(0.0, 1.0), st.floats(0.0, 1.2))
def test_many_robots_at_once_are_each_alone(robot, powers, start, duration):
    # Alike in gait and size alone: springs, dampers, feet, length and mass differ by orders of magnitude.
    paths = ["springs.stiffness", "springs.damping", "ground.friction", "body.mass", "body.length"]
    family = [robot]
    for path, power in zip(paths, powers, strict=False):
        old = 0.01 if path == "springs.damping" else robot.get(path) if "springs" not in path else 0.1
        family.append(robot.with_value(path, old * 4.0**power))
    models = [PlanarModel(each) for each in family]
    t0 = start * robot.gait.period
    t1 = t0 + duration * robot.gait.period
    assert all(models[0].can_flow_with(model) for model in models)
    matrices, bounds = PlanarModel.flow_many(models, t0, t1)
    for model, matrix, bound in zip(models, matrices, bounds, strict=True):
        _, alone, alone_bound = model.flow_with_error(model.orbit, t0, t1)
        np.testing.assert_array_equal(matrix, alone)
        assert bound == alone_bound


def test_slow_and_fast_robots_do_not_spoil_each_other():
    slow, fast = (PlanarModel(PRESET.with_value("ground.friction", c)) for c in (1.0, 5e3))
    for models in ([slow, fast], [fast, slow]):
        matrices, bounds = PlanarModel.flow_many(models, 0.0, 0.6)
        for model, matrix, bound in zip(models, matrices, bounds, strict=True):
            _, alone, _ = model.flow_with_error(model.orbit, 0.0, 0.6)
            assert np.abs(matrix - alone).max() <= bound < 1e-8


@pytest.mark.parametrize(
    ("path", "value"), [("gait.stance", 0.3), ("gait.module_phase", 1.0), ("gait.stride", 0.02), ("body.modules", 7)]
)
def test_robots_with_another_gait_or_size_are_taken_apart(path, value):
    other = PlanarModel(PRESET.with_value(path, value))
    assert not MODEL.can_flow_with(other)
    assert not other.can_flow_with(MODEL)
    with pytest.raises(ParameterError) as caught:
        PlanarModel.flow_many([MODEL, other], 0.0, 0.6)
    assert "gait" in one_line(caught)


def test_robots_of_other_springs_flow_together():
    assert MODEL.can_flow_with(PlanarModel(PRESET.with_value("springs.stiffness[2]", 1.0)))
    assert MODEL.can_flow_with(PlanarModel(PRESET.with_value("ground.friction", 1.0)))


# -- absurd but valid


@pytest.mark.parametrize("modules", [2, 60])
def test_robots_of_every_size_walk(modules):
    model = PlanarModel(with_modules(PRESET, modules))
    state, matrix, bound = model.flow_with_error(model.orbit, 0.0, model.period)
    np.testing.assert_array_equal(state, model.orbit)
    assert np.isfinite(matrix).all()
    assert bound < 1e-9
    # Legs that move in pairs push straight: the column of the forward speed knows no sideways.
    paired = PlanarModel(model.robot.with_value("gait.side_phase", 0.0))
    _, matrix = paired.flow(paired.orbit, 0.0, paired.period)
    np.testing.assert_array_equal(matrix[1:, 0], 0.0)


def test_a_thousand_modules_have_a_right_hand_side_and_a_flow_without_derivative():
    model = PlanarModel(with_modules(PRESET, 1000))
    x = state_of(model, 0, bend=1e-3)
    slope = model.rhs(0.05, x)
    assert slope.shape == (2001,)
    assert np.isfinite(slope).all()
    after = model.flow_states([model.orbit], 0.0, 0.01)[0]
    np.testing.assert_allclose(after, model.orbit, rtol=0, atol=1e-9)


@pytest.mark.parametrize("count", [1, 3])
def test_the_linear_flow_of_long_chains_ends_at_a_time_limit(count):
    """It takes a second of one core, for each robot, and all are computed at once."""
    robot = load_robot("aoi2022-planar").with_value("body.modules", 40.0)
    models = [PlanarModel(robot.with_value("springs.stiffness", stiffness)) for stiffness in (0.1, 0.2, 0.3)[:count]]
    short = [PlanarModel(model.robot.with_value("body.modules", 2.0)) for model in models]
    PlanarModel.flow_many(short, 0.0, 0.1)  # compiles
    begin, _ = time.process_time(), [model.contraction for model in models]
    with pytest.raises(SpentError), Deadline(0.05):
        PlanarModel.flow_many(models, 0.0, models[0].period)
    assert time.process_time() - begin < 0.9 * count


def test_the_nonlinear_flow_of_long_chains_looks_at_the_time_between_tangents():
    model = PlanarModel(load_robot("aoi2022-planar").with_value("body.modules", 16.0))
    with pytest.raises(SpentError), Deadline(0.05):
        model.flow(1.1 * model.orbit, 0.0, model.period)
