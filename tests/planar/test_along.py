"""Many robots in one call, few tangents and means over a period: against the plain model and powers foot by foot."""

import numpy as np
import pytest

from chilopod.errors import ParameterError
from chilopod.planar import PlanarModel, powers
from chilopod.planar.along import FollowedModel, walk_means
from chilopod.robot import load_robot

ROBOT = load_robot("aoi2022-planar")
BENT = np.array([0.09, 0.01, -0.1, 0.4, 0.2, 0.3, 0.3, 0.1, 0.3, -0.2, 0.1, 0.2, -0.1])


def robot(k1, **more):
    changed = ROBOT.with_value("springs.stiffness[0]", k1)
    for path, value in more.items():
        changed = changed.with_value(path.replace("__", "."), value)
    return changed


@pytest.mark.parametrize(("t0", "t1"), [(0.0, 0.6), (0.07, 0.43), (0.02, 0.03)])
def test_the_derivative_is_that_of_the_plain_model(t0, t1):
    state, derivative = FollowedModel(robot(0.6), 1e-11).flow(BENT, t0, t1)
    expected_state, expected = PlanarModel(robot(0.6)).flow(BENT, t0, t1)
    assert state == pytest.approx(expected_state, abs=1e-8)
    assert derivative == pytest.approx(expected, abs=1e-7)
    assert np.sort(np.abs(np.linalg.eigvals(derivative))) == pytest.approx(
        np.sort(np.abs(np.linalg.eigvals(expected))), abs=1e-7
    )


def test_the_straight_walk_keeps_its_exact_derivative():
    model = FollowedModel(robot(0.6), 1e-10)
    assert np.array_equal(model.flow(model.orbit, 0.0, 0.6)[1], PlanarModel(robot(0.6)).flow(model.orbit, 0.0, 0.6)[1])


@pytest.mark.parametrize("other", [robot(0.5), robot(0.5, gait__stance=0.4), robot(0.5, ground__friction=200.0)])
def test_each_state_is_carried_by_its_own_robot(other):
    models = [FollowedModel(robot(0.6), 1e-10), FollowedModel(other, 1e-10)]
    together = FollowedModel.flow_each(models, np.array([BENT, -BENT]), 0.1, 0.9)
    for model, state, start in zip(models, together, (BENT, -BENT), strict=True):
        assert np.array_equal(state, model.flow_states(start[None], 0.1, 0.9)[0])


def test_as_many_states_as_models():
    with pytest.raises(ParameterError, match="one row for each model"):
        FollowedModel.flow_each([FollowedModel(robot(0.6))], np.array([BENT, BENT]), 0.0, 0.6)


@pytest.mark.parametrize("other", [robot(0.5), robot(0.5, gait__stance=0.4)])
def test_means_are_those_of_the_powers_foot_by_foot(other):
    models = [PlanarModel(robot(0.6), 1e-12), PlanarModel(other, 1e-12)]
    # Steady by then, so that a rule without nodes of its own will do.
    orbits = np.array([model.flow_states(BENT[None], 0.0, 20 * model.period)[0] for model in models])
    found = walk_means(models, orbits)
    for index, (model, orbit) in enumerate(zip(models, orbits, strict=True)):
        nodes, weights = np.polynomial.legendre.leggauss(24)
        legs = floor = 0.0
        angles = np.zeros(5)
        for start, end in zip(model.schedule.times[:-1], model.schedule.times[1:], strict=True):
            for node, weight in zip(nodes, weights, strict=True):
                t = 0.5 * (start + end + (end - start) * node)
                state = model.flow_states(orbit[None], 0.0, t)[0]
                share = 0.5 * (end - start) * weight / model.period
                legs += share * powers(model, state, t).legs
                floor += share * powers(model, state, t).floor
                angles += share * state[3:8]
        assert found.leg_power[index] == pytest.approx(legs, rel=1e-6)
        assert found.floor_power[index] == pytest.approx(floor, rel=1e-6)
        assert found.mean_angle[index] == pytest.approx(angles, abs=1e-8)
        drift = model.drift(orbit)
        assert (found.drifts[index].forward, found.drifts[index].turn) == pytest.approx(
            (drift.forward, drift.turn), abs=1e-11
        )
