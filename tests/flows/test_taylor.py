"""Flows of traced right-hand sides: against closed forms, differences, and themselves in other units."""

import math

import numba
import numpy as np
import pytest
from numba.core import ir
from numba.core.analysis import dead_branch_prune
from numba.core.compiler import run_frontend

from chilopod.errors import AnalysisError
from chilopod.flows.taylor import stepping
from chilopod.flows.taylor.flow import TaylorFlow
from chilopod.flows.tracing.trace import trace

GRAVITY = 9.81


def flow_of(rhs, n, args=(), **options):
    traced = trace(rhs, n, args)
    return TaylorFlow(traced.tape, **options), traced.params


def differences(flow, params, x, t0, t1, h=1e-6):
    x = np.asarray(x, dtype=float)

    def state(step):
        return flow.states((x + step)[None], t0, t1, params)[0]

    return np.array([(state(h * e) - state(-h * e)) / (2 * h) for e in np.eye(x.size)]).T


# Units


def exponential(matrix):
    """exp(matrix) to the last digit, by its series in integers."""
    bits = 300
    a = np.array([[int(entry * 2.0**100) << (bits - 100) for entry in row] for row in matrix], dtype=object)
    term = np.array([[int(i == j) << bits for j in range(len(a))] for i in range(len(a))], dtype=object)
    total = term
    for k in range(1, 200):
        term = np.array([[entry // (k << bits) for entry in row] for row in term.dot(a)], dtype=object)
        total = total + term
    return (total / (1 << bits)).astype(float)


def test_linear_systems_in_any_units():
    """States in units 10^±9 apart, time in any; every entry within its own bound, and that tight."""
    rng = np.random.default_rng(2)
    tight = []
    for _ in range(30):
        n = int(rng.integers(1, 6))
        matrix = rng.standard_normal((n, n))
        # Powers of two, so that the matrix is the same to the last bit.
        units = 2.0 ** rng.integers(-30, 30, n)
        clock = 2.0 ** rng.integers(-40, 40)
        flow, params = flow_of(lambda t, x, a: a @ x, n, (matrix * units[:, None] / units / clock,))
        passage = flow.advance(np.zeros(n), 0.0, 2.0 * clock, params, bounded=True)
        ratio = units / units[:, None]
        true = exponential(2.0 * matrix)
        error = np.abs(passage.derivative * ratio - true)
        assert (error <= passage.bound * ratio).all()
        tight.append(np.median(passage.bound * ratio / np.maximum(error, 1e-17 * np.abs(true))))
    assert np.median(tight) < 1e3


def pendulum(t, x, k, w, length, clock):
    y = x / length
    return length / clock * np.array([y[1], -k * np.sin(y[0]) - 0.2 * y[1] + np.cos(w * t / clock)])


def test_a_nonlinear_system_in_other_units_has_the_same_digits():
    x = np.array([0.9, -0.4])
    plain = flow_of(pendulum, 2, (1.3, 1.1, np.ones(2), 1.0))
    one = plain[0].advance(x, 0.0, 7.0, plain[1], bounded=True)
    units, clock = np.array([2.0**-30, 2.0**27]), 2.0**33
    flow, params = flow_of(pendulum, 2, (1.3, 1.1, units, clock))
    other = flow.advance(x * units, 0.0, 7.0 * clock, params, bounded=True)
    np.testing.assert_allclose(other.state / units, one.state, rtol=1e-14)
    np.testing.assert_allclose(other.derivative * units / units[:, None], one.derivative, rtol=1e-13)
    np.testing.assert_allclose(other.bound * units / units[:, None], one.bound, rtol=0.8)
    assert one.bound.max() < 1e-12


# Accuracy


def test_closed_forms():
    flow, params = flow_of(lambda t, x: [x[0] * (1 - x[0])], 1)  # logistic: x = 1 / (1 + (1 / x0 - 1) exp(-t))
    passage = flow.advance(np.array([0.2]), 0.0, 5.0, params, bounded=True)
    e = math.exp(-5.0)
    assert passage.state[0] == pytest.approx(1 / (1 + 4 * e), rel=1e-15)
    assert abs(passage.derivative[0, 0] - 25 * e / (1 + 4 * e) ** 2) <= passage.bound[0, 0] < 1e-14
    flow, params = flow_of(lambda t, x: [-(x[0] ** 1.5) / t], 1)  # 1/sqrt(x) = 1/sqrt(x0) + ln(t) / 2
    passage = flow.advance(np.array([4.0]), 1.0, math.e, params, bounded=True)
    assert passage.state[0] == pytest.approx(1.0, rel=1e-15)
    assert abs(passage.derivative[0, 0] - 1 / 8) <= passage.bound[0, 0]


def test_kepler_goes_round():
    """Ellipse of eccentricity 0.9: steps of very different lengths; energy and momentum conserved along."""

    def rhs(t, x):
        return np.concatenate([x[2:], -x[:2] / np.linalg.norm(x[:2]) ** 3])

    flow, params = flow_of(rhs, 4)
    x = np.array([0.1, 0.0, 0.0, math.sqrt(19.0)])
    passage = flow.advance(x, 0.0, 2 * math.pi, params, bounded=True)
    condition = np.abs(passage.derivative) @ np.abs(x)
    assert (np.abs(passage.state - x) <= passage.steps * 2.0**-53 * condition).all()
    assert abs(np.linalg.det(passage.derivative) - 1) < 1e-9  # Liouville


@pytest.mark.parametrize("width", [0.1, 1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("place", [0.3, 1.1, 1.99])
def test_pulses_are_not_stepped_over(width, place):
    def rhs(t, x, w, at):
        return (-1 + 3 / w * np.exp(-0.5 * (((t - at + 1) % 2.0 - 1) / w) ** 2) / math.sqrt(2 * math.pi)) * x

    flow, params = flow_of(rhs, 1, (width, place), period=2.0)
    start = place - 1.0
    passage = flow.advance(np.zeros(1), start, start + 2.0, params, bounded=True)
    assert abs(passage.derivative[0, 0] - math.e) <= passage.bound[0, 0] + 1e-15 / width
    assert passage.bound[0, 0] < 1e-9


# Switches


def test_jumps_in_time_need_no_declaration():
    flow, params = flow_of(lambda t, x: -x * np.where(t % 2.0 > 0.7, 2.0, 1.0), 1)
    for start in (0.0, 0.7, -3.1, 14.3):
        passage = flow.advance(np.array([3.0]), start, start + 2.0, params, bounded=True)
        assert abs(passage.derivative[0, 0] - math.exp(-3.3)) <= passage.bound[0, 0] < 1e-14


def test_saltation_in_closed_form():
    """x' = 1 below x = 1 and 3 above it: dx(t)/dx(0) = 3 once crossed."""
    flow, params = flow_of(lambda t, x: [np.where(x[0] > 1.0, 3.0, 1.0)], 1)
    passage = flow.advance(np.zeros(1), 0.0, 2.0, params, bounded=True)
    assert passage.state[0] == pytest.approx(4.0, rel=1e-15)
    assert abs(passage.derivative[0, 0] - 3.0) <= passage.bound[0, 0] < 1e-13


SWITCHED = {
    "dry friction and a bend": lambda t, x: [
        x[1],
        -x[0] - 0.5 * np.sign(x[0]) * x[0] ** 2 - 0.1 * np.sign(x[1]) + 0.9 * np.cos(t),
    ],
    "stop": lambda t, x: [x[1], -x[0] - 30.0 * np.maximum(x[0] - 0.8, 0.0) - 0.1 * x[1] + np.sin(t)],
    "staircase": lambda t, x: [x[1] + 0.1 * np.floor(3 * x[0]), -x[0] + 0.3 * np.heaviside(x[1], 0.5)],
    "saturation": lambda t, x: [x[1], -np.clip(3 * x[0], -1, 1) + 0.2 * np.abs(np.cos(2 * t))],
    "remainder of the state": lambda t, x: [1.0 + 0.3 * (x[0] % 0.7) + 0.1 * x[1], -x[1] + np.sign(np.sin(3 * x[0]))],
}


@pytest.mark.parametrize("case", SWITCHED)
def test_jumps_in_the_state(case):
    flow, params = flow_of(SWITCHED[case], 2)
    x = np.array([1.05, 0.3])
    passage = flow.advance(x, 0.0, 6.0, params, bounded=True)
    np.testing.assert_allclose(passage.derivative, differences(flow, params, x, 0.0, 6.0), rtol=1e-6, atol=1e-6)
    assert passage.bound.max() < 1e-11
    parts = [flow.advance(x, 0.0, 2.345, params)]
    parts.append(flow.advance(parts[0].state, 2.345, 6.0, params))
    np.testing.assert_allclose(parts[1].derivative @ parts[0].derivative, passage.derivative, atol=passage.bound.max())


def test_sliding_is_named():
    flow, params = flow_of(lambda t, x: [-np.sign(x[0]) + 0.1 * np.cos(t)], 1)
    for start in (1.0, 0.0):
        with pytest.raises(AnalysisError, match="slides"):
            flow.advance(np.array([start]), 0.0, 3.0, params)


@pytest.mark.parametrize(
    ("rhs", "start", "said"),
    [
        (lambda t, x: [-1.0 - np.abs(x[0]) ** 1.5], 0.5, "is not smooth: a root of"),
        (lambda t, x: [-1.0 - np.abs(x[0]) ** 1.3], 0.5, "is not smooth: a power of"),
        (lambda t, x: [-1.0 - np.log1p(np.exp(-2000.0 * x[0]))], -0.2, "overflows: exp of"),
    ],
)
def test_a_motion_that_ends_at_a_function_names_it(rhs, start, said):
    """It does not diverge."""
    flow, params = flow_of(rhs, 1)
    with pytest.raises(AnalysisError, match=f"the right-hand side {said}"):
        flow.advance(np.array([start]), 0.0, 3.0, params)


def test_what_cannot_go_on_ends(monkeypatch):
    monkeypatch.setattr("chilopod.flows.taylor.flow._MOST_WORK", 1e5)
    for power, end in ((2, r"(1|0\.999)"), (3, r"0\.(5|4999)")):  # a whole power is smooth
        flow, params = flow_of(lambda t, x, power=power: x**power, 1)
        with pytest.raises(AnalysisError, match=rf"diverges|beyond t = {end}"):
            flow.advance(np.array([1.0]), 0.0, 2.0, params)
    flow, params = flow_of(lambda t, x: -1e12 * (x - np.cos(t)), 1)
    with pytest.raises(AnalysisError, match="too many steps"):
        flow.advance(np.array([1.0]), 0.0, 1.0, params)
    flow, params = flow_of(lambda t, x: np.sqrt(x), 1)
    with pytest.raises(AnalysisError, match="not finite"):
        flow.advance(np.array([-1.0]), 0.0, 1.0, params)


# Events


def ball(restitution, **options):
    events = [(lambda t, x: x[0], lambda t, x: [x[0], -restitution * x[1]])]
    traced = trace(lambda t, x: [x[1], -GRAVITY], 2, events=events)
    return TaylorFlow(traced.tape, directions=(-1.0,), **options), traced.params


def test_a_ball_bounces():
    """Dropped from rest: v = -sqrt(2 g h) at the floor, and e v up again; the derivative by hand."""
    flow, params = ball(0.8)
    h, e, t1 = 1.0, 0.8, 0.7
    passage = flow.advance(np.array([h, 0.0]), 0.0, t1, params, bounded=True)
    fall = math.sqrt(2 * h / GRAVITY)
    speed = e * GRAVITY * fall
    left = t1 - fall
    assert passage.state == pytest.approx([speed * left - GRAVITY * left**2 / 2, speed - GRAVITY * left], rel=1e-13)
    slope = 1 / math.sqrt(2 * h * GRAVITY)  # d fall / dh
    by_height = [e * GRAVITY * slope * left - (speed - GRAVITY * left) * slope, (1 + e) * GRAVITY * slope]
    np.testing.assert_allclose(passage.derivative[:, 0], by_height, atol=passage.bound.max())
    assert passage.bound.max() < 1e-12


def test_zeno_is_named():
    for restitution in np.linspace(0.1, 0.9, 17).tolist():  # rounding decides whether the last bounces move time
        flow, params = ball(restitution)
        end = math.sqrt(2.0 / GRAVITY) * (1.0 + 2.0 * restitution / (1.0 - restitution))
        with pytest.raises(AnalysisError, match="Zeno") as caught:
            flow.advance(np.array([1.0, 0.0]), 0.0, 2.0 * end, params)
        assert f"t = {end:g};" in str(caught.value)


def test_directions_count():
    events = [(lambda t, x: x[0], lambda t, x: [x[0], x[1], x[2] + t])]  # the third state sums the times
    for direction, times in ((1.0, [1.5]), (-1.0, [0.5, 2.5]), (0.0, [0.5, 1.5, 2.5])):
        traced = trace(lambda t, x: [math.pi * x[1], -math.pi * x[0], 0.0 * x[2]], 3, events=events)
        flow = TaylorFlow(traced.tape, directions=(direction,))
        passage = flow.advance(np.array([1.0, 0.0, 0.0]), 0.0, 3.0, traced.params)
        assert passage.state[2] == pytest.approx(sum(times), rel=1e-14)
        np.testing.assert_allclose(passage.derivative[:2], -np.eye(3)[:2], atol=1e-13)


def test_a_reset_that_depends_on_time():
    """x' = 1 to x = t / 2 + 1 from below, where x goes to t: fixed by hand at t = 2, x = 2 -> 2 for x(0) = 0."""
    events = [(lambda t, x: x[0] - 0.5 * t - 1.0, lambda t, x: [t * x[0] / 2.0 - 1.0])]
    traced = trace(lambda t, x: [1.0 + 0 * x[0]], 1, events=events)
    flow = TaylorFlow(traced.tape, directions=(1.0,))
    passage = flow.advance(np.zeros(1), 0.0, 3.0, traced.params, bounded=True)
    # Start s: crossing at t* = 2 - 2 s, x = 2 - s, reset to t* x / 2 - 1, at the end that + 3 - t*.
    assert passage.state[0] == pytest.approx(2.0, rel=1e-14)
    assert passage.derivative[0, 0] == pytest.approx(-3.0 + 2.0, rel=1e-13)


# Many at once


def test_many_states():
    flow, params = flow_of(lambda t, x, k: [x[1], -k * x[0]], 2, (2.0,))
    start = np.linspace(0.5, 4.0, 70)
    states = flow.states(np.stack([start, np.zeros(70)], axis=1), 0.0, 2.0, params)
    np.testing.assert_allclose(states[:, 0], start * np.cos(2.0 * np.sqrt(2.0)), atol=1e-14)


@pytest.mark.parametrize("a", [2.0, -2.0])
def test_switches_of_parameters_alone(a):
    flow, params = flow_of(lambda t, x, a: [np.sign(a) * x[0] + np.maximum(a, 0.5) * x[1], 0.0 * x[1]], 2, (a,))
    state = flow.advance([1.0, 1.0], 0.0, 1.0, params).state
    sign, drive = np.sign(a), max(a, 0.5)
    np.testing.assert_allclose(state, [np.exp(sign) + sign * drive * np.expm1(sign), 1.0], rtol=1e-14)


def test_a_reset_that_switches():
    events = [(lambda t, x: x[0] - 1.0, lambda t, x: [x[0], -np.maximum(x[1], 0.5)])]
    traced = trace(lambda t, x: [x[1], 0.0 * x[0]], 2, events=events)
    flow = TaylorFlow(traced.tape, directions=(1.0,))
    for speed in (2.0, 1.5, 0.75, 0.4):
        passage = flow.advance([0.0, speed], 0.0, 3.0, traced.params)
        back = max(speed, 0.5)
        np.testing.assert_allclose(passage.state, [1.0 - back * (3.0 - 1.0 / speed), -back], rtol=1e-14)


def test_what_goes_through_switches_is_compiled_only_where_there_are_any():
    """It takes as long to compile as the rest. Numba leaves out what it knows not to run for the types it is given."""

    def left(flow):
        directions, names = numba.typeof(flow._directions), set()
        for kernel in (stepping.advance, stepping._chosen):
            function = run_frontend(kernel.py_func)
            dead_branch_prune(function, [directions if name == "directions" else None for name in function.arg_names])
            values = (line.value for block in function.blocks.values() for line in block.find_insts(ir.Assign))
            names |= {value.name for value in values if isinstance(value, ir.Global)}
        return names

    smooth, _ = flow_of(lambda t, x: [-x[0]], 1)
    switching = {"settle", "await_events", "first_crossing", "cross"}
    assert left(ball(0.8)[0]) >= switching
    assert not left(smooth) & switching
