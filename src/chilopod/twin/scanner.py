"""The laser range scanner on module 1 (Hokuyo URG-04LX in the paper), by ray casts, and the detection of a target in a
scan.

Beams leave the scanner in the plane of the body, one at every step of its view. A target is a pole on the floor;
nothing else reaches the height of the scanner. Distances are rounded to the scanner's resolution and have normal noise.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from chilopod.frozen import Array, read_only
from chilopod.robot import Twin
from chilopod.twin.model import POLE_GROUP, scanner_place

_SAME_INSTANT = 1e-9  # scans
_MARGIN = 1e-6  # of the pole's radius, more than round-off
_GROUPS = np.array([group == POLE_GROUP for group in range(6)], dtype=np.uint8)


def beams(twin: Twin) -> Array:
    """Directions of all beams relative to ahead, from right to left, rad, (beams,)."""
    return _beams(twin.scanner_view, twin.scanner_step)[0]


@lru_cache(maxsize=64)
def _beams(view: float, step: float) -> tuple[Array, Array]:
    """Angles of all beams, rad, and their unit vectors in the frame of module 1, (beams, 3), read-only."""
    half = round(0.5 * view / step)
    angles = np.arange(-half, half + 1, dtype=np.float64) * step
    vectors = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)
    return read_only(angles), read_only(vectors)


class Scanner:
    """Scanners of a batch of robots at their start: periodic scans, evaluated on demand.

    The noise has a seed for each robot, which the walk may replace, or is absent.
    """

    def __init__(self, twin: Twin, batch: Batch, seeds: NDArray[np.object_] | None) -> None:
        self._twin, self._batch, self._seeds = twin, batch, seeds
        self._every = twin.scanner_period / twin.control_interval
        self._number, self._poses = 0, batch.bind("qpos")[:, :7].copy()
        self._first: NDArray[np.intp] = np.zeros(len(self._poses), dtype=np.intp)
        self._looked = -1
        self._seen = np.empty((2, len(self._poses)))

    def passed(self, before: int, now: int, poses: Array, ids: NDArray[np.intp]) -> None:
        """Keep the poses of robots for the last scan up to now.

        Times are control intervals since the start. Poses of module 1, position and quaternion, are those at the end of
        every interval from ``before`` on, shape (len(ids), intervals, 7).
        """
        number = int(now / self._every + _SAME_INSTANT)
        while self._tick_of(number) > now:  # the same number, however time is cut
            number -= 1
        if number > self._number:
            self._poses[ids] = poses[:, max(self._tick_of(number) - before - 1, 0)]
            self._number = number

    def _tick_of(self, number: int) -> int:
        """Number of control intervals before a scan."""
        return int(np.ceil(number * self._every - _SAME_INSTANT))

    def restart(self, ids: NDArray[np.intp], anew: bool) -> None:
        """Restart the scanners of robots that were moved; with ``anew`` the noise of their scans begins again."""
        self._poses[ids] = self._batch.bind("qpos")[ids, :7]
        if anew:
            self._first[ids] = self._number
        self.forget()

    def forget(self) -> None:
        """Discard the detections, because the targets were moved."""
        self._looked = -1

    def look(self, ids: NDArray[np.intp]) -> Array:
        """Bearing (rad) and distance (m) of the target in the last scan of some robots, shape (2, len(ids))."""
        if self._number != self._looked:
            noise = None
            if self._seeds is not None:
                size = len(beams(self._twin))
                which = zip(self._seeds[ids].tolist(), (self._number - self._first[ids]).tolist(), strict=True)
                noise = np.stack([np.random.default_rng(each).standard_normal(size) for each in which])
            scans = scan(self._twin, self._batch, self._poses, ids, noise)
            self._seen = np.full((2, len(self._poses)), np.nan)
            self._seen[:, ids] = np.transpose([detect(self._twin, each) for each in scans])
            self._looked = self._number
        return self._seen[:, ids]

    def state(self) -> dict[str, Array]:
        """Complete state, for :meth:`restore`."""
        return {"number": np.array(self._number), "poses": self._poses, "first": self._first}

    def restore(self, state: dict[str, Any]) -> None:
        """Take over the state of scanners of the same robots."""
        self._number, self._poses, self._first = int(state["number"]), state["poses"], state["first"]
        self.forget()


def scan(twin: Twin, batch: Batch, poses: Array, ids: NDArray[np.intp], noise: Array | None = None) -> Array:
    """One scan of some robots: distances, m, shape (len(ids), beams); NaN where nothing is within range.

    Poses of module 1 are those of all robots at the time of the scan, position and quaternion, shape (robots, 7). Noise
    is given as standard normal deviates, shape (len(ids), beams).
    """
    _, local = _beams(twin.scanner_view, twin.scanner_step)
    pose = poses[ids]
    turn = rotation(pose[:, 3:])
    start = pose[:, :3] + turn @ scanner_place(twin)
    away = local @ np.swapaxes(turn, 1, 2)
    # Few beams pass the axis of a pole nearer than its radius: only these are followed.
    pole = batch.bind("mocap_pos")[ids, 0] - start
    beside = np.abs(away[..., 0] * pole[:, 1, None] - away[..., 1] * pole[:, 0, None])
    near = np.flatnonzero((beside <= (1.0 + _MARGIN) * twin.pole_radius).any(axis=0))
    distances = np.full(away.shape[:2], np.nan)
    if not len(near):
        return distances
    found, _ = batch.ray(start[:, None, :], away[:, near], geomgroup=_GROUPS, ids=ids)
    distance = np.where(found < 0.0, np.nan, found)
    if noise is not None:
        distance = distance + twin.scanner_noise * noise[:, near]
    if twin.scanner_resolution > 0.0:
        distance = np.round(distance / twin.scanner_resolution) * twin.scanner_resolution
    distance[~((distance >= twin.scanner_nearest) & (distance <= twin.scanner_range))] = np.nan
    distances[:, near] = distance
    return distances


def detect(twin: Twin, distances: Array) -> tuple[float, float]:
    """Bearing (left positive, rad) and distance (m) of the pole's axis from the centre of module 1 in one scan, m,
    (beams,): the widest run of neighbouring beams that hit something. NaN without a hit."""
    seen = np.flatnonzero(np.isfinite(distances))
    if not len(seen):
        return float("nan"), float("nan")
    runs = np.split(seen, np.flatnonzero(np.diff(seen) > 1) + 1)
    run = max(runs, key=len)
    angles, near = beams(twin)[run], distances[run]
    middle = 0.5 * (angles[0] + angles[-1])
    # Each beam gives an estimate of the axis, which lies in the middle of the run; the mean has the least noise.
    across = near * np.sin(angles - middle)
    beyond = np.sqrt(np.maximum(twin.pole_radius**2 - across**2, 0.0))
    away = float(np.mean(near * np.cos(angles - middle) + beyond))
    x = scanner_place(twin)[0] + away * np.cos(middle)
    y = away * np.sin(middle)
    return float(np.arctan2(y, x)), float(np.hypot(x, y))


def rotation(quaternions: Array) -> Array:
    """Rotation matrices of unit quaternions (w, x, y, z), shape (..., 4) to (..., 3, 3)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions), -1, 0)
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    turn = np.empty((*w.shape, 3, 3))
    for i, j in np.ndindex(3, 3):
        turn[..., i, j] = rows[i][j]
    return turn
