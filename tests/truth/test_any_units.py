"""The same systems in random units of every state, of time and of the parameter: the same digits throughout."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chilopod.stability import exponents, from_rhs, locate, multipliers
from helpers.systems import roessler_rhs

decades = st.integers(-9, 9).map(lambda n: 10.0**n)
times = st.integers(-6, 6).map(lambda n: 10.0**n)
few = settings(max_examples=8, deadline=None, derandomize=True)

# First period doubling in c and its period, by a Taylor integration in extended precision; a of b_1 and a_1 at q = 0.3.
ROESSLER = 2.832445027862538915, 5.7698200165065631905
MATHIEU = 0.6891659356138624, 1.2883236383268328


def in_units(rhs):
    """x' = rhs(t, x, p) with the units of time and of every state as further arguments, so that it is compiled once."""

    def scaled(t, x, parameter, time, *units):
        slopes = rhs(t / time, [each / unit for each, unit in zip(x, units, strict=True)], parameter)
        return [slope * unit / time for slope, unit in zip(slopes, units, strict=True)]

    return scaled


def duffing(t, x, force):
    """x'' + 0.1 x' - x + x^3 = force cos 1.2 t, about one of its wells."""
    return [x[1], -0.1 * x[1] + x[0] - x[0] * x[0] * x[0] + force * np.cos(1.2 * t)]


def mathieu(t, y, a):
    return [y[1], -(a - 0.6 * np.cos(2.0 * t)) * y[0]]


SCALED = {rhs: in_units(rhs) for rhs in (duffing, roessler_rhs, mathieu)}


def forced(states=(1.0, 1.0), time=1.0):
    return from_rhs(SCALED[duffing], 2, 2.0 * np.pi / 1.2 * time, args=(0.1, time, *states))


@few
@given(st.tuples(decades, decades), times)
def test_forced(states, time):
    plain = multipliers(forced(), [1.0, 0.0])  # there is no closed form: plain units are the reference
    found = exponents(forced(states, time), np.array([1.0, 0.0]) * states)
    np.testing.assert_allclose(found.multipliers.orbit / states, plain.orbit, rtol=1e-11)
    np.testing.assert_allclose(found.multipliers.values, plain.values, rtol=1e-11)
    assert found.multipliers.error_bound < 1e-10
    np.testing.assert_allclose(np.exp(found.values * found.multipliers.period), plain.values, rtol=1e-11)


@few
@given(st.tuples(decades, decades, decades), times, decades)
def test_autonomous(states, time, parameter):
    (point,) = locate(
        lambda c: from_rhs(SCALED[roessler_rhs], 3, None, args=(c / parameter, time, *states), guess_period=5.8 * time),
        (2.5 * parameter, 3.2 * parameter),
        orbit=np.array([3.0, 0.0, 0.1]) * states,
        normal_form=False,
    )
    assert abs(point.value / parameter - ROESSLER[0]) <= point.error_bound / parameter < 1e-10
    assert point.period / time == pytest.approx(ROESSLER[1], rel=1e-10)


@few
@given(st.tuples(decades, decades), times, decades)
def test_conservative(states, time, parameter):
    found = locate(
        lambda a: from_rhs(SCALED[mathieu], 2, np.pi * time, args=(a / parameter, time, *states), orbit=[0.0, 0.0]),
        (0.2 * parameter, 1.9 * parameter),
    )
    assert len(found) == 2
    for point, value in zip(found, MATHIEU, strict=True):
        assert abs(point.value / parameter - value) <= point.error_bound / parameter + 4e-15 < 1e-12
