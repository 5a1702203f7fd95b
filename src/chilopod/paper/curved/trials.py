"""Curved walks as the paper's experiments: straight at the start, a small disturbance, and a long walk.

The paper walks its robot at k1 = 15, 17, 21, 28, 41 and 75 N*mm/deg, from 0.44 to 2.2 times the 34 at which it sees
the curved walk set in. In the planar model that happens at 12.0, and a joint passes a right angle below about 0.55
times that, so the springs here are spread about 12, denser where the bend grows steeply.

A small bend grows at the rate of the straight walk's leading exponent, 0.06/s at 10 N*mm/deg and a quarter of that at
11.5. Every trial walks for a number of e-folds of this rate; ``settled`` tells whether it had settled by then.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator

from chilopod import stability
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.straight_walk import pitchfork
from chilopod.engine import Status
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.measures import SEEDS, Folder, by_spring, spring_walks
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.stability.returns import whole_period
from chilopod.tasks.radius_law import is_curved
from chilopod.trials import AVERAGED, Disturbance, mean_joint_angles

SPRINGS = (7.0, 8.0, 9.0, 10.0, 11.0, 11.5, 13.0, 15.0, 41.0)
"""k1 of the trials, N*mm/deg."""

EXAMPLES = (41.0, 8.0)
"""k1 of the two walks that are shown over time, N*mm/deg: straight, and about as far below the point as the paper's."""

BEFORE = 30.0
"""Duration of the mean before that one, s; their difference decides whether a walk had settled."""

SETTLED = 0.01
"""Largest change between those two means, relative to the largest joint angle."""

STRAIGHT = float(np.deg2rad(0.1))
"""Largest mean angle of any joint of a straight walk."""

_E_FOLDS = 15.0  # growth from half a degree takes some 6, and a bend settles twice as fast as it grew
_SHORTEST, _LONGEST = 180.0, 1200.0  # s
_ROUNDING = 1e-6  # rad; a walk straighter than this is as straight as it gets
_SAMPLES = 6  # per period: means are then good to 0.02 deg


def curved_trials(
    robot: Robot,
    springs: Sequence[float] = SPRINGS,
    repeats: int = 10,
    *,
    disturbance: Disturbance | None = None,
    e_folds: float = _E_FOLDS,
    folder: Folder = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Walks that start straight, several at every spring (N*mm/deg, rising), and their bends at the end.

    A trial walks for a number of e-folds of the slowest motion about the straight walk, but 180 s at least and 1200 s
    at most. All have seeds of their own, and by default the disturbance of all studies.

    Returns
    -------
    Dataset over spring (N*mm/deg), repeat, joint and state: ``mean_angle`` over the last 5 s (rad; NaN where the walk
    ended before), ``change`` (rad; largest of any joint against the mean over the 30 s before), ``settled``,
    ``axis_radius`` (m, the paper's (N-1) L / sum |theta|), ``direction`` (left, right, straight; empty where it had not
    settled), ``status``, ``duration`` (s) and ``end_state``, the reduced state at the end, a whole number of periods
    after the start.
    """
    durations = [_walking_time(robot.with_value(K1, stiffness(float(value))), e_folds) for value in springs]
    walk: dict[str, Any] = {"disturbance": disturbance or Disturbance(), "rate": _SAMPLES / robot.gait.period}
    walk |= {"seeds": range(0, SEEDS * len(springs), SEEDS), "folder": folder, "progress": progress}
    records = spring_walks(robot, springs, durations, repeats=repeats, **walk)
    data = by_spring([_outcome(record, robot) for record in records], springs)
    data["duration"] = ("spring", np.array(durations), {"units": "s"})
    data.attrs = {
        "robot": robot.name,
        "varied": K1,
        "critical_k1": pitchfork(robot, normal_form=False).value,
        "averaged_s": AVERAGED,
        "about": "walks from straight on, averaged at their end",
    }
    return data


def off_branch(robot: Robot, trials: xr.Dataset, branch: xr.Dataset) -> xr.DataArray:
    """Distance of the final walks from the branch's periodic orbit with the same spring.

    The orbit is solved anew at every spring, from the points beside it of a branch that turns right; a left turn is
    compared with the mirror image of the right one half a period later. The trials, from :func:`curved_trials`,
    have no spread of friction, as the branch has none.

    Returns
    -------
    Largest difference of any joint angle, rad, over (spring, repeat); NaN where the walk is straight or not settled.
    """
    joints = slice(3, robot.body.modules + 2)
    off = np.full((trials.sizes["spring"], trials.sizes["repeat"]), np.nan)
    for row, spring in zip(off, trials.spring.values, strict=True):
        at = trials.sel(spring=spring)
        if not is_curved(at).any():
            continue
        model = PlanarModel(robot.with_value(K1, stiffness(float(spring))))
        guess = on_branch(branch, "orbit", float(spring))
        orbit = stability.find_orbit(whole_period(model), guess, with_error=False).state
        mirrored = model.reflection @ model.flow_states(orbit[None], 0.0, 0.5 * model.period)[0]
        for side, expected in (("right", orbit), ("left", mirrored)):
            here = at.direction.values == side
            row[here] = np.abs(at.end_state.values[here] - expected)[:, joints].max(axis=1)
    return xr.DataArray(off, {"spring": trials.spring, "repeat": trials.repeat}, attrs={"units": "rad"})


def on_branch(branch: xr.Dataset, name: str, spring: float | Array) -> Array:
    """A quantity of the branch at a spring, or many (N*mm/deg), between its points, beyond the stiffest of them.

    The stiffest point is the pitchfork, or the fold at which a subcritical branch turns back. Near it angles change
    with the root of the distance from it; softer walks are stable up to the next bifurcation.
    """
    beyond = branch.isel(point=slice(int(branch.parameter.values.argmax()), None))
    stiffest = float(beyond.parameter.values[0])
    distance = np.sqrt(stiffest - beyond.parameter.values)
    wanted = np.sqrt(np.maximum(stiffest - np.asarray(spring), 0.0))
    values: Array = PchipInterpolator(distance, beyond[name].values)(wanted)
    return values


def variant_trials(
    robot: Robot, base: xr.Dataset, repeats: int = 5, *, folder: Folder = None, progress: Progress = silent
) -> dict[str, xr.Dataset]:
    """Trials of the paper's variants, by name, at the same springs relative to each one's own pitchfork.

    ``base`` are trials of the robot as built, from :func:`curved_trials`. The first ``repeats`` of them are used, at
    springs up to 1.2 times the critical one.
    """
    ratios = base.spring.values / base.attrs["critical_k1"]
    ratios = ratios[ratios < 1.2]
    robots = {name: each for name, each in printed.variant_robots(robot).items() if name != printed.AS_BUILT}
    found = {printed.AS_BUILT: base.isel(spring=slice(len(ratios)), repeat=slice(repeats))}
    for index, (name, variant) in enumerate(robots.items()):
        shown = part(progress, index / len(robots), (index + 1) / len(robots), name)
        springs = ratios * pitchfork(variant, normal_form=False).value
        found[name] = curved_trials(variant, springs.tolist(), repeats, folder=folder, progress=shown)
    return found


def _walking_time(robot: Robot, e_folds: float) -> float:
    """Seconds, a whole number of periods."""
    sizes = np.abs(stability.multipliers(PlanarModel(robot)).values)
    slowest = np.abs(np.log(sizes[sizes > 0.1])).min(initial=np.log(10.0)) / robot.gait.period
    seconds = np.clip(e_folds / slowest, _SHORTEST, _LONGEST)
    return float(np.ceil(seconds / robot.gait.period)) * robot.gait.period


def _outcome(record: xr.Dataset, robot: Robot) -> xr.Dataset:
    """Numbers of one trial's record."""
    walk = record.isel(robot=0)
    last = mean_joint_angles(walk).values
    before = mean_joint_angles(walk, BEFORE, before=AVERAGED).values
    change, bend = float(np.abs(last - before).max()), float(np.abs(last).max())
    # A straight walk settles for ever; one that only just starts to bend is as straight, but no longer gets straighter.
    straight = bend < STRAIGHT and bend <= max(np.abs(before).max(), _ROUNDING)
    settled = walk.status.item() == Status.WALKED.label and (straight or change <= SETTLED * bend)
    side = "straight" if straight else "right" if last.sum() > 0.0 else "left"
    return xr.Dataset(
        {
            "mean_angle": ("joint", last, {"units": "rad"}),
            "change": ((), change, {"units": "rad"}),
            "settled": ((), settled),
            "axis_radius": ((), float(robot.axis_radius(last)), {"units": "m"}),
            "direction": ((), np.array(side if settled else "", dtype=object)),
            "status": ((), np.array(walk.status.item(), dtype=object)),
            "end_state": ("state", _reduced(walk.isel(time=-1))),
        },
        coords={"joint": walk.joint.values},
    )


def _reduced(moment: xr.Dataset) -> Array:
    """The reduced state (see :mod:`chilopod.planar.dynamics`) at a moment of a record."""
    c, s = np.cos(float(moment.heading)), np.sin(float(moment.heading))
    vx, vy = moment.velocity.values
    ahead = [c * vx + s * vy, c * vy - s * vx, float(moment.heading_rate)]
    return np.concatenate([ahead, moment.joint_angle.values, moment.joint_rate.values])
