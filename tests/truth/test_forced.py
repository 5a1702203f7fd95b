"""Forced systems with known answers: in other units, with pulses and jumps, and large ones."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import fsolve

from chilopod.stability import Criticality, Kind, find_orbit, from_rhs, locate, multipliers
from helpers.spectra import farthest


def assert_same(found, known, least=1e-14):
    """Every multiplier within the bound of one that is known, each used once."""
    bound = max(found.error_bound, least)
    assert bound < 1e-8
    assert farthest(found.values, known) <= bound


# A double pendulum with a moving pivot


def double_pendulum(t, x, g, drive, rate, damping):
    """Two unit masses on unit rods; the pivot moves up and down with the acceleration ``drive`` cos(``rate`` t). Mass
    matrix [[2, c], [c, 1]], c = cos(a - b), inverted by hand."""
    a, b, p, q = x
    c, s = np.cos(a - b), np.sin(a - b)
    weight = g + drive * np.cos(rate * t)
    first = -s * q * q - 2.0 * weight * np.sin(a) - damping * p
    second = s * p * p - weight * np.sin(b) - damping * (q - p)
    determinant = 2.0 - c * c
    return np.array([p, q, (first - c * second) / determinant, (2.0 * second - c * first) / determinant])


def test_a_double_pendulum_that_hangs():
    """At rest it is linear, with a 2 x 2 Hill equation: scipy's monodromy matrix."""
    g, drive, rate, damping = 9.81, 4.0, 5.0, 0.2
    period = 2.0 * math.pi / rate
    inverse = np.array([[1.0, -1.0], [-1.0, 2.0]])
    weights = np.diag([2.0, 1.0])
    friction = damping * np.array([[1.0, 0.0], [-1.0, 1.0]])

    def slope(t, y):
        states = y.reshape(4, 4)
        weight = g + drive * math.cos(rate * t)
        return np.concatenate([states[2:], -inverse @ (weight * weights @ states[:2] + friction @ states[2:])]).ravel()

    known = solve_ivp(slope, (0.0, period), np.eye(4).ravel(), "DOP853", rtol=3e-14, atol=1e-16).y[:, -1].reshape(4, 4)
    system = from_rhs(double_pendulum, 4, period, args=(g, drive, rate, damping))
    found = multipliers(system, [0.0] * 4)
    assert np.abs(np.sort_complex(found.values) - np.sort_complex(np.linalg.eigvals(known))).max() < 1e-11
    assert found.error_bound < 1e-11
    # The divergence of the flow is the trace of the friction at rest.
    assert np.prod(found.values).real == pytest.approx(math.exp(-damping * 4.0 * period), rel=1e-12)


# Steep functions, at the ends of which exp and cosh overflow


@pytest.mark.parametrize(
    ("force", "guess"),
    [
        (lambda x: -0.5 / (1.0 + np.exp(100.0 * x)), [0.5, 0.5]),
        (lambda x: -0.5 / (1.0 + np.exp(100.0 * x)), [0.3, 9.8]),
        (lambda x: -0.5 / (1.0 + np.exp(300.0 * x)), [2.0, -3.0]),
        (lambda x: -0.5 * np.tanh(50.0 * x), [0.5, 0.5]),
        (lambda x: -0.5 / np.cosh(100.0 * (x - 1.0)) ** 2, [0.5, 0.5]),
        (lambda x: -0.5 * (1.0 + np.exp(100.0 * x)) ** -1.3, [0.5, 0.5]),
        (lambda x: -0.5 * np.exp(-np.exp(100.0 * x)), [0.5, 0.5]),
    ],
)
def test_steep_but_smooth_forces(force, guess):
    """A motion of amplitude 10, corrected once by the residual of scipy's, whose steps meet every change."""

    def slope(t, x):
        return [x[1], -0.2 * x[1] - x[0] + 2.0 * np.cos(t) + force(x[0])]

    found = find_orbit(from_rhs(slope, 2, 2.0 * np.pi), guess)
    with np.errstate(over="ignore"):
        run = solve_ivp(slope, (0.0, 2.0 * np.pi), found.state, "DOP853", rtol=1e-12, atol=1e-12, max_step=0.004)
    end = run.y[:, -1]
    off = np.linalg.solve(found.image.jacobian - np.eye(2), end - found.state)
    assert np.abs(off).max() < 1e-10
    assert found.error.max() < 1e-10


# Duffing in other units


def critical(force, gradient, duration, turn, guess):
    """State and parameter where ``turn`` times the flow gives the state back, and the flow's derivative has the
    multiplier 1, by scipy; ``force(t, y, p)`` is x'', and ``gradient(y)`` its derivatives by x and x'."""

    def slope(t, y, p):
        moved = np.array([[0.0, 1.0], gradient(y)]) @ y[2:].reshape(2, 2)
        return [y[1], force(t, y, p), *moved.ravel()]

    def equations(unknown):
        x, p = unknown[:2], unknown[2]
        run = solve_ivp(
            slope, (0.0, duration(p)), [*x, 1.0, 0.0, 0.0, 1.0], "DOP853", args=(p,), rtol=1e-12, atol=1e-13
        )
        end = run.y[:, -1]
        return [*(turn * end[:2] - x), np.linalg.det(end[2:].reshape(2, 2) - np.eye(2))]

    return fsolve(equations, guess, xtol=1e-11)[2]


def test_the_fold_of_a_resonance_in_any_unit():
    """x'' + 0.1 x' + x + x^3 = 0.4 cos w t."""
    known = critical(
        lambda t, y, w: 0.4 * math.cos(w * t) - 0.1 * y[1] - y[0] - y[0] ** 3,
        lambda y: [-1.0 - 3.0 * y[0] ** 2, -0.1],
        lambda w: 2.0 * math.pi / w,
        1.0,
        [-0.06, 3.58, 2.006],
    )
    for metre, second in ((1.0, 1.0), (1e-6, 1e-3), (1e9, 3600.0)):

        def family(w, metre=metre, second=second):
            def rhs(t, x, w):
                y, v = x[0] / metre, x[1] * second / metre
                return [x[1], metre / second**2 * (0.4 * np.cos(w * t) - 0.1 * v - y - y * y * y)]

            return from_rhs(rhs, 2, 2.0 * math.pi / w, args=(w,))

        found = locate(family, (1.1 / second, 2.4 / second), orbit=[1.0 * metre, 0.0], normal_form=False)
        assert found.complete
        (fold,) = found
        assert fold.kind is Kind.FOLD
        assert fold.value * second == pytest.approx(known, rel=1e-9)
        assert fold.error_bound * second < 1e-11


def test_the_pitchfork_of_two_wells_in_any_unit():
    """x'' + 0.2 x' - x + x^3 = F cos t. The orbit round both wells loses its symmetry x(t + T/2) = -x(t) where the
    return map -flow(T/2) has the multiplier -1."""
    known = critical(
        lambda t, y, force: force * math.cos(t) - 0.2 * y[1] + y[0] - y[0] ** 3,
        lambda y: [1.0 - 3.0 * y[0] ** 2, -0.2],
        lambda force: math.pi,
        -1.0,
        [1.9, 0.9, 2.1],
    )
    for metre, second in ((1.0, 1.0), (1e-7, 1e4)):

        def family(force, metre=metre, second=second):
            def rhs(t, x, force):
                y, v = x[0] / metre, x[1] * second / metre
                return [x[1], metre / second**2 * (force * np.cos(t / second) - 0.2 * v + y - y * y * y)]

            return from_rhs(rhs, 2, 2.0 * math.pi * second, args=(force,), symmetry=-np.eye(2))

        found = locate(family, (1.0, 4.0), orbit=[1.9 * metre, 0.6 * metre / second])
        assert found.complete
        (point,) = found
        assert (point.kind, point.criticality) == (Kind.PITCHFORK, Criticality.SUPERCRITICAL)
        assert point.value == pytest.approx(known, rel=1e-9)
        assert point.error_bound < 1e-9


# Pulses and jumps


def test_a_train_of_pulses():
    """x' = (-1 + sum of pulses of area 0.3 and width s) x: the multiplier is exp(-T + 0.3 n), whatever the width."""
    period, pulses = 5.0, np.array([0.3, 1.7, 2.9, 4.4])
    for width in (0.1, 1e-2, 1e-3):

        def rhs(t, x, width=width):
            total = -1.0
            for place in pulses:
                late = (t - place + 0.5 * period) % period - 0.5 * period
                total = total + 0.3 / (width * math.sqrt(2.0 * math.pi)) * np.exp(-0.5 * (late / width) ** 2)
            return [total * x[0]]

        assert_same(
            multipliers(from_rhs(rhs, 1, period), [0.0]), [math.exp(-period + 0.3 * pulses.size)], 1e-15 / width
        )


def test_forcing_by_the_sign_of_a_cosine():
    """x'' + 0.2 x' + x = sign(cos w t): each half period leads to a fixed state -+1, so that the orbit is known, and
    with S = -1 the return map of half a period is -exp(A T / 2)."""
    w, damping = 0.7, 0.2
    half = math.pi / w
    matrix = np.array([[0.0, 1.0], [-1.0, -damping]])
    system = from_rhs(
        lambda t, x: [x[1], -x[0] - damping * x[1] + np.sign(np.cos(w * t))], 2, 2.0 * half, symmetry=-np.eye(2)
    )
    carried = expm(matrix * half)
    rest = np.array([1.0, 0.0])
    # From a jump upwards at -T/4: y = rest + exp(A t) (y0 - rest), y(T/2) = -y0.
    jump = np.linalg.solve(np.eye(2) + carried, carried @ rest - rest)
    start = rest + expm(matrix * 0.5 * half) @ (jump - rest)
    orbit = find_orbit(system, [0.0, 0.0])
    assert orbit.state == pytest.approx(start, rel=1e-13)
    assert_same(multipliers(system, [0.0, 0.0]), np.linalg.eigvals(carried @ carried))


def test_a_square_wave_in_the_stiffness():
    """Meissner's equation x'' + c x' + (1 + 0.4 sign(cos t)) x = 0.

    With x = exp(-c t / 2) y a half of the period turns y by an angle a each, and the multipliers have the product
    exp(-2 pi c) and the sum exp(-pi c) (2 cos a1 cos a2 - (a1 / a2 + a2 / a1) sin a1 sin a2). In extended precision:
    the bound is finer than what double precision makes of it.
    """
    system = from_rhs(lambda t, x: [x[1], -(1.0 + 0.4 * np.sign(np.cos(t))) * x[0] - 0.1 * x[1]], 2, 2.0 * math.pi)
    c, pi = np.longdouble("0.1"), np.longdouble("3.14159265358979323846")
    stiff, soft = (pi * np.sqrt(np.longdouble(k) - c**2 / 4) for k in ("1.4", "0.6"))
    cosines, sines = np.cos(stiff) * np.cos(soft), np.sin(stiff) * np.sin(soft)
    half = np.exp(-pi * c) * (cosines - (stiff / soft + soft / stiff) * sines / 2)
    apart = half**2 - np.exp(-2 * pi * c)
    root = np.sqrt(abs(apart)) * (1.0 if apart > 0.0 else 1j)
    known = [complex(half + root), complex(half - root)]
    assert_same(multipliers(system, [0.0, 0.0]), known)


# A rotor


def test_a_rotor_with_internal_damping():
    """Jeffcott: z'' + (e + i) z' + (1 - 1j i w) z = u w^2 exp(1j w t), with external damping e and internal i. In the
    frame that turns with it everything is at rest, and z = exp(s t), s^2 + (e + i) s + 1 - 1j i w = 0: unstable above
    w = 1 + e / i, where s = 1j."""
    external, internal, unbalance = 0.05, 0.1, 0.02

    def rhs(t, x, w):
        a, b, p, q = x
        damping = external + internal
        return [
            p,
            q,
            -damping * p - a - internal * w * b + unbalance * w * w * np.cos(w * t),
            -damping * q - b + internal * w * a + unbalance * w * w * np.sin(w * t),
        ]

    def family(w):
        return from_rhs(rhs, 4, 2.0 * math.pi / w, args=(w,))

    def known(w):
        roots = np.roots([1.0, external + internal, 1.0 - 1j * internal * w])
        values = np.exp(2.0 * math.pi / w * roots)
        return [*values, *values.conj()]

    for w in (0.6, 1.4, 1.9):
        assert_same(multipliers(family(w), [0.0] * 4), known(w))
    threshold = 1.0 + external / internal
    found = locate(family, (1.2, 1.9), orbit=[0.0] * 4)
    assert found.complete
    (point,) = found
    assert point.kind is Kind.NEIMARK_SACKER
    assert abs(point.value - threshold) <= point.error_bound < 1e-10
    # The whirl is seen at the frequency 1 in one that turns at 1.5: once in 2 pi / 1.5 it turns by 4 pi / 3.
    assert point.frequency == pytest.approx(threshold - 1.0, rel=1e-9)


# Large systems


@pytest.mark.parametrize("masses", [3, 40])
def test_a_chain_whose_springs_stiffen_in_step(masses):
    """x_i'' + d x_i' + k(t) (2 x_i - x_{i-1} - x_{i+1}) = 0 between walls: mode j has the Hill equation
    y'' + d y' + k(t) (2 - 2 cos(pi j / (n + 1))) y = 0."""
    damping, rate = 0.05, 1.3
    period = 2.0 * math.pi / rate

    def chain(t, x):
        place, speed = x[:masses], x[masses:]
        left = np.concatenate([[0.0], place[:-1]])
        right = np.concatenate([place[1:], [0.0]])
        stiffness = 1.0 + 0.3 * np.cos(rate * t)
        return np.concatenate([speed, -damping * speed - stiffness * (2.0 * place - left - right)])

    def mode(t, y, square):
        return [y[1], -damping * y[1] - (1.0 + 0.3 * math.cos(rate * t)) * square * y[0]]

    known = []
    for j in range(1, masses + 1):
        square = 2.0 - 2.0 * math.cos(math.pi * j / (masses + 1))
        columns = [
            solve_ivp(mode, (0.0, period), start, "DOP853", args=(square,), rtol=3e-14, atol=1e-16).y[:, -1]
            for start in np.eye(2)
        ]
        known += np.linalg.eigvals(np.array(columns).T).tolist()
    found = multipliers(from_rhs(chain, 2 * masses, period), np.zeros(2 * masses))
    assert_same(found, known, 3e-13)
