"""Orbits of systems that do not depend on time: unknown period, one multiplier that is always 1."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import (
    BranchPoint,
    Ending,
    Event,
    Kind,
    Orbit,
    PeriodicSystem,
    SearchStatus,
    begin,
    exponents,
    find_orbit,
    follow,
    follow2,
    from_rhs,
    locate,
    multipliers,
    switch,
)
from chilopod.stability.search.samples import Samples
from helpers.systems import lorenz, roessler

STEP = 1e-30


def ring(mu, twist=0.0, spin=2.0, leak=0.7, units=(1.0, 1.0, 1.0)):
    """r' = r (mu - r^2), phi' = spin + twist (r^2 - mu), z' = -leak z + r^2 - mu, in x = r cos phi, y = r sin phi, z.

    The orbit r^2 = mu takes 2 pi / spin, whatever mu; its multipliers are exp(-2 mu T) and exp(-leak T). All in closed
    form: with q = r^2, q(t) = mu q0 e / (mu + q0 (e - 1)), e = exp(2 mu t).
    """
    units = np.array(units)

    def moved(x, t):
        x, y, z = x / units
        q0 = x * x + y * y
        e = np.exp(2.0 * mu * t)
        grown = mu + q0 * (e - 1.0)
        turned = spin * t + twist * (0.5 * np.log(grown / mu) - mu * t)
        share = np.sqrt(mu * e / grown)
        c, s = np.cos(turned) * share, np.sin(turned) * share
        # z' is driven by q - mu, which is a rational function of e: a Gauss rule is exact to round-off here.
        u, w = np.polynomial.legendre.leggauss(40)
        u, w = 0.5 * t * (u + 1.0), 0.5 * t * w
        grow = np.exp(2.0 * mu * u)
        drive = mu * q0 * grow / (mu + q0 * (grow - 1.0)) - mu
        z = z * np.exp(-leak * t) + (w * np.exp(-leak * (t - u)) * drive).sum()
        return np.array([c * x - s * y, s * x + c * y, z]) * units

    def flow(x, t0, t1):
        columns = [
            moved(x + 1j * STEP * step, t1 - t0).imag / STEP / unit
            for step, unit in zip(np.eye(3) * units, units, strict=True)
        ]
        return moved(x, t1 - t0).real, np.array(columns).T

    def velocity(x):
        x, y, z = x / units
        q = x * x + y * y
        turning = spin + twist * (q - mu)
        return np.array([(mu - q) * x - turning * y, (mu - q) * y + turning * x, -leak * z + q - mu]) * units

    return PeriodicSystem(3, None, flow, velocity=velocity, guess_period=2.0 * np.pi / spin)


def known(mu, leak, spin):
    period = 2.0 * np.pi / spin
    return period, np.exp(-np.sort([2.0 * mu, leak]) * period)


@given(
    st.floats(0.2, 2.0),
    st.floats(-3.0, 3.0),
    st.floats(0.5, 5.0),
    st.sampled_from([-0.3, -0.02, 0.05, 0.4, 1.0]),
    st.floats(0.0, 6.2),
    st.floats(0.93, 1.06),
    st.lists(st.sampled_from([1e-9, 1e-4, 1.0, 1e5, 1e9]), min_size=3, max_size=3),
)
def test_known_orbits_in_any_units(mu, twist, spin, leak, angle, off, units):
    # From the guess the motion has to come back in about the period, and the same way round.
    assume(0.5 * spin < spin + twist * mu * (off**2 - 1.0) < 2.0 * spin)
    period, values = known(mu, leak, spin)
    guess = np.sqrt(mu) * np.array([np.cos(angle), np.sin(angle), 0.0]) * off * units
    found = multipliers(ring(mu, twist, spin, leak, units), guess)
    assert found.period == pytest.approx(period, rel=1e-13)
    assert np.abs(found.values - values).max() <= found.error_bound
    if abs(2.0 * mu - leak) > 0.05:  # equal multipliers move as the square root of an error
        assert found.error_bound < 1e-8
    assert found.stable == bool(leak > 0)


def test_exponents_leave_out_the_motion_itself():
    found = exponents(ring(1.3, 0.4, 2.0, 40.0), [1.1, 0.3, 0.0])
    np.testing.assert_allclose(found.values, [-2.6, -40.0], rtol=1e-11)
    assert found.modes.shape == (3, 2)
    assert found.multipliers.period == pytest.approx(np.pi, rel=1e-14)


def test_one_state_has_nothing_beside_its_motion():
    """Of a neuron that fires at x = 1, and of x' = x that is turned there, whose half period is a return."""
    fire = Event(lambda t, x: x[0] - 1.0, lambda t, x: [0.0 * x[0]], direction=1)
    turn = Event(lambda t, x: x[0] ** 2 - 1.0, lambda t, x: [-0.5 * x[0]], direction=1)

    def neuron(current):
        return from_rhs(lambda t, x: [current - x[0]], 1, None, guess_period=1.0, events=[fire])

    turning = from_rhs(lambda t, x: [x[0]], 1, None, guess_period=1.4, symmetry=[[-1.0]], events=[turn])
    for system, guess, period in ((neuron(1.5), [0.2], np.log(3.0)), (turning, [0.6], 2.0 * np.log(2.0))):
        for found in (multipliers(system, guess), multipliers(system, guess, leading=1)):
            assert (found.values.size, found.error_bound, found.stable, found.remarks) == (0, 0.0, True, ())
            assert found.period == pytest.approx(period, rel=1e-13)
        assert exponents(system, guess).modes.shape == (1, 0)
    branch = follow(neuron, begin(neuron, 1.5, [0.2]), (1.5, 2.0))
    assert branch.ending is Ending.LEFT_INTERVAL
    assert all(point.stable for point in branch.points)


def test_a_bad_guess_settles_on_the_orbit_that_attracts():
    found = find_orbit(ring(1.0, 0.8), [9.0, -7.0, 3.0])
    assert found.period == pytest.approx(np.pi, rel=1e-12)
    assert np.hypot(*found.state[:2]) == pytest.approx(1.0, rel=1e-12)


def test_a_bad_guess_of_the_period():
    system = ring(1.0, 0.3)
    for guess in (2.0, 4.7):
        far = PeriodicSystem(3, None, system.flow, velocity=system.velocity, guess_period=guess)
        assert find_orbit(far, [1.0, 0.2, 0.1]).period == pytest.approx(np.pi, rel=1e-12)


def test_where_the_orbit_loses_stability():
    """leak passes through zero: a multiplier +1 besides the one of the motion."""
    (point,) = locate(lambda leak: ring(1.0, 0.5, leak=leak), (-0.2, 0.3), orbit=[1.0, 0.1, 0.0], normal_form=False)
    assert abs(point.value) <= point.error_bound < 1e-9
    assert point.kind in (Kind.TRANSCRITICAL, Kind.BRANCH_POINT)


def test_orbits_in_a_family():
    """Nothing brings z back: the nearest orbit is found, and its multiplier 1 is not called stable."""
    found = multipliers(ring(0.5, leak=0.0), [0.7, 0.02, 0.3])
    np.testing.assert_allclose(found.values, [1.0, np.exp(-np.pi)], rtol=1e-10)
    assert not found.stable


def test_a_flow_without_parts_is_a_map():
    """x -> -0.8 x, as a flow that ignores from when to when: the exponent has half a turn."""
    system = PeriodicSystem(1, 1.0, lambda x, t0, t1: (-0.8 * x, np.array([[-0.8]])), orbit=[0.0])
    assert exponents(system).values[0] == pytest.approx(np.log(0.8) + 1j * np.pi)


def test_what_is_no_orbit_is_one_line():
    with pytest.raises(AnalysisError, match="equilibrium"):
        multipliers(ring(1.0, leak=0.5), [0.0, 0.0, -2.0])
    with pytest.raises(ParameterError, match="guess_period"):
        PeriodicSystem(3, None, ring(1.0).flow, velocity=ring(1.0).velocity)
    with pytest.raises(ParameterError, match="period"):
        PeriodicSystem(3, None, ring(1.0).flow)
    drift = PeriodicSystem(1, None, lambda x, t0, t1: (x + t1 - t0, np.eye(1)), velocity=np.ones_like, guess_period=1.0)
    with pytest.raises(AnalysisError) as error:
        multipliers(drift, [0.0])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("step", [0.005, 0.01, 0.02])
def test_a_doubled_branch_has_no_points_that_are_not_there(step):
    """Beside the period doubling of Rössler's system the doubled orbit's multiplier falls from 1 at a constant rate; a
    small residual, which is far from an orbit there, made folds and pitchforks of it."""

    (doubling,) = locate(roessler, (2.0, 3.0), orbit=[3.0, 0.0, 0.1])
    (start,) = switch(roessler, doubling)
    branch = follow(roessler, start, (2.0, 3.0), points=4, step=step)
    assert [point.value for point in branch.special_points] == [doubling.value]
    assert branch.remarks == ()
    # The first value is known to some 1e-9, which is a hundredth of its distance from the doubling.
    last = branch.points[-1]
    rate = (1.0 - last.multipliers[0].real) / (last.value - doubling.value)
    for point in branch.points[1:]:
        assert point.value > doubling.value
        assert (1.0 - point.multipliers[0].real) / (point.value - doubling.value) == pytest.approx(rate, rel=0.05)


def test_a_doubled_branch_does_not_remark_its_start():
    """Beside the period doubling of Chua's circuit the doubled orbit's multiplier is below 1 by less than its error."""

    def rhs(t, x, a):
        return [a * (x[1] - x[0] ** 3 / 16.0 + x[0] / 6.0), x[0] - x[1] + x[2], -14.0 * x[1]]

    def chua(a):
        return from_rhs(rhs, 3, None, args=(a,), guess_period=2.3)

    (doubling,) = locate(chua, (8.15, 8.25), orbit=[0.346, 0.02, 0.457], normal_form=False)
    (start,) = switch(chua, doubling)
    branch = follow(chua, start, (8.0, 9.0), points=1, step=0.02)
    assert branch.remarks == ()
    assert [point.value for point in branch.special_points] == [doubling.value]


def test_a_cycle_that_shrinks_into_an_equilibrium_ends_there():
    """The unstable cycle ends in the Hopf point at r = 470/19 (Lorenz 1963): nothing beyond, no fold, no orbit that
    misses itself."""
    start = begin(lorenz, 24.0, [5.48239022, 5.89665725, 19.66310346])
    branch = follow(lorenz, start, (13.0, 26.0), points=400)
    assert branch.ending is Ending.LOST
    assert "Hopf" in branch.reason
    assert branch.special_points == ()
    assert branch.points[-1].value == pytest.approx(470.0 / 19.0, abs=1e-5)
    for point in branch.points:
        assert point.value < 470.0 / 19.0
        rest = np.sqrt(8.0 / 3.0 * (point.value - 1.0))
        motion = np.abs(point.orbit - [rest, rest, point.value - 1.0]).max()
        state, _ = lorenz(point.value).flow(point.orbit, 0.0, point.period)
        assert np.abs(state - point.orbit).max() <= 1e-8 * motion


@pytest.mark.parametrize("state", [[3.0, 0.0, 0.1], [0.0, 3.0, 0.1], [-3.0, 0.0, 0.05]])
def test_coefficients_do_not_hang_on_where_an_orbit_is_met(state):
    """Rössler's period doubling, on three sections, located and followed."""
    (point,) = locate(roessler, (2.0, 3.3), orbit=state)
    box = ((2.0, 3.3), (-0.1, 0.1))
    curve = follow2(lambda c, more: roessler(c + more), point, box, second=0.0, rising=True, points=1)
    for each in (point, *curve.points):
        assert abs(each.coefficient + 0.3705827166) <= each.coefficient_error + 1e-10 < 1e-7
    np.testing.assert_allclose(curve.points[0].mode, point.mode * np.sign(point.mode @ curve.points[0].mode), atol=1e-7)


@pytest.mark.parametrize("angle", [1.0, np.pi, 1.5 * np.pi, 5.0])
def test_coefficients_do_not_hang_on_where_an_orbit_with_an_event_is_met(angle):
    """r' = s r, phi' = 1, and a reset whose return map is u -> -(1 + p) u - 0.4 u^3 in u = r - 2.

    The mode u e^(s t) / sqrt(1 + s^2) across the motion jumps back at the event.
    """
    s = -0.05
    decay = np.exp(2.0 * np.pi * s)

    def family(p):
        def reset(t, x):
            u = x[0] - 2.0
            return [(2.0 - (1.0 + p) * u - 0.4 * u**3) / decay, 0.0 * x[0]]

        back = Event(lambda t, x: x[1], reset, direction=1)
        return from_rhs(
            lambda t, x: [s * x[0] - x[1], s * x[1] + x[0]], 2, None, events=[back], guess_period=2.0 * np.pi
        )

    r = 2.0 * np.exp(s * (angle - 2.0 * np.pi))
    (point,) = locate(family, (-0.3, 0.3), orbit=[r * np.cos(angle), r * np.sin(angle)])
    unit = (1.0 + s * s) * 4.0 * np.pi * s / (1.0 - np.exp(-4.0 * np.pi * s))  # squared u of a mean square of 1
    assert abs(point.coefficient - 0.8 * unit) <= point.coefficient_error < 1e-7


@pytest.mark.parametrize("angle", [0.3, 1.5, 4.5])
def test_a_pair_that_jumps_at_an_event(angle):
    """w' = (a + 0.2 + 0.37 i - |w|^2) w round a circle, and w is multiplied by e^(-0.4 pi) once a turn.

    At a = 0, ln |w| falls by the integral of |w|^2 in a turn, on the average 2 |A|^2 with the amplitude A of a mode of
    mean square 1.
    """
    shrink = np.exp(-0.4 * np.pi)

    def rhs(t, x, a):
        grow, beside = 1.0 - x[0] ** 2 - x[1] ** 2, a + 0.2 - x[2] ** 2 - x[3] ** 2
        return [grow * x[0] - x[1], grow * x[1] + x[0], beside * x[2] - 0.37 * x[3], beside * x[3] + 0.37 * x[2]]

    kick = Event(lambda t, x, a: x[1], lambda t, x, a: [x[0], x[1], shrink * x[2], shrink * x[3]], direction=1)
    found = locate(
        lambda a: from_rhs(rhs, 4, None, args=(a,), events=[kick], guess_period=6.3),
        (-0.3, 0.4),
        orbit=[np.cos(angle), np.sin(angle), 0.0, 0.0],
    )
    (point,) = found
    assert abs(point.coefficient + 4.0 * np.pi) <= point.coefficient_error < 1e-6


@pytest.mark.parametrize("state", [[1.0, 0.0, -0.3], [1.0, 0.0, 0.3], [1.2, 0.0, 0.0], [0.54, 0.84, 0.0]])
def test_a_fold_of_an_orbit_with_twist(state):
    """The cycles r^2 = 1 +- sqrt(1/4 - l^2) turn at rates that differ, and meet at l = 1/2."""

    def rhs(t, x, level):
        square = x[0] * x[0] + x[1] * x[1]
        grow, turn = 0.25 - level * level - (square - 1.0) ** 2, 1.0 + square
        return [grow * x[0] - turn * x[1], turn * x[0] + grow * x[1], -0.5 * x[2] + x[0] * x[1]]

    found = locate(lambda level: from_rhs(rhs, 3, None, args=(level,), guess_period=3.0), (0.3, 1.0), orbit=state)
    (point,) = found
    assert found.complete
    assert point.kind is Kind.FOLD
    assert abs(point.value - 0.5) <= point.error_bound < 1e-10


@pytest.mark.parametrize(("method", "guess"), [("implicit", (0.3, 0.1)), ("automatic", (0.00020277, 0.02949324))])
def test_a_multiplier_that_is_zero_lies_within_its_bound(method, guess):
    # The Oregonator: rounding of a state turns its velocity by far more, and with it the projection onto the section.
    def rhs(t, x):
        return [(x[0] * (1.0 - x[0]) + x[1] * (2e-4 - x[0]) / (2e-4 + x[0])) / 1e-2, x[0] - x[1]]

    found = multipliers(from_rhs(rhs, 2, None, guess_period=7.0, method=method), guess)
    assert abs(found.values[-1]) <= found.error_bounds[-1] < 1e-7  # exp(-68193.9), by the integral of the divergence


def rimless_wheel(slope):
    """The next spoke hits the ground at a lean of pi/8 + slope, and cos(pi/4) of the speed is left."""
    step = np.pi / 8.0
    hit = Event(lambda t, x: x[0] - step - slope, lambda t, x: [slope - step, np.cos(2.0 * step) * x[1]], 1)
    return from_rhs(lambda t, x: [x[1], np.sin(x[0])], 2, None, events=[hit], guess_period=2.2)


def test_a_search_moves_time_0_away_from_an_event():
    """The lean just after a hit passes the one at which the orbit begins; the multiplier is 1/2 at every slope."""
    low, lean = 0.125, -0.226
    after = 4.0 * np.sin(np.pi / 8.0) * np.sin(low)  # square of the speed after a hit
    start = [lean, np.sqrt(after + 2.0 * (np.cos(low - np.pi / 8.0) - np.cos(lean)))]
    found = locate(rimless_wheel, (low, 0.31), start)
    assert found.complete
    assert len(found) == 0
    assert found.searched == (low, 0.31)
    assert "time 0 was moved along the orbit, away from an event" in found.remarks[-1]


def test_what_was_found_before_time_0_was_moved_is_kept(monkeypatch):
    class Lost(Samples):
        def __init__(self, family, guess, *others):
            if isinstance(guess, Orbit):
                raise AnalysisError("no periodic orbit found", field="orbit")
            super().__init__(family, guess, *others)

    monkeypatch.setattr("chilopod.stability.search.locate.Samples", Lost)
    found = locate(rimless_wheel, (0.125, 0.31), [-0.226, 0.4416])
    assert found.status is SearchStatus.INCOMPLETE
    assert found.ending.startswith("no periodic orbit found before the orbit was followed beyond 0.18")
    assert 0.18 < found.searched[1] < 0.2


def test_a_search_stays_on_an_orbit_beside_an_event():
    """Five neurons fire in turn; next to their orbit one beyond the threshold never fires. The turn's stability changes
    where neurons do not act on each other."""
    count, drive, low = 5, 1.2, -0.2

    def family(pulse):
        def fires(i):
            return Event(lambda t, x: x[i] - 1.0, lambda t, x: [0.0 if j == i else x[j] + pulse for j in range(5)], 1)

        fire = [fires(i) for i in range(count)]
        return from_rhs(lambda t, x: [drive - each for each in x], count, None, events=fire, guess_period=3.731)

    start = [0.6161448, 0.7713021, 0.8448762, 0.8797623, 0.2889129]
    found = locate(family, (low, 0.03), start, normal_form=False)
    (point,) = found
    assert found.complete
    assert abs(point.value) <= point.error_bound < 1e-10


def test_an_orbit_may_be_given_just_before_or_after_an_impact():
    slope = 0.1
    after = 2.0 * np.sqrt(np.sin(np.pi / 8.0) * np.sin(slope))
    for lean, speed in ((slope - np.pi / 8.0, after), (slope + np.pi / 8.0, np.sqrt(2.0) * after)):
        assert multipliers(rimless_wheel(slope), [lean, speed]).values == pytest.approx([0.5], abs=1e-12)


@pytest.mark.parametrize("guess", [[0.2, 0.3, 1.0], [1.0, 0.3, 0.0], [1.0, 0.3, 1.0], [0.1, 0.3, 1.0]])
def test_a_mode_of_an_orbit_is_one_of_its_values(guess):
    """A block sticks to a belt from 0.2 to 1, where it begins to slip; the third state says which."""
    period = np.pi + 2.0 * np.arctan(0.75) + 0.8 / 0.3

    def rhs(t, x):
        return [np.where(x[2] > 0.5, 0.3, x[1]), np.where(x[2] > 0.5, 0.0, 0.6 - x[0]), 0.0]

    catch = Event(lambda t, x: x[1] - 0.3 - x[2], lambda t, x: [x[0], 0.3, 1.0], 1)
    slip = Event(lambda t, x: x[0] - 1.0 + 10.0 * (x[2] - 1.0), lambda t, x: [1.0, 0.3, 0.0], 1)
    found = find_orbit(from_rhs(rhs, 3, None, events=[catch, slip], guess_period=period), guess)
    assert found.period == pytest.approx(period, rel=1e-9)
    assert found.state[2] in (0.0, 1.0)


@pytest.mark.parametrize("left", [0.0, 1e-13, 1e-6])
def test_an_orbit_given_beside_an_event_is_not_left_for_another(left):
    """Two neurons in antiphase, the second about to fire."""
    fire = [
        Event(lambda t, x: x[0] - 1.0, lambda t, x: [0.0, x[1] - 0.1], 1),
        Event(lambda t, x: x[1] - 1.0, lambda t, x: [x[0] - 0.1, 0.0], 1),
    ]
    period = 1.6262946371279092
    antiphase = from_rhs(lambda t, x: [1.3 - x[0], 1.3 - x[1]], 2, None, events=fire, guess_period=period)
    found = multipliers(antiphase, [1.3 - 1.3 * np.exp(-period / 2.0) - left, 1.0 - left])
    assert found.period == pytest.approx(period, rel=1e-9)


@pytest.mark.parametrize("factor", [0.7, 1.35])
def test_a_state_on_an_orbit_keeps_it_with_a_wrong_period(factor):
    """Newton's method comes to an orbit of period 17.5 with the shorter time, though the motion returns after 5.88."""

    def system(guess_period):
        rhs = lambda t, x: [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - 5.7)]  # noqa: E731
        return from_rhs(rhs, 3, None, guess_period=guess_period)

    exact = find_orbit(system(5.88), [8.0, -3.0, 0.3], with_error=False)
    found = find_orbit(system(factor * exact.period), exact.state, with_error=False)
    assert found.period == pytest.approx(exact.period, rel=1e-9)
    np.testing.assert_allclose(found.state, exact.state, atol=1e-8)


def van_der_pol(mu):
    return from_rhs(lambda t, x: [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]], 2, None, guess_period=6.6)


def bits(branch):
    points = [(each.value, each.period, each.error_bound, each.special, *each.orbit) for each in branch.points]
    return points, branch.ending, branch.reason, branch.step, branch.remarks


def test_a_branch_of_cycles_in_pieces_is_that_in_one():
    between, start = (1.0, 8.0), begin(van_der_pol, 1.0, [2.0, 0.0])
    whole, piece = (follow(van_der_pol, start, between, points=points) for points in (8, 4))
    assert bits(follow(van_der_pol, piece, between, points=4)) == bits(whole)
    pieces = follow(van_der_pol, start, between, budget=60)
    while len(pieces.points) < len(whole.points):
        assert pieces.ending is Ending.BUDGET
        pieces = follow(van_der_pol, pieces, between, budget=60)
    assert bits(pieces)[0][: len(whole.points)] == bits(whole)[0]
    anew = follow(van_der_pol, replace(piece, anchor=None), between, points=4)
    assert [each.value for each in anew.points] == pytest.approx([each.value for each in whole.points], rel=1e-9)


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_a_branch_goes_on_from_a_point_in_other_units(factor):
    """Its tangent there is that along the section in these units, not in those of the point."""
    start = begin(van_der_pol, 2.0, [0.5, 2.8])
    point = follow(van_der_pol, start, (1.0, 8.0), points=1).points[0]
    units = point.units * [factor, 1.0, 1.0]
    tangent = point.tangent * point.units / units
    other = replace(point, units=units, tangent=tangent / np.linalg.norm(tangent))
    first, last = follow(van_der_pol, other, (1.0, 8.0), points=1, step=1e-4).points
    moved = (np.append(last.orbit, last.value) - np.append(first.orbit, first.value)) / units
    assert moved / np.linalg.norm(moved) == pytest.approx(first.tangent, abs=1e-2)


@pytest.mark.parametrize("points", [13, 16])
def test_a_cycle_that_shrinks_in_pieces_ends_where_one_does_in_one(points):
    """r^2 = mu: the largest motion is that of the earlier pieces."""

    def family(mu):
        return from_rhs(lambda t, x: [*(mu - x @ x) * x + np.array([-x[1], x[0]])], 2, None, guess_period=2 * np.pi)

    start = begin(family, 0.5, [np.sqrt(0.5), 0.0], rising=False)
    pieces = follow(family, follow(family, start, (-0.5, 0.5), points=points), (-0.5, 0.5))
    assert bits(pieces) == bits(follow(family, start, (-0.5, 0.5)))
    assert "Hopf" in pieces.reason


@pytest.mark.parametrize(
    ("value", "orbit", "multiplier", "tangent", "period"),
    [
        (
            3.522760239814641, [-0.3135294289407823, -0.09525690475403274, 3.5400921431527728], -0.83373571581753,
            [-0.003598288687454264, 0.0039045197348393794, -0.9999253515370717, -0.0110044717104258],
            31.004911327935183,
        ),
        (
            3.1593902971757033, [-0.31153583821991104, -0.09494383918542362, 3.1703235484657797], -5.83524414848993,
            [0.010322726438960306, 0.0038993966269151668, -0.9998866448869307, -0.010243700579841971],
            47.14044227963879,
        ),
        (
            2.611465672571466, [-0.2976379303681251, -0.09440362914069594, 2.57335020732535], -33978.16609053449,
            [0.019943299807079536, 0.004397254371342856, -0.9997439563384144, -0.009744255326313742],
            173.86621067214995,
        ),
    ],
)  # fmt: skip
def test_a_branch_goes_on_from_a_point_whose_returns_magnify(value, orbit, multiplier, tangent, period):
    """Of the bursts of Hindmarsh & Rose (1984), far from a fold, which needs a multiplier of +1."""

    def rhs(current):
        return lambda t, x: [
            x[1] - x[0] ** 3 + 3.0 * x[0] ** 2 - x[2] + current,
            1.0 - 5.0 * x[0] ** 2 - x[1],
            0.006 * (4.0 * (x[0] + 1.6) - x[2]),
        ]

    units = np.array([0.051788298499435344, 0.00872558510103503, 0.03772742967541175, 3.5])
    point = BranchPoint(value, np.array(orbit), np.array([multiplier, 0j]), np.array(tangent), units, period=period)
    branch = follow(lambda current: from_rhs(rhs(current), 3, None, guess_period=20.0), point, (1.5, 5.0), points=1)
    assert (branch.ending, branch.remarks, len(branch.points)) == (Ending.ENOUGH_POINTS, (), 2)
    last = branch.points[-1]
    assert last.value - value == pytest.approx(0.02 * 3.5 * tangent[-1], rel=0.02)
    how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    closed = solve_ivp(rhs(last.value), (0.0, last.period), last.orbit, **how).y[:, -1]
    assert closed == pytest.approx(last.orbit, abs=1e-10 * max(1.0, abs(multiplier)))
