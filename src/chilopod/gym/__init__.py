"""Gymnasium environments: a robot that turns to a target, or walks a course, told once a gait cycle what to do.

Importing this registers ``chilopod/Turn-v0`` and ``chilopod/Course-v0``, and so does
``gymnasium.make("chilopod.gym:chilopod/Turn-v0")``. ``episodes`` is the one implementation, of a batch over
:class:`chilopod.engine.Walk`, which needs no Gymnasium; ``envs`` shows it as :class:`gymnasium.vector.VectorEnv` and,
one robot of it, as :class:`gymnasium.Env`.
"""

from typing import TYPE_CHECKING

from chilopod.extras import needs
from chilopod.lazy import exports

needs("gymnasium", extra="gym")

import gymnasium  # noqa: E402  (there, as has just been seen)

if TYPE_CHECKING:
    from chilopod.gym.actions import Actions
    from chilopod.gym.envs import CourseEnv, CourseVectorEnv, TurnEnv, TurnVectorEnv
    from chilopod.gym.episodes import Episodes, Rewards
    from chilopod.gym.policies import Policy, Steered, baseline
    from chilopod.gym.sight import Sight
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "actions": ("Actions",),
            "envs": ("CourseEnv", "CourseVectorEnv", "TurnEnv", "TurnVectorEnv"),
            "episodes": ("Episodes", "Rewards"),
            "policies": ("Policy", "Steered", "baseline"),
            "sight": ("Sight",),
        },
    )

__all__ = [
    "Actions",
    "CourseEnv",
    "CourseVectorEnv",
    "Episodes",
    "Policy",
    "Rewards",
    "Sight",
    "Steered",
    "TurnEnv",
    "TurnVectorEnv",
    "baseline",
]

for _task in ("Turn", "Course"):
    if f"chilopod/{_task}-v0" not in gymnasium.registry:  # this module may be loaded again
        gymnasium.register(
            f"chilopod/{_task}-v0",
            entry_point=f"chilopod.gym.envs:{_task}Env",
            vector_entry_point=f"chilopod.gym.envs:{_task}VectorEnv",
        )
