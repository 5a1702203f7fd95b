"""How branches end, and what is refused: no family, however hostile, ends in anything but an ending or one line."""

from dataclasses import replace

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ChilopodError, ParameterError
from chilopod.stability import (
    Ending,
    Event,
    Kind,
    PeriodicSystem,
    begin,
    find_orbit,
    follow,
    from_map,
    from_rhs,
    locate,
)
from chilopod.stability.returns import jumps_at_ends
from chilopod.stability.search.samples import Samples


def of_map(function, dimension, size=1.0):
    """A system with a period of 1 whose return map is a function, its derivative by differences."""
    step = 1e-6 * size

    def flow(x, t0, t1):
        if t1 - t0 < 0.5:
            return x, np.eye(dimension)
        with np.errstate(all="ignore"):
            columns = [function(x + step * e) - function(x - step * e) for e in np.eye(dimension)]
            return function(x), np.array(columns).T / (2 * step)

    return PeriodicSystem(dimension, 1.0, flow)


def linear(p):
    return of_map(lambda x: 0.5 * x + p, 1)


def circle(p):
    return of_map(lambda x: x + 0.3 * (0.25 - x**2 - p**2), 1)


@pytest.mark.parametrize("border", [0.0, 0.1234])
def test_a_jump_is_named_where_the_multipliers_jump(border):
    """A border collision, which is a kink of the branch: no cubic through the ends of a step shows its place."""

    def family(p):
        def flow(x, t0, t1):
            slope = 1.0 if t1 - t0 < 0.5 else 0.549 if x[0] < 0.0 else -1.369
            return slope * x + (p - border) * (t1 - t0 > 0.5), np.array([[slope]])

        return PeriodicSystem(1, 1.0, flow)

    branch = follow(family, [-1.1276 / 0.451], (border - 1.1276, border + 0.7144))
    (said,) = branch.remarks
    told = said.split("a multiplier jumps across the circle at ")[1].replace(",", "").split()
    places = [float(told[i]) for i in (0, 2, 4)]
    assert places == pytest.approx([border] * 3, abs=1e-9)
    assert not branch.special_points


def hostile(kind, random):
    """A family with something wrong, the size of its states, and the unit of its parameter."""
    c = random.normal(size=3)
    narrow, size = 10 ** random.uniform(-3, -1), 10 ** random.uniform(-9, 9)
    unit = 10.0 ** random.choice([-290, -9, 9, 290])
    dimension = int(random.integers(1, 3))
    p_unit = unit if kind == "huge" else 1.0

    def image(y, p):
        if kind == "nan":
            return np.nan if abs(p - 0.4) < narrow else 0.4 * y + p
        if kind == "jump":
            return 0.5 * y + (p > 0.3) * c[0]
        if kind == "kink":
            return 0.5 * y + 0.3 * abs(y - p)
        if kind == "ripple":
            return 0.5 * y + 0.1 * np.sin(p / narrow)
        if kind == "vanishing":
            return y + 0.3 * (0.1 * c[0] - p - y * y)
        if kind == "raising":
            if p > 0.5:
                raise ValueError("no such thing")
            return 0.3 * y + p * p
        if kind == "rough":
            return 0.5 * y + sum(0.5**j * np.cos(np.pi * 3**j * p) for j in range(12))
        return 0.5 * y + p + 0.1 * y * y / (1 + y * y)

    def family(value):
        def function(x):
            y = x / size
            return size * np.array([image(y[0], value / p_unit), 0.3 * y[-1] + 0.1 * y[0]])[:dimension]

        return of_map(function, dimension, size)

    return family, size * np.full(dimension, 0.3), p_unit


KINDS = ("nan", "jump", "kink", "ripple", "vanishing", "raising", "rough", "huge")


@pytest.mark.parametrize("kind", KINDS)
def test_hostile_families_end(kind):
    random = np.random.default_rng(KINDS.index(kind))
    for _ in range(3):
        family, guess, unit = hostile(kind, random)
        try:
            start = begin(family, 0.05 * unit, guess)
            branch = follow(family, start, (-0.3 * unit, unit), points=25, budget=4000)
        except ChilopodError:
            continue
        assert branch.points
        assert all(-0.3 * unit <= point.value <= unit for point in branch.points)
        assert (branch.ending is Ending.LOST) == bool(branch.reason)
        if kind == "huge":
            assert branch.ending is Ending.LEFT_INTERVAL


def test_the_last_point_is_on_the_end_of_the_interval():
    asked = []

    def family(p):
        asked.append(p)
        return linear(p)

    for rising, end in ((True, 0.7), (False, -0.3)):
        branch = follow(family, begin(family, 0.1, [0.2], rising), (-0.3, 0.7))
        assert branch.ending is Ending.LEFT_INTERVAL
        assert branch.points[-1].value == end
        assert branch.points[-1].orbit[0] == pytest.approx(2 * end, abs=1e-12)
    assert -0.3 <= min(asked) <= max(asked) <= 0.7


@pytest.mark.parametrize(("start", "end", "rising"), [(0.7, 0.0, True), (0.0, 0.7, False)])
def test_a_branch_from_an_end_of_its_interval_goes_inward(start, end, rising):
    branch = follow(linear, begin(linear, start, [2.0 * start], rising), (0.0, 0.7))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert branch.points[-1].value == end


def test_a_budget_ends_a_branch_and_keeps_what_was_found():
    branch = follow(circle, begin(circle, 0.0, [0.5]), (-1.0, 1.0), budget=150)
    assert branch.ending is Ending.BUDGET
    assert len(branch.points) > 2
    on = follow(circle, branch, (-1.0, 1.0))
    assert on.ending is Ending.CLOSED
    assert max(point.error_bound for point in on.points) < 1e-8  # the last one's, too


def test_a_branch_that_goes_on_closes_where_a_single_run_does():
    """Also within two steps."""
    start = begin(circle, 0.0, [0.5])
    whole = follow(circle, start, (-1.0, 1.0))
    steps = sum(point.special is None for point in whole.points[1:])
    piece = follow(circle, start, (-1.0, 1.0), points=steps - 1)
    on = follow(circle, piece, (-1.0, 1.0), points=steps)
    assert (piece.ending, on.ending) == (Ending.ENOUGH_POINTS, Ending.CLOSED)
    assert [point.value for point in on.points] == [point.value for point in whole.points]


def test_a_guess_and_an_orbit_start_a_branch():
    by_guess = follow(linear, [0.1], (0.0, 1.0))
    by_orbit = follow(linear, find_orbit(linear(0.0), [0.1]), (0.0, 1.0))
    assert by_guess.points[0].orbit == pytest.approx([0.0], abs=1e-12)
    assert by_guess.points[-1].value == by_orbit.points[-1].value == 1.0


def test_a_branch_goes_on_from_any_of_its_points():
    branch = follow(circle, begin(circle, 0.0, [0.5]), (-1.0, 1.0))
    on = follow(circle, branch.points[3], (-2.0, 2.0), points=30)
    assert on.scale == 4.0
    assert on.special_points[0].special is Kind.FOLD
    assert on.points[1].value > branch.points[3].value


def test_what_cannot_be_is_one_line():
    with pytest.raises(ParameterError, match="too narrow"):
        follow(linear, [0.1], (1.0, 1.0 + 1e-12))
    with pytest.raises(ParameterError, match="between"):
        follow(linear, [0.1], (-1e308, 1e308))
    with pytest.raises(ParameterError, match="must contain the start"):
        follow(linear, begin(linear, 2.0, [0.1]), (0.0, 1.0))
    for refused in (begin(linear, 2.0, [0.1]), [0.1]):
        with pytest.raises(ParameterError, match=r"symmetric = True: must be False for systems without a symmetry"):
            follow(linear, refused, (2.0, 3.0), symmetric=True)
    pitchfork = {p: of_map(lambda x, p=p: (1 + p) * x - x**3, 1) for p in (0.0,)}
    with pytest.raises(AnalysisError, match="branches meet here"):
        follow(lambda p: of_map(lambda x: (1 + p) * x - x**3, 1), begin(pitchfork.get, 0.0, [0.0]), (-1.0, 1.0))


def test_an_event_that_passes_time_0_is_named():
    """A ball on a table whose phase is the parameter: the impact moves through the end of the period."""
    e, g, w, a = 0.5, 9.81, 60.0, 0.0036
    table = Event(
        lambda t, x, p: x[0] - a * np.sin(w * t + p),
        lambda t, x, p: [x[0], -e * x[1] + (1 + e) * a * w * np.cos(w * t + p)],
        -1,
    )

    def family(p):
        return from_rhs(lambda t, x, p: [x[1], -g], 2, 2 * np.pi / w, args=(p,), events=[table])

    branch = follow(family, begin(family, 2.0, [0.0138, 0.331]), (2.0, 7.5))
    assert branch.ending is Ending.LOST
    assert branch.reason.startswith("an event passes time 0 of the orbit")
    found = locate(family, (2.0, 7.5), orbit=[0.0138, 0.331])
    assert found.searched[1] == pytest.approx(branch.points[-1].value, abs=1e-3)
    assert found.ending.startswith("the orbit cannot be followed beyond 6.9")
    assert found.ending.endswith(branch.reason)


def test_a_grazing_is_named():
    """The linear motion has the amplitude force / |3 + 0.2 i|, and meets a wall at 1."""
    wall = Event(lambda t, x: x[0] - 1.0, lambda t, x: [x[0], -0.8 * x[1]], 1)

    def family(force):
        return from_rhs(
            lambda t, x: [x[1], -0.2 * x[1] - 4.0 * x[0] + force * np.cos(t + 1.0)], 2, 2.0 * np.pi, events=[wall]
        )

    branch = follow(family, [0.1, 0.1], (2.0, 5.0))
    assert branch.ending is Ending.LOST
    assert branch.reason.startswith("just ahead the orbit grazes an event")
    assert branch.points[-1].value == pytest.approx(abs(3.0 + 0.2j), abs=1e-4)


def test_time_0_of_an_autonomous_orbit_is_moved_away_from_an_event():
    """The wall of an oscillator reaches the state in which the branch began."""
    wall = Event(lambda t, x, w: x[0] - w, lambda t, x, w: [x[0], -0.9 * x[1]], 1)

    def family(w):
        return from_rhs(
            lambda t, x, w: [x[1], (1 - x[0] ** 2) * x[1] - x[0]], 2, None, args=(w,), events=[wall], guess_period=5.5
        )

    branch = follow(family, begin(family, 1.2, [0.9, 1.6], rising=False), (0.6, 1.2))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert any("time 0 was moved along the orbit, away from an event" in remark for remark in branch.remarks)
    again = find_orbit(family(0.6), branch.points[-1].orbit)
    assert again.period == pytest.approx(branch.points[-1].period, rel=1e-9)


def test_time_0_is_moved_also_where_it_comes_to_lie_just_after_an_event():
    """A resonate-and-fire neuron: its reset comes to lie within rounding of the end of a return."""
    fires = Event(lambda t, x, i: x[1] - 1.0, lambda t, x, i: [0.3 * x[0], -0.6], 1)

    def family(i):
        def rhs(t, x, i):
            return [-0.1 * x[0] - x[1] + i, x[0] - 0.1 * x[1]]

        return from_rhs(rhs, 2, None, args=(i,), events=[fires], guess_period=0.82)

    branch = follow(family, [0.8576316, -0.59838556], (2.71, 2.8))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert any("time 0 was moved along the orbit, away from an event" in remark for remark in branch.remarks)


@pytest.mark.parametrize("guessed", [1.580038384587912, 2.0])
def test_a_branch_begins_at_an_impact(guessed):
    """A leaky neuron with adaptation, just after it fires: the orbit begins further along the motion."""
    fires = Event(lambda t, x, i: x[0] - 1.0, lambda t, x, i: [0.0, x[1] + 0.2], 1)

    def family(i):
        return from_rhs(
            lambda t, x, i: [i - x[0] - x[1], -0.1 * x[1]], 2, None, args=(i,), events=[fires], guess_period=guessed
        )

    start = begin(family, 2.5, [0.0, 1.3684243358403948])
    assert start.orbit[0] > 0.1
    branch = follow(family, start, (2.5, 2.6))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert branch.remarks == ()


def chattering(current, kick):
    """Izhikevich's neuron, which fires several times in a row."""
    fires = Event(lambda t, x, i, d: x[0] - 30.0, lambda t, x, i, d: [-50.0, x[1] + d], 1)

    def rhs(t, x, i, d):
        return [0.04 * x[0] ** 2 + 5.0 * x[0] + 140.0 - x[1] + i, 0.02 * (0.2 * x[0] - x[1])]

    return from_rhs(rhs, 2, None, args=(current, kick), events=[fires], guess_period=66.4)


@pytest.mark.parametrize("high", [0.72, 1.5])
def test_a_step_does_not_land_on_an_orbit_of_another_period(high):
    """Five spikes up to a fold at 0.712744; orbits with four have nearly the same states between their rows."""

    def family(s):
        return chattering(10.0 - s, 2.0)

    branch = follow(family, begin(family, 0.7101, [-69.1237, -5.5106]), (0.0, high), points=1)
    assert branch.points[-1].value < 0.71275
    assert branch.points[-1].period > branch.points[0].period > 66.0


def test_a_search_does_not_go_on_along_an_orbit_of_another_period():
    """The orbit ends in a fold at 2.056806395."""
    samples = Samples(lambda d: chattering(10.0, d), [-60.0, -0.2], 2.056, 2.058, 1000, np.inf)
    assert 2.0568 < samples.end < 2.056806395


def test_the_end_of_a_map_is_no_event():
    """Images are taken at whole times, and so at time 0."""

    def family(p):
        root = np.sqrt(0.3 - p)  # no such map beyond
        return from_map(lambda x: ([0.5 * x[0] + root], [[0.5]]), 1)

    with np.errstate(invalid="raise"):
        branch = follow(family, begin(family, 0.1, [0.5]), (0.1, 0.5))
    assert branch.ending is Ending.LOST
    assert "event" not in branch.reason


def test_a_map_over_two_periods_ends_without_an_event():
    """It is applied in the middle of them."""

    def family(p):
        r = 3.3 + np.sqrt(0.3 - p)  # no such map beyond
        return from_map(lambda x: ([r * x[0] * (1.0 - x[0])], [[r - 2.0 * r * x[0]]]), 1)

    with np.errstate(invalid="raise"):
        branch = follow(family, begin(family, 0.2, [0.45], periods=2), (0.2, 0.5))
    assert branch.ending is Ending.LOST
    assert "event" not in branch.reason


def test_a_fast_motion_is_no_jump():
    """It settles within the shortest part of a return that is looked at, as at a jump."""
    system = from_rhs(lambda t, x: [x[1], -x[0], 1e4 * (x[0] - x[2])], 3, None, guess_period=6.3)
    assert not jumps_at_ends(system, np.array([1.0, 0.0, 1.0]), 2.0 * np.pi)


@pytest.mark.parametrize(("rate", "length"), [(1.0, 1.0), (100.0, 1.0), (1e6, 1e-9)])
def test_bounds_of_multipliers_by_energy(rate, length):
    """A multiplier is exactly 1, and the parameter, zero but for rounding, moves it: x'' + x + x^3 = 0 and a pendulum,
    in some units."""

    def hardening(x):
        return x + x**3 / length**2

    def pendulum(x):
        return length * np.sin(x / length)

    for force in (hardening, pendulum):

        def family(value, force=force):
            def rhs(t, x):
                return [x[1] + value * force(x[0]), -(rate**2) * force(x[0]) + value * x[1]]

            return from_rhs(rhs, 2, None, guess_period=6.2 / rate)

        branch = follow(family, begin(family, 0.0, [0.5 * length, 0.0]), (-0.1 * rate, 0.1 * rate), points=12)
        assert len(branch.points) > 8
        assert branch.remarks == ()
        for point in branch.points:
            assert np.abs(point.multipliers - 1.0).max() <= point.error_bound
            assert point.stable is None
            if abs(point.orbit[0]) < 2.5 * length:  # the pendulum is unstable upright, and magnifies errors near there
                assert point.error_bound < 1e-9


@pytest.mark.parametrize("width", [1e-5, 1e-3])
def test_a_family_by_energy_has_no_branch_points_of_its_own(width):
    """Orbits about a point of Hill's problem, by the parameter of a term that vanishes: H' - 1 is nearly singular along
    the whole family, more so in a narrow interval."""

    def hill(value):
        def rhs(t, x):
            cube = (x[0] ** 2 + x[1] ** 2) ** 1.5
            gx, gy = x[0] / cube - 3.0 * x[0], x[1] / cube
            first = [x[2] + value * gx, x[3] + value * gy]
            return [*first, 2.0 * x[3] - gx + value * x[2], -2.0 * x[2] - gy + value * x[3]]

        return from_rhs(rhs, 4, None, guess_period=3.0, scale=[0.3] * 4)

    rate = np.sqrt(2.0 * np.sqrt(7.0) - 1.0)
    times = np.linspace(0.0, 2.0 * np.pi / rate, 65)
    across, x, y = (rate**2 + 9.0) / (2.0 * rate), 0.02 * np.cos(rate * times), 0.02 * np.sin(rate * times)
    states = np.stack([3.0 ** (-1.0 / 3.0) + x, -across * y, -rate * y, -rate * across * x], axis=1)
    branch = follow(hill, begin(hill, 0.0, (times, states)), (-width, width), points=12)
    assert len(branch.points) > 8
    assert branch.special_points == ()
    assert str(branch).startswith(f"Branch by energy: {len(branch.points)} orbits with periods between 3.0")
    assert branch.plot().get_xlabel() == "period"


def test_branches_that_do_not_go_on_are_refused():
    """Fixed points with p^2 + (x - 3)^2 = 1: a closed branch."""

    def circle(p):
        return from_map(lambda x: ([x[0] + 0.3 * (1.0 - p * p - (x[0] - 3.0) ** 2)], [[1.0 - 0.6 * (x[0] - 3.0)]]), 1)

    start = begin(circle, 0.1, [3.0 + np.sqrt(0.99)])
    closed = follow(circle, start, (-2.0, 2.0))
    assert closed.ending is Ending.CLOSED
    with pytest.raises(ParameterError, match="is a closed branch"):
        follow(circle, closed, (-2.0, 2.0))
    with pytest.raises(ParameterError, match="is a branch without points"):
        follow(circle, replace(closed, points=()), (-2.0, 2.0))
    part = follow(circle, start, (-2.0, 2.0), points=3)
    plane = lambda p: from_map(lambda x: (0.5 * x, 0.5 * np.eye(2)), 2)  # noqa: E731
    with pytest.raises(ParameterError, match="must have the branch's dimension"):
        follow(plane, part, (-2.0, 2.0))


def test_a_resumed_branch_is_not_studied_outside_its_interval():
    def family(p):
        assert p < 0.5
        return from_map(lambda x: ([0.5 * x[0] + p], [[0.5]]), 1)

    part = follow(family, begin(family, 0.0, [0.0]), (-0.1, 0.4), points=3)

    def narrow(p):
        assert p <= 0.01
        return family(p)

    with pytest.raises(ParameterError, match="must extend beyond the branch's last point"):
        follow(narrow, part, (-0.1, 0.01))
