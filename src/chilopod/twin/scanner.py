"""The laser range scanner on module 1 (Hokuyo URG-04LX in the paper), by ray casts, and what it makes of a target.

Beams leave the scanner in the plane of the body, one every step of its view. A target is a pole on the floor; nothing
else is as high as the scanner. Distances are rounded to the scanner's resolution and have normal noise.
"""

from __future__ import annotations

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from chilopod.robot import Twin
from chilopod.twin.model import POLE_GROUP, scanner_place

Array = NDArray[np.float64]

_GROUPS = np.array([group == POLE_GROUP for group in range(6)], dtype=np.uint8)


def beams(twin: Twin) -> Array:
    """Directions of all beams relative to ahead, from right to left, rad, (beams,)."""
    half = round(0.5 * twin.scanner_view / twin.scanner_step)
    return np.arange(-half, half + 1, dtype=np.float64) * twin.scanner_step


def scan(twin: Twin, batch: Batch, ids: NDArray[np.intp], noise: Array | None = None) -> Array:
    """One scan of every robot.

    Parameters
    ----------
    twin
        The scanner.
    batch
        The robots.
    ids
        Which of them.
    noise
        Standard normal deviates, shape (len(ids), beams); None for a scanner without noise.

    Returns
    -------
    Distances, m, shape (len(ids), beams); NaN where there is nothing within range.
    """
    angles = beams(twin)
    local = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)
    pose = batch.bind("qpos")[ids, :7]
    turn = rotation(pose[:, 3:])
    start = pose[:, :3] + turn @ scanner_place(twin)
    away = local @ np.swapaxes(turn, 1, 2)
    found, _ = batch.ray(start[:, None, :], away, geomgroup=_GROUPS, ids=ids)
    distance = np.where(found < 0.0, np.nan, found)
    if noise is not None:
        distance = distance + twin.scanner_noise * noise
    if twin.scanner_resolution > 0.0:
        distance = np.round(distance / twin.scanner_resolution) * twin.scanner_resolution
    distance[~((distance >= twin.scanner_nearest) & (distance <= twin.scanner_range))] = np.nan
    return distance


def detect(twin: Twin, distances: Array) -> tuple[float, float]:
    """Where the pole is in one scan: the widest run of neighbouring beams that see something.

    Parameters
    ----------
    twin
        The scanner and the pole's radius.
    distances
        One scan, m, (beams,).

    Returns
    -------
    Bearing (left positive, rad) and distance (m) of the pole's axis from the centre of module 1; NaN if it is not seen.
    """
    seen = np.flatnonzero(np.isfinite(distances))
    if not len(seen):
        return float("nan"), float("nan")
    runs = np.split(seen, np.flatnonzero(np.diff(seen) > 1) + 1)
    run = max(runs, key=len)
    angles, near = beams(twin)[run], distances[run]
    middle = 0.5 * (angles[0] + angles[-1])
    # Each beam says where the axis is, if the axis is in the middle of the run; their mean has the least noise.
    across = near * np.sin(angles - middle)
    beyond = np.sqrt(np.maximum(twin.pole_radius**2 - across**2, 0.0))
    away = float(np.mean(near * np.cos(angles - middle) + beyond))
    x = scanner_place(twin)[0] + away * np.cos(middle)
    y = away * np.sin(middle)
    return float(np.arctan2(y, x)), float(np.hypot(x, y))


def rotation(quaternions: Array) -> Array:
    """Rotation matrices of unit quaternions (w, x, y, z), shape (..., 4) to (..., 3, 3)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions), -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
