"""Exponents of systems whose multipliers lie dozens of orders of magnitude apart."""

from math import exp, log, pi, sqrt

import numpy as np
import pytest
from scipy.linalg import expm

from chilopod.errors import AnalysisError
from chilopod.stability import Event, PeriodicSystem, exponents, from_map, from_rhs
from chilopod.stability.spectrum import split_leading
from helpers.systems import linear

PERIOD = 2 * pi
SKEW = np.array([[0.0, 0.5, -0.2, 0.3], [-0.5, 0.0, 0.4, 0.1], [0.2, -0.4, 0.0, -0.6], [-0.3, -0.1, 0.6, 0.0]])
SLANT = np.array([[1.0, 0.3, 0.0, 0.2], [0.1, 1.2, -0.4, 0.0], [0.0, 0.2, 0.9, 0.3], [-0.3, 0.0, 0.1, 1.1]])


def frame(t):
    """A T-periodic change of variables that is not orthogonal."""
    return expm(SKEW * np.sin(t)) @ SLANT


def exactly(generator):
    """x = P(t) u with u' = generator u, by its exact flow."""
    inverse = np.linalg.inv
    return linear(lambda t0, t1: frame(t1) @ expm(generator * (t1 - t0)) @ inverse(frame(t0)), 4, PERIOD)


def rotation(a, w):
    return np.array([[a, w], [-w, a]])


def blocks(*parts):
    n = sum(len(np.atleast_2d(p)) for p in parts)
    result, i = np.zeros((n, n)), 0
    for part in map(np.atleast_2d, parts):
        result[i : i + len(part), i : i + len(part)] = part
        i += len(part)
    return result


def test_fast_and_slow_pairs():
    """Pairs 40 orders of magnitude apart; the frequencies are given modulo one turn a period."""
    slow, fast = rotation(-0.05, 0.3), rotation(-log(1e40) / PERIOD, 1.7)
    found = exponents(exactly(blocks(slow, fast)))
    wrapped = 1.7 - 2.0
    expected = [-0.05 + 0.3j, -0.05 - 0.3j]
    expected += [complex(-log(1e40) / PERIOD, abs(wrapped)), complex(-log(1e40) / PERIOD, -abs(wrapped))]
    np.testing.assert_allclose(found.values, expected, rtol=1e-10)


def test_modes_are_eigenvectors_of_the_period():
    system = exactly(blocks(rotation(-0.05, 0.3), -0.4, -0.9))
    found = exponents(system)
    matrix = system.flow(np.zeros(4), 0.0, PERIOD)[1]
    np.testing.assert_allclose(matrix @ found.modes, found.modes * np.exp(found.values * PERIOD), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found.modes, axis=0), 1.0, rtol=1e-14)
    peaks = found.modes[np.abs(found.modes).argmax(axis=0), range(4)]
    assert (peaks.real > 0).all()
    np.testing.assert_allclose(peaks.imag, 0.0, atol=1e-14)


def test_negative_multipliers_have_half_a_turn():
    """Frequency pi/T: the multipliers are negative, and the imaginary part is +pi/T for both."""
    found = exponents(exactly(blocks(rotation(-0.1, 0.5), rotation(-0.3, 0.0))))
    np.testing.assert_allclose(found.values, [-0.1 + 0.5j, -0.1 + 0.5j, -0.3, -0.3], atol=1e-7)
    assert (found.values.imag <= pi / PERIOD).all()


def test_order_is_by_falling_real_part_with_positive_frequency_first():
    found = exponents(exactly(blocks(-0.9, rotation(-0.05, 0.3), 0.2)))
    np.testing.assert_allclose(found.values, [0.2, -0.05 + 0.3j, -0.05 - 0.3j, -0.9], atol=1e-12)
    np.testing.assert_allclose(found.modes[:, 1], found.modes[:, 2].conj(), atol=1e-12)


def half_turn(generator, signs):
    """u' = generator u with the symmetry u -> diag(signs) u of half a period."""
    return linear(lambda t0, t1: expm(generator * (t1 - t0)), len(generator), PERIOD, symmetry=np.diag(signs))


def test_half_period_gives_the_principal_logarithm_of_the_full_period():
    generator = blocks(0.05, rotation(-0.1, 0.4), -0.3)
    found = exponents(half_turn(generator, [-1.0, 1.0, 1.0, 1.0]))
    np.testing.assert_allclose(found.values, [0.05, -0.1 + 0.4j, -0.1 - 0.4j, -0.3], atol=1e-12)
    nu = found.multipliers.half_period
    np.testing.assert_allclose(found.multipliers.values, nu**2, rtol=1e-14)
    # The first half-period multiplier is negative, its square is not.
    assert nu[0] == pytest.approx(-np.exp(0.05 * pi), rel=1e-13)
    assert found.values[0].imag == 0.0


def test_a_singular_flow_is_refused():
    system = PeriodicSystem(2, 1.0, lambda x, t0, t1: (np.diag([1.0, 0.0]) @ x, np.diag([1.0, 0.0])), orbit=np.zeros(2))
    with pytest.raises(AnalysisError, match="contracts too strongly"):
        exponents(system)


@pytest.mark.parametrize("last", [0.0, 1e-310])
def test_a_singular_map_is_refused(last):
    """A map has no parts that could be halved."""
    system = PeriodicSystem(
        2, 1.0, lambda x, t0, t1: (np.diag([0.5, last]) @ x, np.diag([0.5, last])), orbit=np.zeros(2)
    )
    with pytest.raises(AnalysisError, match="contracts too strongly"):
        exponents(system)


def test_leading_directions_of_a_factor_that_makes_nothing_of_the_others():
    logarithms, vectors = split_leading([np.diag([2.0, 0.0])], 1)
    np.testing.assert_allclose(logarithms, [log(2.0)], rtol=1e-15)
    np.testing.assert_allclose(vectors, [[1.0], [0.0]], atol=1e-15)


def kicked(reset):
    """x' = -x, y' = -2 y, with a reset in the middle of the period 1."""
    kick = Event(lambda t, x: np.sin(np.pi * (t - 0.5)), reset)
    return from_rhs(lambda t, x: [-x[0], -2.0 * x[1]], 2, 1.0, events=[kick])


@pytest.mark.parametrize(("d", "sure"), [(1e-3, 1e-8), (1e-8, 1e-4), (1e-12, 1.0)])
def test_a_nearly_singular_reset(d, sure):
    """Multipliers with the sum exp(-1) + (2 + d) exp(-2) and the product d exp(-3)."""
    found = exponents(kicked(lambda t, x: [x[0] + x[1] + 0.1, 2.0 * x[0] + (2.0 + d) * x[1]]), [0.1, 0.1])
    own = (2.0 + d) - 2.0  # of the reset as rounded
    total = exp(-1.0) + (2.0 + d) * exp(-2.0)
    first = 0.5 * (total + sqrt(total**2 - 4.0 * own * exp(-3.0)))
    expected = [log(first), log(own * exp(-3.0) / first)]
    assert (np.abs(found.values - expected) <= found.error_bound).all()
    assert found.error_bound[0] < 1e-11
    assert found.error_bound[1] < sure


def test_a_singular_reset():
    """Multipliers 3 / e + 6 / e^2 and 0."""
    system = kicked(lambda t, x: [3.0 * (x[0] + x[1]), 6.0 * (x[0] + x[1])])
    with pytest.raises(AnalysisError, match=r"contracts too strongly.*resolved=True"):
        exponents(system, [0.0, 0.0])
    found = exponents(system, [0.0, 0.0], resolved=True)
    np.testing.assert_allclose(found.values, [log(3.0 * exp(-1.0) + 6.0 * exp(-2.0))], rtol=1e-12)
    assert str(found).endswith("of 1 more the multipliers are zero, or too small to be resolved")


@pytest.mark.parametrize("angle", [pi, 1.0, 0.5 * pi])
def test_a_reset_of_an_orbit_of_its_own_period(angle):
    """r' = -0.05 r, phi' = 1; after a turn r becomes 2 g^-1 + k (r - 2) g^-1, g the decay over a turn."""

    def spiral(k):
        decay = exp(-0.1 * pi)
        back = Event(lambda t, x: x[1], lambda t, x: [(2.0 + k * (x[0] - 2.0)) / decay, 0.0 * x[1]], direction=1)
        start = 2.0 * exp(-0.05 * (angle - 2.0 * pi)) * np.array([np.cos(angle), np.sin(angle)])
        system = from_rhs(
            lambda t, x: [-0.05 * x[0] - x[1], -0.05 * x[1] + x[0]], 2, None, events=[back], guess_period=6.3
        )
        return exponents(system, start)

    for k in (-0.5, 1e-9):
        np.testing.assert_allclose(spiral(k).values.real, [log(abs(k)) / (2.0 * pi)], rtol=1e-6)
    with pytest.raises(AnalysisError, match="contracts too strongly"):
        spiral(0.0)


def test_a_map_of_poor_condition():
    """A map has no parts that could be halved: eigenvalues 1 and 1e-9."""
    matrix = 0.5 * np.array([[1.0 + 1e-9, 1.0 - 1e-9], [1.0 - 1e-9, 1.0 + 1e-9]])
    found = exponents(from_map(lambda x: (matrix @ x, matrix), 2), [0.0, 0.0])
    np.testing.assert_allclose(found.values, [0.0, log(1e-9)], atol=1e-6)
