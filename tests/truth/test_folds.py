"""Folds at any place of a grid: of forced motions and of limit cycles, with the fold known in closed form."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chilopod.stability import Ending, Kind, begin, follow, from_map, from_rhs, locate


def forced(mu):
    """With y = x - cos(t) / 10 it is y' = mu - y^2: orbits y^2 = mu, the fold at 0; the second state follows."""

    def rhs(t, x, mu):
        return [mu - (x[0] - 0.1 * np.cos(t)) ** 2 - 0.1 * np.sin(t), x[0] - x[1]]

    return from_rhs(rhs, 2, 2.0 * np.pi, args=(mu,))


def forced_orbit(mu):
    """Of x[1]' = x[0] - x[1] the periodic solution is sqrt(mu) + (cos t + sin t) / 20."""
    return np.sqrt(mu) + np.array([0.1, 0.05])


def cycles(mu):
    """r' = r (mu + r^2 - r^4), turning with angular velocity 1: r^2 = 1/2 + sqrt(1/4 + mu), the fold at -1/4."""

    def rhs(t, x, mu):
        square = x[0] ** 2 + x[1] ** 2
        growth = mu + square - square**2
        return [growth * x[0] - x[1], growth * x[1] + x[0]]

    return from_rhs(rhs, 2, None, args=(mu,), guess_period=6.0)


def cycle(mu):
    return np.array([np.sqrt(0.5 + np.sqrt(0.25 + mu)), 0.0])


FAMILIES = {"forced": (forced, forced_orbit, 0.0), "cycles": (cycles, cycle, -0.25)}
# From where and to where, relative to the fold: it is a node of the search's grid, between two, at the end, before and
# beyond it by a little.
REACHES = [
    (0.75, -0.05), (0.75, -0.25), (0.5, -0.5), (0.1, -0.7), (1.0, 0.0), (1.0, -1e-9), (0.01, -0.01), (1e-6, -1e-6),
]  # fmt: skip
# A cycle takes several times as long as a forced orbit.
CASES = [*(("forced", *reach) for reach in REACHES), *(("cycles", *reach) for reach in REACHES[3::4])]


def is_fold(point, known, closest=1e-11):
    assert point.kind is Kind.FOLD
    assert abs(point.value - known) <= point.error_bound < closest
    assert point.normal_form is None or point.normal_form.quadratic != 0.0


@pytest.mark.parametrize(("name", "start", "end"), CASES)
def test_locate_finds_it(name, start, end):
    family, orbit, fold = FAMILIES[name]
    found = locate(lambda minus: family(-minus), (-fold - start, -fold - end), orbit=orbit(fold + start))
    assert found.complete
    (point,) = found
    is_fold(point, -fold)
    assert found.ending == f"the orbit ends in a fold at {point.value:.9g}"
    assert found.ending not in found.remarks


@pytest.mark.parametrize("name", FAMILIES)
def test_there_is_none_just_before_it(name):
    family, orbit, fold = FAMILIES[name]
    for end in (1e-3, 1e-9):
        found = locate(
            lambda minus: family(-minus), (-fold - 1.0, -fold - end), orbit=orbit(fold + 1.0), normal_form=False
        )
        assert found.complete
        assert (len(found), found.ending) == (0, "")


@pytest.mark.parametrize("name", FAMILIES)
def test_an_orbit_that_begins_in_it(name):
    family, orbit, fold = FAMILIES[name]
    found = locate(family, (fold, fold + 0.5), orbit=orbit(fold))
    assert found.complete
    (point,) = found
    is_fold(point, fold)
    assert found.ending == ""


@pytest.mark.parametrize(("name", "start", "end"), CASES)
def test_follow_passes_it(name, start, end):
    family, orbit, fold = FAMILIES[name]
    between = (fold + end, fold + start)
    branch = follow(family, begin(family, between[1], orbit(between[1]), rising=False), between, points=40)
    point = branch.special_points[0]
    is_fold(point.bifurcation, fold)
    assert all(between[0] <= point.value <= between[1] for point in branch.points)


def test_a_branch_of_cycles_ends_where_they_shrink():
    """r^2 = 1/2 - sqrt(1/4 + mu), behind the fold, is 0 at mu = 0."""
    branch = follow(cycles, begin(cycles, 0.5, cycle(0.5), rising=False), (-0.5, 0.5), points=100)
    (point,) = branch.special_points
    is_fold(point.bifurcation, -0.25)
    assert branch.ending is Ending.LOST
    assert "a Hopf point" in branch.reason
    assert -1e-3 < branch.points[-1].value < 0.0


@pytest.mark.parametrize("name", FAMILIES)
def test_a_branch_that_starts_in_it_says_so(name):
    family, orbit, fold = FAMILIES[name]
    branch = follow(family, begin(family, fold, orbit(fold)), (fold - 0.5, fold + 0.5), points=5)
    assert "the branch starts in a fold" in branch.remarks
    assert branch.points[-1].value > fold


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_fold_of_a_map_where_the_state_is_zero(unit):
    """Rounding of the terms that cancel there does not shrink with the state."""

    def bent(p):
        return from_map(
            lambda x: ([x[0] + x[0] ** 2 / unit + unit * (p + 1.1) - 2.05 * unit], [[1 + 2 * x[0] / unit]]), 1
        )

    found, branch = locate(bent, (0.3, 1.4), orbit=[-0.8 * unit]), follow(bent, [-0.8 * unit], (0.3, 1.4))
    assert found.complete
    assert branch.ending is Ending.LEFT_INTERVAL
    for (point,) in (found, [each.bifurcation for each in branch.special_points]):
        assert point.kind is Kind.FOLD
        assert abs(point.value - 0.95) <= point.error_bound < 1e-14


@pytest.mark.parametrize("start", [-0.33, -0.4])
@pytest.mark.parametrize("power", [3, 7, 10, 13])
def test_terms_of_a_map_that_cancel(power, start):
    """x + x^2 + p + 1/16, with rounding of 2^power: a fold at p = -1/16, and a period doubling one below it."""

    def family(p):
        def image(x):
            return [x[0] + x[0] ** 2 + (p + 2.0**power) - (2.0**power - 0.0625)], [[1.0 + 2.0 * x[0]]]

        return from_map(image, 1)

    branch = follow(family, [-np.sqrt(-start - 0.0625)], (start, 0.5))
    assert branch.ending is Ending.LEFT_INTERVAL
    (fold,) = branch.special_points
    is_fold(fold.bifurcation, -0.0625)
    (doubling,) = locate(family, (start - 1.0, -0.8), orbit=[-np.sqrt(-start + 0.9375)], normal_form=False)
    assert doubling.kind is Kind.PERIOD_DOUBLING
    assert abs(doubling.value + 1.0625) <= doubling.error_bound < 1e-11


def resonance(force):
    """Duffing's oscillator with hardening over the frequency w, in units of time in which its period is 2 pi."""

    def rhs(t, x, w):
        return [x[1] / w, (-0.1 * x[1] - x[0] - 0.5 * x[0] ** 3 + force * np.cos(t)) / w]

    return lambda w: from_rhs(rhs, 2, 2.0 * np.pi, args=(w,))


@pytest.mark.parametrize(("force", "fold"), [(0.1, 1.14103841), (0.11, 1.16164993), (0.15, 1.24727662)])
def test_a_resonance_far_from_where_the_search_began(force, fold):
    """The orbit grows by a factor of nine on the way; scipy confirms the orbit there and its multiplier 1."""
    found = locate(resonance(force), (0.3, 2.5), orbit=[force, 0.0])
    assert found.complete
    (point,) = found
    is_fold(point, point.value)
    assert point.value == pytest.approx(fold, abs=1e-8)

    def rhs(t, x):
        back = np.array([[0.0, 1.0], [-1.0 - 1.5 * x[0] ** 2, -0.1]]) / point.value
        moved = [x[1], -0.1 * x[1] - x[0] - 0.5 * x[0] ** 3 + force * np.cos(t)]
        return np.append(np.array(moved) / point.value, back @ x[2:].reshape(2, 2))

    start = np.append(point.orbit, np.eye(2))
    end = solve_ivp(rhs, (0.0, 2.0 * np.pi), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert end[:2] == pytest.approx(point.orbit, abs=1e-9)
    assert np.linalg.det(end[2:].reshape(2, 2) - np.eye(2)) == pytest.approx(0.0, abs=1e-7)


def cubic(p, bend):
    """A map whose orbits are x^3 + bend x = p: with a negative bend folds at p = 2 (-bend/3)^1.5 and its opposite."""

    def image(x):
        return [x[0] - 0.5 * (x[0] ** 3 + bend * x[0] - p), 0.1 * x[0] + 0.4 * x[1]], [
            [1.0 - 0.5 * (3.0 * x[0] ** 2 + bend), 0.0],
            [0.1, 0.4],
        ]

    return from_map(image, 2)


def cubic_orbit(p, bend):
    """The lowest one."""
    roots = np.roots([1.0, 0.0, bend, -p])
    return min(roots.real[np.abs(roots.imag) < 1e-5]) * np.array([1.0, 1.0 / 6.0])


@pytest.mark.parametrize("bend", [-1e-6, -1e-4, -1e-3, -1e-2, -0.1])
def test_one_of_two_that_are_close_together(bend):
    """Between both the curve goes back by as little as 1e-9 of the interval."""
    fold = 2.0 * (-bend / 3.0) ** 1.5
    found = locate(lambda p: cubic(p, bend), (-1.0, 1.3), orbit=cubic_orbit(-1.0, bend))
    assert found.complete
    (point,) = found
    is_fold(point, fold)


@pytest.mark.parametrize("before", [1e-4, 1e-6, 1e-8, 1e-12])
@pytest.mark.parametrize("bend", [-0.3, -0.1])
def test_an_orbit_that_begins_just_before_its_end(bend, before):
    fold = 2.0 * (-bend / 3.0) ** 1.5
    found = locate(lambda p: cubic(p, bend), (fold - before, 1.3), orbit=cubic_orbit(fold - before, bend))
    assert found.complete
    (point,) = found
    is_fold(point, fold)
