"""Orbits of systems that conserve an energy: they come in families, with a multiplier 1 besides that of the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from chilopod.errors import AnalysisError
from chilopod.stability import begin, exponents, follow, from_rhs, locate, multipliers, switch
from chilopod.stability.branches.branch import Ending
from chilopod.stability.unit_circle.crossings import SearchStatus


def pendulum(guess_period, length=1.0, time=1.0):
    def rhs(t, x):
        return [x[1] / time, -np.sin(x[0] / length) * length / time]

    return from_rhs(rhs, 2, None, guess_period=guess_period)


def period_of(swing):
    return 4.0 * float(ellipk(np.sin(swing / 2.0) ** 2))


@pytest.mark.parametrize(("length", "time"), [(1.0, 1.0), (1e9, 1e-6), (1e-9, 1e6)])
@pytest.mark.parametrize("swing", [0.01, 0.5, 2.0, 3.0])
def test_pendulum(swing, length, time):
    """The multiplier 1 is double and defective: the period depends on the swing."""
    found = multipliers(pendulum(1.01 * period_of(swing) * time, length, time), [swing * length, 0.0])
    angle, speed = found.orbit / length
    swung = np.arccos(np.cos(angle) - 0.5 * speed**2)
    assert found.period / time == pytest.approx(period_of(swung), rel=1e-11)
    assert abs(found.values[0] - 1.0) <= found.error_bound < 1e-3
    assert not found.stable


def test_exponent_of_the_pendulum():
    found = exponents(pendulum(8.4), [2.0, 0.0])
    np.testing.assert_allclose(found.values, [0.0], atol=1e-10)


def henon_heiles(guess_period, strength=1.0, units=(1.0, 1.0)):
    length, time = units

    def rhs(t, s, strength):
        x, y, u, v = s[0] / length, s[1] / length, s[2] / length, s[3] / length
        forces = [-x - 2.0 * strength * x * y, -y - strength * (x * x - y * y)]
        return [u * length / time, v * length / time, forces[0] * length / time, forces[1] * length / time]

    return from_rhs(rhs, 4, None, args=(strength,), guess_period=guess_period * time)


@pytest.mark.parametrize("units", [(1.0, 1.0), (1e9, 1e-6), (1e-9, 1e6)])
@pytest.mark.parametrize("height", [0.2, 0.4, 0.7, 0.95])
def test_henon_heiles_on_its_axis(height, units):
    """y'' = -y + y^2 alone, and across it Hill's equation x'' = -(1 + 2 y) x, whose trace is found by scipy."""
    length, time = units
    found = multipliers(henon_heiles(6.5 if height < 0.5 else 8.0, units=units), [0.0, height * length, 0.0, 0.0])
    start = found.orbit / length
    np.testing.assert_allclose(start[[0, 2]], 0.0, atol=1e-9)

    def with_hill(t, s):
        y, v, *hill = s
        x, u = np.array(hill[:2]), np.array(hill[2:])
        return [v, -y + y * y, *u, *(-(1.0 + 2.0 * y) * x)]

    period = found.period / time
    end = solve_ivp(
        with_hill, (0.0, period), [start[1], start[3], 1.0, 0.0, 0.0, 1.0], "DOP853", rtol=1e-12, atol=1e-13
    )
    np.testing.assert_allclose(end.y[:2, -1], start[[1, 3]], atol=1e-8)
    trace = end.y[2, -1] + end.y[5, -1]
    # Without that of the motion: 1, for the energy, and the pair across.
    assert found.values.sum().real == pytest.approx(1.0 + trace, abs=1e-7)
    assert np.abs(found.values - 1.0).min() <= found.error_bound < 1e-6
    assert not found.stable


def test_a_family_of_very_unstable_orbits_without_sizes_of_its_states():
    """x'' + x + x^3 = 0 beside the saddle y'' = 1.96 y - y^2, whose return is linear within a hundredth only: its
    parameter, which is rounding, shows no orbit again."""

    def family(value):
        def rhs(t, x):
            a, b = x[0] + x[0] ** 3, x[2] * x[2] - 1.96 * x[2]
            return [x[1] + value * a, value * x[1] - a, x[3] + value * b, value * x[3] - b]

        return from_rhs(rhs, 4, None, guess_period=6.0)

    branch = follow(family, begin(family, 0.0, [0.5, 0.0, 0.0, 0.0]), (-0.1, 0.1), points=24)
    amplitudes, periods = np.array([(abs(point.orbit[0]), point.period) for point in branch.points]).T
    assert len(periods) == 25
    assert amplitudes[-1] > 2.0
    exact = 4.0 * ellipk(amplitudes**2 / (2.0 + 2.0 * amplitudes**2)) / np.sqrt(1.0 + amplitudes**2)
    np.testing.assert_allclose(periods, exact, rtol=1e-10)


def test_searches_end():
    """Stronger and stronger coupling is the same orbit at higher energies."""
    found = locate(
        lambda strength: henon_heiles(6.5, strength), (0.5, 1.5), orbit=[0.0, 0.4, 0.0, 0.0], normal_form=False
    )
    assert found.status is SearchStatus.CONSERVATIVE
    assert len(found) == 0
    assert any("+1 throughout" in remark for remark in found.remarks)


def by_energy(value):
    """Hénon & Heiles (1964), with the gradient of their energy times a parameter."""

    def rhs(t, s):
        gx, gy = s[0] + 2.0 * s[0] * s[1], s[1] + s[0] ** 2 - s[1] ** 2
        return [s[2] + value * gx, s[3] + value * gy, value * s[2] - gx, value * s[3] - gy]

    return from_rhs(rhs, 4, None, guess_period=8.0)


def test_branches_leave_collisions_of_a_family_by_energy():
    """The orbit along an axis: across it states are rounding, and orbits of the family with other periods are near."""
    branch = follow(by_energy, begin(by_energy, 0.0, [0.0, -0.42, 0.0, 0.0], rising=False), (-0.1, 0.1), points=15)
    for point, times in zip(branch.special_points[:3], (2, 2, 1), strict=True):
        for start in switch(by_energy, point):
            left = follow(by_energy, start, (-0.1, 0.1), points=1, closely=False)
            assert left.ending is Ending.ENOUGH_POINTS
            assert left.periods == times
            assert left.points[-1].period == pytest.approx(times * point.period, rel=1e-3)
            assert np.abs(left.points[-1].orbit[[0, 2]]).max() > 1e-6  # across the axis
            for each in left.points:
                rhs = lambda t, s: by_energy(0.0).velocity(s)  # noqa: E731
                end = solve_ivp(rhs, (0.0, each.period), each.orbit, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
                np.testing.assert_allclose(end, each.orbit, atol=1e-9)
    with pytest.raises(AnalysisError, match=r"does not close"):
        follow(by_energy, replace(start, orbit=point.orbit + 0.01 * np.eye(4)[0]), (-0.1, 0.1), points=1)


def test_units_of_a_family_that_begins_at_a_tiny_orbit_are_renewed():
    """Two states of the second normal mode are quadratic in its amplitude, so fixed units suit tiny orbits only."""

    def gradient(x, y):
        return x + 1.4 * x * y + 0.25 * y * y + 1.2 * x**3, 1.8 * y + 0.7 * x * x + 0.5 * x * y + y**3

    def family(value):
        def rhs(t, s):
            gx, gy = gradient(s[0], s[1])
            return [s[2] + value * gx, s[3] + value * gy, value * s[2] - gx, value * s[3] - gy]

        return from_rhs(rhs, 4, None, guess_period=5.0)

    start = begin(family, 0.0, [0.3, 0.0, 0.0, 0.0], rising=False)
    assert np.abs(start.orbit).max() < 1e-4
    branch = follow(family, start, (-0.1, 0.1), points=105, closely=False)
    x, y, vx, vy = branch.points[-1].orbit
    potential = 0.5 * x * x + 0.9 * y * y + 0.7 * x * x * y + 0.25 * x * y * y + 0.3 * x**4 + 0.25 * y**4
    assert 0.5 * (vx * vx + vy * vy) + potential > 0.005  # fixed units end at 0.0032281
    assert (np.abs(branch.points[-1].orbit) < 1e3 * branch.units[:-1]).all()
    continued = follow(family, branch, (-0.1, 0.1), points=1, closely=False)
    np.testing.assert_array_equal(continued.units, branch.units)
