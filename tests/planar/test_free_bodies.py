"""Half a minute of walking, against free bodies held together by joint forces."""

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.planar import PlanarModel
from chilopod.planar.model import carry
from helpers.free_bodies import FreeBodies

N_MM_PER_DEG = 1e-3 * 180 / np.pi
HALF_A_MINUTE = 30.0
# Below the pitchfork at 12 N*mm/deg: the straight walk gives way to a stable curved one, so errors do not grow on.
CURVED = load_robot("aoi2022-planar").with_value("springs.stiffness[0]", 10 * N_MM_PER_DEG)


def walked(model, x, pose, t0, t1):
    """State and pose at t1 by the package."""
    whole = np.concatenate([x, pose])[None]
    carry([model], whole, t0, t1, model.tolerance)
    return whole[0, : model.dimension], whole[0, model.dimension :]


def bent(model, degrees=10.0):
    """The straight walk with joint 1 bent."""
    x = model.orbit.copy()
    x[3] = np.radians(degrees)
    return x


def assert_same_walk(model, ours, theirs, atol=1e-6):
    """Position (m), heading and joint angles (rad) agree."""
    (x, pose), (reduced, place) = ours, theirs
    np.testing.assert_allclose(pose, place, rtol=0, atol=atol)
    joints = slice(3, model.modules + 2)
    np.testing.assert_allclose(x[joints], reduced[joints], rtol=0, atol=atol)


def test_half_a_minute_from_a_small_bend_into_the_curved_walk_agrees_with_free_bodies():
    model, bodies = PlanarModel(CURVED), FreeBodies(CURVED)
    x, pose = bent(model), np.array([0.3, -2.0, 1.1])
    state = bodies.carry(bodies.from_reduced(x, pose), 0.0, HALF_A_MINUTE)
    assert np.abs(bodies.gaps(state)).max() < 1e-12
    ours = walked(model, x, pose, 0.0, HALF_A_MINUTE)
    assert abs(ours[1][2] - pose[2]) > 2.0  # it has turned
    assert_same_walk(model, ours, bodies.to_reduced(state), atol=1e-8)


@pytest.mark.parametrize("seed", [1, 2])
def test_from_a_large_random_state_at_any_time_it_agrees_with_free_bodies(seed):
    model, bodies = PlanarModel(CURVED), FreeBodies(CURVED)
    rng = np.random.default_rng(seed)
    x = np.concatenate([rng.normal(0, 0.5, 3), rng.uniform(-1.2, 1.2, 5), rng.normal(0, 5, 5)])
    pose, start, end = rng.normal(size=3), *(rng.uniform(0, 1) + np.array([0.0, 3.0]))
    theirs = bodies.to_reduced(bodies.carry(bodies.from_reduced(x, pose), start, end))
    assert_same_walk(model, walked(model, x, pose, start, end), theirs, atol=1e-8)
