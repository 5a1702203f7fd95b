"""Special points on branches of rings and of conservative systems, where several multipliers cross at once."""

from math import cos, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from chilopod.errors import ParameterError
from chilopod.stability import Ending, Kind, follow, from_rhs, locate, switch
from chilopod.stability.symmetry.isotypic import SymmetricKind
from helpers import systems

BETWEEN = (-2.0, 1.0)


def ring(cells, power, units=1.0, declared=True, moves=0.3):
    """Cells u -> u / 2 - c (u_left + u_right - 2 u) - u^power about an orbit that moves with c, in some units.

    Wave number k has the multiplier 1/2 + c l, l = 2 - 2 cos(2 pi k / cells): +1 at 1 / (2 l), -1 at -3 / (2 l).
    """
    shift = np.roll(np.eye(cells), 1, axis=0)
    coupling = shift + shift.T - 2.0 * np.eye(cells)
    symmetry = {"spatial_symmetry": [shift, np.eye(cells)[::-1]]} if declared else {}

    def family(c):
        center = (0.5 + moves * c) * units

        def image(x):
            u = (x - center) / units
            slope = 0.5 * np.eye(cells) - c * coupling - np.diag(power * u ** (power - 1))
            return center + units * (0.5 * u - c * coupling @ u - u**power), slope

        return systems.of_map(image, cells, share=4e-16, **symmetry)

    return family


def crossings(cells):
    factors = [2.0 - 2.0 * cos(2.0 * pi * k / cells) for k in range(1, cells // 2 + 1)]
    found = [(s / factor, 1 if abs(factor - 4.0) < 1e-9 else 2) for factor in factors for s in (-1.5, 0.5)]
    return sorted((value, count) for value, count in found if BETWEEN[0] < value < BETWEEN[1])


@pytest.mark.parametrize(("cells", "power"), [(3, 2), (4, 3), (5, 2), (5, 3)])
@pytest.mark.parametrize("units", [1.0, 1e-9])
def test_a_branch_of_symmetric_orbits_names_what_locate_does(cells, power, units):
    family, orbit = ring(cells, power, units), np.full(cells, -0.1 * units)
    special = [point.bifurcation for point in follow(family, orbit, BETWEEN).special_points]
    known = crossings(cells)
    assert len(special) == len(known)
    for point, (value, count) in zip(special, known, strict=True):
        assert abs(point.value - value) < 1e-12
        assert point.error_bound < 1e-12
        assert point.multiplicity == count
        np.testing.assert_allclose(point.orbit, (0.5 + 0.3 * value) * units, rtol=1e-11)
    for point, other in zip(special, locate(family, BETWEEN, orbit=orbit), strict=True):
        assert (point.kind, point.multiplicity) == (other.kind, other.multiplicity)
        assert point.symmetry.kind is other.symmetry.kind
        if other.modes is not None:
            assert point.modes.shape == other.modes.shape


def test_two_branches_leave_where_a_ring_of_three_crosses():
    """In the plane u = (a, b, a): a new orbit on either side of c = 1/6, along one line through it."""
    family = ring(3, 2)
    old = follow(family, np.full(3, -0.1), BETWEEN)
    (point,) = [point for point in old.special_points if point.special is Kind.TRANSCRITICAL]
    assert point.bifurcation.symmetry.kind is SymmetricKind.EQUIVARIANT_TRANSCRITICAL
    sides = []
    for start in switch(family, point):
        branch = follow(family, start, BETWEEN, points=5)
        assert branch.ending is Ending.ENOUGH_POINTS
        for each in branch.points[1:]:
            u = each.orbit - (0.5 + 0.3 * each.value)
            a, b = u[0], u[1]
            assert u[2] == pytest.approx(a, abs=1e-13)
            # a / 2 + a^2 = c (a - b) and b / 2 + b^2 = 2 c (b - a)
            assert 0.5 * a + a * a == pytest.approx(each.value * (a - b), abs=1e-10)
            assert 0.5 * b + b * b == pytest.approx(2.0 * each.value * (b - a), abs=1e-10)
            assert abs(a - b) > 1e-4
        sides.append(branch.points[-1].value - 1.0 / 6.0)
    assert sides[0] * sides[1] < 0.0


@pytest.mark.parametrize("count", [3, 5])
def test_what_leaves_a_ring_keeps_a_mirror(count):
    family = ring(count, 3)
    old = follow(family, np.full(count, -0.1), BETWEEN)
    for point in old.special_points:
        starts = switch(family, point, periods=1)
        branch = follow(family, starts[0], BETWEEN, points=4)
        assert branch.ending is Ending.ENOUGH_POINTS
        last = branch.points[-1]
        u = last.orbit - (0.5 + 0.3 * last.value)
        mirrors = [np.roll(u[::-1], turn) for turn in range(count)]
        assert min(float(np.abs(mirror - u).max()) for mirror in mirrors) < 1e-12
        assert np.abs(u).max() > 1e-3


@pytest.mark.parametrize(("cells", "moves"), [(3, 0.3), (5, 0.3), (7, 0.45), (3, 0.24), (5, 0.34), (7, 0.21)])
def test_the_symmetry_of_a_ring_need_not_be_declared(cells, moves):
    """However the last digits fall: where two multipliers cross at once, the matrix of the curve is singular but for
    rounding."""
    family = ring(cells, 3, declared=False, moves=moves)
    special = follow(family, np.full(cells, 0.5 - 2.0 * moves), BETWEEN).special_points
    known = crossings(cells)
    assert [point.bifurcation.multiplicity for point in special] == [count for _, count in known]
    for point, (value, _) in zip(special, known, strict=True):
        assert abs(point.value - value) < 1e-12


def test_the_bound_of_a_double_multiplier_of_a_flow():
    """Three Brusselators without a declared symmetry: where two multipliers cross at once, orbits leave in any
    direction of a plane. Truth by another integrator: the variation of one cell in a wave around the ring."""

    def cell(u, v):
        return 1.0 - 3.5 * u + u * u * v, 2.5 * u - u * u * v

    def family(c):
        def rhs(t, x):
            u, v = x[::2], x[1::2]
            du, dv = cell(u, v)
            spread = [c * (v[i - 1] + v[(i + 1) % 3] - 2.0 * v[i]) for i in range(3)]
            return [each for i in range(3) for each in (du[i], dv[i] + spread[i])]

        return from_rhs(rhs, 6, None, guess_period=6.58)

    def crossed(t, x):
        return x[0] - 0.5 if t > 1.0 else 1.0

    crossed.terminal, crossed.direction = True, -1.0

    def off(c):
        def rhs(t, x):
            (u, v), w = x[:2], x[2:].reshape(2, 2)
            slopes = np.array([[2.0 * u * v - 3.5, u * u], [2.5 - 2.0 * u * v, -u * u - 3.0 * c]])
            return np.concatenate([cell(u, v), (slopes @ w).ravel()])

        run = solve_ivp(rhs, (0.0, 9.0), [*start, 1, 0, 0, 1], "DOP853", events=crossed, rtol=1e-12, atol=1e-13)
        return np.linalg.eigvals(run.y[2:, -1].reshape(2, 2)).real.max() - 1.0

    start = [1.0, 3.0]
    for _ in range(12):
        run = solve_ivp(lambda t, x: cell(*x), (0.0, 9.0), start, "DOP853", events=crossed, rtol=1e-12, atol=1e-13)
        start = run.y[:, -1]
    true = brentq(off, 0.5, 0.6, xtol=1e-11)
    (point,) = follow(family, np.tile(start, 3), (0.3, 1.0)).special_points
    (other,) = locate(family, (0.3, 1.0), orbit=np.tile(start, 3))
    for found in (point.bifurcation, other):
        assert (found.kind, found.multiplicity) == (Kind.BRANCH_POINT, 2)
        assert abs(found.value - true) < 1e-9
        assert found.error_bound < 1e-8


def linear(matrix):
    """x' = A x about the orbit zero."""

    def family(p):
        a = np.array(matrix(p), dtype=float)
        return systems.linear(lambda t0, t1: expm(a * (t1 - t0)), len(a), orbit=None)

    return family


def test_two_multipliers_that_cross_at_once():
    special = follow(linear(lambda p: np.diag([p, 2.0 * p, -1.0])), np.zeros(3), (-0.3, 0.4)).special_points
    (point,) = (each.bifurcation for each in special)
    assert (point.kind, point.multiplicity) == (Kind.BRANCH_POINT, 2)
    assert abs(point.value) <= point.error_bound < 1e-13
    assert point.modes.shape == (3, 2)
    assert np.linalg.matrix_rank(point.modes[:2]) == 2


def test_krein_collision_on_a_branch():
    """x'' - 2 p y' = x, y'' + 2 p x' = y: s^2 = 1 - 2 p^2 +- 2 p sqrt(p^2 - 1), so pairs meet at p = 1."""
    family = linear(lambda p: [[0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 2 * p], [0, 1, -2 * p, 0]])
    (point,) = follow(family, np.zeros(4), (0.5, 1.0 + 0.2 * sqrt(7.0))).special_points
    assert point.special is Kind.KREIN_COLLISION
    assert abs(point.value - 1.0) <= point.bifurcation.error_bound < 1e-10
    assert point.bifurcation.multiplicity == 4
    assert point.bifurcation.frequency == pytest.approx(1.0, abs=1e-5)
    with pytest.raises(ParameterError, match="Krein"):
        switch(family, point)


def test_collision_at_plus_one_on_a_branch():
    """x'' = p x has the multipliers exp(+-sqrt(p))."""
    (point,) = follow(linear(lambda p: [[0.0, 1.0], [p, 0.0]]), np.zeros(2), (-0.7, 1.0)).special_points
    assert point.special is Kind.COLLISION
    assert abs(point.value) <= point.bifurcation.error_bound < 1e-10
