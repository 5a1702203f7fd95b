"""Meaning of an action of -1 to 1 for the actuators of a robot, and its time in the gait cycle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from chilopod.engine import Command
from chilopod.engine.arguments import as_array, require
from chilopod.errors import ParameterError, nearest_name
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.steering.leg_yaw import SIDES, LegYawController

SPRINGS = ("first", "all")
"""Springs that an action sets."""

_SOFTEST = 1.0 / 7.0
"""Default softest spring relative to the stiffest: there the paper's robot bends ever more tightly, until a joint
leaves its range."""

_ROUNDING = 1e-6  # tolerance of single precision at the end of a range


@dataclass(frozen=True)
class Actions:
    """Springs, then the yaw of the left and of the right leg of module 1, each from -1 to 1.

    A spring goes from its softest to its stiffest by equal factors: at 0 it is their geometric mean. The yaw of a leg
    goes from the right to the left limit of the paper's controller. As there, a leg yaws while it swings, at 40 to 80 %
    of its swing; the springs ramp with the leg that swings first in the cycle. Thus an action takes effect within a
    gait cycle of its observation, and feet are not dragged across the floor.

    The robot has an actuator for each of the springs, whose joints are counted from 0; ``softest`` and ``stiffest`` are
    the ends of the range of each spring, N*m/rad, and the controller ``legs`` defines yaw limit and swing.
    """

    robot: Robot
    joints: tuple[int, ...]
    softest: tuple[float, ...]
    stiffest: tuple[float, ...]
    legs: LegYawController = field(default_factory=LegYawController)

    @classmethod
    def of(cls, robot: Robot, springs: Literal["first", "all"] = "first") -> Actions:
        """Actions of a robot on its first spring or on all adjustable springs.

        A robot without any actuator gets ideal ones. The default range goes from a seventh of the stiffest spring of
        the axis to that spring. Raises ParameterError if a spring has no actuator, or an empty range.
        """
        near = nearest_name(str(springs), SPRINGS)
        require(springs in SPRINGS, f"must be {' or '.join(SPRINGS)}", "springs", springs, nearest=near)
        own = robot.springs
        if own.adjustable is None:
            every = springs == "all"
            robot = robot.override("springs.adjustable" if every else "springs.adjustable[0]", True)
        can = robot.springs.adjustable or ()
        joints = (0,) if springs == "first" else tuple(joint for joint, each in enumerate(can) if each)
        driven = any(can) and all(can[joint] for joint in joints)
        require(driven, "must be true: the action sets the first spring", "springs.adjustable[0]", False)
        most = max(own.stiffness)
        softest = tuple(own.softest[joint] if own.softest else _SOFTEST * most for joint in joints)
        stiffest = tuple(own.stiffest[joint] if own.stiffest else most for joint in joints)
        for low, high in zip(softest, stiffest, strict=True):
            names, given = "springs.softest, springs.stiffest", f"{low:g}, {high:g} N*m/rad"
            require(low < high, "must leave each spring a range", names, given)
        return cls(robot, joints, softest, stiffest)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each number of an action."""
        springs = (f"spring of joint {joint + 1}" for joint in self.joints)
        return (*springs, *(f"yaw of the {side} leg" for side in SIDES))

    @property
    def moments(self) -> tuple[tuple[float, float, int], ...]:
        """Times of leg yaw in order: fraction of the cycle, duration (s), and leg."""
        events = self.legs.events(self.robot.gait)
        return tuple(sorted((each.phase, each.window, SIDES.index(each.name)) for each in events))

    def checked(self, actions: ArrayLike, *robots: int) -> Array:
        """Copy of actions of shape (len(names),), or (robots, len(names)) for a batch. Raises ParameterError for a
        wrong shape, NaN, or values out of range."""
        array, shape = as_array("action", actions), (*robots, len(self.names))
        problem = f"must be {shape}, the numbers {', '.join(self.names)}"
        require(array.shape == shape, problem, "action.shape", array.shape)
        inside = np.abs(array) <= 1.0 + _ROUNDING
        if not inside.all():
            place = np.argwhere(~inside)[0].tolist()
            problem, value = f"the {self.names[place[-1]]} is out of range", float(array[tuple(place)])
            raise ParameterError(problem, field=f"action{place}", value=value, allowed="-1 to 1")
        return np.clip(array, -1.0, 1.0)

    def stiffness(self, actions: Array) -> Array:
        """Stiffness of the springs that an action sets, N*m/rad, shape (robots, len(joints))."""
        low, high = np.log(self.softest), np.log(self.stiffest)
        return np.asarray(np.exp(low + 0.5 * (actions[:, : len(self.joints)] + 1.0) * (high - low)))

    def set_by(self, stiffness: Array) -> Array:
        """Actions that set springs to a stiffness, N*m/rad, within their ranges, shape (robots, len(joints))."""
        low, high = np.log(self.softest), np.log(self.stiffest)
        return np.clip(2.0 * (np.log(stiffness) - low) / (high - low) - 1.0, -1.0, 1.0)

    def commands(self, actions: Array, leg_yaw: Array) -> list[tuple[float, Command]]:
        """Times of a gait cycle, as fractions of it, with their commands, from :meth:`checked` actions and the present
        leg yaw, rad, shape (robots, 2)."""
        stiffness = np.tile(self.robot.springs.stiffness, (len(actions), 1))
        stiffness[:, self.joints] = self.stiffness(actions)
        wanted, yaw = self.legs.limit * actions[:, len(self.joints) :], leg_yaw.copy()
        timed = []
        for number, (phase, window, side) in enumerate(self.moments):
            yaw[:, side] = wanted[:, side]
            springs = stiffness if number == 0 else None
            timed.append((phase, Command(leg_yaw=yaw.copy(), stiffness=springs, within=window)))
        return timed
