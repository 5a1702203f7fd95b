"""Turning tasks together, and the causes of the difference between the best spring and the law's; minima of the paper's
criteria, and comparison of its two strategies: a pitchfork by one soft spring, Hopf by springs all alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from chilopod import trials
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.radius_law import RadiusLaws, radius_laws
from chilopod.analysis.straight_walk import first_loss
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.measures import Folder, over_springs
from chilopod.paper.printed import CRITERION_NAMES, Band
from chilopod.paper.section import Context, Size
from chilopod.paper.turning.trials import (
    CRITERIA,
    DURATION,
    RATE,
    SPRINGS,
    UNIFORM_SPRINGS,
    TurningTask,
    to_target,
    turning_task,
    without_leg_yaw,
)
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.statistics import LEVEL, Answer, Comparison, Interval, difference, every, mean
from chilopod.steering import LegYawController, Target, earliest_arrival, evaluate
from chilopod.trials import NONE, Disturbance, Trial

ROUGH = 3.0
"""Multiples of the usual disturbance, for the check that conclusions do not depend on it."""

FARTHER = (1.3, 2.0, 3.0, 4.5)
"""Distances of targets in the direction of task A, for the effect of a longer way, m."""

FARTHER_SPRINGS = (8, 9, 10, 11, 12, 12.5, 13, 14, 15, 17, 19, 21, 24, 28, 41)
QUICK_SPRINGS = (6, 7, 8, 9, 10, 11, 12, 21)
ROUGH_SPRINGS = (6, 7, 8, 8.5, 9, 9.5, 10, 11, 12, 13, 15, 21)
"""Springs of these trials, of quick ones, and of rough ones, N*mm/deg."""

SCALES = {"distance": (1.0, "m"), "angle": (180.0 / math.pi, "deg"), "effort": (1.0, "rad²·s")}
"""Units in which the criteria are shown: factor and unit."""

_COLUMNS = ("spring", "at", "softest", "stiffest", "alike", "mean", "error")


@dataclass(frozen=True)
class Turning:
    """Results of the turning studies."""

    robot: Robot
    laws: RadiusLaws
    tasks: Mapping[str, TurningTask]  # the paper's two, by letter
    hopf: TurningTask  # task A with uniform springs
    rough: TurningTask  # task A with a disturbance :data:`ROUGH` times as large
    hopf_point: float  # Neimark-Sacker point of uniform springs, N*mm/deg
    without: xr.Dataset  # task A with and without leg yaw, at the best spring and at the law's
    settled: xr.Dataset  # see :func:`settled_start`
    farther: xr.Dataset  # see :func:`farther_targets`


def turning(context: Context, progress: Progress = silent) -> Turning:
    """All turning studies of the robot of the planar model; if not full, fewer springs and fewer, nearer targets."""
    robot, folder, quick = context.robot, context.folder, context.size is not Size.FULL
    usual = SPRINGS, UNIFORM_SPRINGS, ROUGH_SPRINGS, FARTHER
    springs, uniform, rougher, distances = (
        (QUICK_SPRINGS, UNIFORM_SPRINGS[::3], QUICK_SPRINGS, FARTHER[:2]) if quick else usual
    )
    laws = radius_laws(robot)
    tasks: dict[str, TurningTask] = {}
    for index, (letter, said) in enumerate(printed.TASKS.items()):
        share = part(progress, 0.25 * index, 0.25 * (index + 1), f"task {letter}")
        tasks[letter] = turning_task(robot, said.target, springs, folder=folder, progress=share)
    task = tasks["A"]
    share = part(progress, 0.5, 0.65, "uniform springs")
    hopf = turning_task(robot, task.target, uniform, strategy="hopf", time=task.time, folder=folder, progress=share)
    share, disturbance = part(progress, 0.65, 0.85, "larger disturbances"), Disturbance().scaled(ROUGH)
    rough = turning_task(robot, task.target, rougher, disturbance=disturbance, folder=folder, progress=share)
    springs_ = {"best spring": task.best, "spring of the law": laws.k_hat(task.target.radius)[0]}
    share = part(progress, 0.85, 0.9, "with and without leg yaw")
    without = without_leg_yaw(robot, task.target, springs_, folder=folder, progress=share)
    settled = settled_start(robot, laws, {letter: each.target for letter, each in tasks.items()}, folder)
    farther = farther_targets(robot, laws, task.target.bearing, distances, folder)
    progress(1.0, "turning tasks")
    point = first_loss(robot, ALL, None, Kind.NEIMARK_SACKER, normal_form=False)
    return Turning(robot, laws, tasks, hopf, rough, point.value, without, settled, farther)


def settled_start(robot: Robot, laws: RadiusLaws, targets: Mapping[str, Target], folder: Folder = None) -> xr.Dataset:
    """Arrival with the spring of the law if the walk begins on its curve.

    One undisturbed trial without leg yaw for each start, at the spring of the law by the path of module 1: "straight";
    "bent", the settled walk; and "bent, aimed", with the target relative to the motion of module 1 instead of its
    heading.

    Dataset over (task, start): ``start_nearest`` (m); over task: ``law_spring`` (N*mm/deg) and ``slip``, the mean
    angle from heading to motion of module 1 on the settled walk (rad).
    """
    found = []
    for target in targets.values():
        _, spring = laws.k_hat(target.radius)
        walker = robot.with_value(K1, stiffness(spring))
        straight = Trial(walker, DURATION, target=target, disturbance=NONE, rate=RATE)
        bent = replace(straight, joint_angles=laws.joint_angles(spring))
        records = trials.run([straight, bent], folder)
        slip = _slip(records[1])
        aimed = Target(target.bearing + slip, target.distance)
        records += trials.run([replace(bent, target=aimed)], folder)
        found.append((*(float(record.distance.min()) for record in records), spring, slip))
    *nearest, springs, slips = np.array(found).T
    columns = {
        "start_nearest": (("task", "start"), np.array(nearest).T, {"units": "m"}),
        "law_spring": ("task", springs, {"units": PAPER_UNIT}),
        "slip": ("task", slips, {"units": "rad"}),
    }
    coords = {"task": list(targets), "start": ["straight", "bent", "bent, aimed"]}
    return xr.Dataset(columns, coords, {"robot": robot.name})


def _slip(record: xr.Dataset) -> float:
    """Mean angle from heading to velocity of module 1, rad; over the second half of a walk."""
    late = record.isel(robot=0, time=slice(record.sizes["time"] // 2, None))
    moving = np.arctan2(late.velocity.sel(axis="y").values, late.velocity.sel(axis="x").values)
    return float(np.mean((moving - late.heading.values + np.pi) % (2.0 * np.pi) - np.pi))


def farther_targets(
    robot: Robot, laws: RadiusLaws, bearing: float, distances: Sequence[float], folder: Folder
) -> xr.Dataset:
    """Results for targets in one direction at growing distances, with the effect of the time that a bend needs to grow.

    One undisturbed trial each, with leg yaw, with a duration in proportion to the distance.

    Dataset over (away, spring): ``nearest`` (m), ``effort`` until the earliest arrival of that distance, and
    ``effort_part``, its ratio to the effort of legs at their limit all the time (1); over away: ``earliest`` (s),
    ``k_hat`` by the law (N*mm/deg).
    """
    limit, both, found = LegYawController().limit, ("spring",), []
    for away in distances:
        target, duration = Target(bearing, away), DURATION * away / distances[0]
        asked = [to_target(robot, target, spring, duration=duration, disturbance=NONE) for spring in FARTHER_SPRINGS]
        record = trials.together(trials.run(asked, folder))
        earliest = earliest_arrival(record)
        result = evaluate(record, earliest)
        columns = {
            "nearest": (both, result.nearest, {"units": "m"}),
            "effort": (both, result.effort, {"units": "rad^2*s"}),
            "effort_part": (both, result.effort / (2.0 * limit**2 * earliest), {"units": "1"}),
            "earliest": ((), earliest, {"units": "s"}),
            "k_hat": ((), laws.k_hat(target.radius)[0], {"units": PAPER_UNIT}),
        }
        coords = {"away": ((), away, {"units": "m"}), "spring": over_springs(FARTHER_SPRINGS)}
        attrs = {"robot": robot.name, "bearing_deg": math.degrees(bearing)}
        found.append(xr.Dataset(columns, coords, attrs))
    return xr.concat(found, "away")


def minima(criteria: xr.Dataset, instant: int = 0) -> xr.Dataset:
    """Minima of each criterion of a :class:`TurningTask`, in means over repeats, at an instant: 0 is the earliest
    arrival, 1 the paper's 23 s, 2 each walk's own.

    Dataset over criterion: the ``spring`` of the smallest mean; ``at``, the vertex of a parabola in 1/k1 through it and
    its neighbours (the spring itself at an end of the grid); ``softest`` and ``stiffest`` of the springs that are not
    worse by a t test (seed by seed), all in N*mm/deg, and ``alike``, their number; the best spring is one of them in
    95 % of cases, as the tests share their level (Bonferroni); ``mean`` and ``error`` of the smallest.
    """
    at_instant = criteria.isel(instant=instant)
    columns = zip(_COLUMNS, np.array([_minimum(at_instant, name) for name in CRITERIA]).T, strict=True)
    data = {name: ("criterion", column) for name, column in columns}
    return xr.Dataset(data, {"criterion": list(CRITERIA)}, {"seconds": float(at_instant.seconds)})


def _minimum(criteria: xr.Dataset, name: str) -> tuple[float, ...]:
    """Columns of :func:`minima` for one criterion; NaN where no spring has a mean."""
    springs, means, each = criteria.spring.values, criteria[f"{name}_mean"].values, criteria[name].values
    if np.isnan(means).all():
        return (np.nan,) * len(_COLUMNS)
    lowest = int(np.nanargmin(means))
    others = [mean(row - each[lowest], size=float(np.nanmax(each))).above() for row in each]
    # One-sided, and the chance of an error is shared by all springs that the best one is compared with.
    worse = [one.side is True and one.p * (len(springs) - 1) < 2.0 * (1.0 - LEVEL) for one in others]
    alike = springs[np.isfinite(means) & ~np.array(worse)]
    error = criteria[f"{name}_error"].values[lowest]
    vertex = _vertex(springs, means, lowest)
    return springs[lowest], vertex, alike.min(), alike.max(), alike.size, means[lowest], error


def _vertex(springs: Array, mean: Array, lowest: int) -> float:
    """Vertex of the parabola in 1/k through three points, in k."""
    order = slice(lowest - 1, lowest + 2)
    if lowest in (0, len(springs) - 1) or np.isnan(mean[order]).any():
        return float(springs[lowest])
    curve = np.polynomial.Polynomial.fit(1.0 / springs[order], mean[order], 2)
    if curve.deriv(2)(0.0) <= 0.0:  # three equal values
        return float(springs[lowest])
    return float(1.0 / curve.deriv().roots()[0].real)


def around(low: xr.Dataset, said: Band) -> Answer:
    """True if the minimum of one criterion of :func:`minima` lies at some springs (N*mm/deg); undecided if springs that
    are no worse lie within and outside them."""
    low_end, high_end = min(float(low.softest), float(low["at"])), max(float(low.stiffest), float(low["at"]))
    if said.low <= low_end and high_end <= said.high:
        return True
    return None if low_end <= said.high and said.low <= high_end else False


def comparisons(pitchfork: TurningTask, hopf: TurningTask) -> dict[str, Comparison]:
    """Comparisons of the smallest mean of every criterion with both strategies, at the first instant: True if the
    pitchfork's is lower.

    Both have the seeds 0, 1, ...: with as many repeats they are compared seed by seed, else as independent trials. The
    lower one is the best of several springs, so its p counts as often as springs are no worse.
    """
    found = {}
    for name in CRITERION_NAMES:
        ours, theirs = (_smallest(task, name) for task in (pitchfork, hopf))
        one = difference(theirs, ours, paired=ours.size == theirs.size).above()
        best_of = minima((pitchfork if one.side else hopf).criteria)["alike"].sel(criterion=name)
        found[name] = replace(one, p=min(1.0, one.p * float(best_of)) if one.side is not None else one.p)
    return found


def ratios(pitchfork: TurningTask, hopf: TurningTask, instant: int = 0, count: int = 2000) -> dict[str, Interval]:
    """Smallest mean of every criterion with the pitchfork over that with Hopf, at an instant, with an interval of 95 %
    by bootstrap: seeds are drawn again for both strategies at once, and the best spring is chosen anew each time."""
    repeats = pitchfork.criteria.sizes["repeat"]
    drawn = np.vstack([np.arange(repeats), np.random.default_rng(0).integers(repeats, size=(count, repeats))])
    found = {}
    for name in CRITERION_NAMES:
        each = [task.criteria[name].isel(instant=instant).values[:, drawn].mean(axis=2) for task in (pitchfork, hopf)]
        ours, theirs = (np.where(np.isnan(means), np.inf, means).min(axis=0) for means in each)
        low, high = np.quantile(ours / theirs, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
        found[name] = Interval(float(ours[0] / theirs[0]), float(low), float(high))
    return found


def _smallest(task: TurningTask, name: str) -> Array:
    """The trials at the spring of the smallest mean."""
    spring = float(minima(task.criteria).spring.sel(criterion=name))
    at = task.criteria[name].isel(instant=0)
    trials: Array = np.full(at.sizes["repeat"], np.nan) if np.isnan(spring) else at.sel(spring=spring).values
    return trials


def all_lower(pitchfork: TurningTask, hopf: TurningTask) -> Comparison:
    """Comparison of all three minima: True if those of the pitchfork are lower."""
    return every(comparisons(pitchfork, hopf).values())


def in_words(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """Minimum of every criterion with both strategies, with the words lower, higher or undecided for the pitchfork."""
    ours, theirs = minima(pitchfork.criteria)["mean"], minima(hopf.criteria)["mean"]
    parts = []
    for name, compared in comparisons(pitchfork, hopf).items():
        factor, unit = SCALES[name]
        one, two = (factor * float(each.sel(criterion=name)) for each in (ours, theirs))
        parts.append(f"{CRITERION_NAMES[name]} {one:.3g} against {two:.3g} {unit}: {compared.words('lower', 'higher')}")
    return "; ".join(parts)


def counted(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """Numbers of minima of the pitchfork that are lower, higher and undecided."""
    answers = [each.answer for each in comparisons(pitchfork, hopf).values()]
    named = {"lower": True, "higher": False, "undecided": None}
    counts = {word: sum(each is answer for each in answers) for word, answer in named.items()}
    return ", ".join(f"{count} of {len(answers)} {word}" for word, count in counts.items() if count)


def softest_minima(hopf: TurningTask, point: float) -> tuple[str, bool]:
    """Minima of the criteria with all springs alike, beside the point below which the body undulates; True if all of
    them lie below it, in the unstable region."""
    at = minima(hopf.criteria).spring.sel(criterion=list(CRITERION_NAMES)).values
    places = " and ".join(f"{spring:g}" for spring in np.unique(at))
    return f"{places} {PAPER_UNIT}, the body undulates below {point:.2f}", bool((at < point).all())


def saturated(time: float) -> float:
    """Largest possible third criterion, rad^2 s: that of legs at their limit all the time."""
    return 2.0 * LegYawController().limit ** 2 * time


def saturation(*tasks: TurningTask) -> str:
    """Ratio of the third criterion of all springs to its limit; if all are near 1, it distinguishes little."""
    full, unit = saturated(tasks[0].time), SCALES["effort"][1]
    means = np.concatenate([task.criteria.effort_mean.isel(instant=0).values for task in tasks])
    return (
        f"with all springs ε3 is {100.0 * np.nanmin(means) / full:.0f} to {100.0 * np.nanmax(means) / full:.0f} % of "
        f"the {full:.3g} {unit} of legs at their limit all the time"
    )
