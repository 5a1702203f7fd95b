"""How far to trust the twin: its predictions over the valley of constants that its data leave open, and its numerics.

Weighted samples of two valleys, results of ``chilopod identify twin``, are included: with joints without dry friction,
and with any. Sets of constants that are drawn by these weights predict the printed results of other experiments, each
with few undisturbed walks. The base series is repeated with finer steps and a tighter solver.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from chilopod import trials
from chilopod.analysis.parameters import PAPER_UNIT, stiffness
from chilopod.errors import ParameterError
from chilopod.paper import printed
from chilopod.paper.measures import Folder, fitted, onset_point, over_springs, point_of, radius_ratio, spring_walks
from chilopod.paper.printed import base_series_data
from chilopod.paper.robot.turning import TASK_DURATION
from chilopod.paper.robot.walks import UNDULATION, lower_steps, uniform_modes, walk_ends
from chilopod.paper.section import Context, Size
from chilopod.paper.statements import NUMERICS
from chilopod.paper.table import OfTwin, Result, of_twin
from chilopod.paper.turning.trials import to_target
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import ARRIVAL_RADIUS
from chilopod.tasks.identify.data import FITTED, WITH_FRICTION
from chilopod.tasks.identify.twin import known, samples_of
from chilopod.tasks.identify.twin_series import DURATION, base_series
from chilopod.trials import NONE
from chilopod.twin.walk import TOLERANCE

SPRINGS = (13.0, 15.0, 17.0, 19.0, 21.0, 24.0, 28.0)
"""k1 of the variants, N*mm/deg."""

TASK_SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0, 34.0, 41.0)
UNIFORM_SPRINGS = (30.0, 23.0, 18.0, 14.0)
COUNT = 12
"""Number of sets of constants of a valley that predict, with the preset's."""

VALLEYS = {"without friction": FITTED, "with friction": WITH_FRICTION}
"""Constants of the valleys: dry friction of the joints is zero, or free."""

LOWER = ", lower steps"
"""Suffix of a variant's name with steps lowered in proportion to their length."""

_DURATION = 60.0  # s
_BENT = 0.8  # rad in all, that walks begin with

NUMERIC_SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0)
"""k1 of the walks with other numerics, N*mm/deg."""

CASES = {"2 ms": (2e-3, TOLERANCE), "1 ms": (1e-3, TOLERANCE), "0.5 ms": (5e-4, TOLERANCE), "tight": (2e-3, 1e-13)}
"""Step (s) and tolerance of the contact solver; all studies use the first."""


def twin_spread(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Predictions by the preset and by sets of constants drawn from both valleys; if not full, by one of each.

    Dataset over set (0 the preset's), with the ``valley`` of each and by valley its number of ``effective`` samples:
    the constants (SI; ``unit`` is the unit of the robot file) by path over ``constant``, and predictions: over variant
    ``onset`` (N*mm/deg, NaN where walks determine none; ``paper`` as printed) and ``radius`` (over that as built, at an
    equal distance from each one's own onset), ``uniform`` (N*mm/deg), and over task ``best``, the spring that comes
    nearest to the target (N*mm/deg), and ``arrives``, True if its walk arrives. The walks are undisturbed, so sets
    differ by their constants alone.
    """
    robot, folder, size = context.whole, context.folder, context.size
    count = size.of(COUNT, 2, 2) - 1
    samples = {valley: samples_of(known(free)) for valley, free in VALLEYS.items()}
    sets = [("preset", FITTED.robot_with(robot, FITTED.values_at(known()[0].parts)))]
    for valley, free in VALLEYS.items():
        sets += [(valley, free.robot_with(robot, free.values_at(each))) for each in samples[valley].drawn(count)]
    rows: list[dict[str, Any]] = []
    for index, (_, other) in enumerate(sets):
        progress(index / len(sets), f"set {index + 1} of {len(sets)}")
        rows.append({**predictions(other, folder, size=size), **nearest_springs(other, folder, size)})
    series = base_series_data()
    numbers = len(series.radii) + len(series.speeds) + 1
    names, tasks, paths = list(rows[0]["onset"]), list(rows[0]["best"]), WITH_FRICTION.paths

    def table(name: str, over: str, keys: list[str]) -> tuple[tuple[str, str], np.ndarray]:
        return ("set", over), np.array([[row[name][key] for key in keys] for row in rows])

    return xr.Dataset(
        {
            "constants": (("set", "constant"), np.array([WITH_FRICTION.of(other) for _, other in sets])),
            "unit": ("constant", [robot.unit_of(path) for path in paths]),
            "uniform": ("set", np.array([row["uniform"] for row in rows]), {"units": PAPER_UNIT}),
            "onset": table("onset", "variant", names),
            "radius": table("radius", "variant", names),
            "best": table("best", "task", tasks),
            "paper": ("variant", [printed_number(name).value for name in names], {"units": PAPER_UNIT}),
            "arrives": table("arrives", "task", tasks),
            "valley": ("set", [valley for valley, _ in sets]),
            "effective": ("from", [each.effective for each in samples.values()]),
        },
        coords={"set": np.arange(len(sets)), "constant": paths, "variant": names, "task": tasks, "from": list(samples)},
        attrs={"robot": robot.name, "numbers": numbers, "answers": len(series.curved) + len(series.straight)},
    )


def printed_number(reading: str) -> printed.Number:
    """Onset of the paper's curved walks of a variant in one of its readings."""
    return printed.onset(reading.removesuffix(LOWER))


def predictions(robot: Robot, folder: Folder = None, engine: str = "twin", size: Size = Size.FULL) -> dict[str, Any]:
    """Onsets of curved walks outside the base series, and their radii, by few undisturbed walks, which begin bent; and
    that of an undulation with all springs alike, by multipliers.

    By variant ``onset`` (N*mm/deg) and ``radius`` (over that as built, at an equal distance from each one's own onset),
    and ``uniform`` (N*mm/deg); NaN where walks determine none.
    """
    shape = np.array(printed.mode_shape(robot))
    bend = tuple(_BENT * shape / shape.sum())
    variants = printed.variant_robots(robot)
    for name, variant in list(variants.items()):
        if variant.gait.stride != robot.gait.stride:
            variants[f"{name}{LOWER}"] = lower_steps(robot, variant)
    springs, uniform_springs = size.cut((SPRINGS, UNIFORM_SPRINGS), (SPRINGS[1::4], UNIFORM_SPRINGS[:1]))
    longest = size.cut(_DURATION, 6.0)
    undisturbed: dict[str, Any] = {"joint_angles": bend, "disturbance": NONE, "rate": 10.0}
    series = {}
    for name, variant in variants.items():
        duration = longest * robot.gait.stride / variant.gait.stride
        walks = spring_walks(variant, springs, duration, folder=folder, engine=engine, **undisturbed)
        series[name] = walk_ends(walks, variant, springs)
    base = next(iter(series.values()))
    try:
        modes = uniform_modes(robot, uniform_springs, engine=engine, size=size, folder=folder)
        uniform = float(modes.end.sel(mode=UNDULATION))
    except ParameterError:  # servos that are too stiff for the steps of a derivative
        uniform = np.nan
    return {
        "onset": {name: onset_point(each).value for name, each in series.items()},
        "radius": {name: radius_ratio(base, each).distance.value for name, each in series.items()},
        "uniform": uniform,
    }


def nearest_springs(robot: Robot, folder: Folder = None, size: Size = Size.FULL) -> dict[str, dict[str, Any]]:
    """For each of the paper's tasks ``best``, the spring that comes nearest to the target undisturbed (N*mm/deg), and
    ``arrives``, True if its walk arrives."""
    found: dict[str, dict[str, Any]] = {"best": {}, "arrives": {}}
    springs, duration = size.cut((TASK_SPRINGS, TASK_DURATION), (TASK_SPRINGS[::3], 2.0))
    same: dict[str, Any] = {"duration": duration, "disturbance": NONE, "rate": 20.0, "engine": "twin"}
    for letter, task in printed.TASKS.items():
        walks = [to_target(robot, task.target, spring, **same) for spring in springs]
        nearest = [float(record.distance.min()) for record in trials.run(walks, folder)]
        found["best"][letter] = springs[int(np.argmin(nearest))]
        found["arrives"][letter] = bool(min(nearest) < ARRIVAL_RADIUS)
    return found


def twin_numerics(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Onset, radii and speeds with finer steps and a tighter solver; if not full, the first two cases only.

    Dataset over case and spring: ``axis_radius`` (m) and ``speed`` of module 1 (m/s); over case: ``onset`` by the
    paper's method (N*mm/deg).
    """
    robot, size = context.whole, context.size
    radii, speeds, onsets = [], [], []
    cases = CASES if size is Size.FULL else dict(list(CASES.items())[:2])
    springs, duration = size.cut((NUMERIC_SPRINGS, DURATION), (NUMERIC_SPRINGS[::2], 6.0))
    for index, (name, (step, tolerance)) in enumerate(cases.items()):
        progress(index / len(cases), name)
        finer = robot.with_value("twin.timestep", step)
        found = base_series(
            finer, base_series_data(), [*map(stiffness, springs)], tolerance=tolerance, duration=duration
        )
        speeds.append(found.speeds)
        radii.append(robot.axis_radius(found.bends))
        onsets.append(point_of(fitted(1.0 / np.array(springs), np.abs(found.bends[:, 0]))).value)
    columns = {
        "axis_radius": (("case", "spring"), np.array(radii), {"units": "m"}),
        "speed": (("case", "spring"), np.array(speeds), {"units": "m/s"}),
        "onset": ("case", np.array(onsets), {"units": PAPER_UNIT}),
    }
    return xr.Dataset(columns, {"case": list(cases), "spring": over_springs(springs)}, {"robot": robot.name})


def numeric_rows(data: xr.Dataset) -> list[OfTwin]:
    """The line of the robot's table."""
    moves = data[["onset", "axis_radius", "speed"]] / data.isel(case=0, drop=True) - 1.0
    at_21 = 100.0 * moves.sel(spring=21.0)
    said = "; ".join(
        f"{name}: onset {float(at.onset):+.1f} %, radius at 21 {float(at.axis_radius):+.1f} %, "
        f"speed {float(at.speed):+.1f} %"
        for name, at in ((str(name), at_21.sel(case=name)) for name in data.case.values[1:])
    )
    # NaN if a walk failed.
    move = float(max(np.abs(each.values).max() for each in moves.data_vars.values()))
    words = f"{said}; largest move of onset, and radii and speeds at 15 to 28 N*mm/deg, {100.0 * move:.1f} %"
    return [of_twin(NUMERICS, Result(f"{words} (one walk each, without an error)", move, 0.0))]
