"""What the paper prints, as the tables that constants are fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.steering import ARRIVAL_RADIUS, Target
from chilopod.studies.paper import printed, printed_stiffness
from chilopod.tasks.identify import BaseSeries, CriticalMode

K1_ROUNDING = 0.5
"""N*mm/deg: the paper prints 12."""

MODE_ROUNDING = 0.005
"""It prints two decimals."""


def critical_mode_data() -> CriticalMode:
    """Of the planar model: six numbers, of which half the last digit is left open."""
    return CriticalMode(
        k1=_in_paper_unit("critical_k1"),
        components=tuple(printed()["pitchfork"]["joint_components"]),
        k1_tolerance=K1_ROUNDING,
        component_tolerance=MODE_ROUNDING,
        between=(4.0, 40.0),
    )


def variant_settings() -> Mapping[str, Sequence[str]]:
    """The paper's variants of its robot: what is set in each, by name."""
    return {name: entry["set"] for name, entry in printed()["variants"].items()}


def base_series_data() -> BaseSeries:
    """Of the robot: walks with k2 to k5 = 41 N*mm/deg and a stride of 3 cm, straight at k1 = 75 and 41, curved at 28,
    21, 17 and 15, set in at 34, radius 1.2 m at 26 and 0.88 m at 21.

    The tolerance is half of what the report calls agreeing.
    """
    curved: Any = printed()["curved"]
    return BaseSeries(
        curved=(15.0, 17.0, 21.0, 28.0),
        straight=(41.0, 75.0),
        radii={float(key): units.parse(text, "m") for key, text in curved["radius"].items()},
        onset=_in_paper_unit("robot_critical_k1"),
        law=(9.7, 0.030),  # meets both printed radii
        shape=tuple(value / 2.10 for value in printed()["pitchfork"]["joint_components"]),
    )


def walking_speed() -> float:
    """Of the robot, m/s: what task A and its earliest arrival imply.

    The circle that leads to a target at the distance R and the bearing psi has the radius r = R / (2 sin psi) and the
    arc 2 psi r to it, of which the last :data:`chilopod.steering.ARRIVAL_RADIUS` is not walked: who is as near has
    arrived.
    """
    turning: Any = printed()["turning"]
    target = Target.parse(turning["tasks"]["A"]["target"])
    arc = 2.0 * target.bearing * target.radius - ARRIVAL_RADIUS
    return arc / units.parse(turning["evaluation_time"], "s")


def _in_paper_unit(key: str) -> float:
    return units.from_si(printed_stiffness("pitchfork", key), PAPER_UNIT)
