"""Hybrid systems with known answers: impacts, contacts, walking, and motions that cannot go on."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from chilopod.errors import AnalysisError
from chilopod.stability import (
    Criticality,
    Event,
    Kind,
    begin,
    find_orbit,
    follow,
    from_rhs,
    locate,
    multipliers,
)

GRAVITY = 9.81


def sorted_values(values):
    return np.sort_complex(np.asarray(values, dtype=complex))


def assert_multipliers(found, known, least=1e-15):
    """Within the bound that was given, which is itself small."""
    distance = np.abs(sorted_values(found.values) - sorted_values(known)).max()
    assert distance <= max(found.error_bound, least) < 1e-9


# A ball on a vibrating table


class VibratingTable:
    """A ball bounces once a period T on a table at A sin(w t + 2), with restitution e.

    It takes off and lands at the same height, at speeds g T / 2, so that the table has the velocity V = q g T / 2 then,
    q = (1 - e) / (1 + e). With P the table's phase at the impact, A w cos P = V; its acceleration is a = -A w^2 sin P.
    One period, from the flight and the derivative of the impact, has the determinant e^2 and the trace
    (1 + e)^2 (1 + a / g) - 2 e. Orbits begin where A w^2 = pi q g, and their period doubles where
    (A w^2 / g)^2 = (pi q)^2 + (1 + q^2)^2.
    """

    def __init__(self, restitution, metre, second):
        self.e, self.g = restitution, GRAVITY * metre / second**2
        self.w = 60.0 / second
        self.period = 2.0 * math.pi / self.w
        self.q = (1.0 - self.e) / (1.0 + self.e)
        self.first = math.pi * self.q * self.g / self.w**2
        self.doubles = math.hypot(math.pi * self.q, 1.0 + self.q**2) * self.g / self.w**2

    def system(self, amplitude):
        e, g, w = self.e, self.g, self.w
        impact = Event(
            lambda t, x, a: x[0] - a * np.sin(w * t + 2.0),
            lambda t, x, a: [x[0], -e * x[1] + (1.0 + e) * a * w * np.cos(w * t + 2.0)],
            -1,
        )
        return from_rhs(lambda t, x, a: [x[1], -g], 2, self.period, args=(amplitude,), events=[impact])

    def phase(self, amplitude):
        return math.acos(self.first / amplitude)

    def state(self, amplitude):
        phase = self.phase(amplitude)
        flown = (2.0 - phase) / self.w  # at time 0
        speed = 0.5 * self.g * self.period
        return np.array([amplitude * math.sin(phase) + speed * flown - 0.5 * self.g * flown**2, speed - self.g * flown])

    def multipliers(self, amplitude):
        lift = amplitude * self.w**2 * math.sin(self.phase(amplitude)) / self.g
        return np.roots([1.0, 2.0 * self.e - (1.0 + self.e) ** 2 * (1.0 - lift), self.e**2])


TABLES = [(0.5, 1.0, 1.0), (0.9, 1e6, 1e3), (0.1, 1e-6, 1e-2)]


@pytest.mark.parametrize(("restitution", "metre", "second"), TABLES)
def test_a_ball_on_a_vibrating_table(restitution, metre, second):
    table = VibratingTable(restitution, metre, second)
    for share in (0.1, 0.5, 0.9, 1.2):
        amplitude = table.first + share * (table.doubles - table.first)
        state = table.state(amplitude)
        orbit = find_orbit(table.system(amplitude), state * [1.001, 1.0])
        assert (np.abs(orbit.state - state) <= orbit.error + 1e-14 * np.abs(state)).all()
        assert_multipliers(multipliers(table.system(amplitude), state), table.multipliers(amplitude))


@pytest.mark.parametrize(("restitution", "metre", "second"), TABLES)
def test_where_the_period_of_bounces_doubles(restitution, metre, second):
    table = VibratingTable(restitution, metre, second)
    start = 0.5 * (table.first + table.doubles)
    found = locate(table.system, (start, 1.2 * table.doubles), orbit=table.state(start))
    assert found.complete
    (doubling,) = found
    assert doubling.kind is Kind.PERIOD_DOUBLING
    assert abs(doubling.value - table.doubles) <= doubling.error_bound < 1e-10 * table.doubles


@pytest.mark.parametrize(("restitution", "metre", "second"), TABLES)
def test_where_bounces_begin(restitution, metre, second):
    table = VibratingTable(restitution, metre, second)
    start = 0.5 * (table.first + table.doubles)
    downwards = locate(
        lambda value: table.system(-value), (-start, -0.9 * table.first), orbit=table.state(start), normal_form=False
    )
    (fold,) = downwards  # and not beyond it on other orbits, with two impacts a period
    assert fold.kind is Kind.FOLD
    assert abs(-fold.value - table.first) <= fold.error_bound < 1e-8 * table.first


def test_bounces_round_their_beginning():
    table = VibratingTable(*TABLES[2])
    start = 0.5 * (table.first + table.doubles)
    between = (0.9 * table.first, start)
    branch = follow(table.system, begin(table.system, start, table.state(start), rising=False), between, points=12)
    (fold,) = branch.special_points
    assert fold.special is Kind.FOLD
    assert abs(fold.value - table.first) <= fold.bifurcation.error_bound < 1e-8 * table.first
    sizes = np.abs(table.state(start))
    for point in branch.points[: branch.points.index(fold)]:
        assert (np.abs(point.orbit - table.state(point.value)) <= 1e-10 * sizes).all()
    assert branch.points[-1].value > table.first


# A mass that hits a wall


class ImpactOscillator:
    """x'' + 2 z x' + x = F cos w t with a wall at x = d and restitution r, hit once a period T.

    Between impacts x = X cos(w t - psi) + h, where h(T) = h(0) and h' goes from s - r v after one impact to s + v
    before the next, s = X w sin(w t - psi) at impact: h and s are linear in the speed v, and
    (d - h)^2 + (s / w)^2 = X^2 is quadratic in it (Shaw and Holmes, J. Sound Vib. 90, 1983).
    """

    def __init__(self, damping, force, frequency, wall, restitution):
        self.z, self.force, self.w, self.d, self.r = damping, force, frequency, wall, restitution
        self.period = 2.0 * math.pi / frequency
        self.matrix = np.array([[0.0, 1.0], [-1.0, -2.0 * damping]])
        response = force / (1.0 - frequency**2 + 2j * damping * frequency)
        self.size, self.lag = abs(response), -np.angle(response)
        carried = expm(self.matrix * self.period)
        # carried (h, s - r v) = (h, s + v), for v = 1
        h, s = np.linalg.solve(carried - np.eye(2), np.array([0.0, 1.0]) + restitution * carried[:, 1])
        quadratic = [h**2 + (s / frequency) ** 2, -2.0 * wall * h, wall**2 - self.size**2]
        self.speed = max(np.roots(quadratic).real)
        cosine, sine = (wall - h * self.speed) / self.size, s * self.speed / (self.size * frequency)
        self.time = ((math.atan2(sine, cosine) + self.lag) / frequency) % self.period

    def homogeneous(self, start, speed, end):
        """h and h' at the end of a flight from an impact at a time, which it leaves with a velocity."""
        phase = self.w * start - self.lag
        begin = np.array([self.d - self.size * np.cos(phase), speed + self.size * self.w * np.sin(phase)])
        return expm(self.matrix * (end - start)) @ begin

    def impact_map(self):
        """Derivative of the map from one impact (time, speed) to the next, by that of its implicit equation."""
        start, end = self.time, self.time + self.period
        step = 1e-20

        def at_end(a, v, b):
            phase_a, phase_b = self.w * a - self.lag, self.w * b - self.lag
            begin = np.array([self.d - self.size * np.cos(phase_a), -self.r * v + self.size * self.w * np.sin(phase_a)])
            damped = np.sqrt(1.0 - self.z**2)
            s = b - a
            c, k = np.cos(damped * s), np.sin(damped * s) / damped
            grow = np.exp(-self.z * s)
            h = grow * ((c + self.z * k) * begin[0] + k * begin[1])
            slope = grow * (-k * begin[0] + (c - self.z * k) * begin[1])
            return np.array([h + self.size * np.cos(phase_b) - self.d, slope - self.size * self.w * np.sin(phase_b)])

        given = (start, self.speed, end)
        by = [at_end(*(v + 1j * step * (i == j) for j, v in enumerate(given))).imag / step for i in range(3)]
        by_start, by_speed, by_end = by
        later = [-by_start[0] / by_end[0], -by_speed[0] / by_end[0]]
        return np.array([later, [by_start[1] + by_end[1] * later[0], by_speed[1] + by_end[1] * later[1]]])

    def system(self):
        z, f, w, d, r = self.z, self.force, self.w, self.d, self.r
        wall = Event(lambda t, x: x[0] - d, lambda t, x: [x[0], -r * x[1]], 1)
        return from_rhs(lambda t, x: [x[1], -x[0] - 2.0 * z * x[1] + f * np.cos(w * t)], 2, self.period, events=[wall])

    def state(self):
        end = self.homogeneous(self.time, -self.r * self.speed, self.period)
        return end + self.size * np.array([math.cos(-self.lag), -self.w * math.sin(-self.lag)])


@pytest.mark.parametrize(
    "case",
    [(0.05, 1.0, 2.8, 0.0, 0.8), (0.1, 0.7, 2.3, -0.1, 0.5), (0.02, 1.0, 1.7, 0.1, 0.3), (0.3, 2.0, 2.0, 0.0, 0.95)],
)
def test_a_mass_that_hits_a_wall(case):
    known = ImpactOscillator(*case)
    system, state = known.system(), known.state()
    assert np.abs(system.flow(state, 0.0, known.period)[0] - state).max() < 1e-13
    assert_multipliers(multipliers(system, state + 1e-4), np.linalg.eigvals(known.impact_map()))


# A hopper


def hopper_period(speed, gravity, stiffness):
    """Of flight, 2 v / g, and of stance: u'' = -g - (k/m) u from u' = -v at u = 0 to u' = v."""
    w = math.sqrt(stiffness)
    return 2.0 * speed / gravity + 2.0 * (math.pi - math.atan(speed * w / gravity)) / w


def hopper(touches, stiffness, metre=1.0):
    """A mass on a leg; a third state says whether the foot is down, and ``touches`` what touch-down makes of all."""
    touch = Event(lambda t, x: x[0], touches, -1)
    leave = Event(lambda t, x: x[0], lambda t, x: [x[0], x[1], 0.0], 1)

    def rhs(t, x):
        return [x[1], -GRAVITY * metre - stiffness * x[2] / metre * x[0], 0.0]

    return from_rhs(rhs, 3, None, events=[touch, leave], guess_period=0.5)


@pytest.mark.parametrize("as_event", [True, False])
@pytest.mark.parametrize("metre", [1.0, 1e-6])
def test_a_hopper_keeps_its_energy(metre, as_event):
    """Every height has its hop: a family of orbits, whose multiplier is 1."""
    gravity, stiffness, speed = GRAVITY * metre, 400.0, 1.7 * metre
    if as_event:
        system = hopper(lambda t, x: [x[0], x[1], metre], stiffness, metre)
        guess, known = [0.1 * metre, math.sqrt(speed**2 - 0.2 * metre * gravity), 0.0], [1.0, 0.0]
    else:
        system = from_rhs(lambda t, x: [x[1], -gravity - stiffness * np.minimum(x[0], 0.0)], 2, None, guess_period=0.5)
        guess, known = [0.1 * metre, math.sqrt(speed**2 - 0.2 * metre * gravity)], [1.0]
    found = multipliers(system, guess)
    assert_multipliers(found, known)
    height, rate = found.orbit[:2]
    speed = math.sqrt(rate**2 + 2.0 * gravity * height)
    assert found.period == pytest.approx(hopper_period(speed, gravity, stiffness), rel=1e-13)


def test_a_hopper_that_loses_and_gains():
    """At touch-down its speed v becomes r v + c, so c / (1 - r) comes back, and the multiplier is r."""
    stiffness, gain = 400.0, 0.9
    for keeps in (0.5, -0.3):
        speed = gain / (1.0 - keeps)
        system = hopper(lambda t, x, keeps=keeps: [x[0], keeps * x[1] - gain, 1.0], stiffness)
        found = multipliers(system, [0.5 * speed**2 / GRAVITY - 0.01, 0.4, 0.0])
        assert_multipliers(found, [keeps, 0.0])
        assert found.period == pytest.approx(hopper_period(speed, GRAVITY, stiffness), rel=1e-13)


# The simplest walker


def walker_rhs(t, x, slope):
    """Garcia, Chatterjee, Ruina and Coleman, J. Biomech. Eng. 120 (1998), eq. 1 and 2."""
    stance, rate, swing, swing_rate = x
    falls = np.sin(stance - slope)
    return [rate, falls, swing_rate, falls + rate * rate * np.sin(swing) - np.cos(stance - slope) * np.sin(swing)]


def heel_strike(t, x, slope):
    """The legs change places; eq. 4."""
    c = np.cos(2.0 * x[0])
    return [-x[0], c * x[1], -2.0 * x[0], c * (1.0 - c) * x[1]]


STRIKE = Event(lambda t, x, slope: x[2] - 2.0 * x[0], heel_strike, 1)
LONG, SHORT = (0.200310900544287, -0.199832473004977), (0.193937369810184, -0.203866927442010)
"""Stance angle and rate just after heel strike of the two gaits at the slope 0.009."""


def walker(slope):
    return from_rhs(walker_rhs, 4, None, args=(slope,), events=[STRIKE], guess_period=3.6)


def after_strike(start):
    stance, rate = start
    return np.array([stance, rate, 2.0 * stance, (1.0 - math.cos(2.0 * stance)) * rate])


def next_step(start, slope):
    """Stance angle and rate after the next heel strike, and its time, by scipy."""

    def strike(t, x, slope):
        return x[2] - 2.0 * x[0] if t > 1.0 else 1.0  # it has just happened

    strike.terminal, strike.direction = True, 1.0
    run = solve_ivp(
        walker_rhs, (0.0, 8.0), after_strike(start), "DOP853", args=(slope,), rtol=3e-14, atol=1e-15, events=strike
    )
    return np.array(heel_strike(0.0, run.y_events[0][0], slope)[:2]), run.t_events[0][0]


def stride(guess, slope):
    """The gait near a guess by Newton's method on scipy's steps: state after heel strike, period, derivative."""
    start = np.array(guess)
    while True:
        end, duration = next_step(start, slope)
        off = end - start
        derivative = np.array([differences(lambda x: next_step(x, slope)[0], start, e) for e in np.eye(2)]).T
        if np.abs(off).max() < 1e-12:
            return start, duration, derivative
        start = start - np.linalg.solve(derivative - np.eye(2), off)


def differences(function, x, direction, h=1e-4):
    """Derivative by central differences of sixth order."""
    weights = {1: 45.0, 2: -9.0, 3: 1.0}
    return sum(w * (function(x + k * h * direction) - function(x - k * h * direction)) for k, w in weights.items()) / (
        60.0 * h
    )


@pytest.mark.parametrize("gait", [LONG, SHORT])
def test_the_simplest_walker(gait):
    """From the published states, which are those just after an impact."""
    start, duration, derivative = stride(gait, 0.009)
    assert start == pytest.approx(gait, abs=1e-9)
    found = multipliers(walker(0.009), after_strike(gait))
    assert found.period == pytest.approx(duration, abs=1e-11)
    # A four-dimensional state, of which an impact forgets two.
    known = [*np.linalg.eigvals(derivative), 0.0]
    assert np.abs(sorted_values(found.values) - sorted_values(known)).max() < 1e-8  # what the differences are good for
    assert found.error_bound < 1e-9
    assert found.stable is (gait is LONG)


def test_where_the_walker_begins_to_limp():
    found = locate(walker, (0.009, 0.017), orbit=after_strike(LONG))
    assert found.complete
    (point,) = found
    assert (point.kind, point.criticality) == (Kind.PERIOD_DOUBLING, Criticality.SUPERCRITICAL)
    assert point.value == pytest.approx(0.0151, abs=5e-5)  # as published
    assert point.error_bound < 1e-10
    # Steps grow as the cube root of the slope. The determinant of derivative + 1 changes its sign there.
    near = np.array(LONG) * (point.value / 0.009) ** (1.0 / 3.0)
    signs = []
    for side in (-1e-7, 1e-7):
        near, _, derivative = stride(near, point.value + side)
        signs.append(np.sign(np.linalg.det(derivative + np.eye(2))))
    assert signs == [1.0, -1.0]


# Stick and slip


def test_stick_and_slip():
    """A unit mass on a unit spring and a belt of speed v. It sticks up to a force s, then slips against a force f:
    with D = s - f it slips for pi + 2 atan(v / D) and sticks for 2 D / v. Where it begins to slip is always the same,
    so that all multipliers are 0."""
    belt, static, kinetic = 0.3, 1.0, 0.6
    # The third state says whether it sticks.
    system = from_rhs(
        lambda t, x: [np.where(x[2] > 0.5, belt, x[1]), np.where(x[2] > 0.5, 0.0, kinetic - x[0]), 0.0],
        3,
        None,
        events=[
            Event(lambda t, x: x[1] - belt - x[2], lambda t, x: [x[0], belt, 1.0], 1),
            Event(lambda t, x: x[0] - static + 10.0 * (x[2] - 1.0), lambda t, x: [static, belt, 0.0], 1),
        ],
        guess_period=8.0,
    )
    found = multipliers(system, [0.0, belt, 1.0])
    excess = static - kinetic
    assert found.period == pytest.approx(math.pi + 2.0 * math.atan(belt / excess) + 2.0 * excess / belt, rel=1e-13)
    assert np.abs(found.values).max() <= max(found.error_bound, 1e-15) < 1e-9


# A neuron with a refractory clock, x[1], that is started at a spike and then stays at zero


def refractory(t, x):
    return [np.where(x[1] > 0.0, 0.0, 1.2 - x[0]), np.where(x[1] > 0.0, -1.0, 0.0)]


@pytest.mark.parametrize("guess", [[0.2, 0.0], [0.5, 0.0], [0.0, 0.4]])
def test_an_orbit_along_a_switching_surface(guess):
    """The velocity on the surface is that with which the motion goes on; a spike forgets the state."""
    spike = Event(lambda t, x: x[0] - 1.0, lambda t, x: [0.0, 0.5], 1)
    found = multipliers(from_rhs(refractory, 2, None, events=[spike], guess_period=2.2), guess)
    assert found.period == pytest.approx(math.log(6.0) + 0.5, rel=1e-13)
    assert_multipliers(found, [0.0])
    assert found.stable


def test_a_state_at_rest_on_a_switching_surface_is_no_orbit():
    """Without spikes the neuron comes to rest at 1.2."""
    for guess_period, state in itertools.product((2.3, 0.1), ([0.3, 0.0], [1.2, 0.0], [1.2, 1e-15])):
        said = refusal(refractory, 2, None, guess_period=guess_period, state=np.array(state))
        assert "equilibrium" in said or "does not come back" in said


def refusal(*arguments, state, **options):
    with pytest.raises(AnalysisError) as refused:
        multipliers(from_rhs(*arguments, **options), state)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_sliding_is_named():
    """A block that dry friction holds: which force keeps it there is not in its right-hand side."""
    said = refusal(
        lambda t, x: [x[1], -x[0] - np.sign(x[1]) + 0.5 * np.cos(t)], 2, 2.0 * math.pi, state=np.array([2.5, 0.1])
    )
    assert "slides along a switching surface" in said


def test_a_ball_that_comes_to_rest_is_named():
    said = refusal(
        lambda t, x: [x[1], -GRAVITY],
        2,
        5.0,
        events=[Event(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]], -1)],
        state=np.array([1.0, 0.0]),
    )
    assert "Zeno" in said


WALLED = 0.1, 1.7
"""Damping and frequency of a driven mass beside a wall."""


def forced(t, x, force):
    z, w = WALLED
    return [x[1], -x[0] - 2.0 * z * x[1] + force * np.cos(w * t)]


def test_a_wall_that_is_touched_as_forces_grow():
    """The motion of amplitude X(F) reaches the wall at F = d |1 - w^2 + 2 i z w|. From there on it is another one,
    whose derivative begins at infinity (Nordmark, J. Sound Vib. 145, 1991): the orbit cannot be followed."""
    z, w, wall = *WALLED, 0.5

    def family(force):
        hit = Event(lambda t, x, f: x[0] - wall, lambda t, x, f: [x[0], -0.8 * x[1]], 1)
        return from_rhs(forced, 2, 2.0 * math.pi / w, args=(force,), events=[hit])

    touches = wall * abs(1.0 - w**2 + 2j * z * w)
    found = locate(family, (0.5 * touches, 1.5 * touches), orbit=[0.0, 0.0])
    assert not found.complete
    assert "cannot be followed" in found.ending
    assert "just ahead the orbit grazes an event" in found.ending
    assert found.searched[1] == pytest.approx(touches, rel=1e-3)


def test_a_wall_that_is_never_reached_does_nothing():
    z, w = WALLED
    known = np.exp(2.0 * math.pi / w * np.roots([1.0, 2.0 * z, 1.0]))
    for events in ([], [Event(lambda t, x, f: x[0] - 50.0, lambda t, x, f: [x[0], -x[1]], 0)]):
        system = from_rhs(forced, 2, 2.0 * math.pi / w, args=(1.0,), events=events)
        assert_multipliers(multipliers(system, [0.0, 0.0]), known)


# Kicks, and impacts at the start


@pytest.mark.parametrize("period", [1.0, 2.0 * math.pi, 1e-5])
@pytest.mark.parametrize("direction", [0, 1])
def test_kicks_at_the_border_of_periods_happen_once(period, direction):
    """The standard map (Chirikov 1979): p' = p + K sin q, q' = q + p', its kicks at times that are multiples of T."""
    strength = 0.7
    rate = math.pi / period if direction == 0 else 2.0 * math.pi / period
    kick = Event(lambda t, x: np.sin(rate * t), lambda t, x: [x[0], x[1] + strength * np.sin(x[0]) / period], direction)
    rotor = from_rhs(lambda t, x: [x[1], 0.0], 2, period, events=[kick])
    for first, last in ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (0.0, 10.0)):
        q, p, at = 1.0, 0.3, first
        for kicked in range(math.ceil(first), math.ceil(last)):
            q, at = q + p * (kicked - at), float(kicked)
            p += strength * math.sin(q)
        q += p * (last - at)
        state, derivative = rotor.flow(np.array([1.0, 0.3 / period]), first * period, last * period)
        assert state * [1.0, period] == pytest.approx([q, p], rel=1e-13)
        assert np.linalg.det(derivative) == pytest.approx(1.0, rel=1e-13)
    trace = 2.0 + strength  # at the unstable point q = p = 0
    assert_multipliers(multipliers(rotor, [0.1, 0.01 / period]), np.roots([1.0, -trace, 1.0]))


def test_an_orbit_may_be_given_where_an_impact_is_due_or_just_was():
    """x'' - 2 d x' + x = 0 with a wall at -1: the return from impact to impact by the closed solution of a flight."""
    d, restitution = 0.15, 0.6
    wall = Event(lambda t, x: x[0] + 1.0, lambda t, x: [x[0], -restitution * x[1]], -1)
    oscillator = from_rhs(lambda t, x: [x[1], -x[0] + 2.0 * d * x[1]], 2, None, events=[wall], guess_period=4.0)
    flow = np.array([[0.0, 1.0], [-1.0, 2.0 * d]])

    def flight(speed):  # from the wall, with a speed away from it, to the wall
        duration = brentq(lambda t: (expm(flow * t) @ [-1.0, speed])[0] + 1.0, 1.5, 5.0, xtol=1e-15)
        return duration, restitution * -(expm(flow * duration) @ [-1.0, speed])[1]

    away = brentq(lambda v: flight(v)[1] - v, 5.0, 30.0, xtol=1e-14)
    slope = (flight(away + 1e-5)[1] - flight(away - 1e-5)[1]) / 2e-5
    before = -away / restitution
    for state in ([0.2, 1.0], [-1.0, away], [-1.0 + 1e-9, away], [-1.0, before], [-1.0 + 1e-14, before]):
        found = multipliers(oscillator, state)
        assert found.period == pytest.approx(flight(away)[0], rel=1e-12)
        assert found.values == pytest.approx([slope], rel=1e-8)
        assert found.error_bound < 1e-12


def test_a_branch_of_orbits_with_impacts_is_within_its_bounds():
    """A self-excited oscillator against a wall: its branch has units a thousand times larger than its orbits."""
    wall = Event(lambda t, x, p: x[0] + 0.6285, lambda t, x, p: [x[0], 0.4342 * x[1]], -1)

    def family(stiffness):
        def rhs(t, x, p):
            return [x[1], (0.3529 - 0.1408 * x[0] ** 2) * x[1] - 1.595 * p * x[0]]

        return from_rhs(rhs, 2, None, args=(stiffness,), events=[wall], guess_period=4.7)

    branch = follow(family, begin(family, 1.0, [1.096, 1.334], rising=False), (0.58, 1.0), points=40, step=0.07)
    assert len(branch.points) > 5
    for point in branch.points:
        system = family(point.value)
        again = system.flow(point.orbit, 0.0, point.period)[0]
        assert np.abs(again - point.orbit).max() < 5e-12
        known = multipliers(system, point.orbit)
        assert np.abs(known.values - point.multipliers).max() <= known.error_bound + point.error_bound
