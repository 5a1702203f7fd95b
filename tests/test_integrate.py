"""The compiled integrator: order, tangents by complex step, error control on the tangent, and giving up."""

from math import pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chilopod.compiled import njit
from chilopod.integrate import COMPLEX_STEP, integrator


@njit
def slope(t, x, args, out):
    """A pendulum, or of one state an explosion: each is compiled for every kind of number."""
    if x.size == 1:
        out[0] = args[0] * x[0] * x[0]
    else:
        out[0] = x[1]
        out[1] = -args[0] * np.sin(x[0]) + args[1] * np.cos(t)


flow = integrator(slope)

ARGS = (1.3, 0.4)
START = np.array([0.8, -0.3])


def run(x, t0, t1, tolerance, h=0.0):
    x = np.array(x)
    work = np.empty((16, x.size), x.dtype)
    h, reached = flow(ARGS, x, t0, t1, h, tolerance, work)
    assert reached
    return x, h


def tilted(x, tangent):
    return np.asarray(x) + 1j * COMPLEX_STEP * np.asarray(tangent)


@pytest.fixture(scope="module")
def exact():
    """State and derivative at t = 6 by scipy, with the variational equation written by hand."""

    def both(t, y):
        matrix = np.array([[0.0, 1.0], [-ARGS[0] * np.cos(y[0]), 0.0]])
        slope = [y[1], -ARGS[0] * np.sin(y[0]) + ARGS[1] * np.cos(t)]
        return np.concatenate([slope, (matrix @ y[2:].reshape(2, 2)).ravel()])

    y = solve_ivp(both, (0, 6), [*START, 1, 0, 0, 1], method="DOP853", rtol=2.3e-14, atol=1e-16).y[:, -1]
    return y[:2], y[2:].reshape(2, 2)


def test_order_eight():
    """One step of h = 0.8, two of 0.4, ...: forced to a fixed step, the error falls by 2^8 with every halving."""
    span = 0.8
    reference = run(START, 0.0, span, 1e-15)[0]
    errors = []
    for parts in (1, 2, 4):
        x = START.copy()
        for i in range(parts):
            # So loose that a single step covers the whole piece.
            x, _ = run(x, i * span / parts, (i + 1) * span / parts, 1e3, h=span)
        errors.append(np.abs(x - reference).max())
    assert errors[2] > 1e-14  # still above round-off, or the ratios would mean nothing
    for coarse, fine in zip(errors, errors[1:], strict=False):
        assert 2**7 < coarse / fine < 2**10


def test_error_follows_the_tolerance(exact):
    errors = [np.abs(run(START, 0.0, 6.0, tolerance)[0] - exact[0]).max() for tolerance in (1e-5, 1e-8, 1e-11, 1e-14)]
    for error, tolerance in zip(errors, (1e-5, 1e-8, 1e-11, 1e-14), strict=True):
        assert error < 100 * tolerance
    assert errors[0] > 1e3 * errors[2]


def test_tangents_by_complex_step_are_exact(exact):
    for j in range(2):
        x, _ = run(tilted(START, np.eye(2)[j]), 0.0, 6.0, 1e-14)
        np.testing.assert_allclose(x.real, exact[0], atol=1e-12)
        np.testing.assert_allclose(x.imag / COMPLEX_STEP, exact[1][:, j], atol=2e-12)


def test_tangent_is_controlled_where_the_state_rests():
    """With no forcing the pendulum rests at 0: the state has no error at any step, the tangent oscillates."""
    x = tilted([0.0, 0.0], [1.0, 0.0])
    work = np.empty((16, 2), x.dtype)
    _, reached = flow((1.0, 0.0), x, 0.0, 40 * pi, 0.0, 1e-13, work)
    assert reached
    np.testing.assert_array_equal(x.real, 0.0)
    np.testing.assert_allclose(x.imag / COMPLEX_STEP, [1.0, 0.0], atol=1e-9)


def test_a_step_to_start_with_comes_back(exact):
    x, h = run(START, 0.0, 3.0, 1e-12)
    assert 0.0 < h < 6.0
    x, _ = run(x, 3.0, 6.0, 1e-12, h=h)
    np.testing.assert_allclose(x, exact[0], atol=1e-10)


@pytest.mark.parametrize("first", [1e-9, 0.1, 100.0])
def test_any_first_step_will_do(first, exact):
    np.testing.assert_allclose(run(START, 0.0, 6.0, 1e-12, h=first)[0], exact[0], atol=1e-10)


@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
def test_blow_up_is_reported(dtype):
    """x' = x^2 from 1 ends at t = 1."""
    work = np.empty((16, 1), dtype)
    x = np.ones(1, dtype)
    assert not flow((1.0, 0.0), x, 0.0, 2.0, 0.0, 1e-10, work)[1]
    x = np.ones(1, dtype)
    assert flow((1.0, 0.0), x, 0.0, 0.99, 0.0, 1e-12, work)[1]
    assert x[0].real == pytest.approx(100.0, rel=1e-7)


def test_not_a_number_is_reported():
    work = np.empty((16, 1))
    assert not flow((np.nan, 0.0), np.ones(1), 0.0, 2.0, 0.0, 1e-10, work)[1]
