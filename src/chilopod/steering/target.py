"""A target on the floor and the circle that leads to it (paper, Fig. "turning" A)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod import units
from chilopod.errors import ParameterError, concerning

ARRIVAL_RADIUS = 0.15
"""Distance within which the paper counts the target as reached, m."""

FARTHEST = 1e4
"""Largest distance of a target, m; larger ones are typing errors."""

_FORM = 'a direction and a distance, such as "45 deg, 1.3 m"'


@dataclass(frozen=True)
class Target:
    """Target relative to module 1 before the walk; ParameterError for one within the arrival radius, behind the robot,
    or too far.

    Attributes
    ----------
    bearing
        Direction relative to the heading, left positive, rad, within a right angle.
    distance
        Distance from the centre of module 1, m, more than :data:`ARRIVAL_RADIUS`.
    """

    bearing: float
    distance: float

    def __post_init__(self) -> None:
        if not abs(self.bearing) <= 0.5 * math.pi:
            value, allowed = f"{math.degrees(self.bearing):g} deg", "-90 to 90 deg; a number without a unit is in rad"
            raise ParameterError("must lie in front of the robot", field="target bearing", value=value, allowed=allowed)
        if not ARRIVAL_RADIUS < self.distance <= FARTHEST:
            allowed = f"more than the {ARRIVAL_RADIUS:g} m that count as arrived, at most {FARTHEST:g} m"
            value = f"{self.distance:g} m"
            raise ParameterError("must be a distance to walk", field="target distance", value=value, allowed=allowed)

    @classmethod
    def parse(cls, text: str) -> Target:
        """Read ``"45 deg, 1.3 m"``; ParameterError or UnitError for any other text, or a target out of range."""
        bearing, comma, distance = text.partition(",")
        if not comma:
            raise ParameterError("must be a target", field="target", value=text, allowed=_FORM)
        with concerning("target"):
            numbers = units.parse(bearing, "rad"), units.parse(distance, "m")
        return cls(*numbers)

    @property
    def radius(self) -> float:
        """Radius of the circle along the heading to the target, R / (2 |sin psi|), m; infinite straight ahead."""
        sine = abs(math.sin(self.bearing))
        return self.distance / (2.0 * sine) if sine > 0.0 else math.inf

    @property
    def position(self) -> NDArray[np.float64]:
        """Position on the floor, for a robot at the origin that heads along x, m, shape (2,)."""
        return self.distance * np.array([math.cos(self.bearing), math.sin(self.bearing)])

    def __str__(self) -> str:
        return f"{math.degrees(self.bearing):g} deg, {self.distance:g} m"
