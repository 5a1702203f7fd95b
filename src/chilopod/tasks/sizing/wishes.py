"""Wishes for a robot, and how far a robot is from them.

A radius enters as its squared curvature, which falls to zero at the onset in proportion to the growth rate, and goes on
with that where the robot walks straight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chilopod import units
from chilopod.analysis.quantities import QUANTITIES, Measured, Onset, leading_mode
from chilopod.errors import ChilopodError, ParameterError
from chilopod.robot import Robot

FAILED = 10.0
"""Deviation of a robot without the quantity."""


@dataclass(frozen=True)
class Wish:
    """A quantity, see :data:`chilopod.analysis.quantities.QUANTITIES`, and its value, SI, to be met (``sense`` 0), not
    to be exceeded (-1), or at least to be reached (1)."""

    quantity: str
    value: float
    sense: int = 0

    def deviation(self, value: float) -> float:
        """Relative deviation of a value from the wish, zero if it is met; absolute for a wish of 0."""
        if self.quantity in ("speed", "settling"):  # which spread over decades
            return self._one_sided(float(np.log(value / self.value)))
        return self._one_sided((value - self.value) / (abs(self.value) or 1.0))

    def searched(self, measured: Measured, robot: Robot) -> float:
        """Smooth measure of that deviation of a robot, zero and signed alike; :data:`FAILED` without the quantity."""
        try:
            if self.quantity != "radius":
                return self.deviation(getattr(measured, self.quantity)(robot))
            growth = leading_mode(robot).growth
            curvature = self.value / measured.radius(robot) if growth > 0.0 else 0.0
            return self._one_sided(1.0 - curvature**2 - min(growth, 0.0))
        except ChilopodError:
            return FAILED

    def missed(self, searched: float) -> float:
        """Size of the deviation that :meth:`searched` measures; infinite for the radius of a robot that walks
        straight."""
        if self.quantity != "radius":
            return abs(searched)
        return abs(1.0 / np.sqrt(1.0 - searched) - 1.0) if searched < 1.0 else np.inf

    def _one_sided(self, deviation: float) -> float:
        return max(0.0, deviation * -self.sense) * -self.sense if self.sense else deviation


def parsed_wish(robot: Robot, onset: Onset, name: str, given: float | str) -> Wish:
    """A wish from its value, SI or text; ParameterError names the fault."""
    try:
        sense = {"<": -1, ">": 1}.get(given[:1], 0) if isinstance(given, str) else 0
        unit = robot.si_unit_of(onset.parameter) if name == "onset" else QUANTITIES[name]
        value = units.parse(given[abs(sense) :].removeprefix("="), unit) if isinstance(given, str) else float(given)
        if not np.isfinite(value) or (name in ("radius", "speed", "settling") and value <= 0.0):
            raise ParameterError("must be finite, and positive for a radius, a speed or a time", value=given)
    except ChilopodError as error:
        error.field = name
        raise
    return Wish(name, value, sense)
