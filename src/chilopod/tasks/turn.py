"""One turn: which spring leads to a target, and how the robot gets there with it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import units
from chilopod.analysis.parameters import K1
from chilopod.engine import Controller, engine_named
from chilopod.engine.named import check_controller, path_of
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Short
from chilopod.notebook import block, table, words
from chilopod.progress import Progress, silent
from chilopod.record import LONGEST, in_range
from chilopod.robot import Robot
from chilopod.steering import Criteria, Strategy, Target, earliest_arrival, evaluate
from chilopod.tasks.radius_law import radius_law
from chilopod.tasks.shown import paths
from chilopod.tasks.walk import check_repeats, foot_creep, repeated
from chilopod.trials import NONE, Trial, check_fits, run, straight, together

Array = NDArray[np.float64]

_SOFTEST = 1.0 / 20.0  # of the stiffest spring: where a strategy without a radius law starts to look
_ROUNDS = 2
_LEAST = 5.0  # s
_AS_NEAR = 1e-9  # m


@dataclass(frozen=True)
class Turn(Short):
    """A turning task and how it went.

    Attributes
    ----------
    robot
        With the spring it walked with.
    target, strategy, engine
        As given to :func:`turn`.
    controller
        Controller of the walks, the strategy's or one's own; None without steering.
    by_law
        The spring whose settled walk has the radius of the circle to the target, the paper's k1-hat, N*m/rad; None
        where there is no such spring or none was asked for.
    stiffness
        The spring it walked with, N*m/rad; None where the strategy leaves the springs alone.
    record
        Record of all repeats.
    criteria
        At the earliest arrival of any repeat, or at the end if none arrives.
    """

    robot: Robot
    target: Target
    strategy: Strategy
    engine: str
    controller: Controller | None
    by_law: float | None
    stiffness: float | None
    record: xr.Dataset
    criteria: Criteria

    @property
    def straight(self) -> bool:
        """See :func:`chilopod.trials.straight`."""
        return straight(self.record)

    @cached_property
    def foot_creep(self) -> float | None:
        """See :func:`chilopod.tasks.walk.foot_creep`."""
        return foot_creep(self.robot, self.engine)

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; null for what there is not."""

        def plain(value: float | None) -> float | None:
            return float(value) if value is not None and np.isfinite(value) else None

        found = self.criteria
        return {
            "robot": self.robot.name,
            "strategy": self.strategy.name,
            "engine": self.engine,
            "controller": None if self.controller is None else path_of(type(self.controller)),
            "target": {"bearing_rad": self.target.bearing, "distance_m": self.target.distance},
            "circle_radius_m": plain(self.target.radius),
            "spring_by_law_N_m_rad": plain(self.by_law),
            "spring_N_m_rad": plain(self.stiffness),
            "evaluation_time_s": found.time,
            "walks": [
                {
                    "outcome": outcome.label,
                    "arrival_s": plain(found.arrival[i]),
                    "nearest_m": plain(found.nearest[i]),
                    "epsilon1_m": plain(found.distance[i]),
                    "epsilon2_rad": plain(found.angle[i]),
                    "epsilon3_rad2_s": plain(found.effort[i]),
                }
                for i, outcome in enumerate(found.outcome)
            ],
            "foot_creep_N_s_m": self.foot_creep,
        }

    def _repr_html_(self) -> str:
        said = f"The circle to it has a radius of {self.target.radius:.3g} m."
        for name, spring in (("settles on it", self.by_law), ("was walked with", self.stiffness)):
            if spring is not None:
                said += f" The spring that {name}: {units.from_si(spring, 'N*mm/deg'):.4g} N·mm/deg."
        found = self.criteria
        rows = [
            (outcome.label, f"{arrival:.2f}" if np.isfinite(arrival) else "-", f"{nearest:.3f}")
            for outcome, arrival, nearest in zip(found.outcome, found.arrival, found.nearest, strict=True)
        ]
        return block(
            f"{self.robot.name}, {self.engine}: turn to {self.target} by {self.strategy.name}",
            paths(self.record),
            words(said),
            table(("outcome", "arrival (s)", "nearest (m)"), rows),
        )


def turn(
    robot: Robot,
    target: Target,
    strategy: Strategy,
    spring: float | str = "auto",
    *,
    duration: float | None = None,
    seed: int | None = None,
    repeats: int = 1,
    engine: str = "planar",
    controller: Controller | None = None,
    folder: str | Path | None = None,
    progress: Progress = silent,
) -> Turn:
    """Walk to a target.

    Parameters
    ----------
    robot
        The robot.
    target
        Target of the turn.
    strategy
        Strategy, one of :data:`chilopod.steering.STRATEGIES`.
    spring
        Spring of the strategy, N*m/rad; or ``law``: the paper's k1-hat, from the radius law; or ``auto``: what comes
        nearest to the target in undisturbed simulated trials, which takes into account that a walk needs time to bend.
        Without leg yaw nothing bends undisturbed, and ``auto`` is ``law``.
    duration
        s; by default what the circle takes at the speed of the straight walk without slip, times the engine's haste,
        see :class:`chilopod.engine.Traits`; at least 5 s.
    seed, repeats, progress
        As for :func:`chilopod.tasks.walk`.
    engine
        One of :data:`chilopod.engine.ENGINES`, or one's own as ``package.module:object``. The radius law of the planar
        model is that of its exact branch, any other's that of trials.
    controller
        In place of the strategy's: a frozen dataclass, see :class:`chilopod.trials.Trial`.
    folder
        Folder of all trials, of the radius law and of the search too; without one nothing is kept.

    Raises
    ------
    AnalysisError
        If no spring turns tightly enough.
    """
    if spring not in ("auto", "law") and isinstance(spring, str):
        raise ParameterError("is no spring", field="spring", value=spring, allowed="auto, law, or a stiffness")
    if strategy.springs is None and spring != "auto":
        raise ParameterError(
            f"is of no use to {strategy.name}, which leaves the springs alone",
            field="spring",
            value=spring,
            allowed="auto",
        )
    check_repeats(seed, repeats)
    traits = engine_named(engine).traits
    engine_named(engine).common(robot)
    if controller is not None:
        check_controller(controller)
    time = duration if duration is not None else _time_for(robot, target, traits.haste)
    in_range("duration", time, LONGEST, "s")
    check_fits(repeated(Trial(robot, time, target=target, engine=engine), seed, repeats))
    law = None
    if isinstance(spring, str) and strategy.springs == K1:

        def shown(done: float, words: str) -> None:
            progress(0.4 * done, f"radius law, {words}")

        law = radius_law(robot, engine, folder, shown)
    by_law = law.value(target.radius) if law else None
    if strategy.springs is None:
        stiffness = None
    elif not isinstance(spring, str):
        stiffness = spring
    elif spring == "law" or not (strategy.leg_yaw or controller):
        if by_law is None:
            raise AnalysisError("only the first spring has a radius law", field="spring", value=spring)
        stiffness = by_law
    else:
        between = (float(law.values[0]), 1.5 * law.pitchfork) if law else _around(robot)
        progress(0.4, "trials with many springs")
        stiffness = best_spring(robot, target, strategy, between, time, engine, controller, folder)
    progress(0.9, "walk")
    walker, steering, _ = strategy.prepare(robot, None, stiffness, controller)
    trial = Trial(walker, time, target=target, controller=steering, engine=engine, poses=traits.poses)
    record = together(run(repeated(trial, seed, repeats), folder))
    when = earliest_arrival(record)
    criteria = evaluate(record, when if np.isfinite(when) else float(record.time[-1]))
    return Turn(walker, target, strategy, engine, steering, by_law, stiffness, record, criteria)


def best_spring(
    robot: Robot,
    target: Target,
    strategy: Strategy,
    between: tuple[float, float],
    duration: float,
    engine: str = "planar",
    controller: Controller | None = None,
    folder: str | Path | None = None,
) -> float:
    """The spring of a strategy that comes nearest to the target, by undisturbed trials on ever finer grids, N*m/rad."""
    low, high = between
    tried = engine_named(engine).traits.a_round
    values = np.geomspace(low, high, tried)
    best = 0
    for round_ in range(_ROUNDS):
        if round_:
            values = np.linspace(values[max(best - 1, 0)], values[min(best + 1, tried - 1)], tried)
        trials = []
        for value in values:
            walker, steering, _ = strategy.prepare(robot, None, float(value), controller)
            trials.append(Trial(walker, duration, 0, (), target, steering, NONE, rate=20.0, engine=engine))
        record = together(run(trials, folder))
        nearest = evaluate(record, duration).nearest
        # Of springs that do equally well the stiffest.
        best = int(np.flatnonzero(nearest <= np.nanmin(nearest) + _AS_NEAR)[-1])
    return float(values[best])


def _around(robot: Robot) -> tuple[float, float]:
    stiffest = max(robot.springs.stiffness)
    return _SOFTEST * stiffest, stiffest


def _time_for(robot: Robot, target: Target, haste: float) -> float:
    angle = abs(target.bearing)
    arc = target.distance * (angle / np.sin(angle) if angle > 0.0 else 1.0)
    return float(max(_LEAST, haste * arc / robot.gait.speed))
