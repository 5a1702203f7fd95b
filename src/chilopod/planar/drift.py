"""Displacement of the robot over the floor in a period of its walk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Drift:
    """Motion of module 1 over one period of a periodic walk, in its own frame at the start.

    The repeated motion follows a circle, so the quantities below describe the path over many periods.

    Attributes
    ----------
    forward, left
        Displacement, m.
    turn
        Change of heading, rad, left positive.
    period
        Duration of a gait cycle, s.
    """

    forward: float
    left: float
    turn: float
    period: float

    @property
    def distance(self) -> float:
        """Length of the straight line between the ends of the period, m."""
        return float(np.hypot(self.forward, self.left))

    @property
    def radius(self) -> float:
        """Radius of the circle through successive positions, m; infinite on a straight walk."""
        half = abs(np.sin(0.5 * self.turn))
        return float(0.5 * self.distance / half) if half > 0.0 else float("inf")

    @property
    def heading_rate(self) -> float:
        """Mean rate of turn, rad/s."""
        return self.turn / self.period

    @property
    def speed(self) -> float:
        """Mean speed along the circle, m/s: its arc is longer than the straight line between the ends."""
        half = 0.5 * self.turn
        arc = self.distance * (half / np.sin(half) if np.sin(half) != 0.0 else 1.0)
        return float(arc / self.period)
