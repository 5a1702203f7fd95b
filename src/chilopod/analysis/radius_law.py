"""Radius of the settled curved walk over the first spring, for a robot whose straight walk ends in a pitchfork."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.frozen import Short
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import RadiusLaw

_BETWEEN = (1.0 / 20.0, 3.0)
"""Interval, relative to the stiffest spring, in which the pitchfork of the first spring is searched."""


@dataclass(frozen=True)
class RadiusLaws(Short):
    """Radii over k1 by the paper's measure (N-1) L / sum |theta|, with mean angles (``axis``), and by the actual path
    of module 1; and the branch of left turns that they come from."""

    axis: RadiusLaw
    path: RadiusLaw
    walks: xr.Dataset

    def k_hat(self, radius: float) -> tuple[float, float]:
        """Springs for a radius (m) by both laws, N*mm/deg."""
        by_axis, by_path = (units.from_si(law.value(radius), PAPER_UNIT) for law in (self.axis, self.path))
        return by_axis, by_path

    def joint_angles(self, spring: float) -> tuple[float, ...]:
        """Joint angles of the settled left turn at phase 0 with a spring (N*mm/deg), rad, (N-1,)."""
        walks = self.walks
        # Beside the pitchfork angles grow as the square root of the distance.
        root = np.sqrt(np.maximum(walks.parameter_si.values[0] - walks.parameter_si.values, 0.0))
        wanted = np.sqrt(walks.parameter_si.values[0] - stiffness(spring))
        joints = range(3, 3 + walks.sizes["joint"])
        return tuple(float(np.interp(wanted, root, walks.orbit.values[:, joint])) for joint in joints)


def radius_laws(robot: Robot, progress: Progress = silent, seconds: float = np.inf) -> RadiusLaws:
    """Compute the laws from the branch of curved walks, from the pitchfork down to a bend of a right angle in a joint.
    AnalysisError if there is no pitchfork in the first spring, the search takes too long, or no law is beside it."""
    stiffest = max(robot.springs.stiffness)
    low, high = (part * stiffest for part in _BETWEEN)
    walks = curved_walks(robot, K1, (low, high), side=-1, progress=progress, seconds=seconds)
    springs, stable, radii = walks.parameter_si.values, walks.stable.values, (walks.axis_radius, walks.path_radius)
    axis, path = (RadiusLaw.of_branch(springs, each.values, stable, robot.unit_of(K1)) for each in radii)
    return RadiusLaws(axis, path, walks)
