"""Steering by the first spring, once in a gait cycle, from the robot's sensors alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from chilopod import units
from chilopod.engine import Command, Event, Observation
from chilopod.errors import ParameterError
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.gait import Gait
from chilopod.robot import Robot
from chilopod.steering.leg_yaw import SIDES, LegYawController
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.target import ARRIVAL_RADIUS

_AHEAD = 2.0  # modules


@dataclass(frozen=True, eq=False)
class SpringLaw(ReadOnlyArrays):
    """Steering law that compares the bend of the body with the bend of the circle to the target.

    When the left leg of module 1 swings, the desired curvature is 2 sin(psi) / D, that of the circle to a point on the
    line to the target a distance D ahead, no farther than the target itself (pure pursuit). It is compared with that of
    the body axis, the sum of joint angles over (N-1) L. The first spring is then

    - as soft as possible where the body bends less, because a bend grows by only a few percent a second beside the
      pitchfork;
    - that of the inverse radius law, the paper's k1-hat, where it bends as desired, which keeps the bend;
    - as stiff as possible where it bends more or to the wrong side, where the desired bend is nearly zero, and where a
      joint reaches its limit, which straightens it.

    The desired bend is zero where the target lies so far within the tightest circle that the robot would circle it for
    ever. Where the target is out of view it is the tightest, to the side that the legs were last turned to, until the
    target is in view again. The legs of module 1 yaw as in the paper, which decides the side of a new bend. The
    commands depend on one observation only.

    Attributes
    ----------
    softest, stiffest
        Ends of the range of the first spring, N*m/rad.
    curvatures, springs
        The inverse radius law: 1/m, rising from 0 at the pitchfork, and N*m/rad.
    tightest, arm
        Radius of the tightest circle, and (N-1) L of the paper's radius, m.
    ahead
        D, m, two module lengths: the reach of the first two joints. Half of that and half as much again work as well; a
        circle all the way to a far target is too wide.
    band
        Tolerance of the bend as a fraction of the desired bend. Values between 0.15 and 0.3 work equally well.
    straight, most_bent
        Desired bend of all joints together that is left to the legs, and the largest bend of one joint, rad; at a right
        angle modules collide.
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
        """Build the law of a robot from its size, its springs, the actuator of the first one, and its radius law. The
        range of the spring goes from that of the tightest walk of the radius law to the stiffest of the axis, within
        the limits of the actuator. ParameterError if the actuator leaves no range."""
        own = robot.springs
        softest = max(float(law.values[0]), own.softest[0] if own.softest else 0.0)
        stiffest = min(max(own.stiffness), own.stiffest[0] if own.stiffest else np.inf)
        if not softest < stiffest:
            low, high = (units.format(each, law.unit, digits=4) for each in (softest, stiffest))
            problem, names = "must leave the first spring a range to steer with", "springs.softest, springs.stiffest"
            allowed = "the softest below the stiffest, and below the stiffest spring of the axis"
            raise ParameterError(problem, field=names, value=f"{low} to {high}", allowed=allowed)
        curvatures = np.where(np.isfinite(law.radii), 1.0 / law.radii, 0.0)
        tightest, length = law.radius(softest) if softest < law.pitchfork else law.tightest, robot.module_length
        arm, ahead = (robot.body.modules - 1) * length, _AHEAD * length
        return cls(softest, stiffest, curvatures[::-1], law.values[::-1], tightest, arm, ahead)

    def remarks(self, law: RadiusLaw) -> list[str]:
        """Remarks on the radii that the robot's actuator cannot reach."""
        found = []
        springs = self.softest, self.stiffest, law.pitchfork
        softest, stiffest, pitchfork = (units.format(each, law.unit, digits=4) for each in springs)
        if self.softest >= law.pitchfork:
            found.append(f"the softest first spring, {softest}, does not bend the straight walk; {pitchfork} does")
        elif self.softest > law.values[0]:
            tighter = f"tighter ones, down to {law.tightest:.3g} m, are out of reach"
            found.append(f"the softest first spring, {softest}, gives circles of {self.tightest:.3g} m; {tighter}")
        if self.stiffest <= law.pitchfork:
            found.append(f"the stiffest first spring, {stiffest}, does not keep the walk straight; {pitchfork} does")
        return found

    def events(self, gait: Gait) -> Sequence[Event]:
        """Events of the legs of module 1."""
        return self.leg_yaw.events(gait)

    def act(self, event: Event, seen: Observation) -> Command:
        """Command the yaw of the swinging leg, and with the left one the spring."""
        legs = self.leg_yaw.towards(event, seen)
        if event.name != SIDES[0]:
            return legs
        stiffness = seen.stiffness.copy()
        stiffness[:, 0] = self.spring(seen)
        return replace(legs, stiffness=stiffness)

    def spring(self, seen: Observation) -> Array:
        """Stiffness of the first spring for an observation, N*m/rad, shape (robots,)."""
        curvature = self.curvature(seen)
        wanted, bend = self.arm * curvature, -seen.joint_angles.sum(axis=1)
        # Ratio of the bend to the desired one; negative to the wrong side.
        share = bend * np.sign(wanted) / np.maximum(np.abs(wanted), self.straight)
        steady = np.clip(np.interp(np.abs(curvature), self.curvatures, self.springs), self.softest, self.stiffest)
        spring = np.where(share < 1.0 + self.band, steady, self.stiffest)
        spring = np.where(share < 1.0 - self.band, self.softest, spring)
        straightens = (share < 0.0) | (np.abs(wanted) < self.straight)
        straightens |= np.abs(seen.joint_angles).max(axis=1) > self.most_bent
        return np.where(straightens, self.stiffest, spring)

    def curvature(self, seen: Observation) -> Array:
        """Desired curvature, 1/m, left positive, shape (robots,)."""
        bearing = np.clip(seen.bearing, -0.5 * np.pi, 0.5 * np.pi)
        pursued = 2.0 * np.sin(bearing) / np.clip(seen.distance, ARRIVAL_RADIUS, self.ahead)
        sought = np.copysign(1.0 / self.tightest, seen.leg_yaw[:, 0])
        return np.where(np.isnan(pursued), sought, np.where(self._too_near(seen), 0.0, pursued))

    def _too_near(self, seen: Observation) -> NDArray[np.bool_]:
        """True if the tightest circle leads around the target and never to it."""
        radius = self.tightest
        ahead, aside = seen.distance * np.cos(seen.bearing), np.abs(seen.distance * np.sin(seen.bearing))
        return np.asarray(np.hypot(ahead, aside - radius) < radius - ARRIVAL_RADIUS)
