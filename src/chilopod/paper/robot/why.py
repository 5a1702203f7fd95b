"""Reasons why the robot bends at 34 and the planar model at 12: parts of the assumptions by which the planar model
differs from the twin.

The twin has a planar limit. Its legs are as stiff as the step allows, lift their feet high and put them down on the
point. Its feet never reach the Coulomb limit, so the floor resists them like a viscous one with the coefficient of the
planar model (see :mod:`chilopod.twin.creep`). There the two engines have to agree. Each :class:`Factor` then removes
one assumption.

The measure is the spring k1 at which the straight walk ends: the largest modulus of the leading multipliers, of bends
of 1 deg, passes 1. It is searched with every subset of the factors. Shapley values (L. S. Shapley, "A value for
n-person games", 1953) of its logarithm share the whole change among the factors: the mean over all orders of removal.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.linalg import null_space

from chilopod.analysis.cycle_multipliers import crossing, finite_modes
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.straight_walk import pitchfork
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.measures import Folder, kept
from chilopod.paper.section import Context, Size
from chilopod.paper.statements import PLANAR_LIMIT
from chilopod.paper.table import OfPlanar, OfTwin, Result, of_twin
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot, Twin
from chilopod.show.words import SPRING_UNIT, listing
from chilopod.statistics import Interval
from chilopod.tasks.identify.data import FITTED
from chilopod.tasks.identify.twin import known, samples_of
from chilopod.twin.creep import foot_creep
from chilopod.twin.cycle_map import walk_cycle
from chilopod.twin.legs import twin_of

ENDS = ("end", "end_low", "end_high")
"""Names of the end of the straight walk and of the ends of its interval, N*mm/deg."""

SEARCHED = (5.0, 80.0)
"""Springs k1 between which the straight walk is followed, N*mm/deg."""

ORDERS = 0.9
"""Part of the orders of removal in the interval of a factor's part."""

SETS = 4
"""Number of other sets of constants with which the parts are estimated."""

PLANAR = {
    "twin.sliding_friction": 1000.0,
    "twin.servo_stiffness": 300.0,
    "twin.servo_damping": 0.75,
    "twin.joint_inertia": 5e-4,
    "twin.clearance": 0.03,
    "twin.contact_time": 0.002,
    "twin.foot_radius": 5e-4,
    "twin.link_mass": 0.01,
    "twin.timestep": 1e-3,
}
"""Constants of the planar limit instead of the twin's, SI."""

FINER = {
    **PLANAR,
    "twin.servo_stiffness": 1000.0,
    "twin.servo_damping": 2.0,
    "twin.joint_inertia": 3e-4,
    "twin.contact_time": 0.001,
    "twin.control_interval": 0.001,
    "twin.timestep": 2e-4,
}
"""Planar limit with smaller remaining differences, at five times the work."""


@dataclass(frozen=True)
class Factor:
    """Assumption of the planar model that the twin does not make: name, what the robot does without it, and the numbers
    of the robot that go from those of the planar limit to the twin's."""

    name: str
    clause: str
    paths: tuple[str, ...]


FACTORS = (
    Factor("feet", "feet are where they are", ("legs.forward_offset", "legs.half_width")),
    Factor("grip", "standing feet stick", ()),
    Factor("dry friction", "feet slide beyond the Coulomb limit", ("twin.sliding_friction",)),
    Factor("soft legs", "servos give way", ("twin.servo_stiffness", "twin.servo_damping", "twin.joint_inertia")),
    Factor("dragging feet", "swinging feet drag", ("twin.clearance",)),
    Factor("joint damping", "yaw joints have friction", ("springs.damping",)),
    Factor(
        "legs and floor",
        "legs have mass, feet a size, and the floor is soft",
        ("twin.link_mass", "twin.foot_radius", "twin.contact_time"),
    ),
)
"""Factors, in the order of the table."""

_FIRST, _FACTOR = 20.0, 2.0  # N*mm/deg, from where the search goes by this factor until the walk's stability changes
_CYCLES, _FEWER, _FEW = 16, 12, 8  # that bends are followed
_TOLERANCE = 0.005  # of a modulus
_BENT, _SCATTER = np.deg2rad(5.0), 0.1  # yaw, rad, and error of a modulus, beyond which the straight walk is lost
_GROWS = 0.1  # excess of a walk that is lost
_SOFT_STEP = 2e-3  # s, enough for soft legs
_ONCE = 1e3  # factor with which the search ends where it begins


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


def straight_end(robot: Robot, first: float = _FIRST, factor: float = _FACTOR, cycles: float = _CYCLES) -> Interval:
    """Spring k1 at which the straight walk ends, with an interval of 95 %, N*mm/deg.

    The search goes from ``first`` by steps of a factor. The value is one end of :data:`SEARCHED` if the walk is
    unstable or stable throughout; the interval is then from there to infinity or 0.
    """
    yaw = [f"yaw{i}" for i in range(1, robot.body.modules)]
    known: list[tuple[Array, Any]] = []  # state and leading modes of the last stable walk

    def excess(spring: float) -> tuple[float, float]:
        """Largest modulus of the leading multipliers less 1, and its error."""
        cycle, standing = walk_cycle(robot.with_value(K1, stiffness(spring)))
        joints = [cycle.names.index(name) for name in yaw]
        for start, basis in (*known, (standing, None)):
            modes, settled, own = finite_modes(cycle, start, yaw, cycles=round(cycles), basis=basis)
            above, error = abs(modes[0].multiplier) - 1.0, modes[0].error
            if np.abs(settled[joints]).max() < _BENT and error < _SCATTER:
                known[:] = [(settled, own)] if above < 0.0 else known
                return above, error
        return _GROWS, 0.0

    a, at_a = first, excess(first)[0]
    while True:
        b = a * factor if at_a > 0.0 else a / factor
        if not SEARCHED[0] <= b <= SEARCHED[1]:
            return Interval(a, a, np.inf) if at_a > 0.0 else Interval(a, 0.0, a)
        at_b = excess(b)[0]
        if at_a * at_b <= 0.0:
            return crossing(excess, (a, at_a), (b, at_b), _TOLERANCE)
        a, at_a = b, at_b


def _kept_end(robot: Robot, folder: Folder, *how: float) -> Interval:
    return Interval(*kept(folder, robot, ("end", *how), lambda: [*vars(straight_end(robot, *how)).values()]))


def limit_end(robot: Robot, planar: Robot, constants: Mapping[str, float], folder: Folder, cycles: int) -> float:
    """Spring at which the straight walk ends in the planar limit, N*mm/deg, searched from 5 % below the planar model's
    pitchfork by steps of a tenth."""
    first = 0.95 * pitchfork(planar, normal_form=False).value
    return _kept_end(planar_limit(robot, planar, constants), folder, first, 1.05 / 0.95, cycles).value


def shapley(on: NDArray[np.bool_], values: Array) -> Array:
    """Shapley values, (factors, ...), of a game with values (subsets, ...) of some subsets of its factors.

    ``on`` tells which factors a subset has, (subsets, factors); the first has none, the last all. The values are those
    of the weighted least squares of Charnes et al. (1988): exact from all subsets, an estimate from some of them.
    """
    factors = on.shape[1]
    size = on.sum(axis=1)
    weight = np.array([1.0 / np.sqrt(comb(factors, s) * s * (factors - s)) if 0 < s < factors else 0.0 for s in size])
    whole = values[-1] - values[0]
    free = null_space(np.ones((1, factors)))  # contributions that sum to 0
    rest = values - values[0] - np.multiply.outer(size / factors, whole)
    law = np.linalg.pinv(weight[:, None] * on @ free) * weight
    return whole / factors + np.tensordot(free @ law, rest, 1)


def over_orders(on: NDArray[np.bool_], values: Array, factor: int) -> tuple[float, float]:
    """Ends of the middle :data:`ORDERS` of what a factor adds, over the orders in which factors may be removed."""
    rows = {tuple(row): value for row, value in zip(on.tolist(), values.tolist(), strict=True)}
    found = []
    for row, value in rows.items():
        without = (*row[:factor], False, *row[factor + 1 :])
        if row[factor] and without in rows:
            found.append((value - rows[without], 1.0 / comb(len(row) - 1, sum(without))))
    if not found:
        return float("nan"), float("nan")
    added, weight = np.array(sorted(found)).T
    below = (np.cumsum(weight) - 0.5 * weight) / weight.sum()
    low, high = np.interp([0.5 - 0.5 * ORDERS, 0.5 + 0.5 * ORDERS], below, added)
    return float(low), float(high)


def subsets(size: Size) -> NDArray[np.bool_]:
    """Subsets of the factors, (subsets, factors): all; if quick none, each alone, all but one, and all; if tiny none
    and all."""
    count = len(FACTORS)
    sizes = size.of(range(count + 1), (0, 1, count - 1, count), (0, count))
    chosen = [set(each) for many in sizes for each in itertools.combinations(range(count), many)]
    return np.array([[factor in each for factor in range(count)] for each in chosen])


def contributions(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Parts of the factors in the end of the straight walk.

    Every subset is kept beside the folder of the trials.

    Dataset over subset and factor: ``on``, True if a subset has a factor; over subset: :data:`ENDS`, the results of
    :func:`straight_end`; over factor: ``share``, by which the end is multiplied, ``share_low`` and ``share_high``, see
    :func:`over_orders`, ``share_error``, half an interval of 95 % by the errors of the ends, relative, ``alone`` and
    ``without``, the ends with this one alone and with all others (N*mm/deg). Attributes: ``vouched`` and ``exact``, the
    ends of the planar limit by :func:`limit_end` and of the planar model; ``grip`` and ``viscous``, the creep
    coefficients of the twin and of the planar model (N*s/m).
    """
    robot, planar, folder, size = context.whole, context.robot, context.folder, context.size
    data = _shares_of(robot, context, subsets(size), progress)
    progress(1.0, "finer planar limit")
    data.attrs = {
        "robot": robot.name,
        "vouched": limit_end(robot, planar, size.of(FINER, PLANAR, PLANAR), folder, _cycles(size)),
        "exact": pitchfork(planar, normal_form=False).value,
        "grip": foot_creep(robot).across,
        "viscous": planar.ground.friction,
    }
    return data


def over_sets(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Parts of the factors by the preset and by sets of constants drawn from the valley that the data leave, over set:
    those of :func:`contributions`, estimated from the subsets in which one factor comes first or last."""
    robot, on = context.whole, subsets(Size.QUICK if context.size is not Size.TINY else Size.TINY)
    drawn = samples_of(known()).drawn(context.size.of(SETS, SETS, 1))
    sets = [robot, *(FITTED.robot_with(robot, FITTED.values_at(parts)) for parts in drawn)]
    found = [
        _shares_of(each, context, on, part(progress, index / len(sets), (index + 1) / len(sets)))
        for index, each in enumerate(sets)
    ]
    same = found[0][["on", "about"]]
    return xr.concat([each.drop_vars(["on", "about"]) for each in found], "set").assign(same)


def _shares_of(robot: Robot, context: Context, on: NDArray[np.bool_], progress: Progress) -> xr.Dataset:
    size = context.size
    how = _FIRST, size.cut(_FACTOR, _ONCE), _cycles(size)
    names, ends = np.array([factor.name for factor in FACTORS]), []
    for index, row in enumerate(on):
        progress(index / len(on), ", ".join(names[row]) or "planar limit")
        ends.append(_kept_end(with_factors(robot, context.robot, names[row].tolist()), context.folder, *how))
    data = shares(on, np.array([[end.value, end.low, end.high] for end in ends]))
    return data.assign_coords(factor=names).assign(about=("factor", [factor.clause for factor in FACTORS]))


def _cycles(size: Size) -> int:
    return size.of(_CYCLES, _FEWER, _FEW)


def shares(on: NDArray[np.bool_], ends: Array) -> xr.Dataset:
    """Part of the results of :func:`contributions` that follows from the ends, with their intervals, (subsets, 3)."""
    inside, logs = np.isfinite(ends[:, 2]) & (ends[:, 1] > 0.0), np.log(ends[:, 0])
    half = np.where(inside, ends[:, 2] - ends[:, 0], 0.0) / ends[:, 0]
    error = np.sqrt(shapley(on, np.eye(len(on))) ** 2 @ half**2)
    span = np.array([over_orders(on, logs, factor) for factor in range(on.shape[1])]).T
    columns = {name: ("subset", column, {"units": PAPER_UNIT}) for name, column in zip(ENDS, ends.T, strict=True)}
    size, found = on.sum(axis=1), np.exp([shapley(on, logs), *span])
    for name, many in (("alone", 1), ("without", on.shape[1] - 1)):
        rows = {int((on[i] if many == 1 else ~on[i]).argmax()): ends[i, 0] for i in np.flatnonzero(size == many)}
        values = [rows.get(factor, np.nan) for factor in range(on.shape[1])]
        columns[name] = ("factor", np.array(values), {"units": PAPER_UNIT})
    for name, values in zip(("share", "share_low", "share_high"), found, strict=True):
        columns[name] = ("factor", values, {"units": "1"})
    return xr.Dataset({"on": (("subset", "factor"), on), **columns, "share_error": ("factor", error)})


def cause(data: xr.Dataset) -> str:
    """Sentence on the factors that raise the end of the straight walk, the largest first: those whose part is above 1
    in at least :data:`ORDERS` of the orders."""
    said = {factor.name: factor.clause for factor in FACTORS}
    largest = data.sortby("share", ascending=False)
    clauses = [said[str(name)] for name in largest.factor[(largest.share_low > 1.0).values].values]
    reason = f"because {listing(clauses)}" if clauses else "for no reason that holds in every order"
    robot, planar = printed.ONSET.value, printed.CRITICAL_K1.value
    return f"The robot bends at {robot:g} {SPRING_UNIT} and the planar model at {planar:g} {reason}"


def rows(data: xr.Dataset) -> list[OfTwin | OfPlanar]:
    """Line of the robot's table on the agreement of the engines in the planar limit."""
    point, exact = data.attrs["vouched"], data.attrs["exact"]
    words = f"{point:.2f} {PAPER_UNIT} ({100.0 * (point / exact - 1.0):+.1f} %, without an error)"
    return [
        of_twin(PLANAR_LIMIT, Result(words, point / exact, 0.0)),
        OfPlanar(PLANAR_LIMIT, Result(value=exact, unit=PAPER_UNIT, digits=4)),
    ]
