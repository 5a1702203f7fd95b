"""Series of walks with several springs, and the paper's measures on them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from chilopod import trials
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.square_root import SquareRootFit, square_root_fit
from chilopod.engine import engine_named
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.output import keep
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.sources import digest
from chilopod.statistics import Estimate, mean, propagated
from chilopod.tasks.radius_law import in_settled_curve, is_curved
from chilopod.trials import Trial

Folder = str | Path | None

SEEDS = 10_000
"""Distance of the seeds of neighbouring springs; more repeats then do not change the other trials."""

_RATE = 50.0  # Hz
_WITHOUT = ("cli", "gym", "live", "show")  # subpackages that do not affect results that are kept


def spring_walks(
    robot: Robot,
    springs: Sequence[float],
    duration: float | Sequence[float],
    *,
    repeats: int = 1,
    seeds: Sequence[int] | None = None,
    parameter: str = K1,
    folder: Folder = None,
    progress: Progress = silent,
    **walk: Any,
) -> list[xr.Dataset]:
    """Records of walks with some springs (N*mm/deg; a stiffness by its path), one spring after the other.

    ``duration`` (s) is one for all walks, or one for each spring. ``repeats`` is the number of walks with each spring,
    ``seeds`` are the seeds of the first of them (0 by default), from which the others count up. ``walk`` are other
    fields of :class:`chilopod.trials.Trial`.
    """
    durations = np.broadcast_to(duration, len(springs)).tolist()
    asked = [
        Trial(robot.with_value(parameter, stiffness(float(spring))), seconds, seed + repeat, **walk)
        for spring, seconds, seed in zip(springs, durations, seeds or [0] * len(springs), strict=True)
        for repeat in range(repeats)
    ]
    return trials.run(asked, folder, progress)


def kept(folder: Folder, robot: Robot, how: object, compute: Callable[[], list[Any]]) -> list[Any]:
    """Result of a computation on a robot that is no trial, plain numbers, from a file beside the folder of the trials
    if it is there; ``how`` is all else that determines it, but for the sources and the twin's engine."""
    if folder is None:
        return compute()
    code = digest(_WITHOUT), engine_named("twin").traits.version
    said = repr((code, how, robot.with_(name="robot", provenance={}).to_toml()))
    path = Path(folder).parent / "multipliers" / f"{hashlib.sha256(said.encode()).hexdigest()[:20]}.json"
    with suppress(OSError, ValueError):
        return list(json.loads(path.read_text()))
    found = compute()
    keep(path, json.dumps(found), "multipliers")
    return found


def spring_seeds(springs: Sequence[float]) -> list[int]:
    """First seed of the walks with each spring."""
    return [int(SEEDS * spring) for spring in springs]


def by_spring(walks: Sequence[xr.Dataset], springs: Sequence[float]) -> xr.Dataset:
    """Measures of walks over spring (N*mm/deg) and repeat, from walks in this order."""
    repeats = len(walks) // len(springs)
    rows = [xr.concat(walks[i : i + repeats], "repeat") for i in range(0, len(walks), repeats)]
    return xr.concat(rows, "spring").assign_coords(spring=over_springs(springs), repeat=np.arange(repeats))


def over_springs(springs: Sequence[float]) -> tuple[str, Array, dict[str, str]]:
    """Coordinate of springs, N*mm/deg."""
    return "spring", np.asarray(springs, dtype=np.float64), {"units": PAPER_UNIT}


def example_walks(
    robot: Robot,
    springs: Sequence[float],
    duration: float,
    seeds: Sequence[int],
    engine: str = "planar",
    folder: Folder = None,
) -> xr.Dataset:
    """Joint angles of one walk with each of some springs, over (time, spring, joint): ``joint_angle`` (rad)."""
    records = spring_walks(robot, springs, duration, seeds=seeds, folder=folder, rate=_RATE, engine=engine)
    angles = [record.joint_angle.isel(robot=0, drop=True) for record in records]
    data = xr.concat(angles, dim="spring").transpose("time", "spring", "joint").to_dataset(name="joint_angle")
    data.attrs = {"robot": robot.name, "varied": K1, "about": "yaw joint angles over time"}
    return data.assign_coords(spring=over_springs(springs))


def shares(data: xr.Dataset) -> xr.Dataset:
    """Shares of the walks that are ``curved`` and ``straight``, over spring."""
    found = {"curved": is_curved(data), "straight": (data.direction == "straight").values}
    columns = {name: ("spring", here.mean(axis=1), {"units": "1"}) for name, here in found.items()}
    return xr.Dataset(columns, {"spring": data.spring})


def counted(data: xr.Dataset, settled: bool = True) -> NDArray[np.bool_]:
    """Mask of the trials that curve, and have settled if ``settled``, at springs at which most curve; shape (springs,
    repeats)."""
    most = is_curved(data).mean(axis=1) > 0.5
    return (in_settled_curve(data) if settled else is_curved(data)) & most[:, None]


def fitted(inverse: ArrayLike, bends: ArrayLike) -> SquareRootFit | None:
    """Square-root law of bends over 1/k by :func:`square_root_fit`; None if they do not determine a point."""
    try:
        return square_root_fit(inverse, bends)
    except AnalysisError:
        return None


def point_of(fit: SquareRootFit | None) -> Estimate:
    """Point of a fit, N*mm/deg; NaN if there is none."""
    return fit.estimate if fit else Estimate()


def onset(data: xr.Dataset, joint: int = 1, settled: bool = True) -> SquareRootFit | None:
    """Onset of curved walks by the paper's method: the square-root fit to the trials that are :func:`counted`."""
    here = counted(data, settled)
    inverse = np.broadcast_to(1.0 / data.spring.values[:, None], here.shape)
    return fitted(inverse[here], data.mean_angle.sel(joint=joint).values[here])


def onset_point(data: xr.Dataset, settled: bool = True) -> Estimate:
    """Point of :func:`onset`, N*mm/deg; NaN if there is none."""
    return point_of(onset(data, settled=settled))


def radius_at(data: xr.Dataset, spring: float, settled: bool = True) -> Estimate:
    """Mean radius of the trials at a spring that curve and have settled (all without ``settled``), m; NaN if there are
    fewer than two."""
    at = data.sel(spring=spring)
    radii = at.axis_radius.values[in_settled_curve(at) if settled else is_curved(at)]
    return mean(radii) if len(radii) > 1 else Estimate()


def spring_for(data: xr.Dataset, radius: float) -> Estimate:
    """The paper's k1-hat: spring of a radius, interpolated between trials, N*mm/deg; NaN outside of them.

    The squared curvature is interpolated in 1/k1, in which it is linear by the square-root law.
    """
    here = counted(data)
    curved = here.any(axis=1)
    curvature = np.where(here, 1.0 / data.axis_radius.values, np.nan)[curved]
    inverse, wanted = 1.0 / data.spring.values[curved], radius**-2

    def found(curvature: Array) -> float:
        squared = np.nanmean(curvature, axis=1) ** 2
        order = np.argsort(squared)
        return 1.0 / float(np.interp(wanted, squared[order], inverse[order], left=np.nan, right=np.nan))

    return propagated(found, curvature, reciprocal=True)[0] if curved.any() else Estimate()


@dataclass(frozen=True)
class RadiusRatio:
    """Radius of a variant over that of the robot as built; NaN without a common distance.

    By the square-root law the bend is A sqrt(1/k1 - 1/k*). Two robots of equal A and different onsets k* turn alike at
    equal 1/k1 - 1/k*. Far from the onset the bend saturates, so a ratio of fitted amplitudes A is not exact. Therefore
    the measured bends are compared, over the distances at which both have trials. Squared bends are nearly linear in
    1/k1 and are joined by straight lines. Only the onsets come from fits, to the summed bend of the trials of each.
    Saturation moves both onsets to stiffer springs, so that little of it remains in the ratio.
    """

    distance: Estimate  # at equal distances from each one's own onset
    springs: Estimate  # at equal springs, mean over those compared
    compared: tuple[float, ...]  # springs at which two trials of both curve, N*mm/deg


def radius_ratio(base: xr.Dataset, variant: xr.Dataset) -> RadiusRatio:
    """Compare the radii of two series of trials over spring and repeat, from
    :func:`chilopod.tasks.radius_law.end_of_walk`; only trials that are :func:`counted` count.
    """
    inverse, bends = zip(*(_bends(each) for each in (base, variant)), strict=True)
    distance, springs = (Estimate(each) for each in _ratios(inverse, bends))
    if all((np.isfinite(each).sum(axis=1) > 1).any() for each in bends):  # else nobody knows how one of them scatters
        first, repeats = len(bends[0]), [each.shape[1] for each in bends]
        table = np.full((first + len(bends[1]), max(repeats)), np.nan)
        table[:first, : repeats[0]], table[first:, : repeats[1]] = bends
        distance, springs = propagated(lambda trials: _ratios(inverse, [trials[:first], trials[first:]]), table)
    return RadiusRatio(distance, springs, tuple(float(1.0 / x) for x in _shared(inverse, bends)))


def law_ratio(springs: Sequence[float], base_onset: float, onset: float) -> float:
    """Radius at equal springs by the square-root law with equal amplitudes: effect of the onsets alone.

    Mean over the springs (N*mm/deg) softer than both onsets; NaN if there is none.
    """
    inverse = np.array([1.0 / spring for spring in springs if spring < min(base_onset, onset)])
    return mean(np.sqrt((inverse - 1.0 / base_onset) / (inverse - 1.0 / onset))).value


def onset_of_bend(data: xr.Dataset) -> float:
    """Onset of the curved walks of a series by a fit to their summed bend, N*mm/deg; NaN if there is none."""
    return _onset(*_bends(data))


def change(ratio: Estimate) -> str:
    """Change that a ratio means, in per cent, with its standard error if that is known."""
    if np.isnan(ratio.value):
        return "not determined"
    error = f" ± {100.0 * ratio.error:.0f}" if ratio.error > 0.0 else ""
    return f"{round(100.0 * (ratio.value - 1.0)):+d}{error} %"


def _bends(data: xr.Dataset) -> tuple[Array, Array]:
    """1/k1, rising, and the bend of every trial that counts, NaN elsewhere, at springs at which some do."""
    here = counted(data)
    most = here.any(axis=1)
    bend = np.where(here, 1.0 / data.axis_radius.values, np.nan)[most]  # in proportion: (N-1) L is the same in all
    inverse = 1.0 / data.spring.values[most]
    order = np.argsort(inverse)
    return inverse[order], bend[order]


def _shared(inverse: Sequence[Array], bends: Sequence[Array]) -> Array:
    """1/k1 at which at least two trials of both curve."""
    both = [x[np.isfinite(bend).sum(axis=1) > 1] for x, bend in zip(inverse, bends, strict=True)]
    shared: Array = np.intersect1d(*both)
    return shared


def _ratios(inverse: Sequence[Array], bends: Sequence[Array]) -> tuple[float, float]:
    """At equal distance and at equal springs."""
    squared = [_squared(x, bend) for x, bend in zip(inverse, bends, strict=True)]
    shared = _shared(inverse, bends)
    means = [np.nanmean(1.0 / bend[np.isin(x, shared)], axis=1) for x, bend in zip(inverse, bends, strict=True)]
    springs = float(np.mean(means[1] / means[0])) if shared.size else float("nan")
    low, high = np.max([s[0][0] for s in squared]), np.min([s[0][-1] for s in squared])
    if not low < high:  # nor if one of them has no onset
        return float("nan"), springs
    grid = np.unique([low, high, *(x for s in squared for x in s[0] if low < x < high)])
    one, other = (float(np.trapezoid(np.interp(grid, *each), grid)) for each in squared)
    return float(np.sqrt(one / other)), springs


def _squared(inverse: Array, bend: Array) -> tuple[Array, Array]:
    """Distance from the onset of these trials, rising, and the square of their mean bend; NaN if they have no onset."""
    distance = inverse - 1.0 / _onset(inverse, bend)
    if np.isnan(distance).all():
        return np.array([np.nan]), np.array([np.nan])
    return distance[distance > 0.0], (np.nanmean(bend, axis=1) ** 2)[distance > 0.0]


def _onset(inverse: Array, bend: Array) -> float:
    here = np.isfinite(bend)
    each = np.broadcast_to(inverse[:, None], bend.shape)[here]
    return point_of(fitted(each, bend[here])).value
