"""Curves of bifurcation points in two parameters, and their points of codimension two, with known answers."""

from dataclasses import replace
from functools import cache, partial

import numba
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import mathieu_b

from chilopod.stability import (
    BifurcationPoint,
    CodimensionTwo,
    Ending,
    Kind,
    PeriodicSystem,
    follow2,
    from_map,
    from_rhs,
    locate,
)
from helpers.systems import henon, of_map

mapped = partial(of_map, many=True)


def with_parameters(rhs, dimension, period, constants=(), **known):
    """``family2`` of a right-hand side that has both parameters, and constants, as its last states, at rest: built but
    once."""
    n = dimension
    extended = from_rhs(rhs, n + 2 + len(constants), period)

    def family2(p, q):
        behind = [p, q, *constants]

        def flow(x, t0, t1):
            state, derivative = extended.flow(np.append(x, behind), t0, t1)
            return state[:n], derivative[:n, :n]

        def flow_with_error(x, t0, t1):
            state, derivative, error = extended.flow_with_error(np.append(x, behind), t0, t1)
            return state[:n], derivative[:n, :n], error if np.ndim(error) == 0 else error[:n, :n]

        def flow_states(states, t0, t1):
            return extended.flow_states(np.hstack([states, np.tile(behind, (len(states), 1))]), t0, t1)[:, :n]

        return PeriodicSystem(n, period, flow, flow_with_error=flow_with_error, flow_states=flow_states, **known)

    return family2, extended


def kinds(curve):
    return [point.kind for point in curve.special]


def check_special(curve, *expected):
    """Kinds and values, within their bounds."""
    assert kinds(curve) == [kind for kind, _ in expected]
    for point, (_, values) in zip(curve.special, expected, strict=True):
        assert (np.abs(point.values - values) <= point.error_bound).all()
        assert (point.error_bound <= 1e-9 * (1.0 + np.abs(values))).all()


def check_next(point, expected):
    assert abs(point.next_coefficient - expected) <= point.next_coefficient_error < 1e-6 * abs(expected)


def check_curve(curve, across, radius=lambda point: 1.0):
    """``across(values)``, a function that is zero on the curve, is so within the bounds of all points, which are small:
    the rounding of a state is divided by the radius of the motion."""
    special = {id(point) for point in curve.special}
    for point in curve.points:
        slopes = [
            (across(point.values + h) - across(point.values - h)) / 2e-6
            for h in (np.array([1e-6, 0]), np.array([0, 1e-6]))
        ]
        assert abs(across(point.values)) <= np.abs(slopes) @ point.error_bound
        assert id(point) in special or (point.error_bound * radius(point) < 1e-11 * (1.0 + np.abs(point.values))).all()


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_cusp(unit):
    """x -> x + p + q x - x^3 has folds at 27 p^2 = 4 q^3."""

    def family2(p, q):
        return mapped(lambda x: (x + p + q * x - x**3 / unit**2, np.array([[1.0 + q - 3.0 * x[0] ** 2 / unit**2]])))

    x = -np.sqrt(0.5 / 3.0)
    start = BifurcationPoint(
        Kind.FOLD, unit * (x**3 - 0.5 * x), 0.0, np.array([x * unit]), np.ones(1, complex), 1.0 + 0j, 0.0
    )
    curve = follow2(family2, start, ((-unit, unit), (-1.0, 1.0)), second=0.5)
    check_curve(curve, lambda values: 27.0 * (values[0] / unit) ** 2 - 4.0 * values[1] ** 3) if unit == 1.0 else None
    assert kinds(curve) == [CodimensionTwo.CUSP]
    (cusp,) = curve.special
    assert (np.abs(cusp.values) <= cusp.error_bound).all()
    assert (cusp.error_bound <= 1e-13 * np.array([unit, 1.0])).all()
    check_next(cusp, -(unit**-2.0))
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    assert curve.values[0][1] == curve.values[-1][1] == 1.0
    assert curve.values[0][0] == pytest.approx(-curve.values[-1][0], rel=1e-12)


def test_the_tip_of_an_arnold_tongue_is_no_cusp():
    """x -> x + q + p sin x has folds at q = p and q = -p, which are straight; at p = q = 0 it is the identity."""

    def family2(q, p):
        return mapped(lambda x: (x + q + p * np.sin(x), np.array([[1.0 + p * np.cos(x[0])]])))

    start = BifurcationPoint(Kind.FOLD, 0.5, 0.0, np.array([1.5 * np.pi]), np.ones(1, complex), 1.0 + 0j, 0.0)
    curve = follow2(family2, start, ((-1.0, 1.0), (-0.2, 0.8)), second=0.5)
    check_special(curve, (CodimensionTwo.DEGENERATE_FOLD, [0.0, 0.0]))
    assert curve.special[0].next_coefficient_error < 1e-9
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)


def test_a_curve_that_is_lost_at_the_tip_of_an_arnold_tongue_says_so():
    """A circle map with a decay towards the circle: at p = q = 0 every angle is a fixed point."""

    def family2(q, p):
        def image(x):
            r, a = np.hypot(*x), np.arctan2(x[1], x[0])
            radius = 1.0 + 0.3 * (r - 1.0) + p * np.cos(a)
            angle = a + q + p * np.sin(a) + 0.2 * (r - 1.0) + 0.3 * p * np.cos(2.0 * a)
            c, s = np.cos([a, angle]), np.sin([a, angle])
            polar = np.array([[0.3, -p * s[0]], [0.2, 1.0 + p * c[0] - 0.6 * p * np.sin(2.0 * a)]])
            out, back = (
                np.array([[c[1], -radius * s[1]], [s[1], radius * c[1]]]),
                np.array([[c[0], s[0]], [-s[0] / r, c[0] / r]]),
            )
            return radius * np.array([c[1], s[1]]), out @ polar @ back

        return from_map(image, 2)

    (fold,) = locate(lambda q: family2(q, 0.1), (0.0, 0.5), orbit=[1.0, 0.0])
    curve = follow2(family2, fold, ((-0.5, 0.5), (-0.2, 0.4)), second=0.1, rising=False)
    assert curve.endings[1] is Ending.LOST
    assert np.abs(curve.values[-1]).max() < 1e-4
    assert "tip of an Arnold tongue" in curve.reasons[1]


def area_changing(a, b, c=0.2):
    """(x, y) -> (y, a - b x - y^2 + c x y): at its fixed point the determinant is b - c x, the trace (c - 2) x."""
    return mapped(
        lambda x: (
            np.array([x[1], a - b * x[0] - x[1] * x[1] + c * x[0] * x[1]]),
            np.array([[0.0, 1.0], [c * x[1] - b, c * x[0] - 2.0 * x[1]]]),
        ),
        2,
    )


def parameters_at(x, b, c=0.2):
    """(b, a) for which x is the fixed point."""
    return np.array([b, x * x * (1.0 - c) + (1.0 + b) * x])


@cache
def torus_curve():
    (start,) = locate(lambda b: area_changing(0.2, b), (0.2, 1.5), orbit=[0.1, 0.1], normal_form=False)
    return follow2(
        lambda b, a: area_changing(a, b), start, ((0.2, 1.9), (-2.0, 5.0)), second=0.2, points=150, longest=0.1
    )


def test_resonances_on_a_curve_of_neimark_sacker():
    curve = torus_curve()
    assert curve.kind is Kind.NEIMARK_SACKER
    expected = []
    for kind, cosine in [
        (CodimensionTwo.RESONANCE_1_1, 1.0),
        (CodimensionTwo.RESONANCE_1_4, 0.0),
        (CodimensionTwo.RESONANCE_1_3, -0.5),
        (CodimensionTwo.RESONANCE_1_2, -1.0),
    ]:
        x = 2.0 * cosine / (0.2 - 2.0)
        expected.append((kind, parameters_at(x, 1.0 + 0.2 * x)))
    check_special(curve, *expected)
    assert curve.endings == (Ending.RESONANCE, Ending.RESONANCE)
    for point in curve.points:
        x = 2.0 * point.multiplier.real / (0.2 - 2.0)
        np.testing.assert_allclose(point.values, parameters_at(x, 1.0 + 0.2 * x), atol=1e-12)


@pytest.mark.parametrize(("units", "first"), [((1.0, 1.0), 1.0), ((1e-7, 1e5), 1e6)])
def test_double_multiplier_and_flip_on_a_curve_of_folds(units, first):
    """With states, and the first parameter, in any units."""
    units = np.array(units)

    def family2(a, b):
        plain = area_changing(a / first, b)

        def image(x):
            state, jacobian = plain.flow(x / units, 0.0, 1.0)
            return state * units, jacobian * units[:, None] / units

        return mapped(image, 2, 1e-15 * np.outer(units, 1.0 / units))

    x = np.full(2, -1.5 / 1.6)
    start = BifurcationPoint(Kind.FOLD, -(1.5**2) / 3.2 * first, 0.0, x * units, units.astype(complex), 1.0 + 0j, 0.0)
    curve = follow2(family2, start, ((-2.0 * first, first), (-2.0, 1.5)), second=0.5, longest=0.1)
    scale = np.array([first, 1.0])
    points = (replace(each, values=each.values / scale, error_bound=each.error_bound / scale) for each in curve.points)
    curve = replace(curve, points=tuple(points))
    check_curve(curve, lambda values: values[0] + (1.0 + values[1]) ** 2 / 3.2)
    assert all((point.error_bound < 1e-11).all() for point in curve.special)
    check_special(
        curve,
        (CodimensionTwo.FOLD_FLIP, (0.0, -1.0)),
        (CodimensionTwo.RESONANCE_1_1, (-((16.0 / 9.0) ** 2) / 3.2, 7.0 / 9.0)),
    )


def test_double_multiplier_on_a_curve_of_flips():
    """The Henon map (x, y) -> (1 - a x^2 + y, b x) has its period doubling at a = 3 (1 - b)^2 / 4."""
    (start,) = locate(lambda a: henon(a, 0.3), (0.1, 0.8), orbit=[0.8, 0.24])
    curve = follow2(henon, start, ((0.05, 5.0), (-1.4, 0.7)), second=0.3, longest=0.1)
    check_curve(curve, lambda values: values[0] - 0.75 * (1.0 - values[1]) ** 2)
    check_special(curve, (CodimensionTwo.RESONANCE_1_2, (3.0, -1.0)))
    nearest = min(curve.points, key=lambda point: abs(point.values[1] - 0.3))
    assert nearest.coefficient == pytest.approx(start.coefficient, rel=1e-6)


def test_generalised_period_doubling():
    """Twice x -> -m x + e x^2 + c x^3 at m = 1 is x - 2 (c + e^2) x^3 + ...; here m = 1 + p - q^2, c = q."""

    def family2(p, q):
        m = 1.0 + p - q * q
        return mapped(
            lambda x: (-m * x + 0.6 * x**2 + q * x**3, np.array([[-m + 1.2 * x[0] + 3.0 * q * x[0] ** 2]])),
            orbit=np.zeros(1),
        )

    (start,) = locate(lambda p: family2(p, 0.1), (-0.2, 0.3))
    curve = follow2(family2, start, ((-0.5, 0.5), (-0.6, 0.6)), second=0.1)
    check_curve(curve, lambda values: values[0] - values[1] ** 2)
    check_special(curve, (CodimensionTwo.GENERALISED_PERIOD_DOUBLING, (0.36**2, -0.36)))
    # a = u + s u^2 + t u^4, for the s and t with which u has no square and no fourth power, goes to -u - 2 c^2 u^5.
    check_next(curve.special[0], 4.0 * 0.36**2)
    for point in (each for each in curve.points if each.coefficient is not None):
        assert point.coefficient == pytest.approx(-2.0 * (point.values[1] + 0.36), abs=1e-7)


def test_degenerate_pitchfork_of_an_orbit_with_a_spatial_symmetry():
    """x -> x (1 + p + y) - (2.5 + q) x^3, y -> y / 2 + q / 5 + x^2: y = 0.4 q + 2 x^2 on the centre manifold."""

    def family2(p, q):
        return mapped(
            lambda z: (
                np.array([z[0] * (1.0 + p + z[1]) - (2.5 + q) * z[0] ** 3, 0.5 * z[1] + 0.2 * q + z[0] ** 2]),
                np.array([[1.0 + p + z[1] - 3.0 * (2.5 + q) * z[0] ** 2, z[0]], [2.0 * z[0], 0.5]]),
            ),
            2,
            spatial_symmetry=np.diag([-1.0, 1.0]),
        )

    start = BifurcationPoint(Kind.PITCHFORK, -0.2, 0.0, np.array([0.0, 0.2]), np.array([1.0 + 0j, 0.0]), 1.0 + 0j, 0.0)
    curve = follow2(family2, start, ((-1.0, 1.0), (-1.0, 1.0)), second=0.5)
    check_curve(curve, lambda values: values[0] + 0.4 * values[1])
    check_special(curve, (CodimensionTwo.DEGENERATE_PITCHFORK, (0.2, -0.5)))


def test_chenciner():
    """z -> z e^(i w) (1 + p - q^2 + (q - 0.3) |z|^2 - |z|^4 / 2) turns at q = 0.3."""

    def family2(p, q):
        turn = np.exp(1j * (1.1 + 0.3 * q))

        def image(x):
            z = complex(*x)
            size = abs(z) ** 2
            factor = 1.0 + p - q * q + (q - 0.3) * size - 0.5 * size**2
            slope = (q - 0.3) - size
            columns = []
            for direction in (1.0, 1.0j):
                moved = turn * (direction * factor + z * slope * 2.0 * (z.conjugate() * direction).real)
                columns.append([moved.real, moved.imag])
            mapped_z = turn * z * factor
            return np.array([mapped_z.real, mapped_z.imag]), np.array(columns).T

        return mapped(image, 2, orbit=np.zeros(2))

    (start,) = locate(lambda p: family2(p, 0.1), (-0.2, 0.3))
    curve = follow2(family2, start, ((-0.5, 0.5), (-0.6, 0.6)), second=0.1)
    check_curve(curve, lambda values: values[0] - values[1] ** 2)
    check_special(curve, (CodimensionTwo.CHENCINER, (0.09, 0.3)))
    check_next(curve.special[0], -0.5 * 2.0**2)  # |z| is sqrt(2) of the amplitude along the unit mode


def test_chenciner_of_a_cycle():
    """z' = (p - 0.3 + (q - 0.1) |z|^2 - 0.4 |z|^4 + 0.6 i) z beside the unit circle, seen as (2 + cos phi) z: the mean
    square of that factor is 4.5, wherever the orbit starts."""

    def family2(p, q):
        def rhs(t, x):
            wide, square = 2.0 + x[0], 1.0 - x[0] * x[0] - x[1] * x[1]
            size = (x[2] * x[2] + x[3] * x[3]) / wide**2
            u, v = x[0] * square - x[1], x[1] * square + x[0]
            grow = p - 0.3 + (q - 0.1) * size - 0.4 * size * size + u / wide
            return [u, v, grow * x[2] - 0.6 * x[3], grow * x[3] + 0.6 * x[2]]

        return from_rhs(rhs, 4, None, guess_period=6.2)

    (start,) = locate(lambda p: family2(p, 0.05), (0.2, 0.43), orbit=[-0.8, 0.6, 0.0, 0.0])
    box = ((0.2, 0.43), (0.0, 0.2))
    curve = follow2(family2, start, box, second=0.05, rising=True, step=0.4, longest=0.4, points=1)
    share = 2.0 / 4.5  # |z|^2 of the amplitude 1
    for point in (start, curve.points[0]):
        assert abs(point.coefficient + 0.1 * np.pi * share) <= point.coefficient_error < 1e-7
    (turn,) = curve.special
    assert turn.kind is CodimensionTwo.CHENCINER
    assert (np.abs(turn.values - [0.3, 0.1]) <= turn.error_bound).all()
    assert abs(turn.next_coefficient + 0.8 * np.pi * share**2) <= turn.next_coefficient_error < 1e-5


@pytest.mark.parametrize("off", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("order", [3, 4])
def test_chenciner_near_a_resonance(off, order):
    """u -> (1 + p) (1 + q u^2 + 2 u^4) u, turned by an angle near 2 pi / order, in coordinates that are bent."""

    def turned(u, p, q):
        size = u @ u
        angle = 2.0 * np.pi / order + off + 0.7 * size + 0.3 * size**2
        factor, rise = (1.0 + p) * (1.0 + q * size + 2.0 * size**2), (1.0 + p) * (q + 4.0 * size)
        turn, across = turning(angle, 1.0), turning(angle + 0.5 * np.pi, 1.0)
        slopes = rise * turn @ u + factor * (0.7 + 0.6 * size) * across @ u
        return factor * turn @ u, factor * turn + np.outer(slopes, 2.0 * u)

    def bent(u):
        y = u[1] + 0.5 * u[0] ** 2
        return np.array([u[0] + 0.8 * y**2, y]), np.array([[1.0 + 1.6 * y * u[0], 1.6 * y], [u[0], 1.0]])

    def straight(w):
        x = w[0] - 0.8 * w[1] ** 2
        return np.array([x, w[1] - 0.5 * x**2]), np.array([[1.0, -1.6 * w[1]], [-x, 1.0 + 1.6 * w[1] * x]])

    def family2(p, q):
        def image(w):
            u, first = straight(w)
            v, second = turned(u, p, q)
            end, third = bent(v)
            return end, third @ second @ first

        return from_map(image, 2)

    (start,) = locate(lambda p: family2(p, 0.2), (-0.2, 0.3), orbit=[0.0, 0.0])
    (point,) = follow2(family2, start, ((-0.5, 0.5), (-0.5, 0.5)), second=0.2).special
    assert point.kind is CodimensionTwo.CHENCINER
    assert abs(point.next_coefficient - 8.0) <= point.next_coefficient_error < 1e-3


def turning(angle, size):
    return size * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (-np.eye(1), turning(1.0, 1.0), CodimensionTwo.FLIP_NEIMARK_SACKER),
        (turning(1.0, 1.0), -np.eye(1), CodimensionTwo.FLIP_NEIMARK_SACKER),
        (turning(0.7, 1.0), turning(1.9, 1.0), CodimensionTwo.DOUBLE_NEIMARK_SACKER),
    ],
)
def test_two_at_once(first, second, expected):
    """A linear map of two blocks that are critical at p = q / 4 and at q = 0.2, in slanted coordinates."""
    n = len(first) + len(second)
    basis = np.eye(n) + 0.3 * np.sin(np.arange(n * n)).reshape(n, n)

    def family2(p, q):
        blocks = np.zeros((n, n))
        blocks[: len(first), : len(first)] = (1.0 + p - 0.25 * q) * first
        blocks[len(first) :, len(first) :] = (1.0 + p * p + q - 0.2) * second
        matrix = basis @ blocks @ np.linalg.inv(basis)
        return mapped(lambda x: (matrix @ x, matrix), n, orbit=np.zeros(n))

    (start,) = locate(lambda p: family2(p, 0.05), (-0.1, 0.2), normal_form=False)
    curve = follow2(family2, start, ((-0.5, 0.5), (-0.4, 0.4)), second=0.05, coefficients=False)
    check_curve(curve, lambda values: values[0] - 0.25 * values[1])
    q = 8.0 * (np.sqrt(1.0 + 0.05) - 1.0)  # of q^2 / 16 + q = 0.2
    check_special(curve, (expected, (0.25 * q, q)))


def test_first_tongue_of_the_mathieu_equation():
    """x'' + (a - 2 q cos 2t) x = 0 doubles its period at a = b_1(q); nothing is damped, so -1 is double all along."""
    family2, _ = with_parameters(mathieu, 2, np.pi, orbit=[0.0, 0.0])
    value = float(mathieu_b(1, 0.5))
    start = BifurcationPoint(Kind.PERIOD_DOUBLING, value, 0.0, np.zeros(2), np.array([0.0, 1.0 + 0j]), -1.0 + 0j, 1.0)
    curve = follow2(family2, start, ((0.0, 1.0), (0.3, 0.8)), second=0.5, step=0.3, longest=0.5, coefficients=False)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    assert not curve.special
    for point in curve.points:
        a, q = point.values
        assert abs(a - mathieu_b(1, q)) <= point.error_bound.sum() < 1e-9


@numba.njit
def mathieu(t, x):
    return np.array([x[1], -(x[2] - 2.0 * x[3] * np.cos(2.0 * t)) * x[0], 0.0 * x[2], 0.0 * x[3]])


@numba.njit
def duffing(t, x):
    """x'' + d x' + c x + x^3 = F cos(w t), in units of w t, with F, d, w and c behind."""
    slope = -x[3] * x[1] - x[5] * x[0] - x[0] * x[0] * x[0] + x[2] * np.cos(t)
    return np.array([x[1] / x[4], slope / x[4], 0.0 * x[2], 0.0 * x[3], 0.0 * x[4], 0.0 * x[5]])


def test_cusp_of_the_forced_duffing_oscillator():
    """Where the resonance of a hardening spring begins to fold over as its damping falls, w = 1.7.

    Along the orbits at a damping, in the order of their speeds at time 0, F' and F'' vanish together there.
    """
    family2, extended = with_parameters(duffing, 2, 2.0 * np.pi, (1.7, 1.0))
    located = locate(lambda force: family2(force, 0.6), (0.2, 1.8), orbit=[-0.1, 0.05], normal_form=False)
    start = next(point for point in located if point.kind is Kind.FOLD)
    curve = follow2(family2, start, ((0.05, 2.0), (0.1, 1.0)), second=0.6, rising=True, points=14, longest=0.2)
    cusp = curve.special[0]
    assert cusp.kind is CodimensionTwo.CUSP
    assert (cusp.error_bound < 1e-8).all()

    nodes = np.cos(np.pi * (np.arange(12) + 0.5) / 12)
    x, speed = cusp.orbit

    def forces(damping):
        """F of the orbits with given speeds x'(0), as a series; unknown are x(0) and F."""
        found = []
        for node in nodes:
            state = np.array([x, speed + 0.05 * node, cusp.values[0], damping, 1.7, 1.0])
            for _ in range(6):
                image, slope = extended.flow(state, 0.0, 2.0 * np.pi)
                matrix = slope[:2, [0, 2]] - np.array([[1.0, 0.0], [0.0, 0.0]])
                state[[0, 2]] += np.linalg.solve(matrix, (state - image)[:2])
            found.append(state[2])
        return np.polynomial.chebyshev.Chebyshev.fit(nodes, found, 11, domain=[-1, 1])

    def flattest(series):
        roots = series.deriv(2).roots()
        return roots[np.abs(roots).argmin()].real

    def least_slope(damping):
        series = forces(damping)
        return float(series.deriv(1)(flattest(series)))

    damping = brentq(least_slope, cusp.values[1] - 0.01, cusp.values[1] + 0.01, xtol=1e-9)
    assert damping == pytest.approx(cusp.values[1], abs=1e-7)
    series = forces(damping)
    assert series(flattest(series)) == pytest.approx(cusp.values[0], abs=1e-7)


def test_folds_of_cycles_of_an_autonomous_system():
    """r' = p - 0.1 + (q - 0.2) (r - 1) - (r - 1)^3 with the angle going round once in 2 pi."""
    plain, _ = with_parameters(polar, 2, 1.0)

    def family2(p, q):
        return replace(
            plain(p, q), period=None, velocity=lambda x: polar(0.0, np.append(x, [p, q]))[:2], guess_period=2.0 * np.pi
        )

    x = -np.sqrt(0.1 / 3.0)
    start = BifurcationPoint(
        Kind.FOLD, 0.1 + x**3 - 0.1 * x, 0.0, np.array([1.0 + x, 0.0]), np.array([1.0 + 0j, 0.0]), 1.0 + 0j, 0.0
    )
    curve = follow2(
        family2, start, ((-0.1, 0.3), (-0.3, 0.7)), second=0.3, points=4, step=0.3, longest=0.4, rising=False
    )
    for point in curve.points:
        p, q = point.values - [0.1, 0.2]
        assert 27.0 * p**2 == pytest.approx(4.0 * q**3, abs=1e-11)
    (cusp,) = curve.special
    assert cusp.kind is CodimensionTwo.CUSP
    assert (np.abs(cusp.values - [0.1, 0.2]) <= cusp.error_bound).all()
    assert (cusp.error_bound < 1e-9).all()
    check_next(cusp, -2.0 * np.pi)


@pytest.mark.parametrize("middle", [(0.0, 0.0), (3.0, -1.0)])
def test_folds_of_cycles_end_in_a_bautin_point(middle):
    """r' = r (p + q r^2 - r^4) has folds at p = -q^2 / 4 for q > 0 only, where r^2 = q / 2."""

    def family2(p, q):
        def rhs(t, x):
            u, v = x[0] - middle[0], x[1] - middle[1]
            s = u * u + v * v
            grown = p + q * s - s * s
            return [grown * u - v, grown * v + u]

        return from_rhs(rhs, 2, None, guess_period=2.0 * np.pi)

    orbit = np.add(middle, [np.sqrt(0.4), 0.0])
    start = BifurcationPoint(Kind.FOLD, -0.16, 0.0, orbit, np.array([1.0 + 0j, 0.0]), 1.0 + 0j, 0.0)
    curve = follow2(family2, start, ((-0.5, 0.5), (-0.7, 1.2)), second=0.8, rising=False, coefficients=False)
    assert curve.endings[1] is Ending.LOST
    assert "a Bautin point" in curve.reasons[1]
    assert 0.0 < curve.values[-1][1] < 1e-3
    check_curve(
        curve,
        lambda values: values[0] + 0.25 * values[1] ** 2,
        radius=lambda point: np.linalg.norm(point.orbit - middle),
    )


@numba.njit
def polar(t, x):
    r = np.sqrt(x[0] * x[0] + x[1] * x[1])
    grown = (x[2] - 0.1 + (x[3] - 0.2) * (r - 1.0) - (r - 1.0) * (r - 1.0) * (r - 1.0)) / r
    return np.array([grown * x[0] - x[1], grown * x[1] + x[0], 0.0 * x[2], 0.0 * x[3]])


def test_pitchfork_of_the_half_period_map_to_a_known_one():
    """The pitchfork at d = 0.2, known to twenty digits, reached along the curve from another damping."""
    family2, _ = with_parameters(duffing, 2, 2.0 * np.pi, (1.0, 0.0), symmetry=-np.eye(2))
    (start,) = locate(lambda force: family2(force, 0.22), (2.3, 2.7), orbit=[1.88, 0.64], normal_form=False)
    curve = follow2(family2, start, ((2.0, 3.0), (0.2, 0.3)), second=0.22, rising=False, longest=0.2)
    assert curve.kind is Kind.PITCHFORK
    end = curve.points[-1]
    assert end.values[1] == 0.2
    assert abs(end.values[0] - 2.40337711605714358988) <= end.error_bound.sum() < 1e-10
    np.testing.assert_allclose(end.orbit, [1.87793925257730701435, 0.63506905472679528861], atol=1e-11)
    assert end.frequency == 0.0
    assert end.coefficient < -end.coefficient_error
