"""Environments of Gymnasium: a batch of robots, and a single robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Space
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from chilopod.engine import engine_named
from chilopod.engine.arguments import as_seeds, require
from chilopod.gym.episodes import Episodes, Step
from chilopod.robot import Robot, load_robot

if TYPE_CHECKING:
    from chilopod.gym.picture import Picture

Row = NDArray[np.float32]
Pixels = NDArray[np.uint8]
Source = str | Path | Robot | None

_PRESETS = {"planar": "aoi2022-planar", "twin": "aoi2022"}
_RENDER_MODES = ("rgb_array",)
_FPS = 10  # pictures of a film, each a gait cycle


class _Pictured:
    """Environment with pictures of its robots, which a copy draws again from the episodes."""

    episodes: Episodes
    render_mode: str | None
    _pictures: list[Picture] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_pictures": None}

    def _drawn(self) -> list[Pixels]:
        """Pictures of all robots; none without a render mode."""
        if self.render_mode is None:
            return []
        if self._pictures is None:
            from chilopod.gym.picture import Picture

            self._pictures = [Picture(self.episodes, robot) for robot in range(self.episodes.count)]
        return [picture.drawn() for picture in self._pictures]


class RobotVectorEnv(_Pictured, VectorEnv[Row, Row, NDArray[Any]]):
    """A number of robots with one task, all in one walk of an engine. Raises ParameterError for an unknown robot,
    engine, task or render mode.

    The robot is a preset, a robot file, or a robot, by default the paper's; the engine is named, and the render mode is
    ``rgb_array`` or None. Others are arguments of :class:`chilopod.gym.Episodes`: task, springs, patience, disturbance,
    and fields of the task.
    """

    metadata = {"render_modes": [*_RENDER_MODES], "render_fps": _FPS, "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        *,
        robot: Source = None,
        engine: str = "planar",
        render_mode: str | None = None,
        **named: Any,
    ) -> None:
        self.episodes = _episodes(num_envs, robot, engine, render_mode, named)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space, self.single_action_space = _spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators: list[np.random.Generator] | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Row, dict[str, Any]]:
        """Begin an episode with every robot. Robot i has ``seed`` + i, or its own seed of a list; None continues the
        generators."""
        _no_options(options, "; each robot begins again where its episode ends")
        seeds = _seeds(seed, self.num_envs)
        super().reset(seed=None if np.ndim(seed) else seeds[0])  # type: ignore[arg-type]
        if self._generators is None:
            drawn = self.np_random.integers(1 << 31, size=self.num_envs)
            self._generators = [np_random(int(each))[0] for each in drawn]
        for number, each in enumerate(seeds):
            if each is not None:
                self._generators[number] = np_random(each)[0]
        step = self.episodes.begin(self._generators, seeds)
        return step.observation, _infos(step)

    def step(
        self, actions: Row
    ) -> tuple[Row, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Walk for a gait cycle; robots whose episode was over begin another instead."""
        step = self.episodes.step(actions)
        return step.observation, step.reward, step.terminated, step.truncated, _infos(step)

    def render(self) -> tuple[Pixels, ...] | None:
        """Picture of every robot from above; None without a render mode."""
        return tuple(self._drawn()) or None


class RobotEnv(_Pictured, gymnasium.Env[Row, Row]):
    """One robot; the parameters are those of :class:`RobotVectorEnv`."""

    metadata = {"render_modes": [*_RENDER_MODES], "render_fps": _FPS}  # noqa: RUF012

    def __init__(
        self, *, robot: Source = None, engine: str = "planar", render_mode: str | None = None, **named: Any
    ) -> None:
        self.render_mode = render_mode
        self.episodes = _episodes(1, robot, engine, render_mode, named)
        self.observation_space, self.action_space = _spaces(self.episodes)
        self._over = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Row, dict[str, Any]]:
        """Begin an episode; with a seed, that of trials with the same seed."""
        _no_options(options)
        (seed,) = _seeds(seed, 1)
        super().reset(seed=seed)
        step, self._over = self.episodes.begin([self.np_random], [seed]), False
        return step.observation[0], _info(step)

    def step(self, action: Row) -> tuple[Row, float, bool, bool, dict[str, Any]]:
        """Walk for a gait cycle."""
        require(not self._over, "must not follow the end of an episode", "step", allowed="reset() first")
        step = self.episodes.step(self.episodes.actions.checked(action)[None])
        terminated, truncated = bool(step.terminated[0]), bool(step.truncated[0])
        self._over = terminated or truncated
        return step.observation[0], float(step.reward[0]), terminated, truncated, _info(step)

    def render(self) -> Pixels | None:
        """A picture of the robot, from above; None without a render mode."""
        return next(iter(self._drawn()), None)


def _episodes(count: int, robot: Source, engine: str, render_mode: str | None, named: dict[str, Any]) -> Episodes:
    known, allowed = render_mode in (None, *_RENDER_MODES), ", ".join(_RENDER_MODES)
    require(known, "must be one of the render modes", "render_mode", render_mode, allowed)
    engine_named(engine)
    if robot is None:
        robot = _PRESETS.get(engine, _PRESETS["planar"])
    walker = robot if isinstance(robot, Robot) else load_robot(robot)
    return Episodes(walker, count, engine=engine, remember=render_mode is not None, **named)


def _spaces(episodes: Episodes) -> tuple[Space[Row], Space[Row]]:
    """Spaces of observations and actions of one robot."""
    low, high = episodes.sight.bounds
    observations: Any = Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)
    actions: Any = Box(-1.0, 1.0, (len(episodes.actions.names),), dtype=np.float32)
    return observations, actions


def _seeds(seed: Any, count: int) -> list[int | None]:
    if seed is None:
        return [None] * count
    if isinstance(seed, str | bytes) or not isinstance(seed, Sequence | np.ndarray) or not getattr(seed, "ndim", 1):
        return [_whole(seed) + number for number in range(count)]
    require(len(seed) == count, f"has the wrong length {len(seed)}", "seed", allowed=str(count))
    return [None if each is None else _whole(each) for each in seed]


def _no_options(options: dict[str, Any] | None, more: str = "") -> None:
    require(not options, "must be left out", "options", list(options or ()), f"none{more}")


def _whole(seed: object) -> int:
    (number,) = as_seeds([seed], "seed") or []
    return number


def _infos(step: Step) -> dict[str, Any]:
    """Infos in the form of vector environments: every array with a mask of the robots that have it."""
    here = np.ones(len(step.reward), dtype=np.bool_)
    return {**step.info, **{f"_{name}": here.copy() for name in step.info}}


def _info(step: Step) -> dict[str, Any]:
    return {name: each[0].copy() if each.ndim > 1 else each[0].item() for name, each in step.info.items()}
