"""Gymnasium environments: a robot with a task and one action in a gait cycle.

Importing this registers ``chilopod/NAME-v0`` for every name of ``tasks.TASKS``, and so does
``gymnasium.make("chilopod.gym:chilopod/Turn-v0")``. ``episodes`` is the one implementation, of a batch over
:class:`chilopod.engine.Walk`, which needs no Gymnasium; ``envs`` shows it as :class:`gymnasium.vector.VectorEnv` and,
one robot of it, as :class:`gymnasium.Env`.
"""

from typing import TYPE_CHECKING

from chilopod.extras import needs
from chilopod.lazy import exports

needs("gymnasium", extra="gym")

import gymnasium  # noqa: E402  (there, as has just been seen)

from chilopod.gym.tasks import TASKS  # noqa: E402

if TYPE_CHECKING:
    from chilopod.gym.actions import Actions
    from chilopod.gym.envs import RobotEnv, RobotVectorEnv
    from chilopod.gym.episodes import Episodes
    from chilopod.gym.policies import Policy, Steered, baseline
    from chilopod.gym.sight import Sight
    from chilopod.gym.tasks import Look, OneTarget, RandomTargets, Rewards, Task
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "actions": ("Actions",),
            "envs": ("RobotEnv", "RobotVectorEnv"),
            "episodes": ("Episodes",),
            "policies": ("Policy", "Steered", "baseline"),
            "sight": ("Sight",),
            "tasks": ("Look", "OneTarget", "RandomTargets", "Rewards", "Task"),
        },
    )

__all__ = [
    "Actions",
    "Episodes",
    "Look",
    "OneTarget",
    "Policy",
    "RandomTargets",
    "Rewards",
    "RobotEnv",
    "RobotVectorEnv",
    "Sight",
    "Steered",
    "Task",
    "baseline",
]

for _task in TASKS:
    if f"chilopod/{_task}-v0" not in gymnasium.registry:  # this module may be loaded again
        gymnasium.register(
            f"chilopod/{_task}-v0",
            entry_point="chilopod.gym.envs:RobotEnv",
            vector_entry_point="chilopod.gym.envs:RobotVectorEnv",
            kwargs={"task": _task},
        )
