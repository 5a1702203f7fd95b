"""What a search costs is bounded, also where every orbit is hard to find; exceptions of a user's functions cost what
they touch and no more."""

import math
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.deadline import Budget, SpentError
from chilopod.stability import (
    Ending,
    PeriodicSystem,
    exponents,
    find_orbit,
    follow,
    from_map,
    from_rhs,
    locate,
    locate_hopf,
    multipliers,
    sweep,
)
from chilopod.stability.branches.parts import find_fold
from chilopod.stability.unit_circle.crossings import SearchStatus
from helpers.systems import duffing, linear, lorenz

BUDGET = 150
FLOWS_PER_RETURN = 12  # of a system without a period: to the section, and Newton's method for when it is there
SHAPES = {
    "nowhere smooth": lambda k: sum(0.7**j * math.cos(math.pi * 7.0**j * k) for j in range(18)),
    "fast": lambda k: 5.0 * math.sin(300.0 * k),
    "ever faster": lambda k: 5.0 * math.sin(1.0 / (k - 0.53)),
}


def stuart_landau(amplitude, frequency, rate):
    """r' = r (a^2 - r^2), angle' = omega, z' = rate z, in the closed form of their flow."""

    def flow(x, t0, t1):
        t, (u, v, z) = t1 - t0, x
        grow = math.exp(2.0 * amplitude**2 * t)
        below = 1.0 + (u * u + v * v) * (grow - 1.0) / amplitude**2
        stretch = math.sqrt(grow / below)
        c, s = math.cos(frequency * t), math.sin(frequency * t)
        turn = np.array([[c, -s], [s, c]])
        bend = np.eye(2) - np.outer([u, v], [u, v]) * (grow - 1.0) / amplitude**2 / below
        derivative = np.zeros((3, 3))
        derivative[:2, :2] = stretch * turn @ bend
        derivative[2, 2] = math.exp(rate * t)
        return np.append(stretch * turn @ x[:2], z * derivative[2, 2]), derivative

    def velocity(x):
        pull = amplitude**2 - x[0] ** 2 - x[1] ** 2
        return np.array([pull * x[0] - frequency * x[1], pull * x[1] + frequency * x[0], rate * x[2]])

    return PeriodicSystem(3, None, flow, velocity=velocity, guess_period=2.0 * math.pi)


@pytest.mark.parametrize("knows", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_search_costs_no_more_than_its_budget(shape, knows):
    flows = 0

    def family(k):
        wild = SHAPES[shape](k)
        system = stuart_landau(1.0 + 0.02 * wild, 1.0 + 0.15 * wild, 0.2 * wild)

        def counted(x, t0, t1):
            nonlocal flows
            flows += 1
            return system.flow(x, t0, t1)

        return replace(system, flow=counted, orbit=[1.0, 0.0, 0.0] if knows else None)

    found = locate(family, (0.0, 1.0), None if knows else [1.0, 0.0, 0.0], normal_form=False, budget=BUDGET)
    assert found.status is SearchStatus.BUDGET
    # Twice the budget to follow, twice to search; the first orbit; and what was found.
    first = 500 + 3 * 30 * FLOWS_PER_RETURN
    points = len(found) + sum("could not be described" in remark for remark in found.remarks)
    described = points * 400 * FLOWS_PER_RETURN
    assert flows < 4 * BUDGET * FLOWS_PER_RETURN + first + described
    assert found.evaluations <= 3 * BUDGET


def test_a_larger_budget_finds_more():
    def family(k):
        return stuart_landau(1.0, 1.0 + 0.3 * math.sin(20.0 * k), math.sin(20.0 * k))

    *fewest, few, many = (
        locate(family, (0.01, 1.0), [1.0, 0.0, 0.0], False, budget) for budget in (1, 2, 20, 40, 3000)
    )
    for each in (*fewest, few):
        assert each.status is SearchStatus.BUDGET
        assert any("(`budget`) were spent" in remark for remark in each.remarks)
    assert len(few) < len(many) == 6
    np.testing.assert_allclose([point.value for point in many], np.pi / 20.0 * np.arange(1, 7), rtol=1e-9)


def line(p, raised=None, where=(0.25, 0.35)):
    """x' = p x, y' = -y; something else between two values of p."""
    if raised is not None and where[0] < p < where[1]:
        raise raised
    return from_rhs(lambda t, x: [p * x[0], -x[1]], 2, 1.0, orbit=[0.0, 0.0])


@pytest.mark.parametrize("raised", [ZeroDivisionError("by hand"), KeyError("gain"), TypeError("two\nlines")])
def test_exceptions_of_the_family(raised):
    """They are islands without an orbit: what lies outside is found, on both sides where the orbit is known."""
    found = locate(lambda p: line(p - 0.6, raised, (-0.25, -0.15)), (-1.0, 1.0))
    assert [point.value for point in found] == [pytest.approx(0.6, abs=1e-12)]
    assert found.status is SearchStatus.INCOMPLETE
    said = next(remark for remark in found.remarks if type(raised).__name__ in remark)
    assert "the family raised" in said
    assert "\n" not in said
    followed = locate(lambda p: line(p, raised, (0.2, 1.0)), (-1.0, 1.0), [0.0, 0.0])
    assert [point.value for point in followed] == [pytest.approx(0.0, abs=1e-12)]
    assert "cannot be followed beyond 0.199" in followed.remarks[0]
    branch = follow(lambda p: line(p, raised), [0.0, 0.0], (-1.0, 1.0), points=40)
    assert branch.ending is Ending.LOST
    assert type(raised).__name__ in branch.reason
    assert branch.special_points[0].value == pytest.approx(0.0, abs=1e-9)


def test_exceptions_at_the_first_value():
    def family(p):
        return line(p, KeyError("gain"), (-2.0, 2.0))

    for ask in (
        lambda: locate(family, (-1.0, 1.0)),
        lambda: locate(family, (-1.0, 1.0), [0.0, 0.0]),
        lambda: follow(family, [0.0, 0.0], (-1.0, 1.0)),
    ):
        with pytest.raises(AnalysisError, match=r"family = -1.0: raised KeyError: 'gain'") as caught:
            ask()
        assert isinstance(caught.value.__cause__, KeyError)


def test_exceptions_inside_a_flow():
    def family(p):
        def moves(t0, t1):
            if 0.35 < p < 0.45:
                raise LookupError("no table")
            return np.diag(np.exp(np.array([p - 0.6, -1.0]) * (t1 - t0)))

        return linear(moves, 2)

    found = locate(family, (-1.0, 1.0))
    assert [point.value for point in found] == [pytest.approx(0.6, abs=1e-12)]
    assert any("LookupError: no table at 0." in remark for remark in found.remarks)


def test_parameters_that_a_system_refuses():
    """A period that is no number from some value on."""

    def family(p):
        return from_rhs(lambda t, x: [p * x[0]], 1, 1.0 if p < 0.5 else math.nan, orbit=[0.0])

    found = locate(family, (-1.0, 1.0))
    assert [point.value for point in found] == [pytest.approx(0.0, abs=1e-12)]
    assert any("period = nan" in remark for remark in found.remarks)
    with pytest.raises(ParameterError, match="period = nan"):
        locate(lambda p: family(p + 2.0), (-1.0, 1.0))


def test_a_dimension_that_changes():
    def family(p):
        if p < 0.5:
            return line(p)
        return from_rhs(lambda t, x: -x, 3, 1.0, orbit=[0.0, 0.0, 0.0])

    for guess in (None, [0.0, 0.0]):
        found = locate(family, (-1.0, 1.0), guess)
        assert [point.value for point in found] == [pytest.approx(0.0, abs=1e-12)]
        assert found.status is SearchStatus.INCOMPLETE
        assert any("changes its dimension" in remark for remark in found.remarks)
    branch = follow(family, [0.0, 0.0], (-1.0, 1.0), points=40)
    assert branch.ending is Ending.LOST
    assert "changes its dimension" in branch.reason
    assert len(branch.points) > 10


def halfway(value):
    """A right-hand side that changes its mind within the period."""

    def rhs(t, x):
        return value if t > 0.5 else -x

    return rhs


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("no", "an array of real numbers, not 'no'"),
        (None, "an array of real numbers, not None"),
        ([1.0, [2.0]], r"an array of real numbers, not \[1.0, \[2.0\]\]"),
        ({"x": 1.0}, "an array of real numbers, not {'x': 1.0}"),
        ([1.0], r"returns an array of shape \(1,\); allowed: an array of shape \(2,\)"),
        ([1.0, 2.0j], "an array of real numbers, not complex ones"),
        (3.0, r"returns an array of shape \(\); allowed: an array of shape \(2,\)"),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_is_no_array_of_numbers(value, said):
    for rhs in (lambda t, x: value, halfway(value)):
        with pytest.raises(ParameterError, match=said) as caught:
            from_rhs(rhs, 2, 1.0, orbit=[0.0, 0.0]).flow(np.zeros(2), 0.0, 1.0)
        assert "rhs" in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("rhs", "method"),
    [
        (lambda t, x: [x[1], -x[0]], "taylor"),
        (lambda t, x: [x[1], -x[0]], "implicit"),
        (lambda t, x: [x[1], -x[0] if t > -9.0 else 0.0], "automatic"),  # cannot be traced
    ],
)
def test_a_flow_ends_with_the_time_of_the_search_that_asked_for_it(rhs, method):
    system = from_rhs(rhs, 2, 2.0 * math.pi, method=method)
    start = np.array([1.0, 0.0])
    after = system.flow(start, 0.0, 1.0)[0]  # what has to be compiled is compiled
    with Budget(10, seconds=0.02), pytest.raises(SpentError, match=r"^seconds: the time limit is reached$"):
        system.flow(start, 0.0, 1e5)
    assert np.array_equal(system.flow(start, 0.0, 1.0)[0], after)  # and no longer than that


def test_many_states_at_once_and_inner_searches_with_longer_limits_or_none_end_with_the_time_too():
    system = from_rhs(lambda t, x: [x[1], -x[0]], 2, 2.0 * math.pi, method="taylor")
    states = np.ones((64, 2))
    system.flow_states(states, 0.0, 1.0)
    with Budget(10, seconds=0.02), pytest.raises(SpentError):
        system.flow_states(states, 0.0, 1e5)
    for inner in (Budget(10), Budget(10, seconds=60.0)):
        with Budget(10, seconds=0.02), inner, pytest.raises(SpentError):
            system.flow(np.array([1.0, 0.0]), 0.0, 1e5)


def test_the_first_orbit_is_within_the_time():
    family = partial(duffing, symmetry=-np.eye(2))
    for search in (
        lambda: locate(family, (2.3, 2.5), orbit=[1.88, 0.64], seconds=0.0),
        lambda: follow(family, [1.88, 0.64], (2.3, 2.5), seconds=0.0),
    ):
        with pytest.raises(SpentError, match="the time limit is reached"):
            search()


@pytest.mark.parametrize("guess", [[1e8, 1e8, 1e8], [1e8, 0.0, 0.0]])
def test_a_hopeless_guess_is_refused_after_one_flow(guess):
    with pytest.raises(AnalysisError, match=r"^orbit: the motion from the guess takes too many steps"):
        multipliers(lorenz(24.0, 0.6), guess)


def test_time_limits_reach_flows_of_the_user_and_settling():
    """Without a limit this search would take hundreds of flows."""
    asked = []

    def flow(x, t0, t1):
        asked.append(t0)
        time.sleep(0.01)
        return x + 1.0 + np.sin(37.0 * x), np.eye(1)

    system, known = (PeriodicSystem(1, 1.0, flow, scale=[1.0], orbit=orbit) for orbit in (None, [0.5]))
    for search in (multipliers, exponents, find_orbit, lambda _, orbit, seconds: sweep([known] * 3, seconds=seconds)):
        asked.clear()
        with pytest.raises(SpentError, match="the time limit is reached"):
            search(system, [0.5], seconds=0.05)
        assert len(asked) < 20


@pytest.mark.parametrize("budget", [160, 200])
def test_an_orbit_that_is_traced_through_a_steep_place_stays_within_the_budget(budget):
    """Twice as many return maps follow the orbit x^3 + x / 1000 = p, and again serve the search."""
    calls = []

    def family(p):
        def image(x):
            calls.append(p)
            return [x[0] - 0.5 * (x[0] ** 3 + 1e-3 * x[0] - p)], [[1.0 - 0.5 * (3.0 * x[0] ** 2 + 1e-3)]]

        return from_map(image, 1)

    found = locate(family, (-1.0, 1.3), orbit=[-0.9997], budget=budget)
    assert found.status is SearchStatus.BUDGET
    assert found.evaluations < budget
    assert len(calls) < 4 * budget


def test_a_search_for_a_fold_ends_with_its_budget():
    """x' = p - x^2 as a map: the fold is at 0."""

    def family(p):
        return from_map(lambda x: (x + p - x**2, np.array([[1.0 - 2.0 * x[0]]])), 1)

    budget = Budget(1000)
    assert find_fold(family, 0.04, np.array([0.2]), 1.0, False, budget).value == pytest.approx(0.0, abs=1e-9)
    assert 0 < budget.left < 1000
    spent = Budget(20)
    assert find_fold(family, 0.04, np.array([0.2]), 1.0, False, spent) is None
    assert spent.left == 0


def raising(*arguments):
    raise ValueError("no table")


@pytest.mark.parametrize(
    ("system", "name"),
    [
        (lambda: from_rhs(raising, 2, 1.0), "rhs"),
        (lambda: from_rhs(lambda t, x: raising() if x[0] > 1.0 else [-x[0], -x[1]], 2, 1.0), "rhs"),
        (lambda: PeriodicSystem(2, 1.0, raising), "flow"),
        (lambda: from_map(raising, 2), "image"),
    ],
)
@pytest.mark.parametrize("ask", [multipliers, exponents, find_orbit])
def test_exceptions_of_a_system_name_its_function(system, name, ask):
    with pytest.raises(AnalysisError, match=f"^{name}: raised ValueError: no table$") as caught:
        ask(system(), [2.0, 0.0])
    assert isinstance(caught.value.__cause__, ValueError)


def test_the_time_of_a_search_for_hopf_points_includes_its_first_system():
    """Thousands of calls examine a function that cannot be traced."""
    calls = []

    def slow(t, x, p):
        calls.append(t)
        time.sleep(1e-3)
        return [p * x[0] - x[1] - (x[0] ** 3 if x[0] < 1e9 else 0.0), x[0]]

    def family(p):
        return from_rhs(slow, 2, None, args=(p,), guess_period=6.0)

    with pytest.raises(SpentError):
        locate_hopf(family, (-1.0, 1.0), [0.0, 0.0], seconds=0.3)
    assert len(calls) <= 320


def test_a_period_of_an_orbit_must_be_guessed():
    with pytest.raises(ParameterError, match="guess_period: must be given where the period is None"):
        from_rhs(lambda t, x: -x, 2, None)
