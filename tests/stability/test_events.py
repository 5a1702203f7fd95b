"""Events that are none are refused in one line that names them."""

import itertools
import math

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import Event, from_rhs


def ball(*events):
    return from_rhs(lambda t, x: [x[1], -9.81], 2, 1.0, events=events, orbit=[0.3, 0.5])


def height(t, x):
    return x[0]


def bounced(t, x):
    return [x[0], -0.8 * x[1]]


def branching(t, x):
    return 1.0 if x[0] > 0 else -1.0


@pytest.mark.parametrize(
    ("reset", "said"),
    [
        (lambda t, x: [x[0]], r"an array of shape \(1,\); allowed: an array of shape \(2,\)"),
        (lambda t, x: [x[0], x[1], x[1]], r"an array of shape \(3,\); allowed: an array of shape \(2,\)"),
        (lambda t, x: "up", r"an array of real numbers, not 'up'; allowed: an array of shape \(2,\)"),
        (lambda t, x: None, r"an array of real numbers, not None; allowed: an array of shape \(2,\)"),
    ],
)
def test_resets(reset, said):
    with pytest.raises(ParameterError, match=r"^events\[1\].reset: (returns|must return) " + said):
        ball(Event(lambda t, x: x[0] - 9.0, direction=1), Event(height, reset, -1))


@pytest.mark.parametrize(
    ("guard", "said"),
    [
        (lambda t, x: "low", "must return a real number, not 'low'; allowed: one number"),
        (lambda t, x: None, "must return a real number, not None; allowed: one number"),
        (lambda t, x: x, r"returns an array of shape \(2,\); allowed: one number"),
        (lambda t, x: x[0] < 0.0, "must return a number, not true"),
        (lambda t, x: math.nan, "is not finite on the orbit"),
        (lambda t, x: np.sqrt(-1.0 - x[0] ** 2), "is not finite on the orbit"),
        (lambda t, x: 0.0, "is zero at all states"),
        (lambda t, x: x[0] - x[0], "is zero at all states"),
    ],
)
def test_guards(guard, said):
    with pytest.raises(ParameterError, match=r"events\[0\].guard( = nan)?: " + said):
        ball(Event(guard, bounced, -1))


def test_guards_without_an_orbit():
    """NaN at zero is no fault where nobody said that the orbit is there."""
    event = Event(lambda t, x: np.log(np.abs(x[0])), direction=-1)
    assert from_rhs(lambda t, x: -x, 1, 1.0, events=[event]).dimension == 1
    with pytest.raises(ParameterError, match=r"events\[0\].guard: must be finite"):
        from_rhs(lambda t, x: -x, 1, 1.0, events=[Event(lambda t, x: x[0] * math.nan)])


def test_functions_that_cannot_be_traced():
    with pytest.raises(ParameterError, match="need functions that can be traced: it needs the value"):
        ball(Event(branching, bounced))
    with pytest.raises(ParameterError, match="need functions that can be traced: IndexError"):
        ball(Event(lambda t, x: [][1], bounced))
    with pytest.raises(ParameterError, match=r"^rhs: returns an array of shape \(1,\); allowed: an array of shape"):
        from_rhs(lambda t, x: [x[1]], 2, 1.0, events=[Event(height)])


def test_events_at_the_same_instant():
    """The first of the list happens; where that is seen, the other is refused."""
    for second in (Event(lambda t, x: 1.0 * x[0], bounced), Event(height, None, -1)):
        with pytest.raises(ParameterError, match=r"events\[1\].guard: must differ from that of events\[0\]"):
            ball(Event(height, bounced, -1), second)
    assert ball(Event(height, bounced, -1), Event(height, bounced, 1)).dimension == 2

    def kicked(speed):
        return lambda t, x: [x[0], x[1] + speed]

    # x' = 1 up to x = 0 at t = 0.5, with two guards that meet there, one of them a few units in the last place late:
    # rounding, which differs between processors, may put either first.
    for speeds, late in itertools.product(((1.0, 10.0), (10.0, 1.0)), (-3e-16, -1e-16, 0.0, 1e-16, 3e-16)):
        second = Event(lambda t, x, late=late: 3.0 * (x[0] - late) + x[0] ** 2, kicked(speeds[1]))
        system = from_rhs(
            lambda t, x: [1.0 + x[1], 0.0 * x[0]], 2, 1.0, events=[Event(height, kicked(speeds[0])), second]
        )
        state, _ = system.flow(np.array([-0.5, 0.0]), 0.0, 0.95)
        np.testing.assert_allclose(state, [(1.0 + speeds[0]) * 0.45, speeds[0]], rtol=1e-12)


@pytest.mark.parametrize(
    "guard",
    [
        lambda t, x: np.sign(x[0]),
        lambda t, x: np.where(x[0] > 0.0, 1.0, -1.0),
        lambda t, x: np.floor(x[0]) + 0.5,
        lambda t, x: 2.0 * (x[0] > 0.0) - 1.0,
        lambda t, x: x[0] + 0.5 * np.sign(x[0]),
    ],
)
@pytest.mark.parametrize("direction", [0, 1])
def test_a_guard_that_jumps_through_zero_is_refused(guard, direction):
    """Its event would be passed over."""
    event = Event(guard, lambda t, x: [x[0], -0.7 * x[1]], direction)
    system = from_rhs(lambda t, x: [x[1], -0.1 * x[1] - x[0] + np.cos(2.0 * t + 1.0)], 2, np.pi, events=[event])
    with pytest.raises(AnalysisError, match=r"a guard jumps through zero at t = .*allowed: guards that pass zero cont"):
        system.flow(np.array([-0.79, 2.97]), 0.0, np.pi)


def raised(x):
    return [x[0] + 1.0]


@pytest.mark.parametrize(
    ("period", "guard", "reset", "direction", "said"),
    [
        (1.0, lambda t, x: np.sin(math.pi * (t - 0.3) / 1.5), lambda t, x: raised(x), 1, "period = 1.0: .*guard"),
        (1.0, lambda t, x: np.sin(math.pi * t), None, 1, "period = 1.0: .*guard"),  # rises every other period
        (1.0, lambda t, x: x[0] - 1.0 + 0.1 * np.sin(t), None, 0, "period = 1.0: .*guard"),
        (1.0, lambda t, x: t - 0.3, None, 0, "period = 1.0: .*guard"),
        (1.0, lambda t, x: x[0] - 0.1, lambda t, x: [1.0 + 0.2 * np.sin(math.pi * t)], -1, "period = 1.0: .*reset"),
        (None, lambda t, x: x[0] - 0.1 + 0.1 * np.sin(t), lambda t, x: [1.0], 0, r"given; .*\[0\].guard depends on t"),
        (None, lambda t, x: np.exp(-t) * (x[0] - 0.1), lambda t, x: [1.0], -1, r"given; .*\[0\].guard depends on t"),
        (None, lambda t, x: x[0] - 0.1, lambda t, x: [1.0 + 0.1 * t], -1, r"given; .*\[0\].reset depends on t"),
    ],
)
def test_events_without_the_period_are_refused(period, guard, reset, direction, said):
    """Orbits that do not repeat came out as stable."""
    with pytest.raises(ParameterError, match=said):
        from_rhs(lambda t, x: [-x[0]], 1, period, events=[Event(guard, reset, direction)], guess_period=1.0)


@pytest.mark.parametrize(
    ("guard", "direction"),
    [
        (lambda t, x: np.cos(2.0 * math.pi * t), 1),
        (lambda t, x: np.cos(math.pi * t), 0),  # passes zero once a period, in turn rising and falling
        (lambda t, x: np.exp(-t) * (x[0] - 1.0), 1),
        (lambda t, x: np.cos(math.pi * t) * (x[0] - np.sin(2.0 * math.pi * t)), 0),
        (lambda t, x: t % 1.0 - 0.3, 1),
    ],
)
def test_guards_up_to_a_factor(guard, direction):
    """A factor leaves the events as they are, a negative one if both directions count."""
    event = Event(guard, lambda t, x: raised(x), direction)
    assert from_rhs(lambda t, x: [-x[0]], 1, 1.0, events=[event]).dimension == 1
