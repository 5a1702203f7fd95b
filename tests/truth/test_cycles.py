"""Limit cycles born at Hopf points: the Brusselator, and two coupled Stuart-Landau oscillators in closed form.

z' = (1 + i w) z - (1 + i c) |z|^2 z + k (1 + i e) (other - z): in phase |z| = 1, in antiphase |z|^2 = 1 - 2 k, and in
the frame that turns with them the disturbances obey constant matrices of order two.
"""

import numpy as np
import pytest

from chilopod.errors import AnalysisError
from chilopod.stability import Kind, from_rhs, locate, multipliers

W, C, E = 3.0, 1.5, -1.0
EXCHANGE = np.kron([[0.0, 1.0], [1.0, 0.0]], np.eye(2))

# A = 1, B = 3: a Taylor integration in extended precision, with the trace of the Jacobian as a third state.
BRUSSELATOR = 7.1569199211798798232, -8.2875206802655675690265567569


def brusselator(b, guess_period=7.0):
    def rhs(t, x, b):
        return [1.0 + x[0] * x[0] * x[1] - (b + 1.0) * x[0], b * x[0] - x[0] * x[0] * x[1]]

    return from_rhs(rhs, 2, None, args=(b,), guess_period=guess_period)


def coupled(t, x, k):
    result = []
    for i, j in ((0, 2), (2, 0)):
        u, v = x[i], x[i + 1]
        q, du, dv = u * u + v * v, x[j] - u, x[j + 1] - v
        result += [u - W * v - q * (u - C * v) + k * (du - E * dv), v + W * u - q * (v + C * u) + k * (dv + E * du)]
    return result


def pair(k, frequency, **how):
    return from_rhs(coupled, 4, None, args=(k,), guess_period=2.0 * np.pi / frequency, **how)


def in_phase(k):
    """Period and multipliers."""
    period = 2.0 * np.pi / (W - C)
    apart = np.array([[-2.0 - 2.0 * k, 2.0 * k * E], [-2.0 * C - 2.0 * k * E, -2.0 * k]])
    return period, np.exp(period * np.append(np.linalg.eigvals(apart), -2.0))


def antiphase(k):
    r2 = 1.0 - 2.0 * k
    turning = W - 2.0 * k * E - C * r2
    period = 2.0 * np.pi / turning
    a, b = 1.0 - 2.0 * r2, W - turning - 2.0 * r2 * C
    together = np.array([[a - r2, -b - C * r2], [b - C * r2, a + r2]])
    return period, np.exp(period * np.append(np.linalg.eigvals(together), -2.0 * r2))


def alike(found, expected, bound):
    return max(np.abs(found - value).min() for value in expected) <= bound


@pytest.mark.parametrize("k", [-0.2, 0.1, 0.24, 0.4])
def test_multipliers_in_phase(k):
    period, expected = in_phase(k)
    found = multipliers(pair(k, W - C, spatial_symmetry=EXCHANGE), [1.0, 0.1, 1.0, 0.1])
    assert found.period == pytest.approx(period, rel=1e-13)
    assert alike(found.values, expected, found.error_bound)
    assert found.error_bound < 1e-9 * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("k", [-0.1, 0.1, 0.3])
def test_multipliers_in_antiphase(k):
    period, expected = antiphase(k)
    r = np.sqrt(1.0 - 2.0 * k)
    guess = [r, 0.0, -r, 0.0]
    whole = multipliers(pair(k, W, spatial_symmetry=-EXCHANGE), guess)
    half = multipliers(pair(k, W, symmetry=EXCHANGE), guess)
    for found in (whole, half):
        assert found.period == pytest.approx(period, rel=1e-13)
        assert alike(found.values, expected, found.error_bound)
        assert found.error_bound < 1e-9
    np.testing.assert_allclose(half.half_period**2, half.values)


@pytest.mark.parametrize("symmetry", [None, EXCHANGE], ids=["undeclared", "declared"])
def test_the_phases_part(symmetry):
    """Where the disturbance of the phase difference stands still: k = -(1 + c e) / (1 + e^2), and at k = 0."""
    found = locate(
        lambda k: pair(k, W - C, spatial_symmetry=symmetry), (0.1, 0.45), orbit=[1.0, 0.0, 1.0, 0.0], normal_form=True
    )
    assert found.complete
    (point,) = found
    assert abs(point.value - 0.25) <= point.error_bound < 1e-8
    assert point.kind is Kind.PITCHFORK
    assert point.multiplier == pytest.approx(1.0)


@pytest.mark.parametrize("symmetry", [None, EXCHANGE], ids=["undeclared", "declared"])
def test_uncoupled_phases_are_free(symmetry):
    """At k = 0 no phase difference is preferred; multipliers from 1e-12 to 1e3 are met on the way."""
    found = locate(
        lambda k: pair(k, W - C, spatial_symmetry=symmetry), (-0.3, 0.1), orbit=[1.0, 0.0, 1.0, 0.0], normal_form=False
    )
    assert found.complete
    (point,) = found
    assert abs(point.value) <= point.error_bound < 1e-8
    assert point.multiplier == pytest.approx(1.0)


@pytest.mark.parametrize(
    "how", [{}, {"spatial_symmetry": -EXCHANGE}, {"symmetry": EXCHANGE}], ids=["", "spatial", "time"]
)
def test_neimark_sacker_in_antiphase(how):
    """The trace of the matrix vanishes at k = 1/4; its determinant is 3/4 there."""
    r = np.sqrt(0.7)
    found = locate(lambda k: pair(k, W - 0.5, **how), (0.15, 0.35), orbit=[r, 0.0, -r, 0.0])
    assert found.complete
    (point,) = found
    assert point.kind is Kind.NEIMARK_SACKER
    assert abs(point.value - 0.25) <= point.error_bound < 1e-10
    assert point.period == pytest.approx(2.0 * np.pi / 2.75, rel=1e-10)
    angle = np.sqrt(0.75) * point.period
    assert point.frequency == pytest.approx(min(angle, 2.0 * np.pi - angle) / point.period, rel=1e-9)


@pytest.mark.parametrize("damping", [0.1, -0.1, 1.0])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_spiral_returns_to_its_section_but_is_no_orbit(damping, size):
    spiral = from_rhs(lambda t, x: [x[1], -x[0] - damping * x[1]], 2, None, guess_period=6.3)
    with pytest.raises(AnalysisError, match=r"^orbit: [^\n]*$"):
        multipliers(spiral, [size, 0.0])
