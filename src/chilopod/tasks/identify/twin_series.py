"""Walks for the identification of a robot's constants, their measures and their residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from chilopod.analysis.parameters import K1
from chilopod.analysis.square_root import square_root_fit
from chilopod.engine import Walk, engine_named
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.record import Recording
from chilopod.robot import Robot
from chilopod.tasks.identify.data import BaseSeries
from chilopod.twin.walk import TOLERANCE

DURATION = 60.0
"""Duration of the walks, s."""

LOST = np.inf
"""Value of every residual for constants with which the robot cannot walk."""

FAR = 3.0
"""Largest residual of the nearest fit beyond which the data have no valley: no constants explain them."""

_SOONER = 36.0  # s, when walks that are far off are given up
_HOPELESS = 4.0  # misfit
_AVERAGED = 4.8  # s, whole periods near the paper's 5 s
_APART = 12.0  # s between the two last averages, a cycle of the slowest swing
_STRAIGHT = 0.1  # rad in all
_STEADY = 0.1  # rad that the summed bend may move between them
_PER_CYCLE = 10  # samples


@dataclass(frozen=True)
class Series:
    """Measures of the walks of a series, NaN where a walk failed: mean joint angles over 4.8 s, 12 s before the end and
    at the end, rad, shape (springs, joints), and speeds of module 1 along its way, gait cycle by gait cycle, over the
    last 4.8 s, m/s, shape (springs,). ``early`` says that the walks were given up, as they were far off the data."""

    before: Array
    bends: Array
    speeds: Array
    early: bool = False


def base_series(
    robot: Robot,
    data: BaseSeries,
    springs: Sequence[float] | None = None,
    tolerance: float = TOLERANCE,
    engine: str = "twin",
    duration: float = DURATION,
) -> Series:
    """Walk a series for a duration, s, from starts near the bends of its data, with a tolerance of the contact solver.
    ``springs`` replace the values of k1, N*m/rad; ``engine`` is the twin or a :class:`chilopod.twin.Edited`. Walks of
    all springs of the data stop after 36 s if they are far off by then."""
    walks: Any = engine_named(engine)  # with arguments that only the twin has
    robots = [robot.with_value(K1, spring) for spring in springs or data.springs]
    initial = walks.initial_states(robot, data.start(robot, springs or data.springs))
    record = Recording(rate=_PER_CYCLE / robot.gait.period)
    walk: Walk = walks.start(robots, initial=initial, record=record, tolerance=tolerance, expected=duration)
    if springs is None:
        walk.advance(min(_SOONER, duration))
        early = _series(walk, robot)
        if hopeless(robot, early, data):
            return replace(early, early=True)
    walk.advance(duration)
    return _series(walk, robot)


def _series(walk: Walk, robot: Robot) -> Series:
    data = walk.to_dataset()
    angles = data.joint_angle.transpose("time", "robot", "joint").values
    cycles = round(_AVERAGED / robot.gait.period)
    samples, apart = cycles * _PER_CYCLE, round(_APART / robot.gait.period) * _PER_CYCLE
    places = data.position.transpose("time", "robot", "axis").values[-samples - 1 :: _PER_CYCLE]
    steps = np.linalg.norm(np.diff(places, axis=0), axis=-1)
    before = angles[: len(angles) - apart][-samples:]
    return Series(before.mean(0), angles[-samples:].mean(0), steps.mean(0) / robot.gait.period)


def hopeless(robot: Robot, found: Series, data: BaseSeries) -> bool:
    """True if walks are so far off the data that they are given up early."""
    return bool(np.sqrt(np.mean(residuals(robot, found, data, by_curvature=True) ** 2)) > _HOPELESS)


def residuals(robot: Robot, found: Series, data: BaseSeries, by_curvature: bool = False) -> Array:
    """Residuals of a series: computed less the data, one number for each of ``data.names``. These are radii, speeds and
    onset (each over its standard error); bend where the robot is straight beyond 0.1 rad in all (over 0.05 rad); the
    deficit from 0.3 rad at the stiffest curved spring (the same); motion between averages beyond 0.1 rad (over 0.1).
    The radius of a straight walk is that of a bend by 0.1 rad, or of three standard errors if that is larger. With
    ``by_curvature`` a radius R has the error of 1/R to first order and keeps its sign, as in the likelihood."""
    springs = data.springs
    summed = np.abs(found.bends).sum(-1)
    at = dict(zip(springs, summed, strict=True))
    if not np.isfinite(found.bends).all():
        return np.full(len(data.names), LOST)
    length = (robot.body.modules - 1) * robot.module_length
    off = [(1.0 - at[k] * r / length) * r / error for k, (r, error) in data.radii.items()]
    if not by_curvature:
        least = {k: min(_STRAIGHT, length / (r + FAR * error)) for k, (r, error) in data.radii.items()}
        off = [(length / max(at[k], least[k]) - r) / error for k, (r, error) in data.radii.items()]
    off += [(found.speeds[springs.index(k)] - v) / error for k, (v, error) in data.speeds.items()]
    curved = [springs.index(k) for k in data.curved]
    try:
        fitted = square_root_fit(1.0 / np.array(data.curved), np.abs(found.bends[curved, 0])).critical
    except AnalysisError:
        fitted = 0.5 * data.onset[0]
    off.append((fitted - data.onset[0]) / data.onset[1])
    off += [max(at[k] - _STRAIGHT, 0.0) / 0.05 for k in data.straight]
    off.append(max(0.3 - at[max(data.curved)], 0.0) / 0.05)
    moved = np.abs(np.abs(found.bends).sum(-1) - np.abs(found.before).sum(-1))
    off.append(max(float(moved.max()) - _STEADY, 0.0) / _STEADY)
    return np.array(off)
