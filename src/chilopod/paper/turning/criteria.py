"""Minima of the paper's criteria of turning tasks, and comparison of its two strategies: a pitchfork by one soft
spring, Hopf by springs all alike."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.frozen import Array
from chilopod.paper.printed import CRITERION_NAMES, Band
from chilopod.paper.turning.trials import CRITERIA, TurningTask
from chilopod.statistics import LEVEL, Answer, Comparison, Interval, difference, every, mean
from chilopod.steering import LegYawController

SCALES = {"distance": (1.0, "m"), "angle": (180.0 / math.pi, "deg"), "effort": (1.0, "rad²·s")}
"""Units in which the criteria are shown: factor and unit."""

_COLUMNS = ("spring", "at", "softest", "stiffest", "alike", "mean", "error")


def minima(criteria: xr.Dataset, instant: int = 0) -> xr.Dataset:
    """Minima of each criterion of a :class:`TurningTask`, in means over repeats, at an instant: 0 is the earliest
    arrival, 1 the paper's 23 s, 2 each walk's own.

    Returns
    -------
    Dataset over criterion: the ``spring`` of the smallest mean; ``at``, the vertex of a parabola in 1/k1 through it and
    its neighbours (the spring itself at an end of the grid); ``softest`` and ``stiffest`` of the springs that are not
    worse by a t test (seed by seed), all in N*mm/deg, and ``alike``, their number; the best spring is one of them in
    95 % of cases, as the tests share their level (Bonferroni); ``mean`` and ``error`` of the smallest.
    """
    at_instant = criteria.isel(instant=instant)
    rows = np.array([_minimum(at_instant, name) for name in CRITERIA])
    return xr.Dataset(
        {name: ("criterion", column) for name, column in zip(_COLUMNS, rows.T, strict=True)},
        coords={"criterion": list(CRITERIA)},
        attrs={"seconds": float(at_instant.seconds)},
    )


def _minimum(criteria: xr.Dataset, name: str) -> tuple[float, ...]:
    """Columns of :func:`minima` for one criterion; NaN where no spring has a mean."""
    springs, means, each = criteria.spring.values, criteria[f"{name}_mean"].values, criteria[name].values
    if np.isnan(means).all():
        return (np.nan,) * len(_COLUMNS)
    lowest = int(np.nanargmin(means))
    others = [mean(row - each[lowest], size=float(np.nanmax(each))).above() for row in each]
    # One-sided, and the chance of an error is shared by all springs that the best one is compared with.
    worse = [one.side is True and one.p * (len(springs) - 1) < 2.0 * (1.0 - LEVEL) for one in others]
    alike = springs[np.isfinite(means) & ~np.array(worse)]
    error = criteria[f"{name}_error"].values[lowest]
    vertex = _vertex(springs, means, lowest)
    return springs[lowest], vertex, alike.min(), alike.max(), alike.size, means[lowest], error


def _vertex(springs: Array, mean: Array, lowest: int) -> float:
    """Vertex of the parabola in 1/k through three points, in k."""
    order = slice(lowest - 1, lowest + 2)
    if lowest in (0, len(springs) - 1) or np.isnan(mean[order]).any():
        return float(springs[lowest])
    curve = np.polynomial.Polynomial.fit(1.0 / springs[order], mean[order], 2)
    if curve.deriv(2)(0.0) <= 0.0:  # three equal values
        return float(springs[lowest])
    return float(1.0 / curve.deriv().roots()[0].real)


def around(low: xr.Dataset, said: Band) -> Answer:
    """True if the minimum of one criterion of :func:`minima` lies at some springs (N*mm/deg); undecided if springs that
    are no worse lie within and outside them."""
    low_end, high_end = min(float(low.softest), float(low["at"])), max(float(low.stiffest), float(low["at"]))
    if said.low <= low_end and high_end <= said.high:
        return True
    return None if low_end <= said.high and said.low <= high_end else False


def comparisons(pitchfork: TurningTask, hopf: TurningTask) -> dict[str, Comparison]:
    """Comparisons of the smallest mean of every criterion with both strategies, at the first instant: True if the
    pitchfork's is lower.

    Both have the seeds 0, 1, ...: with as many repeats they are compared seed by seed, else as independent trials. The
    lower one is the best of several springs, so its p counts as often as springs are no worse.
    """
    found = {}
    for name in CRITERION_NAMES:
        ours, theirs = (_smallest(task, name) for task in (pitchfork, hopf))
        one = difference(theirs, ours, paired=ours.size == theirs.size).above()
        best_of = minima((pitchfork if one.side else hopf).criteria)["alike"].sel(criterion=name)
        found[name] = replace(one, p=min(1.0, one.p * float(best_of)) if one.side is not None else one.p)
    return found


def ratios(pitchfork: TurningTask, hopf: TurningTask, instant: int = 0, count: int = 2000) -> dict[str, Interval]:
    """Smallest mean of every criterion with the pitchfork over that with Hopf, at an instant, with an interval of 95 %
    by bootstrap: seeds are drawn again for both strategies at once, and the best spring is chosen anew each time."""
    repeats = pitchfork.criteria.sizes["repeat"]
    drawn = np.vstack([np.arange(repeats), np.random.default_rng(0).integers(repeats, size=(count, repeats))])
    found = {}
    for name in CRITERION_NAMES:
        each = [task.criteria[name].isel(instant=instant).values[:, drawn].mean(axis=2) for task in (pitchfork, hopf)]
        ours, theirs = (np.where(np.isnan(means), np.inf, means).min(axis=0) for means in each)
        low, high = np.quantile(ours / theirs, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
        found[name] = Interval(float(ours[0] / theirs[0]), float(low), float(high))
    return found


def _smallest(task: TurningTask, name: str) -> Array:
    """The trials at the spring of the smallest mean."""
    spring = float(minima(task.criteria).spring.sel(criterion=name))
    at = task.criteria[name].isel(instant=0)
    trials: Array = np.full(at.sizes["repeat"], np.nan) if np.isnan(spring) else at.sel(spring=spring).values
    return trials


def all_lower(pitchfork: TurningTask, hopf: TurningTask) -> Comparison:
    """Comparison of all three minima: True if those of the pitchfork are lower."""
    return every(comparisons(pitchfork, hopf).values())


def in_words(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """Minimum of every criterion with both strategies, with the words lower, higher or undecided for the pitchfork."""
    ours, theirs = minima(pitchfork.criteria)["mean"], minima(hopf.criteria)["mean"]
    parts = []
    for name, compared in comparisons(pitchfork, hopf).items():
        factor, unit = SCALES[name]
        one, two = (factor * float(each.sel(criterion=name)) for each in (ours, theirs))
        parts.append(f"{CRITERION_NAMES[name]} {one:.3g} against {two:.3g} {unit}: {compared.words('lower', 'higher')}")
    return "; ".join(parts)


def counted(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """Numbers of minima of the pitchfork that are lower, higher and undecided."""
    answers = [each.answer for each in comparisons(pitchfork, hopf).values()]
    named = {"lower": True, "higher": False, "undecided": None}
    counts = {word: sum(each is answer for each in answers) for word, answer in named.items()}
    return ", ".join(f"{count} of {len(answers)} {word}" for word, count in counts.items() if count)


def softest_minima(hopf: TurningTask, point: float) -> tuple[str, bool]:
    """Minima of the criteria with all springs alike, beside the point below which the body undulates; True if all of
    them lie below it, in the unstable region."""
    at = minima(hopf.criteria).spring.sel(criterion=list(CRITERION_NAMES)).values
    places = " and ".join(f"{spring:g}" for spring in np.unique(at))
    return f"{places} {PAPER_UNIT}, the body undulates below {point:.2f}", bool((at < point).all())


def saturated(time: float) -> float:
    """Largest possible third criterion, rad^2 s: that of legs at their limit all the time."""
    return 2.0 * LegYawController().limit ** 2 * time


def saturation(*tasks: TurningTask) -> str:
    """Ratio of the third criterion of all springs to its limit; if all are near 1, it distinguishes little."""
    full, unit = saturated(tasks[0].time), SCALES["effort"][1]
    means = np.concatenate([task.criteria.effort_mean.isel(instant=0).values for task in tasks])
    return (
        f"with all springs ε3 is {100.0 * np.nanmin(means) / full:.0f} to {100.0 * np.nanmax(means) / full:.0f} % of "
        f"the {full:.3g} {unit} of legs at their limit all the time"
    )
