"""Episodes of a batch of robots, step by step, without Gymnasium.

A step is a gait cycle. Robots whose episode is over stand still for the next step and begin another at its end, while
the others walk on: Gymnasium's autoreset mode ``NEXT_STEP``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod import memory
from chilopod.engine import Observation, Walk, engine_named
from chilopod.engine.arguments import require
from chilopod.engine.contract import Marks
from chilopod.errors import ParameterError
from chilopod.flows.arguments import checked_count
from chilopod.frozen import Array
from chilopod.gym.actions import Actions
from chilopod.gym.sight import Sight
from chilopod.gym.tasks import Look, Task, task_of
from chilopod.record import LONGEST
from chilopod.robot import Robot
from chilopod.steering import CourseReferee, Judged, Verdict
from chilopod.tasks.course import patience_of
from chilopod.trials.trial import Disturbance, Drawn, conditions, draw

_MOST = 1 << 20  # robots
_A_LOOK = 2.0 * (8.0 + 1.0)  # bytes of a look's error and its miss, drawn and in one array
_SEEDS = 1 << 31  # seeds of episodes without a given one are less than this


@dataclass(frozen=True)
class Step:
    """Result of a step, for every robot of a batch; the arrays are the caller's to keep.

    See :class:`chilopod.gym.Sight` and :class:`chilopod.gym.Task`; the reward of a robot whose episode has just begun
    is 0. The info has ``time`` of the episode (s), ``distance`` of the target (m), ``pose`` of module 1 (m, m, rad),
    ``verdict`` on the target that ended in this step, or "", and ``arrived``: number of targets reached so far.
    """

    observation: NDArray[np.float32]
    reward: Array
    terminated: Marks
    truncated: Marks
    info: dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Moment:
    """A batch at the end of a step, for pictures: x, y and heading of module 1 (m, m, rad), joint angles and leg yaw
    (rad), stiffness of the springs (N·m/rad), and positions of the targets (m), each of shape (robots, ...)."""

    pose: Array
    joint_angles: Array
    leg_yaw: Array
    stiffness: Array
    aims: Array


class Episodes:
    """Robots that walk to targets, each in its own episode. Raises ParameterError for an unknown robot, engine or task.

    Parameters
    ----------
    robot, count, engine
        Robot, number of episodes at once, and name of the engine.
    task, chosen
        Task, or its name among :data:`chilopod.gym.tasks.TASKS`; fields of it with other values, such as ``targets`` or
        ``rewards``.
    springs
        Springs that actions set, see :class:`chilopod.gym.Actions`.
    patience
        Patience for each target, s; by default the engine's, see :func:`chilopod.tasks.course.patience_of`.
    disturbance
        Disturbance of the start and of bearings, as in trials.
    remember
        True to keep ``moments`` of the steps so far, as many as the longest episode has.

    ``actions`` and ``sight`` are the meaning of actions and of observations, and ``period`` is the length of a step, s.
    """

    def __init__(
        self,
        robot: Robot,
        count: int = 1,
        *,
        task: str | Task = "Turn",
        engine: str = "planar",
        springs: Literal["first", "all"] = "first",
        patience: float | None = None,
        disturbance: Disturbance = Disturbance(),  # noqa: B008  (frozen)
        remember: bool = False,
        **chosen: Any,
    ) -> None:
        self.task = task_of(task, chosen)
        self.count = checked_count("num_envs", count, _MOST)
        require(isinstance(disturbance, Disturbance), "must be a Disturbance", "disturbance", disturbance)
        disturbance.check_foot(robot.body.modules)
        self._name, self._engine = engine, engine_named(engine)
        self._engine.common(robot)
        self.actions = Actions.of(robot, springs)
        self._patience = patience_of(engine) if patience is None else patience
        self._disturbance = disturbance
        common = self.task.course(0, self._patience)
        self.sight = Sight(self.actions, common.range)
        gait, least = robot.gait, self.task.farthest / robot.gait.speed
        problem, allowed = "must be long enough to reach the farthest target", f"{least:g} s or more"
        require(self._patience >= least, problem, "patience", f"{self._patience:g} s", allowed)
        self.period = gait.period
        self._looks = int(np.ceil(common.duration / gait.period)) + len(common.goals) + 1
        needed, free = _A_LOOK * self._looks * self.count, memory.available()
        problem, asked = f"would take {memory.in_words(needed)} of memory", f"{self.count} * {common.duration:g} s"
        allowed = f"fewer or shorter episodes: {memory.in_words(free)} are free"
        require(needed <= free, problem, "num_envs * targets * patience", asked, allowed)
        self.moments: deque[Moment] | None = deque(maxlen=self._looks) if remember else None
        self._walk: Walk | None = None
        self._generators: list[np.random.Generator] = []

    def __getstate__(self) -> dict[str, Any]:
        # An engine may be a module, and a walk compiled: both are rebuilt, the walk to the bit.
        saved = None if self._walk is None else self._walk.save()
        return {**self.__dict__, "_engine": None, "_walk": saved}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _engine=engine_named(state["_name"]))
        self._walk = None if state["_walk"] is None else self._engine.resume(state["_walk"])

    @property
    def robot(self) -> Robot:
        """Robot that walks, with the actuators that actions need."""
        return self.actions.robot

    def steps(self, robot: int) -> int:
        """Number of steps that the present episode of a robot has had so far."""
        return int(self._cycle - self._since[robot])

    def begin(self, generators: Sequence[np.random.Generator], seeds: Sequence[int | None]) -> Step:
        """Begin an episode with every robot, in a new walk, with the disturbance of trials with its seed. A seed of
        None, and the seeds of later episodes, are drawn from the robot's generator."""
        self._generators = list(generators)
        return self._begin(seeds)

    def step(self, actions: ArrayLike) -> Step:
        """Walk for a gait cycle by actions of shape (robots, numbers of an action), see :class:`chilopod.gym.Actions`;
        those of robots whose episode was over are not used. Raises ParameterError, and changes nothing, before the
        first episode, or for an invalid action."""
        if self._walk is None:
            raise ParameterError("must not be called before the first reset", field="step", allowed="reset() first")
        checked, waiting, walk = self.actions.checked(actions, self.count), self._ended, self._walk
        if waiting.all():
            return self._begin([None] * self.count)
        for phase, command in self.actions.commands(checked, self._leg_yaw):
            walk.advance((self._cycle + phase) * self.period)
            walk.command(command)
        self._cycle += 1
        walk.advance(self._cycle * self.period)
        if waiting.any():
            self._restart(walk, waiting)
        return self._look(walk, waiting)

    def _begin(self, seeds: Sequence[int | None]) -> Step:
        drawn, courses, start = self._drawn(np.arange(self.count), seeds)
        self._walk = self._engine.start(self.robot, record=None, **start)
        missed = np.stack([each.missed for each in drawn])
        self._referee = CourseReferee(courses, self.robot.gait, missed, keep=False)
        self._errors = np.stack([each.bearing for each in drawn])
        self._cycle, self._since = 0, np.zeros(self.count, dtype=np.intp)
        self._away, self._arrived = np.full(self.count, np.nan), np.zeros(self.count, dtype=np.intp)
        if self.moments is not None:
            self.moments.clear()
        return self._look(self._walk, np.ones(self.count, dtype=np.bool_))

    def _restart(self, walk: Walk, which: Marks) -> None:
        ids = np.flatnonzero(which)
        drawn, courses, start = self._drawn(ids, [None] * len(ids))
        walk.restart(which, **start)
        self._referee.restart(which, courses, np.stack([each.missed for each in drawn]))
        self._errors[ids] = np.stack([each.bearing for each in drawn])
        self._since[ids], self._arrived[ids] = self._cycle, 0

    def _drawn(
        self, ids: NDArray[np.intp], seeds: Sequence[int | None]
    ) -> tuple[list[Drawn], list[Any], dict[str, Any]]:
        """Disturbances, courses and start arguments of new episodes of some robots."""
        chosen = [
            int(self._generators[robot].integers(_SEEDS)) if seed is None else seed
            for robot, seed in zip(ids.tolist(), seeds, strict=True)
        ]
        modules = self.robot.body.modules
        drawn = [draw(self._disturbance, seed, modules, self._looks) for seed in chosen]
        start = conditions(self._engine, self.robot, drawn, self._disturbance.bearing > 0.0)
        return drawn, [self.task.course(seed, self._patience) for seed in chosen], start

    def _look(self, walk: Walk, fresh: Marks) -> Step:
        """Judge the targets, set the next ones, and observe, at the end of a step."""
        referee, seen, pose = self._referee, walk.observe(), walk.pose()
        away, left = _distance(referee.aims, pose), referee.time_left(walk.time)
        judged = referee.judge(walk)
        busy, aims = referee.busy, referee.aims
        others = judged.moved & busy
        if others.any():
            # A robot without further targets shows the last one again.
            again = walk.observe()
            bearing = np.where(others, again.bearing, seen.bearing)
            seen = replace(seen, bearing=bearing, distance=np.where(others, again.distance, seen.distance))
        look = Look(judged, busy, self._away - away, left, self.period, self.robot.gait.speed)
        reward = self._rewarded(look, fresh)
        self._away = np.where(others, _distance(aims, pose), away)
        terminated, truncated = self.task.ending(look)
        if (self._cycle + 1) * self.period > LONGEST:
            truncated |= busy  # no walk is longer; the next step begins another
        self._arrived += judged.arrived
        self._ended, self._leg_yaw = terminated | truncated, seen.leg_yaw
        if self._ended.any():
            walk.halt(self._ended)
        if self.moments is not None:
            self.moments.append(Moment(pose, seen.joint_angles, seen.leg_yaw, seen.stiffness, aims))
        time = (self._cycle - self._since) * self.period
        info = {"time": time, "distance": self._away.copy(), "pose": pose, "verdict": _verdicts(judged)}
        info["arrived"] = self._arrived.copy()
        return Step(self.sight.row(self._through(seen)), reward, terminated, truncated, info)

    def _rewarded(self, look: Look, fresh: Marks) -> Array:
        """Reward of the task, checked: one finite number for each robot, 0 where an episode has just begun."""
        reward = np.asarray(self.task.reward(look), dtype=np.float64)
        fits = reward.shape == look.left.shape
        require(fits, "must give one reward for each robot", "reward", f"shape {reward.shape}")
        reward = np.where(fresh, 0.0, reward)
        require(np.isfinite(reward).all(), "must give finite rewards", "reward", reward)
        return reward

    def _through(self, seen: Observation) -> Observation:
        """Observation with the noise and the view of the scanners."""
        look = self._cycle - self._since
        if not self._engine.traits.noisy:
            bearing = seen.bearing + self._errors[np.arange(self.count), look]
            seen = replace(seen, bearing=(bearing + np.pi) % (2.0 * np.pi) - np.pi)
        return self._referee.through(look, seen)


def _distance(places: Array, pose: Array) -> Array:
    return np.asarray(np.hypot(places[:, 0] - pose[:, 0], places[:, 1] - pose[:, 1]))


def _verdicts(judged: Judged) -> NDArray[np.str_]:
    verdicts = np.full(len(judged.gone), "", dtype="U12")
    which = judged.arrived, judged.late, judged.unseen, judged.gone
    for marks, verdict in zip(which, (Verdict.ARRIVED, Verdict.LATE, Verdict.UNSEEN, Verdict.STOPPED), strict=True):
        verdicts[marks] = verdict.label
    return verdicts
