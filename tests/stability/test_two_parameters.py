"""How a curve of bifurcation points is followed: where it ends and why, and what is refused."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure

from chilopod.errors import ParameterError
from chilopod.stability import (
    BifurcationPoint,
    CodimensionTwo,
    Ending,
    Kind,
    PeriodicSystem,
    SpecialPoint2,
    begin,
    follow,
    follow2,
    from_map,
    locate,
    switch,
    switch2,
)
from chilopod.stability.codimension_two import detection
from chilopod.stability.normal_forms.normal_form import NormalFormStatus
from helpers.systems import doubling, of_map

BOX = ((-2.0, 2.0), (-2.0, 2.0))


def circle(hole=None):
    """x -> -(p^2 + q^2) x, which doubles its period on the unit circle."""

    def family2(p, q):
        size = -(p * p + q * q)
        if hole is not None and hole(p, q):
            size = np.nan
        return of_map(lambda x: (size * x, np.array([[size]])), orbit=np.zeros(1), many=True)

    return family2


def start_at(angle, kind=Kind.PERIOD_DOUBLING):
    point = BifurcationPoint(kind, np.cos(angle), 0.0, np.zeros(1), np.ones(1, complex), -1.0 + 0j, np.pi)
    return point, np.sin(angle)


POINT, SECOND = start_at(0.4)


@pytest.mark.parametrize("rising", [None, True, False])
def test_closed_curve_ends_where_it_began(rising):
    curve = follow2(circle(), POINT, BOX, second=SECOND, rising=rising, points=500)
    assert Ending.CLOSED in curve.endings
    assert not curve.special
    angles = np.unwrap(np.arctan2(curve.values[:, 1], curve.values[:, 0]))
    assert np.abs(np.hypot(*curve.values.T) - 1.0).max() < 1e-13
    turn = abs(angles[-1] - angles[0])
    assert 2.0 * np.pi - 0.15 < turn < 2.0 * np.pi
    (line,) = curve.plot(Figure().add_subplot()).lines
    np.testing.assert_array_equal(line.get_xydata(), [*curve.values, curve.values[0]])


def test_edges_of_the_box_are_met_exactly():
    curve = follow2(circle(), POINT, ((0.3, 2.0), (-0.7, 2.0)), second=SECOND)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    (one, other) = (curve.values[0], curve.values[-1])
    assert one[1] == -0.7
    assert one[0] == pytest.approx(np.sqrt(1.0 - 0.49), abs=1e-13)
    assert other[0] == 0.3
    assert other[1] == pytest.approx(np.sqrt(1.0 - 0.09), abs=1e-13)
    assert (curve.values >= [0.3, -0.7]).all()


@pytest.mark.parametrize("width", [1e-4, 1e-6, 1e-8])
def test_a_box_far_narrower_than_its_values_is_crossed(width):
    """Its steps are parts of the box, and the rounding of the systems, some 1e-15, is that of the values."""

    def family2(p, q):
        size = -(p * p + q * q) + 1e-15 * np.sin(1e20 * (p + q))
        return of_map(lambda x: (size * x, np.array([[size]])), orbit=np.zeros(1), many=True)

    box = (POINT.value - width, POINT.value + 0.7 * width), (SECOND - width, SECOND + width)
    curve = follow2(family2, POINT, box, second=SECOND)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    assert len(curve.points) < 100
    assert np.abs(np.hypot(*curve.values.T) - 1.0).max() < 1e-14


@pytest.mark.parametrize("off", [0.0, 1e-9, -1e-9])
def test_no_values_outside_the_box_are_asked_for(off):
    """Of a start on its edge, which may be off by its error, either."""
    asked = []

    def family2(p, q):
        asked.append(q)
        return circle()(p, q)

    point = replace(POINT, value=POINT.value + off)
    curve = follow2(family2, point, ((-2.0, 2.0), (SECOND, 2.0)), second=SECOND, coefficients=False)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    assert curve.values[0][1] == curve.values[-1][1] == min(asked) == SECOND


def test_a_direction_is_kept():
    up = follow2(circle(), POINT, ((0.3, 2.0), (-0.7, 2.0)), second=SECOND, rising=True)
    down = follow2(circle(), POINT, ((0.3, 2.0), (-0.7, 2.0)), second=SECOND, rising=False)
    assert up.endings == (Ending.START, Ending.LEFT_INTERVAL)
    assert (np.diff(up.values[:, 1]) > 0.0).all()
    assert (np.diff(down.values[:, 1]) < 0.0).all()


def test_where_the_map_does_not_exist_the_curve_is_lost_with_a_reason():
    curve = follow2(circle(hole=lambda p, q: q > 0.8), POINT, BOX, second=SECOND, rising=True)
    assert curve.endings[1] is Ending.LOST
    assert "not finite" in curve.reasons[1]
    assert 0.8 - 1e-5 < curve.values[-1][1] <= 0.8


@pytest.mark.parametrize(("rising", "border"), [(True, 0.3), (False, -0.3)])
def test_a_jump_that_ends_the_curve_is_named(rising, border):
    """Beyond the border the derivative of the return has another value, as where an impact is added that is not
    counted."""

    def family2(p, q):
        def image(x):
            past = max(x[0] + q / border - 1.0, 0.0)
            return x + p - x**2 + 0.5 * past, np.array([[1.0 - 2.0 * x[0] + 0.5 * (past > 0.0)]])

        return of_map(image, scale=np.ones(1))

    family = partial(family2, q=0.0)
    (fold,) = follow(family, begin(family, 0.04, [0.2], rising=False), (-0.1, 0.05)).special_points
    curve = follow2(family2, fold.bifurcation, BOX, second=0.0, rising=rising)
    assert curve.endings[1] is Ending.LOST
    assert curve.reasons[1].startswith("just ahead returns change so fast that they seem to jump")
    assert curve.remarks == (curve.reasons[1],)
    assert curve.to_dataset().attrs["remarks"] == curve.reasons[1]
    assert curve.values[-1] == pytest.approx([0.0, border], abs=1e-5)


def test_a_family_that_refuses_values_ends_the_curve():
    def family2(p, q):
        if q > 0.8:
            raise ParameterError("must be at most 0.8", field="q", value=q)
        return circle()(p, q)

    curve = follow2(family2, POINT, BOX, second=SECOND, rising=True)
    assert curve.endings[1] is Ending.LOST
    assert "at most 0.8" in curve.reasons[1]


def test_budgets_are_kept():
    calls = []

    def family2(p, q):
        calls.append((p, q))
        return circle()(p, q)

    curve = follow2(family2, POINT, BOX, second=SECOND, rising=True, budget=200, coefficients=False)
    assert curve.endings[1] is Ending.BUDGET
    assert len(calls) < 1000
    short = follow2(circle(), POINT, BOX, second=SECOND, points=7)
    assert short.endings == (Ending.ENOUGH_POINTS, Ending.ENOUGH_POINTS)
    assert len(short.points) == 15


def test_progress_is_told():
    told = []
    follow2(circle(), POINT, BOX, second=SECOND, points=3, progress=lambda count, at: told.append((count, at.values)))
    assert [count for count, _ in told] == [1, 2, 3, 1, 2, 3]


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"between": ((-2.0, 2.0), (2.0, -2.0))}, "between"),
        ({"between": (-2.0, 2.0)}, "between"),
        ({"between": ((-2.0, 2.0), (0.0, np.inf))}, "between"),
        ({"between": ((-2.0, 0.5), (-2.0, 2.0))}, "between"),
        ({"second": np.nan}, "second"),
        ({"points": 0}, "points"),
        ({"step": 0.0}, "step"),
        ({"budget": -1}, "budget"),
        ({"start": "here"}, "start"),
        ({"start": BifurcationPoint(Kind.FOLD, 0.9, 0.0, np.zeros(2), np.ones(2, complex), 1 + 0j, 0.0)}, "start"),
    ],
)
def test_what_is_refused(given, field):
    arguments = {"family2": circle(), "start": POINT, "between": BOX, "second": SECOND} | given
    with pytest.raises(ParameterError) as refused:
        follow2(**arguments)
    assert refused.value.field == field


def test_what_two_parameters_would_unfold_is_refused():
    """x -> (1 + p) x - x^3 of an orbit that is neither known nor symmetric as far as anybody says."""

    def family2(p, q):
        return of_map(lambda x: ((1.0 + p) * x - x**3, np.array([[1.0 + p - 3.0 * x[0] ** 2]])))

    start = BifurcationPoint(Kind.PITCHFORK, 0.0, 0.0, np.zeros(1), np.ones(1, complex), 1.0 + 0j, 0.0)
    with pytest.raises(ParameterError, match="unfold"):
        follow2(family2, start, BOX, second=0.0)


@pytest.mark.parametrize("kind", [Kind.KREIN_COLLISION, Kind.HOPF])
def test_a_point_of_a_wrong_kind_is_named(kind):
    point, _ = start_at(0.4, kind)
    with pytest.raises(ParameterError, match=rf"^start = '{kind.label}': must be of a kind .* of another kind$"):
        follow2(circle(), point, BOX, second=SECOND)
    one = np.ones(1, complex)
    special = SpecialPoint2(np.zeros(2), np.zeros(2), np.zeros(1), one, 1.0 + 0j, one, 0.0, kind=CodimensionTwo.CUSP)
    for start in (special, "here"):
        with pytest.raises(ParameterError, match="BifurcationPoint from `locate`, or a start from `switch2`"):
            follow2(circle(), start, BOX, second=SECOND)
    with pytest.raises(ParameterError, match="must be a point of codimension two; allowed: one of the `special`"):
        switch2(circle(), point, BOX)


turning = doubling(many=True)
TURNS = BifurcationPoint(Kind.PERIOD_DOUBLING, 0.0, 0.0, np.zeros(1), np.ones(1, complex), -1.0 + 0j, np.pi)


def test_a_coefficient_that_is_not_found_near_its_zero_is_bracketed(monkeypatch):
    """x -> -(1 + p) x + (q - 0.1) x^3 turns at q = 0.1, where here no normal form is found."""

    def shy(*arguments, **named):
        form = detection_normal_form(*arguments, **named)
        return replace(form, status=NormalFormStatus.OUT_OF_REACH, cubic=np.nan) if abs(form.cubic) < 0.004 else form

    detection_normal_form = detection.normal_form
    monkeypatch.setattr(detection, "normal_form", shy)

    curve = follow2(turning, TURNS, ((-1.0, 1.0), (-1.0, 1.0)), second=-0.3)
    (found,) = curve.special
    assert found.kind is CodimensionTwo.GENERALISED_PERIOD_DOUBLING
    assert abs(found.values[1] - 0.1) <= found.error_bound[1] < 0.03
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)


def test_a_point_that_may_be_anywhere_is_none(monkeypatch):
    assert follow2(turning, TURNS, ((-1.0, 1.0), (-1.0, 1.0)), second=-0.3).special
    monkeypatch.setattr(detection, "_along", lambda *arguments: np.inf)
    curve = follow2(turning, TURNS, ((-1.0, 1.0), (-1.0, 1.0)), second=-0.3)
    assert not curve.special
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)


def test_another_second_parameter_than_that_of_the_point_is_refused():
    def cubic(p, q):
        return from_map(lambda x: ([x[0] + 0.1 * (p + q * x[0] - x[0] ** 3)], [[1.0 + 0.1 * (q - 3.0 * x[0] ** 2)]]), 1)

    branch = follow(partial(cubic, q=1.5), begin(partial(cubic, q=1.5), -2.0, [-1.6]), (-2.0, 2.0))
    fold = branch.special_points[0].bifurcation
    box = (-2.0, 2.0), (-1.0, 2.5)
    assert follow2(cubic, fold, box, second=1.5, points=3).kind is Kind.FOLD
    with pytest.raises(ParameterError, match=r"second = 1.4: is not that of the start.*0\.68"):
        follow2(cubic, fold, box, second=1.4)


@pytest.mark.parametrize(("order", "kind"), [(3, CodimensionTwo.FOLD_FLIP), (4, CodimensionTwo.PITCHFORK_FOLD)])
def test_a_multiplier_of_minus_1_breaks_a_symmetry_of_even_order(order, kind):
    """A fold of y beside a multiplier -(1 + q) of x; the symmetry turns the plane of the first two states."""
    angle = 2.0 * np.pi / order
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])

    def family2(p, q):
        def flow(x, t0, t1):
            derivative = np.eye(3)
            first, last = round(order * t0), round(order * t1)
            for part in range(first, last):
                frame = np.linalg.matrix_power(turn.T, part)
                x, derivative = frame.T @ x, frame.T @ derivative
                slopes = np.diag([-(1.0 + q), 0.3, 1.0 - 2.0 * x[2]])
                x = frame @ turn.T @ np.array([-(1.0 + q) * x[0], 0.3 * x[1], x[2] + p - x[2] ** 2])
                derivative = frame @ turn.T @ slopes @ derivative
            return x, derivative

        more = {"symmetry": turn}
        return PeriodicSystem(3, 1.0, flow, flow_with_error=lambda *given: (*flow(*given), 1e-14), **more)

    point = BifurcationPoint(Kind.FOLD, 0.0, 0.0, np.zeros(3), np.eye(3, dtype=complex)[2], 1.0 + 0j, 0.0)
    (found,) = follow2(family2, point, ((-1.0, 1.0), (-0.31, 0.3)), second=-0.3, coefficients=False).special
    assert found.kind is kind
    np.testing.assert_allclose(found.values, 0.0, atol=1e-6)


@pytest.mark.parametrize("shift", [0.0, 1e-3, 1.0])
def test_states_at_zero_are_followed_as_others_are(shift):
    """The curve of folds is p = 0 for all q, with a fold-flip at the origin; the second state is ``shift`` on it."""

    def family2(p, q):
        def image(x):
            v = x[1] - shift
            after = [x[0] - p - x[0] ** 2 + 0.1 * v**2, shift - (1.0 + q) * v + v**3]
            return after, [[1.0 - 2.0 * x[0], 0.2 * v], [0.0, 3.0 * v**2 - 1.0 - q]]

        return from_map(image, 2)

    (point,) = locate(lambda p: family2(p, -0.3), (-0.2, 0.1), orbit=[0.44, shift])
    curve = follow2(family2, point, ((-0.2, 0.1), (-0.5, 0.5)), second=-0.3)
    assert set(curve.endings) == {Ending.LEFT_INTERVAL}
    (special,) = curve.special
    assert special.kind is CodimensionTwo.FOLD_FLIP
    assert (np.abs(special.values) <= special.error_bound).all()


def meeting(oblique):
    """x -> x (1 + p + y) - x^3, y -> y + q + y^2 + 0.8 x^2: a fold of y at q = 0, pitchforks of x at p = -y. In oblique
    coordinates the modes of both are not at right angles."""
    axes = np.array([[1.0, 0.4], [-0.7, 1.2]]) if oblique else np.eye(2)
    back = np.linalg.inv(axes)

    def family2(p, q):
        def image(state):
            x, y = axes @ state
            slopes = np.array([[1.0 + p + y - 3.0 * x * x, x], [1.6 * x, 1.0 + 2.0 * y]])
            return back @ [x * (1.0 + p + y) - x**3, y + q + y * y + 0.8 * x * x], back @ slopes @ axes

        return from_map(image, 2, spatial_symmetry=back @ np.diag([-1.0, 1.0]) @ axes)

    return family2, back


@pytest.mark.parametrize("oblique", [False, True])
@pytest.mark.parametrize(("kind", "values", "y"), [(Kind.PITCHFORK, (0.3, -0.09), -0.3), (Kind.FOLD, (-0.3, 0.0), 0.0)])
def test_pitchfork_and_fold_meet(oblique, kind, values, y):
    """Also where the return map has two equal multipliers, and the equations of one are singular."""
    family2, back = meeting(oblique)
    mode = back[:, 0 if kind is Kind.PITCHFORK else 1].astype(complex)
    start = BifurcationPoint(kind, values[0], 0.0, back @ [0.0, y], mode, 1.0 + 0j, 0.0)
    curve = follow2(family2, start, ((-0.5, 0.35), (-0.2, 0.1)), second=values[1])
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    (found,) = curve.special
    assert found.kind is CodimensionTwo.PITCHFORK_FOLD
    assert (np.abs(found.values) <= found.error_bound).all()
    assert found.error_bound.max() < 1e-12


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_another_multiplier_like_the_critical_one(sign):
    """Two flips, or a pitchfork and a transcritical bifurcation of another state, which are not coupled at first."""

    def family2(p, q):
        def image(state):
            x, y = state
            slopes = [[sign * (1.0 + p) - 3.0 * x * x + 0.2 * y, 0.2 * x], [0.2 * x, sign * (1.0 + q) - 2.0 * y]]
            return [sign * (1.0 + p) * x - x**3 + 0.2 * x * y, sign * (1.0 + q) * y - y * y + 0.1 * x * x], slopes

        return from_map(image, 2, spatial_symmetry=np.diag([-1.0, 1.0]) if sign > 0.0 else None)

    kind = Kind.PITCHFORK if sign > 0.0 else Kind.PERIOD_DOUBLING
    start = BifurcationPoint(kind, 0.0, 0.0, np.zeros(2), np.eye(2, dtype=complex)[0], sign + 0j, 0.0)
    curve = follow2(family2, start, ((-0.5, 0.5), (-0.4, 0.4)), second=-0.3, coefficients=False)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    (found,) = curve.special
    assert found.kind is CodimensionTwo.SEVERAL_CRITICAL
    np.testing.assert_allclose(found.values, 0.0, atol=1e-14)


def test_two_flips_of_which_one_breaks_a_symmetry_have_one_name_on_both_curves():
    """Coupled logistic maps at [3, 0], where both multipliers are -1 and none is +1."""

    def family2(r, e):
        coupling = np.array([[1.0 - e, e], [e, 1.0 - e]])
        symmetry = [[0.0, 1.0], [1.0, 0.0]]
        return from_map(
            lambda x: (coupling @ (r * x * (1.0 - x)), coupling * (r * (1.0 - 2.0 * x))), 2, spatial_symmetry=symmetry
        )

    starts = locate(lambda r: family2(r, -0.1), (2.2, 3.4), orbit=[0.55, 0.55], normal_form=False)
    box = ((2.0, 3.9), (-0.4, 0.4))
    curves = [follow2(family2, start, box, second=-0.1, coefficients=False) for start in starts]
    found = [special for curve in curves for special in curve.special]
    assert [each.kind for each in found] == [CodimensionTwo.SEVERAL_CRITICAL] * 2
    np.testing.assert_allclose([each.values for each in found], [[3.0, 0.0]] * 2, atol=1e-12)


def test_a_pitchfork_is_not_followed_among_systems_without_its_symmetry():
    def family2(p, q):
        mirror = None if q else -np.eye(1)
        return from_map(
            lambda x: ([(1.0 + p) * x[0] + q - x[0] ** 3], [[1.0 + p - 3.0 * x[0] ** 2]]), 1, spatial_symmetry=mirror
        )

    (point,) = locate(lambda p: family2(p, 0.0), (-0.5, 0.3), orbit=[0.0])
    assert point.kind is Kind.PITCHFORK
    with pytest.raises(ParameterError, match="unfolds"):
        follow2(family2, point, ((-0.5, 0.3), (-0.5, 0.5)), second=0.0)


def test_a_pole_of_a_coefficient_is_no_zero():
    """(x, y) -> (y, p - q x - y^2 - 0.3 x y): the coefficient of its period doublings has a pole at a fold-flip,
    where its sign changes."""

    def family2(p, q):
        def image(state):
            x, y = state
            return [y, p - q * x - y * y - 0.3 * x * y], [[0.0, 1.0], [-q - 0.3 * y, -2.0 * y - 0.3 * x]]

        return from_map(image, 2)

    (located,) = locate(lambda p: family2(p, 0.3), (0.0, 3.0), [0.0, 0.0])
    curve = follow2(family2, located, ((-3.0, 6.0), (-2.0, 3.0)), second=0.3, points=None)
    first, second = curve.special
    assert (first.kind, second.kind) == (CodimensionTwo.FOLD_FLIP, CodimensionTwo.RESONANCE_1_2)
    assert (np.abs(first.values - [0.0, -1.0]) <= first.error_bound).all()


def test_points_of_a_doubled_branch_are_followed_over_two_periods():
    """x -> r x (1 - x) + q is y -> y^2 + c with c = r / 2 - r^2 / 4 - r q, whose 2-cycle doubles at c = -5/4."""

    def family2(r, q):
        return from_map(lambda x: ([r * x[0] * (1.0 - x[0]) + q], [[r * (1.0 - 2.0 * x[0])]]), 1)

    def family(r):
        return family2(r, 0.0)

    (start,) = switch(family, follow(family, [0.6], (2.6, 3.6)).special_points[0])
    point = follow(family, start, (2.6, 3.6)).special_points[-1].bifurcation
    found = follow2(family2, point, ((2.6, 3.6), (-0.05, 0.05)), second=0.0, points=3, coefficients=False)
    r, q = found.values.T
    assert found.periods == 2
    np.testing.assert_allclose(r / 2.0 - r**2 / 4.0 - r * q, -1.25, atol=1e-12)


def bounds_of(curve):
    return np.array([each.error_bound for each in curve.points])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_nothing_happens_along_collisions(sign):
    """[[p - q^2, -1], [1, 0]] has determinant 1: both multipliers are +1 or -1 on all of p = q^2 ± 2, in one block. The
    box is so wide that its rounding in p is far above that of the map."""

    def family2(p, q):
        matrix = np.array([[p - q * q, -1.0], [1.0, 0.0]])
        return of_map(lambda x: (matrix @ x, matrix), 2, orbit=np.zeros(2))

    centre, mode = 2.0 * sign, np.array([sign, 1.0], complex) / np.sqrt(2.0)
    start = BifurcationPoint(Kind.COLLISION, centre + 0.09, 0.0, np.zeros(2), mode, sign + 0j, 0.0)
    curve = follow2(family2, start, ((centre - 500.0, centre + 500.0), (-3.0, 3.0)), second=0.3)
    assert not curve.special
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    assert (np.abs(curve.values[:, 0] - curve.values[:, 1] ** 2 - centre) <= bounds_of(curve)[:, 0]).all()


def beside(gap, noise=0.0, **more):
    """x -> -(1 + (p^2 - q^2 - gap) / 3) x: period doublings on the hyperbola p^2 = q^2 + gap, of two curves."""

    def family2(p, q):
        size = -(1.0 + (p * p - q * q - gap) / 3.0) + noise * np.sin(1e20 * (p + q))
        return of_map(lambda x: (size * x, np.array([[size]])), orbit=np.zeros(1), many=True)

    start = start_at(np.arccos(np.sqrt(0.25 + gap)))[0]
    return follow2(family2, start, BOX, second=0.5, points=None, coefficients=False, **more)


@pytest.mark.parametrize(("gap", "noise"), [(1e-4, 0.0), (1e-8, 0.0), (-1e-8, 0.0), (1e-6, 2e-16)])
def test_a_curve_is_not_left_for_a_near_one(gap, noise):
    curve = beside(gap, noise)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    assert (curve.values[:, 0 if gap > 0.0 else 1] >= np.sqrt(abs(gap)) - 1e-9).all()
    assert set(np.sign(curve.values[[0, -1], 1 if gap > 0.0 else 0])) == {-1.0, 1.0}


@pytest.mark.parametrize("noise", [0.0, 2e-16])
def test_curves_that_cross_are_followed_straight_on(noise):
    curve = beside(0.0, noise)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    np.testing.assert_allclose(curve.values[:, 0], curve.values[:, 1], atol=1e-9)
    assert len(curve.points) < 60


def test_a_curve_that_cannot_be_told_from_another_one_ends():
    """Their distance is far below the shortest step, a hundred-thousandth of the longest."""
    curve = beside(1e-9, longest=1.0, step=1.0)
    assert Ending.LOST in curve.endings
    assert len(set(np.sign(curve.values[:, 0]))) == 1


def ring(a, k):
    """z_j -> e^(i / 2) (1 + a - |z_j|^2) z_j + k (z_(j+1) + z_(j-1) - 2 z_j) e^(i / 2) of three alike cells: two pairs
    are on the unit circle where a = 3 k."""
    turn, mirror = np.roll(np.eye(3), 1, axis=0), np.eye(3)[::-1]
    coupled = k * (turn + turn.T - 2.0 * np.eye(3))
    spin = np.kron([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]], np.eye(3))

    def image(x):
        u, v = x[:3], x[3:]
        grow, each = 1.0 + a - u * u - v * v, -2.0 * np.array([[u * u, u * v], [u * v, v * v]])
        local = np.block([[np.diag(part) for part in row] for row in each])
        matrix = np.diag(np.tile(grow, 2)) + np.kron(np.eye(2), coupled)
        return spin @ matrix @ x, spin @ (matrix + local)

    symmetries = [np.kron(np.eye(2), each) for each in (turn, mirror)]
    return from_map(image, 6, orbit=np.zeros(6), spatial_symmetry=symmetries)


def test_two_pairs_that_a_symmetry_makes_equal_are_followed_as_one():
    (point,) = (each for each in locate(lambda a: ring(a, 0.1), (0.2, 0.4)) if each.multiplicity == 4)
    curve = follow2(ring, point, ((-0.2, 0.6), (-0.1, 0.3)), second=0.1)
    assert curve.endings == (Ending.LEFT_INTERVAL, Ending.LEFT_INTERVAL)
    assert (np.abs(curve.values @ [1.0, -3.0]) <= bounds_of(curve) @ [1.0, 3.0]).all()
    (special,) = curve.special  # where all cells alike are critical as well
    assert special.kind is CodimensionTwo.DOUBLE_NEIMARK_SACKER
    assert (np.abs(special.values) <= special.error_bound).all()
    assert all(each.coefficient is None for each in curve.points)


def test_two_equal_pairs_without_a_symmetry_are_refused():
    (point,) = (each for each in locate(lambda a: ring(a, 0.1), (0.2, 0.4)) if each.multiplicity == 4)

    def alone(a, k):
        return replace(ring(a, k), spatial_symmetry=None)

    with pytest.raises(ParameterError, match="has 2 critical pairs that no spatial symmetry makes equal"):
        follow2(alone, point, ((-0.2, 0.6), (-0.1, 0.3)), second=0.1)
