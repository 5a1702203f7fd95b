"""Summary of a walk: mean shape at the end, radius of its curve, and final position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from chilopod.engine import Status
from chilopod.frozen import Array
from chilopod.notebook import finite
from chilopod.robot import Robot

AVERAGED = 5.0
"""Time at the end of a walk over which the paper averages joint angles, s."""


@dataclass(frozen=True)
class WalkSummary:
    """Summary of the end of one walk.

    ``status`` is a label of :class:`chilopod.engine.Status`. ``joint_angles`` are means over the last :data:`AVERAGED`
    s, a longer gait cycle, or a shorter walk, rad, shape (N-1,), NaN if the walk failed, or if its samples there leave
    more than half of the cycle out; ``axis_radius`` is that of these angles, see
    :meth:`chilopod.robot.Robot.axis_radius`, m, infinite if the walk is straight. ``x`` and ``y`` are the position of
    the centre of module 1 at the end, m.
    """

    status: str
    joint_angles: Array
    axis_radius: float
    x: float
    y: float

    @property
    def failed(self) -> bool:
        """True if it ended early."""
        return self.status != Status.WALKED.label

    @property
    def sentence(self) -> str:
        """Status in words."""
        return next(each.sentence for each in Status if each.label == self.status)

    @property
    def joint_angles_deg(self) -> list[float]:
        """:attr:`joint_angles` in degrees."""
        return [float(angle) for angle in np.rad2deg(self.joint_angles)]

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; null for missing values of a failed walk, and for an infinite radius."""
        return {
            "status": self.status,
            "x_m": finite(self.x),
            "y_m": finite(self.y),
            "axis_radius_m": finite(self.axis_radius),
            "mean_joint_angles_rad": [finite(angle) for angle in self.joint_angles],
        }


def mean_joint_angles(record: xr.Dataset, seconds: float = AVERAGED, before: float = 0.0) -> xr.DataArray:
    """Joint angles averaged over some seconds that end ``before`` s before the end of a record, rad, over (robot,
    joint). The first sample does not count, so that whole cycles have equal weights: 5 s at 10 Hz are 50 samples."""
    times = record.time.values
    last = times[-1] - before + 1e-9  # samples are at round times, up to round-off
    first, end = np.searchsorted(times, [last - seconds, last])
    return record.joint_angle.isel(time=slice(int(first), int(end))).mean("time", skipna=False)


def straight(record: xr.Dataset) -> bool:
    """True if no joint ever bends, to the last bit: without a difference between left and right a straight walk stays
    straight even where it is unstable."""
    ends = record.end_joint_angle.values if "end_joint_angle" in record else np.zeros(1)
    return not (record.joint_angle.values.any() or ends.any())


def summaries(robot: Robot, record: xr.Dataset, seconds: float = AVERAGED) -> Sequence[WalkSummary]:
    """Summary of every walk of a record, with means over its last seconds, or over its last gait cycle if longer."""
    seconds = max(seconds, robot.gait.period)
    times, end, place = record.time.values, float(record.time[-1]), record.position.isel(time=-1)
    if "end_position" in record:  # the walk goes on behind the last sample
        end, place = record.attrs["duration"], record.end_position
    if _shows_cycle(times[times > end - seconds + 1e-9], min(seconds, end), robot.gait.period):
        angles = mean_joint_angles(record, seconds, before=times[-1] - end).transpose("robot", "joint").values
    else:
        angles = np.full((record.sizes["robot"], record.sizes["joint"]), np.nan)
    radii = robot.axis_radius(angles)
    places = place.transpose("robot", "axis").values
    return [
        WalkSummary(str(status), angle, float(radius), float(x), float(y))
        for status, angle, radius, (x, y) in zip(record.status.values, angles, radii, places, strict=True)
    ]


def _shows_cycle(times: Array, duration: float, period: float) -> bool:
    """True if samples within a duration leave no more than half of the gait cycle, or of a shorter walk, out."""
    cycle = min(duration, period)
    phases = np.sort(times % cycle) if len(times) > 1 else np.zeros(1)
    return bool(np.diff(phases, append=phases[0] + cycle).max() <= 0.5 * cycle + 1e-9)
