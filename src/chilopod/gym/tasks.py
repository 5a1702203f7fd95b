"""Tasks: the targets of an episode, its reward and its ending. A new one is a class and a line of :data:`TASKS`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

import numpy as np

from chilopod.engine.arguments import as_number, require
from chilopod.engine.contract import Marks
from chilopod.errors import ParameterError, nearest_name
from chilopod.flows.arguments import checked_count
from chilopod.frozen import Array
from chilopod.steering import Course, Goal, Judged, Target, random_course
from chilopod.steering.course import MOST_GOALS, RANDOM_DISTANCES


@dataclass(frozen=True)
class Rewards:
    """Weights of the reward of a step, see :meth:`Task.reward`.

    The weights are for every metre of progress towards the target, arrival at a target, every gait cycle, and the
    failure of a robot that falls or bends a joint too far, in addition to the charge for its remaining time.
    """

    progress: float = 1.0
    arrival: float = 1.0
    cycle: float = -0.01
    failure: float = -1.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            require(np.isfinite(as_number(each.name, value)), "must be finite", each.name, value)


@dataclass(frozen=True)
class Look:
    """State of a batch at the end of a step, as a task judges it; arrays have the shape (robots,).

    ``judged`` and ``busy`` are masks of the robots whose target ended, and of those that have another one; ``nearer``
    is the progress towards the target, m, NaN for robots without one; ``left`` and ``period`` are the time left for all
    targets and the length of a step, s, and ``speed`` that of the straight walk without slip, m/s.
    """

    judged: Judged
    busy: Marks
    nearer: Array
    left: Array
    period: float
    speed: float


@dataclass(frozen=True)
class Task:
    """Reward and end of an episode, with weights of the reward; subclasses define the targets."""

    rewards: Rewards = Rewards()

    def __post_init__(self) -> None:
        require(isinstance(self.rewards, Rewards), "must be a Rewards", "rewards", self.rewards)

    @property
    def farthest(self) -> float:
        """Largest distance of a target when it is set, m; by default that of random courses."""
        return RANDOM_DISTANCES[1]

    def course(self, seed: int, patience: float) -> Course:
        """Targets of the episode of a seed, each with a patience, s; the same number for every seed."""
        raise NotImplementedError

    def reward(self, look: Look) -> Array:
        """Reward of a step.

        A robot that fails is charged as if it walked straight away from its targets until their time is over, plus the
        penalty for failing. Therefore walking on is never worse than failing.
        """
        worth = self.rewards
        # Least gain of a robot that walks on in the time left.
        least = min(worth.cycle, 0.0) / look.period - abs(worth.progress) * look.speed
        reward = worth.progress * np.nan_to_num(look.nearer) + worth.arrival * look.judged.arrived
        reward += worth.cycle + np.where(look.judged.gone, worth.failure + least * look.left, 0.0)
        return np.asarray(reward)

    def ending(self, look: Look) -> tuple[Marks, Marks]:
        """Masks of the robots that have arrived at their last target or no longer walk (*terminated*), and of those
        whose time for the last target is over (*truncated*)."""
        judged = look.judged
        return judged.gone | (judged.arrived & ~look.busy), (judged.late | judged.unseen) & ~look.busy


@dataclass(frozen=True)
class RandomTargets(Task):
    """A number of random targets, one after the other, see :func:`chilopod.steering.random_course`."""

    targets: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_count("targets", self.targets, MOST_GOALS)

    def course(self, seed: int, patience: float) -> Course:
        """The course ``random:SEED``."""
        return random_course(seed, patience, self.targets)


@dataclass(frozen=True)
class OneTarget(Task):
    """One target at the same position for every seed, relative to a robot without disturbance."""

    target: Target = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(isinstance(self.target, Target), "must be a Target", "target", self.target)

    @property
    def farthest(self) -> float:
        """Distance of the target."""
        return self.target.distance

    def course(self, seed: int, patience: float) -> Course:
        """Course of the target alone."""
        x, y = self.target.position.tolist()
        return Course((Goal(x, y, relative=False),), patience)


TASKS: Final[Mapping[str, Task]] = {
    "Turn": RandomTargets(),
    "Course": RandomTargets(targets=5),
    "TaskA": OneTarget(target=Target.parse("45 deg, 1.3 m")),
    "TaskB": OneTarget(target=Target.parse("40 deg, 1.5 m")),
}
"""Tasks by name: random targets, and the two turning tasks of Aoi et al. (2022)."""


_ARGUMENTS = ("task", "robot", "engine", "springs", "patience", "disturbance", "render_mode")  # of an environment


def task_of(task: str | Task, chosen: Mapping[str, Any]) -> Task:
    """Return a task, given itself or by name, with other values of some fields. Raises ParameterError for an unknown
    task or field."""
    found = TASKS.get(task) if isinstance(task, str) else task
    if not isinstance(found, Task):
        nearest, allowed = nearest_name(str(task), TASKS), f"{', '.join(TASKS)}, or a chilopod.gym.Task"
        raise ParameterError("must be one of the tasks", field="task", value=task, allowed=allowed, nearest=nearest)
    names = [each.name for each in fields(found)]
    for name, value in chosen.items():
        problem, known = f"must be a field of {type(found).__name__} or an argument", (*names, *_ARGUMENTS)
        require(name in names, problem, name, value, ", ".join(known), nearest_name(name, known))
    return replace(found, **chosen)
