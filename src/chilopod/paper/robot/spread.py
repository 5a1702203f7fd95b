"""Predictions of the twin over the valley of constants that its data leave open.

Weighted samples of two valleys, results of ``chilopod identify twin``, are included: with joints without dry friction,
and with any. Sets of constants that are drawn by these weights predict the printed results of other experiments, each
with few undisturbed walks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from chilopod import trials
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.errors import ParameterError
from chilopod.paper import printed
from chilopod.paper.equal_distance import radius_ratio
from chilopod.paper.fit_data import base_series_data
from chilopod.paper.measures import Folder, onset_point, spring_walks
from chilopod.paper.robot.turning import TASK_DURATION
from chilopod.paper.robot.walks import UNDULATION, lower_steps, uniform_modes, walk_ends
from chilopod.paper.section import Context, Size
from chilopod.paper.turning.trials import to_target
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import ARRIVAL_RADIUS
from chilopod.tasks.identify.data import FITTED, WITH_FRICTION
from chilopod.tasks.identify.twin import known, samples_of
from chilopod.trials import NONE

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


def twin_spread(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Predictions by the preset and by sets of constants drawn from both valleys; if not full, by one of each.

    Returns
    -------
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
        attrs={
            "robot": robot.name,
            "numbers": len(series.radii) + len(series.speeds) + 1,
            "answers": len(series.curved) + len(series.straight),
        },
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
    longest = size.cut(_DURATION, 10.0)
    undisturbed: dict[str, Any] = {"joint_angles": bend, "disturbance": NONE, "rate": 10.0}
    series = {}
    for name, variant in variants.items():
        duration = longest * robot.gait.stride / variant.gait.stride
        walks = spring_walks(variant, springs, duration, folder=folder, engine=engine, **undisturbed)
        series[name] = walk_ends(walks, variant, springs)
    base = next(iter(series.values()))
    try:
        modes = uniform_modes(robot, uniform_springs, folder=folder, engine=engine)
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
