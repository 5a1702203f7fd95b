"""Every crossing in the interval is found, none is invented, and each lies within its error bound."""

import contextlib
import math
import time
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import brentq

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import (
    Ending,
    Kind,
    PeriodicSystem,
    SearchStatus,
    SpentError,
    find_orbit,
    follow,
    from_map,
    from_rhs,
    locate,
)
from helpers.systems import linear, lorenz

PERIOD = 1.3


def diagonal(*rates):
    """Multipliers exp(T rate(mu)), one a dimension."""

    def system(mu):
        values = np.array([rate(mu) for rate in rates])
        return linear(lambda t0, t1: np.diag(np.exp(values * (t1 - t0))), len(values), PERIOD)

    return system


def with_roots(*roots, scale=1.0):
    return lambda mu: scale * np.prod([mu - root for root in roots])


def decaying(mu):
    return -1.0


def assert_found(points, roots):
    assert len(points) == len(roots), [point.value for point in points]
    for point, root in zip(points, sorted(roots), strict=True):
        assert abs(point.value - root) <= point.error_bound
        assert point.error_bound < 1e-6


def test_an_interval_without_a_crossing_has_no_points():
    for offset in (-0.1, 0.3):
        found = locate(diagonal(lambda mu, at=offset: at + np.sign(at) * mu * mu, decaying), (-1.0, 1.0))
        assert len(found) == 0
        assert found.complete


@pytest.mark.parametrize("roots", [(0.3, 0.32), (0.43, 0.445), (0.05, 0.9), (0.41, 0.48)], ids=str)
@pytest.mark.parametrize("scale", [-0.1, -1.0, -100.0, 1.0])
def test_out_and_in_again_within_a_small_part_of_the_interval(roots, scale):
    assert_found(locate(diagonal(with_roots(*roots, scale=scale), decaying), (0.0, 1.0)), roots)


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4, 1e-5, 1e-7])
def test_two_multipliers_that_cross_nearly_together(gap):
    both_out = diagonal(with_roots(0.3), with_roots(0.3 + gap, scale=2.0), decaying)
    assert_found(locate(both_out, (0.0, 1.0)), (0.3, 0.3 + gap))
    one_out_one_in = diagonal(with_roots(0.3), with_roots(0.3 + gap, scale=-2.0), decaying)
    assert_found(locate(one_out_one_in, (0.0, 1.0)), (0.3, 0.3 + gap))


@pytest.mark.parametrize("where", [0.5, 0.25, 0.625])
def test_a_crossing_at_a_point_of_the_first_grid(where):
    assert_found(locate(diagonal(with_roots(where), decaying), (0.0, 1.0)), (where,))


@given(
    st.lists(st.integers(1, 31), min_size=1, max_size=3, unique=True),
    st.sampled_from([-30.0, -3.0, 3.0, 30.0]),
    st.floats(-3.0, -0.2),
)
def test_none_missed(places, scale, other):
    roots = [0.031 * place for place in places]
    assert_found(locate(diagonal(with_roots(*roots, scale=scale), lambda mu: other), (0.0, 1.0)), roots)


def test_bound_holds_in_a_slanted_basis_far_from_zero():
    """Large values of the parameter, an ill-conditioned eigenbasis, an awkward scale."""
    basis = np.array([[1.0, 1.0, 0.0], [0.0, 1e-3, 1.0], [0.3, 0.0, 1.0]])
    inverse = np.linalg.inv(basis)
    root = 41234.5678

    def system(mu):
        rates = np.array([1e-4 * (mu - root), -0.5, -2.0])
        return linear(lambda t0, t1: basis @ np.diag(np.exp(rates * (t1 - t0))) @ inverse, 3, PERIOD)

    (point,) = locate(system, (20000.0, 75000.0))
    assert abs(point.value - root) <= point.error_bound < 1e-3
    np.testing.assert_allclose(point.mode.real, basis[:, 0] / np.linalg.norm(basis[:, 0]), atol=1e-9)


def test_kinds_side_by_side():
    """A real multiplier through +1, a pair through the circle and, with half a turn a period, one through -1."""

    def system(mu):
        def moves(t0, t1):
            t = t1 - t0
            matrix = np.zeros((5, 5))
            matrix[0, 0] = np.exp((mu - 0.2) * t)
            c, s = np.cos(1.1 * t), np.sin(1.1 * t)
            matrix[1:3, 1:3] = np.exp((mu - 0.5) * t) * np.array([[c, s], [-s, c]])
            # A Moebius frame: turned by pi in a period, then stretched in the turned axes.
            a, b = pi * t0 / PERIOD, pi * t1 / PERIOD
            before = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
            after = np.array([[np.cos(b), -np.sin(b)], [np.sin(b), np.cos(b)]])
            matrix[3:, 3:] = after @ np.diag(np.exp([(mu - 0.8) * t, -t])) @ before.T
            return matrix

        return linear(moves, 5, PERIOD)

    points = locate(system, (0.0, 1.0), normal_form=False)
    assert_found(points, (0.2, 0.5, 0.8))
    assert [point.kind for point in points[1:]] == [Kind.NEIMARK_SACKER, Kind.PERIOD_DOUBLING]
    assert points[1].frequency == pytest.approx(1.1, rel=1e-12)
    assert points[2].frequency == pytest.approx(pi / PERIOD, rel=1e-12)


def test_a_pair_that_meets_on_the_real_axis_is_no_bifurcation():
    """Complex inside, complex no more, then one real multiplier leaves: one point only."""

    def system(mu):
        # Eigenvalues -0.3 +- sqrt(mu - 0.4): complex below 0.4, real above, zero at 0.49.
        return linear(lambda t0, t1: expm(np.array([[-0.3, 1.0], [mu - 0.4, -0.3]]) * (t1 - t0)), 2, PERIOD)

    assert_found(locate(system, (0.0, 1.0)), (0.49,))


@pytest.mark.parametrize(
    "between", [(1.0, 0.0), (0.0, 0.0), (0.0, np.inf), (np.nan, 1.0), (0.0,), (0, 1, 2), "ab", None, (1e6, 1e6 + 2e-9)]
)
def test_a_bad_interval_is_one_line(between):
    with pytest.raises(ParameterError) as error:
        locate(diagonal(decaying), between)
    assert str(error.value).startswith("between")
    assert "\n" not in str(error.value)


def test_a_family_without_known_orbits_needs_a_guess():
    def system(mu):
        return PeriodicSystem(1, 1.0, lambda x, t0, t1: (x, np.eye(1)))

    with pytest.raises(AnalysisError, match="has no known periodic orbit"):
        locate(system, (0.0, 1.0))


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e9])
def test_an_orbit_at_rest_is_followed_from_a_guess_beside_it(unit):
    """x' = (p - 1/4) x - x^3 / unit^2 over a time 2, in closed form: the zero orbit has a pitchfork at 1/4."""

    def family(p):
        a = p - 0.25

        def flow(x, t0, t1):
            grow = np.exp(a * (t1 - t0))
            spread = np.expm1(2.0 * a * (t1 - t0)) / a if a else 2.0 * (t1 - t0)
            share = 1.0 + (x[0] / unit) ** 2 * spread
            return x * grow / np.sqrt(share), np.array([[grow / share**1.5]])

        return PeriodicSystem(1, 2.0, flow)

    found = locate(family, (-0.5, 1.0), orbit=[0.3 * unit])
    assert found.complete
    (point,) = found
    assert point.kind is Kind.PITCHFORK
    assert abs(point.value - 0.25) <= point.error_bound < 1e-10
    assert not point.orbit.any()


SYMMETRIC = {310.0: [-37.42354634, -94.33277851, 305.61384361], 311.0: [-37.38058567, -94.55590981, 306.15255370]}
"""States on symmetric orbits."""


@pytest.mark.parametrize("between", [(310.0, 316.0), (311.0, 320.0), (310.0, 350.0)])
def test_a_pitchfork_of_a_symmetry_that_is_not_declared(between):
    """Lorenz (1963): the symmetric orbit gives way as r falls. With the symmetry in time the return map is another one,
    with the multiplier -1."""
    orbit = find_orbit(lorenz(between[0], 0.41), SYMMETRIC[between[0]]).state
    found = locate(lambda r: lorenz(r, 0.41), between, orbit=orbit)
    half = locate(lambda r: lorenz(r, 0.41, symmetry=np.diag([-1.0, -1.0, 1.0])), between, orbit=orbit)
    (point,), (known,) = found, half
    assert found.complete
    assert half.complete
    assert point.kind is known.kind is Kind.PITCHFORK
    assert abs(point.value - known.value) <= point.error_bound + known.error_bound < 1e-6


def test_an_orbit_that_meets_another_one_and_ends_is_not_all():
    """The asymmetric orbit ends in the pitchfork; beyond it Newton's method finds the symmetric one."""
    found = locate(lambda r: lorenz(r, 0.41), (305.0, 325.0), orbit=[-13.484487, 37.180551, 286.471177])
    assert not found.complete
    assert any("near 312.973" in remark and "another orbit meets it" in remark for remark in found.remarks)


@pytest.mark.parametrize("gap", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_two_orbits_that_pass_each_other_at_a_distance(gap, side):
    """The fixed points p/2 +- sqrt(p^2 + gap^2)/2 exchange what they look like, and neither bifurcates."""

    def passing(p):
        return from_map(lambda x: ([x[0] + 0.5 * (p * x[0] - x[0] ** 2 + gap**2 / 4)], [[1.0 + 0.5 * p - x[0]]]), 1)

    found = locate(passing, (-1.0, 1.3), orbit=[0.5 * (-1.0 + side * np.hypot(1.0, gap))])
    assert (len(found), found.status.name) == (0, "COMPLETE")


@pytest.mark.parametrize("between", [(-0.6, 1.3), (-0.45, 1.25), (-0.5, 1.5), (-0.15, 1.1)])
def test_an_orbit_is_followed_through_the_points_where_another_one_crosses_it(between):
    """The fixed points 0 and m = p(1 - p) exchange stability at p = 0 and p = 1; a long step past one of these points
    comes down on the other one, whose multiplier has not passed +1."""

    def exchanging(p):
        m = p * (1.0 - p)
        return from_map(lambda x: ([(1.0 + m) * x[0] - x[0] ** 2], [[1.0 + m - 2.0 * x[0]]]), 1)

    for start in (0.0, between[0] * (1.0 - between[0])):
        found = locate(exchanging, between, orbit=[start], normal_form=False)
        assert found.complete
        np.testing.assert_allclose([point.value for point in found], [0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("mean", [0.4, 0.5, 0.6, 0.7, 0.8])
@pytest.mark.parametrize("bend", [-1.9, -0.6, 0.6, 1.9])
def test_an_orbit_that_sways_is_not_left_for_one_that_crosses_it(mean, bend):
    """The orbit is sin 4p, its multiplier mean + (1.05 - mean) sin 4p."""

    def swaying(p):
        sine = np.sin(4.0 * p)
        nu = mean + (1.05 - mean) * sine
        return from_map(
            lambda x: ([sine + nu * (x[0] - sine) + bend * (x[0] - sine) ** 2], [[nu + 2.0 * bend * (x[0] - sine)]]), 1
        )

    found = locate(swaying, (-1.0, 1.0), orbit=[np.sin(-4.0)], normal_form=False)
    first = np.arcsin((1.0 - mean) / (1.05 - mean))
    assert found.complete
    np.testing.assert_allclose([point.value for point in found], [0.25 * first, 0.25 * (np.pi - first)], atol=1e-7)


@pytest.mark.parametrize("high", [1.8, 2.6, 8.0])
def test_a_pitchfork_of_a_symmetry_that_is_not_declared_is_found_or_left_open(high):
    """Beyond it a long step comes down on an orbit that leaves there, whose multiplier lies within the circle again."""

    def family(a):
        return from_rhs(lambda t, x: [a * x[0] - x[0] ** 3 + np.cos(t)], 1, 2.0 * np.pi)

    found = locate(family, (0.3, high), orbit=[0.25], normal_form=False)
    assert not found.complete or [round(point.value, 6) for point in found] == [1.100428]


def test_a_search_that_is_out_of_time_after_the_first_orbit_is_a_result():
    cells = 12

    def ring(mu):
        def rhs(t, x):
            u, v = x[:cells], x[cells:]
            return np.concatenate([v, mu * (1.0 - u * u) * v - u + 0.1 * (np.roll(u, 1) - 2.0 * u + np.roll(u, -1))])

        return from_rhs(rhs, 2 * cells, None, guess_period=6.3)

    guess = np.concatenate([2.0 * np.ones(cells), np.zeros(cells)])
    find_orbit(ring(0.5), guess)  # compiles
    for seconds in (0.2, 0.4, 0.8):
        with contextlib.suppress(SpentError):  # there is no first orbit yet
            assert not locate(ring, (0.5, 2.0), orbit=guess, seconds=seconds).complete


@pytest.mark.parametrize("basis", [[[1.0, 0.0], [0.0, 1.0]], [[0.8, -0.6], [0.6, 0.8]], [[1.0, 1.0], [0.0, 1.0]]])
@pytest.mark.parametrize("gap", [1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_bounds_of_two_multipliers_that_cross_together(basis, gap, sign):
    def family(a):
        matrix = sign * np.array(basis) @ np.diag([a, a * (1.0 + gap)]) @ np.linalg.inv(basis)
        return from_map(lambda x: (matrix @ x, matrix), 2)

    found = locate(family, (0.9, 1.13), orbit=np.zeros(2))
    assert sum(point.multiplicity for point in found) == 2
    for point in found:
        assert min(abs(point.value - each) for each in (1.0, 1.0 / (1.0 + gap))) <= point.error_bound
    low, high = found[0], found[-1]
    assert low.value - low.error_bound <= 1.0 / (1.0 + gap)
    assert high.value + high.error_bound >= 1.0


def test_a_slow_family_is_not_called_once_the_time_is_over():
    calls = []

    def family(p):
        calls.append(p)
        time.sleep(0.1)
        return from_rhs(lambda t, x: [p * x[0] - x[0] ** 3 + np.cos(t)], 1, 2.0 * np.pi)

    found = locate(family, (0.3, 3.0), orbit=[0.0], seconds=0.5)
    assert found.status is SearchStatus.BUDGET
    assert len(calls) < 15
    assert f"{found.searched[0]:.9g} to {found.searched[1]:.9g}, at {found.evaluations} values" in str(found)


@pytest.mark.parametrize("low", [-1.0, 0.0, 0.1])
@pytest.mark.parametrize("cells", [2, 3, 4, 5])
def test_a_point_among_the_symmetric_orbits_of_a_ring(cells, low):
    """The cells move alike there, so the point is that of one cell, by collocation of odd orbits at 98 instants."""
    turn = np.roll(np.eye(cells), 1, 0)

    def rhs(t, x, p):
        return p * x - x**3 + 0.3 * np.cos(t) + 0.2 * (np.roll(x, 1) - 2.0 * x + np.roll(x, -1))

    def family(p):
        return from_rhs(rhs, cells, 2 * np.pi, args=(p,), spatial_symmetry=turn)

    found = locate(family, (low, 0.3), orbit=np.zeros(cells))
    assert found.status is SearchStatus.COMPLETE
    (point,) = found
    assert abs(point.value - 0.1342679520115237) <= point.error_bound + 1e-15
    assert point.error_bound < 1e-9


def coupled(k, size):
    """Two Stuart-Landau oscillators: the difference of their phases has the exponent -2 k."""

    def rhs(t, z):
        a, b, c, d = (each / size for each in z)
        first, second = 1.0 - a * a - b * b, 1.0 - c * c - d * d
        one = size * (first * a - b + k * (c - a)), size * (first * b + a + k * (d - b))
        return [*one, size * (second * c - d + k * (a - c)), size * (second * d + c + k * (b - d))]

    return from_rhs(rhs, 4, None, guess_period=6.28)


@pytest.mark.parametrize("size", [1.0, 3.0, 1e6])
def test_a_multiplier_that_is_one_at_a_sampled_value_passes_it_in_all_units(size):
    found = locate(lambda k: coupled(k, size), (-0.4, 0.4), orbit=[size, 0.0, size, 0.0], normal_form=False)
    assert found.status is SearchStatus.COMPLETE
    (point,) = found
    assert abs(point.value) <= point.error_bound < 1e-9


@pytest.mark.parametrize("rounding", [-3e-16, 0.0, 3e-16])
def test_rounding_does_not_decide_on_which_side_of_one_a_multiplier_is(rounding):
    """The middle of the interval is sampled, and there one of the multipliers is +1 but for rounding."""

    def family(k):
        slow, fast = math.exp(-4.0 * math.pi * k) + rounding, 1e-3 * math.exp(k)
        return from_map(lambda z: ([fast * z[0], slow * z[1]], [[fast, 0.0], [0.0, slow]]), 2)

    found = locate(family, (-0.4, 0.4), orbit=[0.0, 0.0], normal_form=False)
    assert found.status is SearchStatus.COMPLETE
    assert [abs(point.value) < 1e-12 for point in found] == [True]


@pytest.mark.parametrize("rounding", [-3e-16, 0.0, 3e-16])
def test_an_orbit_that_meets_another_at_a_sampled_value_ends_there(rounding):
    """x -> x - k x - x^3: the orbit sqrt(-k) ends at 0, and the orbit 0 goes on with multiplier 1 - k."""

    def family(k):
        growth = 1.0 - k + rounding
        return from_map(lambda x: ([growth * x[0] - x[0] ** 3], [[growth - 3.0 * x[0] ** 2]]), 1)

    found = locate(family, (-0.4, 0.4), orbit=[math.sqrt(0.4)], normal_form=False)
    assert found.status is SearchStatus.INCOMPLETE
    assert -1e-3 < found.searched[1] < 0.0
    assert "another orbit meets it" in found.ending


def close(distance):
    """Two pitchforks at a distance on both sides of 0.01, of an orbit that has to be followed."""
    return lambda a: from_rhs(lambda t, x: [((a - 0.01) ** 2 - distance**2) * x[0] - x[0] ** 3], 1, 2.0 * np.pi)


def test_two_pitchforks_close_together_are_no_touch():
    found = locate(close(1e-5), (-0.1, 0.13), orbit=[0.0])
    assert found.complete
    assert [point.kind for point in found] == [Kind.PITCHFORK] * 2
    for point, truth in zip(found, (0.00999, 0.01001), strict=True):
        assert abs(point.value - truth) <= point.error_bound < 1e-8


@pytest.mark.parametrize("distance", [3e-6, 1e-6, 0.0])
def test_what_may_be_a_touch_or_two_crossings_is_not_complete(distance):
    found = locate(close(distance), (-0.1, 0.13), orbit=[0.0])
    assert not found.complete
    assert not len(found)
    assert any("touches" in remark and " or " in remark for remark in found.remarks)


@pytest.mark.parametrize("distance", [1e-5, 1e-6])
def test_a_branch_reports_no_point_without_a_bound(distance):
    branch = follow(close(distance), [0.0], (-0.1, 0.13))
    for point in branch.special_points:
        assert abs(abs(point.value - 0.01) - distance) <= point.bifurcation.error_bound


def test_every_orbit_is_counted_and_the_distance_of_neighbours_is_said():
    """The multiplier exceeds 1 between two of the first values of a search, where the orbit is looked at halfway."""

    def window(p):
        gain = -0.3 + 0.3 * (np.tanh((p - 0.32) / 0.01) - np.tanh((p - 0.48) / 0.01))
        return from_rhs(lambda t, x: [(gain + 0.2 * np.cos(t)) * x[0] - x[0] ** 3], 1, 2.0 * np.pi)

    found = locate(window, (0.0, 1.0), [0.0])
    np.testing.assert_allclose([point.value for point in found], [0.32, 0.48], atol=1e-9)
    assert 0.1 < found.spacing < 0.2
    assert f"at most {found.spacing:.2g} apart" in str(found)
    assert found.to_dataset().attrs["spacing"] == found.spacing


@pytest.mark.parametrize("at", [0.0, 0.15, 0.3])
@pytest.mark.parametrize(("name", "times"), [("spatial_symmetry", 1), ("symmetry", 2)])
def test_a_symmetry_of_one_system_is_none_of_its_family(name, times, at):
    """The quadratic term vanishes at a single value, where -x is a symmetry in space, or one after half a period."""

    def family(p, at=at):
        def rhs(t, x):
            return [x[1], (p - 0.05 - 0.1 * np.cos(times * t)) * x[0] - 0.2 * x[1] - (p - at) * x[0] ** 2 - x[0] ** 3]

        return from_rhs(rhs, 2, 2.0 * pi, **{name: -np.eye(2)} if p == at else {})

    found = locate(family, (0.0, 0.3), orbit=[0.0, 0.0])
    assert found.status is SearchStatus.COMPLETE
    (point,), (other,) = found, locate(lambda p: family(p, 0.5), (0.0, 0.3), orbit=[0.0, 0.0])
    assert point.kind is Kind.TRANSCRITICAL
    assert abs(point.value - other.value) <= point.error_bound + other.error_bound
    branch = follow(family, [0.0, 0.0], (0.0, 0.3))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert [each.special for each in branch.special_points] == [Kind.TRANSCRITICAL]
    with pytest.raises(ParameterError, match="must be False for systems without a symmetry in time"):
        follow(family, [0.0, 0.0], (0.0, 0.3), symmetric=True)


def steep_map(p, power, bend):
    """Its orbits are x^power + bend x = p; the radius of a second block is multiplied by 1 at x = 0.3."""

    def image(x):
        r, c, s = 1.0 - 0.5 * (0.3 - x[0]), np.cos(1.0), np.sin(1.0)
        turned = c * x[1] - s * x[2], s * x[1] + c * x[2]
        derivative = [
            [1.0 - 0.25 * (power * x[0] ** (power - 1) + bend), 0.0, 0.0],
            [0.5 * turned[0], r * c - 0.3 * x[1] ** 2, -r * s],
            [0.5 * turned[1], r * s, r * c - 0.3 * x[2] ** 2],
        ]
        x0 = x[0] - 0.25 * (x[0] ** power + bend * x[0] - p)
        return [x0, r * turned[0] - 0.1 * x[1] ** 3, r * turned[1] - 0.1 * x[2] ** 3], derivative

    return from_map(image, 3)


@pytest.mark.parametrize(("power", "bend"), [(3, 1e-3), (3, 1e-8), (5, 1e-3), (5, 1e-4), (7, 1e-3)])
def test_an_orbit_that_changes_steeply_is_followed(power, bend):
    """No step of the parameter is short enough where x changes by as much as 1/bend times the parameter."""
    first = brentq(lambda x: x**power + bend * x + 1.0, -2.0, 2.0)
    found = locate(lambda p: steep_map(p, power, bend), (-1.0, 1.0), orbit=[first, 0.0, 0.0])
    assert (found.complete, found.searched, found.ending) == (True, (-1.0, 1.0), "")
    (point,) = found
    assert point.kind is Kind.NEIMARK_SACKER
    assert abs(point.value - 0.3**power - 0.3 * bend) <= point.error_bound < 1e-11


def steep_cycle(p, bend):
    """A circle with (r - 1)^3 + bend (r - 1) = p, and a pair that grows from r = 1.1."""

    def rhs(t, x, p, bend):
        r = np.sqrt(x[0] ** 2 + x[1] ** 2)
        growth, pair = p - (r - 1.0) ** 3 - bend * (r - 1.0), 0.3 * (r - 1.1)
        return [
            growth * x[0] - x[1],
            growth * x[1] + x[0],
            pair * x[2] - 1.7 * x[3] - 0.1 * x[2] ** 3,
            pair * x[3] + 1.7 * x[2] - 0.1 * x[3] ** 3,
        ]

    return from_rhs(rhs, 4, None, args=(p, bend), guess_period=6.0)


def test_a_cycle_that_changes_steeply_is_followed():
    first = 1.0 + brentq(lambda x: x**3 + 1e-3 * x + 0.1, -1.0, 0.0)
    found = locate(lambda p: steep_cycle(p, 1e-3), (-0.1, 0.1), orbit=[first, 0.0, 0.0, 0.0])
    assert found.complete
    assert [point.kind for point in found] == [Kind.NEIMARK_SACKER]
    assert abs(found[0].value - 1.1e-3) <= found[0].error_bound < 1e-11


def forced_ring(p):
    """Three of Duffing's oscillators, forced a third of a period apart."""

    def rhs(t, x, p):
        rates = []
        for i in range(3):
            y, v, beside = x[2 * i], x[2 * i + 1], x[2 * i - 2] + x[(2 * i + 2) % 6]
            force = p * np.cos(t - 2.0 * pi * i / 3.0)
            rates += [v, -0.25 * v - y**3 - 0.3 * y**2 + 0.2 * (beside - 2.0 * y) + force]
        return rates

    return from_rhs(rhs, 6, 2.0 * pi, args=(p,))


def test_a_forced_ring_is_followed_through_a_steep_place():
    """The values are those of searches that begin beyond it, and of `follow`."""
    found = locate(forced_ring, (0.05, 0.5), orbit=np.zeros(6))
    assert found.complete
    assert [point.kind for point in found] == [Kind.NEIMARK_SACKER] * 2
    assert [point.value for point in found] == pytest.approx([0.17730600802, 0.34540863254], abs=1e-10)


@pytest.mark.parametrize("width", [5e-5, 2e-7])
def test_an_interval_that_is_narrow_beside_its_values(width):
    """Period doubling of the logistic map at r = 3, with r = 3 + 1e4 (p - 1e6)."""

    def family(p):
        r = 3.0 + 1e4 * (p - 1e6)
        return from_map(lambda x: ([r * x[0] * (1 - x[0])], [[r * (1 - 2 * x[0])]]), 1)

    found = locate(family, (1e6 - 0.4 * width, 1e6 + 0.6 * width), [0.64])
    assert found.complete
    (point,) = found.points
    assert point.kind is Kind.PERIOD_DOUBLING
    assert abs(point.value - 1e6) <= point.error_bound < 1e-8
