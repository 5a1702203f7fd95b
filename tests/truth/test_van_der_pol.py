"""Van der Pol's oscillator: period and multiplier, from almost harmonic to relaxation oscillations.

By Liouville's formula the multiplier is exp of the integral of mu (1 - x^2) over the orbit. Its digits below are those
of a Taylor integration in extended precision (64 bits of mantissa) with that integral as a third state.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chilopod.stability import exponents, find_orbit, from_rhs, locate, multipliers
from helpers.systems import van_der_pol

# mu, period, largest x, logarithm of the multiplier
KNOWN = [
    (0.1, 6.287111272288726793, 2.0001039798727959, -0.62910392102601957),
    (0.5, 6.3806758017735862865, 2.0024879304471084, -3.2396674744742780782),
    (1.0, 6.663286859323130182, 2.0086198608748431, -7.0589328087989591486),
    (2.0, 7.629874479674841635, 2.0198913846671360, -18.178637479168041097),
    (3.0, 8.859095499719917152, 2.0233041416822143, -34.89695595220119642),
    (5.0, 11.612230667719570035, 2.0215080615623213, -85.45201854488354043),
    (10.0, 19.078369566939014174, 2.0142853609264053, -311.84421928622802156),
]
UNITS = [(1.0, 1.0), (1e9, 1e-9), (1e-9, 1e9), (1e-7, 1e-7)]


def oscillator(mu, guess_period, units=(1.0, 1.0)):
    return from_rhs(van_der_pol, 2, None, args=(mu, *units), guess_period=guess_period)


@pytest.mark.parametrize(("mu", "period", "peak", "log"), KNOWN)
def test_digits_by_scipy(mu, period, peak, log):
    """The printed digits are not the only witness."""

    def with_liouville(t, x):
        return [x[1], mu * (1.0 - x[0] * x[0]) * x[1] - x[0], mu * (1.0 - x[0] * x[0])]

    found = solve_ivp(with_liouville, (0.0, period), [peak, 0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(found, [peak, 0.0, log], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize(("mu", "period", "peak", "log"), KNOWN)
def test_multiplier_and_period_in_any_units(mu, period, peak, log, units):
    found = exponents(oscillator(mu, round(period, 1), units), np.array([peak, 0.0]) * units)
    assert found.multipliers.period == pytest.approx(period, rel=1e-13)
    assert found.values.shape == (1,)
    assert found.values[0] * period == pytest.approx(log, rel=1e-9)
    assert abs(found.values[0] - log / period) <= found.error_bound[0] < 1e-6
    assert abs(found.multipliers.values[0] - np.exp(log)) <= found.multipliers.error_bound < 1e-9
    assert found.multipliers.stable
    u, v = found.multipliers.orbit / units
    assert abs(u) < peak + 1e-12
    assert (u, v) == pytest.approx((peak, 0.0)) or mu >= 5.0  # of relaxation oscillations it may be another state


@pytest.mark.parametrize("guess", [(2.0, 0.0), (0.1, 0.1), (5.0, 5.0), (0.0, -3.0), (-1.0, 0.3)])
@pytest.mark.parametrize(("mu", "period", "factor"), [(0.5, KNOWN[1][1], 0.8), (5.0, KNOWN[5][1], 1.0)])
def test_bad_guesses(mu, period, factor, guess):
    assert find_orbit(oscillator(mu, factor * period), guess).period == pytest.approx(period, rel=1e-13)


def test_no_bifurcation_on_the_way_to_relaxation():
    found = locate(lambda mu: oscillator(mu, 6.4), (0.5, 5.0), orbit=[2.0, 0.0])
    assert len(found) == 0
    assert found.complete


def test_a_family_of_circles_at_the_harmonic_end():
    """mu = 0: every state is on an orbit, and the other multiplier is 1 as well."""
    found = multipliers(oscillator(0.0, 6.0), [2.0, 0.0])
    assert found.period == pytest.approx(2.0 * np.pi, rel=1e-14)
    assert abs(found.values[0] - 1.0) <= found.error_bound < 1e-12
    assert not found.stable
