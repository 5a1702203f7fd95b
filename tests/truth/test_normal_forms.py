"""Period doubling, Neimark-Sacker and pitchfork with centre manifolds, all with closed-form coefficients."""

from math import cos, pi, sin

import numba
import numpy as np
import pytest
from scipy.special import iv

from chilopod.stability import Criticality, Kind, from_rhs, locate

PERIOD = 1.7


def verdict(coefficient):
    return Criticality.SUPERCRITICAL if coefficient < 0 else Criticality.SUBCRITICAL


def check(point, kind, coefficient, frequency=0.0, at=0.0):
    assert point.kind is kind
    assert abs(point.value - at) <= point.error_bound < 1e-10
    assert point.coefficient == pytest.approx(coefficient, rel=1e-7)
    assert abs(point.coefficient - coefficient) <= point.coefficient_error
    assert point.criticality is verdict(coefficient)
    assert point.frequency == pytest.approx(frequency, rel=1e-10, abs=1e-12)


def moebius(mu, cubic, coupling, damping):
    """u' = mu u + coupling u z - cubic u^3, z' = -damping z + u^2, in a frame for u that turns by 180 degrees a period.

    The other half of the turning pair decays. Seen from outside the system is periodic because u -> -u changes
    nothing, and every multiplier of the pair has a minus sign.
    """

    def rhs(t, x):
        c, s = cos(pi * t / PERIOD), sin(pi * t / PERIOD)
        u, v = c * x[0] + s * x[1], -s * x[0] + c * x[1]
        du, dv = mu * u + coupling * u * x[2] - cubic * u * u * u, -v
        turn = pi / PERIOD
        return [c * du - s * dv - turn * x[1], s * du + c * dv + turn * x[0], -damping * x[2] + u * u]

    return from_rhs(rhs, 3, PERIOD, orbit=[0.0, 0.0, 0.0])


@pytest.mark.parametrize(("cubic", "coupling", "damping"), [(0.7, 0.0, 1.0), (0.7, 1.5, 2.5), (0.2, 1.5, 2.5)])
def test_period_doubling(cubic, coupling, damping):
    (point,) = locate(lambda mu: moebius(mu, cubic, coupling, damping), (-0.11, 0.2))
    # On the centre manifold z = u^2 / damping; the map of two periods is what the coefficient belongs to.
    check(point, Kind.PERIOD_DOUBLING, 2 * PERIOD * (coupling / damping - cubic), pi / PERIOD)
    np.testing.assert_allclose(np.abs(point.mode), [1, 0, 0], atol=1e-9)
    assert abs(point.multiplier + 1) < 1e-11


@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize(("cubic", "coupling", "damping"), [(0.7, 1.5, 2.5), (0.2, 1.5, 2.5)])
def test_pitchfork_with_a_centre_manifold(cubic, coupling, damping, declared):
    """x' = mu x + coupling x y - cubic x^3, y' = -damping y + x^2, in slanted coordinates."""
    basis = np.array([[1.0, 0.4], [-0.3, 2.0]])
    inverse = np.linalg.inv(basis)

    def system(mu):
        def rhs(t, w):
            x, y = inverse @ w
            return basis @ np.array([mu * x + coupling * x * y - cubic * x * x * x, -damping * y + x * x])

        mirror = basis @ np.diag([-1.0, 1.0]) @ inverse if declared else None
        return from_rhs(rhs, 2, PERIOD, orbit=[0.0, 0.0], spatial_symmetry=mirror)

    (point,) = locate(system, (-0.11, 0.2))
    scale = np.linalg.norm(basis[:, 0])  # a unit amplitude along the unit mode is x = 1 / scale
    check(point, Kind.PITCHFORK, PERIOD * (coupling / damping - cubic) / scale**2)
    np.testing.assert_allclose(point.mode, basis[:, 0] / scale, atol=1e-9)


@numba.njit
def planar(t, x, mu, omega, a, b, modulation, harmonic):
    pulse = mu + modulation * np.cos(harmonic * 2 * pi * t / PERIOD)
    size = x[0] * x[0] + x[1] * x[1]
    slope = np.empty_like(x)
    slope[0] = pulse * x[0] - omega * x[1] - size * (a * x[0] - b * x[1])
    slope[1] = pulse * x[1] + omega * x[0] - size * (a * x[1] + b * x[0])
    return slope


@pytest.mark.parametrize("modulation", [0.0, 0.9])
@pytest.mark.parametrize(("omega", "a", "b"), [(1.1, 0.8, 0.3), (2.3, 0.8, -1.0), (5.9, -0.4, 2.0)])
def test_neimark_sacker(omega, a, b, modulation):
    """z' = (mu + modulation cos(2 pi t / T) + i omega) z - (a + i b) |z|^2 z.

    With r = |z|, r' = (mu + ...) r - a r^3, so at mu = 0 r -> r - a T I0(modulation T / pi) r^3; the unit mode
    (1, -i) / sqrt(2) makes |z| = sqrt(2) times the amplitude.
    """
    (point,) = locate(
        lambda mu: from_rhs(planar, 2, PERIOD, args=(mu, omega, a, b, modulation, 1.0), orbit=[0.0, 0.0]), (-0.11, 0.2)
    )
    principal = abs(np.angle(np.exp(1j * omega * PERIOD))) / PERIOD
    check(point, Kind.NEIMARK_SACKER, -2 * a * PERIOD * iv(0, modulation * PERIOD / pi), principal)
    # The phase advances by -b times the integral of r^2, counted in the sense in which the frequency is positive.
    sense = np.sign(np.angle(np.exp(1j * omega * PERIOD)))
    rotation = -2 * sense * b * PERIOD * iv(0, modulation * PERIOD / pi)
    assert abs(point.rotation - rotation) <= point.rotation_error < 1e-6 * abs(rotation)
    assert abs(point.multiplier - np.exp(1j * principal * PERIOD)) < 1e-11
    np.testing.assert_allclose(np.abs(point.mode), np.sqrt(0.5), atol=1e-9)


@pytest.mark.parametrize("omega", [0.7, 2.3])
def test_neimark_sacker_by_the_half_period_map(omega):
    """With an even harmonic, z -> -z after half a period is a symmetry; answers are those of the full period."""
    (half,), (full,) = (
        locate(
            lambda mu, symmetry=symmetry: from_rhs(
                planar, 2, PERIOD, args=(mu, omega, 0.8, 0.3, 0.9, 2.0), orbit=[0.0, 0.0], symmetry=symmetry
            ),
            (-0.11, 0.2),
        )
        for symmetry in (-np.eye(2), None)
    )
    principal = abs(np.angle(np.exp(1j * omega * PERIOD))) / PERIOD
    for point in (half, full):
        check(point, Kind.NEIMARK_SACKER, -1.6 * PERIOD * iv(0, 0.45 * PERIOD / pi), principal)
    assert half.multiplier**2 == pytest.approx(full.multiplier, abs=1e-11) or half.multiplier**2 == pytest.approx(
        full.multiplier.conjugate(), abs=1e-11
    )


def test_neimark_sacker_with_quadratic_terms():
    """z' = (mu + i w) z + g20 z^2 / 2 + g11 z z* + g02 z*^2 / 2 + g21 z^2 z* / 2 (Kuznetsov, section 3.5), slanted."""
    w, g20, g11, g02, g21 = 1.3, 0.3 - 0.2j, 0.25 + 0.4j, -0.35 + 0.1j, -0.3 + 0.5j
    basis = np.array([[1.0, 0.5], [0.2, 1.4]])
    inverse = np.linalg.inv(basis)

    def system(mu):
        def rhs(t, state):
            x, y = inverse @ state
            size, real, imaginary = x * x + y * y, x * x - y * y, 2 * x * y
            u, v = mu * x - w * y, mu * y + w * x
            for g, re, im in (
                (g20 / 2, real, imaginary),
                (g11, size, 0.0),
                (g02 / 2, real, -imaginary),
                (g21 / 2, size * x, size * y),
            ):
                u, v = u + g.real * re - g.imag * im, v + g.real * im + g.imag * re
            return basis @ np.array([u, v])

        return from_rhs(rhs, 2, PERIOD, orbit=[0.0, 0.0])

    (point,) = locate(system, (-0.11, 0.2))
    first = 0.5j / w * (g20 * g11 - 2 * abs(g11) ** 2 - abs(g02) ** 2 / 3) + g21 / 2
    mode = basis @ np.array([1.0, -1j])  # z = 1 moves along it: state = Re(z mode) = 2 Re(a mode / |mode|)
    scale = np.linalg.norm(mode) / 2
    check(point, Kind.NEIMARK_SACKER, PERIOD * first.real / scale**2, w)
    rotation = PERIOD * first.imag / scale**2
    assert abs(point.rotation - rotation) <= point.rotation_error < 1e-6 * abs(rotation)
