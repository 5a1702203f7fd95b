"""Points where a period doubling or a pitchfork turns from super- to subcritical, and the folds that leave them.

On a' = P a + Q a^3 + G a^5, and on the map a -> s (a + P a + Q a^3 + G a^5), folds of what branches off at P = 0 lie at
P = Q^2 / (4 G), whatever the coordinates.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from chilopod.stability import (
    BifurcationPoint,
    CodimensionTwo,
    Kind,
    follow,
    follow2,
    from_rhs,
    locate,
    switch,
    switch2,
)
from helpers.systems import of_map

FIFTH = -0.8
BOX = ((-0.3, 0.6), (-0.6, 0.8))


def unfolded(p, q):
    """P and Q."""
    return p - 0.2 - 0.5 * q + 0.3 * q * q, q - 0.1 + 0.4 * p * p


def check_fold(curve, units=(1.0, 1.0)):
    """A curve lies where folds do within its bounds, and goes away from the point that it leaves."""
    big, small = np.array([unfolded(*(point.values / units)) for point in curve.points]).T
    bounds = np.array([(point.error_bound / units).sum() for point in curve.points])
    assert (np.abs(big - small**2 / (4.0 * FIFTH)) <= bounds).all()
    assert bounds.max() < 1e-11
    assert (np.diff(small) > 0.0).all()
    assert 0.0 < small[0] < 0.2


def sheared(sign, units, basis, orbit):
    """The map on a, and b -> b / 2 + 0.3 a^2 beside it, in sheared and slanted coordinates and other units."""
    inverse, units = np.linalg.inv(basis), np.asarray(units)

    def family2(p, q, of=(1.0, 1.0)):
        large, small = unfolded(p / of[0], q / of[1])

        def image(states):
            u = (states / units - orbit) @ inverse.T
            b = u[..., 1] - 0.5 * u[..., 0] ** 2
            a = u[..., 0] - 0.4 * b**2
            b = u[..., 1] - 0.5 * u[..., 0] ** 2
            a, b = sign * (a + large * a + small * a**3 + FIFTH * a**5), 0.5 * b + 0.3 * a**2
            first = a + 0.4 * b**2
            return (np.stack([first, b + 0.5 * first**2], axis=-1) @ basis.T + orbit) * units

        def slopes(x):
            steps = 1e-30j * np.diag(units)
            return (image(x + steps).imag / (1e-30 * units[:, None])).T

        known = {"orbit": orbit * units} if sign > 0.0 else {}
        error = 3e-15 * units[:, None] / units
        return of_map(lambda x: (image(x), slopes(x)), 2, error, many=True, **known)

    return family2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("units", "of"), [((1.0, 1.0), (1.0, 1.0)), ((1e-6, 1e6), (1e-6, 1e6)), ((1e6, 1e6), (1e6, 1e-6))]
)
def test_maps_in_any_units_and_coordinates(sign, units, of):
    basis, orbit = np.array([[1.1, 0.4], [-0.5, 0.8]]), np.array([0.3, -0.7])
    plain = sheared(sign, units, basis, orbit)

    def family2(p, q):
        return plain(p, q, of)

    kind = Kind.PERIOD_DOUBLING if sign < 0.0 else Kind.PITCHFORK
    box = tuple((low * unit, high * unit) for (low, high), unit in zip(BOX, of, strict=True))
    start = BifurcationPoint(kind, 0.2 * of[0], 0.0, orbit * units, np.ones(2, complex), complex(sign), 0.0)
    (point,) = follow2(family2, start, box, second=0.0, longest=0.1).special
    large, small = unfolded(*(point.values / of))
    assert abs(large) + abs(small) <= 2.0 * (point.error_bound / of).sum() < 1e-7
    returns = 2.0 if sign < 0.0 else 1.0
    expected = returns * FIFTH / np.linalg.norm(basis[:, 0] * units) ** 4
    assert abs(point.next_coefficient - expected) <= point.next_coefficient_error < 1e-4 * abs(expected)
    starts = switch2(family2, point, box)
    assert len(starts) == (1 if sign < 0.0 else 2)
    for each in starts:
        curve = follow2(family2, each, box, points=8, coefficients=False)
        assert curve.periods == each.periods == int(returns)
        check_fold(curve, of)


def half_period_symmetric(p, q):
    """The flow on a, and b' = a^3 / 2 - 2 b beside it, about a forced motion, in coordinates that change in time."""
    large, small = unfolded(p, q)

    def rhs(t, z):
        c, s = np.cos(np.pi * t), np.sin(np.pi * t)
        a = z[0] - 0.7 * c
        b = z[1] - 0.7 * s - 0.6 * c * a * a
        slope = large * a + small * a**3 + FIFTH * a**5
        other = 0.5 * a**3 - 2.0 * b + 1.2 * c * a * slope - 0.6 * np.pi * s * a * a
        return [slope - 0.7 * np.pi * s, other + 0.7 * np.pi * c]

    return from_rhs(rhs, 2, 2.0, symmetry=-np.eye(2))


def test_pitchfork_of_a_half_period_map():
    (start,) = locate(lambda p: half_period_symmetric(p, 0.0), BOX[0], orbit=[0.7, 0.0], normal_form=False)
    (point,) = follow2(half_period_symmetric, start, BOX, second=0.0).special
    assert point.kind is CodimensionTwo.DEGENERATE_PITCHFORK
    # Over two units of time; the mode at time 0 is along a.
    assert abs(point.next_coefficient - 2.0 * FIFTH) <= point.next_coefficient_error < 1e-4
    for each in switch2(half_period_symmetric, point, BOX):
        check_fold(follow2(half_period_symmetric, each, BOX, points=8, coefficients=False))


def moebius(p, q):
    """The flow on a, in a strip that has turned over when it has gone round once, in 2 pi."""
    large, small = unfolded(p, q)

    def rhs(t, x):
        r = np.sqrt(x[0] * x[0] + x[1] * x[1])
        cosine, sine = x[0] / r, x[1] / r
        cc, ss, sc = 0.5 * (1.0 + cosine), 0.5 * (1.0 - cosine), 0.5 * sine
        ac, a_s = cc * (r - 1.0) + sc * x[2], sc * (r - 1.0) + ss * x[2]
        square = (r - 1.0) * ac + x[2] * a_s
        grows = large + small * square + FIFTH * square * square + 0.6
        out, up = grows * ac - 0.6 * (r - 1.0) - 0.5 * x[2], grows * a_s - 0.6 * x[2] + 0.5 * (r - 1.0)
        return [out * cosine - x[1], out * sine + x[0], up]

    return from_rhs(rhs, 3, None, guess_period=6.2)


def test_doubling_of_a_cycle_of_an_autonomous_system():
    start = BifurcationPoint(
        Kind.PERIOD_DOUBLING, 0.2, 0.0, np.array([1.0, 0.0, 0.0]), np.ones(3, complex), -1.0 + 0j, 0.5
    )
    box = ((0.1, 0.4), (-0.1, 0.3))
    (point,) = follow2(moebius, start, box, second=0.0, rising=True, longest=0.2).special
    expected = 4.0 * np.pi * FIFTH
    assert abs(point.next_coefficient - expected) <= point.next_coefficient_error < 1e-3
    (leaving,) = switch2(moebius, point, box)
    check_fold(follow2(moebius, leaving, box, points=3, coefficients=False))


def helmholtz(force, rate):
    """x'' + 0.15 x' + x + x^2 = F cos(w t), in units of w t."""
    return from_rhs(
        lambda t, x: [x[1] / rate, (-0.15 * x[1] - x[0] - x[0] ** 2 + force * np.cos(t)) / rate], 2, 2.0 * np.pi
    )


def test_helmholtz_oscillator_against_other_ways_to_the_same_folds():
    """A branch of doubled orbits at one rate folds there, and so finds another integrator."""
    box = ((0.3, 0.6), (1.1, 1.7))
    (start,) = locate(lambda force: helmholtz(force, 1.6), (0.3, 0.6), orbit=[0.0, 0.0], normal_form=False)
    (point,) = follow2(helmholtz, start, box, second=1.6, rising=False, longest=0.1).special
    assert point.kind is CodimensionTwo.GENERALISED_PERIOD_DOUBLING
    # The multiplier of the simple orbit over the fourth power of the fold's amplitude, extrapolated: 14.83456.
    assert abs(point.next_coefficient - 14.83456) <= 1e-5 + point.next_coefficient_error < 1e-3
    (leaving,) = switch2(helmholtz, point, box)
    fold = follow2(helmholtz, leaving, box, points=10, coefficients=False).points[-1]
    force, rate = fold.values

    def family(force):
        return helmholtz(force, rate)

    (doubling,) = locate(family, (0.3, 0.45), orbit=[0.0, 0.0], normal_form=False)
    (branch,) = (follow(family, one, (0.3, 0.6), points=12) for one in switch(family, doubling))
    (met,) = (one for one in branch.special_points if one.special is Kind.FOLD)
    assert abs(met.value - force) <= met.bifurcation.error_bound + fold.error_bound[0] < 1e-11

    def residual(unknown):
        def rhs(t, z):
            slope = (-0.15 * z[1] - z[0] - z[0] ** 2 + unknown[2] * np.cos(t)) / rate
            matrix = np.array([[0.0, 1.0], [-1.0 - 2.0 * z[0], -0.15]]) / rate
            return np.concatenate([[z[1] / rate, slope], (matrix @ z[2:].reshape(2, 2)).ravel()])

        begin = np.concatenate([unknown[:2], [1.0, 0.0, 0.0, 1.0]])
        end = solve_ivp(rhs, (0.0, 4.0 * np.pi), begin, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        return [*(end[:2] - unknown[:2]), np.linalg.det(end[2:].reshape(2, 2) - np.eye(2))]

    assert fsolve(residual, [*(1.002 * fold.orbit), 1.001 * force], xtol=1e-11)[2] == pytest.approx(force, abs=1e-8)
