"""A floor with bumps for the whole robot."""

from __future__ import annotations

import mujoco
import numpy as np

from chilopod import twin
from chilopod.robot import Robot

HEIGHT = 0.004
"""Height of the highest bumps, m; a foot is lifted by little more."""

_GRID = 0.05  # m between heights
_REACH = 12.0  # m from the start, farther than courses lead
_START = (-1.6, 0.2, 0.3)  # m behind, ahead and to the sides where the floor is flat: there the feet stand at first
_UNDER = 5e-4  # m that flat parts lie under the plane, so that a foot touches one floor only


def _bumps(spec: mujoco.MjSpec, robot: Robot) -> None:
    across = int(2.0 * _REACH / _GRID) + 1
    heights = np.random.default_rng(0).uniform(0.0, HEIGHT, (across, across))
    places = np.linspace(-_REACH, _REACH, across)
    behind, ahead, aside = _START
    heights[np.ix_(np.abs(places) < aside, (places > behind) & (places < ahead))] = -_UNDER
    spec.add_hfield(
        name="bumps",
        size=[_REACH, _REACH, HEIGHT + _UNDER, 0.01],
        nrow=across,
        ncol=across,
        userdata=((heights + _UNDER) / (HEIGHT + _UNDER)).ravel(),
    )
    spec.worldbody.add_geom(
        name="bumps",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="bumps",
        pos=[0.0, 0.0, -_UNDER],
        contype=0,
        conaffinity=1,
    )


BUMPS = twin.Edited("a floor with bumps", _bumps)
"""Heights at random, equally likely up to :data:`HEIGHT`, 5 cm from each other, straight between; flat at the start."""
