"""Turning tasks: the paper's experiments with targets, as trials of the planar model (its section "Turning").

A robot stands straight, a target lies ahead to its left, and the first spring is chosen before it walks; the legs of
module 1 yaw towards the target. Each task is walked with many springs and several seeds and judged as the paper does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from chilopod import trials
from chilopod.analysis.parameters import PAPER_UNIT, stiffness
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.measures import Folder, over_springs
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.steering import LegYawController, Outcome, Target, earliest_arrival, evaluate
from chilopod.steering.criteria import efforts
from chilopod.steering.strategies import strategy_named
from chilopod.trials import Trial

DURATION = printed.ARRIVAL.value
"""Time of the paper's evaluation, and duration of trials of the planar model, which arrives well before, s."""

SPRINGS = (5, 6, 7, 7.5, 8, 8.5, 9, 9.5, 10, 10.5, 11, 11.5, 12, 12.5, 13, 14, 15, 17, 21, 28, 41, 75)
"""Springs k1 of the turning tasks, N*mm/deg, dense around the minima of the planar model's criteria."""

UNIFORM_SPRINGS = (2, 3, 4, 5, 6, 8, 11, 15, 21, 41)
"""Springs of the Hopf strategy, all alike, N*mm/deg, in the paper's ratios to the Hopf point."""

CRITERIA = ("distance", "angle", "effort", "effort_until_arrival")
"""epsilon 1 to 3, and epsilon 3 integrated only until the robot has arrived."""

RATE = 50.0
"""Samples per second of these trials."""

_PATH_STEP = 2
"""Step between the samples of a drawn path in the record."""


@dataclass(frozen=True)
class TurningTask:
    """Outcome of walks to a target with many springs.

    ``criteria``, over (instant, spring, repeat): ``distance`` (m), ``angle`` (rad) and ``effort`` (rad^2 s), epsilon 1
    to 3, at the ``seconds`` of "earliest arrival" and "paper" (:data:`DURATION`), and at each walk's "own" arrival or,
    without one, where it is nearest; their means over repeats and standard errors as ``distance_mean``,
    ``distance_error`` and so on (NaN where a repeat did not walk so long). Over (spring, repeat):
    ``effort_until_arrival`` (or until the end, rad^2 s), ``arrival`` (s, NaN if never), ``nearest`` (m), ``outcome``
    and ``status``.

    ``paths``, over (shown, repeat, time): ``x`` and ``y`` (m) of module 1, ``distance`` (m) and ``bearing`` (rad,
    continuous) of the target, of three springs: the best, and the grid's nearest to 15/21 and 41/21 of it as in the
    paper.
    """

    target: Target
    criteria: xr.Dataset
    paths: xr.Dataset

    @property
    def time(self) -> float:
        """The evaluation time, s."""
        return float(self.criteria.seconds[0])

    @property
    def best(self) -> float:
        """The spring that comes nearest to the target on average, N*mm/deg; it needs no evaluation time."""
        return _best(self.criteria)


def to_target(
    robot: Robot,
    target: Target,
    spring: float,
    strategy: str = "pitchfork",
    *,
    duration: float = DURATION,
    rate: float = RATE,
    limit: float | None = None,
    **walk: Any,
) -> Trial:
    """A walk towards a target by a strategy with its spring (N*mm/deg); ``limit`` is the largest yaw of the legs, rad,
    if it is not that of the controller, ``walk`` are other fields of a trial."""
    walker, controller, _ = strategy_named(strategy).prepare(robot, None, stiffness(float(spring)))
    if limit is not None and isinstance(controller, LegYawController):
        controller = replace(controller, limit=limit)
    return Trial(walker, duration, target=target, controller=controller, rate=rate, **walk)


def turning_task(
    robot: Robot,
    target: Target,
    springs: Sequence[float] = SPRINGS,
    repeats: int = printed.REPEATS,
    strategy: str = "pitchfork",
    **walk: Any,
) -> TurningTask:
    """Task of :func:`strategy_tasks` with one strategy."""
    return strategy_tasks(robot, target, {strategy: springs}, repeats, **walk)[strategy]


def strategy_tasks(
    robot: Robot,
    target: Target,
    springs: Mapping[str, Sequence[float]],
    repeats: int = printed.REPEATS,
    *,
    time: float | None = None,
    shown: Sequence[float] = (),
    folder: Folder = None,
    progress: Progress = silent,
    **walk: Any,
) -> dict[str, TurningTask]:
    """Walk towards a target by every strategy with its springs (N*mm/deg), several times, with the seeds 0, 1, ...

    Epsilon 1 to 3 are taken at ``time`` (s), by default the earliest arrival over all strategies, and the duration if
    none arrives. ``shown`` are the springs of ``paths`` (N*mm/deg), of a strategy that has them. ``walk`` is the rest
    of :func:`to_target`: duration (s, at least the paper's), engine, disturbance, limit.
    """
    tasks, records, duration = {}, {}, 0.0
    for index, (strategy, own) in enumerate(springs.items()):
        asked = [to_target(robot, target, spring, strategy, **walk) for spring in own for _ in range(repeats)]
        seeded = [replace(trial, seed=number % repeats) for number, trial in enumerate(asked)]
        share = part(progress, index / len(springs), (index + 1) / len(springs), strategy)
        records[strategy], duration = trials.together(trials.run(seeded, folder, share)), asked[0].duration
    earliest = {strategy: earliest_arrival(record) for strategy, record in records.items()}
    when = time if time is not None else float(np.nanmin([*earliest.values(), np.inf]))
    for strategy, record in records.items():
        own = springs[strategy]
        criteria = _criteria(record, (when if np.isfinite(when) else duration, DURATION), own, repeats)
        criteria.attrs = {"robot": robot.name, "target": str(target), "strategy": strategy, "duration_s": duration}
        criteria.attrs |= {"earliest_arrival_s": earliest[strategy], "radius_m": target.radius}
        wanted = [ratio / 21.0 * _best(criteria) for ratio in (15.0, 21.0, 41.0)]
        nearest = [own[int(np.abs(np.log(np.asarray(own) / each)).argmin())] for each in wanted]
        paths = _paths(record, own, repeats, shown if shown and set(shown) <= set(own) else nearest)
        paths.attrs = {**criteria.attrs, "target_x_m": target.position[0], "target_y_m": target.position[1]}
        tasks[strategy] = TurningTask(target, criteria, paths)
    return tasks


def _best(criteria: xr.Dataset) -> float:
    return float(criteria.spring[int(np.argmin(criteria.nearest.mean("repeat").values))])


def _criteria(record: xr.Dataset, instants: tuple[float, float], springs: Sequence[float], repeats: int) -> xr.Dataset:
    shape = (len(springs), repeats)
    found = [evaluate(record, time) for time in instants]
    arrival, away = found[0].arrival, record.distance.transpose("robot", "time")
    nearest = record.time.values[away.fillna(np.inf).argmin("time").values]
    ends, own = (np.where(np.isfinite(arrival), arrival, each).tolist() for each in (float(record.time[-1]), nearest))
    alone = [evaluate(record.isel(robot=[index]), time) for index, time in enumerate(own)]
    until = np.array([efforts(record.isel(robot=[index]), end)[0] for index, end in enumerate(ends)])
    both = ("spring", "repeat")
    instant = ["earliest arrival", "paper", "own"]
    data = xr.Dataset(coords={"spring": over_springs(springs), "instant": instant, "repeat": np.arange(repeats)})
    data["seconds"] = ("instant", np.array([*instants, np.nan]), {"units": "s"})
    for name, unit in (("distance", "m"), ("angle", "rad"), ("effort", "rad^2*s")):
        frozen = np.concatenate([getattr(each, name) for each in alone])
        values = np.stack([each.reshape(shape) for each in (*(getattr(one, name) for one in found), frozen)])
        data[name] = (("instant", *both), values, {"units": unit})
    data["effort_until_arrival"] = (both, until.reshape(shape), {"units": "rad^2*s"})
    for name in CRITERIA:
        data[f"{name}_mean"] = data[name].mean("repeat", skipna=False, keep_attrs=True)
        error = data[name].std("repeat", ddof=1, skipna=False) / np.sqrt(repeats)
        data[f"{name}_error"] = error.assign_attrs(units=data[name].attrs["units"])
    data["arrival"] = (both, arrival.reshape(shape), {"units": "s"})
    data["nearest"] = (both, found[0].nearest.reshape(shape), {"units": "m"})
    labels = np.array([each.label for each in found[0].outcome], dtype=object)
    data["outcome"] = (both, labels.reshape(shape))
    data["status"] = (both, record.status.values.astype(object).reshape(shape))
    return data


def _paths(record: xr.Dataset, springs: Sequence[float], repeats: int, shown: Sequence[float]) -> xr.Dataset:
    over = ("shown", "repeat", "time")
    rows = [[springs.index(spring) * repeats + repeat for repeat in range(repeats)] for spring in shown]
    some = record.isel(robot=xr.DataArray(rows, dims=over[:2]), time=slice(None, None, _PATH_STEP))
    x, y = some.position.transpose("axis", *over).values
    columns = {
        "x": (over, x, {"units": "m"}),
        "y": (over, y, {"units": "m"}),
        "distance": (over, some.distance.transpose(*over).values, {"units": "m"}),
        "bearing": (over, np.unwrap(some.bearing.transpose(*over).values, axis=2), {"units": "rad"}),
    }
    springs_ = ("shown", np.asarray(shown, float), {"units": PAPER_UNIT})
    times = ("time", some.time.values, {"units": "s"})
    return xr.Dataset(columns, {"shown": springs_, "repeat": np.arange(repeats), "time": times})


def springs_by_outcome(criteria: xr.Dataset) -> dict[Outcome, list[float]]:
    """Springs (N*mm/deg) by the outcome of most of their trials."""
    found: dict[str, list[float]] = {outcome.label: [] for outcome in Outcome}
    for spring, labels in zip(criteria.spring.values, criteria.outcome.values, strict=True):
        names, counts = np.unique(labels.astype(str), return_counts=True)
        found[str(names[counts.argmax()])].append(float(spring))
    return {outcome: found[outcome.label] for outcome in Outcome}


def outcome_words(criteria: xr.Dataset, written: Callable[[list[float]], str]) -> str:
    """Words for the outcomes of walks to a target, from stiff springs to soft ones."""
    found = springs_by_outcome(criteria)
    shown = (Outcome.OUTSIDE, Outcome.ARRIVED, Outcome.INSIDE, Outcome.FAILED)
    return "; ".join(f"{outcome.label} at {written(found[outcome])}" for outcome in shown if found[outcome])


def span(springs: list[float]) -> str:
    """Springs from the softest to the stiffest."""
    return f"{min(springs):g}" + (f" to {max(springs):g}" if len(springs) > 1 else "")


@dataclass(frozen=True)
class LegYaw:
    """Walks to a target at one spring (N*mm/deg), without leg yaw and with it, see :func:`without_leg_yaw`."""

    name: str
    spring: float
    alone: xr.Dataset
    helped: xr.Dataset

    def __str__(self) -> str:
        """Number of walks that arrive."""
        left = int((self.alone.turned > 0.0).sum())
        return f"{counted(self.alone)} arrive ({left} turn left), with it {counted(self.helped)}"


def arrivals(walks: xr.Dataset) -> tuple[int, int]:
    """Number of walks that arrive, and number of walks."""
    return int(np.nansum(walks.arrived)), int(np.isfinite(walks.arrived).sum())


def counted(walks: xr.Dataset) -> str:
    """Number of walks that arrive, of all, in words."""
    return "{} of {}".format(*arrivals(walks))


def by_leg_yaw(data: xr.Dataset) -> list[LegYaw]:
    """Results of :func:`without_leg_yaw`, by spring."""
    found = []
    for case in np.flatnonzero(~data.leg_yaw.values):
        alone, helped = data.isel(case=int(case)), data.isel(case=int(case) + 1)
        name = str(alone.case.values).partition(",")[0]
        found.append(LegYaw(name, float(alone.spring), alone, helped))
    return found


def _last(data: xr.DataArray) -> Array:
    """Last value of every robot before it ended."""
    values = data.transpose("robot", "time").values
    return np.array([row[np.isfinite(row)][-1] for row in values])


def without_leg_yaw(
    robot: Robot,
    target: Target,
    springs: Mapping[str, float],
    *,
    duration: float = DURATION,
    folder: Folder = None,
    progress: Progress = silent,
    **walk: Any,
) -> xr.Dataset:
    """The task of :func:`turning_task` with and without leg yaw (Fig. "without": five trials and nine), at values of k1
    (N*mm/deg) by name.

    Dataset over (case, trial, time): ``x`` and ``y`` of module 1 (m); over (case, trial): ``arrived``, ``nearest`` (m)
    and ``turned``, the last heading (rad, left positive). Cases are the names, each ``leg_yaw`` or not, with
    ``spring``; where there are fewer trials than nine the rest is NaN.
    """
    cases, most = [], printed.WITHOUT_LEG_YAW
    for index, ((name, spring), leg_yaw) in enumerate((item, with_) for item in springs.items() for with_ in (0, 1)):
        one = to_target(robot, target, spring, "pitchfork" if leg_yaw else "open-loop", duration=duration, **walk)
        asked = [replace(one, seed=seed) for seed in range(printed.REPEATS if leg_yaw else most)]
        record = trials.together(trials.run(asked, folder))
        result = evaluate(record, duration)
        some = record.isel(time=slice(None, None, _PATH_STEP))
        place = some.position.transpose("axis", "robot", "time")
        columns = {
            "x": (("trial", "time"), place.sel(axis="x").values, {"units": "m"}),
            "y": (("trial", "time"), place.sel(axis="y").values, {"units": "m"}),
            "arrived": ("trial", np.isfinite(result.arrival).astype(float), {"units": "1"}),
            "nearest": ("trial", result.nearest, {"units": "m"}),
            "turned": ("trial", _last(record.heading), {"units": "rad"}),
        }
        coords = {"time": ("time", some.time.values, {"units": "s"}), "trial": np.arange(len(asked))}
        cases.append(xr.Dataset(columns, coords).reindex(trial=np.arange(most)))
        progress((index + 1) / (2 * len(springs)), f"{name}, leg yaw {'on' if leg_yaw else 'off'}")
    data = xr.concat(cases, dim="case")
    data["leg_yaw"] = ("case", np.tile([False, True], len(springs)))
    data["spring"] = ("case", np.repeat([float(each) for each in springs.values()], 2), {"units": PAPER_UNIT})
    data = data.assign_coords(case=[f"{name}, {how}" for name in springs for how in ("without", "with")])
    x, y = target.position
    data.attrs = {"robot": robot.name, "target": str(target), "target_x_m": x, "target_y_m": y}
    return data
