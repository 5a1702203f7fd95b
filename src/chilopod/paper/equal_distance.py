"""Radius of a variant over that of the robot, at equal distances from the onset of each one's curved walks.

By the square-root law the bend is A sqrt(1/k1 - 1/k*). Two robots of equal A and different onsets k* turn alike at
equal 1/k1 - 1/k*. Far from the onset the bend saturates, so a ratio of fitted amplitudes A is not exact. Therefore the
measured bends are compared, over the distances at which both have trials. Squared bends are nearly linear in 1/k1 and
are joined by straight lines. Only the onsets come from fits, to the summed bend of the trials of each. Saturation moves
both onsets to stiffer springs, so that little of it remains in the ratio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from chilopod.frozen import Array
from chilopod.paper.measures import counted, fitted, point_of
from chilopod.statistics import Estimate, mean, propagated


@dataclass(frozen=True)
class RadiusRatio:
    """Radius of a variant over that of the robot as built; NaN without a common distance."""

    distance: Estimate  # at equal distances from each one's own onset
    springs: Estimate  # at equal springs, mean over those compared
    compared: tuple[float, ...]  # springs at which two trials of both curve, N*mm/deg


def radius_ratio(base: xr.Dataset, variant: xr.Dataset) -> RadiusRatio:
    """Compare the radii of two series of trials over spring and repeat, from
    :func:`chilopod.tasks.radius_law.end_of_walk`; only trials that are :func:`chilopod.paper.measures.counted` count.
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
