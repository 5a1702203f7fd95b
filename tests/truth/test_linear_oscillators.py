"""Mathieu's and Meissner's equation: traces and multipliers known to twenty digits."""

from math import cos, pi

import numpy as np
import pytest

from chilopod.stability import exponents, from_rhs, multipliers

MATHIEU = [
    (0.5, 0.2, -1.352670431680594273824),
    (2.5, 1.0, -0.09675230278692830285),
    (3.0, 5.0, 11.24255011161492717522),
]
MEISSNER_TRACE = 2.1140748603493438766
MEISSNER = (1.399569368525353, 0.714505491823991)


def mathieu(a, q):
    return from_rhs(lambda t, y: [y[1], -(a - 2 * q * cos(2 * t)) * y[0]], 2, pi, orbit=[0, 0])


def meissner(**how):
    return from_rhs(lambda t, y: [y[1], -(1 + 0.5 * np.sign(cos(t))) * y[0]], 2, 2 * pi, orbit=[0, 0], **how)


@pytest.mark.parametrize(("a", "q", "trace"), MATHIEU)
def test_mathieu_trace(a, q, trace):
    found = multipliers(mathieu(a, q))
    assert found.values.sum().real == pytest.approx(trace, rel=1e-11, abs=0)
    assert abs(found.values.sum() - trace) <= 2 * found.error_bound
    # The flow keeps areas: the product is one.
    assert np.prod(found.values) == pytest.approx(1.0, rel=1e-11)
    assert found.half_period is None


def test_meissner_trace_and_multipliers():
    found = multipliers(meissner(switch_times=[pi / 2, 3 * pi / 2]))
    assert found.values.sum().real == pytest.approx(MEISSNER_TRACE, rel=1e-11, abs=0)
    np.testing.assert_allclose(found.values, MEISSNER, rtol=1e-11)
    assert np.abs(found.values - MEISSNER).max() <= found.error_bound
    assert not found.stable


@pytest.mark.parametrize("start", [0.4, 1.7, pi / 2, 3.0, 5.9])
def test_multipliers_do_not_depend_on_where_the_period_starts(start):
    system = meissner(switch_times=[pi / 2, 3 * pi / 2])
    values = np.linalg.eigvals(system.flow(np.zeros(2), start, start + 2 * pi)[1])
    np.testing.assert_allclose(sorted(values, reverse=True), MEISSNER, rtol=1e-11)


def test_mathieu_inside_a_stable_tongue_turns_without_growing():
    found = exponents(mathieu(2.5, 1.0))
    np.testing.assert_allclose(found.values.real, 0.0, atol=1e-11)
    assert np.abs(found.values.imag) * pi == pytest.approx(np.arccos(-0.09675230278692830285 / 2), rel=1e-11)
    assert found.values[0] == found.values[1].conjugate()
    assert found.values[0].imag > 0
