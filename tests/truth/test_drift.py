"""Drift of motions whose path is known: constant body velocity (v, w) runs along a circle of radius v/w."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod.planar import Drift


def arc(speed, rate, period, sideways=0.0):
    """Displacement after a period at constant velocity (speed, sideways) in a frame that turns at ``rate``."""
    turn = rate * period
    if turn == 0.0:
        return Drift(speed * period, sideways * period, 0.0, period)
    along, across = math.sin(turn) / rate, 2.0 * math.sin(0.5 * turn) ** 2 / rate
    return Drift(speed * along - sideways * across, speed * across + sideways * along, turn, period)


speeds = st.floats(1e-3, 10.0)
periods = st.floats(0.05, 5.0)
turns = st.floats(1e-9, 3.0).flatmap(lambda turn: st.sampled_from([turn, -turn]))


@given(speeds, turns, periods)
def test_radius_speed_and_heading_rate_of_a_circle(speed, turn, period):
    rate = turn / period
    drift = arc(speed, rate, period)
    assert drift.radius == pytest.approx(speed / abs(rate), rel=1e-13)
    assert drift.speed == pytest.approx(speed, rel=1e-13)
    assert drift.heading_rate == pytest.approx(rate, rel=1e-13)


@given(speeds, st.floats(-10.0, 10.0), turns, periods)
def test_a_walk_that_also_slides_sideways(speed, sideways, turn, period):
    drift = arc(speed, turn / period, period, sideways)
    assert drift.radius == pytest.approx(math.hypot(speed, sideways) * period / abs(turn), rel=1e-13)
    assert drift.speed == pytest.approx(math.hypot(speed, sideways), rel=1e-13)


@given(speeds, periods)
def test_a_straight_walk_has_no_circle(speed, period):
    drift = arc(speed, 0.0, period)
    assert drift.radius == math.inf
    assert drift.heading_rate == 0.0
    assert drift.speed == pytest.approx(speed, rel=1e-15)


@given(turns, periods)
def test_turning_on_the_spot_has_radius_zero(turn, period):
    drift = Drift(0.0, 0.0, turn, period)
    assert drift.radius == 0.0
    assert drift.speed == 0.0


@pytest.mark.parametrize("turn", [0.5, -0.5, 3.0, 4.0, -5.5, 6.0])
def test_speed_and_radius_are_positive_however_far_a_period_turns(turn):
    drift = arc(0.3, turn / 2.0, 2.0)
    assert drift.radius == pytest.approx(0.6 / abs(turn), rel=1e-12)
    assert drift.speed == pytest.approx(0.3, rel=1e-12)
