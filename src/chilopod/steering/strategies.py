"""The strategies that are compared: which springs, and whether the legs of module 1 help."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from chilopod.errors import ParameterError, nearest_name
from chilopod.robot import Robot
from chilopod.steering.leg_yaw import LegYawController


@dataclass(frozen=True)
class Strategy:
    """How a robot is made to turn.

    Attributes
    ----------
    name
        As it is typed.
    sentence
        Description of the strategy in a sentence.
    springs
        The parameter it chooses: the dotted path of one spring or of all; None leaves the springs alone.
    leg_yaw
        True if the legs of module 1 yaw towards the target.
    """

    name: str
    sentence: str
    springs: str | None
    leg_yaw: bool


STRATEGIES: Mapping[str, Strategy] = {
    each.name: each
    for each in (
        Strategy(
            "pitchfork", "a soft first spring bends the walk, leg yaw chooses the side", "springs.stiffness[0]", True
        ),
        Strategy(
            "hopf", "springs all alike and soft make the walk undulate, leg yaw turns it", "springs.stiffness", True
        ),
        Strategy("leg-yaw", "the springs stay as they are, leg yaw alone turns the robot", None, True),
        Strategy(
            "open-loop", "a soft first spring bends the walk, to whichever side it falls", "springs.stiffness[0]", False
        ),
    )
}
"""For one turn, by name."""

VARIABLE: Final = Strategy(
    "variable",
    "the first spring is set anew in every gait cycle, leg yaw chooses the side",
    "springs.stiffness[0]",
    True,
)
ACTUATED: Final = Strategy(
    "actuated", "torques at all joints bend the body axis into the circle to the target, with leg yaw", None, True
)

ON_COURSES: Mapping[str, Strategy] = {
    each.name: each for each in (VARIABLE, STRATEGIES["pitchfork"], STRATEGIES["hopf"], STRATEGIES["leg-yaw"], ACTUATED)
}
"""For courses, by name."""


def strategy_named(name: str, among: Mapping[str, Strategy] = STRATEGIES) -> Strategy:
    """One of :data:`STRATEGIES`, or of others.

    Raises
    ------
    ParameterError
        If there is none of this name.
    """
    if name not in among:
        raise ParameterError(
            "there is no such strategy",
            field="strategy",
            value=name,
            allowed=", ".join(among),
            nearest=nearest_name(name, among),
        )
    return among[name]


def steered(robot: Robot, strategy: Strategy, stiffness: float | None) -> tuple[Robot, LegYawController | None]:
    """The robot with the strategy's spring (N*m/rad; None leaves it), and its controller."""
    if strategy.springs is not None and stiffness is not None:
        robot = robot.with_value(strategy.springs, stiffness)
    return robot, LegYawController() if strategy.leg_yaw else None
