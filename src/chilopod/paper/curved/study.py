"""Curved walks as the paper's experiments: straight at the start, a small disturbance, and a long walk; the paper's
estimate of the pitchfork beside the point, and its variants (Fig. "curved", "absolute" and "different").

The paper walks its robot at k1 = 15, 17, 21, 28, 41 and 75 N*mm/deg, from 0.44 to 2.2 times the 34 at which it sees
the curved walk set in. In the planar model that happens at 12.0, and a joint passes a right angle below about 0.55
times that, so the springs here are spread about 12, denser where the bend grows steeply.

A small bend grows at the rate of the straight walk's leading exponent, 0.06/s at 10 N*mm/deg and a quarter of that at
11.5. Every trial walks for a number of e-folds of this rate; ``settled`` tells whether it had settled by then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator

from chilopod import stability
from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.square_root import SquareRootFit, square_root_fit
from chilopod.analysis.straight_walk import pitchfork
from chilopod.engine import Status
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.measures import SEEDS, Folder, by_spring, example_walks, spring_walks
from chilopod.paper.section import Context
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.stability.returns import whole_period
from chilopod.statistics import means, spread_difference
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

AGREEMENT_SPRINGS = (8.0, 10.0, 11.0)
"""Springs of the trials without spread of friction that are compared with the branch, N*mm/deg."""

TINY_SPRINGS = (7.0, 8.5, 10.0, 41.0)
"""Springs of a tiny report, N*mm/deg, over the full range."""

_NARROWEST, _WIDEST = 1e-4, 0.4  # of the critical spring, ranges that the law is fitted over along the branch


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
    exact, about = pitchfork(robot, normal_form=False).value, "walks from straight on, averaged at their end"
    data.attrs = {"robot": robot.name, "varied": K1, "critical_k1": exact, "averaged_s": AVERAGED, "about": about}
    return data


def off_branch(robot: Robot, trials: xr.Dataset, branch: xr.Dataset) -> xr.DataArray:
    """Distance of the final walks from the branch's periodic orbit with the same spring.

    The orbit is solved anew at every spring, from the points beside it of a branch that turns right; a left turn is
    compared with the mirror image of the right one half a period later. The trials, from :func:`curved_trials`,
    have no spread of friction, as the branch has none.

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
    columns = {
        "mean_angle": ("joint", last, {"units": "rad"}),
        "change": ((), change, {"units": "rad"}),
        "settled": ((), settled),
        "axis_radius": ((), float(robot.axis_radius(last)), {"units": "m"}),
        "direction": ((), np.array(side if settled else "", dtype=object)),
        "status": ((), np.array(walk.status.item(), dtype=object)),
        "end_state": ("state", _reduced(walk.isel(time=-1))),
    }
    return xr.Dataset(columns, {"joint": walk.joint.values})


def _reduced(moment: xr.Dataset) -> Array:
    """The reduced state (see :mod:`chilopod.planar.dynamics`) at a moment of a record."""
    c, s = np.cos(float(moment.heading)), np.sin(float(moment.heading))
    vx, vy = moment.velocity.values
    ahead = [c * vx + s * vy, c * vy - s * vx, float(moment.heading_rate)]
    return np.concatenate([ahead, moment.joint_angle.values, moment.joint_rate.values])


@dataclass(frozen=True)
class CurvedStudy:
    """Results of the trials of curved walks."""

    trials: xr.Dataset  # see :func:`curved_trials`
    examples: xr.Dataset  # see :func:`chilopod.paper.measures.example_walks`
    branch: xr.Dataset  # exact walks, turning right, see :func:`chilopod.analysis.branch.curved_walks`
    fits: xr.Dataset  # see :func:`onset_fits`
    law: xr.Dataset  # see :func:`law_along_branch`
    agreement: xr.DataArray  # rad, off the branch, of trials without spread of friction
    variants: Mapping[str, xr.Dataset]  # trials by variant, "as built" first
    branches: Mapping[str, xr.Dataset]  # likewise
    comparison: xr.Dataset  # see :func:`compared`

    @property
    def fit(self) -> SquareRootFit:
        """The square-root law over all springs, as the paper fits it."""
        return fitted(self.trials)


def curved_study(context: Context, progress: Progress = silent) -> CurvedStudy:
    """Run the trials of the paper's curved walks and compare them with the exact branches.

    The springs of the trials are spread about the critical one of the paper's robot. If not full, there are two trials
    at every spring of the variants in place of the paper's 5; if tiny, three of the robot in place of 10, at fewer
    springs.
    """
    robot, folder, size = context.robot, context.folder, context.size
    repeats, variant_repeats = size.of((10, 5), (10, 2), (3, 2))
    springs, agreement_springs = size.cut((SPRINGS, AGREEMENT_SPRINGS), (TINY_SPRINGS, AGREEMENT_SPRINGS[:1]))
    trials = curved_trials(robot, springs, repeats, folder=folder, progress=part(progress, 0.0, 0.3))
    variants = variant_trials(robot, trials, variant_repeats, folder=folder, progress=part(progress, 0.3, 0.8))
    progress(0.8, "branches")
    branches = {name: _branch(variant, variants[name]) for name, variant in printed.variant_robots(robot).items()}
    progress(0.9, "trials beside the branch")
    even = Disturbance(friction=0.0)
    settled = curved_trials(robot, agreement_springs, 3, disturbance=even, e_folds=25.0, folder=folder)
    branch = branches[printed.AS_BUILT]
    study = CurvedStudy(
        trials=trials,
        examples=example_walks(robot, EXAMPLES, 120.0, (0, 0), folder=folder),
        branch=branch,
        fits=onset_fits(trials, branch),
        law=law_along_branch(branch),
        agreement=off_branch(robot, settled, branch),
        variants=variants,
        branches=branches,
        comparison=compared(variants, branches),
    )
    progress(1.0, "done")
    return study


def bend_order(trials: xr.Dataset) -> tuple[int, ...]:
    """Joints in order of their bend in trials that curve, largest first."""
    angles = np.abs(trials.mean_angle.values[is_curved(trials)]).mean(axis=0)
    return tuple(int(joint) + 1 for joint in np.argsort(-angles))


def fluctuation(trials: xr.Dataset) -> tuple[str, float, float]:
    """Scatter of joint 1 among trials at the softest spring beside that at the stiffest spring that curves, in words,
    and these springs, N*mm/deg."""
    curved = trials.isel(spring=is_curved(trials).any(axis=1))
    angles = np.where(is_curved(curved), np.abs(curved.mean_angle.sel(joint=1).values), np.nan)
    wider = spread_difference(angles[0], angles[-1]).above().words()
    return wider, float(curved.spring[0]), float(curved.spring[-1])


def fitted(trials: xr.Dataset) -> SquareRootFit:
    """The square-root law through the trials that settled on a curved walk."""
    here = is_curved(trials)
    inverse = np.broadcast_to(1.0 / trials.spring.values[:, None], here.shape)
    return square_root_fit(inverse[here], trials.mean_angle.sel(joint=1).values[here])


def onset_fits(trials: xr.Dataset, branch: xr.Dataset) -> xr.Dataset:
    """The square-root fit over nested ranges of springs, from the pair nearest the point to all of them.

    Dataset over softest (the softest spring fitted, N*mm/deg): ``critical_k1``, its ``error`` by the least squares and
    ``trial_error`` by the scatter of trials (see :class:`chilopod.analysis.SquareRootFit`), ``exact_walks``, the fit
    with every trial replaced by the exact walk of its spring (its error does not shrink with repeats), and ``trials``.
    """
    curved = trials.isel(spring=is_curved(trials).any(axis=1))
    softest, rows = curved.spring.values[:-1][::-1], []
    for low in softest:
        part = curved.isel(spring=curved.spring.values >= low)
        here = is_curved(part)
        springs = np.broadcast_to(part.spring.values[:, None], here.shape)[here]
        exact = on_branch(branch, "mean_angle", springs)[:, 0]
        found, without = fitted(part), square_root_fit(1.0 / springs, exact)
        rows.append((found.critical, found.error, found.estimate.error, without.critical, found.trials))
    *springs_, counts = np.array(rows, dtype=np.float64).T
    names = ("critical_k1", "error", "trial_error", "exact_walks")
    columns = {name: ("softest", each, {"units": PAPER_UNIT}) for name, each in zip(names, springs_, strict=True)}
    columns["trials"] = ("softest", counts.astype(int), {})
    attrs = {"robot": trials.attrs["robot"], "exact_k1": trials.attrs["critical_k1"]}
    return xr.Dataset(columns, {"softest": ("softest", softest, {"units": PAPER_UNIT})}, attrs)


def law_along_branch(branch: xr.Dataset) -> xr.Dataset:
    """Error of the square-root law itself: fits to exact walks, evenly spread in 1/k, from the pitchfork to a softest
    spring.

    Dataset over softest (N*mm/deg): ``critical_k1`` as fitted, ``angle`` of joint 1 there (rad), and ``power``, the
    slope of its logarithm over that of 1/k - 1/kc: one half where the law holds.
    """
    exact = float(branch.parameter.values[0])
    softest = exact * (1.0 - np.geomspace(_NARROWEST, _WIDEST, 25))
    found = []
    for low in softest:
        inverse = np.linspace(1.0 / exact, 1.0 / low, 21)[1:]
        angles = on_branch(branch, "mean_angle", 1.0 / inverse)[:, 0]
        found.append((square_root_fit(inverse, angles).critical, angles[-1]))
    critical, angle = np.array(found).T
    columns = {
        "critical_k1": ("softest", critical, {"units": PAPER_UNIT}),
        "angle": ("softest", angle, {"units": "rad"}),
        "power": ("softest", np.gradient(np.log(angle), np.log(1.0 / softest - 1.0 / exact)), {"units": "1"}),
    }
    attrs = {"robot": branch.attrs["robot"], "exact_k1": exact}
    return xr.Dataset(columns, {"softest": ("softest", softest, {"units": PAPER_UNIT})}, attrs)


def compared(variants: Mapping[str, xr.Dataset], branches: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Changes by each of the paper's variants (Fig. "different").

    Dataset over variant and ratio (of k1 to the variant's own critical one): ``fitted_k1`` with its ``error`` (by
    the scatter of trials), ``exact_k1``, ``robot_k1`` as printed, ``stiffest_k1`` of the curved walks (above
    ``exact_k1`` where the branch folds back), all in N*mm/deg; ``criticality``; ``radius`` with ``radius_error``, mean
    and standard error over the trials that settled on a curved walk (m; NaN where there are fewer than two);
    ``equal_ratio``, the radius over that as built at the same ratio, mean over all ratios; ``equal_spring``, over that
    at the same k1, along the branches, at ``spring``.
    """
    base, all_branches = branches[printed.AS_BUILT], branches.values()
    exact = np.array([trials.attrs["critical_k1"] for trials in variants.values()])
    fits = [fitted(trials) for trials in variants.values()]
    statistics = [means(each.axis_radius.values, is_curved(each)) for each in variants.values()]
    radius, error = (np.array(each) for each in zip(*statistics, strict=True))
    several = [is_curved(each).sum(axis=1) > 1 for each in variants.values()]
    radius = np.where(several, radius, np.nan)
    ratio = (radius / radius[0])[:, np.isfinite(radius).all(axis=0)]
    # Every variant walks a curve there: softer than all critical springs, stiffer than where a branch ends.
    spring = float(0.9 * exact.min())
    there = np.array([axis_radius(branch, spring) for branch in all_branches])
    springs = {
        "fitted_k1": [fit.critical for fit in fits],
        "error": [fit.estimate.error for fit in fits],
        "exact_k1": exact,
        "robot_k1": [printed.onset(name).value for name in variants],
        "stiffest_k1": [float(branch.parameter.max()) for branch in all_branches],
    }
    kinds = np.array([branch.attrs["criticality"] for branch in all_branches], dtype=object)
    columns = {
        **{name: ("variant", np.array(values), {"units": PAPER_UNIT}) for name, values in springs.items()},
        "criticality": ("variant", kinds),
        "radius": (("variant", "ratio"), radius, {"units": "m"}),
        "radius_error": (("variant", "ratio"), error, {"units": "m"}),
        "equal_ratio": ("variant", ratio.mean(axis=1), {"units": "1"}),
        "equal_spring": ("variant", there / axis_radius(base, spring), {"units": "1"}),
    }
    ratios = variants[printed.AS_BUILT].spring.values / exact[0]
    coords = {"variant": np.array(list(variants), dtype=object), "ratio": ratios}
    return xr.Dataset(columns, coords, {"robot": base.attrs["robot"], "spring": spring})


def axis_radius(branch: xr.Dataset, spring: float | Array) -> Array:
    """The paper's radius (N-1) L / sum |theta| of the exact walk at a spring, or many (N*mm/deg), m."""
    # Along a branch only the bend changes, so that any of its points gives (N-1) L.
    length = float(branch.axis_radius[-1]) * float(np.abs(branch.mean_angle[-1]).sum())
    with np.errstate(divide="ignore"):
        radius: Array = length / np.abs(on_branch(branch, "mean_angle", spring)).sum(axis=-1)
    return radius


def _branch(robot: Robot, trials: xr.Dataset) -> xr.Dataset:
    """The exact curved walks over the springs of the trials; a fold lies a few per cent above the pitchfork at most."""
    lowest, highest = 0.97 * float(trials.spring.min()), 1.1 * trials.attrs["critical_k1"]
    return curved_walks(robot, K1, (stiffness(lowest), stiffness(float(highest))))
