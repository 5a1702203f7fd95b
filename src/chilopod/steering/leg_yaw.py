"""The supplementary turning controller of the paper (appendix): the legs of module 1 yaw towards the target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from chilopod.engine import Command, Event, Observation
from chilopod.errors import ParameterError
from chilopod.gait import Gait

SIDES = ("left", "right")
"""Sides of the legs of module 1: the names of their events."""


@dataclass(frozen=True)
class LegYawController:
    """Controller that yaws each leg of module 1 towards the target, by at most ``step`` in every swing.

    At ``start`` of the swing the bearing psi is read. Until ``end`` of the swing the yaw then ramps by psi - yaw, or by
    sign(psi - yaw) times ``step`` if that is less. It never exceeds ``limit``. The yaw stays constant while the foot
    stands, and while the target is not seen.

    Attributes
    ----------
    step, limit
        Largest change in a gait cycle, and largest yaw, rad (5 deg in the paper).
    start, end
        Start and end of the ramp, as parts of the swing (0.4 and 0.8 in the paper).
    """

    step: float = math.radians(5.0)
    limit: float = math.radians(5.0)
    start: float = 0.4
    end: float = 0.8

    def __post_init__(self) -> None:
        for name in ("step", "limit"):
            value = getattr(self, name)
            if not 0.0 <= value < 0.5 * math.pi:
                raise ParameterError("is out of range", field=name, value=value, allowed="0 to a right angle, rad")
        if not 0.0 <= self.start <= self.end <= 1.0:
            raise ParameterError("must rise from 0 to 1", field="start, end", value=(self.start, self.end))

    def events(self, gait: Gait) -> Sequence[Event]:
        """``start`` of the swings of the left and the right leg."""
        at = gait.duty + self.start * (1.0 - gait.duty)
        ramp = (self.end - self.start) * gait.swing
        phases = zip(SIDES, gait.leg_phases(1)[0], strict=True)
        return [Event(side, float((at - phase) % 1.0), ramp) for side, phase in phases]

    def act(self, event: Event, seen: Observation) -> Command:
        """Command a new yaw for the swinging leg."""
        side = SIDES.index(event.name)
        yaw = seen.leg_yaw.copy()
        change = np.clip(seen.bearing - yaw[:, side], -self.step, self.step)
        wanted = np.clip(yaw[:, side] + change, -self.limit, self.limit)
        yaw[:, side] = np.where(np.isnan(wanted), yaw[:, side], wanted)
        return Command(leg_yaw=yaw, within=event.window)

    def towards(self, event: Event, seen: Observation) -> Command:
        """Command as :meth:`act`, but search for a target out of view: the leg yaws further to the side that the left
        one is turned to, to the left if it is straight."""
        sought = np.copysign(0.5 * math.pi, seen.leg_yaw[:, 0])
        return self.act(event, replace(seen, bearing=np.where(np.isnan(seen.bearing), sought, seen.bearing)))
