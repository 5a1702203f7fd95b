"""The same systems in random units of every state, of time and of the parameter: the same digits throughout."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chilopod.stability import exponents, from_rhs, locate, multipliers
from helpers.systems import in_units, roessler_rhs

decades = st.integers(-9, 9).map(lambda n: 10.0**n)
times = st.integers(-6, 6).map(lambda n: 10.0**n)
few = settings(max_examples=8, deadline=None, derandomize=True)

# First period doubling in c and its period, by a Taylor integration in extended precision; a of b_1 and a_1 at q = 0.3.
ROESSLER = 2.832445027862538915, 5.7698200165065631905
MATHIEU = 0.6891659356138624, 1.2883236383268328


def duffing(t, x, force):
    """x'' + 0.1 x' - x + x^3 = force cos 1.2 t, about one of its wells."""
    return [x[1], -0.1 * x[1] + x[0] - x[0] * x[0] * x[0] + force * np.cos(1.2 * t)]


def forced(states=(1.0, 1.0), time=1.0, parameter=1.0):
    rhs = in_units(duffing, states, time)
    return lambda force: from_rhs(rhs, 2, 2.0 * np.pi / 1.2 * time, args=(force / parameter,))


@few
@given(st.tuples(decades, decades), times)
def test_forced(states, time):
    plain = multipliers(forced()(0.1), [1.0, 0.0])  # there is no closed form: plain units are the reference
    found = exponents(forced(states, time)(0.1), np.array([1.0, 0.0]) * states)
    np.testing.assert_allclose(found.multipliers.orbit / states, plain.orbit, rtol=1e-11)
    np.testing.assert_allclose(found.multipliers.values, plain.values, rtol=1e-11)
    assert found.multipliers.error_bound < 1e-10
    np.testing.assert_allclose(np.exp(found.values * found.multipliers.period), plain.values, rtol=1e-11)


@few
@given(st.tuples(decades, decades, decades), times, decades)
def test_autonomous(states, time, parameter):
    rhs = in_units(roessler_rhs, states, time)
    (point,) = locate(
        lambda c: from_rhs(rhs, 3, None, args=(c / parameter,), guess_period=5.8 * time),
        (2.5 * parameter, 3.2 * parameter),
        orbit=np.array([3.0, 0.0, 0.1]) * states,
        normal_form=False,
    )
    assert abs(point.value / parameter - ROESSLER[0]) <= point.error_bound / parameter < 1e-10
    assert point.period / time == pytest.approx(ROESSLER[1], rel=1e-10)


def mathieu(t, y, a):
    return [y[1], -(a - 0.6 * np.cos(2.0 * t)) * y[0]]


@few
@given(st.tuples(decades, decades), times, decades)
def test_conservative(states, time, parameter):
    rhs = in_units(mathieu, states, time)
    found = locate(
        lambda a: from_rhs(rhs, 2, np.pi * time, args=(a / parameter,), orbit=[0.0, 0.0]),
        (0.2 * parameter, 1.9 * parameter),
    )
    assert len(found) == 2
    for point, value in zip(found, MATHIEU, strict=True):
        assert abs(point.value / parameter - value) <= point.error_bound / parameter + 4e-15 < 1e-12
