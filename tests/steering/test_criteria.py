"""Criteria on made-up paths, whose outcome and integrals are known."""

import numpy as np
import pytest
import xarray as xr

from chilopod.planar import simulate
from chilopod.record import bearing_and_distance
from chilopod.robot import load_robot
from chilopod.steering import LegYawController, Outcome, Target, earliest_arrival, evaluate

TARGET = Target.parse("45 deg, 1.3 m")
TIME = np.linspace(0.0, 20.0, 2001)


def circle(radius, speed=0.1):
    """A walk along a circle to the left (radius > 0) or right, at constant speed; infinite for straight on."""
    if np.isinf(radius):
        return np.stack([speed * TIME, 0.0 * TIME], -1), 0.0 * TIME
    angle = speed * TIME / radius
    return radius * np.stack([np.sin(angle), 1.0 - np.cos(angle)], -1), angle


def record(*walks, target=TARGET):
    sign = -1.0 if target.bearing < 0 else 1.0
    places = np.stack([place * [1.0, sign] for place, _ in walks], axis=1)
    headings = sign * np.stack([heading for _, heading in walks], axis=1)
    bearing, distance = bearing_and_distance(places, headings, target.position)
    over = ("time", "robot")
    return xr.Dataset({"distance": (over, distance), "bearing": (over, bearing)}, coords={"time": TIME})


@pytest.mark.parametrize("bearing", [45.0, -45.0])
def test_outcomes(bearing):
    target = Target(np.deg2rad(bearing), 1.3)
    # The circle itself, one too wide, one too tight, straight on.
    paths = [circle(target.radius), circle(1.5), circle(0.55), circle(np.inf)]
    broken = circle(0.55)[0].copy(), circle(0.55)[1].copy()
    broken[0][700:] = np.nan
    broken[1][700:] = np.nan
    result = evaluate(record(*paths, broken, target=target), 14.0)
    assert result.outcome == (Outcome.ARRIVED, Outcome.OUTSIDE, Outcome.INSIDE, Outcome.OUTSIDE, Outcome.FAILED)
    assert np.isnan(result.distance[4])
    assert np.isnan(result.effort[4])


def test_arrival_and_the_first_two_criteria_on_the_circle_and_on_a_straight_line():
    data = record(circle(TARGET.radius), circle(np.inf))
    # The chord left is 0.15 m after the arc whose remaining half angle has sin = 0.15 / (2 r).
    left = 2.0 * np.arcsin(0.15 / (2.0 * TARGET.radius))
    expected = TARGET.radius * (2.0 * TARGET.bearing - left) / 0.1
    assert earliest_arrival(data) == pytest.approx(expected, abs=1e-4)
    result = evaluate(data, 9.1234)
    # On the circle the bearing is half the arc that is left, on the line it is plain geometry.
    assert result.angle[0] == pytest.approx(TARGET.bearing - 0.05 * 9.1234 / TARGET.radius, abs=1e-6)
    away = TARGET.position - [0.91234, 0.0]
    assert result.distance[1] == pytest.approx(np.hypot(*away), abs=1e-6)
    assert result.angle[1] == pytest.approx(np.arctan2(away[1], away[0]), abs=1e-6)
    assert result.nearest == pytest.approx([0.0, TARGET.position[1]], abs=1e-3)


def test_nobody_arrives():
    assert np.isnan(earliest_arrival(record(circle(np.inf))))


def test_an_angle_is_taken_between_samples_across_the_back():
    data = record(circle(np.inf)).isel(time=[0, 1])
    data["bearing"] = (("time", "robot"), np.deg2rad([[179.0], [-179.0]]))
    assert np.rad2deg(evaluate(data, float(TIME[1]) / 2).angle[0]) == pytest.approx(180.0)


@pytest.mark.parametrize("until", [0.3, 4.44, 7.777, 12.0])
def test_effort_is_the_integral_of_the_squared_yaw(until):
    robot = load_robot("aoi2022-planar")
    data = simulate(
        [robot, robot.set_from_text(["springs.stiffness[0]=9 N*mm/deg"])],
        12.0,
        controller=LegYawController(),
        target=[(0.6, 0.05), (0.5, 0.3)],
        rate=4000.0,
    )
    time, square = data.time.values, (data.leg_yaw.values**2).sum(axis=2)
    upto = time <= until + 1e-9
    fine = np.trapezoid(square[upto], time[upto], axis=0)
    assert evaluate(data, until).effort == pytest.approx(fine, rel=1e-6, abs=3e-6)
    assert fine.max() > 0.0 or until < 0.4
