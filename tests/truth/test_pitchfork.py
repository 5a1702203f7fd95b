"""x' = (mu + eps cos t) x -+ x^3: the pitchfork with everything in closed form.

With x = e^{eps sin t} u and mu = 0 the equation becomes u' = -+ e^{2 eps sin t} u^3, whose period map is
u / sqrt(1 +- 4 pi I0(2 eps) u^2): the multiplier is e^{2 pi mu} and the cubic coefficient -+ 2 pi I0(2 eps).
"""

from math import cos, exp, pi

import numba
import numpy as np
import pytest
from scipy.special import iv

from chilopod.stability import Criticality, Kind, from_rhs, locate, multipliers


@numba.njit
def compiled(t, x, mu, eps, sign):
    return np.array([(mu + eps * np.cos(t)) * x[0] + sign * x[0] * x[0] * x[0]])


def plain(t, x, mu, eps, sign):
    return [(mu + eps * cos(t)) * x[0] + sign * x[0] ** 3]


def family(eps, sign, rhs=compiled, **how):
    return lambda mu: from_rhs(rhs, 1, 2 * pi, args=(mu, eps, sign), orbit=[0.0], **how)


def check(points, eps, sign):
    assert [point.kind for point in points] == [Kind.PITCHFORK]
    point = points[0]
    assert abs(point.value) <= point.error_bound < 1e-10
    assert abs(point.multiplier - 1) < 1e-12
    assert point.frequency == 0.0
    expected = sign * 2 * pi * iv(0, 2 * eps)
    assert point.coefficient == pytest.approx(expected, rel=1e-8, abs=0)
    assert abs(point.coefficient - expected) <= point.coefficient_error
    assert point.coefficient_error < 1e-7 * abs(expected)
    assert point.criticality is (Criticality.SUPERCRITICAL if sign < 0 else Criticality.SUBCRITICAL)


@pytest.mark.parametrize("symmetry", [None, [[-1.0]]], ids=["undeclared", "declared"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("eps", [0.0, 0.1, 1.0, 2.0])
def test_pitchfork(eps, sign, symmetry):
    check(locate(family(eps, sign, spatial_symmetry=symmetry), (-0.31, 0.4)), eps, sign)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_pitchfork_of_a_plain_function(sign):
    check(locate(family(1.0, sign, plain), (-0.31, 0.4)), 1.0, sign)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_strong_coefficient_comes_with_an_honest_error(sign):
    """At eps = 3 the period map is singular at an amplitude of 0.034 already."""
    (point,) = locate(family(3.0, sign), (-0.31, 0.4))
    expected = sign * 2 * pi * iv(0, 6.0)
    assert abs(point.coefficient - expected) <= point.coefficient_error < 0.01 * abs(expected)
    assert point.criticality is (Criticality.SUPERCRITICAL if sign < 0 else Criticality.SUBCRITICAL)


@pytest.mark.parametrize("mu", [-0.4, -0.01, 0.0, 0.2])
def test_multiplier(mu):
    found = multipliers(family(1.5, -1.0)(mu))
    assert found.values[0] == pytest.approx(exp(2 * pi * mu), rel=1e-12)
    assert abs(found.values[0] - exp(2 * pi * mu)) <= found.error_bound


@pytest.mark.parametrize("eps", [0.0, 1.0])
def test_transcritical(eps):
    """x' = (mu + eps cos t) x - x^2: the other orbit passes through the origin at mu = 0."""

    def rhs(t, x, mu):
        return [(mu + eps * cos(t)) * x[0] - x[0] * x[0]]

    (point,) = locate(lambda mu: from_rhs(rhs, 1, 2 * pi, args=(mu,), orbit=[0.0]), (-0.31, 0.4))
    assert point.kind is Kind.TRANSCRITICAL
    assert abs(point.value) <= point.error_bound < 1e-10
    assert point.coefficient is None
    assert point.criticality is Criticality.NOT_DEFINED


def test_a_quintic_term_alone_is_no_pitchfork_with_a_verdict():
    """x' = mu x - x^5: the cubic coefficient is zero, and so nothing is claimed about its sign."""
    (point,) = locate(
        lambda mu: from_rhs(lambda t, x: [mu * x[0] - x[0] ** 5], 1, 1.0, orbit=[0.0], spatial_symmetry=[[-1.0]]),
        (-0.31, 0.4),
    )
    assert point.kind is Kind.PITCHFORK
    assert point.criticality is Criticality.UNDECIDED
    assert abs(point.coefficient) <= point.coefficient_error < 1e-8


@numba.njit
def scaled(t, x, mu, size):
    return np.array([(mu + 0.5 * np.cos(t)) * x[0] - (x[0] / size) * (x[0] / size) * x[0]])


@pytest.mark.parametrize("symmetry", [None, [[-1.0]]], ids=["undeclared", "declared"])
@pytest.mark.parametrize("size", [1e-5, 0.03, 1e6])
def test_pitchfork_on_other_scales(size, symmetry):
    (point,) = locate(
        lambda mu: from_rhs(scaled, 1, 2 * pi, args=(mu, size), orbit=[0.0], spatial_symmetry=symmetry), (-0.31, 0.4)
    )
    assert point.kind is Kind.PITCHFORK
    expected = -2 * pi * iv(0, 1.0) / size**2
    assert abs(point.coefficient - expected) <= point.coefficient_error < 1e-4 * abs(expected)
    assert point.criticality is Criticality.SUPERCRITICAL
