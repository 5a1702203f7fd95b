"""What is written down of a walk: places, angles, rates and foot forces over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.planar.model import PlanarModel
from chilopod.record import walk_record

Array = NDArray[np.float64]


def planar_record(model: PlanarModel, samples: Array, states: Array, leg_yaw: Array) -> xr.Dataset:
    """States over time as named quantities on the floor, see :func:`chilopod.record.walk_record`.

    Parameters
    ----------
    model
        Any of the robots.
    samples
        s, shape (samples,).
    states
        With poses, shape (samples, robots, 2N+4).
    leg_yaw
        rad, shape (samples, robots, 2).
    """
    n = model.modules
    heading = states[..., 2 * n + 3]
    c, s = np.cos(heading), np.sin(heading)
    velocity = np.stack([c * states[..., 0] - s * states[..., 1], s * states[..., 0] + c * states[..., 1]], axis=-1)
    return walk_record(
        samples,
        position=states[..., 2 * n + 1 : 2 * n + 3],
        heading=heading,
        velocity=velocity,
        heading_rate=states[..., 2],
        joint_angle=states[..., 3 : n + 2],
        joint_rate=states[..., n + 2 : 2 * n + 1],
        leg_yaw=leg_yaw,
    )


def foot_forces(
    models: Sequence[PlanarModel], samples: Array, states: Array, leg_yaw: Array, friction: Array
) -> xr.DataArray:
    """Force of the floor on every foot, zero for those in the air, along the floor's axes, N.

    Foot by foot from places and velocities, without the contact moments.

    Returns
    -------
    Over (time, robot, module, side, axis).
    """
    n, gait = models[0].modules, models[0].robot.gait
    half = 0.5 * np.array([model.robot.module_length for model in models])[:, None]
    heading = states[..., None, 2 * n + 3] + _summed(states[..., 3 : n + 2])
    rate = states[..., None, 2] + _summed(states[..., n + 2 : 2 * n + 1])
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    left = np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)
    # From one centre over the joint to the next: -half (ahead + ahead of the next).
    swing = (half * rate)[..., None] * left
    front = states[..., None, :1] * ahead[..., :1, :] + states[..., None, 1:2] * left[..., :1, :]
    velocity = front - np.moveaxis(_summed(np.moveaxis(swing[..., :-1, :] + swing[..., 1:, :], -1, 0)), 0, -1)

    phase = (samples[:, None, None] / gait.period + gait.leg_phases(n)) % 1.0
    standing = (phase < gait.duty)[:, None]
    stroke = gait.stride * (0.5 - phase / gait.duty)[:, None]
    yaw = np.zeros((*heading.shape, 2))
    yaw[..., 0, :] = leg_yaw
    offset = np.array([model.robot.legs.forward_offset for model in models])[:, None, None]
    width = np.array([model.robot.legs.half_width for model in models])[:, None, None] * np.array([1.0, -1.0])
    x, y = offset + stroke * np.cos(yaw), width + stroke * np.sin(yaw)
    pace = -gait.speed * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    along = pace[..., 0] - rate[..., None] * y
    across = pace[..., 1] + rate[..., None] * x
    slip = velocity[..., None, :] + along[..., None] * ahead[..., None, :] + across[..., None] * left[..., None, :]
    return xr.DataArray(
        np.where(standing[..., None], -friction[..., None] * slip, 0.0),
        dims=("time", "robot", "module", "side", "axis"),
        coords={"module": np.arange(1, n + 1)},
        attrs={"units": "N"},
    )


def _summed(increments: Array) -> Array:
    """Running sums along the last axis, starting from zero: one entry more."""
    zero = np.zeros((*increments.shape[:-1], 1))
    return np.concatenate([zero, np.cumsum(increments, axis=-1)], axis=-1)
