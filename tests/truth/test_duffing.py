"""Forced Duffing oscillator x'' + 0.2 x' + x^3 = F cos t: its symmetric orbit loses its symmetry in a pitchfork."""

from functools import cache
from math import cos, pi

import numba
import numpy as np
import pytest

from chilopod.stability import Criticality, Kind, find_orbit, from_rhs, locate, multipliers

FORCE = 2.40337711605714358988
STATE = (1.87793925257730701435, 0.63506905472679528861)
NU = (-1.0, -0.533488091091103)


@numba.njit
def compiled(t, x, force):
    return np.array([x[1], -0.2 * x[1] - x[0] * x[0] * x[0] + force * np.cos(t)])


@numba.njit
def in_units(t, x, force, size):
    return np.array([x[1], -0.2 * x[1] - x[0] * (x[0] / size) * (x[0] / size) + force * size * np.cos(t)])


def plain(t, x, force):
    return [x[1], -0.2 * x[1] - x[0] ** 3 + force * cos(t)]


def duffing(force, rhs=compiled, symmetry=((-1, 0), (0, -1))):
    return from_rhs(rhs, 2, 2 * pi, args=(force,), symmetry=symmetry)


@cache
def located(rhs):
    return locate(lambda force: duffing(force, rhs), (2.2, 2.6), orbit=[1.88, 0.64])


@pytest.mark.parametrize("rhs", [compiled, plain], ids=["compiled", "plain"])
def test_pitchfork_by_the_half_period_map(rhs):
    (point,) = located(rhs)
    assert point.kind is Kind.PITCHFORK
    assert abs(point.value - FORCE) < 1e-12
    assert abs(point.value - FORCE) <= point.error_bound < 1e-9
    np.testing.assert_allclose(point.orbit, STATE, rtol=0, atol=1e-12)
    assert abs(point.multiplier + 1.0) < 1e-12
    assert point.frequency == 0.0
    assert point.criticality is Criticality.SUPERCRITICAL


@pytest.mark.parametrize("rhs", [compiled, plain], ids=["compiled", "plain"])
def test_multipliers_at_the_pitchfork(rhs):
    found = multipliers(duffing(FORCE, rhs), STATE)
    assert np.abs(found.half_period - NU).max() < 1e-12
    assert np.abs(found.values - np.square(NU)).max() <= found.error_bound
    # Liouville: the divergence is -0.2 everywhere.
    assert np.prod(found.values).real == pytest.approx(np.exp(-0.4 * pi), rel=1e-12)


def test_full_period_agrees_with_the_half_period():
    half = multipliers(duffing(2.3), STATE)
    full = multipliers(duffing(2.3, symmetry=None), half.orbit)
    np.testing.assert_allclose(full.orbit, half.orbit, atol=1e-12)
    assert np.abs(full.values - half.values).max() <= full.error_bound + half.error_bound


def test_compiled_and_plain_agree():
    (one,), (other,) = located(compiled), located(plain)
    assert abs(one.coefficient - other.coefficient) <= one.coefficient_error + other.coefficient_error
    np.testing.assert_allclose(one.mode, other.mode, atol=1e-11)


def test_the_symmetry_need_not_be_known():
    """Over the full period H - 1 is singular at the point and the orbit inexact; it is a pitchfork all the same."""
    (half,) = located(compiled)
    (point,) = locate(lambda force: duffing(force, symmetry=None), (2.1, 2.77), orbit=[1.88, 0.64])
    assert point.kind is Kind.PITCHFORK
    assert abs(point.normal_form.quadratic) <= point.normal_form.quadratic_error < 1e-3
    assert abs(point.coefficient - half.coefficient) <= point.coefficient_error < 0.05 * abs(half.coefficient)


@pytest.mark.parametrize("symmetry", [((-1, 0), (0, -1)), None])
@pytest.mark.parametrize(("low", "high"), [(FORCE, 2.6), (2.2, FORCE), (FORCE - 1e-9, 2.6), (2.2, FORCE + 1e-9)])
def test_an_interval_that_begins_or_ends_in_the_pitchfork(low, high, symmetry):
    """Or almost: it is no fold, although the orbit is singular there."""
    (point,) = locate(
        lambda force: duffing(force, symmetry=symmetry), (low, high), orbit=STATE if low > 2.3 else [1.88, 0.64]
    )
    assert point.kind is Kind.PITCHFORK
    assert abs(point.value - FORCE) <= point.error_bound < 1e-9
    assert point.criticality is Criticality.SUPERCRITICAL


@pytest.mark.parametrize("size", [1e-9, 1e-4, 1e4, 1e9])
def test_other_units(size):
    """The same for X = size x, with its symmetry."""
    (expected,) = located(compiled)
    (point,) = locate(
        lambda force: from_rhs(in_units, 2, 2 * pi, args=(force, size), symmetry=((-1, 0), (0, -1))),
        (2.2, 2.6),
        orbit=[1.88 * size, 0.64 * size],
    )
    error = point.coefficient_error * size**2 + expected.coefficient_error
    assert abs(point.coefficient * size**2 - expected.coefficient) <= error < 1e-6 * abs(expected.coefficient)
    assert point.criticality is Criticality.SUPERCRITICAL


def test_coefficient_against_the_branch_itself():
    """rate (F - F*) + coefficient a^2 = 0 holds to leading order on the asymmetric orbits that branch off."""
    (point,) = located(compiled)
    step = 1e-5
    growth = [multipliers(duffing(FORCE + s * step), STATE).values[0].real for s in (1, -1)]
    rate = (growth[0] - growth[1]) / (2 * step)
    side = np.sign(-point.coefficient * rate)  # on which side of F* the asymmetric orbits live
    mode = point.mode.real
    values, left = np.linalg.eig(find_orbit(duffing(point.value), STATE).image.jacobian.T)
    left = left[:, np.abs(values + 1).argmin()]
    left = left / (left @ mode)

    def estimate(away):
        force = point.value + side * away
        symmetric = find_orbit(duffing(force), STATE).state
        amplitude = np.sqrt(abs(rate * away / point.coefficient))
        # Two mirrored orbits: half their difference has only odd powers of the amplitude.
        beside = (find_orbit(duffing(force, symmetry=None), symmetric + s * amplitude * mode) for s in (1, -1))
        there, back = (orbit.state for orbit in beside)
        assert np.abs(there - back).max() > amplitude
        return -side * rate * away / (0.5 * left @ (there - back)) ** 2

    assert 2 * estimate(1e-5) - estimate(2e-5) == pytest.approx(point.coefficient, rel=1e-5)


def test_bounds_of_an_orbit_far_from_zero():
    """They are those of the motion, not of the distance."""

    def shifted(distance):
        return from_rhs(lambda t, x: [x[1], -0.2 * x[1] - (x[0] - distance) ** 3 + 2.5 * np.cos(t)], 2, 2.0 * np.pi)

    near, far = (find_orbit(shifted(distance), [distance + 1.88, 0.64]) for distance in (0.0, 1e4))
    assert (np.abs(far.state - [1e4, 0.0] - near.state) <= far.error + near.error).all()
    assert far.error.max() < 1e-6
