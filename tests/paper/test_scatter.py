"""What scatter leaves open: both sides of every bound, and how often a difference that is not there is seen."""

import numpy as np
import pytest

from chilopod.paper.scatter import (
    Difference,
    between,
    difference,
    drawn_anew,
    every,
    increases,
    mean_and_error,
    spread_difference,
)


@pytest.mark.parametrize(
    ("value", "lower", "higher"), [(-2.1, True, False), (-1.9, None, None), (1.9, None, None), (2.1, False, True)]
)
def test_two_standard_errors_tell_means_apart(value, lower, higher):
    found = Difference(0.3 * value, 0.3)
    assert (found.lower, found.higher) == (lower, higher)
    assert (
        str(found)
        == {
            -2.1: "lower by 2.1 standard errors",
            -1.9: "undecided (lower by 1.9 standard errors)",
            1.9: "undecided (higher by 1.9 standard errors)",
            2.1: "higher by 2.1 standard errors",
        }[value]
    )


def test_without_scatter_any_difference_counts_and_without_an_error_none():
    assert Difference(-1e-9, 0.0).lower is True
    assert Difference(0.0, 0.0).lower is None
    assert Difference(-1.0, np.nan).lower is None
    assert Difference(np.nan, 0.1).lower is None
    assert (str(Difference(-1.0, 0.0)), str(Difference(-1.0, np.nan))) == ("lower", "undecided")


def test_the_error_of_a_difference():
    one, other = np.array([1.0, 2.0, 3.0]), np.array([2.0, 3.0, 4.5, np.nan])
    found = difference(one, other)
    assert found.value == pytest.approx(2.0 - 9.5 / 3.0)
    assert found.error == pytest.approx(np.sqrt(one.var(ddof=1) / 3.0 + other[:3].var(ddof=1) / 3.0))
    # Seed by seed the scatter that both share does not count.
    paired = difference(one, other[:3], paired=True)
    assert paired.value == pytest.approx(found.value)
    assert paired.error == pytest.approx((one - other[:3]).std(ddof=1) / np.sqrt(3.0))
    assert (found.lower, paired.lower) == (None, True)
    assert np.isnan(difference([1.0], [2.0, 3.0]).error)
    assert mean_and_error([1.0, np.nan])[0] == 1.0
    assert np.isnan(mean_and_error([])).all()


def test_a_difference_that_is_not_there_is_rarely_seen():
    rng = np.random.default_rng(0)
    seen = [difference(*rng.standard_normal((2, 10))).lower for _ in range(1000)]
    assert np.mean([each is not None for each in seen]) == pytest.approx(0.05, abs=0.03)


@pytest.mark.parametrize(("ratio", "answer"), [(2.0, True), (1.0, None), (0.5, False)])
def test_trials_that_scatter_farther(ratio, answer):
    rng = np.random.default_rng(1)
    one, other = ratio * rng.standard_normal(40) + 5.0, rng.standard_normal(40)
    assert spread_difference(one, other).higher is answer


@pytest.mark.parametrize(
    ("value", "answer"),
    [(0.85, False), (0.89, None), (0.91, None), (0.95, True), (1.0, True), (1.09, None), (1.2, False)],
)
def test_a_mean_next_to_its_bound_is_undecided(value, answer):
    assert between(value, 0.01, 0.9, 1.1) is answer
    assert between(10.0 * value, 0.1, 9.0, 11.0) is answer


def test_bounds_without_scatter_are_sharp():
    assert between(1.0, 0.0, 0.0, 1.0) is True
    assert between(1.0 + 1e-9, 0.0, 0.0, 1.0) is False
    assert between(0.5, np.nan, 0.0, 1.0) is None
    assert between(np.nan, 0.1, 0.0, 1.0) is False
    assert between(np.inf, 0.1, 0.0, 1.0) is False


def test_all_of_several_answers():
    assert every([True, True]) is True
    assert every([True, None]) is None
    assert every([None, False]) is False


def test_means_that_rise():
    rng = np.random.default_rng(2)
    trials = [mean + 0.01 * rng.standard_normal(5) for mean in (0.1, 0.2, 0.3)]
    assert increases(trials) is True
    assert increases(trials[::-1]) is False
    assert increases([*trials, trials[-1] + 1e-4]) is None
    assert increases(trials[:1]) is None


def test_drawing_anew_keeps_means_and_scatter():
    rng = np.random.default_rng(3)
    trials = np.array([[1.0, 2.0, 4.0, np.nan], [5.0, np.nan, np.nan, np.nan]])
    drawn = np.array([drawn_anew(trials, rng) for _ in range(4000)])
    assert (np.isnan(drawn) == np.isnan(trials)).all()
    assert (drawn[:, 1, 0] == 5.0).all()
    means = drawn[:, 0, :3].mean(axis=1)
    mean, error = mean_and_error(trials[0])
    assert means.mean() == pytest.approx(mean, abs=0.05)
    assert means.std() == pytest.approx(error, rel=0.05)
