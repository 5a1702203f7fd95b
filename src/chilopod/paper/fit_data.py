"""What the paper prints, as the tables that constants are fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.printed import printed, printed_stiffness
from chilopod.steering import ARRIVAL_RADIUS, Target
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
    21, 17 and 15, set in at 34, radius 1.2 m at 26 and 0.88 m at 21, at a speed of 0.056 m/s (:func:`walking_speed`).

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
        speeds={21.0: walking_speed()},
    )


def walking_speed() -> float:
    """How fast the robot walked, m/s; the paper prints no speed, but the time at which it was there.

    In task A the target is R = 1.3 m away, psi = 45 deg to the side. The circle to it has the radius R / (2 sin psi)
    and turns by 2 psi on the way, 1.444 m in all. The robot was within 0.15 m of the target after 23 s at the earliest:
    1.294 m, 0.056 m/s. It walked at k1 = 21 N*mm/deg, on about that circle.
    """
    task = printed()["turning"]["tasks"]["A"]
    target = Target.parse(task["target"])
    way = 2.0 * abs(target.bearing) * target.radius - ARRIVAL_RADIUS
    return way / units.parse(printed()["turning"]["evaluation_time"], "s")


def _in_paper_unit(key: str) -> float:
    return units.from_si(printed_stiffness("pitchfork", key), PAPER_UNIT)
