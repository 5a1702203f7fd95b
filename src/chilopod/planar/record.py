"""Record of a walk: positions, angles, rates and foot forces over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from chilopod.frozen import Array
from chilopod.planar.energy import foot_slip, front_velocity
from chilopod.planar.model import PlanarModel
from chilopod.record import walk_record


def planar_record(model: PlanarModel, samples: Array, states: Array, leg_yaw: Array) -> xr.Dataset:
    """States with poses over time, shape (samples, robots, 2N+4), as named quantities on the floor, see
    :func:`chilopod.record.walk_record`; samples are in s, leg yaw in rad, shape (samples, robots, 2), and any one of
    the robots' models serves."""
    n = model.modules
    heading = states[..., 2 * n + 3]
    return walk_record(
        samples,
        position=states[..., 2 * n + 1 : 2 * n + 3],
        heading=heading,
        velocity=front_velocity(states, heading),
        heading_rate=states[..., 2],
        joint_angle=states[..., 3 : n + 2],
        joint_rate=states[..., n + 2 : 2 * n + 1],
        leg_yaw=leg_yaw,
    )


def foot_forces(
    models: Sequence[PlanarModel], samples: Array, states: Array, leg_yaw: Array, friction: Array
) -> xr.DataArray:
    """Force of the floor on every foot, zero for those in the air, along the floor's axes, N, over (time, robot,
    module, side, axis): foot by foot from positions and velocities, without the contact moments."""
    n, gait = models[0].modules, models[0].robot.gait
    phase = gait.phases(samples, n)[:, None]
    yaw = np.zeros((*states.shape[:2], n, 2))
    yaw[..., 0, :] = leg_yaw
    _, slip = foot_slip(models, states, gait.stroke(phase), yaw)
    return xr.DataArray(
        np.where(gait.stands(phase)[..., None], -friction[..., None] * slip, 0.0),
        dims=("time", "robot", "module", "side", "axis"),
        coords={"module": np.arange(1, n + 1)},
        attrs={"units": "N"},
    )
