"""Orbits that graze an event: with it and without it they may be two curves, which no search takes for one."""

import re
from dataclasses import replace

import numpy as np
import pytest

from chilopod.stability import Ending, Event, Kind, begin, follow, from_rhs, locate
from chilopod.stability.returns import JUMPS_AHEAD, event_beside

HIGHEST = 2.000103979842264
"""Largest angle of the van der Pol oscillator with a damping of 0.1, by scipy's DOP853."""


def forced(w, force=lambda beyond: 0.0, events=()):
    """The motion sin(t) solves the equation without a force or an event beyond w, and grazes w = 1."""

    def rhs(t, x, w):
        return [x[1], -x[0] - 0.2 * x[1] + 0.2 * np.cos(t) - force(x[0] - w)]

    return from_rhs(rhs, 2, 2.0 * np.pi, args=(w,), events=events)


def bounds(sentence):
    return [float(each) for each in re.findall(r"\d\.\d+", sentence)]


@pytest.mark.parametrize(
    ("force", "fold"), [(0.05, 1.0000265754458681), (0.2, 1.00026166818567), (0.5, 1.00063659578821)]
)
def test_a_search_does_not_jump_over_a_fold_to_an_orbit_without_the_event(force, fold):
    """The fold of the orbit that crosses the switch, by exponentials of matrices and scipy."""
    (point,) = locate(lambda w: forced(w, lambda beyond: force * (beyond > 0.0)), (0.9, 1.3), [0.056, 0.994])
    assert point.kind is Kind.FOLD
    assert point.value == pytest.approx(fold, abs=1e-11)


def test_what_is_beyond_a_grazing_where_an_orbit_is_very_unstable_is_left_open():
    faster = Event(lambda t, x, w: x[0] - w, lambda t, x, w: [x[0], 1.1 * x[1]], 1)
    found = locate(lambda w: forced(w, events=[faster]), (0.99, 1.001), [0.0, 1.0])
    assert [point.kind for point in found] == [Kind.PERIOD_DOUBLING]
    assert found[0].value == pytest.approx(0.99999463397, abs=1e-10)
    assert not found.complete
    assert found.searched[1] == pytest.approx(1.0, abs=1e-6)


def test_a_search_reports_a_grazing_between_stable_orbits():
    hit = Event(lambda t, x, h: x[0] - h, lambda t, x, h: [x[0], -0.6 * x[1]], 1)

    def walled(h):
        def rhs(t, x, h):
            return [x[1], 0.1 * (1.0 - x[0] ** 2) * x[1] - x[0]]

        return from_rhs(rhs, 2, None, args=(h,), events=[hit], guess_period=6.4)

    found = locate(walled, (1.95, 2.05), [-2.0, 0.0])
    assert not found.complete
    assert found.searched == (1.95, 2.05)
    (remark,) = found.remarks
    low, high = bounds(remark)
    assert low - 1e-9 <= HIGHEST <= high + 1e-9
    assert high - low < 1e-8


def test_a_branch_ends_at_a_grazing_between_stable_orbits():
    """The event takes half the square of the velocity, so the derivative jumps at w = 1."""
    slower = Event(lambda t, x, w: x[0] - w, lambda t, x, w: [x[0], x[1] - 0.5 * x[1] ** 2], 1)
    branch = follow(
        lambda w: forced(w, events=[slower]),
        begin(lambda w: forced(w, events=[slower]), 1.001, [0.0, 1.0], rising=False),
        (0.999, 1.001),
        closely=False,
    )
    assert branch.ending is Ending.LOST
    assert branch.reason.startswith("just ahead the orbit grazes an event")
    assert branch.points[-1].value == pytest.approx(1.0, abs=1e-7)


def test_a_grazing_is_named_where_the_motion_without_the_event_does_not_come_back():
    """A pendulum, kicked as it passes an angle: its highest point after one kick is that of the next at 0.57079281."""

    def clock(h):
        kick = Event(lambda t, x, h: x[0] - h, lambda t, x, h: [x[0], np.sqrt(x[1] ** 2 + 0.3)], 1)
        rhs = lambda t, x, h: [x[1], -0.1 * x[1] - np.sin(x[0])]  # noqa: E731
        return from_rhs(rhs, 2, None, args=(h,), events=[kick], guess_period=7.0)

    branch = follow(clock, begin(clock, 0.57, [-0.673, 0.0]), (0.57, 0.6))
    assert branch.ending is Ending.LOST
    assert branch.reason.startswith("just ahead the orbit grazes an event")
    assert branch.points[-1].value == pytest.approx(0.57079281, abs=1e-6)


def test_a_grazing_of_a_kink_is_passed():
    """Where a spring begins to act returns are smooth, as its force begins at zero."""
    family = lambda w: forced(w, lambda beyond: 0.5 * np.maximum(beyond, 0.0))  # noqa: E731
    found = locate(family, (0.9, 1.1), [0.0, 1.0])
    assert (found.complete, found.searched, found.remarks) == (True, (0.9, 1.1), ())
    assert follow(family, [0.0, 1.0], (0.9, 1.1)).ending is Ending.LEFT_INTERVAL


def test_passages_of_events_are_counted_that_depend_on_states():
    """The motion sin(t) passes 0.5 twice in a period; what happens at given times, or at an end, does not count."""
    timed, passes = Event(lambda t, x, w: np.sin(t - 1.0)), Event(lambda t, x, w: x[0] - w)
    start = np.array([0.0, 1.0])
    assert list(forced(0.5, events=[timed, passes]).flow_events(start, 0.0, 2.0 * np.pi)) == [2.0]
    assert list(forced(0.0, events=[passes]).flow_events(start, 0.0, 2.0 * np.pi)) == [1.0]
    assert list(forced(0.5).flow_events(start, 0.0, 2.0 * np.pi)) == []


def test_an_event_that_comes_too_late_for_a_return_is_no_grazing():
    """A body with the speed v is at 1 at the time 1 / v, which passes the end of the period, 1, as v passes 1."""
    slowed = Event(lambda t, x: x[0] - 1.0, lambda t, x: [x[0], 0.5 * x[1]], 1)
    moving = from_rhs(lambda t, x: [x[1], 0.0 * x[1]], 2, 1.0, events=[slowed])
    ahead = lambda distance: (moving, np.array([0.0, 1.05 - 1e4 * distance]))  # noqa: E731
    assert [moving.flow_events(ahead(distance)[1], 0.0, 1.0).tolist() for distance in (0.0, 1e-5)] == [[1.0], [0.0]]
    assert event_beside(*ahead(0.0), 1.0, ahead) == ""


def test_a_system_without_events_is_told_of_none():
    """A return jumps beside an orbit, as one that grows by e^T just ahead; the right-hand sides are linear."""

    def ahead(distance):
        return from_rhs(lambda t, x, p: [p * x[0]], 1, 1.0, args=(float(distance > 1e-12),)), np.ones(1)

    system, x = ahead(0.0)
    assert event_beside(system, x, 1.0, ahead) == ""
    counted = lambda distance: (replace(ahead(distance)[0], flow_events=None), x)  # noqa: E731
    assert event_beside(replace(system, flow_events=None), x, 1.0, counted) == JUMPS_AHEAD
