"""Printed numbers of the paper, the condition on a number that agrees with each, and tables to fit constants to.

S. Aoi et al., "Advanced turning maneuver of a many-legged robot using pitchfork bifurcation", IEEE Transactions on
Robotics, 2022. The numbers are those of its planar model and of its robot; springs are in N*mm/deg, as printed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from chilopod.analysis.parameters import PAPER_UNIT, stiffness
from chilopod.robot import Robot
from chilopod.steering import ARRIVAL_RADIUS, Outcome, Target
from chilopod.tasks.identify import BaseSeries, CriticalMode


@dataclass(frozen=True)
class Said:
    """A printed statement, and the condition of agreement, in words."""

    words: str
    condition: str


@dataclass(frozen=True)
class Band(Said):
    """A printed statement with which a number agrees if it lies between two bounds."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """Middle between the bounds."""
        return 0.5 * (self.low + self.high)

    def holds(self, value: float) -> bool:
        """True if a number without an error lies between the bounds."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Number:
    """A printed number, its unit, and the largest deviation of a number that agrees, in the same unit."""

    value: float
    unit: str
    tolerance: float

    def __str__(self) -> str:
        return f"{self.value:g} {self.unit}"

    @property
    def band(self) -> Band:
        """Band of numbers that agree."""
        low, high = self.value - self.tolerance, self.value + self.tolerance
        return Band(str(self), f"{100.0 * self.tolerance / self.value:.0f} %", low, high)


@dataclass(frozen=True)
class Variant:
    """Change of the robot, as for ``--set``: critical k1 of the planar model over that as built, onset of the robot's
    curved walks, and their radius over that as built."""

    overrides: tuple[str, ...]
    model: Band
    onset: Number
    radius: Band


@dataclass(frozen=True)
class Task:
    """A turning task: target, radius of the circle to it, the spring whose walk has this radius, springs at which all
    three criteria are smallest, outcomes of walks with some springs, and section or figure of the paper."""

    target: Target
    radius: Number
    k_hat: Number
    minima: Band
    outcomes: Mapping[Outcome, float]
    source: str


FIT_TOLERANCE = 0.05
"""Standard error of the base series' numbers in fits, relative: half of the tolerances in the report's verdicts."""

ONSETS = 0.10
"""Relative tolerance of every spring at which straight walks of the robot end."""


def _spring(value: float, tolerance: float = ONSETS) -> Number:
    return Number(value, PAPER_UNIT, tolerance * value)


def _around(k_hat: float) -> Band:
    """Bounds of a spring around 21: its neighbours in the paper."""
    low, high = 17.0 / 21.0 * k_hat, 28.0 / 21.0 * k_hat
    condition = f"{low:.3g} to {high:.3g} {PAPER_UNIT}, with all that are no worse"
    return Band(f"around k1 = {k_hat:g} {PAPER_UNIT}", condition, low, high)


ANALYSIS = "section Verification by Floquet analysis"
CRITICAL_K1 = Number(12.0, PAPER_UNIT, 0.5)
"""Critical k1 of the planar model, printed without decimals."""

MODE = tuple(Number(value, "", 0.005) for value in (0.64, 0.36, 0.48, 0.46, 0.16))
"""Joint components of the planar model's critical mode, with two decimals."""

MODE_ORDER = tuple(sorted(range(1, 6), key=lambda joint: -MODE[joint - 1].value))
"""Joints in order of their bend in it, largest first."""

KIND, UNIFORM_KIND = "pitchfork", "Neimark-Sacker"
"""Kinds of bifurcation of the planar model: with k1 alone, and with all springs alike."""

LOWER = Band("lower", "5 % lower", 0.0, 0.95)
LITTLE_CHANGE = Band("little change", "10 %", 0.9, 1.1)
"""Change of the planar model's critical k1, relative to that as built: also with more modules."""

_UNCHANGED = Band("almost unchanged", "15 %, at equal distance", 0.85, 1.15)
_SMALLER = Band("smaller", "not wider than as built, at equal distance", 0.0, 1.0)

ONSET = _spring(34.0)
"""Onset of curved walks of the robot, by a square-root fit."""

VARIANTS: Mapping[str, Variant] = {
    "k2-5 = 28 N*mm/deg": Variant(("springs.stiffness=28 N*mm/deg",), LOWER, _spring(23.0), _UNCHANGED),
    "stride 1.8 cm": Variant(("gait.stride=1.8 cm",), LOWER, _spring(25.0), _UNCHANGED),
    "module phase 180 deg": Variant(("gait.module_phase=180 deg",), LITTLE_CHANGE, _spring(31.0), _SMALLER),
}

AS_BUILT = "as built"
"""The robot beside its variants."""

STRAIGHT, CURVED = (41.0, 75.0), (15.0, 17.0, 21.0, 28.0)
"""Springs k1 of straight walks of the robot, and of curved ones."""

EXPERIMENTS = "section Pitchfork bifurcation of straight walk, experimental results of the robot"
RADII = {21.0: Number(0.88, "m", 0.088), 26.0: Number(1.2, "m", 0.12)}
"""Radii of the robot's curved walks, by k1."""

UNIFORM = _spring(18.0)
"""Hopf point of the robot with all springs alike; the planar model's own is not printed."""

COMPARISON = "section Comparison with previous strategy"
TURNING = "section Turning maneuverability"

CRITERION_NAMES = {"distance": "ε1, distance", "angle": "ε2, angle", "effort": "ε3, leg yaw"}
"""Names of the robot's criteria."""

ARRIVAL = Number(23.0, "s", 0.15 * 23.0)
"""Earliest arrival of the robot in task A."""

SPEED = 0.10
"""Relative tolerance of the walking speed, which follows from the earliest arrival (:func:`walking_speed`)."""

REPEATS, WITHOUT_LEG_YAW = 5, 9
"""Walks to the target with each spring, and without leg yaw."""

TASKS: Mapping[str, Task] = {
    "A": Task(
        Target.parse("45 deg, 1.3 m"),
        Number(0.88, "m", 0.005),
        _spring(21.0, 0.15),
        _around(21.0),
        {Outcome.OUTSIDE: 41.0, Outcome.ARRIVED: 21.0, Outcome.INSIDE: 15.0},
        "figure Turning task",
    ),
    "B": Task(
        Target.parse("40 deg, 1.5 m"),
        Number(1.2, "m", 0.05),
        _spring(26.0, 0.15),
        _around(26.0),
        {},
        "figure Evaluation criteria for different conditions",
    ),
}


def variant_robots(robot: Robot) -> dict[str, Robot]:
    """The robot as built and with each of the paper's changes."""
    return {AS_BUILT: robot, **{name: robot.set_from_text(each.overrides) for name, each in VARIANTS.items()}}


def mode_shape(robot: Robot) -> tuple[float, ...]:
    """Joint components of the planar model's critical mode; all alike for another number of joints."""
    joints = robot.body.modules - 1
    return tuple(each.value for each in MODE) if joints == len(MODE) else (1.0,) * joints


def onset(variant: str) -> Number:
    """Onset of curved walks of the robot as built, or of a variant."""
    return ONSET if variant == AS_BUILT else VARIANTS[variant].onset


def critical_mode_data() -> CriticalMode:
    """Critical mode and spring of the planar model: six numbers, each exact to half of its last digit."""
    return CriticalMode(
        k1=stiffness(CRITICAL_K1.value),
        components=tuple(each.value for each in MODE),
        k1_tolerance=stiffness(CRITICAL_K1.tolerance),
        component_tolerance=MODE[0].tolerance,
        between=(stiffness(4.0), stiffness(40.0)),
    )


def variant_settings() -> Mapping[str, Sequence[str]]:
    """Settings of the paper's variants of its robot, by name."""
    return {name: each.overrides for name, each in VARIANTS.items()}


def base_series_data() -> BaseSeries:
    """Base series of the robot: walks with k2 to k5 = 41 N*mm/deg and a stride of 3 cm.

    They are straight at k1 = 75 and 41, curved at 28, 21, 17 and 15; curves set in at 34, with a radius
    of 1.2 m at 26 and 0.88 m at 21, at a speed of 0.056 m/s (:func:`walking_speed`).
    """

    def within(number: float) -> tuple[float, float]:
        return number, FIT_TOLERANCE * number

    return BaseSeries(
        curved=[stiffness(spring) for spring in CURVED],
        straight=[stiffness(spring) for spring in STRAIGHT],
        onset=within(stiffness(ONSET.value)),
        radii={stiffness(spring): within(radius.value) for spring, radius in RADII.items()},
        speeds={stiffness(TASKS["A"].k_hat.value): within(walking_speed())},
        law=(9.7 * math.sqrt(stiffness(1.0)), 0.030 / stiffness(1.0)),  # meets both printed radii
        shape=[each.value / 2.10 for each in MODE],
    )


def walking_speed() -> float:
    """Speed of the robot, m/s, from its arrival time, as the paper prints no speed.

    In task A the target is R = 1.3 m away, psi = 45 deg to the side. The circle to it has the radius R / (2 sin psi)
    and turns by 2 psi on the way, 1.444 m in all. The robot was within 0.15 m of the target after 23 s at the earliest:
    1.294 m, 0.056 m/s. It walked at k1 = 21 N*mm/deg, on about that circle.
    """
    target = TASKS["A"].target
    way = 2.0 * abs(target.bearing) * target.radius - ARRIVAL_RADIUS
    return way / ARRIVAL.value
