"""Radius of a robot's curved walks over its first spring: from the exact branch if there is one, else from walks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import units
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.radius_law import radius_laws
from chilopod.analysis.square_root import square_root_fit
from chilopod.engine import Status, engine_named
from chilopod.errors import AnalysisError
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import RadiusLaw
from chilopod.trials import AVERAGED, NONE, Trial, mean_joint_angles, run, summaries

PERIOD = 0.6
"""Gait cycle of the paper's robot, s; whatever takes some time in it takes as many cycles in other robots."""

DURATION = 90.0
"""Duration of its trials, s: beside the onset a bend takes a minute to grow."""

CYCLES = 150.0
"""The same in gait cycles, of every robot."""

CURVED = 0.25
"""Least bend of all joints together of a curved walk, rad: a radius of 4.5 m or less."""

SETTLED = 0.05
"""Largest relative change of the bend of a settled curve in the 10 s before its end."""

SAMPLES = 6
"""Samples in a gait cycle: 10 in a second of the paper's robot."""

HELD = 16
"""Number of walks that must stay in range at a spring; then of 20 walks usually all do."""

_LAW_SPRINGS = (0.2, 0.3, 0.37, 0.44, 0.51, 0.59, 0.68, 0.78, 0.9)  # of the stiffest spring
_LAW_BEND = 0.8  # rad in all, to start with


def radius_law(
    robot: Robot, engine: str = "planar", folder: str | Path | None = None, progress: Progress = silent
) -> RadiusLaw:
    """Radius of the curved walks over k1, by the paper's measure.

    An engine whose walks are those of the planar theory has the law of the exact branch, from the softest spring on
    that a robot with a straight start withstands (:func:`that_holds`). The law of any other engine is measured in
    undisturbed walks that start bent; springs at which these fail are left out. The robot's own first spring does not
    matter; folder and progress are those of :class:`chilopod.tasks.RunOptions`.

    AnalysisError if there is no such branch, fewer than three springs curve, or softer ones do not curve more tightly.
    """
    if engine_named(engine).traits.exact:
        return that_holds(radius_laws(robot, progress).axis, robot, engine)
    stiffest = units.from_si(max(robot.springs.stiffness), PAPER_UNIT)
    springs = [float(round(part * stiffest, 2)) for part in _LAW_SPRINGS]
    trials = [bent(robot.with_value(K1, stiffness(spring)), engine) for spring in springs]
    ends = xr.concat([end_of_walk(each, robot) for each in run(trials, folder, progress)], "spring")
    curved = is_curved(ends)
    if curved.sum() < 3:
        raise AnalysisError("must give at least three curved walks for a radius law", field="springs")
    inverse = 1.0 / np.array(springs)
    fit = square_root_fit(inverse[curved], ends.bend.values[curved])
    stiff_first = np.flatnonzero(curved)[::-1]
    values = [fit.critical, *(springs[i] for i in stiff_first)]
    radii = [np.inf, *(float(ends.axis_radius[i]) for i in stiff_first)]
    return RadiusLaw.of_branch([stiffness(each) for each in values], radii, [True] * len(values), PAPER_UNIT)


def bent(robot: Robot, engine: str = "planar", cycles: float = CYCLES) -> Trial:
    """An undisturbed walk of a robot that starts bent, recorded at the same phases of each gait cycle."""
    angles, period = (_LAW_BEND / (robot.body.modules - 1),), robot.gait.period
    return Trial(robot, cycles * period, 0, angles, None, None, NONE, SAMPLES / period, engine=engine)


def that_holds(law: RadiusLaw, robot: Robot, engine: str = "planar") -> RadiusLaw:
    """Part of a radius law whose circles a robot reaches from a straight start. A robot bends farther on its way into a
    circle than on the circle, and feet differ, so that a joint may leave its range although it does not in the settled
    walk. The softest spring of the result is the first at which no joint does in :data:`HELD` walks with the
    disturbance of all studies. Raises AnalysisError if no spring remains."""
    for first, value in enumerate(law.values[:-2].tolist()):
        walker = robot.with_value(K1, value)
        ends = run([Trial(walker, CYCLES * robot.gait.period, seed, rate=1.0, engine=engine) for seed in range(HELD)])
        if all(end.status.values[0] == Status.WALKED.label for end in ends):
            return RadiusLaw(law.values[first:], law.radii[first:], law.unit)
    raise AnalysisError("a joint leaves its range at every spring that bends the robot", field="springs")


def end_of_walk(record: xr.Dataset, robot: Robot, earlier: float = 10.0) -> xr.Dataset:
    """Measures at the end of one trial's record. Times are those of the paper's robot; others take as many gait cycles.

    Dataset over joint: ``mean_angle``, ``axis_radius`` (m) and ``status`` of :class:`chilopod.trials.WalkSummary`;
    ``bend``, the sum of the sizes of the mean angles (rad); ``direction`` (left, right, straight; empty where the walk
    failed, or has no mean angles); ``moved``, the difference of the bend from that of the ``earlier`` s before (rad),
    ``settled``, whether that is less than :data:`SETTLED` of the bend; and ``speed``, that of module 1 over the last
    12 s (m/s).
    """
    second = robot.gait.period / PERIOD
    (end,) = summaries(robot, record, AVERAGED * second)
    walk = record.isel(robot=0)
    times, last = walk.time.values, end.joint_angles
    bend = float(np.abs(last).sum())
    moved = abs(bend - float(np.abs(mean_joint_angles(walk, earlier * second, AVERAGED * second)).sum()))
    side = "straight" if bend < CURVED else "right" if last.sum() > 0.0 else "left"
    place = walk.position.transpose("time", "axis").values
    back = int(np.searchsorted(times, times[-1] - 12.0 * second))
    # Path length by arcs, gait cycle by gait cycle, from phase 0: on a curve chords are shorter, and module 1 sways.
    stride = max(1, round(robot.gait.period / (times[1] - times[0])))
    chords = np.diff(place[back - back % stride :: stride] @ np.array([1.0, 1.0j]))
    turn = float(np.angle(chords[1:] * chords[:-1].conj()).mean()) if len(chords) > 1 else 0.0
    steps = np.abs(chords) / (np.sinc(0.5 * turn / np.pi) * stride * (times[1] - times[0]))
    return xr.Dataset(
        {
            "mean_angle": ("joint", last, {"units": "rad"}),
            "bend": ((), bend, {"units": "rad"}),
            "axis_radius": ((), end.axis_radius, {"units": "m"}),
            "direction": ((), np.array("" if end.failed or np.isnan(bend) else side, dtype=object)),
            "moved": ((), moved, {"units": "rad"}),
            "settled": ((), moved <= SETTLED * bend),
            "speed": ((), float(steps.mean()), {"units": "m/s"}),
            "status": ((), np.array(end.status, dtype=object)),
        },
        coords={"joint": walk.joint.values},
    )


def is_curved(data: xr.Dataset) -> NDArray[np.bool_]:
    """Mask of the walks that curve, by :func:`end_of_walk`; of the shape of ``data.direction``."""
    return np.isin(data.direction.values, ("left", "right"))


def in_settled_curve(data: xr.Dataset) -> NDArray[np.bool_]:
    """Mask of the walks that curve and have settled: their radius and angles no longer depend on the duration."""
    return is_curved(data) & data.settled.values
