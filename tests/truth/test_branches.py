"""Branches whose curves, special points and multipliers are known in closed form."""

from math import cos, exp, pi, sin, sqrt

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import (
    Criticality,
    Ending,
    Kind,
    PeriodicSystem,
    begin,
    follow,
    from_map,
    from_rhs,
    locate,
    switch,
)
from helpers import systems


def of_map(function, derivative, dimension=1, **more):
    """A system with a period of 1 whose return map is a function, known to round-off."""

    def image(x):
        return np.atleast_1d(function(x)).astype(float), np.atleast_2d(derivative(x))

    return systems.of_map(image, dimension, share=4e-16, **more)


def rescaled(family, units):
    """The same systems with their states in other units."""
    units = np.array(units)

    def other(value):
        system = family(value)

        def flow(x, t0, t1):
            state, product = system.flow(x / units, t0, t1)
            return state * units, product * units[:, None] / units

        def with_error(x, t0, t1):
            state, product, error = system.flow_with_error(x / units, t0, t1)
            return state * units, product * units[:, None] / units, error * units[:, None] / units

        more = {"flow_with_error": with_error} if system.flow_with_error else {}
        if system.period is None:
            more |= {"velocity": lambda x: units * system.velocity(x / units), "guess_period": system.guess_period}
        return PeriodicSystem(system.dimension, system.period, flow, **more)

    return other


def within(special, value):
    """Whether a special point is where it should be, by no more than its bound."""
    bound = special.bifurcation.error_bound
    return abs(special.value - value) <= bound < 1e-8


def crossing(p):
    """x -> (1 + p) x - x^2: orbits 0 and p."""
    return of_map(lambda x: (1 + p) * x - x**2, lambda x: 1 + p - 2 * x)


def logistic(r):
    return from_map(lambda x: (r * x * (1 - x), np.diag(r * (1 - 2 * x))), 1)


def henon(a, b=0.3):
    return of_map(
        lambda x: np.array([a - x[0] ** 2 + b * x[1], x[0]]), lambda x: np.array([[-2 * x[0], b], [1.0, 0.0]]), 2
    )


def ring(p, radius=0.5):
    """Orbits x^2 + p^2 = radius^2."""
    return of_map(lambda x: x + radius**2 - x**2 - p**2, lambda x: 1 - 2 * x)


def test_transcritical_and_the_other_branch():
    between = (-0.4, 0.5)
    old = follow(crossing, begin(crossing, -0.4, [0.0]), between)
    (point,) = old.special_points
    assert point.special is Kind.TRANSCRITICAL
    assert within(point, 0.0)
    assert point.bifurcation.normal_form.quadratic == pytest.approx(-1.0, abs=1e-9)
    ends = []
    for start in switch(crossing, point):
        branch = follow(crossing, start, between)
        assert branch.ending is Ending.LEFT_INTERVAL
        for each in branch.points:
            assert each.orbit[0] == pytest.approx(each.value, abs=1e-9)
            assert each.multipliers[0].real == pytest.approx(1 - each.value, abs=1e-9)
        assert [each.special for each in branch.points[1:]] == [None] * (len(branch.points) - 1)
        ends.append(branch.points[-1].value)
    assert sorted(ends) == [-0.4, 0.5]


def test_a_located_transcritical_point_is_left_along_the_other_branch():
    def family(p):
        return of_map(lambda x: (1 + p) * x - x**2, lambda x: 1 + p - 2 * x, orbit=[0.0])

    (point,) = locate(family, (-0.4, 0.5))
    branch = follow(family, switch(family, point)[0], (-0.4, 0.5))
    assert abs(branch.points[-1].orbit[0]) == pytest.approx(abs(branch.points[-1].value), abs=1e-9)
    assert branch.points[-1].orbit[0] != 0.0


def test_period_doublings_of_the_logistic_map():
    """Doublings at 3 and 1 + sqrt(6); the orbit of period 2 has the multiplier 4 + 2 r - r^2."""
    between = (2.2, 3.52)
    branch = follow(logistic, begin(logistic, 2.2, [0.5]), between)
    (first,) = branch.special_points
    assert first.special is Kind.PERIOD_DOUBLING
    assert within(first, 3.0)
    assert first.bifurcation.criticality is Criticality.SUPERCRITICAL
    assert first.bifurcation.frequency == pytest.approx(pi)
    assert first.bifurcation.coefficient == pytest.approx(-18.0, rel=1e-7)  # -a - 3 a^2, twice
    (start,) = switch(logistic, first)
    doubled = follow(logistic, start, between)
    assert doubled.periods == 2
    assert doubled.ending is Ending.LEFT_INTERVAL
    for point in doubled.points[1:]:
        r = point.value
        states = [(r + 1 + sign * sqrt((r - 3) * (r + 1))) / (2 * r) for sign in (-1, 1)]
        assert min(abs(point.orbit[0] - x) for x in states) < 1e-8
        assert point.multipliers[0].real == pytest.approx(4 + 2 * r - r**2, abs=1e-8)
        assert point.period == 2.0
    (left, second) = doubled.special_points
    assert left.value == first.value
    assert second.special is Kind.PERIOD_DOUBLING
    assert within(second, 1 + sqrt(6))
    # Where two periods map a to -a + b a^2 + d a^3, four map it to a - 2 (b^2 + d) a^3.
    once = Polynomial([0.0, second.value, -second.value])
    _, _, b, d, _ = once(once)(Polynomial([second.orbit[0], 1.0])).coef
    assert second.bifurcation.coefficient == pytest.approx(-2 * (b**2 + d), rel=1e-6)
    (again,) = switch(logistic, second, periods=doubled.periods)
    fourth = follow(logistic, again, between, points=8)
    assert fourth.periods == 4
    x = fourth.points[-1].orbit
    image = logistic(fourth.points[-1].value).flow(x, 0.0, 2.0)[0]
    assert abs(image[0] - x[0]) > 1e-3
    assert logistic(fourth.points[-1].value).flow(x, 0.0, 4.0)[0] == pytest.approx(x, abs=1e-9)


@pytest.mark.parametrize("units", [[1.0, 1.0], [1e9, 1e9], [1e-9, 1e9], [3e-9, 7e-9]])
def test_the_map_of_henon_in_any_units(units):
    """Fold at -(1-b)^2/4, doublings at 3 (1-b)^2/4 and, of the orbit of period 2, at (1-b)^2 + (1+b)^2/4."""
    family, between, b = rescaled(henon, units), (-0.5, 1.2), 0.3
    start = begin(family, 0.0, np.array([0.05, 0.05]) * units)
    up = follow(family, start, between)
    (doubling,) = up.special_points
    assert doubling.special is Kind.PERIOD_DOUBLING
    assert within(doubling, 3 * (1 - b) ** 2 / 4)
    down = follow(family, begin(family, 0.0, np.array([0.05, 0.05]) * units, rising=False), between)
    fold = down.special_points[0]
    assert fold.special is Kind.FOLD
    assert within(fold, -((1 - b) ** 2) / 4)
    assert fold.bifurcation.normal_form.quadratic != 0.0
    doubled = follow(family, switch(family, doubling)[0], between)
    second = doubled.special_points[1]
    assert second.special is Kind.PERIOD_DOUBLING
    assert within(second, (1 - b) ** 2 + (1 + b) ** 2 / 4)


def test_an_isola_closes():
    branch = follow(ring, begin(ring, 0.0, [0.5]), (-1.0, 1.0))
    assert branch.ending is Ending.CLOSED
    assert [point.special for point in branch.special_points] == [Kind.FOLD, Kind.FOLD]
    assert [point.value for point in branch.special_points] == pytest.approx([0.5, -0.5], abs=1e-9)
    assert all(within(point, np.sign(point.value) * 0.5) for point in branch.special_points)
    assert branch.points[-1].orbit[0] == pytest.approx(0.5, abs=1e-9)
    assert branch.points[-1].value == pytest.approx(0.0, abs=1e-9)
    angles = np.unwrap([np.arctan2(point.value, point.orbit[0]) for point in branch.points])
    assert angles[-1] - angles[0] == pytest.approx(2 * pi, abs=1e-8)


@pytest.mark.parametrize("narrow", [1e-2, 1e-4, 1e-6])
def test_a_pair_of_folds_close_to_each_other(narrow):
    """p = x^3 - narrow x, folds at x^2 = narrow / 3."""

    def family(p):
        return of_map(lambda x: x + 0.5 * (p + narrow * x - x**3), lambda x: 1 + 0.5 * (narrow - 3 * x**2))

    branch = follow(family, begin(family, -1.0, [-1.0]), (-1.0, 1.0))
    assert branch.ending is Ending.LEFT_INTERVAL
    x = sqrt(narrow / 3)
    folds = [2 * x**3, -2 * x**3]
    assert [point.special for point in branch.special_points] == [Kind.FOLD, Kind.FOLD]
    for point, value in zip(branch.special_points, folds, strict=True):
        assert abs(point.value - value) <= point.bifurcation.error_bound


@pytest.mark.parametrize("imperfection", [1e-3, 1e-6, 1e-9])
def test_an_imperfect_pitchfork_is_no_pitchfork(imperfection):
    def family(p):
        return of_map(lambda x: x + 0.5 * (p * x - x**3 + imperfection), lambda x: 1 + 0.5 * (p - 3 * x**2))

    branch = follow(family, begin(family, -0.5, [0.0]), (-0.5, 0.5))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert not branch.special_points
    assert branch.points[-1].orbit[0] == pytest.approx(sqrt(0.5), abs=1e-3)
    assert branch.points[-1].stable


@pytest.mark.parametrize("width", [0.03, 0.01])
def test_two_period_doublings_within_a_step(width):
    def family(p):
        m = -0.9 - 0.3 * exp(-(((p - 0.5) / width) ** 2))
        return of_map(lambda x: m * x - x**3, lambda x: m - 3 * x**2)

    branch = follow(family, begin(family, 0.0, [0.0]), (0.0, 1.0))
    off = width * sqrt(np.log(3.0))
    assert [point.special for point in branch.special_points] == [Kind.PERIOD_DOUBLING] * 2
    assert within(branch.special_points[0], 0.5 - off)
    assert within(branch.special_points[1], 0.5 + off)


def radial(constant, linear, omega=2.0):
    """r' = r (constant + linear r^2 - r^4), theta' = omega."""

    def squared(s, duration, steps=20, order=12):
        """(r^2)' = 2 r^2 (constant + linear r^2 - r^4) by Taylor series."""
        h = duration / steps
        for _ in range(steps):
            a, b, c = [s], [], []
            for k in range(order):
                b.append(sum(a[i] * a[k - i] for i in range(k + 1)))
                c.append(sum(a[i] * b[k - i] for i in range(k + 1)))
                a.append(2 * (constant * a[k] + linear * b[k] - c[k]) / (k + 1))
            s = sum(term * h**k for k, term in enumerate(a))
        return s

    def flow(x, t0, t1):
        before = float(x @ x)
        after = squared(before + 1e-20j, t1 - t0)
        grown, angle = sqrt(after.real / before), omega * (t1 - t0)
        turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
        rate = (after.imag / 1e-20 / before - after.real / before**2) / grown
        return grown * turn @ x, turn @ (grown * np.eye(2) + rate * np.outer(x, x))

    def velocity(x):
        square = x @ x
        return (constant + linear * square - square**2) * x + omega * np.array([-x[1], x[0]])

    return PeriodicSystem(2, None, flow, velocity=velocity, guess_period=2 * pi / omega)


def cycles(mu):
    """Orbits r^2 = (1 +- sqrt(1 + 4 mu)) / 2."""
    return radial(mu, 1.0)


def ring_of_cycles(mu, radius=0.5):
    """Orbits (r^2 - 1)^2 + mu^2 = radius^2."""
    return radial(radius**2 - mu**2 - 1.0, 2.0)


def test_an_isola_of_cycles_closes():
    branch = follow(ring_of_cycles, begin(ring_of_cycles, 0.0, [1.22, 0.0]), (-1.0, 1.0), closely=False)
    assert branch.ending is Ending.CLOSED
    assert [point.special for point in branch.special_points] == [Kind.FOLD, Kind.FOLD]
    assert [point.value for point in branch.special_points] == pytest.approx([0.5, -0.5], abs=1e-9)
    squares = np.array([point.orbit @ point.orbit for point in branch.points])
    angles = np.unwrap(np.arctan2([point.value for point in branch.points], squares - 1))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * pi, abs=1e-6)


@pytest.mark.parametrize("units", [[1.0, 1.0], [1e9, 1e9], [1e-9, 1e-9]])
def test_a_fold_of_cycles(units):
    family = rescaled(cycles, units)
    branch = follow(
        family, begin(family, 0.2, np.array([1.1, 0.0]) * units, rising=False), (-0.5, 0.3), points=25, closely=False
    )
    (fold,) = branch.special_points
    assert fold.special is Kind.FOLD
    assert abs(fold.value + 0.25) <= fold.bifurcation.error_bound < 1e-6
    for point in branch.points:
        square = float((point.orbit / units) @ (point.orbit / units))
        assert point.value == pytest.approx(square**2 - square, abs=1e-8)
        assert point.period == pytest.approx(pi, rel=1e-8)
        assert point.multipliers.shape == (1,)
        assert point.multipliers[0].real == pytest.approx(exp(pi * (2 * square - 4 * square**2)), rel=1e-6)
    turn = branch.points.index(fold)
    assert all(point.stable for point in branch.points[:turn])
    assert not any(point.stable for point in branch.points[turn + 1 :])


def moebius(mu):
    """An orbit round the unit circle whose neighbourhood turns by half while it goes round.

    Across it, in a frame that turns with it, u' = mu u - u^3 and v' = -v: the multipliers are -e^(2 pi mu) and
    -e^(-2 pi), and orbits u = +- sqrt(mu) of period 4 pi branch off at 0, with the multiplier e^(-8 pi mu).
    """

    def flow(x, t0, t1):
        columns = [_moebius_flow(mu, x + 1e-20j * direction, t1 - t0) for direction in np.eye(3)]
        return columns[0].real, np.array([column.imag / 1e-20 for column in columns]).T

    def velocity(x):
        return _moebius_flow(mu, np.asarray(x, dtype=complex), 1e-20j).imag / 1e-20

    return PeriodicSystem(3, None, flow, velocity=velocity, guess_period=6.2)


def _moebius_flow(mu, x, duration):
    start = np.arctan2(x[1].real, x[0].real)
    along, side = x[0] * cos(start) + x[1] * sin(start), x[1] * cos(start) - x[0] * sin(start)
    theta, y, z = start + np.arctan(side / along), np.sqrt(along**2 + side**2) - 1, x[2]
    u = y * np.cos(theta / 2) + z * np.sin(theta / 2)
    v = z * np.cos(theta / 2) - y * np.sin(theta / 2)
    grown = np.exp(2 * mu * duration)
    # u^2 / (mu - u^2) grows by e^(2 mu t), with the limit of mu -> 0
    share = np.expm1(2 * mu * duration) / mu if mu else 2 * duration
    u = u * np.sqrt(grown / (1 + u**2 * share))
    v = v * np.exp(-duration)
    theta = theta + duration
    y = u * np.cos(theta / 2) - v * np.sin(theta / 2)
    z = u * np.sin(theta / 2) + v * np.cos(theta / 2)
    return np.array([(1 + y) * np.cos(theta), (1 + y) * np.sin(theta), z])


def test_period_doubling_of_an_orbit_with_a_period_of_its_own():
    between = (-0.02, 0.05)
    branch = follow(moebius, begin(moebius, -0.02, [1.0, 0.0, 0.0]), between)
    (doubling,) = branch.special_points
    assert doubling.special is Kind.PERIOD_DOUBLING
    assert abs(doubling.value) <= doubling.bifurcation.error_bound < 1e-9
    assert doubling.bifurcation.criticality is Criticality.SUPERCRITICAL
    assert doubling.bifurcation.frequency == pytest.approx(0.5)
    doubled = follow(moebius, switch(moebius, doubling)[0], between, points=20)
    assert doubled.points[-1].value > 0.01
    for point in doubled.points[1:]:
        assert point.period == pytest.approx(4 * pi, rel=1e-9)
        assert point.multipliers[0].real == pytest.approx(exp(-8 * pi * point.value), rel=1e-6)
        assert point.stable


def square(mu):
    """x' = mu x - x^3 - x y^2 / 2 and the same of y: orbits y = 0 and x = y branch off at 0, mirrored four times."""

    def rhs(t, x):
        return [mu * x[0] - x[0] ** 3 - 0.5 * x[0] * x[1] ** 2, mu * x[1] - x[1] ** 3 - 0.5 * x[1] * x[0] ** 2]

    generators = np.array([[[0.0, 1.0], [1.0, 0.0]], [[-1.0, 0.0], [0.0, 1.0]]])
    return from_rhs(rhs, 2, 1.0, orbit=[0.0, 0.0], spatial_symmetry=generators)


def test_every_mode_of_a_symmetric_pitchfork_has_its_branch():
    (point,) = locate(square, (-0.4, 0.5))
    starts = switch(square, point)
    assert len(starts) == 4
    for start in starts:
        end = follow(square, start, (-0.4, 0.5), points=4, closely=False).points[-1]
        diagonal = abs(start.mode).min() > 0.5
        assert end.orbit == pytest.approx(
            np.sqrt(end.value / (1.5 if diagonal else 1.0)) * np.sign(start.mode), abs=1e-8
        )


def test_tori_and_folds_are_not_switched_at():
    branch = follow(ring, begin(ring, 0.0, [0.5]), (-1.0, 1.0))
    with pytest.raises(ParameterError, match="passes it along the same branch"):
        switch(ring, branch.special_points[0])
    with pytest.raises(ParameterError, match="must be a special point"):
        switch(ring, branch.points[0])
    with pytest.raises(ParameterError, match="switch"):
        follow(ring, branch.special_points[0].bifurcation, (-1.0, 1.0))


def test_a_state_that_is_no_orbit_is_refused():
    with pytest.raises(AnalysisError, match="no periodic orbit"):
        begin(lambda p: of_map(lambda x: x + 1.0 + 0.5 * np.sin(x), lambda x: 1 + 0.5 * np.cos(x)), 0.0, [0.3])


def test_a_branch_begins_at_a_fold():
    down, up = (follow(ring, begin(ring, 0.5, [0.0], rising), (-1.0, 1.0), points=5) for rising in (False, True))
    for branch in (down, up):
        for point in branch.points:
            assert np.hypot(point.orbit[0], point.value) == pytest.approx(0.5, abs=1e-7)
    assert down.points[-1].orbit[0] * up.points[-1].orbit[0] < 0.0


@pytest.mark.parametrize("between", [(1.0, 1.3), (0.64, 3.055)])
def test_a_pitchfork_right_beside_a_collision(between):
    """Almost without damping a pair meets on the real axis 8e-7 before one of the two passes +1, where neither is
    smooth. The pitchfork breaks a symmetry in time that the system does not declare."""
    c, f, w, phase = 0.3094316621687306, 7.543749370451843, 1.235929467663377, 1.4680845484394605

    def rhs(t, x, p):
        return [x[1], -0.001 * x[1] - c * x[0] ** 3 + f * p * np.cos(w * t + phase)]

    start = [0.2415764, -2.9058916]
    branch = follow(
        lambda p: from_rhs(rhs, 2, 2.0 * pi / w, args=(p,)),
        begin(lambda p: from_rhs(rhs, 2, 2.0 * pi / w, args=(p,)), 1.0, start),
        between,
        longest=0.19,
    )
    (point,) = branch.special_points
    assert point.special is Kind.PITCHFORK
    # By torture/own_orbits.py, which shares no code with chilopod: 1.011467363853523 +- 9.7e-10.
    assert point.value == pytest.approx(1.011467363853523, abs=9.7e-10)
    assert point.bifurcation.error_bound < 1e-9
    assert branch.ending is Ending.LEFT_INTERVAL
