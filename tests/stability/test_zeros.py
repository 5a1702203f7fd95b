"""Zeros of functions whose zeros are known."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jn_zeros, jv

from chilopod.stability.zeros import find_zeros, signed_log


def zeros(function, low, high):
    return [
        a if a == b else brentq(lambda v: function(np.array([v]))[0], a, b, xtol=1e-300, rtol=1e-14)
        for a, b in find_zeros(signed_log(function), low, high).changes
    ]


def test_all_zeros_of_an_oscillating_function():
    expected = jn_zeros(0, 20)
    assert zeros(lambda x: jv(0, x), 0.0, expected[-1] + 1.0) == pytest.approx(list(expected), rel=1e-12)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_two_that_lie_close_together(gap):
    assert zeros(lambda x: (x - 0.3) * (x - 0.3 - gap), 0.0, 1.0) == pytest.approx([0.3, 0.3 + gap], abs=1e-9)


def test_a_touch_is_no_change_of_sign_and_a_miss_is_none():
    assert zeros(lambda x: (x - 0.3) ** 2, 0.0, 1.0) == []
    assert zeros(lambda x: (x - 0.3) ** 2 + 1e-6, 0.0, 1.0) == []
    assert zeros(lambda x: np.exp(x), -1.0, 1.0) == []


def test_zeros_at_the_ends_and_at_nodes():
    assert zeros(lambda x: x * (x - 0.5), -1.0, 1.0) == pytest.approx([0.0, 0.5], abs=1e-12)


def test_a_narrow_bump_of_many_decades():
    found = zeros(lambda x: np.tanh(200.0 * (x - 0.7)), 0.0, 1.0)
    assert found == pytest.approx([0.7], abs=1e-12)


def test_nothing_is_asked_outside_the_interval():
    asked = []

    def function(x):
        asked.extend(x.tolist())
        return np.sqrt(x) - 0.5

    assert zeros(function, 0.0, 1.0) == pytest.approx([0.25])
    assert min(asked) >= 0.0
    assert max(asked) <= 1.0
