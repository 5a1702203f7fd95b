"""Functions of complex-step numbers against numpy's own, and against derivatives known in closed form."""

import numpy as np
import pytest

from chilopod import dual
from chilopod.compiled import fused_njit
from chilopod.integrate import COMPLEX_STEP

ANGLES = [*np.linspace(-0.8, 0.8, 161), -40.0, -3.0, 1.0, 7.5, 0.25 * np.pi, 1e5]


@fused_njit
def cos_sin(angle):
    return dual.cos_sin(angle)


@fused_njit
def reciprocal(number):
    return dual.reciprocal(number)


@pytest.mark.parametrize("angle", ANGLES)
def test_cosine_and_sine_are_those_of_numpy_to_the_last_bit_or_two(angle):
    c, s = cos_sin(angle)
    assert c == pytest.approx(np.cos(angle), rel=0, abs=2.3e-16)
    assert s == pytest.approx(np.sin(angle), rel=0, abs=2.3e-16)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_tangent_is_carried_by_the_derivative(angle):
    c, s = cos_sin(complex(angle, 3.0 * COMPLEX_STEP))
    assert (c.real, s.real) == cos_sin(angle)
    assert c.imag / COMPLEX_STEP == pytest.approx(-3.0 * np.sin(angle), rel=0, abs=2e-15)
    assert s.imag / COMPLEX_STEP == pytest.approx(3.0 * np.cos(angle), rel=0, abs=2e-15)


def test_reciprocal():
    assert reciprocal(8.0) == 0.125
    inverse = reciprocal(complex(-4.0, COMPLEX_STEP))
    assert inverse.real == -0.25
    assert inverse.imag / COMPLEX_STEP == -1.0 / 16.0


def test_an_angle_that_is_no_number_stays_none():
    assert np.isnan(cos_sin(np.nan)).all()
