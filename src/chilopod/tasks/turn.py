"""One turn: the spring that leads to a target, and the walk with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack, cast

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.parameters import K1
from chilopod.engine import Controller, engine_named
from chilopod.errors import AnalysisError, ParameterError
from chilopod.notebook import finite
from chilopod.progress import part, silent
from chilopod.robot import Robot
from chilopod.steering import Criteria, Strategy, Target, earliest_arrival, evaluate
from chilopod.steering.strategies import check_strategy
from chilopod.tasks.radius_law import radius_law
from chilopod.tasks.walk import Pathed, RunOptions, runs
from chilopod.trials import NONE, Trial, check_fits, run, straight, together

_SOFTEST = 1.0 / 20.0  # of the stiffest spring: start of the search for a strategy without a radius law
_ROUNDS = 2
_LEAST = 5.0  # s
_AS_NEAR = 1e-9  # m
_TOLD = {
    "arrival": "arrival_s",
    "nearest": "nearest_m",
    "distance": "epsilon1_m",
    "angle": "epsilon2_rad",
    "effort": "epsilon3_rad2_s",
}


@dataclass(frozen=True)
class Turn(Pathed):
    """Result of a turning task.

    Attributes
    ----------
    trials, strategy
        Trials of the walks, whose robot has the spring that was used; and the strategy.
    by_law
        Spring whose settled walk has the radius of the circle to the target, the paper's k1-hat, N*m/rad; None if there
        is no such spring or it was not requested.
    stiffness
        Spring that was used, N*m/rad; None if the strategy does not set the springs.
    record, criteria
        Record of all repeats; criteria at the earliest arrival of any of them, or at the end if none arrives.
    """

    strategy: Strategy
    by_law: float | None
    stiffness: float | None
    record: xr.Dataset
    criteria: Criteria

    @property
    def target(self) -> Target:
        """Target given to :func:`turn`."""
        return cast(Target, self.first.target)

    @property
    def straight(self) -> bool:
        """See :func:`chilopod.trials.straight`."""
        return straight(self.record)

    def _found(self) -> dict[str, Any]:
        found = self.criteria
        return {
            "strategy": self.strategy.name,
            "target": {"bearing_rad": self.target.bearing, "distance_m": self.target.distance},
            "circle_radius_m": finite(self.target.radius),
            "spring_by_law_N_m_rad": finite(self.by_law),
            "spring_N_m_rad": finite(self.stiffness),
            "evaluation_time_s": found.time,
            "walks": [
                {"outcome": outcome.label, **{key: finite(getattr(found, name)[i]) for name, key in _TOLD.items()}}
                for i, outcome in enumerate(found.outcome)
            ],
        }

    @property
    def title(self) -> str:
        """Robot, engine, target and strategy in words."""
        return f"{self.who}: turn to {self.target} by {self.strategy.name}"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        found, radius = self.criteria, self.target.radius
        circle = f"has a radius of {radius:.3f} m" if np.isfinite(radius) else "is a straight line"
        above = [f"{self.strategy.name}: {self.strategy.sentence}", f"the circle to the target {circle}"]
        springs = {"by the settled radius (the paper's k1-hat)": self.by_law, "walked with": self.stiffness}
        for name, spring in springs.items():
            if spring is not None:
                above.append(f"spring {name}: {units.format(spring, 'N*mm/deg', digits=4)}")
        measures = "distance left, angle and effort (the paper's epsilon 1 to 3)"
        above.append(f"{measures} at {found.time:.2f} s; nearest at any time")
        head = "seed", "outcome", "arrival (s)", "nearest (m)", "left (m)", "angle (deg)", "effort (rad2 s)"
        rows: list[Sequence[str]] = [head]
        for i, (label, outcome) in enumerate(zip(self.labels, found.outcome, strict=True)):
            arrival = f"{found.arrival[i]:.2f}" if np.isfinite(found.arrival[i]) else "never"
            nearest, left, effort = f"{found.nearest[i]:.4f}", f"{found.distance[i]:.3f}", f"{found.effort[i]:.4f}"
            rows.append((label, outcome.label, arrival, nearest, left, f"{np.degrees(found.angle[i]):.2f}", effort))
        return above, rows, []


def turn(
    robot: Robot,
    target: Target,
    strategy: Strategy,
    spring: float | str = "auto",
    *,
    duration: float | None = None,
    engine: str = "planar",
    controller: Controller | None = None,
    **options: Unpack[RunOptions],
) -> Turn:
    """Walk to a target; AnalysisError if no spring turns tightly enough.

    Parameters
    ----------
    robot, target, strategy
        Robot, target, and one of :data:`chilopod.steering.STRATEGIES`.
    spring
        Spring of the strategy, N*m/rad; or ``law``: the paper's k1-hat, from the radius law; or ``auto``: the spring
        that comes nearest to the target in undisturbed simulated trials, which accounts for the time that a bend needs
        to grow. Without leg yaw an undisturbed robot does not bend, and ``auto`` means ``law``.
    duration
        Duration, s; by default the time for the circle at the speed of the straight walk without slip, multiplied by
        the engine's ``duration_ratio``, see :class:`chilopod.engine.Traits`; at least 5 s.
    engine, controller
        As for :class:`chilopod.trials.Trial`; the controller replaces that of the strategy.
    **options
        See :class:`chilopod.tasks.RunOptions`; the folder has the trials of the radius law and of the search too.
    """
    check_strategy(strategy)
    if spring not in ("auto", "law") and isinstance(spring, str):
        raise ParameterError("must be a spring", field="spring", value=spring, allowed="auto, law, or a stiffness")
    if strategy.springs is None and spring != "auto":
        problem = f"must be auto: strategy {strategy.name} does not set the springs"
        raise ParameterError(problem, field="spring", value=spring, allowed="auto")
    traits = engine_named(engine).traits
    time = duration if duration is not None else _time_for(robot, target, traits.duration_ratio)
    trial = Trial(robot, time, target=target, controller=controller, engine=engine, poses=traits.poses)
    check_fits(trial.repeated(options.get("seed"), options.get("repeats", 1)))
    folder, progress = options.get("folder"), options.get("progress", silent)
    law, by_trials = None, spring == "auto" and (strategy.leg_yaw or controller is not None)
    if isinstance(spring, str) and strategy.springs == K1:
        try:
            law = radius_law(robot, engine, folder, part(progress, 0.0, 0.4, "radius law"))
        except AnalysisError as error:
            if error.field != "branch":
                raise
            if not by_trials:
                problem = f"needs a radius law of the first spring: {error.problem}"
                raise AnalysisError(problem, field="spring", value=spring, allowed="a stiffness") from error
    by_law = law.value(target.radius) if law else None
    if strategy.springs is None:
        stiffness = None
    elif not isinstance(spring, str):
        stiffness = spring
    elif not by_trials:
        if by_law is None:
            raise AnalysisError("must be the first spring for a radius law", field="spring", value=spring)
        stiffness = by_law
    else:
        stiffest = max(robot.springs.stiffness)
        between = (float(law.values[0]), 1.5 * law.pitchfork) if law else (_SOFTEST * stiffest, stiffest)
        progress(0.4, "trials with many springs")
        stiffness = _best_spring(trial, strategy, between, folder)
    options["progress"] = part(progress, 0.9, 1.0, "walk")
    trials, records = runs(_with_spring(trial, strategy, stiffness), **options)
    record = together(records)
    when = earliest_arrival(record)
    criteria = evaluate(record, when if np.isfinite(when) else float(record.time[-1]))
    return Turn(trials, strategy, by_law, stiffness, record, criteria)


def _with_spring(trial: Trial, strategy: Strategy, stiffness: float | None) -> Trial:
    walker, controller, _ = strategy.prepare(trial.robot, None, stiffness, trial.controller)
    return replace(trial, robot=walker, controller=controller)


def _best_spring(trial: Trial, strategy: Strategy, between: tuple[float, float], folder: str | Path | None) -> float:
    """Spring of a strategy that comes nearest to the target, N*m/rad, by undisturbed trials on ever finer grids."""
    low, high = between
    tried = engine_named(trial.engine).traits.walks_per_round
    trial = replace(trial, disturbance=NONE, rate=20.0, poses=False)
    values = np.geomspace(low, high, tried)
    best = 0
    for round_ in range(_ROUNDS):
        if round_:
            values = np.linspace(values[max(best - 1, 0)], values[min(best + 1, tried - 1)], tried)
        record = together(run([_with_spring(trial, strategy, float(value)) for value in values], folder))
        nearest = evaluate(record, trial.duration).nearest
        # Of equally good springs take the stiffest.
        best = int(np.flatnonzero(nearest <= np.nanmin(nearest) + _AS_NEAR)[-1])
    return float(values[best])


def _time_for(robot: Robot, target: Target, duration_ratio: float) -> float:
    angle = abs(target.bearing)
    arc = target.distance * (angle / np.sin(angle) if angle > 0.0 else 1.0)
    return float(max(_LEAST, duration_ratio * arc / robot.gait.speed))
