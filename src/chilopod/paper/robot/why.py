"""Reasons why the robot bends at 34 and the planar model at 12: steps from the planar model's assumptions to the
twin's.

The twin has a planar limit. Its legs are as stiff as the step allows, lift their feet high and put them down on the
point. Its feet never reach the Coulomb limit, so the floor resists them like a viscous one with the coefficient of the
planar model (see :mod:`chilopod.twin.creep`). There the two engines have to agree. Each :class:`Factor` then removes
one assumption. Factors are switched on alone in the planar limit, switched off alone in the twin, and switched on one
after the other.

The measure is the paper's: the onset of curved walks by a square-root fit to the bend of joint 1. The agreement of
the engines in the planar limit has a finer one: the spring at which the growth rate of a bend of 1 deg changes sign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.analysis.straight_walk import pitchfork
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.measures import Folder, cycle_means, fitted, point_of, spring_walks
from chilopod.paper.section import Context, Size
from chilopod.paper.statements import PLANAR_LIMIT
from chilopod.paper.table import OfPlanar, OfTwin, Result, of_twin
from chilopod.progress import Progress, silent
from chilopod.robot import Robot, Twin
from chilopod.tasks.radius_law import CURVED
from chilopod.trials import NONE
from chilopod.twin.creep import foot_creep
from chilopod.twin.legs import twin_of

SPRINGS = (7.0, 10.0, 15.0, 22.0, 33.0, 50.0)
"""First springs k1 that are tried, N*mm/deg."""

PLANAR = {
    "twin.sliding_friction": 1000.0,
    "twin.servo_stiffness": 300.0,
    "twin.servo_damping": 0.75,
    "twin.joint_inertia": 3e-4,
    "twin.clearance": 0.03,
    "twin.contact_time": 0.002,
    "twin.foot_radius": 5e-4,
    "twin.link_mass": 0.01,
    "twin.timestep": 5e-4,
}
"""Constants of the planar limit instead of the twin's, SI."""

FINER = {
    **PLANAR,
    "twin.servo_stiffness": 1000.0,
    "twin.servo_damping": 2.0,
    "twin.contact_time": 0.001,
    "twin.control_interval": 0.001,
    "twin.timestep": 2e-4,
}
"""Planar limit with smaller remaining differences, at 2.5 times the work."""


@dataclass(frozen=True)
class Factor:
    """Assumption of the planar model that the twin does not make, in a word and a sentence, and the numbers of the
    robot that go from those of the planar limit to the twin's."""

    name: str
    sentence: str
    paths: tuple[str, ...]


FACTORS = (
    Factor("feet", "where the feet are", ("legs.forward_offset", "legs.half_width")),
    Factor("grip", "how firmly the floor holds a foot that does not slide", ()),
    Factor("dry friction", "feet slide beyond the Coulomb limit", ("twin.sliding_friction",)),
    Factor(
        "soft legs", "servos give way under load", ("twin.servo_stiffness", "twin.servo_damping", "twin.joint_inertia")
    ),
    Factor("dragging feet", "swing feet are hardly lifted and touch the floor", ("twin.clearance",)),
    Factor("joint damping", "friction in the yaw joints", ("springs.damping",)),
    Factor(
        "legs and floor",
        "mass of the legs, size of the feet, softness of the floor",
        ("twin.link_mass", "twin.foot_radius", "twin.contact_time"),
    ),
)
"""Factors, in the order in which they are switched on one after the other."""

_BEND = float(np.deg2rad(1.0))
_DURATION, _SKIPPED = 18.0, 6.0  # s
_SAMPLES = 6  # per period
_BENT, _WALK = 0.5, 60.0  # rad (root of the sum of squares) and s, of the walks that a square root is fitted to
_AVERAGED, _PER_SECOND = 12.0, 10.0  # s, a cycle of the undulation that the twin has besides; Hz
_BESIDE = (0.75, 0.85, 0.95)  # of a point, springs for a finer one
_SOFT_STEP = 2e-3  # s, enough for soft legs


def planar_limit(robot: Robot, planar: Robot, constants: Mapping[str, float] = PLANAR) -> Robot:
    """The twin under the assumptions of the planar model, with that model's feet and friction."""
    return with_grip(_limit(robot, planar, constants), planar.ground.friction)


def _limit(robot: Robot, planar: Robot, constants: Mapping[str, float]) -> Robot:
    # All at once: not every step goes into every control interval.
    own = {key.partition(".")[2]: value for key, value in constants.items()}
    changed = robot.with_(twin=Twin(**{**dict(twin_of(robot)), **own})).with_value("springs.damping", 0.0)
    for path in FACTORS[0].paths:
        changed = changed.with_value(path, planar.get(path))
    return changed


def with_grip(robot: Robot, coefficient: float) -> Robot:
    """Robot whose feet creep with a coefficient, N*s/m, which is proportional to ``impedance_ratio``."""
    ratio = robot.get("twin.impedance_ratio")
    return robot.with_value("twin.impedance_ratio", ratio * coefficient / foot_creep(robot).across)


def with_factors(robot: Robot, planar: Robot, names: Sequence[str]) -> Robot:
    """The planar limit with some factors switched on."""
    limit = _limit(robot, planar, PLANAR)
    for factor in FACTORS:
        if factor.name in names:
            for path in factor.paths:
                limit = limit.with_value(path, robot.get(path))
    if "soft legs" in names:
        limit = limit.with_value("twin.timestep", min(_SOFT_STEP, robot.get("twin.timestep")))
    return with_grip(limit, foot_creep(robot).across if "grip" in names else planar.ground.friction)


def growth(robot: Robot, springs: Sequence[float], folder: Folder = None, duration: float = _DURATION) -> Array:
    """Growth rates of a small bend of the twin, averaged over gait cycles, with each spring (N*mm/deg), 1/s; NaN where
    a walk failed."""
    bend, rate = _BEND * _shape(robot), _SAMPLES / robot.gait.period
    records = [_walks(robot, springs, duration, folder, sign * bend, rate) for sign in (1.0, -1.0)]
    rates = []
    for pair in zip(*records, strict=True):
        one, other = (each.joint_angle.isel(robot=0).transpose("time", "joint").values for each in pair)
        cycles = cycle_means(0.5 * (one - other), _SAMPLES)
        times = (np.arange(len(cycles)) + 0.5) * robot.gait.period
        late = times > _SKIPPED
        rates.append(np.polyfit(times[late], np.log(np.linalg.norm(cycles[late], axis=1)), 1)[0])
    return np.array(rates)


def sign_change(springs: ArrayLike, growth: Array) -> float:
    """The stiffest spring below which a growth rate is positive, between values linearly in 1/k; NaN if there is
    none."""
    inverse = 1.0 / np.asarray(springs)
    for i in range(len(inverse) - 1, 0, -1):
        if growth[i] <= 0.0 < growth[i - 1]:
            part = growth[i] / (growth[i] - growth[i - 1])
            return float(1.0 / (inverse[i] + part * (inverse[i - 1] - inverse[i])))
    return float("nan")


def onset(robot: Robot, folder: Folder = None, size: Size = Size.FULL) -> float:
    """Onset of curved walks, N*mm/deg, by the paper's method: the square-root fit to the bend of joint 1 of walks that
    begin bent. The first fit is over the three stiffest springs that curve, the second over three beside its point.

    Infinite if walks curve at the stiffest spring tried, NaN if at fewer than two, or if their bends point beyond it.
    If not full, without the second fit.
    """
    springs = size.cut(SPRINGS, SPRINGS[::3])
    duration = size.cut(_WALK, 2.5)
    bends = _bends(robot, springs, duration, folder)
    if bends[-1] > 0.0:
        return float("inf")
    point = _point(springs, bends)
    if size is not Size.FULL or np.isnan(point):
        return point
    finer = [round(point * part, 2) for part in _BESIDE]
    refined = _point(finer, _bends(robot, finer, duration, folder))
    return refined if refined <= max(springs) else point


def _walks(
    robot: Robot, springs: Sequence[float], duration: float, folder: Folder, bend: Array, rate: float
) -> list[xr.Dataset]:
    """Undisturbed walks of the twin that begin bent."""
    how: dict[str, Any] = {"disturbance": NONE, "rate": rate, "engine": "twin", "folder": folder}
    return spring_walks(robot, springs, duration, joint_angles=tuple(bend), **how)


def _bends(robot: Robot, springs: Sequence[float], duration: float, folder: Folder) -> Array:
    """Mean angle of joint 1 at the end of walks, rad; 0 where the body is straight, or the walk failed."""
    records = _walks(robot, springs, duration, folder, _BENT * _shape(robot), _PER_SECOND)
    kept = round(_AVERAGED * _PER_SECOND)
    last = np.abs([record.joint_angle.isel(robot=0).values[-kept:].mean(axis=0) for record in records])
    return np.where(last.sum(axis=1) > CURVED, last[:, 0], 0.0)


def _point(springs: Sequence[float], bends: Array) -> float:
    curved = np.flatnonzero(bends > 0.0)[-3:]
    if len(curved) < 2:
        return float("nan")
    # Two springs have a point too: a third that is as straight as it gets does not move it.
    inverse = np.array([*(1.0 / springs[i] for i in curved), 1e-3])
    point = point_of(fitted(inverse, [*bends[curved], 0.0])).value
    # Beyond a spring at which walks are straight there is no point.
    return point if point <= max(springs) or bends[-1] > 0.0 else float("nan")


def limit_point(
    robot: Robot,
    planar: Robot,
    constants: Mapping[str, float] = FINER,
    folder: Folder = None,
    duration: float = _DURATION,
) -> float:
    """Spring at which a small bend neither grows nor dies out in the planar limit, N*mm/deg, near the planar model's
    pitchfork; NaN if there is none."""
    springs = [round(part * pitchfork(planar, normal_form=False).value, 2) for part in (0.95, 1.05)]
    return sign_change(springs, growth(planar_limit(robot, planar, constants), springs, folder, duration))


def ablation(context: Context, progress: Progress = silent) -> xr.Dataset:
    """The point with factors switched on and off.

    The planar limit takes feet and friction from the robot of the planar model. If not full, only the path from the
    planar limit to the twin, without the second fit.

    Returns
    -------
    Dataset over factor: ``alone``, the point in the planar limit with only this one (N*mm/deg); ``without``, in the
    twin without it; ``path``, with it and all before it. Infinite where walks curve at all springs tried, NaN where at
    none. Attributes: ``limit`` and ``twin``, the point without factors and with all; ``vouched`` and ``exact``, the
    points of the planar limit by :func:`limit_point` and of the planar model; ``grip``, the twin's creep coefficient,
    and ``viscous``, the planar model's (N*s/m).
    """
    robot, planar, folder, size = context.whole, context.robot, context.folder, context.size
    names = [factor.name for factor in FACTORS]
    every = frozenset(names)
    wanted = {"path": [frozenset(names[: i + 1]) for i in range(len(names))]}
    if size is Size.FULL:
        wanted |= {"alone": [frozenset([name]) for name in names], "without": [every - {name} for name in names]}
    points = dict.fromkeys([frozenset[str](), *(on for sets in wanted.values() for on in sets)], np.nan)
    for index, on in enumerate(points):
        progress(index / len(points), ", ".join(sorted(on)) or "planar limit")
        points[on] = onset(with_factors(robot, planar, sorted(on)), folder, size)
    data = xr.Dataset(coords={"factor": names})
    for name in ("alone", "without", "path"):
        values = [points[on] for on in wanted[name]] if name in wanted else [np.nan] * len(names)
        data[name] = ("factor", np.array(values), {"units": PAPER_UNIT})
    data["about"] = ("factor", np.array([factor.sentence for factor in FACTORS], dtype=object))
    progress(1.0, "planar limit by growth")
    data.attrs = {
        "robot": robot.name,
        "vouched": limit_point(
            robot, planar, FINER if size is Size.FULL else PLANAR, folder, size.cut(_DURATION, 12.0)
        ),
        "exact": pitchfork(planar, normal_form=False).value,
        "limit": points[frozenset()],
        "twin": points[every],
        "grip": foot_creep(robot).across,
        "viscous": planar.ground.friction,
    }
    return data


def _shape(robot: Robot) -> Array:
    """Shape of the bend at the start."""
    mode = np.array(printed.mode_shape(robot))
    return mode / np.linalg.norm(mode)


def rows(data: xr.Dataset) -> list[OfTwin | OfPlanar]:
    """Line of the robot's table on the agreement of the engines in the planar limit."""
    point, exact = data.attrs["vouched"], data.attrs["exact"]
    words = f"{point:.2f} {PAPER_UNIT} ({100.0 * (point / exact - 1.0):+.1f} %, without an error)"
    return [
        of_twin(PLANAR_LIMIT, Result(words, point / exact, 0.0)),
        OfPlanar(PLANAR_LIMIT, Result(value=exact, unit=PAPER_UNIT, digits=4)),
    ]
