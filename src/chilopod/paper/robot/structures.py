"""Other structures of the robot: changes to the twin, each with its constants fitted anew.

Twins of several structures may meet the base series and predict different results. Here the preset gets each of some
structures, and least squares move its constants until it meets the base series again. All structures share one
derivative of the residuals, measured by differences at the preset. The predictions are then compared with the printed
results, by chi squared: a change of 2 decides nothing, a change of 10 speaks clearly for or against a structure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import xarray as xr

from chilopod import twin
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.measures import Folder
from chilopod.paper.printed import CRITERION_NAMES, base_series_data
from chilopod.paper.robot.spread import LOWER, predictions, printed_number
from chilopod.paper.robot.turning import TASK_DURATION
from chilopod.paper.section import Context, Size
from chilopod.paper.turning.study import minima
from chilopod.paper.turning.trials import strategy_tasks
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.data import FITTED, BaseSeries
from chilopod.tasks.identify.twin import PRIOR
from chilopod.tasks.identify.twin_series import DURATION, base_series, residuals

PHASE, UNIFORM = "module phase 180 deg", "all springs alike"
"""Names of the variants, and of the predictions."""

TOLERANCE = 0.05
"""Tolerance of a printed onset, relative: half of the report's; unit of the residuals in chi squared."""

_STEP = 0.06  # of a constant's range, for differences: where walks change evenly
_LOST = 30.0  # residual of a walk that fails
_ROUNDS, _MET = 5, 0.7  # steps at most, and misfit at which that ends

_SPRINGS = {"pitchfork": (17.0, 21.0, 26.0), "hopf": (8.7, 11.0, 15.0)}  # N*mm/deg, where criteria are smallest
_REPEATS = 3

_ROLL = 50.0  # N*m/rad
_PLAY = np.deg2rad(1.0)
_HIGHER = 0.02  # m
_HEAVIER = 1.5


def _rolls(spec: mujoco.MjSpec, robot: Robot) -> None:
    for i in range(2, robot.body.modules + 1):
        spec.body(f"module{i}").add_joint(
            name=f"roll{i}",
            axis=[1.0, 0.0, 0.0],
            pos=[0.5 * robot.module_length, 0.0, 0.0],
            stiffness=[_ROLL, 0.0, 0.0],
            damping=[0.02 * _ROLL, 0.0, 0.0],
        )


def _play(spec: mujoco.MjSpec, robot: Robot) -> None:
    for joint in [each for each in spec.joints if each.name.startswith("leg")]:
        joint.parent.add_joint(
            name=f"{joint.name}_play",
            axis=joint.axis,
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[-0.5 * _PLAY, 0.5 * _PLAY],
            armature=1e-5,
            damping=[1e-3, 0.0, 0.0],
        )


def _high(spec: mujoco.MjSpec, robot: Robot) -> None:
    for i in range(1, robot.body.modules + 1):
        spec.body(f"module{i}").ipos[2] += _HIGHER


def _heavy_front(spec: mujoco.MjSpec, robot: Robot) -> None:
    count = robot.body.modules
    for i in range(1, count + 1):
        body = spec.body(f"module{i}")
        part = _HEAVIER if i == 1 else (count - _HEAVIER) / (count - 1)
        body.mass, body.inertia = part * body.mass, part * np.array(body.inertia)


ROLLS = twin.Edited("modules that roll", _rolls)
PLAY = twin.Edited("play in leg joints", _play)
HIGH = twin.Edited("mass high up", _high)
HEAVY_FRONT = twin.Edited("heavy front", _heavy_front)


@dataclass(frozen=True)
class Structure:
    """Structure that the robot could have: a word, a sentence, and overrides as for ``--set``, or the name of an engine
    in this module if a robot file cannot express it."""

    name: str
    sentence: str
    overrides: tuple[str, ...] = ()
    edited: str = ""

    @property
    def engine(self) -> str:
        """Engine that walks it."""
        return f"{__name__}:{self.edited}" if self.edited else "twin"


STRUCTURES = (
    Structure("as it is", "the preset"),
    Structure("modules roll", "against each other, held by 50 N*m/rad", edited="ROLLS"),
    Structure("dry leg joints", "0.05 N*m of dry friction in each", ("twin.leg_friction=0.05 N*m",)),
    Structure("play in leg joints", "1 deg of backlash in each", edited="PLAY"),
    Structure("mass high up", "bodies' centres of mass 20 mm above the hips", edited="HIGH"),
    Structure("heavy front", "module 1 with 1.5 times the mass of a module", edited="HEAVY_FRONT"),
    Structure("heavy links", "80 g instead of 40", ("twin.link_mass=0.08 kg",)),
    Structure("light links", "20 g instead of 40", ("twin.link_mass=0.02 kg",)),
    Structure("high hips", "108 mm instead of 98, straighter legs", ("twin.hip_height=108 mm",)),
    Structure("long links", "70 mm instead of 60", ("twin.upper_link=70 mm", "twin.lower_link=70 mm")),
    Structure("large feet", "12 mm instead of 6", ("twin.foot_radius=12 mm",)),
    Structure("soft floor", "40 ms instead of 20", ("twin.contact_time=0.04 s",)),
    Structure("slow commands", "every 10 ms instead of 2", ("twin.control_interval=0.01 s",)),
    Structure("slow scanner", "a scan in 0.5 s instead of 0.1", ("twin.scanner_period=0.5 s",)),
)
"""Structures that are tried; the first is the robot as it is."""


def structures(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Predictions by other structures, with constants fitted anew; if tiny, by one with the preset's constants.

    Dataset over structure: ``misfit`` to the base series, with the preset's constants (``given``) and with its own
    (``fitted``), over ``fit``; ``constants`` (SI) over constant; over prediction, ``predicted`` and ``paper``
    (N*mm/deg); ``tighter``, radius with a module phase of 180 deg over that as built, at an equal distance from each
    one's own onset; ``criteria``, the smallest mean of each of the paper's three in task A over strategy; and
    ``chi_squared``, the sum of squares of the predictions' distances from the paper's over 5 %, for the shorter stride
    by the nearer of its two readings.
    """
    robot, folder, size = context.whole, context.folder, context.size
    data = base_series_data()
    tried, rounds, duration = size.cut((STRUCTURES, _ROUNDS, DURATION), (STRUCTURES[:1], 0, 6.0))
    law = _law(robot, data, part(progress, 0.0, 0.1)) if rounds else np.empty(0)
    rows: list[Mapping[str, Any]] = []
    for index, each in enumerate(tried):
        progress(0.1 + 0.9 * index / len(tried), each.name)
        changed = robot.set_from_text(each.overrides)
        given, fitted, anew = _fitted(changed, data, law, each.engine, rounds, duration)
        found = predictions(anew, folder, each.engine, size)
        criteria = _strategies(anew, folder, each.engine, size)
        rows.append({**found, "misfit": (given, fitted), "constants": FITTED.of(anew), "criteria": criteria})
    variants = [name for name in rows[0]["onset"] if name != printed.AS_BUILT]
    names = [*variants, UNIFORM]
    predicted = [[*(row["onset"][name] for name in variants), row["uniform"]] for row in rows]
    paper = [*(printed_number(name).value for name in variants), printed.UNIFORM.value]
    misfits, constants, smallest = (np.array([row[key] for row in rows]) for key in ("misfit", "constants", "criteria"))
    return xr.Dataset(
        {
            "misfit": (("structure", "fit"), misfits),
            "constants": (("structure", "constant"), constants),
            "predicted": (("structure", "prediction"), np.array(predicted), {"units": PAPER_UNIT}),
            "paper": ("prediction", paper, {"units": PAPER_UNIT}),
            "tighter": ("structure", np.array([row["radius"][PHASE] for row in rows])),
            "criteria": (("structure", "strategy", "criterion"), smallest, {"units": "m, rad, rad^2*s"}),
            "about": ("structure", np.array([each.sentence for each in tried], dtype=object)),
        },
        coords={
            "structure": [each.name for each in tried],
            "fit": ["given", "fitted"],
            "constant": FITTED.paths,
            "prediction": names,
            "strategy": list(_SPRINGS),
            "criterion": list(CRITERION_NAMES),
        },
        attrs={"robot": robot.name},
    ).pipe(_with_chi_squared)


def _with_chi_squared(data: xr.Dataset) -> xr.Dataset:
    squared = ((data.predicted / data.paper - 1.0) / TOLERANCE) ** 2
    readings = [name for name in data.prediction.values if name.endswith(LOWER)]
    twice = [*readings, *(name.removesuffix(LOWER) for name in readings)]
    once = squared.drop_sel(prediction=twice).sum("prediction", skipna=False)
    return data.assign(chi_squared=once + squared.sel(prediction=twice).min("prediction", skipna=False))


def _strategies(robot: Robot, folder: Folder, engine: str, size: Size) -> Array:
    """The smallest criteria of task A, with one soft spring and with all springs alike."""
    target = printed.TASKS["A"].target
    repeats, duration = size.cut((_REPEATS, TASK_DURATION), (2, 3.0))
    kept: Any = {"duration": duration, "engine": engine, "folder": folder}
    tasks = strategy_tasks(robot, target, _SPRINGS, repeats, **kept)
    names = list(CRITERION_NAMES)
    return np.array([minima(task.criteria)["mean"].sel(criterion=names).values for task in tasks.values()])


def _law(robot: Robot, data: BaseSeries, progress: Progress) -> Array:
    """Slopes of the residuals over the parts of the constants' ranges, shape (residuals, constants)."""
    place = FITTED.parts_of(FITTED.of(robot))
    columns: list[Array] = []
    for path, step in zip(FITTED.paths, _STEP * np.eye(len(place)), strict=True):
        progress(len(columns) / len(place), path)
        ends = [_off(FITTED.robot_with(robot, FITTED.values_at(place + sign * step)), data) for sign in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / (2.0 * _STEP))
    return np.array(columns).T


def _off(robot: Robot, data: BaseSeries, engine: str = "twin", duration: float = DURATION) -> Array:
    """Residuals that are not zero wherever they are met."""
    smooth = len(data.radii) + len(data.speeds) + 1
    series = base_series(robot, data, engine=engine, duration=duration)
    off = residuals(robot, series, data, by_curvature=True)[:smooth]
    return np.where(off == np.inf, _LOST, off)


def _fitted(
    robot: Robot, data: BaseSeries, law: Array, engine: str, rounds: int, duration: float
) -> tuple[float, float, Robot]:
    """Misfits before and after, and the robot with constants that meet the base series best."""
    place = FITTED.parts_of(FITTED.of(robot))
    best_robot, off = robot, _off(robot, data, engine, duration)
    given = best = float(np.sqrt(np.mean(off**2)))
    here = place
    for _ in range(rounds):
        if best <= _MET:
            break
        # Damped about the preset: no constant is moved far for little.
        normal = law.T @ law + np.eye(len(here)) / PRIOR**2
        levenberg = -np.linalg.solve(normal, law.T @ off + (here - place) / PRIOR**2)
        step = np.clip(here + levenberg, 0.0, 1.0) - here
        moved = FITTED.robot_with(robot, FITTED.values_at(here + step))
        found = _off(moved, data, engine, duration)
        law = law + np.outer(found - off - law @ step, step) / max(float(step @ step), 1e-12)  # Broyden
        here, off = here + step, found
        misfit = float(np.sqrt(np.mean(off**2)))
        if misfit < best:
            best, best_robot = misfit, moved
    return given, best, best_robot
