"""Zeros of functions whose zeros are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import jn_zeros, jv

from chilopod.stability.unit_circle.zeros import DENSE, FEW_PLACES, MORE_PLACES, PLACES, find_zeros, interpolated


def signed_log(function):
    """As find_zeros wants a function: its signs and logarithms."""

    def both(places):
        values = function(places)
        with np.errstate(divide="ignore"):
            return np.sign(values), np.log(np.abs(values))

    return both


def zeros(function, low, high):
    # Zeros near 0 to the digits of the interval, not to their own.
    within = {"xtol": 1e-16 * (high - low), "rtol": 4 * np.finfo(float).eps}
    return [
        a if a == b else brentq(lambda v: function(np.array([v]))[0], a, b, **within)
        for a, b in find_zeros(signed_log(function), low, high).changes
    ]


def test_all_zeros_of_an_oscillating_function():
    expected = jn_zeros(0, 20)
    assert zeros(lambda x: jv(0, x), 0.0, expected[-1] + 1.0) == pytest.approx(list(expected), rel=1e-12)


def test_a_touch_is_no_change_of_sign_and_a_miss_is_none():
    assert zeros(lambda x: (x - 0.3) ** 2, 0.0, 1.0) == []
    assert zeros(lambda x: (x - 0.3) ** 2 + 1e-6, 0.0, 1.0) == []
    assert zeros(lambda x: np.exp(x), -1.0, 1.0) == []


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


def test_twice_the_degree_resolves_a_smooth_function_without_a_cut():
    asked = set()

    def function(x):
        asked.update(x.tolist())
        return np.sign(np.exp(x) - 3.0), np.log(np.abs(np.exp(x) - 3.0))

    assert len(find_zeros(function, -2.0, 3.0).changes) == 1
    assert len(asked) == 19 + 2  # all places on the interval, and both ends of the doubtful part


_DYADIC = st.sampled_from([0.0, 0.125, 0.25, 0.5, 0.75, 1.0])
_NODE = st.integers(0, 8).map(lambda k: 0.5 - 0.5 * np.cos(np.pi * k / 8))
_PLACE = st.one_of(_DYADIC, _NODE, st.floats(0.0, 1.0))
_CLUSTER = st.tuples(_PLACE, st.none() | st.tuples(st.sampled_from([-1.0, 1.0]), st.floats(-9.0, -1.0)))
_SHAPES = {"polynomial": lambda x: x, "trigonometric": np.sin, "exponential": np.expm1}


@given(
    st.lists(_CLUSTER, min_size=1, max_size=3),
    st.sampled_from(sorted(_SHAPES)),
    st.integers(-12, 12),
    st.sampled_from([0.0, -0.5, 1e3, 1e6, -1e9]),
)
def test_roots_on_nodes_with_near_neighbours_in_intervals_of_any_scale(clusters, shape, decade, offset):
    scale = 10.0**decade
    low = scale * offset
    high = low + scale
    parts = [place for place, _ in clusters]
    parts += [place + side * 10.0**gap for place, beside in clusters if beside for side, gap in [beside]]
    roots = np.unique([low + (high - low) * part for part in parts if 0.0 <= part <= 1.0])
    ulp = np.spacing(np.abs([low, high]).max())
    roots = roots[np.append(True, np.diff(roots) > max(1e-9 * scale, 1e3 * ulp))]

    def function(x):
        return np.prod([_SHAPES[shape]((x - root) / scale) for root in roots], axis=0)

    assert zeros(function, low, high) == pytest.approx(list(roots), abs=1e-12 * scale + 16.0 * ulp)


def test_a_zero_on_the_border_of_two_pieces_is_found():
    for offset in (0.0, -0.5, 1e3, 1e6):
        roots = [1e3 * offset, 1e3 * offset + 500.0]
        found = zeros(lambda x, r=roots: (x - r[0]) * (x - r[1]) / 1e6, roots[0], roots[0] + 1e3)
        assert found == pytest.approx(roots)


def test_a_double_zero_is_a_touch_wherever_it_lies():
    for place in (0.3, 0.5, 0.25):
        found = find_zeros(signed_log(lambda x, p=place: np.expm1(x - p) ** 2), 0.0, 1.0)
        ((a, b),) = found.touches
        assert (a <= place <= b, found.changes, found.unresolved) == (True, (), ())
        assert b - a < 1e-6


def test_a_function_that_is_only_noise_is_no_work():
    rng = np.random.default_rng(0)
    asked = []

    def noise(x):
        asked.extend(x.tolist())
        return rng.normal(size=x.size)

    found = find_zeros(signed_log(noise), 0.0, 1.0, error=lambda x: np.full(x.size, 1.0))
    assert found.touches == ((0.0, 1.0),)
    assert len(asked) < 400


def test_the_budget_ends_a_search_and_what_was_met_is_kept():
    asked = []

    def rough(x):
        asked.extend(x.tolist())
        return x - 0.3 + 1e-3 * sum(0.9**k * np.cos(3.0**k * x) for k in range(25))

    found = find_zeros(signed_log(rough), 0.0, 1.0, left=lambda: 300 - len(asked))
    assert found.spent
    assert len(asked) < 400
    assert found.changes
    assert all(rough(np.array([a]))[0] * rough(np.array([b]))[0] < 0.0 for a, b in found.changes)


def test_holes_are_named():
    found = find_zeros(signed_log(lambda x: np.where(np.abs(x - 0.6) < 0.05, np.nan, x - 0.3)), 0.0, 1.0)
    ((a, b),) = found.missing
    assert 0.53 < a < 0.55 < 0.65 < b < 0.67
    ((a, b),) = found.changes
    assert a < 0.3 < b


def test_a_jump_is_no_smooth_function():
    found = find_zeros(signed_log(lambda x: np.where(x < 0.3, 0.1, 2.0) + x), 0.0, 1.0)
    ((a, b),) = found.unresolved
    assert a <= 0.3 <= b
    assert b - a < 1e-6
    assert found.changes == ()


@pytest.mark.parametrize(("places", "degree"), [(FEW_PLACES, 4), (PLACES, 8), (MORE_PLACES, 16)])
def test_polynomials_through_places_show_what_they_do_not_fit(places, degree):
    def polynomial(count):
        return lambda x: np.cos(count * np.arccos(np.clip(x, -1.0, 1.0)))

    lower = polynomial(degree - 2)
    _, wrong, dense = interpolated(lower(places), places)
    assert wrong < 1e-13
    assert np.abs(dense - lower(DENSE)).max() < 1e-13
    for count in (degree - 1, degree + 1, degree + 2, degree + 3):  # the error is seen, though it is no bound
        _, wrong, dense = interpolated(polynomial(count)(places), places)
        assert 4.0 * wrong > np.abs(dense - polynomial(count)(DENSE)).max()
