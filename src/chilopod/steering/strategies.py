"""Strategies for turning a robot. A new one is a :class:`Strategy` and an entry in ``_ALL``, see docs/courses.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

from chilopod.engine import Controller
from chilopod.errors import ParameterError, nearest_name
from chilopod.robot import Robot
from chilopod.steering.actuated import ActuatedAxis
from chilopod.steering.leg_yaw import LegYawController
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.spring_law import SpringLaw


class Prepared(NamedTuple):
    """Robot with a strategy's springs and actuators, controller of its walk or None, and sentences about both."""

    robot: Robot
    controller: Controller | None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Strategy:
    """Strategy for turning a robot; this base class keeps the springs constant during the walk.

    Attributes
    ----------
    name, sentence
        Name on the command line, and description in a sentence.
    springs
        Dotted path of the spring, or of all springs, chosen before the walk; None if the strategy chooses none.
    leg_yaw
        True if the legs of module 1 yaw towards the target.
    """

    name: str
    sentence: str
    springs: str | None = None
    leg_yaw: bool = True

    needs_law: ClassVar[bool] = False
    """True if the controller needs the robot's radius law."""

    needs_torque: ClassVar[bool] = False
    """True if the controller commands torques of the joints."""

    def check(self, spring: float | None) -> None:
        """Refuse, with a ParameterError, a spring that the strategy does not choose, and lack of one that it needs."""
        if self.springs is not None and spring is None:
            raise ParameterError(f"strategy {self.name} needs one stiffness, such as 15 N*mm/deg", field="k1")
        if self.springs is None and spring is not None:
            problem = f"must not be given: strategy {self.name} sets its own springs"
            raise ParameterError(problem, field="k1", value=spring)

    def fitted(self, robot: Robot, spring: float | None = None) -> tuple[Robot, tuple[str, ...]]:
        """Robot with the strategy's springs and actuators, and remarks on it."""
        self.check(spring)
        return (robot if self.springs is None or spring is None else robot.with_value(self.springs, spring)), ()

    def controller(self, robot: Robot, law: RadiusLaw | None) -> tuple[Controller | None, tuple[str, ...]]:
        """Controller of a :meth:`fitted` robot, and remarks on it."""
        return LegYawController() if self.leg_yaw else None, ()

    def prepare(
        self,
        robot: Robot,
        law: RadiusLaw | None = None,
        spring: float | None = None,
        controller: Controller | None = None,
    ) -> Prepared:
        """Prepare a robot for a walk, with its radius law for strategies with ``needs_law``, a spring, N*m/rad, for
        those with ``springs``, or a controller in place of the strategy's, which then needs no law. ParameterError if
        the strategy does not accept spring, law or actuators."""
        walker, remarks = self.fitted(robot, spring)
        if controller is not None:
            return Prepared(walker, controller, remarks)
        if self.needs_law and law is None:
            raise ParameterError(f"must be the radius law of the robot for strategy {self.name}", field="law")
        own, more = self.controller(walker, law)
        return Prepared(walker, own, (*remarks, *more))


@dataclass(frozen=True)
class SpringOnTheWay(Strategy):
    """Strategy that sets the first spring during the walk from the circle to the target."""

    needs_law = True

    def fitted(self, robot: Robot, spring: float | None = None) -> tuple[Robot, tuple[str, ...]]:
        """Robot with an actuator at its first spring; an ideal one if the robot file names none."""
        self.check(spring)
        adjustable = robot.springs.adjustable
        if adjustable is None:
            said = "the robot file names no actuator: the first spring is taken to change as fast as it is told to"
            return robot.override("springs.adjustable[0]", True), (said,)
        if not adjustable[0]:
            problem = f"must be true: strategy {self.name} sets the first spring while the robot walks"
            raise ParameterError(problem, field="springs.adjustable[0]", value=False, allowed="true")
        return robot, ()

    def controller(self, robot: Robot, law: RadiusLaw | None) -> tuple[Controller | None, tuple[str, ...]]:
        """Law of the first spring."""
        assert law is not None
        own = SpringLaw.of(robot, law)
        return own, tuple(own.remarks(law))


@dataclass(frozen=True)
class TorqueOnTheWay(Strategy):
    """Strategy that bends the axis into the circle to the target by torques at all joints."""

    needs_law = True
    needs_torque = True

    def controller(self, robot: Robot, law: RadiusLaw | None) -> tuple[Controller | None, tuple[str, ...]]:
        """Driven axis."""
        assert law is not None
        return ActuatedAxis.of(robot, law), ()


VARIABLE: Final = SpringOnTheWay(
    "variable", "the first spring is set anew in every gait cycle, leg yaw chooses the side"
)
LEG_YAW: Final = Strategy("leg-yaw", "the springs stay as they are, leg yaw alone turns the robot")
ACTUATED: Final = TorqueOnTheWay(
    "actuated", "torques at all joints bend the body axis into the circle to the target, with leg yaw"
)
_ALL = (
    VARIABLE,
    Strategy("pitchfork", "a soft first spring bends the walk, leg yaw chooses the side", "springs.stiffness[0]"),
    Strategy("hopf", "springs all alike and soft make the walk undulate, leg yaw turns it", "springs.stiffness"),
    LEG_YAW,
    Strategy(
        "open-loop", "a soft first spring bends the walk, to whichever side it falls", "springs.stiffness[0]", False
    ),
    ACTUATED,
)

STRATEGIES: Mapping[str, Strategy] = {each.name: each for each in _ALL if not each.needs_law}
"""Strategies for one turn, by name."""

ON_COURSES: Mapping[str, Strategy] = {each.name: each for each in _ALL if each.leg_yaw}
"""Strategies for courses, by name."""

ON_THE_WAY: Mapping[str, Strategy] = {each.name: each for each in ON_COURSES.values() if each.springs is None}
"""Strategies for courses without a spring to choose before the walk, by name."""


def check_strategy(strategy: object) -> None:
    """Refuse anything but a strategy with a ParameterError."""
    if not isinstance(strategy, Strategy):
        allowed = 'a Strategy, such as chilopod.steering.strategy_named("leg-yaw")'
        raise ParameterError("must be a strategy", field="strategy", value=strategy, allowed=allowed)


def strategy_named(name: str, among: Mapping[str, Strategy] = STRATEGIES) -> Strategy:
    """Return a strategy of :data:`STRATEGIES`, or of others, by its name; ParameterError for an unknown one."""
    if name not in among:
        nearest, allowed = nearest_name(name, among), ", ".join(among)
        others = [task for task, own in (("turn", STRATEGIES), ("course", ON_COURSES)) if name in own]
        problem = f"must be a strategy{' of this task; it is one of chilopod ' if others else ''}{' and '.join(others)}"
        raise ParameterError(problem, field="strategy", value=name, allowed=allowed, nearest=nearest)
    return among[name]
