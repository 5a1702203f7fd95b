"""Strategies as policies: actions for the observations of an environment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Controller, event_times
from chilopod.gym.episodes import Episodes
from chilopod.steering import ON_THE_WAY, strategy_named
from chilopod.tasks.radius_law import radius_law

Row = NDArray[np.float32]

Policy = Callable[[Row], Row]
"""Function from observations, one row or one for each robot, to actions."""

BASELINES = {name: each for name, each in ON_THE_WAY.items() if not each.needs_torque}
"""Strategies that steer only with the actuators of actions."""


@dataclass(frozen=True)
class Steered:
    """A controller that steers by springs and leg yaw as a policy, for episodes.

    At every step the controller is called at all its events at once, with the observation at the beginning of the gait
    cycle. In a walk it is called at each event in turn, with an observation up to a cycle later. Springs that the
    controller does not set keep the stiffness of the robot file, within the range of actions.
    """

    controller: Controller
    episodes: Episodes

    def __call__(self, observation: Row) -> Row:
        """Actions for observations, one row or one for each robot."""
        rows, actions = np.atleast_2d(observation), self.episodes.actions
        seen = self.episodes.sight.seen(rows)
        yaw, stiffness = seen.leg_yaw.copy(), np.tile(actions.robot.springs.stiffness, (len(rows), 1))
        gait = actions.robot.gait
        for _, event in event_times(self.controller, gait, gait.period):
            command = self.controller.act(event, seen)
            if command.leg_yaw is not None:
                wanted = np.broadcast_to(command.leg_yaw, yaw.shape)
                yaw = np.where(wanted != seen.leg_yaw, wanted, yaw)
            if command.stiffness is not None:
                stiffness = np.broadcast_to(command.stiffness, stiffness.shape)
        springs = actions.set_by(stiffness[:, actions.joints])
        action = np.column_stack([springs, np.clip(yaw / actions.legs.limit, -1.0, 1.0)]).astype(np.float32)
        return action.reshape(*observation.shape[:-1], action.shape[1])


def baseline(name: str, episodes: Episodes, engine: str = "planar") -> Steered:
    """A strategy of :data:`chilopod.steering.ON_COURSES` as a policy: ``leg-yaw``, the paper's controller with constant
    springs, or ``variable``, which also sets the first spring, by a radius law of the engine, see
    :func:`chilopod.tasks.radius_law`.

    Raises ParameterError or AnalysisError for an unknown name, or if the strategy needs a radius law and the robot has
    none.
    """
    strategy = strategy_named(name, BASELINES)
    law = radius_law(episodes.robot, engine) if strategy.needs_law else None
    controller = strategy.prepare(episodes.robot, law).controller
    assert controller is not None  # both steer
    return Steered(controller, episodes)
