"""The scanner: what it says of the pole against where the pole is, and what happens when it is not seen."""

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from chilopod import load_robot
from chilopod.record import bearing_and_distance
from chilopod.steering import LegYawController
from chilopod.twin import TwinModel, initial_states, simulate
from chilopod.twin.model import POLE_GROUP, scanner_place
from chilopod.twin.scanner import beams, detect, rotation, scan

PRESET = load_robot("aoi2022")
TWIN = PRESET.twin
FARTHEST = TWIN.scanner_range + TWIN.pole_radius


def placed(positions, headings, poles):
    """A batch of robots at these places, each with its pole."""
    count = len(poles)
    batch = Batch(TwinModel(PRESET).model, count, 1)
    batch.bind("qpos")[:] = initial_states(PRESET, 0.0, np.broadcast_to(headings, count), positions)
    batch.bind("mocap_pos")[:, 0] = np.column_stack([poles, np.zeros(count)])
    return batch


def seen_from(positions, headings, bearings, distances):
    """Place of poles that lie in these directions, at these distances from the scanner."""
    ahead = np.stack([np.cos(headings), np.sin(headings)], -1)
    away = np.stack([np.cos(headings + bearings), np.sin(headings + bearings)], -1)
    return positions + TWIN.scanner_offset * ahead + distances[:, None] * away


def random_scenes(seed, count=200):
    rng = np.random.default_rng(seed)
    positions, headings = rng.uniform(-5.0, 5.0, (count, 2)), rng.uniform(-np.pi, np.pi, count)
    bearings = np.radians(rng.uniform(-115.0, 115.0, count))
    distances = rng.uniform(0.15, 4.0, count)
    return positions, headings, seen_from(positions, headings, bearings, distances), rng


def poses(batch):
    """Of module 1."""
    return batch.bind("qpos")[:, :7]


def found_in(batch, noise=None):
    ids = np.arange(batch.nsim)
    return np.array([detect(TWIN, each) for each in scan(TWIN, batch, poses(batch), ids, noise)]).T


def test_beams_are_those_of_the_sensor():
    angles = np.degrees(beams(TWIN))
    assert len(angles) == 683
    np.testing.assert_allclose(np.diff(angles), 0.352)
    np.testing.assert_allclose(angles[[0, -1]], [-120.0, 120.0], atol=0.176)


def test_without_noise_the_pole_is_where_it_is():
    positions, headings, poles, _ = random_scenes(0)
    bearing, distance = found_in(placed(positions, headings, poles))
    true_bearing, true_distance = bearing_and_distance(positions, headings, poles)
    # A beam falls on the rim or past it: half a step, seen from the scanner; a little more from the module's centre.
    assert np.abs(bearing - true_bearing).max() < 0.75 * TWIN.scanner_step
    # Far away the pole is a few beams wide, and its middle known to half a step only.
    assert np.abs(distance - true_distance).max() < 5e-3
    assert np.median(np.abs(distance - true_distance)) < 5e-4


def test_noise_moves_distances_as_much_as_the_beams_on_the_pole_let_it():
    positions, headings, poles, rng = random_scenes(1)
    noise = rng.standard_normal((len(poles), len(beams(TWIN))))
    bearing, distance = found_in(placed(positions, headings, poles), noise)
    true_bearing, true_distance = bearing_and_distance(positions, headings, poles)
    from_scanner = np.linalg.norm(poles - seen_from(positions, headings, np.zeros(200), np.zeros(200)), axis=1)
    hits = 2.0 * np.arcsin(TWIN.pole_radius / from_scanner) / TWIN.scanner_step
    expected = TWIN.scanner_noise / np.sqrt(np.maximum(hits, 1.0))
    error = distance - true_distance
    assert (np.abs(error) < 5.0 * expected + 2e-3).all()
    assert np.std(error / expected) == pytest.approx(1.0, abs=0.2)
    assert np.abs(bearing - true_bearing).max() < 0.75 * TWIN.scanner_step


@pytest.mark.parametrize(
    ("bearing", "distance"),
    [(180.0, 1.0), (125.0, 1.0), (-125.0, 1.0), (0.0, FARTHEST + 2e-3), (60.0, 20.0), (0.0, 0.06)],
)
def test_out_of_view_is_nothing(bearing, distance):
    start = np.array([[0.4, -0.3]])
    pole = seen_from(start, np.array([0.7]), np.radians([bearing]), np.array([distance]))
    assert np.isnan(found_in(placed(start, 0.7, pole))).all()


@pytest.mark.parametrize(("bearing", "distance"), [(119.0, 1.0), (-119.0, 1.0), (0.0, FARTHEST - 5e-3), (0.0, 0.1)])
def test_the_edges_of_the_view_are_seen(bearing, distance):
    start = np.array([[0.4, -0.3]])
    pole = seen_from(start, np.array([0.7]), np.radians([bearing]), np.array([distance]))
    assert np.isfinite(found_in(placed(start, 0.7, pole))).all()


def test_neither_floor_nor_robot_is_seen_even_when_it_nods():
    batch = placed(np.zeros((3, 2)), 0.0, np.full((3, 2), 30.0))
    batch.bind("qpos")[:, 3:7] = [[np.cos(a), 0.0, np.sin(a), 0.0] for a in (-0.05, 0.03, 0.1)]
    assert np.isnan(scan(TWIN, batch, poses(batch), np.arange(3))).all()


def test_beams_that_are_left_out_would_hit_nothing():
    positions, headings, poles, rng = random_scenes(3, count=100)
    batch = placed(positions, headings, poles)
    tilts = rng.normal(0.0, 0.1, (100, 4)) + batch.bind("qpos")[:, 3:7]
    batch.bind("qpos")[:, 3:7] = tilts / np.linalg.norm(tilts, axis=1, keepdims=True)
    angles, turns = beams(TWIN), rotation(poses(batch)[:, 3:])
    local = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=-1)
    away = local @ np.swapaxes(turns, 1, 2)
    start = poses(batch)[:, :3] + turns @ scanner_place(TWIN)
    whole, _ = batch.ray(start[:, None], away, geomgroup=np.arange(6) == POLE_GROUP)
    for row in range(100):  # one at a time, as the beams that are followed are those of all
        (found,) = scan(TWIN, batch, poses(batch), np.array([row]))
        hit = (whole[row] >= TWIN.scanner_nearest) & (whole[row] <= TWIN.scanner_range)
        expected = np.round(whole[row] / TWIN.scanner_resolution) * TWIN.scanner_resolution
        np.testing.assert_array_equal(found, np.where(hit, expected, np.nan))


def test_distances_are_rounded_to_the_resolution():
    batch = placed(np.zeros((1, 2)), 0.0, np.array([[1.0, 0.2]]))
    found = scan(TWIN, batch, poses(batch), np.arange(1), np.random.default_rng(2).standard_normal((1, 683)))
    steps = found[np.isfinite(found)] / TWIN.scanner_resolution
    assert len(steps) > 5
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)


def test_rotations_are_those_of_mujoco():
    rng = np.random.default_rng(3)
    quaternions = rng.normal(size=(5, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    for quaternion, found in zip(quaternions, rotation(quaternions), strict=True):
        expected = np.empty(9)
        mujoco.mju_quat2Mat(expected, quaternion)
        np.testing.assert_allclose(found, expected.reshape(3, 3), rtol=0, atol=1e-15)


def steered(target, duration=2.5, **arguments):
    return simulate(PRESET, duration, controller=LegYawController(), target=target, rate=100.0, **arguments)


def test_the_controller_sees_the_last_scan():
    record = steered((1.5, 0.8), seeds=[5])
    for event, when in enumerate(record.event.values):
        scanned = np.floor(when / TWIN.scanner_period + 1e-9) * TWIN.scanner_period
        there = record.sel(time=scanned, method="nearest").isel(robot=0)
        assert abs(float(there.bearing - record.seen_bearing[event, 0])) < 2.0 * TWIN.scanner_step
        assert abs(float(there.distance - record.seen_distance[event, 0])) < 2.0 * TWIN.scanner_noise


def test_leg_yaw_stays_as_it_is_while_the_pole_is_unseen():
    behind = steered((-2.0, 0.1))
    assert np.isnan(behind.seen_bearing).all()
    assert np.isnan(behind.seen_distance).all()
    assert not behind.command.any()
    assert (behind.status == "walked").all()
    # A pole that goes out of view on the left: both legs stay turned as they last were.
    passed = steered((-0.14, 0.42), duration=3.5)
    seen = np.isfinite(passed.seen_bearing.values[:, 0])
    assert seen[0]
    assert not seen[-1]
    assert (np.diff(seen.astype(int)) <= 0).all()
    last = passed.command.values[np.flatnonzero(seen)[-1], 0]
    np.testing.assert_allclose(last, np.radians(5.0))
    np.testing.assert_array_equal(passed.command.values[~seen, 0], np.tile(last, ((~seen).sum(), 1)))


def test_noise_belongs_to_the_seed_and_not_to_the_company():
    together = steered((1.5, 0.8), seeds=[7, 8, 7], duration=1.5)
    alone = steered((1.5, 0.8), seeds=[8], duration=1.5)
    exact = steered((1.5, 0.8), duration=1.5)
    seen = together.seen_distance.values
    np.testing.assert_array_equal(seen[:, 1], alone.seen_distance.values[:, 0])
    np.testing.assert_array_equal(seen[:, 0], seen[:, 2])
    assert (seen[:, 0] != seen[:, 1]).all()
    assert (seen[:, 1] != exact.seen_distance.values[:, 0]).any()
    np.testing.assert_array_equal(together.position.values[:, 1], alone.position.values[:, 0])
