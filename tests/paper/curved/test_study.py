"""Trials of curved walks: what they settle on, what the square-root fit makes of them, and what is said about it."""

import numpy as np
import pytest

from chilopod import stability
from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.straight_walk import pitchfork
from chilopod.paper.curved import study as curved_findings
from chilopod.paper.curved.study import curved_trials, off_branch, on_branch
from chilopod.paper.printed import variant_robots
from chilopod.planar import PlanarModel
from chilopod.robot import load_robot
from chilopod.stability.returns import whole_period
from chilopod.tasks.radius_law import is_curved
from chilopod.trials import Disturbance

ROBOT = load_robot("aoi2022-planar")
EVEN = Disturbance(friction=0.0)
SPRINGS = np.repeat([7.0, 8.0, 9.0, 10.0, 11.0, 11.5], 10)


@pytest.fixture(scope="module")
def branch():
    return curved_walks(ROBOT, K1, (stiffness(6.8), stiffness(13.0)))


@pytest.fixture(scope="module")
def even():
    return curved_trials(ROBOT, (8.0, 10.0, 41.0), 4, disturbance=EVEN, e_folds=25.0)


def test_settled_trials_are_on_the_branch(branch, even):
    off = off_branch(ROBOT, even, branch)
    assert set(even.direction.values[:2].ravel()) == {"left", "right"}
    assert float(off.max()) < 1e-6
    assert off.notnull().values.tolist() == [[True] * 4] * 2 + [[False] * 4]


def test_means_are_those_of_the_branch(branch, even):
    for row in (0, 1):
        expected = on_branch(branch, "mean_angle", float(even.spring[row]))
        # Five seconds are no whole number of gait cycles, so some of the sway stays in the mean.
        assert np.abs(even.mean_angle.values[row]) == pytest.approx(np.tile(expected, (4, 1)), abs=2e-3)
        side = np.where(even.direction.values[row] == "right", 1.0, -1.0)
        assert (np.sign(even.mean_angle.values[row]) == side[:, None]).all()
    radius = 5 * 0.225 / np.abs(even.mean_angle.values[:2]).sum(axis=-1)
    assert even.axis_radius.values[:2] == pytest.approx(radius)


def test_stiff_springs_walk_straight(even):
    assert set(even.direction.values[2]) == {"straight"}
    assert even.settled.all()


def test_walks_that_have_not_settled_are_told(monkeypatch):
    monkeypatch.setattr("chilopod.paper.curved.study._SHORTEST", 36.0)
    short = curved_trials(ROBOT, (8.0, 10.0), 2, e_folds=1.0)
    assert short.duration.values == pytest.approx(36.0)
    assert not short.settled.any()
    assert set(short.direction.values.ravel()) == {""}
    assert not is_curved(short).any()


def test_a_walk_that_folds_up_is_told():
    soft = curved_trials(ROBOT, (5.0,), 2)
    assert set(soft.status.values.ravel()) == {"out of range"}
    assert np.isnan(soft.mean_angle.values).all()
    assert not soft.settled.any()


def test_the_law_holds_beside_the_point_only(branch):
    law = curved_findings.law_along_branch(branch)
    exact = law.attrs["exact_k1"]
    off = law.critical_k1.values - exact
    assert (np.diff(off) > 0.0).all()
    assert off[0] < 1e-4
    assert off[-1] == pytest.approx(1.04, abs=0.05)
    assert float(law.power.min()) == pytest.approx(0.308, abs=0.01)


def test_the_power_beside_the_point_is_that_of_orbits_solved_there():
    """The bend at 0.5 % and 2 % below the point from Newton's method alone: well below a square root."""
    critical, bends = pitchfork(ROBOT, normal_form=False).value, []
    for share in (0.005, 0.02):
        model = PlanarModel(ROBOT.with_value(K1, stiffness(critical * (1.0 - share))))
        state = np.r_[model.orbit[:3], 0.35 * np.array([1.0, 0.56, 0.75, 0.73, 0.26]), np.zeros(5)]
        for _ in range(30):
            state = model.flow_states(state[None], 0.0, model.period)[0]
        whole = whole_period(model)
        orbit = stability.find_orbit(whole, state, with_error=False).state
        bends.append(np.abs(orbit[3:8] - (model.reflection @ model.flow_states(orbit[None], 0.0, 0.3)[0])[3:8]).sum())
    # Distances count in 1/k.
    power = np.log(bends[1] / bends[0]) / np.log((1 / 0.98 - 1.0) / (1 / 0.995 - 1.0))
    assert power == pytest.approx(0.307, abs=0.02)


def test_variants_are_the_papers():
    robots = variant_robots(ROBOT)
    assert list(robots) == ["as built", "k2-5 = 28 N*mm/deg", "stride 1.8 cm", "module phase 180 deg"]
    assert robots["stride 1.8 cm"].gait.stride == pytest.approx(0.018)
