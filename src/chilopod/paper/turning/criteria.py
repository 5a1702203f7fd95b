"""Minima of the paper's criteria of turning tasks, and comparison of its two strategies: a pitchfork by one soft
spring, Hopf by springs all alike."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.frozen import Array
from chilopod.paper.printed import CRITERION_NAMES, Band
from chilopod.paper.scatter import SURE, Answer, Difference, difference, every
from chilopod.paper.turning.trials import CRITERIA, TurningTask
from chilopod.steering import LegYawController

SCALES = {"distance": (1.0, "m"), "angle": (180.0 / math.pi, "deg"), "effort": (1.0, "rad²·s")}
"""Units in which the criteria are shown: factor and unit."""

_COLUMNS = ("spring", "at", "softest", "stiffest", "mean", "error")


def minima(criteria: xr.Dataset, instant: int = 0) -> xr.Dataset:
    """Minima of each criterion of a :class:`TurningTask`, in means over repeats, at an instant: 0 is the earliest
    arrival, 1 the paper's 23 s.

    Returns
    -------
    Dataset over criterion: the ``spring`` of the smallest mean; ``at``, the vertex of a parabola in 1/k1 through it and
    its neighbours (the spring itself at an end of the grid); ``softest`` and ``stiffest`` of the springs that are worse
    by at most two standard errors of the difference (seed by seed), all in N*mm/deg; ``mean`` and ``error`` of the
    smallest.
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
    springs, mean, each = criteria.spring.values, criteria[f"{name}_mean"].values, criteria[name].values
    if np.isnan(mean).all():
        return (np.nan,) * len(_COLUMNS)
    lowest = int(np.nanargmin(mean))
    apart = each - each[lowest]
    spread = apart.std(1, ddof=1) / np.sqrt(apart.shape[1]) if apart.shape[1] > 1 else np.zeros(len(apart))
    alike = springs[apart.mean(1) <= SURE * spread + 1e-15]
    error = criteria[f"{name}_error"].values[lowest]
    return springs[lowest], _vertex(springs, mean, lowest), alike.min(), alike.max(), mean[lowest], error


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


def differences(pitchfork: TurningTask, hopf: TurningTask) -> dict[str, Difference]:
    """Smallest mean of every criterion with one strategy minus that with the other, at the first instant.

    Both have the seeds 0, 1, ...: with as many repeats they are compared seed by seed, else as independent trials.
    """
    pairs = {name: (_smallest(pitchfork, name), _smallest(hopf, name)) for name in CRITERION_NAMES}
    return {name: difference(one, two, paired=one.size == two.size) for name, (one, two) in pairs.items()}


def _smallest(task: TurningTask, name: str) -> Array:
    """The trials at the spring of the smallest mean."""
    spring = float(minima(task.criteria).spring.sel(criterion=name))
    at = task.criteria[name].isel(instant=0)
    trials: Array = np.full(at.sizes["repeat"], np.nan) if np.isnan(spring) else at.sel(spring=spring).values
    return trials


def all_lower(pitchfork: TurningTask, hopf: TurningTask) -> Answer:
    """True if all three minima of the pitchfork are lower; False if any is clearly higher."""
    return every(each.lower for each in differences(pitchfork, hopf).values())


def in_words(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """Minimum of every criterion with both strategies, with the words lower, higher or undecided for the pitchfork."""
    ours, theirs = minima(pitchfork.criteria)["mean"], minima(hopf.criteria)["mean"]
    parts = []
    for name, apart in differences(pitchfork, hopf).items():
        factor, unit = SCALES[name]
        one, two = (factor * float(each.sel(criterion=name)) for each in (ours, theirs))
        parts.append(f"{CRITERION_NAMES[name]} {one:.3g} against {two:.3g} {unit}: {apart}")
    return "; ".join(parts)


def counted(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """Numbers of minima of the pitchfork that are lower, higher and undecided."""
    answers = [each.lower for each in differences(pitchfork, hopf).values()]
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
