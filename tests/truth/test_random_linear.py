"""Linear periodic systems with known multipliers, drawn at random: the error bound is never exceeded."""

from math import pi

import numba
import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from chilopod.stability import exponents, from_rhs, multipliers

rates = st.floats(-1.2, 0.25)
seeds = st.integers(0, 2**32 - 1)


@numba.njit
def turning(t, x, matrix, turns):
    """x' = (Omega + R(t) L R(t)^T) x with R(t) a rotation by turns[i] t in plane i."""
    n = x.size
    y = np.empty_like(x)
    for i in range(n // 2):
        c, s = np.cos(turns[i] * t), np.sin(turns[i] * t)
        y[2 * i] = c * x[2 * i] + s * x[2 * i + 1]
        y[2 * i + 1] = -s * x[2 * i] + c * x[2 * i + 1]
    z = np.zeros_like(x)
    for i in range(n):
        for j in range(n):
            z[i] += matrix[i, j] * y[j]
    out = np.empty_like(x)
    for i in range(n // 2):
        c, s = np.cos(turns[i] * t), np.sin(turns[i] * t)
        out[2 * i] = c * z[2 * i] - s * z[2 * i + 1] - turns[i] * x[2 * i + 1]
        out[2 * i + 1] = s * z[2 * i] + c * z[2 * i + 1] + turns[i] * x[2 * i]
    return out


def distance(found, known):
    """The largest distance between two sets of complex numbers, paired as well as they can be."""
    gaps = np.abs(np.asarray(found)[:, None] - np.asarray(known)[None])
    rows, columns = linear_sum_assignment(gaps)
    return gaps[rows, columns].max()


@st.composite
def rotating(draw):
    """Matrix, turns and exact exponents: L is block triangular, so that its eigenvalues are known without rounding."""
    planes = draw(st.integers(1, 3))
    real = [draw(rates) for _ in range(planes)]
    imaginary = [draw(st.floats(0.1, 2.0)) for _ in range(planes)]
    rng = np.random.default_rng(draw(seeds))
    matrix = np.tril(rng.normal(0.0, draw(st.floats(0.0, 2.0)), (2 * planes, 2 * planes)), -1)
    for i, (a, w) in enumerate(zip(real, imaginary, strict=True)):
        matrix[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[a, -w], [w, a]]
    turns = np.array([draw(st.integers(-3, 3)) for _ in range(planes)], dtype=float)
    exact = [complex(a, s * w) for a, w in zip(real, imaginary, strict=True) for s in (1, -1)]
    return matrix, turns, np.array(exact)


@example((np.array([[0.0, -1.25], [1.25, 0.0]]), np.array([-1.0]), np.array([1.25j, -1.25j])))  # two steps suffice
@example((np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([-1.0]), np.array([1.0j, -1.0j])))
@given(rotating())
def test_constant_coefficients_seen_from_a_turning_frame(case):
    matrix, turns, exact = case
    n = len(matrix)
    system = from_rhs(turning, n, 2 * pi, args=(matrix, turns), orbit=np.zeros(n))
    found = multipliers(system)
    known = np.exp(2 * pi * exact)
    # What the references themselves are rounded by: exp(2 pi a) of an exact a.
    slack = 4e-16 * 2 * pi * np.abs(exact).max() * np.abs(known).max()
    assert distance(found.values, known) <= found.error_bound + slack
    if np.linalg.cond(np.linalg.eig(matrix)[1]) < 100:  # a bound that is no use would be none
        assert found.error_bound < 1e-9 * max(1.0, np.linalg.norm(system.flow(np.zeros(n), 0.0, 2 * pi)[1]))
    # By falling modulus; what differs by round-off only is equal.
    assert (np.diff(np.abs(found.values)) <= 2e-12 * np.abs(found.values[0])).all()
    modulus = np.abs(np.exp(2 * pi * exact))
    assert found.stable in (None, bool(modulus.max() < 1.0))
    assert found.stable is not None or np.abs(modulus - 1.0).min() <= 2.0 * found.error_bound + slack


@given(st.lists(st.tuples(rates, st.floats(-2.0, 2.0)), min_size=1, max_size=4), seeds, st.floats(0.3, 8.0))
@example(  # the step control is deceived near a quarter of the period, at every tolerance alike
    [(-0.60546875, 0.0), (-0.60546875, 0.0), (-0.36926642652344077, -0.931640625)], 1, 4.91796875
)
def test_commuting_coefficients(pairs, seed, period):
    """x' = V diag(c_i + d_i cos(2 pi t / T)) V^-1 x: the cosine leaves no trace in the multipliers."""
    mean, swing = np.array(pairs).T
    n = len(mean)
    q = np.linalg.qr(np.random.default_rng(seed).standard_normal((n, n)))[0]
    vectors = q @ np.diag(np.linspace(1.0, 3.0, n)) @ q[::-1].T
    inverse = np.linalg.inv(vectors)

    def rhs(t, x):
        return vectors @ ((mean + swing * np.cos(2 * pi * t / period)) * (inverse @ x))

    found = multipliers(from_rhs(rhs, n, period, orbit=np.zeros(n)))
    known = np.exp(mean * period)
    assert distance(found.values, known) <= found.error_bound + 1e-15 * known.max() * max(1, 2 * period)


@given(rotating())
def test_exponents_of_a_turning_frame(case):
    matrix, turns, exact = case
    n = len(matrix)
    found = exponents(from_rhs(turning, n, 2 * pi, args=(matrix, turns), orbit=np.zeros(n)))
    # Conditions may be bad: the same bound as for the multipliers, relative to the smallest.
    allowed = found.multipliers.error_bound / np.exp(2 * pi * exact.real.min()) + 1e-12
    # The imaginary part counts modulo 2 pi / T = 1.
    gaps = found.values[:, None] - exact[None]
    gaps = np.hypot(gaps.real, np.abs(np.exp(2j * pi * gaps.imag) - 1) / (2 * pi))
    assert gaps[linear_sum_assignment(gaps)].max() <= allowed
    assert (found.values.imag > -0.5).all()
    assert (found.values.imag <= 0.5).all()


def test_exponents_sixty_orders_of_magnitude_apart():
    vectors = np.array([[1.0, 0.3, 0.0, 0.2], [0.1, 1.2, -0.4, 0.0], [0.0, 0.2, 0.9, 0.3], [-0.3, 0.0, 0.1, 1.1]])
    exact = np.array([0.1, -0.8, -25 * np.log(10) / (2 * pi), -60 * np.log(10) / (2 * pi)])
    matrix = vectors @ np.diag(exact) @ np.linalg.inv(vectors)
    found = exponents(from_rhs(turning, 4, 2 * pi, args=(matrix, np.array([1.0, -2.0])), orbit=np.zeros(4)))
    np.testing.assert_allclose(found.values.real, exact, rtol=1e-11)
    np.testing.assert_array_equal(found.values.imag, 0.0)
    modes = vectors / np.linalg.norm(vectors, axis=0)
    np.testing.assert_allclose(found.modes, modes, atol=1e-9)
    # The multipliers of the same orbit leave the small ones to their absolute error bound.
    known = np.exp(2 * pi * exact)
    assert distance(found.multipliers.values, known) <= found.multipliers.error_bound


def test_equal_moduli_in_slanted_directions_are_not_torn_apart():
    """All multipliers on the unit circle, the map far from orthogonal: no gap, though one pass may feign it."""
    frequencies = [2.0, 0.5, 1.0]
    exact = np.array([1j * s * w for w in frequencies for s in (1, -1)])
    for seed in range(20):
        matrix = np.tril(np.random.default_rng(seed).normal(0.0, 1.5, (6, 6)), -1)
        for i, w in enumerate(frequencies):
            matrix[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, -w], [w, 0.0]]
        found = exponents(from_rhs(turning, 6, 2 * pi, args=(matrix, np.zeros(3)), orbit=np.zeros(6)))
        assert distance(np.exp(2 * pi * found.values), np.exp(2 * pi * exact)) < 1e-9
        np.testing.assert_allclose(found.values.real, 0.0, atol=1e-10)
