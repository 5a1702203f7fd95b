"""Printed numbers of the paper, as the tables that constants are fitted to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from chilopod.analysis.parameters import stiffness
from chilopod.paper import printed
from chilopod.steering import ARRIVAL_RADIUS
from chilopod.tasks.identify import BaseSeries, CriticalMode

TOLERANCE = 0.05
"""Standard error of the base series' numbers, relative."""


def critical_mode_data() -> CriticalMode:
    """Critical mode and spring of the planar model: six numbers, each exact to half of its last digit."""
    return CriticalMode(
        k1=stiffness(printed.CRITICAL_K1.value),
        components=tuple(each.value for each in printed.MODE),
        k1_tolerance=stiffness(printed.CRITICAL_K1.tolerance),
        component_tolerance=printed.MODE[0].tolerance,
        between=(stiffness(4.0), stiffness(40.0)),
    )


def variant_settings() -> Mapping[str, Sequence[str]]:
    """Settings of the paper's variants of its robot, by name."""
    return {name: each.overrides for name, each in printed.VARIANTS.items()}


def base_series_data() -> BaseSeries:
    """Base series of the robot: walks with k2 to k5 = 41 N*mm/deg and a stride of 3 cm.

    They are straight at k1 = 75 and 41, curved at 28, 21, 17 and 15; curves set in at 34, with a radius
    of 1.2 m at 26 and 0.88 m at 21, at a speed of 0.056 m/s (:func:`walking_speed`).

    The standard errors are half of the tolerances in the report's verdicts.
    """

    def within(number: float) -> tuple[float, float]:
        return number, TOLERANCE * number

    return BaseSeries(
        curved=[stiffness(spring) for spring in printed.CURVED],
        straight=[stiffness(spring) for spring in printed.STRAIGHT],
        onset=within(stiffness(printed.ONSET.value)),
        radii={stiffness(spring): within(radius.value) for spring, radius in printed.RADII.items()},
        speeds={stiffness(printed.TASKS["A"].k_hat.value): within(walking_speed())},
        law=(9.7 * math.sqrt(stiffness(1.0)), 0.030 / stiffness(1.0)),  # meets both printed radii
        shape=[each.value / 2.10 for each in printed.MODE],
    )


def walking_speed() -> float:
    """Speed of the robot, m/s, from its arrival time, as the paper prints no speed.

    In task A the target is R = 1.3 m away, psi = 45 deg to the side. The circle to it has the radius R / (2 sin psi)
    and turns by 2 psi on the way, 1.444 m in all. The robot was within 0.15 m of the target after 23 s at the earliest:
    1.294 m, 0.056 m/s. It walked at k1 = 21 N*mm/deg, on about that circle.
    """
    target = printed.TASKS["A"].target
    way = 2.0 * abs(target.bearing) * target.radius - ARRIVAL_RADIUS
    return way / printed.ARRIVAL.value
