"""The paper's walks of its robot (Fig. "curved", "absolute", "different"), as trials of the twin.

Every trial starts straight but for its disturbance, walks for a minute and a half, and is judged by the mean joint
angles of its last 5 s, with the springs, repeats and estimates of the paper: the radius 5L / sum |theta|, and the point
at which curved walks set in from a square-root fit to the bend of joint 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT
from chilopod.analysis.square_root import SquareRootFit
from chilopod.paper import measures, printed
from chilopod.paper.section import Context, Size
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.tasks.radius_law import DURATION, end_of_walk
from chilopod.trials import AVERAGED

SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0, 41.0, 75.0)
"""k1 of the base series, N*mm/deg: the paper's, and 26, at which it prints a radius."""

VARIANT_SPRINGS = (12.0, 15.0, 17.0, 19.0, 21.0, 24.0, 28.0, 34.0)
"""k1 of the variants, N*mm/deg."""

UNIFORM_SPRINGS = (8.7, 11.0, 13.0, 15.0, 18.0, 21.0, 30.0)
"""All springs together, N*mm/deg."""

SWINGING = 15.0
"""Stiffest of the paper's uniform springs on the soft side of its Hopf point, N*mm/deg."""

REPEATS, VARIANT_REPEATS, UNIFORM_REPEATS = 10, 5, 3

SHORTER = (20.0, 30.0, 40.0, 60.0)
"""Further durations of the base series, s, as the paper does not print the duration of its trials."""

UNIFORM_DURATION = 60.0
"""Duration of walks with all springs alike, which settle sooner, s."""

_RATE = 50.0
_EXAMPLES = (41.0, 15.0)
_WINDOW = 24.0  # s, some two cycles of an undulation
_PER_CYCLE = 6  # samples


@dataclass(frozen=True)
class RobotWalks:
    """Results of the walks."""

    robot: Robot  # as built
    base: xr.Dataset  # its walks, see :func:`walk_ends`
    durations: xr.Dataset  # see :func:`by_duration`
    variants: Mapping[str, xr.Dataset]  # as ``base``, of the paper's three, by name
    lower_steps: Mapping[str, xr.Dataset]  # of those that change the stride, see :func:`lower_steps`
    examples: xr.Dataset  # see :func:`chilopod.paper.measures.example_walks`
    uniform: xr.Dataset | None  # see :func:`undulations`

    @property
    def fit(self) -> SquareRootFit | None:
        """The square-root law of the base series."""
        return measures.onset(self.base)


def robot_walks(context: Context, progress: Progress = silent) -> RobotWalks:
    """All walks of the paper by the whole robot; if quick, half of those of the base series only."""
    robot, folder, size = context.whole, context.folder, context.size
    quick = size is Size.QUICK
    usual = VARIANT_REPEATS if quick else REPEATS
    repeats, fewer, fewest = size.cut((usual, VARIANT_REPEATS, UNIFORM_REPEATS), (1, 1, 1))
    springs, uniform_springs = size.cut((VARIANT_SPRINGS, UNIFORM_SPRINGS), (VARIANT_SPRINGS[1::4], (8.7, 13.0)))
    duration, swinging = size.cut((DURATION, UNIFORM_DURATION), (12.0, 8.0))
    share = part(progress, 0.0, 1.0 if quick else 0.31, "as built")
    records = walk_records(robot, SPRINGS, repeats, duration=duration, folder=folder, progress=share)
    base, durations = walk_ends(records, robot, SPRINGS), by_duration(records, robot, SPRINGS)
    examples = measures.example_walks(robot, _EXAMPLES, duration, measures.spring_seeds(_EXAMPLES), "twin", folder)
    if quick:
        return RobotWalks(robot, base, durations, {}, {}, examples, None)
    robots = {name: each for name, each in printed.variant_robots(robot).items() if name != printed.AS_BUILT}
    strides = [name for name, each in robots.items() if each.gait.stride != robot.gait.stride]
    asked = [*robots.items(), *((name, lower_steps(robot, robots[name])) for name in strides)]
    found: list[xr.Dataset] = []
    for index, (name, variant) in enumerate(asked):
        shown = part(progress, 0.31 + 0.6 * index / len(asked), 0.31 + 0.6 * (index + 1) / len(asked), name)
        # Growing and settling go with the way: who makes shorter steps is given the time to walk as far.
        longer = duration * robot.gait.stride / variant.gait.stride
        walked = walk_records(variant, springs, fewer, duration=longer, folder=folder, progress=shown)
        found.append(walk_ends(walked, variant, springs))
    variants, lower = dict(zip(robots, found, strict=False)), dict(zip(strides, found[len(robots) :], strict=True))
    share = part(progress, 0.91, 1.0, "uniform springs")
    uniform = undulations(robot, uniform_springs, fewest, duration=swinging, folder=folder, progress=share)
    return RobotWalks(robot, base, durations, variants, lower, examples, uniform)


def lower_steps(robot: Robot, variant: Robot) -> Robot:
    """Variant of another stride, with the swing clearance in proportion to the stride."""
    part = variant.gait.stride / robot.gait.stride
    return variant.with_value("twin.clearance", part * robot.get("twin.clearance"))


def walk_records(
    robot: Robot, springs: Sequence[float] = SPRINGS, repeats: int = REPEATS, *, duration: float = DURATION, **walk: Any
) -> list[xr.Dataset]:
    """Records of walks of the twin that start straight, each with a seed of its own."""
    seeds = measures.spring_seeds(springs)
    return measures.spring_walks(
        robot, springs, duration, repeats=repeats, seeds=seeds, rate=_RATE, engine="twin", **walk
    )


def walk_ends(
    records: Sequence[xr.Dataset], robot: Robot, springs: Sequence[float], duration: float | None = None
) -> xr.Dataset:
    """Results of :func:`chilopod.tasks.radius_law.end_of_walk` for walks of :func:`walk_records`, at their ends or
    ``duration`` (s) after the start, over spring (N*mm/deg), repeat and joint."""
    last = float(records[0].time[-1]) if duration is None else duration
    ends = [end_of_walk(record.sel(time=record.time <= last + 1e-9), robot) for record in records]
    data = measures.by_spring(ends, springs)
    data.attrs = {"robot": robot.name, "varied": K1, "averaged_s": AVERAGED, "duration_s": last}
    return data


def by_duration(records: Sequence[xr.Dataset], robot: Robot, springs: Sequence[float]) -> xr.Dataset:
    """Results of the walks of :func:`walk_records` after shorter durations.

    Returns
    -------
    Dataset of :func:`over_durations`, after those of :data:`SHORTER` and the walks' own last.
    """
    last = float(records[0].time[-1])
    durations = [*(each for each in SHORTER if each < last), last]
    return over_durations([walk_ends(records, robot, springs, duration) for duration in durations], durations)


def over_durations(series: Sequence[xr.Dataset], durations: Sequence[float]) -> xr.Dataset:
    """Results of the same walks after several durations (s).

    Returns
    -------
    Dataset over duration: ``onset`` with ``onset_error`` and its degrees of freedom ``onset_freedom``, N*mm/deg; over
    duration and spring: those of :func:`chilopod.paper.measures.shares`, and ``axis_radius`` with its error and
    freedom, as of :func:`chilopod.paper.measures.radius_at`, m.
    """
    # Short walks have not settled: what they show is what one would take for the radius.
    onsets = [measures.onset_point(each, settled=False) for each in series]
    springs = series[0].spring.values
    radii = [[measures.radius_at(each, spring, settled=False) for spring in springs] for each in series]
    columns: dict[str, Any] = {}
    for ending, field in (("", "value"), ("_error", "error"), ("_freedom", "freedom")):
        units = ("1", "1") if field == "freedom" else (PAPER_UNIT, "m")
        onset = np.array([getattr(each, field) for each in onsets])
        radius = np.array([[getattr(each, field) for each in row] for row in radii])
        columns[f"onset{ending}"] = ("duration", onset, {"units": units[0]})
        columns[f"axis_radius{ending}"] = (("duration", "spring"), radius, {"units": units[1]})
    return xr.Dataset(
        {**columns, **xr.concat([measures.shares(each) for each in series], "duration")},
        coords={"duration": ("duration", np.array(durations), {"units": "s"}), "spring": series[0].spring},
        attrs={"robot": series[0].attrs["robot"], "repeats": series[0].sizes["repeat"], "averaged_s": AVERAGED},
    )


def undulations(
    robot: Robot,
    springs: Sequence[float] = UNIFORM_SPRINGS,
    repeats: int = UNIFORM_REPEATS,
    *,
    duration: float = UNIFORM_DURATION,
    engine: str = "twin",
    folder: measures.Folder = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Walks with all springs alike: amplitude of the settled undulation.

    Returns
    -------
    Dataset over spring (N*mm/deg) and repeat: ``amplitude``, root mean square of the joint angles, averaged over gait
    cycles, about their mean over the last 24 s (rad), and ``status``; attributes ``critical_k``, the onset of the
    undulation by a square-root fit to springs up to :data:`SWINGING`, ``critical_k_error``, its standard error, and
    the degrees of freedom ``critical_k_freedom``; NaN if they determine no point.
    """
    wave = tuple(np.deg2rad(4.0) * np.cos(np.arange(robot.body.modules - 1) * np.pi / 2.0))
    walk: dict[str, Any] = {"joint_angles": wave, "engine": engine, "rate": _PER_CYCLE / robot.gait.period}
    walk |= {"seeds": measures.spring_seeds(springs), "folder": folder, "progress": progress}
    records = measures.spring_walks(robot, springs, duration, repeats=repeats, parameter=ALL, **walk)
    shape, last, amplitudes = (len(springs), repeats), round(_WINDOW / robot.gait.period), []
    for record in records:
        angles = record.joint_angle.isel(robot=0).transpose("time", "joint").values[1:]
        amplitudes.append(np.sqrt(measures.cycle_means(angles, _PER_CYCLE)[-last:].var(axis=0).sum()))
    amplitude = np.array(amplitudes).reshape(shape)
    status = np.array([record.status.values[0] for record in records], dtype=object).reshape(shape)
    soft = np.asarray(springs) <= SWINGING
    inverse = np.broadcast_to(1.0 / np.asarray(springs)[:, None], shape)
    point = measures.point_of(measures.fitted(inverse[soft].ravel(), amplitude[soft].ravel()))
    both = ("spring", "repeat")
    return xr.Dataset(
        {"amplitude": (both, amplitude, {"units": "rad"}), "status": (both, status)},
        coords={"spring": measures.over_springs(springs), "repeat": np.arange(repeats)},
        attrs={
            "robot": robot.name,
            "critical_k": point.value,
            "critical_k_error": point.error,
            "critical_k_freedom": point.freedom,
        },
    )
