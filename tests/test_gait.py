"""The gait: phases, contact pattern and foot positions, against the definition evaluated at many times."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod import Gait, Ground, ParameterError, UnitError

PAPER = {"stride": "3 cm", "stance": "0.31 s", "swing": "0.29 s", "module_phase": "120 deg", "side_phase": "180 deg"}

gaits = st.builds(
    Gait,
    stride=st.floats(1e-3, 1.0),
    stance=st.floats(0.01, 2.0),
    swing=st.floats(0.01, 2.0),
    module_phase=st.floats(-2 * math.pi, 2 * math.pi) | st.integers(-12, 12).map(lambda n: n * math.pi / 6),
    side_phase=st.floats(-2 * math.pi, 2 * math.pi) | st.sampled_from([0.0, math.pi, math.pi / 2]),
)


def test_numbers_of_the_paper():
    gait = Gait(**PAPER)
    assert gait.period == pytest.approx(0.6)
    assert gait.duty == pytest.approx(0.31 / 0.6)
    assert gait.speed == pytest.approx(0.03 / 0.31)
    assert gait.half_period_symmetric
    assert not Gait(**{**PAPER, "side_phase": "179 deg"}).half_period_symmetric
    assert Gait(**{**PAPER, "side_phase": "-180 deg"}).half_period_symmetric


def test_round_off_in_phases_makes_no_extra_legs_or_switches():
    gait = Gait(**PAPER)
    np.testing.assert_allclose(gait.leg_phases(4)[:, 0], [0.0, 1 / 3, 2 / 3, 0.0], rtol=0, atol=1e-15)
    assert gait.leg_phases(1000)[999, 0] == 0.0
    schedule = gait.schedule(1000)
    np.testing.assert_allclose(
        schedule.times, [0.0, 0.01, 0.1, 0.11, 0.2, 0.21, 0.3, 0.31, 0.4, 0.41, 0.5, 0.51, 0.6], rtol=0, atol=1e-12
    )
    assert schedule.times[-1] == gait.period
    np.testing.assert_array_equal(schedule.contact[:, 0], schedule.contact[:, 999])


def test_half_a_period_later_the_sides_have_changed_places():
    gait = Gait(**PAPER)
    whole, half = gait.schedule(6), gait.schedule(6, gait.period / 2)
    segments = len(half.times) - 1
    np.testing.assert_allclose(whole.times[segments:] - gait.period / 2, half.times, atol=1e-15)
    np.testing.assert_array_equal(whole.contact[segments:], half.contact[:, :, ::-1])
    np.testing.assert_allclose(whole.stroke[segments:], half.stroke[:, :, ::-1], atol=1e-15)


@given(gaits, st.integers(2, 12), st.sampled_from([0.5, 1.0, 2.3]))
def test_schedule_is_what_the_phases_say(gait, modules, cycles):
    duration = cycles * gait.period
    schedule = gait.schedule(modules, duration)
    assert schedule.times[0] == 0.0
    assert schedule.times[-1] == duration
    assert (np.diff(schedule.times) > 0.0).all()
    # At random moments, compare with the definition, unless a leg is just switching.
    for t in np.random.default_rng(0).uniform(0.0, duration, 50):
        phase = (t / gait.period + gait.leg_phases(modules)) % 1.0
        segment = np.searchsorted(schedule.times, t, side="right") - 1
        clear = (np.minimum(phase, 1.0 - phase) > 1e-9) & (abs(phase - gait.duty) > 1e-9)
        standing = schedule.contact[segment]
        np.testing.assert_array_equal(standing[clear], (phase < gait.duty)[clear])
        position = schedule.stroke[segment] - gait.speed * (t - schedule.times[segment])
        expected = gait.stride * (0.5 - phase / gait.duty)
        clear &= standing
        np.testing.assert_allclose(position[clear], expected[clear], rtol=0, atol=1e-11 * gait.stride / gait.duty)
    assert (schedule.stroke[~schedule.contact] == 0.0).all()
    assert (abs(schedule.stroke) <= gait.stride * 0.5 * (1.0 + 1e-12)).all()


@given(gaits, st.integers(2, 8))
def test_touch_down_is_at_the_front(gait, modules):
    schedule = gait.schedule(modules)
    landed = schedule.contact[1:] & ~schedule.contact[:-1]
    np.testing.assert_allclose(schedule.stroke[1:][landed], gait.stride / 2, rtol=1e-10)


def test_schedules_are_shared_and_read_only():
    gait = Gait(**PAPER)
    schedule = gait.schedule(6)
    assert schedule is Gait(**PAPER).schedule(6)
    for array in (schedule.times, schedule.contact, schedule.stroke):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("change", "error", "complaint"),
    [
        ({"stride": "3 kg"}, UnitError, "stride = '3 kg': is a mass"),
        ({"stance": 0.0}, ParameterError, "stance = 0.0: must be positive"),
        ({"swing": "-1 s"}, ParameterError, "swing = '-1 s': must be positive"),
        ({"module_phase": "400 deg"}, ParameterError, "out of range; allowed: -360 deg to 360 deg"),
        ({"side_phase": math.nan}, UnitError, "side_phase = nan"),
        ({"strid": 1.0}, ParameterError, "unknown key; did you mean 'stride'?"),
    ],
)
def test_refuses(change, error, complaint):
    with pytest.raises(error) as caught:
        Gait(**{**PAPER, **change})
    assert complaint in str(caught.value)


def test_schedule_refuses_nonsense():
    gait = Gait(**PAPER)
    with pytest.raises(ParameterError, match="modules"):
        gait.schedule(0)
    for duration in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ParameterError, match="duration"):
            gait.schedule(6, duration)


def test_ground():
    assert Ground(friction="0.2565 N*s/mm").friction == 256.5
    with pytest.raises(ParameterError, match="friction = 0: must be positive; allowed: more than 0"):
        Ground(friction=0)
    with pytest.raises(ParameterError, match="friction: is missing"):
        Ground()


@given(gaits)
def test_stroke_goes_back_at_the_gaits_speed_and_swings_forward_again(gait):
    standing = np.linspace(0.0, gait.duty, 50, endpoint=False)
    assert gait.stands(standing).all()
    expected = 0.5 * gait.stride - gait.speed * gait.period * standing
    np.testing.assert_allclose(gait.stroke(standing), expected, rtol=0, atol=1e-12 * gait.stride)
    swinging = np.linspace(gait.duty, 1.0, 50)
    assert not gait.stands(swinging).any()
    forward = gait.stroke(swinging)
    assert (np.diff(forward) > 0.0).all()
    np.testing.assert_allclose(forward[[0, -1]], [-0.5 * gait.stride, 0.5 * gait.stride], rtol=1e-12)


def test_schedule_is_that_of_the_phases():
    gait = Gait(**PAPER)
    schedule = gait.schedule(6)
    middle = 0.5 * (schedule.times[:-1] + schedule.times[1:])
    phase = gait.phases(middle, 6)
    assert phase.shape == schedule.stroke.shape
    np.testing.assert_array_equal(gait.stands(phase), schedule.contact)
    moved = schedule.stroke - gait.speed * (middle - schedule.times[:-1])[:, None, None]
    np.testing.assert_allclose(gait.stroke(phase)[schedule.contact], moved[schedule.contact], rtol=0, atol=1e-15)
