"""Exponents of systems whose multipliers lie dozens of orders of magnitude apart."""

from math import log, pi

import numpy as np
import pytest
from scipy.linalg import expm

from chilopod.errors import AnalysisError
from chilopod.stability import PeriodicSystem, exponents
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
