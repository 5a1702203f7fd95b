"""Intervals cover what they say and comparisons of equal things are rarely decided, from three trials on."""

import numpy as np
import pytest
from scipy.stats import binomtest, levene, ttest_ind, ttest_rel

from chilopod.analysis import square_root_fit
from chilopod.errors import ParameterError
from chilopod.statistics import (
    Comparison,
    Estimate,
    Interval,
    difference,
    every,
    grouped_mean,
    holm,
    increases,
    mean,
    propagated,
    ratio,
    share,
    spread_difference,
)

SIZES = pytest.mark.parametrize("n", [3, 5, 10, 20])
DRAW = {
    "normal": lambda rng, shape: rng.standard_normal(shape),
    "skewed": lambda rng, shape: 0.5 * rng.gamma(4.0, size=shape) - 2.0,
}


def assert_covers(intervals, truths):
    truths = np.broadcast_to(truths, len(intervals))
    covered = np.mean([one.low <= truth <= one.high for one, truth in zip(intervals, truths, strict=True)])
    chance = 2.0 * np.sqrt(0.05 * 0.95 / len(intervals))
    assert 0.90 - chance < covered < 0.97 + chance


def assert_rarely_decided(comparisons):
    chance = 2.0 * np.sqrt(0.05 * 0.95 / len(comparisons))
    assert np.mean([one.answer is not None for one in comparisons]) < 0.07 + chance


@SIZES
@pytest.mark.parametrize("draw", DRAW.values(), ids=DRAW)
def test_means_and_differences(n, draw):
    rng = np.random.default_rng(n)
    pairs = [(draw(rng, n), draw(rng, n)) for _ in range(1000)]
    assert_covers([mean(one).interval for one, _ in pairs], 0.0)
    for paired in (False, True):
        found = [difference(one, 3.0 * other, paired=paired) for one, other in pairs]
        assert_covers([each.interval for each in found], 0.0)
        assert_rarely_decided([each.above() for each in found])
    assert_rarely_decided([mean(one).between(0.0, 1.0) for one, _ in pairs])
    assert_rarely_decided([spread_difference(*pair).above() for pair in pairs])
    assert_rarely_decided([increases(draw(rng, (5, n))) for _ in range(300)])


@SIZES
def test_groups_whose_members_depend_on_each_other(n):
    rng = np.random.default_rng(n)
    shares, means, ratios, truths = [], [], [], rng.uniform(0.02, 0.98, 800)
    for truth in truths:
        spread = 0.3 / 0.7  # a correlation of 0.3
        reached = rng.random((n, 5)) < rng.beta(truth / spread, (1.0 - truth) / spread, (n, 1))
        shares.append(share(reached))
        often = rng.random((n, 5)) < rng.beta(4.0, 1.0, (n, 1))
        seconds = rng.gamma(9.0, 2.0, (n, 5)) + rng.normal(0.0, 2.0, (n, 1))
        means.append(grouped_mean(np.where(often, seconds, np.nan)).interval)
        ratios.append(ratio(np.where(often, seconds, 40.0).sum(axis=1), often.sum(axis=1)).interval)
    assert_covers(shares, truths)
    assert_covers(means, 18.0)
    assert_covers(ratios, (0.8 * 18.0 + 0.2 * 40.0) / 0.8)


@SIZES
@pytest.mark.parametrize("springs", [(15.0, 17.0, 21.0, 26.0, 28.0), (12.0, 19.0, 24.9)])
def test_the_point_of_a_square_root_fit(n, springs):
    """With scatter that rises with the bend, and with one spring next to the point."""
    rng, inverse, point = np.random.default_rng(n), np.repeat(1.0 / np.array(springs), n), springs[-1] + 0.1
    bends = 5.0 * np.sqrt(inverse - 1.0 / point) * (1.0 + 0.05 * rng.standard_normal((150, inverse.size)))
    assert_covers([square_root_fit(inverse, each).estimate.interval for each in bends], point)


@SIZES
def test_a_number_from_several_means(n):
    rng = np.random.default_rng(n)
    tables = np.array([1.0, 2.0, 4.0])[:, None] * (1.0 + 0.1 * rng.standard_normal((500, 3, n)))

    def of(table):
        one, two, three = table.mean(axis=1)
        return np.sqrt(one * three) / two, three / one

    found = np.array([propagated(of, table) for table in tables])
    assert_covers([each.interval for each in found[:, 0]], 1.0)
    assert_covers([each.interval for each in found[:, 1]], 4.0)
    back = [propagated(lambda table: of(table)[1], table, reciprocal=True)[0].interval for table in tables]
    assert_covers(back, 4.0)


def test_the_tests_are_scipy_s():
    rng = np.random.default_rng(0)
    one, other = rng.standard_normal(7), 1.0 + 2.0 * rng.standard_normal(5)
    for paired, theirs in ((False, ttest_ind(one, other, equal_var=False)), (True, ttest_rel(one[:5], other))):
        ours = difference(one[:5] if paired else [*one, np.nan], other, paired=paired)
        assert (ours.interval.low, ours.interval.high) == pytest.approx(theirs.confidence_interval())
        assert (ours.above().p, ours.freedom) == pytest.approx((theirs.pvalue, theirs.df))
    assert spread_difference([*one, np.nan], other).above().p == pytest.approx(levene(one, other).pvalue)


@pytest.mark.parametrize("others", [[1.0], [1.0, 2.0], 1.0])
def test_paired_trials_are_as_many(others):
    with pytest.raises(ParameterError, match=r"other: has the wrong shape .*; allowed: \(3,\)"):
        difference([1.0, 2.0, 3.0], others, paired=True)


@pytest.mark.parametrize("gap", [np.nan, np.inf])
def test_only_finite_numbers_count(gap):
    assert mean([gap, 1.0, 2.0, 6.0]) == mean([1.0, 2.0, 6.0])
    assert grouped_mean([[1.0, gap], [3.0, 5.0]]).value == 3.0


@pytest.mark.parametrize(("successes", "count"), [(0, 10), (5, 10), (10, 10), (994, 1000)])
def test_wilson_s_interval(successes, count):
    found = share(np.arange(count) < successes)
    expected = binomtest(successes, count).proportion_ci(method="wilson")
    assert (found.value, found.low, found.high) == pytest.approx((successes / count, *expected), abs=1e-12)


def test_members_that_are_alike_count_once():
    values, reached = np.random.default_rng(1).normal(0.0, 1.0, 40), np.arange(40) < 30
    once, often = grouped_mean(values[:, None]), grouped_mean(np.repeat(values[:, None], 10, axis=1))
    assert (often.value, often.error) == pytest.approx((once.value, once.error))
    alike = share(np.repeat(reached[:, None], 10, axis=1))
    assert (alike.low, alike.high) == pytest.approx((share(reached).low, share(reached).high), rel=1e-2)
    holes = np.where(np.arange(10) % 3, values[:, None], np.nan)
    assert grouped_mean(holes).value == pytest.approx(values.mean())


def test_no_scatter_decides_nothing():
    assert repr(spread_difference([1.0, 1.2], [3.0, 3.1]).above()) == repr(Comparison())  # NaN differs from itself
    for alike in ([0.1, 0.1, 0.1], [1.0, 2.0, 1.0], [1.0, 1.0 + 1e-15, 1.0 - 1e-15], [1.0], []):
        assert mean(alike).between(0.0, 5.0).answer is None
        assert difference(alike, [7.0, 8.0, 9.0]).above().answer is None
    found = Comparison()
    assert (found.words(), found.needs) == (
        "undecided (fewer than 3 different values)",
        "at least 3 different values are needed to decide",
    )
    assert difference([0.3, 0.6, 0.9], [0.1 * 3, 0.2 * 3, 0.3 * 3], paired=True).above().side is None
    assert np.isnan([share([]).value, ratio([0.0], [0.0]).value, mean([]).value]).all()
    assert share([]).above(share([True])) is None


@pytest.mark.parametrize("wrong", [[0.2, 1.0], [np.nan, 1.0, 0.0], [[1.0, 2.0]]])
def test_a_share_is_one_of_true_and_false(wrong):
    with pytest.raises(ParameterError, match=r"reached = .*: must be True or False; allowed: True, False, 1, 0"):
        share(wrong)


def test_as_many_trials_as_are_said_decide():
    asked = Estimate(0.5, 1.0 / np.sqrt(10.0), 9.0, 10).above()
    assert (asked.answer, asked.trials) == (None, 34.0)
    assert asked.needs == "about 34 trials are needed to decide"
    rng = np.random.default_rng(0)
    power = np.mean([mean(0.5 + rng.standard_normal(34)).above().answer is True for _ in range(1000)])
    assert power == pytest.approx(0.8, abs=0.04)
    assert Estimate(0.01, 0.3, 9.0, 10).above().needs == "more than 1000 trials are needed to decide"
    assert Estimate(2.0, 0.1, 9.0, 10).above().needs == ""


@pytest.mark.parametrize(
    ("value", "answer"),
    [(0.85, False), (0.89, None), (0.91, None), (0.95, True), (1.0, True), (1.09, None), (1.2, False), (np.nan, None)],
)
def test_a_mean_next_to_a_bound_is_undecided(value, answer):
    assert Estimate(value, 0.01).between(0.9, 1.1).answer is answer
    assert Estimate(1.0 / value, 0.01 / value**2, reciprocal=True).between(1.0 / 1.1, 1.0 / 0.9).answer is answer


def test_words_say_which_is_higher_and_by_how_much():
    found = [Estimate(value, 1.0).above().words() for value in (-2.1, -1.9, 2.1)]
    assert found[0] == "lower by 2.1 standard errors"
    assert found[1:] == ["undecided (lower by 1.9 standard errors)", "higher by 2.1 standard errors"]


def test_springs_of_a_fit_have_even_intervals_in_their_reciprocals():
    found = Estimate(20.0, 4.0, reciprocal=True).interval
    assert (1.0 / found.low + 1.0 / found.high) == pytest.approx(0.1)
    assert Estimate(20.0, 40.0, reciprocal=True).interval.high == np.inf


def test_what_overlaps_is_undecided():
    low, high, wide = Interval(1.0, 0.5, 1.5), Interval(3.0, 2.0, 4.0), Interval(2.0, 1.0, 3.0)
    assert (high.above(low), low.above(high), wide.above(low)) == (True, False, None)


def test_all_of_several_comparisons():
    sure, likely, unknown = Comparison(True, 0.001), Comparison(True, 0.2), Comparison()
    against = Comparison(False, 0.02)
    assert every([sure, sure]).answer is True
    assert every([sure, likely]).answer is every([sure, unknown]).answer is every([]).answer is None
    assert every([against, unknown]).answer is False
    assert every([against, sure, sure]).answer is None  # one of three so far off is no surprise
    rng = np.random.default_rng(2)
    trials = [centre + 0.01 * rng.standard_normal(5) for centre in (0.1, 0.2, 0.3)]
    assert (increases(trials).answer, increases(trials[::-1]).answer) == (True, False)
    assert increases([*trials, trials[-1] + 1e-4]).answer is increases(trials[:1]).answer is None


def test_holm_s_procedure():
    assert holm([0.01, 0.04, 0.03, 0.005]).tolist() == [True, False, False, True]
    assert holm([]).tolist() == []
