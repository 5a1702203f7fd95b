"""Maps as periodic systems, against what is known of them."""

import functools
import math

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import (
    Kind,
    PeriodicSystem,
    begin,
    find_orbit,
    follow,
    from_map,
    from_rhs,
    locate,
    multipliers,
    sweep,
    switch,
    switch2,
)


def logistic(r):
    return from_map(lambda x: ([r * x[0] * (1.0 - x[0])], [[r * (1.0 - 2.0 * x[0])]]), 1)


def test_images_are_taken_at_whole_times():
    system = logistic(3.2)
    x = np.array([0.3])
    for t0, t1, times in ((0.0, 0.5, 1), (0.5, 1.0, 0), (0.0, 2.0, 2), (1.0, 1.0, 0), (2.5, 6.0, 3)):
        right = x
        for _ in range(times):
            right = 3.2 * right * (1.0 - right)
        assert np.array_equal(system.flow(x, t0, t1)[0], right)


def test_the_derivative_is_within_its_bound():
    """In exact arithmetic, of a map that magnifies."""
    from fractions import Fraction

    system, x, steps = logistic(3.9), np.array([0.37]), 12
    _, derivative, bound = system.flow_with_error(x, 0.0, float(steps))
    exact, slope = Fraction(0.37), Fraction(1)
    for _ in range(steps):
        slope *= Fraction(3.9) * (1 - 2 * exact)
        exact = Fraction(3.9) * exact * (1 - exact)
    assert abs(derivative[0, 0] - float(slope)) <= bound[0, 0] < 1e-9 * abs(float(slope))


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: from_map(3, 1), r"image = 3: must be a function"),
        (lambda: from_map(lambda x: x, 0), r"dimension = 0: must be a whole number"),
        (lambda: multipliers(logistic(3.2), [0.5], leading=2), r"leading = 2: is too large; allowed: 1$"),
        (lambda: multipliers(from_map(lambda x: x, 1), [0.5]), r"image = 'ndarray': must return a pair"),
        (lambda: multipliers(from_map(lambda x: (x, x), 1), [0.5]), r"image: returns an array of shape \(1,\)"),
        (lambda: switch(logistic, 3), r"point = 3: must be a located point"),
        (lambda: find_orbit(None, [1.0]), r"system: must be a system"),
        (lambda: switch2(None, 3, ((0.0, 1.0), (0.0, 1.0))), r"point = 3: must be a point of codimension two"),
        *(
            (lambda s=s: locate(logistic, (2.5, 3.2), [0.6], seconds=s), r"seconds.*: must be a number of seconds")
            for s in (-1.0, math.nan, "3", True)
        ),
        *(
            (lambda b=b: locate(logistic, (2.5, 3.2), [0.6], budget=b), r"budget.*: must be a whole number")
            for b in (-1, 0, 2.5, "x", None, math.inf, [])
        ),
        (lambda: begin(logistic, 2.5, [0.6], periods=4), r"periods = 4: are more than the orbit has; allowed: 1"),
        *(
            (lambda k=k: begin(logistic, 2.5, [0.6], periods=k), r"periods.*: must be a whole number; allowed: 1 ")
            for k in (0, -1, 1.5, True)
        ),
        *(
            (lambda o=o: follow(logistic, [0.6], (2.5, 3.2), **o), f"{next(iter(o))}.*: must be {said}")
            for o, said in (
                ({"budget": -1}, "a whole number"),
                *(({"points": points}, "a whole number; allowed: 1 ") for points in (0, 2.5, "all", True)),
                ({"progress": 3}, "a function"),
                ({"precision": 0}, "positive"),
                ({"step": "1"}, "a number"),
                ({"longest": None}, "a number|finite"),
                ({"closely": 1}, "a truth value"),
            )
        ),
        (lambda: locate(logistic(2.5), (2.5, 3.2), [0.6]), r"family = .*: must be a function"),
        (lambda: locate(lambda p: 3, (2.5, 3.2), [0.6]), r"family = 2.5: must return a system, not int"),
        (lambda: follow(logistic, [0.6], {1.0, 2.0}), r"between = .*: must be numbers"),
        (lambda: multipliers(logistic(2.5), [[0.6], [0.7, 0.8]]), r"orbit = .*: must be numbers"),
        (lambda: multipliers(logistic(2.5), [10**400]), r"orbit = .*: must be numbers"),
        (lambda: PeriodicSystem(1, "1", lambda x, t0, t1: x), r"period = '1': must be a number"),
        (lambda: PeriodicSystem(1, 0.0, lambda x, t0, t1: x), r"period = 0.0: must be positive"),
        (lambda: multipliers(PeriodicSystem(1, 1.0, lambda x, t0, t1: None), [0.5]), r"flow = 'NoneType': must return"),
        (lambda: sweep(3), r"systems = 3: must be a list"),
        (
            lambda: from_rhs(lambda t, x: [x[1], -x[0] + np.cos(1.3 * t)], 2, 2 * math.pi),
            r"period = 6.28.*: must be a period of the right-hand side",
        ),
    ],
)
def test_what_is_none_is_refused_in_one_line(build, said):
    with pytest.raises(ParameterError, match=said) as refused:
        build()
    assert "\n" not in str(refused.value)


def test_progress_of_another_signature_is_one_line():
    with pytest.raises(AnalysisError, match=r"^progress: raised TypeError: .* takes 1 positional argument"):
        follow(logistic, [0.6], (2.5, 3.2), points=1, progress=lambda count: None)


@pytest.mark.parametrize(
    "family",
    [
        lambda p: from_rhs(lambda t, x: [-((p - 0.5) ** 2) * x[0] - x[0] ** 3], 1, 2.0 * math.pi, orbit=[0.0]),
        lambda p: from_map(
            lambda x: ([-(1.0 - (p - 0.5) ** 2) * x[0] + x[0] ** 3], [[-(1.0 - (p - 0.5) ** 2) + 3.0 * x[0] ** 2]]),
            1,
            orbit=[0.0],
        ),
    ],
)
def test_a_multiplier_that_only_touches_the_circle_is_a_remark(family):
    found = locate(family, (0.0, 1.2))
    assert len(found) == 0
    assert found.complete
    (remark,) = found.remarks
    assert "only touches the unit circle, within its error" in remark  # two crossings may hide there
    assert float(remark.split()[1]) == pytest.approx(0.5, abs=1e-5)


def test_a_wrong_derivative_is_refused_in_one_line():
    calls = []

    def henon(x, entry=0.3):
        calls.append(1)
        return [1.0 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]], [[-2.8 * x[0], 1.0], [entry, 0.0]]

    with pytest.raises(ParameterError, match=r"entry \(1, 0\) is 0.4, but a difference gives 0.3"):
        multipliers(from_map(lambda x: henon(x, 0.4), 2), [0.6, 0.2])
    multipliers(from_map(functools.partial(lambda entry, x: henon(x, entry), 0.3), 2), [0.6, 0.2])
    with pytest.raises(ParameterError, match=r"entry \(1, 0\) is 0.5, but a difference gives 0.3"):
        multipliers(from_map(functools.partial(lambda x, entry: henon(x, entry), entry=0.5), 2), [0.6, 0.2])
    for times in (1, 2):  # refused again at the second call
        with pytest.raises(ParameterError, match=r"flow = .*: derivative entry \(0, 0\) is 0.4, but .* gives 0.367879"):
            multipliers(PeriodicSystem(1, 1.0, lambda x, t0, t1: (x * np.exp(t0 - t1), np.diag([0.4]))), [times])
    system = from_map(henon, 2)
    calls.clear()
    assert system.flow(np.zeros(2), 0.0, 1.0)[1][0, 1] == 1.0
    assert len(calls) == 3  # two for the check


def _henon(slope, wrong_from=0.0):
    """Henon maps over their first parameter, whose derivative has a factor ``slope`` from a value on."""

    def family(a):
        factor = slope if a >= wrong_from else 2.0
        start = 0.5 * (math.sqrt(0.49 + 4.0 * a) - 0.7) / a
        return from_map(
            lambda x: ([1.0 - a * x[0] ** 2 + x[1], 0.3 * x[0]], [[-factor * a * x[0], 1.0], [0.3, 0.0]]),
            2,
            orbit=[start, 0.3 * start],
        )

    return family


def test_a_wrong_derivative_is_refused_whatever_came_before():
    """The check has no memory between calls: maps of one family share their code."""
    right, wrong = _henon(2.0), _henon(1.7)
    (point,) = locate(right, (0.1, 0.8))
    assert point.value == pytest.approx(0.3675, abs=1e-12)
    refused = r"^image = .*: derivative entry \(0, 0\) is .*, but a difference gives"
    with pytest.raises(ParameterError, match=refused):
        locate(wrong, (0.1, 0.8))
    with pytest.raises(ParameterError, match=refused):
        multipliers(wrong(0.2))
    with pytest.raises(ParameterError, match=r"^systems\[2\]\.image = "):  # each of several systems
        sweep([right(0.2), right(0.3), wrong(0.2)])
    branch = follow(_henon(1.7, wrong_from=0.25), None, (0.1, 0.8))  # at every point
    assert branch.points[-1].value == pytest.approx(0.25, abs=1e-3)
    assert "derivative entry (0, 0)" in branch.reason


@pytest.mark.parametrize(
    "image",
    [
        lambda x: ([1.0 - 2.0 * abs(x[0] - 0.5)], [[-2.0]]),  # a kink at the first point
        lambda x: ([np.sqrt(x[0] - 0.5)], [[1.0 / np.sqrt(max(x[0] - 0.5, 1e-300))]]),  # an edge of its domain
        lambda x: ([1e-30 * x[0]], [[1e-30]]),
        lambda x: ([0.5 + 1e-7 * np.sin(1e7 * x[0])], [[np.cos(1e7 * x[0])]]),  # curved within a step
        lambda x: ([0.3 * x[0] + 1e-8 * np.sin(1e12 * x[0])], [[0.3]]),  # with noise
    ],
)
def test_a_right_derivative_passes_the_check(image):
    from_map(image, 1).flow(np.array([0.5]), 0.0, 1.0)


@pytest.mark.parametrize("power", [2, 3, 5])
def test_curvature_contradicts_no_derivative_that_is_zero(power):
    """A difference of the odd powers is the step's."""

    def family(p, wrong=0.0):
        return from_map(lambda x: ([-p * x[0] - x[0] ** power], [[wrong - p - power * x[0] ** (power - 1)]]), 1)

    (point,) = locate(family, (0.0, 1.5), orbit=[0.0])
    assert point.kind is Kind.PERIOD_DOUBLING
    assert abs(point.value - 1.0) <= point.error_bound
    with pytest.raises(ParameterError, match=r"entry \(0, 0\) is 0.001, but .*; allowed: d state"):
        multipliers(family(0.0, 1e-3), [0.0])


def test_states_too_small_for_a_difference_need_their_scale():
    def family(p, scale=None, wrong=0.0):
        return from_map(
            lambda x: ([-p * x[0] + 1e24 * x[0] ** 3], [[wrong - p + 3e24 * x[0] ** 2]]), 1, orbit=[0.0], scale=scale
        )

    with pytest.raises(
        ParameterError, match=r"entry \(0, 0\) is -0.5, but .*; allowed: a smaller `scale` of the states"
    ):
        multipliers(family(0.5))
    assert multipliers(family(0.5, [1e-12])).values.tolist() == [-0.5]
    with pytest.raises(ParameterError, match=r"entry \(0, 0\) is -0.4, but a difference gives -0.5"):
        multipliers(family(0.5, [1e-12], 0.1))


@pytest.mark.parametrize(("quadratic", "kind"), [(0.0, Kind.PITCHFORK), (1e-8, Kind.TRANSCRITICAL)])
def test_a_quadratic_term_that_a_symmetry_allows_need_not_be_there(quadratic, kind):
    """z -> (1 + p) z - z |z|^2 + 0.2 conj(z)^5 + quadratic conj(z)^2, with the symmetries of a triangle."""
    turn = complex(-0.5, math.sqrt(0.75))

    def family(p):
        def image(x):
            z, other = complex(*x), complex(x[0], -x[1])
            along, across = 1.0 + p - 2.0 * z * other, -z * z + other**4 + 2.0 * quadratic * other
            rows = along + across, 1j * (along - across)
            moved = (1.0 + p - z * other) * z + 0.2 * other**5 + quadratic * other**2
            return [moved.real, moved.imag], [[each.real for each in rows], [each.imag for each in rows]]

        generators = [[[turn.real, -turn.imag], [turn.imag, turn.real]], [[1.0, 0.0], [0.0, -1.0]]]
        return from_map(image, 2, orbit=[0.0, 0.0], spatial_symmetry=generators)

    (point,) = locate(family, (-0.3, 0.2))
    assert (point.kind, point.multiplicity) == (kind, 2)
    assert len(switch(family, point)) == 2


@pytest.mark.parametrize("copies", [1, 2])
def test_values_kept_as_memory_hide_no_crossing(copies):
    """Zero multipliers of one chain have no left eigenvectors; that of -1 at a = 3/4 does not depend on them."""
    memory = 4

    def family(a):
        def image(x):
            newest = x[:copies]
            derivative = np.eye(copies * memory, k=-copies)
            derivative[range(copies), range(copies)] = -2.0 * a * newest
            return np.concatenate([1.0 - a * newest**2, x[:-copies]]), derivative

        return from_map(image, copies * memory)

    x = np.full(copies * memory, 0.85)
    (found,) = locate(family, (0.2, 1.0), orbit=x)
    assert (found.kind, found.multiplicity) == (Kind.PERIOD_DOUBLING, copies)
    assert abs(found.value - 0.75) <= found.error_bound < 1e-12
    (special,) = follow(family, begin(family, 0.2, x), (0.2, 1.0)).special_points
    assert abs(special.value - 0.75) < 1e-12
