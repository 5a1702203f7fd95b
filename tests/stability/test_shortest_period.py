"""Orbits of systems without a period of their own have their shortest one, whatever multiple of it was guessed."""

from math import pi

import numpy as np
import pytest

from chilopod.errors import ParameterError
from chilopod.stability import begin, find_orbit, follow2, from_rhs, locate, multipliers, switch

OMEGA = 1.7
PERIOD = 2.0 * pi / OMEGA
DAMPING = 0.1


def twisted(strength, turns=1.0, damping=DAMPING):
    """A circle x^2 + y^2 = 1, and across it a pair that turns by 180 degrees a round: in its frame u' = (strength -
    damping) u and v' = -(strength + damping) v, less their cube.

    The round is an orbit, with multipliers -exp of these rates over a period; beyond strength = damping there is one
    of two rounds as well, at u^2 = strength - damping.
    """

    def rhs(t, state, strength, damping):
        x, y, p, q = state
        pull, cube = 1.0 - x * x - y * y, p * p + q * q
        half = 0.5 * OMEGA
        return [
            pull * x - OMEGA * y,
            pull * y + OMEGA * x,
            strength * (x * p + y * q) - half * q - (damping + cube) * p,
            strength * (y * p - x * q) + half * p - (damping + cube) * q,
        ]

    return from_rhs(rhs, 4, None, args=(strength, damping), guess_period=turns * PERIOD)


@pytest.mark.parametrize("turns", [1, 2, 3, 6, 8, 12])
def test_once_round(turns):
    found = multipliers(twisted(0.06, 1.01 * turns), [1.0, 0.0, 0.0, 0.0])
    assert found.period == pytest.approx(PERIOD, rel=1e-12)
    expected = [-np.exp(-0.04 * PERIOD), -np.exp(-0.16 * PERIOD), np.exp(-2.0 * PERIOD)]
    np.testing.assert_allclose(found.values, expected, atol=found.error_bound)


@pytest.mark.parametrize("turns", [2, 4, 6])
@pytest.mark.parametrize("amplitude", [0.3, 1e-3, 1e-5])
def test_twice_round(turns, amplitude):
    """However close it is to the orbit of one round."""
    found = find_orbit(twisted(DAMPING + amplitude**2, turns), [1.0, 0.0, amplitude, 0.0])
    assert found.period == pytest.approx(2.0 * PERIOD, rel=1e-12)
    assert abs(found.state[2]) == pytest.approx(amplitude, rel=1e-3)


@pytest.mark.parametrize("turns", [1.0, 2.0])
def test_a_doubling_is_found_and_left(turns):
    def family(strength):
        return twisted(strength, turns)

    (doubling,) = locate(family, (0.05, 0.2), [1.0, 0.0, 0.0, 0.0])
    assert doubling.period == pytest.approx(PERIOD, rel=1e-12)
    assert abs(doubling.value - DAMPING) <= doubling.error_bound < 1e-9
    # u -> -u exp(...) over a round: of two, (strength - damping) u - u^3 twice.
    assert doubling.coefficient == pytest.approx(-2.0 * PERIOD, rel=1e-6)
    (start,) = switch(family, doubling)
    assert start.period == pytest.approx(2.0 * PERIOD, rel=1e-12)

    # It is followed over its own period, not the guessed one, and damping moves it.
    def both(strength, damping):
        return twisted(strength, 1.2 * turns, damping)

    box = (0.05, 0.2), (0.1, 0.13)
    first, *_, last = follow2(both, doubling, box, second=DAMPING, points=3, step=0.2, longest=0.2).points
    assert first.period == pytest.approx(PERIOD, rel=1e-12)
    assert last.values[1] > 0.11
    assert last.values[0] == pytest.approx(last.values[1], abs=1e-8)


def test_periods_that_were_asked_for():
    start = begin(twisted, 0.15, [1.0, 0.0, 0.2, 0.0], periods=2)
    assert start.period == pytest.approx(2.0 * PERIOD, rel=1e-12)
    with pytest.raises(ParameterError, match="periods = 2: are more than the orbit has; allowed: 1"):
        begin(twisted, 0.15, [1.0, 0.0, 0.0, 0.0], periods=2)


@pytest.mark.parametrize(("order", "turns"), [(2, 3), (2, 5), (3, 4), (4, 5)])
def test_orbits_with_a_symmetry_in_time(order, turns):
    """A turn by 1/k of the circle takes 1/k of the period, and so do 1 + k of them, or 1 + 2 k."""
    c, s = np.cos(2.0 * pi / order), np.sin(2.0 * pi / order)
    back = np.array([[c, s], [-s, c]])

    def rhs(t, x):
        pull = 1.0 - x[0] * x[0] - x[1] * x[1]
        return [pull * x[0] - OMEGA * x[1], pull * x[1] + OMEGA * x[0]]

    system = from_rhs(rhs, 2, None, guess_period=1.02 * turns * PERIOD, symmetry=back)
    found = find_orbit(system, [1.0, 0.1])
    assert found.period == pytest.approx(PERIOD, rel=1e-12)
    assert found.image.returns == order
