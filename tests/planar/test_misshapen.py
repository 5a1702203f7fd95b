"""Compiled loops look at no index: what does not fit together is refused before it gets to them."""

import numpy as np
import pytest

from chilopod import load_robot, planar
from chilopod.errors import ParameterError
from chilopod.planar import PlanarModel, linear, stretch
from chilopod.planar.along import FollowedModel, walk_means
from chilopod.stability import from_rhs

ROBOT = load_robot("aoi2022-planar")
MODEL, FOLLOWED = PlanarModel(ROBOT), FollowedModel(ROBOT)


@pytest.mark.parametrize(
    "call",
    [
        lambda: MODEL.flow_states(np.zeros(13), 0.0, 0.1),
        lambda: PlanarModel.flow_many([], 0.0, 0.1),
        lambda: FollowedModel.flow_each([], np.zeros((0, 13)), 0.0, 0.1),
        lambda: FollowedModel.flow_each([FOLLOWED], np.zeros((1, 5)), 0.0, 0.1),
        lambda: FollowedModel.flow_each([FOLLOWED], np.zeros(13), 0.0, 0.1),
        lambda: FollowedModel.flow_each([FOLLOWED] * 2, np.zeros((1, 13)), 0.0, 0.1),
        lambda: walk_means([], np.zeros((0, 13))),
        lambda: walk_means([FOLLOWED], np.zeros((1, 7))),
        lambda: walk_means([FOLLOWED], np.zeros(())),
        lambda: linear.propagate(np.ones(3), np.zeros((2, 8, 3, 13)), np.ones(3), 1.0, 1.0, np.eye(13)),
    ],
)
def test_states_of_another_shape_are_refused(call):
    with pytest.raises(ParameterError) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_nothing_is_carried_nowhere():
    assert MODEL.flow_states(np.zeros((0, 13)), 0.0, 0.1).shape == (0, 13)
    state, derivative = MODEL.flow(np.full(13, 0.1), 0.3, 0.3)
    np.testing.assert_array_equal(state, np.full(13, 0.1))
    np.testing.assert_array_equal(derivative, np.eye(13))
    np.testing.assert_array_equal(PlanarModel.flow_many([MODEL], 0.3, 0.3)[0][0], np.eye(13))


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_states_of_a_system_of_ones_own_are_refused(method):
    system = from_rhs(lambda t, x: [x[1], -x[0] - 0.1 * x[1]], 2, 1.0, method=method)
    for x in (np.zeros(1), np.zeros(3), np.zeros((2, 2))):
        for flow in (system.flow, system.flow_with_error):
            with pytest.raises(ParameterError, match="shape"):
                flow(x, 0.0, 1.0)
    with pytest.raises(ParameterError, match="shape"):
        system.flow_states(np.zeros((2, 1)), 0.0, 1.0)


def test_a_stretch_of_nothing_is_refused(monkeypatch):
    given, alone = [], stretch.walk_alone
    monkeypatch.setattr(stretch, "walk_alone", lambda *arguments: given.append(arguments) or alone(*arguments))
    planar.start(ROBOT, record=None).advance(0.5)
    rows, pieces, robots, tolerance, *rest = given[0]
    nothing, none = np.empty(0), np.empty(0, dtype=np.intp)
    for spoilt in (
        (none, pieces, robots, tolerance, *rest),
        (rows, pieces._replace(widths=nothing), robots, tolerance, *rest),
        (rows, pieces._replace(widths=nothing, begins=nothing, starts=nothing), robots, tolerance, *rest),
        (rows, pieces, robots._replace(profile=robots.profile[:6]), tolerance, *rest),
        (rows, pieces, robots._replace(yaw=robots.yaw[:, :1]), tolerance, *rest),
        (rows, pieces, robots, tolerance, rest[0][:, :-1], *rest[1:]),
    ):
        with pytest.raises(ParameterError, match="must fit the number"):
            stretch.carry(*spoilt)
        assert not stretch.walk_abreast(*spoilt)
        assert not stretch.walk(1, *spoilt)
