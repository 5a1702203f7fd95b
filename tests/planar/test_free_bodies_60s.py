"""A minute of walking: against free bodies held together by joint forces, and against ten times finer steps."""

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.integrate import integrator
from chilopod.planar import PlanarModel
from chilopod.planar.model import carry
from helpers.free_bodies import FreeBodies

N_MM_PER_DEG = 1e-3 * 180 / np.pi
MINUTE = 60.0
# Below the pitchfork at 12 N*mm/deg: the straight walk gives way to a stable curved one, so errors do not grow on.
CURVED = load_robot("aoi2022-planar").with_value("springs.stiffness[0]", 10 * N_MM_PER_DEG)


def walked(model, x, pose, t0, t1):
    """State and pose at t1 by the package."""
    whole = np.concatenate([x, pose])[None]
    carry([model], whole, t0, t1, model.tolerance)
    return whole[0, : model.dimension], whole[0, model.dimension :]


def bent(model, degrees=2.0):
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


def test_a_minute_from_a_small_bend_into_the_curved_walk_agrees_with_free_bodies():
    model, bodies = PlanarModel(CURVED), FreeBodies(CURVED)
    x, pose = bent(model), np.array([0.3, -2.0, 1.1])
    state = bodies.carry(bodies.from_reduced(x, pose), 0.0, MINUTE)
    assert np.abs(bodies.gaps(state)).max() < 1e-12
    ours = walked(model, x, pose, 0.0, MINUTE)
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


class Finer(PlanarModel):
    """The same robot, every piece between two switches cut into equal parts that no step can exceed."""

    parts = 1

    def _pieces(self, t0, t1):
        starts, widths, interval = super()._pieces(t0, t1)
        cut = widths[:, None] / self.parts
        fine = starts[:, None] + cut * np.arange(self.parts)
        return fine.ravel(), np.repeat(cut, self.parts), np.repeat(interval, self.parts)


def most_steps_in_a_piece(model, x):
    """Steps that the integrator takes at the model's tolerance between two switches: the most within a period."""
    calls = 0

    def counted(t, x, args, out):
        nonlocal calls
        calls += 1
        start, width = args
        out[:] = model.rhs(start + min(t, width * (1 - 1e-9)), x)

    integrate = integrator(counted, on_disk=False).py_func  # interpreted: a period is enough
    work, h, most = np.empty((16, x.size)), 0.0, 0
    switches = model.schedule.times
    for start, width in zip(switches[:-1], np.diff(switches), strict=True):
        calls = 0
        h, reached = integrate((start, width), x, 0.0, width, h, model.tolerance, work)
        assert reached
        most = max(most, calls // 12)
    return most


def test_a_minute_at_the_default_tolerance_agrees_with_steps_ten_times_finer():
    model, finer = PlanarModel(CURVED), Finer(CURVED)
    x, pose = bent(model), np.zeros(3)
    end, place = walked(model, x, pose, 0.0, MINUTE)
    finer.parts = 10 * max(most_steps_in_a_piece(model, bent(model)), most_steps_in_a_piece(model, end.copy()))
    for _ in range(round(MINUTE / model.period)):
        x, pose = walked(finer, x, pose, 0.0, model.period)
    assert_same_walk(model, (end, place), (x, pose))
