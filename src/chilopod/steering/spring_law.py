"""Steering by the first spring, once a gait cycle, from what the robot's sensors give and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from chilopod import units
from chilopod.engine import Command, Event, Observation
from chilopod.errors import ParameterError
from chilopod.frozen import ReadOnlyArrays
from chilopod.gait import Gait
from chilopod.robot import Robot
from chilopod.steering.leg_yaw import SIDES, LegYawController
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.target import ARRIVAL_RADIUS

Array = NDArray[np.float64]

_AHEAD = 2.0  # modules


@dataclass(frozen=True)
class SpringLaw(ReadOnlyArrays):
    """The bend that the body has against the bend that leads to the target.

    When the left leg of module 1 swings, a curvature is wanted: 2 sin(psi) / D, that of the circle to a place on the
    line to the target a distance D ahead, no farther than the target itself (pure pursuit). It is compared with that of
    the body axis, the sum of joint angles over (N-1) L. The first spring is then

    - as soft as it goes where the body bends less: beside the pitchfork the bend that a spring leads to grows by a few
      percent a second, too slowly to wait for;
    - that of the inverse radius law, the paper's k1-hat, where it bends as wanted: this keeps the bend;
    - as stiff as it goes where it bends more or to the wrong side, where hardly a bend is wanted, and where a joint is
      bent as far as it may: this straightens it.

    No bend is wanted where the target lies so far within the tightest circle that the robot would walk round it for
    ever, and the tightest where the target is not seen, to the side that the legs were last turned to: it comes into
    view again. The legs of module 1 yaw as in the paper, and so tell a new bend its side. What the law commands follows
    from one observation.

    Attributes
    ----------
    softest, stiffest
        Ends of the range of the first spring, N*m/rad.
    curvatures, springs
        The inverse radius law: 1/m, rising from 0 at the pitchfork, and N*m/rad.
    tightest, arm
        Radius of the tightest circle, and (N-1) L of the paper's radius, m.
    ahead
        D, m. Two modules long: as far as the joints of the first spring and of the next reach. Half of that and half
        as much again do as well; a circle all the way to a far target is too wide.
    band
        Part of the wanted bend by which the bend may differ. Between 0.15 and 0.3 it hardly matters.
    straight, most_bent
        A wanted bend of all joints together that is left to the legs, and the largest bend of one joint, rad; at a
        right angle modules run into each other.
    leg_yaw
        Leg yaw of the legs of module 1.
    """

    softest: float
    stiffest: float
    curvatures: Array
    springs: Array
    tightest: float
    arm: float
    ahead: float
    band: float = 0.25
    straight: float = 0.1
    most_bent: float = 1.25
    leg_yaw: LegYawController = field(default_factory=LegYawController)

    @classmethod
    def of(cls, robot: Robot, law: RadiusLaw) -> SpringLaw:
        """The law of a robot, by its size, its springs and the actuator of the first one, and by its radius law.

        The spring goes from that of the tightest walk of the radius law to the stiffest of the axis, as far as the
        actuator allows.

        Raises
        ------
        ParameterError
            If the actuator leaves no range.
        """
        own = robot.springs
        softest = max(float(law.values[0]), own.softest[0] if own.softest else 0.0)
        stiffest = min(max(own.stiffness), own.stiffest[0] if own.stiffest else np.inf)
        if not softest < stiffest:
            low, high = (units.format(each, law.unit, digits=4) for each in (softest, stiffest))
            problem, names = "must leave the first spring a range to steer with", "springs.softest, springs.stiffest"
            allowed = "the softest below the stiffest, and below the stiffest spring of the axis"
            raise ParameterError(problem, field=names, value=f"{low} to {high}", allowed=allowed)
        curvatures = np.where(np.isfinite(law.radii), 1.0 / law.radii, 0.0)
        return cls(
            softest,
            stiffest,
            curvatures[::-1],
            law.values[::-1],
            law.radius(softest) if softest < law.pitchfork else law.tightest,
            (robot.body.modules - 1) * robot.module_length,
            _AHEAD * robot.module_length,
        )

    def remarks(self, law: RadiusLaw) -> list[str]:
        """Radii of its law that the robot's actuator keeps it from."""
        said = []
        softest, stiffest, pitchfork = (
            units.format(each, law.unit, digits=4) for each in (self.softest, self.stiffest, law.pitchfork)
        )
        if self.softest >= law.pitchfork:
            said.append(f"at {softest}, its softest, the first spring bends no straight walk ({pitchfork} does)")
        elif self.softest > law.values[0]:
            said.append(
                f"at {softest}, its softest, the first spring makes circles of {self.tightest:.3g} m; tighter ones, "
                f"down to {law.tightest:.3g} m, are out of its reach"
            )
        if self.stiffest <= law.pitchfork:
            said.append(f"at {stiffest}, its stiffest, the first spring holds no straight walk ({pitchfork} does)")
        return said

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
        curvature = self.curvature(seen)
        wanted, bend = self.arm * curvature, -seen.joint_angles.sum(axis=1)
        # Of what is wanted that there is; negative to the wrong side.
        share = bend * np.sign(wanted) / np.maximum(np.abs(wanted), self.straight)
        steady = np.clip(np.interp(np.abs(curvature), self.curvatures, self.springs), self.softest, self.stiffest)
        spring = np.where(
            share < 1.0 - self.band, self.softest, np.where(share < 1.0 + self.band, steady, self.stiffest)
        )
        straightens = (share < 0.0) | (np.abs(wanted) < self.straight)
        straightens |= np.abs(seen.joint_angles).max(axis=1) > self.most_bent
        return np.where(straightens, self.stiffest, spring)

    def curvature(self, seen: Observation) -> Array:
        """Curvature that is wanted, 1/m, left positive, shape (robots,)."""
        bearing = np.clip(seen.bearing, -0.5 * np.pi, 0.5 * np.pi)
        pursued = 2.0 * np.sin(bearing) / np.clip(seen.distance, ARRIVAL_RADIUS, self.ahead)
        sought = np.copysign(1.0 / self.tightest, seen.leg_yaw[:, 0])
        return np.where(np.isnan(pursued), sought, np.where(self._too_near(seen), 0.0, pursued))

    def _too_near(self, seen: Observation) -> NDArray[np.bool_]:
        """True if the tightest circle leads round the target and not to it."""
        radius = self.tightest
        ahead, aside = seen.distance * np.cos(seen.bearing), np.abs(seen.distance * np.sin(seen.bearing))
        inside: NDArray[np.bool_] = np.hypot(ahead, aside - radius) < radius - ARRIVAL_RADIUS
        return inside
