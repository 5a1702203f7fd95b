"""Walks that differ in nothing but their seed: what every verb that walks is asked for, and what its result has."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import xarray as xr

from chilopod.engine import HasFootCreep, engine_named
from chilopod.engine.named import path_of
from chilopod.notebook import Summary
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.trials import NONE, Trial, run


class RunOptions(TypedDict, total=False):
    """Options of every verb that walks: how often, and where that is kept and told.

    Attributes
    ----------
    seed
        Seed of the first walk's disturbances, the others count up from it; None (default) for no disturbance at all.
    repeats
        Number of walks, by default 1.
    folder
        Folder where all trials are kept; without one nothing is kept.
    progress
        Called with the part done (0 to 1) and a few words.
    """

    seed: int | None
    repeats: int
    folder: str | Path | None
    progress: Progress


def runs(
    trial: Trial,
    seed: int | None = None,
    repeats: int = 1,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> tuple[tuple[Trial, ...], list[xr.Dataset]]:
    """Trials of a walk and their records, by :class:`RunOptions`."""
    trials = trial.repeated(seed, repeats)
    return trials, run(trials, folder, progress)


@dataclass(frozen=True)
class Runs(Summary):
    """Walks that differ in nothing but their seed.

    Attributes
    ----------
    trials
        With all that makes each of them.
    """

    trials: tuple[Trial, ...]

    @property
    def first(self) -> Trial:
        """All but the seed is the same in the others."""
        return self.trials[0]

    @property
    def robot(self) -> Robot:
        """Robot that walked."""
        return self.first.robot

    @property
    def engine(self) -> str:
        """Name of the engine."""
        return self.first.engine

    @property
    def who(self) -> str:
        """Names of robot and engine."""
        return f"{self.robot.name}, {self.engine}"

    @property
    def seeds(self) -> list[int | None]:
        """Seed of every walk; None of one that was not disturbed."""
        return [None if trial.disturbance == NONE else trial.seed for trial in self.trials]

    @property
    def labels(self) -> list[str]:
        """:attr:`seeds` in words."""
        return ["-" if seed is None else str(seed) for seed in self.seeds]

    @cached_property
    def foot_creep(self) -> float | None:
        """How firmly the engine's floor holds standing feet: the coefficient of viscous friction across the way that
        lets them creep as much, N*s/m; None where they do not creep, or the robot does not stand."""
        engine = engine_named(self.engine)
        found = engine.foot_creep(self.robot).across if isinstance(engine, HasFootCreep) else np.inf
        return found if np.isfinite(found) else None

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; null for what there is not."""
        steering = self.first.controller
        controller = None if steering is None else path_of(type(steering))
        told = {"robot": self.robot.name, "engine": self.engine, "controller": controller, **self._found()}
        return {**told, "foot_creep_N_s_m": self.foot_creep}

    def _found(self) -> dict[str, Any]:
        return {}
