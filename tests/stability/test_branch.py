"""Branches against curves that are known in closed form."""

import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import mathieu_b

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import Kind, PeriodicSystem, from_map, from_rhs, locate, multipliers
from chilopod.stability.branches.branch import Ending, begin, follow, switch
from helpers.systems import henon, of_map

PERIOD = 2.0


def gentle(mu):
    """x' = mu x - x^3: orbits x = sqrt(mu), multiplier exp(-2 mu T)."""
    return from_rhs(lambda t, x: mu * x - x**3, 1, PERIOD, orbit=[0.0], spatial_symmetry=[[-1.0]])


def abrupt(mu):
    """x' = mu x + x^3 - x^5: orbits x^2 = (1 +- sqrt(1 + 4 mu)) / 2, a fold at mu = -1/4, x^2 = 1/2."""
    return from_rhs(lambda t, x: mu * x + x**3 - x**5, 1, PERIOD, orbit=[0.0], spatial_symmetry=[[-1.0]])


@pytest.mark.parametrize("side", [1, -1])
def test_the_branch_of_a_supercritical_pitchfork(side):
    (fork,) = locate(gentle, (-0.1, 0.2))
    branch = follow(gentle, switch(gentle, fork)[side < 0], (-0.1, 0.2), step=0.05)
    assert branch.ending is Ending.LEFT_INTERVAL
    assert [point.special for point in branch.special_points] == [Kind.PITCHFORK]
    for point in branch.points[1:]:
        assert point.orbit[0] == pytest.approx(side * np.sqrt(point.value), abs=1e-9)
        assert point.multipliers[0] == pytest.approx(np.exp(-2 * point.value * PERIOD), abs=1e-9)
        assert point.stable


def test_the_branch_of_a_subcritical_pitchfork_folds_back():
    (fork,) = locate(abrupt, (-0.3, 0.2))
    branch = follow(abrupt, switch(abrupt, fork)[0], (-0.3, 0.2), step=0.05)
    fork, fold = branch.special_points
    assert (fork.special, fold.special) == (Kind.PITCHFORK, Kind.FOLD)
    assert fold.value == pytest.approx(-0.25, abs=1e-9)
    assert fold.orbit[0] ** 2 == pytest.approx(0.5, abs=1e-6)
    turn = branch.points.index(fold)
    assert not any(point.stable for point in branch.points[1:turn])
    assert all(point.stable for point in branch.points[turn + 1 :])
    for point in branch.points[1:]:
        square = point.orbit[0] ** 2
        assert point.value == pytest.approx(square**2 - square, abs=1e-9)


def test_in_pieces_as_in_one():
    (fork,) = locate(abrupt, (-0.3, 0.2))
    start = switch(abrupt, fork)[0]
    whole = follow(abrupt, start, (-0.3, 0.2), points=12, step=0.05, closely=False)
    piece = follow(abrupt, start, (-0.3, 0.2), points=5, step=0.05, closely=False)
    assert piece.ending is Ending.ENOUGH_POINTS
    pieces = follow(abrupt, piece, (-0.3, 0.2), points=7, closely=False)
    assert (pieces.ending, pieces.scale, pieces.step) == (whole.ending, whole.scale, whole.step)
    assert [point.value for point in pieces.points] == [point.value for point in whole.points]
    assert [point.orbit.tolist() for point in pieces.points] == [point.orbit.tolist() for point in whole.points]
    assert [point.special for point in pieces.points] == [point.special for point in whole.points]
    assert [point.error_bound for point in pieces.points] == [point.error_bound for point in whole.points]


def logistic(r):
    return from_map(lambda x: (r * x * (1.0 - x), [[r - 2.0 * r * x[0]]]), 1)


def test_steep_returns_in_pieces_as_in_one():
    """0 = exp(20 p) - 1 - 1.5 x - x^3: steps of differences by the parameter depend on the step before."""

    def family(p):
        return from_map(lambda x: (np.exp(20.0 * p) - 1.0 - 0.5 * x - x**3, [[-0.5 - 3.0 * x[0] ** 2]]), 1)

    whole, piece = (follow(family, [0.0], (0.0, 1.0), points=points) for points in (16, 8))
    pieces = follow(family, piece, (0.0, 1.0), points=8)
    assert [point.orbit.tolist() for point in pieces.points] == [point.orbit.tolist() for point in whole.points]
    for point in whole.points:
        assert np.expm1(20.0 * point.value) == pytest.approx(1.5 * point.orbit[0] + point.orbit[0] ** 3, rel=1e-8)


def test_a_branch_whose_end_is_another_point_is_continued_from_that():
    """x = +-sqrt(p): the kept state of one half is not that of the other."""

    def family(p):
        return from_map(lambda x: (x + 0.1 * (p - x * x), [[1.0 - 0.2 * x[0]]]), 1)

    piece = follow(family, [1.0], (1.0, 4.0), points=4)
    whole, pickled = (follow(family, each, (1.0, 4.0)) for each in (piece, pickle.loads(pickle.dumps(piece))))
    assert [each.orbit.tolist() for each in pickled.points] == [each.orbit.tolist() for each in whole.points]
    end = piece.points[-1]
    other = replace(
        end, orbit=-end.orbit, multipliers=1.0 + 0.2 * end.orbit.astype(complex), tangent=[-1, 1] * end.tangent
    )
    mirrored = follow(family, replace(piece, points=(*piece.points[:-1], other)), (1.0, 4.0))
    assert all(point.orbit[0] == pytest.approx(-np.sqrt(point.value)) for point in mirrored.points[5:])
    assert mirrored.points[-1].value == 4.0


def test_renewed_units_leave_the_steps_as_long_as_they_are():
    """x = p, where returns magnify 10000 times: the units stay small, and their renewal helps nothing."""

    def family(p):
        return from_map(lambda x: (p + np.expm1(1e4 * (x - p)), [[1e4 * np.exp(1e4 * (x[0] - p))]]), 1)

    branch = follow(family, [0.2], (0.2, 1.2), budget=3000)
    assert branch.ending is Ending.LEFT_INTERVAL
    assert [point.orbit[0] for point in branch.points] == pytest.approx([point.value for point in branch.points])


@pytest.mark.parametrize("size", [1.0, 1e-9])
@pytest.mark.parametrize("slope", [1.0, -1.0])
def test_a_straight_curve_has_no_fold_in_any_units(size, slope):
    """x = 2 slope p, with the multiplier 1/2."""

    def family(p):
        return from_map(lambda x: (0.5 * x + slope * p, [[0.5]]), 1, scale=[size])

    branch = follow(family, begin(family, 0.3, [0.6 * slope]), (-1.0, 1.0), points=2)
    assert branch.remarks == ()
    assert branch.points[1].orbit[0] == pytest.approx(2.0 * slope * branch.points[1].value, rel=1e-12)


# Spent in a step, and while the step with the period doubling is searched.
@pytest.mark.parametrize("budget", [100, 158, 206])
def test_a_budget_changes_no_point(budget):
    whole = follow(logistic, [0.5], (2.0, 3.6))
    piece = follow(logistic, [0.5], (2.0, 3.6), budget=budget)
    assert piece.ending is Ending.BUDGET
    pieces = follow(logistic, piece, (2.0, 3.6))
    assert [point.special for point in whole.special_points] == [Kind.PERIOD_DOUBLING]
    assert [point.value for point in pieces.points] == [point.value for point in whole.points]
    assert pieces.remarks == whole.remarks == ()


def test_a_branch_that_left_goes_on_in_a_wider_interval():
    (fork,) = locate(gentle, (-0.1, 0.1))
    branch = follow(gentle, switch(gentle, fork)[0], (-0.1, 0.1), step=0.05)
    assert branch.ending is Ending.LEFT_INTERVAL
    with pytest.raises(ParameterError, match="last point"):
        follow(gentle, branch, (-0.1, 0.1))
    wider = follow(gentle, branch, (-0.1, 0.4))
    assert wider.points[: len(branch.points)] == branch.points
    assert wider.points[-1].value == 0.4
    for point in wider.points[1:]:
        assert point.orbit[0] == pytest.approx(np.sqrt(point.value), abs=1e-9)


def mapped(matrix):
    """A system whose return map is x -> M x - x^3, M a matrix that depends on the parameter."""

    def family(value):
        m = np.atleast_2d(matrix(value))
        return PeriodicSystem(len(m), 1.0, lambda x, t0, t1: (m @ x - x**3, m - np.diag(3.0 * x**2)))

    return family


@pytest.mark.parametrize(
    ("matrix", "kind"),
    [
        (lambda mu: [[-1.0 - mu]], Kind.PERIOD_DOUBLING),
        (lambda mu: [[1.0 + mu]], Kind.PITCHFORK),
        (lambda mu: (1.0 + mu) * np.array([[0.6, -0.8], [0.8, 0.6]]), Kind.NEIMARK_SACKER),
        (lambda mu: [[1.5, 1.0], [mu, 1.5]], None),  # a pair outside the circle becomes real: nothing happens
    ],
)
def test_special_points_on_the_way_are_named_and_located(matrix, kind):
    family, between = mapped(matrix), (-0.1, 0.137)
    start = begin(family, -0.09, np.zeros(len(matrix(0.0))), rising=True)
    special = follow(family, start, between).special_points
    assert [point.special for point in special] == ([kind] if kind else [])
    for point in special:
        assert point.value == pytest.approx(0.0, abs=1e-9)


def test_stability_is_known_between_two_special_points_of_a_step():
    """Multipliers -1 - mu and -0.5 - 10 mu cross at 0 and at 0.05."""

    def family(mu):
        m = np.diag([-1.0 - mu, -0.5 - 10.0 * mu])
        return of_map(lambda x: (m @ x, m), 2)

    branch = follow(family, begin(family, -0.09, np.zeros(2)), (-0.1, 0.137), longest=0.5, step=0.5)
    first, second = branch.special_points
    assert [first.value, second.value] == pytest.approx([0.0, 0.05], abs=1e-9)
    between = [point for point in branch.points if first.value < point.value < second.value]
    assert [point.stable for point in between] == [False]


def test_a_step_out_of_what_the_system_can_have_is_shortened():
    def family(mu):
        if mu > 0.2 - 1e-6:
            raise ParameterError("cannot be", field="mu", value=mu)
        return gentle(mu)

    (fork,) = locate(gentle, (-0.1, 0.2))
    branch = follow(family, switch(gentle, fork)[0], (-0.1, 0.2), step=0.1, longest=1.0)
    assert branch.ending is Ending.LOST
    assert "cannot be" in branch.reason
    assert 0.19 < branch.points[-1].value < 0.2


@pytest.mark.parametrize("start", [-0.5, -0.6, 0.5])
@pytest.mark.parametrize("longest", [0.15, 0.3])
def test_a_fold_without_damping(start, longest):
    """The map of Henon that keeps areas has orbits a x^2 + 2 x = 1, a fold at a = -1, x = 1: beyond it both multipliers
    lie on the circle, before it one lies on either side of +1."""
    family = partial(henon, b=-1.0)
    x = (np.sqrt(1 + start) - 1) / start
    branch = follow(family, begin(family, start, [x, -x], rising=False), (-2.0, 1.0), longest=longest, points=20)
    folds = [point.value for point in branch.special_points if point.special is Kind.FOLD]
    assert folds == pytest.approx([-1.0], abs=1e-9)
    assert not any("no event" in remark for remark in branch.remarks)


def test_a_real_double_multiplier_is_no_pair():
    """Three cells in a ring, in step: two real multipliers pass +1 as one, where others are a complex pair."""
    shift = np.kron(np.eye(3)[[1, 2, 0]], np.eye(2))

    def ring(p):
        def rhs(t, x, p):
            q, v = x[0::2], x[1::2]
            pulls = [0.5 * (q[i - 1] + q[(i + 1) % 3] - 2.0 * q[i]) for i in range(3)]
            drive = 4.5 * p * np.cos(1.2447113844654425 * t)
            forces = [drive - 0.28783 * v[i] - 0.45515 * q[i] - 0.69746 * q[i] ** 3 + pulls[i] for i in range(3)]
            return [each for i in range(3) for each in (v[i], forces[i])]

        return from_rhs(rhs, 6, 2 * np.pi / 1.2447113844654425, args=(p,), spatial_symmetry=shift)

    start = begin(ring, 1.19, [2.60, 1.113] * 3)
    branch = follow(ring, start, (1.1, 1.35), step=0.05, longest=0.05, points=3)
    (point,) = branch.special_points
    assert point.value == pytest.approx(1.1976250148166, abs=1e-9)
    assert point.bifurcation.multiplicity == 2
    assert not branch.remarks


def driven(size):
    """x' = a x - x^3 + cos t, in units of a size: x(t + pi) = -x(t), a symmetry that is not declared."""
    return lambda a: from_rhs(lambda t, x: [a * x[0] - x[0] ** 3 / size**2 + size * np.cos(t)], 1, 2 * np.pi)


@pytest.mark.parametrize(("step", "size"), [(0.02, 1.0), (0.03, 1.0), (0.1, 1.0), (0.02, 1e-4), (0.02, 1e4)])
def test_a_branch_passes_a_pitchfork_of_a_symmetry_that_is_not_declared(step, size):
    family = driven(size)
    branch = follow(family, [0.0], (0.3, 3.0), step=step)
    assert branch.ending is Ending.LEFT_INTERVAL
    (fork,) = branch.special_points
    assert fork.special is Kind.PITCHFORK
    assert abs(fork.value - 1.10042841024405) <= fork.bifurcation.error_bound + 1e-14 < 1e-9
    for point in branch.points:
        later = family(point.value).flow(np.array(point.orbit), 0.0, np.pi)[0]
        assert later == pytest.approx(-point.orbit, rel=1e-7)


def test_the_branch_that_leaves_it_turns_there():
    branch = follow(driven(1.0), begin(driven(1.0), 3.0, [0.3], rising=False), (0.3, 3.0))
    assert (branch.ending, branch.points[-1].value) == (Ending.LEFT_INTERVAL, 3.0)
    (fork,) = branch.special_points
    assert abs(fork.value - 1.10042841024405) <= fork.bifurcation.error_bound + 1e-14 < 1e-8


def area_preserving(c):
    """Fixed points x = 0 and x = 1 - c; orbits of period two leave the first at c = -1."""
    return from_map(lambda x: ([x[1], -x[0] + 2 * c * x[1] + 2 * x[1] ** 2], [[0, 1], [-1, 2 * c + 4 * x[1]]]), 2)


def test_what_leaves_a_collision():
    (meeting,) = locate(area_preserving, (-1.5, 0.5), orbit=[0.0, 0.0])
    assert meeting.modes is None  # two multipliers with one eigenvector
    (start,) = switch(area_preserving, meeting)
    doubled = follow(area_preserving, start, (-1.5, 0.5), points=4)
    assert (doubled.ending, doubled.periods) == (Ending.ENOUGH_POINTS, 2)
    x, c = doubled.points[-1].orbit, doubled.points[-1].value
    assert x[0] + x[1] == pytest.approx(-1.0 - c, abs=1e-9)
    (meeting,) = locate(area_preserving, (0.5, 1.5), orbit=[0.0, 0.0])
    for start in switch(area_preserving, meeting):
        point = follow(area_preserving, start, (0.5, 1.5), points=3).points[-1]
        assert point.orbit == pytest.approx(1.0 - point.value, abs=1e-9)


def turning(angle):
    """The multipliers exp(+-i angle) of x = 0 meet at -1 with an eigenvector each: every direction is one."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return from_map(lambda x: (turn @ [x[0], x[1] + x[0] ** 3], turn @ [[1.0, 0.0], [3.0 * x[0] ** 2, 1.0]]), 2)


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_the_place_of_a_collision_where_orbits_meet(size):
    """Orbits (pi +- w, +-2 w) of two periods of the standard map, K = 4 w / sin w, lose a symmetry at w = pi/2."""

    def family(strength):
        def image(z):
            (x, p), derivative = np.asarray(z) / size, np.eye(2)
            for _ in range(2):
                slope = strength * np.cos(x)
                p = p + strength * np.sin(x)
                x = x + p
                derivative = np.array([[1.0 + slope, 1.0], [slope, 1.0]]) @ derivative
            return [size * x, size * p], derivative

        return from_map(image, 2)

    low = 5.8 / np.sin(1.45)
    guess = [size * (np.pi + 1.45), size * 2.9]
    (point,) = follow(family, guess, (low, 6.6)).special_points
    (found,) = locate(family, (low, 6.6), orbit=guess)
    assert point.special is found.kind is Kind.COLLISION
    assert abs(point.value - 2.0 * np.pi) <= point.bifurcation.error_bound < 1e-9
    assert abs(found.value - 2.0 * np.pi) <= found.error_bound < 1e-9
    assert point.error_bound < 1e-5


@pytest.mark.parametrize("miss", [0.0, 1e-16, 1e-15, 1e-14, 1e-13])
def test_a_fold_is_within_the_bound_of_the_pitchfork_that_it_nearly_is(miss):
    """x -> x + mu x - x^3 + miss: the fold is at 3 (miss/2)^(2/3)."""

    def family(mu):
        return from_map(lambda x: ([x[0] + mu * x[0] - x[0] ** 3 + miss], [[1.0 + mu - 3.0 * x[0] ** 2]]), 1)

    branch = follow(family, begin(family, 0.5, [-np.sqrt(0.5)], rising=False), (-0.5, 0.5))
    (point,) = branch.special_points
    assert abs(point.value - 3.0 * np.cbrt(miss / 2.0) ** 2) <= point.bifurcation.error_bound < 1e-8


@pytest.mark.parametrize("symmetric", [True, False])
def test_the_mode_of_a_collision_in_a_family_by_energy_is_no_direction_of_the_family(symmetric):
    """Orbits x = a cos(t) with z'' + (k + x^2) z = 0 across, Mathieu's equation: z = se_1(t + pi / 2), even, is one."""
    symmetry = np.diag([1.0, -1.0, 1.0, -1.0]) if symmetric else None

    def family(p):
        def rhs(t, state):
            x, z, u, w = state
            gx, gz = x * (1.0 + z * z), z * (0.8 + x * x)
            return [u + p * gx, w + p * gz, -gx + p * u, -gz + p * w]

        return from_rhs(rhs, 4, None, guess_period=6.28, spatial_symmetry=symmetry, scale=np.ones(4))

    q = brentq(lambda q: 0.8 + 2.0 * q - mathieu_b(1, q), 0.0, 0.2)
    (point,) = follow(family, begin(family, 0.0, [0.5, 0.0, 0.0, 0.0]), (-0.1, 0.1), points=1).special_points
    assert point.special is Kind.COLLISION
    assert point.orbit == pytest.approx([2.0 * np.sqrt(q), 0.0, 0.0, 0.0], abs=1e-11)
    mode = point.bifurcation.mode
    assert mode / mode[1] == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-9)


def test_no_direction_is_made_up_at_a_collision_that_determines_none():
    (meeting,) = locate(turning, (2.5, 4.0), orbit=[0.0, 0.0])
    (special,) = follow(turning, begin(turning, 2.5, [0.0, 0.0]), (2.5, 4.0)).special_points
    for point in (meeting, special.bifurcation):
        assert point.kind is Kind.COLLISION
        assert "leave" not in point.sentences
        assert point.modes.shape == (2, 2)
        assert abs(point.value - np.pi) <= point.error_bound
        with pytest.raises(ParameterError, match=r"has 2 critical modes, which do not determine .* with `begin`$"):
            switch(turning, point)


def test_a_first_step_is_shortened_to_where_there_is_motion():
    """As beside a doubling of a bouncing ball, where a state a step ahead comes to rest."""

    def family(p):
        def image(x):
            if abs(x[0]) > 4e-3:
                raise AnalysisError("the motion ends")
            return -(1.0 + p) * x + x**3, np.array([[3.0 * x[0] ** 2 - 1.0 - p]])

        return of_map(image, scale=np.ones(1))

    (doubling,) = locate(family, (-0.3, 0.5), [0.0])
    branch = follow(family, switch(family, doubling)[0], (-0.3, 0.5), points=2)
    assert branch.ending is Ending.ENOUGH_POINTS
    assert [each.value - each.orbit[0] ** 2 for each in branch.points] == pytest.approx([0.0] * 3, abs=1e-13)


def test_switch_takes_the_periods_of_a_branch():
    family = partial(henon, b=0.3)
    (first,) = locate(family, (0.1, 0.8), orbit=[0.8, 0.24])
    second = follow(family, switch(family, first)[0], (0.1, 1.0)).special_points[-1]
    assert second.value == pytest.approx(0.9125, abs=1e-9)
    assert [start.periods for each in (second, second.bifurcation) for start in switch(family, each)] == [4, 4]


@pytest.mark.parametrize("symmetric", [True, False])
def test_cells_that_lose_their_coupling_are_a_continuum_and_no_bifurcation(symmetric):
    """Three clocks: without coupling their phases are arbitrary, so orbits form a torus."""
    turn, swap = np.roll(np.eye(3), 1, axis=0), np.eye(3)[[1, 0, 2]]
    generators = [np.kron(np.eye(2), each) for each in (turn, swap)] if symmetric else None

    def family(k):
        def rhs(t, z):
            x, y = z[:3], z[3:]
            r, apart = 1 - x**2 - y**2, [k * (np.roll(u, 1) - 2 * u + np.roll(u, -1)) for u in (x, y)]
            return np.concatenate([r * x - y + apart[0], r * y + x + apart[1]])

        return from_rhs(rhs, 6, None, guess_period=6.3, spatial_symmetry=generators)

    guess = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    branch = follow(family, begin(family, -0.05, guess), (-0.05, 0.06))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert not branch.special_points
    for remarks in (branch.remarks, locate(family, (-0.05, 0.06), orbit=guess).remarks):
        assert any("they form a continuum (multipliers at one: 2)" in remark for remark in remarks)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a_straight_curve_is_followed_in_long_steps_in_any_units(unit):
    """Stiffness 1 to one side and 5 to the other: the orbit grows as the force, ten thousandfold here."""

    def family(force):
        def rhs(t, x):
            spring = np.where(x[0] > 0.0, 5.0 * x[0], x[0])
            return [x[1], (force * np.cos(t / unit) - spring - 0.1 * unit * x[1]) / unit**2]

        return from_rhs(rhs, 2, 2.0 * np.pi * unit)

    branch = follow(family, begin(family, 2e-4 * unit, [0.0, 0.0]), (2e-4 * unit, 2.0 * unit))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert 20 < len(branch.points) < 50
    first, last = branch.points[0], branch.points[-1]
    assert np.allclose(last.orbit, 1e4 * first.orbit, rtol=1e-6)


def test_the_first_point_of_a_doubled_branch_leads_to_the_same_branch():
    def logistic(r):
        return from_map(lambda x: ([r * x[0] * (1.0 - x[0])], [[r - 2.0 * r * x[0]]]), 1)

    (first, *_) = locate(logistic, (1.5, 3.9), orbit=[1 / 3])
    doubled = follow(logistic, switch(logistic, first)[0], (2.9, 3.5))
    start = doubled.special_points[0]
    assert doubled.periods == 2
    for again in (switch(logistic, start)[0], start):
        branch = follow(logistic, again, (2.9, 3.5))
        assert branch.periods == 2
        kinds = [(point.special, round(point.value, 9)) for point in branch.special_points]
        assert kinds == [(Kind.PERIOD_DOUBLING, 3.0), (Kind.PERIOD_DOUBLING, round(1.0 + 6.0**0.5, 9))]
        assert not branch.remarks


@pytest.mark.parametrize("gap", [3e-5, 1e-5])
def test_a_fold_near_another_branch_is_no_transcritical_point(gap):
    """The orbits of x -> x - (x^2 - p^2 + gap^2) turn back at p = -gap, close before those that begin at p = gap."""
    family = lambda p: from_map(lambda x: ([x[0] - x[0] ** 2 + p * p - gap * gap], [[1.0 - 2.0 * x[0]]]), 1)  # noqa: E731
    branch = follow(family, begin(family, -0.5, [0.5]), (-0.5, 0.5))
    (special,) = branch.special_points
    assert special.special is Kind.FOLD
    assert abs(special.value + gap) <= special.bifurcation.error_bound < 1e-9


def test_no_branch_meets_a_family_by_energy_near_its_separatrix():
    """Orbits of the soft spring x'' = x^3 - x, damped by p: their multiplier is 1, with an error that grows there."""

    def family(p):
        def rhs(t, x):
            return [x[1] + p * (x[0] - x[0] ** 3), x[0] ** 3 - x[0] + p * x[1]]

        return from_rhs(rhs, 2, None, guess_period=6.3)

    branch = follow(family, begin(family, 0.0, [0.5, 0.0]), (-0.1, 0.1), points=20, closely=False)
    assert branch.points[-1].orbit[0] > 0.9999
    assert not branch.special_points


def flat(power):
    return lambda a: from_rhs(lambda t, x: -a - x**power, 1, PERIOD)


def beside(distance):
    """Branches -a = x^2 and a = d + x / 2, which meet at a near -4 d^2, beside the fold at 0."""
    return lambda a: from_rhs(lambda t, x: (-a - x**2) * (-a + distance + 0.5 * x), 1, PERIOD)


@pytest.mark.parametrize("power", [6, 8])
def test_a_flat_fold_is_no_branch_point(power):
    """The multiplier is +1 within its error for a while: a fold is reported with its bound, or a remark."""
    start = begin(flat(power), -0.5, [0.5 ** (1.0 / power)])
    branch = follow(flat(power), start, (-0.52, 1.0))
    assert len(branch.special_points) <= 1
    assert branch.special_points or any("passes +1" in remark for remark in branch.remarks)
    for fold in branch.special_points:
        assert fold.special is Kind.FOLD
        assert abs(fold.value) <= fold.bifurcation.error_bound


@pytest.mark.parametrize("distance", [1e-4, 1e-5])
def test_a_branch_that_passes_close_to_a_fold_is_found_or_remarked(distance):
    branch = follow(beside(distance), begin(beside(distance), -0.5, [0.5**0.5]), (-1.0, 1.0))
    kinds = [point.special for point in branch.special_points]
    missing = 3 - len(kinds)
    assert kinds == [Kind.FOLD] + [Kind.TRANSCRITICAL] * (2 - missing)
    assert missing == sum("beside the fold is another bifurcation" in remark for remark in branch.remarks) <= 1


@pytest.mark.parametrize("between", [(0.9, 1.2), (0.5, 2.0)])
def test_a_narrow_resonance_is_not_passed_over(between):
    """Its two folds, as harmonic balance gives them, lie within 6e-4, and the orbit is alike on both sides."""

    def forced(w):
        rhs = lambda t, x: [x[1] / w, (-2e-4 * x[1] - x[0] - x[0] ** 3 + 1e-5 * np.cos(t)) / w]  # noqa: E731
        return from_rhs(rhs, 2, 2.0 * np.pi)

    branch = follow(forced, begin(forced, between[0], [1e-5 / (1.0 - between[0] ** 2), 0.0]), between)
    assert [point.special for point in branch.special_points] == [Kind.FOLD, Kind.FOLD]
    np.testing.assert_allclose([point.value for point in branch.special_points], [1.000937, 1.000379], atol=3e-6)


def test_a_doubling_is_left_with_the_period_that_its_point_knows():
    """The family's own guess belongs to the start of another branch."""

    def roessler(c, guess):
        return from_rhs(
            lambda t, x: [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - c)], 3, None, guess_period=guess
        )

    def near(c):
        return roessler(c, 6.0)

    branch = follow(near, begin(near, 2.5, [0.0, -3.5, 0.1]), (2.5, 3.0))
    (point,) = branch.special_points
    (start,) = switch(lambda c: roessler(c, 0.7), point)
    assert start.period == pytest.approx(2.0 * point.period, rel=1e-9)


def test_bounds_along_a_doubled_branch_do_not_grow_with_the_width_of_the_interval():
    """The orbit's change with the parameter, in units of the interval, is no error of its derivative."""
    period = 2.0 * np.pi / 0.7

    def junction(force):
        rhs = lambda t, x: [x[1], -0.4 * x[1] - np.sin(x[0]) + 0.3 + force * np.cos(0.7 * t)]  # noqa: E731
        return from_rhs(rhs, 2, period)

    branch = follow(junction, begin(junction, 0.05, [0.3, 0.0]), (0.05, 2.0))
    (start,) = switch(junction, branch.special_points[1])
    last = follow(junction, start, (0.05, 2.0), points=16).points[-1]
    assert last.stable
    force = last.value
    twice = from_rhs(lambda t, x: [x[1], -0.4 * x[1] - np.sin(x[0]) + 0.3 + force * np.cos(0.7 * t)], 2, 2.0 * period)
    own = np.abs(multipliers(twice, last.orbit).values)
    assert np.abs(np.sort(np.abs(last.multipliers)) - np.sort(own)).max() < last.error_bound < 1e-2


def test_the_size_of_a_rest_is_where_a_bounded_nonlinearity_acts():
    """Far from x = 0 a pendulum rotates freely, so its return is nearly linear again, and takes many steps."""

    def family(a):
        return from_rhs(lambda t, x: [x[1], -0.1 * x[1] + (0.05 - a * np.cos(t)) * np.sin(x[0])], 2, 2.0 * np.pi)

    branch = follow(family, [0.0, 0.0], (0.01, 0.6))
    assert [point.special for point in branch.special_points] == [Kind.PITCHFORK, Kind.PERIOD_DOUBLING]
    assert branch.special_points[0].value == pytest.approx(0.3245234776, abs=1e-9)  # that of `locate`
    assert ((branch.units[:-1] > 0.1) & (branch.units[:-1] < 5.0)).all()
