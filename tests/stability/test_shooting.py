"""Whole orbits as unknowns: returns that magnify a deviation by thousands, guesses that are orbits."""

import numpy as np
import pytest
import xarray as xr

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import Ending, begin, find_orbit, follow, from_rhs, locate, multipliers
from chilopod.stability.orbits.shooting import Nodes, Problem, shot
from helpers.systems import duffing, lorenz

RATE, FREQUENCY = np.sqrt(1.0 + 2.0 * np.sqrt(7.0)), np.sqrt(2.0 * np.sqrt(7.0) - 1.0)
PERIOD = 2.0 * np.pi / FREQUENCY


def hill():
    """Hill's lunar problem, whose point of libration is a saddle and a centre (Szebehely 1967, section 10.3)."""

    def rhs(t, x):
        cube = (x[0] * x[0] + x[1] * x[1]) ** 1.5
        return [x[2], x[3], 2.0 * x[3] + 3.0 * x[0] - x[0] / cube, -2.0 * x[2] - x[1] / cube]

    return from_rhs(rhs, 4, None, guess_period=3.0)


def linear(size):
    """Motion about the point of libration, linearised, at even times over a period."""
    t = np.linspace(0.0, PERIOD, 65)
    ratio = (FREQUENCY**2 + 9.0) / (2.0 * FREQUENCY)
    c, s = size * np.cos(FREQUENCY * t), size * np.sin(FREQUENCY * t)
    states = [3.0 ** (-1.0 / 3.0) + c, -ratio * s, -FREQUENCY * s, -ratio * FREQUENCY * c]
    return t, np.stack(states, axis=1)


def test_an_orbit_that_magnifies_two_thousand_times_from_a_rough_guess():
    times, states = linear(0.02)
    off = np.random.default_rng(1).normal(0.0, 0.01, 4)
    found = multipliers(hill(), (times, states + off))
    assert found.values[0].real == pytest.approx(np.exp(RATE * PERIOD), rel=0.02)
    assert (found.values[0] * found.values[-1]).real == pytest.approx(1.0, abs=1e-6)


def test_a_small_orbit_is_that_of_the_linear_motion():
    found = multipliers(hill(), linear(1e-4))
    assert found.period == pytest.approx(PERIOD, rel=1e-7)
    assert found.values[0].real == pytest.approx(np.exp(RATE * PERIOD), rel=1e-5)


@pytest.mark.parametrize("symmetry", [None, -np.eye(2)])
@pytest.mark.parametrize("form", ["rows", "times", "record", "record across"])
def test_guesses_that_are_orbits(form, symmetry):
    system = duffing(symmetry=symmetry)
    known = find_orbit(system, [1.88, 0.64])
    times = np.linspace(0.0, 2.0 * np.pi, 33)

    def along(times):
        return 0.05 + np.array([duffing().flow(known.state, 0.0, t)[0] if t else known.state for t in times])

    states = along(times)
    guess = {
        "rows": states[:-1],
        "times": (times + 3.0, along(times + 3.0)),
        "record": xr.DataArray(states, {"time": times}, ("time", "state")),
        "record across": xr.DataArray(states.T, {"time": times}, ("state", "time")),
    }[form]
    found = find_orbit(system, guess)
    assert np.abs(found.state - known.state).max() <= (found.error + known.error).max() + 1e-14
    (point,) = locate(lambda force: duffing(force, -np.eye(2)), (2.2, 2.6), orbit=guess)
    assert point.value == pytest.approx(2.403377116057, abs=1e-11)


def test_a_record_must_tell_its_times():
    for record in (
        xr.DataArray(np.ones((9, 2)), dims=("time", "state")),
        xr.DataArray(np.ones((9, 2)), dims=("t", "i")),
    ):
        with pytest.raises(ParameterError, match=r"^orbit = .*: must tell its times; allowed: a dimension `time`"):
            find_orbit(duffing(), record)
    state = find_orbit(duffing(), xr.DataArray([1.88, 0.64], dims="state")).state
    assert state == pytest.approx(find_orbit(duffing(), [1.88, 0.64]).state, abs=1e-14)


def test_a_cycle_is_followed_to_where_it_becomes_homoclinic():
    """Lorenz: at r = 13.9265 (Sparrow 1982, chapter 2) the unstable cycle takes for ever; the closer, the longer by the
    logarithm, at the rate 8/3 of the origin's slowest stable direction, which is slower than the unstable one."""
    start = begin(lorenz, 24.0, [5.48239022, 5.89665725, 19.66310346], rising=False)
    branch = follow(lorenz, start, (13.0, 26.0), points=100, closely=False)  # no search where rounding is magnified
    values = np.array([point.value for point in branch.points])
    assert (np.diff(values) < 0.0).all()
    assert 13.9265 < values[-1] < 13.93
    assert len(branch.points) < 60
    assert branch.special_points == ()
    near = [point for point in branch.points if point.value < 13.97]
    assert len(near) > 3
    for point, after in zip(near, near[1:], strict=False):
        gone = np.log((point.value - 13.92656) / (after.value - 13.92656)) * 3.0 / 8.0
        assert after.period - point.period == pytest.approx(gone, rel=0.1)
        if after.value < 13.929:  # rounding alone is magnified to more than is asked here
            continue
        state, _ = lorenz(after.value).flow(after.orbit, 0.0, after.period)
        assert np.abs(state - after.orbit).max() <= 1e-10 * after.multipliers[0].real


def test_an_end_of_the_interval_is_reached_where_a_return_magnifies():
    asked = []

    def family(r):
        asked.append(r)
        return lorenz(r)

    start = begin(family, 24.0, [5.48239022, 5.89665725, 19.66310346], rising=False)
    asked.clear()
    branch = follow(family, start, (13.94, 26.0))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert branch.points[-1].value == min(asked) == 13.94
    assert branch.points[-1].multipliers[0].real > 5000.0


def test_what_explodes_between_two_nodes_is_named():
    system = from_rhs(lambda t, x: [x[0] ** 2 + np.cos(t)], 1, 2.0 * np.pi)
    nodes = Nodes(np.array([[0.0], [0.0], [50.0], [0.0]]), 2.0 * np.pi)
    with pytest.raises(AnalysisError, match="node 2 of 4"):
        shot(Problem(lambda _: system), nodes, np.ones(1), None)


@pytest.mark.parametrize(
    "guess",
    [
        np.zeros((3, 2)),
        np.zeros((9, 3)),
        np.full((9, 2), np.nan),
        (np.zeros(9), np.zeros((9, 2))),
        (np.linspace(0.0, 1.0, 9), np.zeros((9, 2))),
        (np.linspace(0.0, 2.0 * np.pi, 8), np.zeros((9, 2))),
        np.zeros((2, 2, 2)),
    ],
    ids=str,
)
def test_orbits_that_are_none_are_one_line(guess):
    with pytest.raises(ParameterError) as error:
        find_orbit(duffing(), guess)
    assert "\n" not in str(error.value)


def lunar(t, x):
    """The restricted problem of Earth and Moon in space."""
    m = 0.01215058560962404
    far, near = (((x[0] + at) ** 2 + x[1] ** 2 + x[2] ** 2) ** -1.5 for at in (m, m - 1.0))
    p, q = (1.0 - m) * far, m * near
    along, across = p * (x[0] + m) + q * (x[0] - 1.0 + m), p + q
    return [*x[3:], 2.0 * x[4] + x[0] - along, -2.0 * x[3] + x[1] - across * x[1], -across * x[2]]


@pytest.mark.parametrize(("size", "period"), [(0.006, 2.698895840405), (0.02, None)])
def test_an_orbit_in_a_plane_of_a_system_in_space(size, period):
    # Of the states across the plane corrections leave 1e-32, which was taken for their size. The period is that of
    # DOP853 with tolerances of 1e-13; the larger guess leads to the point of libration.
    t = np.linspace(0.0, 2.0 * np.pi / 2.33438588529, 65)
    c, s = size * np.cos(2.33438588529 * t), size * np.sin(2.33438588529 * t)
    rates = -2.33438588529 * s, -3.58641603 * 2.33438588529 * c
    states = np.stack([0.836915125772357 + c, -3.58641603 * s, 0.0 * t, *rates, 0.0 * t], axis=1)
    system = from_rhs(lunar, 6, None, guess_period=2.7)
    if period is None:
        with pytest.raises(AnalysisError, match="found an equilibrium near the guess"):
            find_orbit(system, (t, states))
    else:
        assert find_orbit(system, (t, states)).period == pytest.approx(period, abs=1e-10)


@pytest.mark.filterwarnings("error")
def test_states_moved_by_rounding_alone_give_no_size():
    def toda(t, x):
        a = 2.0 * np.sqrt(3.0)
        e, f, g = np.exp(a * x[0] + 2.0 * x[1]), np.exp(-a * x[0] + 2.0 * x[1]), np.exp(-4.0 * x[1])
        return [x[2], x[3], -a * (e - f) / 24.0, -(2.0 * e + 2.0 * f - 4.0 * g) / 24.0]

    found = multipliers(from_rhs(toda, 4, None, guess_period=6.26), [0.0, 0.1, 0.0, 0.0])
    assert found.period == pytest.approx(6.263459706114258, abs=1e-10)
    np.testing.assert_allclose(found.values, 1.0, atol=1e-4)


@pytest.mark.parametrize("scale", [None, [1.0, 1.0]])
def test_the_bound_of_an_orbit_that_hardly_any_force_holds(scale):
    """x'' = -x'/5 - x^31 + 0.3 cos t, whose force is below rounding: the mean of the orbit is zero by its symmetry."""
    forced = from_rhs(lambda t, x: [x[1], -x[1] / 5 - x[0] ** 31 + 0.3 * np.cos(t)], 2, 2 * np.pi, scale=scale)
    orbit = find_orbit(forced, [-0.268, 0.058])
    assert (np.abs(orbit.state - np.array([-1.0, 0.2]) * 0.3 / 1.04) <= orbit.error).all()
