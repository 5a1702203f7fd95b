"""Steered walks know neither where on the floor they are nor left from right."""

import numpy as np
import pytest

from chilopod.planar import PlanarModel, initial_states, simulate
from chilopod.robot import load_robot
from chilopod.steering import LegYawController

ROBOT = load_robot("aoi2022-planar").set_from_text(["springs.stiffness[0]=10 N*mm/deg"])
TARGET = np.array([0.9, 0.7])
ANGLES = np.deg2rad([1.0, -0.5, 0.3, 0.8, -1.0])
EVENTS = 50


def test_a_moved_and_turned_world_gives_the_moved_and_turned_record():
    rng = np.random.default_rng(3)
    noise, friction = 0.01 * rng.standard_normal((1, EVENTS)), np.exp(0.02 * rng.standard_normal((6, 2)))
    turn, place = 2.3, np.array([-4.0, 7.0])
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    here, there = (
        simulate(
            ROBOT,
            12.0,
            initial=initial_states(ROBOT, ANGLES, heading, position),
            friction=friction,
            controller=LegYawController(),
            target=target,
            bearing_noise=noise,
            tolerance=1e-10,
        )
        for heading, position, target in ((0.1, (0.0, 0.0), TARGET), (0.1 + turn, place, matrix @ TARGET + place))
    )
    moved = here.position.values @ matrix.T + place
    assert there.position.values == pytest.approx(moved, abs=1e-8)
    assert there.heading.values == pytest.approx(here.heading.values + turn, abs=1e-8)
    for name in ("joint_angle", "leg_yaw", "distance", "bearing"):
        assert there[name].values == pytest.approx(here[name].values, abs=1e-8), name


def test_the_mirror_image_half_a_period_later():
    """Left and right legs swap roles half a period later: a walk from then on, mirrored, is a walk from the start."""
    rng = np.random.default_rng(4)
    noise, friction = 0.01 * rng.standard_normal((1, EVENTS)), np.exp(0.02 * rng.standard_normal((6, 2)))
    half, rate = 0.5 * ROBOT.gait.period, 10.0

    def walk(initial, duration, friction, target, noise):
        return simulate(
            ROBOT,
            duration,
            initial=initial,
            friction=friction,
            controller=LegYawController(),
            target=target,
            bearing_noise=noise,
            rate=rate,
            tolerance=1e-11,
        )

    start = initial_states(ROBOT, ANGLES, 0.1)
    # The one event before half a period (of the right leg) is to see nothing to do: its noise cancels the bearing.
    first = walk(start, 0.25, friction, TARGET, np.zeros((1, 1)))
    assert first.sizes["event"] == 1
    at = float(first.event[0])
    until = simulate(ROBOT, at, initial=start, friction=friction, rate=1.0 / at, target=TARGET, tolerance=1e-12)
    noise[0, 0] = -float(until.bearing[-1, 0])
    later = walk(start, 12.0 + half, friction, TARGET, noise)
    assert float(np.abs(later.leg_yaw.sel(time=slice(0.0, half))).max()) < 1e-8

    # State, place and heading at half a period, mirrored, start the other walk.
    model = PlanarModel(ROBOT, tolerance=1e-13)
    sample = later.isel(robot=0, time=round(half * rate))
    state = np.concatenate(
        [
            [
                np.cos(sample.heading) * sample.velocity[0] + np.sin(sample.heading) * sample.velocity[1],
                np.cos(sample.heading) * sample.velocity[1] - np.sin(sample.heading) * sample.velocity[0],
                sample.heading_rate,
            ],
            sample.joint_angle,
            sample.joint_rate,
        ]
    )
    mirrored = np.concatenate(
        [model.reflection @ state, [sample.position[0], -sample.position[1], -sample.heading]]
    ).astype(float)
    other = walk(mirrored, 12.0, friction[:, ::-1], TARGET * [1.0, -1.0], -noise[:, 1:])
    shifted = later.isel(time=slice(round(half * rate), None))
    assert other.position.values == pytest.approx(shifted.position.values * [1.0, -1.0], abs=1e-6)
    assert other.joint_angle.values == pytest.approx(-shifted.joint_angle.values, abs=1e-6)
    assert other.leg_yaw.values == pytest.approx(-shifted.leg_yaw.values[..., ::-1], abs=1e-6)
    assert float(np.abs(other.leg_yaw).max()) > 0.08
