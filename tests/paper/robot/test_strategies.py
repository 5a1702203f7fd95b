"""Pitchfork against Hopf: ratios by bootstrap, times over both strategies, and the sentence on the claim."""

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.paper.robot.turning import INSTANTS, compared, verdict
from chilopod.paper.turning.study import ratios
from chilopod.paper.turning.trials import strategy_tasks
from chilopod.steering import ARRIVAL_RADIUS, Target
from helpers.made_up_robot import task


def made_up(lowest, wiggle=0.1, seed=0, repeats=12, springs=(17.0, 21.0, 26.0)):
    return task(springs, 21.0, lowest, dict.fromkeys(springs, "arrived"), wiggle=wiggle, repeats=repeats, seed=seed)


def test_ratios_of_walks_that_differ_by_a_factor_have_no_scatter():
    """Seeds are drawn for both at once."""
    found = ratios(made_up({"distance": 0.2}), made_up({"distance": 0.1}))["distance"]
    np.testing.assert_allclose([found.value, found.low, found.high], 2.0, rtol=1e-12)


def test_intervals_of_ratios_have_the_width_of_independent_means():
    one, other = (made_up({}, seed=seed, repeats=200, springs=(21.0,)) for seed in (1, 2))
    found = ratios(one, other)["angle"]
    # The ratio of two means of 200 numbers with a standard deviation of 0.1 about 1.
    half = 1.96 * 0.1 * np.sqrt(2.0 / 200.0)
    assert 0.5 * (found.high - found.low) == pytest.approx(half, rel=0.15)
    assert abs(found.value - 1.0) < 2.0 * half


def test_both_strategies_are_judged_at_the_first_arrival_of_any_and_at_each_one_s_own():
    robot, target = load_robot("aoi2022-planar"), Target.parse("45 deg, 1.3 m")
    limit = np.deg2rad(4.9)
    springs = {"hopf": (5.0,), "pitchfork": (9.5, 20.0)}
    found = strategy_tasks(robot, target, springs, 2, limit=limit, duration=17.0)
    earliest = [each.criteria.attrs["earliest_arrival_s"] for each in found.values()]
    assert np.isfinite(earliest).any()
    assert {each.time for each in found.values()} == {np.nanmin(earliest)}
    for each in found.values():
        own, arrived = each.criteria.sel(instant="own"), np.isfinite(each.criteria.arrival)
        nearest = xr.where(arrived, ARRIVAL_RADIUS, each.criteria.nearest)
        np.testing.assert_allclose(own.distance, nearest, rtol=0, atol=1e-9)
        np.testing.assert_allclose(own.effort.where(arrived), each.criteria.effort_until_arrival.where(arrived))
        assert (own.effort > 0.0).all()
        assert (own.effort <= 2.0 * limit**2 * 17.0).all()


@pytest.mark.parametrize(
    ("ratio", "half", "said"),
    [(0.8, 0.1, "holds"), (0.95, 0.1, "is undecided"), (1.2, 0.1, "fails")],
)
def test_the_claim_says_what_it_hangs_on(ratio, half, said):
    data = compared({"pitchfork": made_up({}), "hopf": made_up({})}).expand_dims(limit=[5.0, 3.5])
    assert data.ratio.dims == ("limit", "instant", "criterion")
    shape = data.ratio.shape
    changed = {"ratio": ratio, "low": ratio - half, "high": ratio + half}
    data = data.assign({name: (data.ratio.dims, np.full(shape, value)) for name, value in changed.items()})
    data.high[1, 0, 0], data.low[1, 0, 0] = 3.0, 2.0  # fails with 3.5 deg at the earliest arrival
    words = verdict(data)
    assert f"{said} with legs that yaw by 5° at the {INSTANTS[0]}" in words
    assert "fails with legs that yaw by" in words
    assert words.index("3.5° at the earliest arrival") > words.index("fails")
