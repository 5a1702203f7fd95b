"""Orbits of systems without a period of their own have their shortest one, whatever multiple of it was guessed."""

from math import pi

import numpy as np
import pytest

from chilopod.errors import ParameterError
from chilopod.stability import (
    Kind,
    begin,
    find_orbit,
    follow,
    follow2,
    from_rhs,
    locate,
    locate_hopf,
    multipliers,
    switch,
)

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


@pytest.mark.parametrize("turns", [1, 2, 3, 6, 8, 12, 29, 60])
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


def turning(speed):
    """A circle on which the angle's rate is speed less the cosine, and across it a pair that turns by 180 degrees a
    round, with the multipliers -exp of speed - 1.5 and of -1 over a period of 2 pi / root(speed^2 - 1)."""

    def rhs(t, state, speed):
        x, y, u, v = state
        r = np.sqrt(x * x + y * y)
        c, s, pull, cube = x / r, y / r, 3.0 * (1.0 - r * r), u * u + v * v
        half, mean, apart = 0.5 * (speed - c), 0.5 * speed - 1.25, 0.5 * speed - 0.25
        return [
            pull * x - 2.0 * half * y,
            pull * y + 2.0 * half * x,
            (mean + apart * c - cube) * u + (apart * s - half) * v,
            (apart * s + half) * u + (mean - apart * c - cube) * v,
        ]

    return from_rhs(rhs, 4, None, args=(speed,), guess_period=400.0)


@pytest.mark.parametrize("part", [0.5, 0.5001, 0.501, 0.502, 0.51, 1.0, 2.0])
def test_a_state_on_an_orbit_gives_that_orbit_by_a_guess_from_half_its_period_on(part):
    """Cycles r^2 = (1 - sqrt(0.6)) / 2, unstable, and (1 + sqrt(0.6)) / 2, of r' = r (r^2 - r^4 - 0.1)."""

    def rhs(t, x):
        rate = -0.1 + (x[0] ** 2 + x[1] ** 2) - (x[0] ** 2 + x[1] ** 2) ** 2
        return [rate * x[0] - x[1], rate * x[1] + x[0]]

    inner = 0.5 * (1.0 - np.sqrt(0.6))
    found = multipliers(from_rhs(rhs, 2, None, guess_period=part * 2.0 * pi), [np.sqrt(inner), 0.0])
    assert found.values == pytest.approx([np.exp(4.0 * pi * inner * (1.0 - 2.0 * inner))], rel=1e-9)


def test_where_the_period_falls_fast():
    """Just beside its start at infinity: within a step the second round ends where the first one was expected to."""
    branch = follow(turning, [-1.0, 0.0, 0.0, 0.0], (1.01, 3.0), closely=False, points=5)
    for point in branch.points:
        assert point.period == pytest.approx(2.0 * pi / np.sqrt(point.value**2 - 1.0), rel=1e-9)


def test_a_search_where_the_period_falls_fast():
    (doubling,) = locate(turning, (1.01, 2.0), [-1.0, 0.0, 0.0, 0.0])
    assert doubling.kind is Kind.PERIOD_DOUBLING
    assert abs(doubling.value - 1.5) <= doubling.error_bound < 1e-9
    assert doubling.period == pytest.approx(2.0 * pi / np.sqrt(1.25), rel=1e-9)


def test_beyond_an_explosion_of_cycles():
    """The canards of van der Pol's equation grow suddenly, and then their period falls."""

    def family(a):
        def rhs(t, x, a):
            return [(x[1] - x[0] ** 3 / 3.0 + x[0]) / 0.1, a - x[0]]

        return from_rhs(rhs, 2, None, args=(a,), guess_period=2.0)

    (hopf,) = locate_hopf(family, (0.9, 1.1), [0.9, -0.6])
    branch = follow(family, *switch(family, hopf), (0.9, 1.1), closely=False)
    assert branch.points[-1].period == pytest.approx(find_orbit(family(0.9), [2.0, 0.0]).period, rel=1e-9)


def test_an_orbit_of_two_rounds_ends_where_it_meets_that_of_one():
    def family(value):
        return twisted(0.3 - value, 2.0)

    start = find_orbit(family(0.15), [1.0, 0.0, 0.3, 0.0])
    assert start.period == pytest.approx(2.0 * PERIOD, rel=1e-12)
    result = locate(family, (0.15, 0.25), start.state)
    assert result.searched[1] < 0.2
    assert "another orbit meets it" in result.remarks[0]
