"""Body axis that is driven joint by joint, for comparison with steering by a spring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from chilopod.engine import Command, Event, Observation
from chilopod.gait import Gait
from chilopod.robot import Robot
from chilopod.steering.leg_yaw import SIDES, LegYawController
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.target import ARRIVAL_RADIUS

_A_CYCLE = 6  # the paper's scanner scans ten times a second


@dataclass(frozen=True)
class ActuatedAxis:
    """Torques bend the axis into the circle to the target, the same angle in all joints.

    At each of six instants of a gait cycle the torque of every joint holds its spring at the desired angle: the joint
    keeps its stiffness and gets another angle of rest. (Torques that also act against the error of the angle do half as
    much again of work in the planar model, and make the lightly damped joints of the twin overshoot.) Legs yaw as in
    the paper; a target out of view is searched for on the side that they were last turned to.

    Attributes
    ----------
    stiffness
        Stiffness of the springs that the torques hold, N*m/rad, (N-1,).
    module_length, most_bent
        Length of a module, m; largest desired angle of one joint, rad.
    leg_yaw
        Leg yaw of the legs of module 1.
    """

    stiffness: tuple[float, ...]
    module_length: float
    most_bent: float
    leg_yaw: LegYawController = field(default_factory=LegYawController)

    @classmethod
    def of(cls, robot: Robot, law: RadiusLaw) -> ActuatedAxis:
        """Axis of a robot, which bends no more tightly than with the softest spring of its radius law."""
        return cls(robot.springs.stiffness, robot.module_length, robot.module_length / law.tightest)

    def events(self, gait: Gait) -> Sequence[Event]:
        """Six events of the axis, and those of the legs of module 1."""
        window = gait.period / _A_CYCLE
        axis = [Event("axis", number / _A_CYCLE, window) for number in range(_A_CYCLE)]
        return [*axis, *self.leg_yaw.events(gait)]

    def act(self, event: Event, seen: Observation) -> Command:
        """Torques, or the yaw of the leg that swings."""
        if event.name in SIDES:
            return self.leg_yaw.towards(event, seen)
        curvature = 2.0 * np.sin(seen.bearing) / np.maximum(seen.distance, ARRIVAL_RADIUS)
        sought = np.copysign(np.inf, seen.leg_yaw[:, 0])
        wanted = -self.module_length * np.where(np.isnan(curvature), sought, curvature)
        angle = np.clip(wanted, -self.most_bent, self.most_bent)[:, None]
        return Command(joint_torque=np.array(self.stiffness) * angle)
