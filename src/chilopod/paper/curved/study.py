"""Trials of curved walks: the paper's estimate of the pitchfork beside the point, and its variants.

Fig. "curved", "absolute" and "different" of the paper, with the branch that the trials settle on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.square_root import SquareRootFit, square_root_fit
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.curved.trials import EXAMPLES, SPRINGS, curved_trials, off_branch, on_branch, variant_trials
from chilopod.paper.measures import example_walks
from chilopod.paper.section import Context
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.statistics import means, spread_difference
from chilopod.tasks.radius_law import is_curved
from chilopod.trials import Disturbance

AGREEMENT_SPRINGS = (8.0, 10.0, 11.0)
"""Springs of the trials without spread of friction that are compared with the branch, N*mm/deg."""

TINY_SPRINGS = (7.0, 8.5, 10.0, 41.0)
"""Springs of a tiny report, N*mm/deg, over the full range."""

_NARROWEST, _WIDEST = 1e-4, 0.4  # of the critical spring, ranges that the law is fitted over along the branch


@dataclass(frozen=True)
class CurvedStudy:
    """Results of the trials of curved walks."""

    trials: xr.Dataset  # see :func:`chilopod.paper.curved.trials.curved_trials`
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


def fitted(trials: xr.Dataset, joint: int = 1) -> SquareRootFit:
    """The square-root law through the trials that settled on a curved walk."""
    here = is_curved(trials)
    inverse = np.broadcast_to(1.0 / trials.spring.values[:, None], here.shape)
    return square_root_fit(inverse[here], trials.mean_angle.sel(joint=joint).values[here])


def onset_fits(trials: xr.Dataset, branch: xr.Dataset) -> xr.Dataset:
    """The square-root fit over nested ranges of springs, from the pair nearest the point to all of them.

    Returns
    -------
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
    return xr.Dataset(
        {**columns, "trials": ("softest", counts.astype(int))},
        coords={"softest": ("softest", softest, {"units": PAPER_UNIT})},
        attrs={"robot": trials.attrs["robot"], "exact_k1": trials.attrs["critical_k1"]},
    )


def law_along_branch(branch: xr.Dataset, count: int = 25) -> xr.Dataset:
    """Error of the square-root law itself: fits to exact walks, evenly spread in 1/k, from the pitchfork to a softest
    spring.

    Returns
    -------
    Dataset over softest (N*mm/deg): ``critical_k1`` as fitted, ``angle`` of joint 1 there (rad), and ``power``, the
    slope of its logarithm over that of 1/k - 1/kc: one half where the law holds.
    """
    exact = float(branch.parameter.values[0])
    softest = exact * (1.0 - np.geomspace(_NARROWEST, _WIDEST, count))
    found = []
    for low in softest:
        inverse = np.linspace(1.0 / exact, 1.0 / low, 21)[1:]
        angles = on_branch(branch, "mean_angle", 1.0 / inverse)[:, 0]
        found.append((square_root_fit(inverse, angles).critical, angles[-1]))
    critical, angle = np.array(found).T
    return xr.Dataset(
        {
            "critical_k1": ("softest", critical, {"units": PAPER_UNIT}),
            "angle": ("softest", angle, {"units": "rad"}),
            "power": ("softest", np.gradient(np.log(angle), np.log(1.0 / softest - 1.0 / exact)), {"units": "1"}),
        },
        coords={"softest": ("softest", softest, {"units": PAPER_UNIT})},
        attrs={"robot": branch.attrs["robot"], "exact_k1": exact},
    )


def compared(variants: Mapping[str, xr.Dataset], branches: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Changes by each of the paper's variants (Fig. "different").

    Returns
    -------
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
    return xr.Dataset(
        {
            **{name: ("variant", np.array(values), {"units": PAPER_UNIT}) for name, values in springs.items()},
            "criticality": ("variant", kinds),
            "radius": (("variant", "ratio"), radius, {"units": "m"}),
            "radius_error": (("variant", "ratio"), error, {"units": "m"}),
            "equal_ratio": ("variant", ratio.mean(axis=1), {"units": "1"}),
            "equal_spring": ("variant", there / axis_radius(base, spring), {"units": "1"}),
        },
        coords={
            "variant": np.array(list(variants), dtype=object),
            "ratio": variants[printed.AS_BUILT].spring.values / exact[0],
        },
        attrs={"robot": base.attrs["robot"], "spring": spring},
    )


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
