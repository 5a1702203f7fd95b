"""Intervals of shares and means: known values."""

import numpy as np
import pytest
from scipy.stats import binomtest, norm

from chilopod.paper.courses.statistics import Interval, bootstrap_mean, wilson


@pytest.mark.parametrize(("successes", "count"), [(0, 10), (5, 10), (10, 10), (994, 1000)])
def test_wilson_s_interval(successes, count):
    found = wilson(successes, count)
    expected = binomtest(successes, count).proportion_ci(method="wilson")
    assert (found.value, found.low, found.high) == pytest.approx((successes / count, *expected), abs=1e-12)


def test_no_trials_say_nothing():
    assert np.isnan(wilson(0, 0).value)
    assert np.isnan(bootstrap_mean([np.nan, np.nan]).low)
    assert wilson(0, 0).above(wilson(5, 10)) is None


def test_the_bootstrap_of_normal_numbers():
    values = np.random.default_rng(1).normal(3.0, 2.0, 2000)
    found, half = bootstrap_mean(values), norm.ppf(0.975) * values.std(ddof=1) / np.sqrt(values.size)
    assert found.value == pytest.approx(values.mean())
    assert found.high - found.low == pytest.approx(2.0 * half, rel=0.06)
    assert found == bootstrap_mean(values)


def test_members_of_a_group_are_drawn_together():
    """Ten times the same number says no more than once."""
    values = np.random.default_rng(1).normal(0.0, 1.0, 400)
    once, often = bootstrap_mean(values), bootstrap_mean(np.repeat(values[:, None], 10, axis=1))
    assert (often.value, often.low, often.high) == pytest.approx((once.value, once.low, once.high))
    holes = np.where(np.arange(10) % 3, values[:, None], np.nan)
    assert bootstrap_mean(holes).value == pytest.approx(values.mean())


def test_what_overlaps_is_undecided():
    low, high, wide = Interval(1.0, 0.5, 1.5), Interval(3.0, 2.0, 4.0), Interval(2.0, 1.0, 3.0)
    assert (high.above(low), low.above(high), wide.above(low)) == (True, False, None)
    assert (low.sign, Interval(0.1, -0.1, 0.3).sign, Interval(-1.0, -2.0, -0.5).sign) == (True, None, False)
