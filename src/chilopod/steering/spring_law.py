"""Steering by the first spring, once a gait cycle, from what the robot's sensors give and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Command, Event, Observation
from chilopod.errors import ParameterError
from chilopod.frozen import ReadOnlyArrays
from chilopod.gait import Gait
from chilopod.robot import Robot
from chilopod.steering.leg_yaw import SIDES, LegYawController
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.target import ARRIVAL_RADIUS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SpringLaw(ReadOnlyArrays):
    """The bend that the body has against the bend of the circle that leads to the target.

    When the left leg of module 1 swings, the curvature 2 sin(psi) / R of the circle to the target is compared with that
    of the body axis, the sum of joint angles over (N-1) L. The first spring is then

    - as soft as it goes where the body bends less: beside the pitchfork the bend that a spring leads to grows by a few
      percent a second, too slowly to wait for;
    - that of the inverse radius law, the paper's k1-hat, where it bends as wanted: this keeps the bend;
    - as stiff as it goes where it bends more or to the wrong side, where the target is ahead, where it lies so far
      within the tightest circle that the robot would walk round it for ever, and where a joint is bent as far as it
      may: this straightens it.

    The legs of module 1 yaw as in the paper, and so tell a new bend its side. A target that is not seen is looked for
    by turning as tightly as can be to the side that the legs were last turned to: it comes into view again.

    The law keeps nothing in mind: what it commands follows from one observation.

    Attributes
    ----------
    softest, stiffest
        Of the first spring, N*m/rad.
    curvatures, springs
        The inverse radius law: 1/m, rising from 0 at the pitchfork, and N*m/rad.
    arm
        (N-1) L of the paper's radius, m.
    band
        Part of the wanted bend by which the bend may differ and still be as wanted.
    straight
        A wanted bend of all joints together that is left to the legs, rad.
    most_bent
        Of one joint, rad; at a right angle modules run into each other.
    leg_yaw
        Of the legs of module 1.
    """

    softest: float
    stiffest: float
    curvatures: Array
    springs: Array
    arm: float
    band: float = 0.25
    straight: float = 0.1
    most_bent: float = 1.25
    leg_yaw: LegYawController = field(default_factory=LegYawController)

    @classmethod
    def of(cls, robot: Robot, law: RadiusLaw) -> SpringLaw:
        """The law of a robot.

        Its spring goes from that of the tightest walk of the radius law to the stiffest of the axis, as far as its
        actuator allows.

        Parameters
        ----------
        robot
            Size, springs, and the actuator of the first one.
        law
            Its radius law.

        Raises
        ------
        ParameterError
            If the actuator cannot make the robot turn: its softest spring lies beyond the pitchfork.
        """
        own = robot.springs
        softest, stiffest = float(law.values[0]), max(own.stiffness)
        if own.softest is not None:
            softest = max(softest, own.softest[0])
        if own.stiffest is not None:
            stiffest = min(stiffest, own.stiffest[0])
        if not softest < min(law.pitchfork, stiffest):
            raise ParameterError(
                "leaves the first spring no stiffness at which the walk bends",
                field="springs.softest",
                value=f"{softest:.4g} N*m/rad",
                allowed=f"less than {min(law.pitchfork, stiffest):.4g} N*m/rad, where the pitchfork or the stiffest is",
            )
        curvatures = np.where(np.isfinite(law.radii), 1.0 / law.radii, 0.0)
        arm = (robot.body.modules - 1) * robot.module_length
        return cls(softest, stiffest, curvatures[::-1], law.values[::-1], arm)

    def events(self, gait: Gait) -> Sequence[Event]:
        """Those of the legs of module 1."""
        return self.leg_yaw.events(gait)

    def act(self, event: Event, seen: Observation) -> Command:
        """Yaw of the leg that swings, and with the left one the spring."""
        legs = self.leg_yaw.towards(event, seen)
        if event.name != SIDES[0]:
            return legs
        stiffness = seen.stiffness.copy()
        stiffness[:, 0] = self.spring(seen)
        return replace(legs, stiffness=stiffness)

    def spring(self, seen: Observation) -> Array:
        """Stiffness of the first spring for what is seen, N*m/rad, shape (robots,)."""
        curvature = 2.0 * np.sin(seen.bearing) / np.maximum(seen.distance, ARRIVAL_RADIUS)
        wanted, bend = self.arm * curvature, -seen.joint_angles.sum(axis=1)
        right_side, size = wanted * bend >= 0.0, np.abs(bend) / np.maximum(np.abs(wanted), self.straight)
        steady = np.interp(np.abs(curvature), self.curvatures, self.springs)
        as_wanted = np.where(size < 1.0 + self.band, np.clip(steady, self.softest, self.stiffest), self.stiffest)
        spring = np.where(size < 1.0 - self.band, self.softest, as_wanted)
        turns = right_side & (np.abs(wanted) > self.straight) & ~self._too_near(seen)
        spring = np.where(np.isnan(wanted), self.softest, np.where(turns, spring, self.stiffest))
        return np.where(np.abs(seen.joint_angles).max(axis=1) > self.most_bent, self.stiffest, spring)

    def _too_near(self, seen: Observation) -> NDArray[np.bool_]:
        """Whether the tightest circle leads round the target and not to it."""
        radius = 1.0 / self.curvatures[-1]
        ahead, aside = seen.distance * np.cos(seen.bearing), np.abs(seen.distance * np.sin(seen.bearing))
        inside: NDArray[np.bool_] = np.hypot(ahead, aside - radius) < radius - ARRIVAL_RADIUS
        return inside
