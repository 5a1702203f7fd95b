"""Places and velocities of modules and feet: the ones are the derivatives of the others."""

import numpy as np
import pytest

from chilopod.kinematics import (
    foot_places,
    foot_velocities,
    from_modules,
    module_centres,
    module_headings,
    module_velocities,
)

LENGTH, OFFSET, WIDTH, SPEED = 0.225, 0.045, 0.073, 0.0968


def test_joints_are_where_modules_meet():
    rng = np.random.default_rng(0)
    headings = module_headings(rng.normal(size=4), rng.normal(size=(4, 5)))
    centres = module_centres(rng.normal(size=(4, 2)), headings, LENGTH)
    half = 0.5 * LENGTH * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    np.testing.assert_allclose((centres - half)[:, :-1], (centres + half)[:, 1:], rtol=0, atol=1e-15)


@pytest.mark.parametrize("yawed", [False, True])
def test_velocities_are_derivatives_of_places(yawed):
    rng = np.random.default_rng(1)
    position, heading, angles = rng.normal(size=2), rng.normal(), rng.normal(size=5)
    velocity, rate, rates = rng.normal(size=2), rng.normal(), rng.normal(size=5)
    stroke = rng.uniform(-0.015, 0.015, (6, 2))
    yaw = rng.normal(size=(6, 2)) if yawed else np.zeros((6, 2))

    def feet(t):
        headings = module_headings(heading + rate * t, angles + rates * t)
        centres = module_centres(position + velocity * t, headings, LENGTH)
        return centres, from_modules(centres, headings, foot_places(OFFSET, WIDTH, stroke - SPEED * t, yaw))

    headings, turning = module_headings(heading, angles), module_headings(rate, rates)
    moving = module_velocities(velocity, headings, turning, LENGTH)
    slip = from_modules(moving, headings, foot_velocities(foot_places(OFFSET, WIDTH, stroke, yaw), turning, SPEED, yaw))
    step = 1e-5
    (centres0, feet0), (centres1, feet1) = feet(-step), feet(step)
    np.testing.assert_allclose(moving, (centres1 - centres0) / (2.0 * step), rtol=0, atol=1e-8)
    np.testing.assert_allclose(slip, (feet1 - feet0) / (2.0 * step), rtol=0, atol=1e-8)
