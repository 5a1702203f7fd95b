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
from scipy.special import ndtri

from chilopod.analysis.cycle_modes import CycleMode
from chilopod.analysis.cycle_multipliers import finite_modes
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.square_root import SquareRootFit
from chilopod.engine import engine_named
from chilopod.frozen import Array
from chilopod.paper import measures, printed
from chilopod.paper.section import QUICK_REPEATS, Context, Size
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.statistics import LEVEL
from chilopod.tasks.radius_law import DURATION, end_of_walk
from chilopod.trials import AVERAGED

SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0, 41.0, 75.0)
"""k1 of the base series, N*mm/deg: the paper's, and 26, at which it prints a radius."""

VARIANT_SPRINGS = (12.0, 15.0, 17.0, 19.0, 21.0, 24.0, 28.0, 34.0)
"""k1 of the variants, N*mm/deg."""

UNIFORM_SPRINGS = (30.0, 26.0, 23.0, 20.0, 17.0, 14.0, 11.0)
"""All springs together, N*mm/deg, the stiffest first."""

UNDULATION, BEND = "undulation", "bend"
"""Modes by which the straight walk ends with all springs alike."""

AMPLITUDE = float(np.deg2rad(5.0))
"""Size of the bends whose multipliers are measured with all springs alike, rad: one that is seen."""

REPEATS, VARIANT_REPEATS = 10, 5

SHORTER = (20.0, 30.0, 40.0, 60.0)
"""Further durations of the base series, s, as the paper does not print the duration of its trials."""

_RATE = 50.0
_EXAMPLES = (41.0, 15.0)
_CYCLES, _FEW = 32, 8  # that bends are followed, and those of a tiny report
_LOST = 0.1  # error of a modulus, beyond which the straight walk is lost


@dataclass(frozen=True)
class RobotWalks:
    """Results of the walks."""

    base: xr.Dataset  # walks of the robot as built, see :func:`walk_ends`
    durations: xr.Dataset  # see :func:`by_duration`
    variants: Mapping[str, xr.Dataset]  # as ``base``, of the paper's three, by name
    lower_steps: Mapping[str, xr.Dataset]  # of those that change the stride, see :func:`lower_steps`
    examples: xr.Dataset  # see :func:`chilopod.paper.measures.example_walks`
    uniform: xr.Dataset | None  # see :func:`uniform_modes`

    @property
    def fit(self) -> SquareRootFit | None:
        """The square-root law of the base series."""
        return measures.onset(self.base)


def robot_walks(context: Context, progress: Progress = silent) -> RobotWalks:
    """All walks of the paper by the whole robot; if quick, :data:`chilopod.paper.section.QUICK_REPEATS` at
    each spring of the base series only."""
    robot, folder, size = context.whole, context.folder, context.size
    quick = size is Size.QUICK
    repeats, fewer = size.of((REPEATS, VARIANT_REPEATS), (QUICK_REPEATS, 0), (1, 1))
    springs, uniform_springs = size.cut((VARIANT_SPRINGS, UNIFORM_SPRINGS), (VARIANT_SPRINGS[1::4], (30.0,)))
    duration = size.cut(DURATION, 6.0)
    share = part(progress, 0.0, 1.0 if quick else 0.31, "as built")
    records = walk_records(robot, SPRINGS, repeats, duration=duration, folder=folder, progress=share)
    base, durations = walk_ends(records, robot, SPRINGS), by_duration(records, robot, SPRINGS)
    examples = measures.example_walks(robot, _EXAMPLES, duration, measures.spring_seeds(_EXAMPLES), "twin", folder)
    if quick:
        return RobotWalks(base, durations, {}, {}, examples, None)
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
    shown = part(progress, 0.91, 1.0, "uniform springs")
    uniform = uniform_modes(robot, uniform_springs, size=size, folder=folder, progress=shown)
    return RobotWalks(base, durations, variants, lower, examples, uniform)


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

    Dataset of :func:`over_durations`, after those of :data:`SHORTER` and the walks' own last.
    """
    last = float(records[0].time[-1])
    durations = [*(each for each in SHORTER if each < last), last]
    return over_durations([walk_ends(records, robot, springs, duration) for duration in durations], durations)


def over_durations(series: Sequence[xr.Dataset], durations: Sequence[float]) -> xr.Dataset:
    """Results of the same walks after several durations (s).

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


def uniform_modes(
    robot: Robot,
    springs: Sequence[float] = UNIFORM_SPRINGS,
    *,
    engine: str = "twin",
    size: Size = Size.FULL,
    folder: measures.Folder = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Leading modes of the straight walk with all springs alike, the stiffest first, and the spring at which each of
    them begins to grow: an undulation, and a bend, which may sway slowly from side to side.

    Dataset over mode and spring (N*mm/deg): ``modulus`` of the multiplier of bends of :data:`AMPLITUDE`, half its
    interval of 95 % ``modulus_error``, and ``period`` of the mode (s, infinite where the multiplier may be real), NaN
    where the mode does not lead or the straight walk is lost; over mode ``end``, at which the modulus passes 1, and its
    standard error ``end_error`` (N*mm/deg), NaN if it does not.
    """

    cycles = size.cut(_CYCLES, _FEW)

    def compute() -> list[Any]:
        known: list[tuple[Array, Any]] = []  # state and leading modes of the last stable walk
        rows = []
        for index, spring in enumerate(springs):
            progress(index / len(springs), f"{spring:g} {PAPER_UNIT}")
            cycle, standing = walker.walk_cycle(robot.with_value(ALL, stiffness(spring)))
            start, basis = known[-1] if known else (standing, None)
            modes, settled, own = finite_modes(cycle, start, yaw, AMPLITUDE, cycles, basis)
            if abs(modes[0].multiplier) < 1.0:
                known.append((settled, own))
            lead = {mode.shape: mode for mode in reversed(modes) if mode.error < _LOST}
            rows.append([_leading(lead.get(name)) for name in (UNDULATION, BEND)])
        return rows

    walker: Any = engine_named(engine)
    yaw = [f"yaw{i}" for i in range(1, robot.body.modules)]
    how = ("uniform", *springs, AMPLITUDE, cycles, engine)
    modulus, error, turn = np.moveaxis(np.array(measures.kept(folder, robot, how, compute)), 2, 0).swapaxes(1, 2)
    ends = np.array([_passes_one(springs, *each) for each in zip(modulus, error, strict=True)]).T
    with np.errstate(divide="ignore"):
        period = 2.0 * np.pi * robot.gait.period / turn
    columns = {
        "modulus": (("mode", "spring"), modulus),
        "modulus_error": (("mode", "spring"), error),
        "period": (("mode", "spring"), period, {"units": "s"}),
        "end": ("mode", ends[0], {"units": PAPER_UNIT}),
        "end_error": ("mode", ends[1], {"units": PAPER_UNIT}),
    }
    coords = {"mode": [UNDULATION, BEND], "spring": measures.over_springs(springs)}
    return xr.Dataset(columns, coords, {"robot": robot.name, "amplitude": AMPLITUDE})


def _leading(mode: CycleMode | None) -> tuple[float, float, float]:
    """Modulus of a mode, its error, and the angle by which it turns in a gait cycle, rad."""
    nan = float("nan")
    return (nan,) * 3 if mode is None else (abs(mode.multiplier), mode.error, mode.turn)


def _passes_one(springs: Sequence[float], modulus: Array, error: Array) -> tuple[float, float]:
    """Spring below which a modulus is above 1, between neighbours linearly in 1/k, and its standard error."""
    inverse, above = 1.0 / np.asarray(springs), modulus - 1.0
    for i in range(len(inverse) - 1):
        if above[i] <= 0.0 < above[i + 1]:
            part = above[i] / (above[i] - above[i + 1])
            gap = inverse[i + 1] - inverse[i]
            value = 1.0 / (inverse[i] + part * gap)
            half = np.hypot((1.0 - part) * error[i], part * error[i + 1]) * gap / (above[i + 1] - above[i])
            return float(value), float(value**2 * half / ndtri(0.5 + 0.5 * LEVEL))
    return float("nan"), float("nan")
