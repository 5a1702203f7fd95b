"""Means, shares, differences and statements about them, from trials that scatter.

Every interval has the level :data:`LEVEL`. For normal numbers, and for numbers about as skewed as a gamma distribution
of shape 4, it covers the truth in 90 to 97 % of cases from three trials on; so does that of a share from three groups
on, in the mean over shares. Intervals of means are too short where numbers are as skewed as exponential ones. Fewer
than three different values decide nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri, stdtr, stdtrit

from chilopod.errors import ParameterError
from chilopod.frozen import Array

LEVEL = 0.95  # of all intervals; equal things are told apart in a share 1 - LEVEL of cases at most
POWER = 0.8  # chance of a decision by as many trials as are said to decide
MOST = 1000  # largest number of trials that is said to decide
DISTINCT = 3  # number of different values from which scatter is known
_FLOOR = 1e-12  # relative: closer values differ by rounding alone

Answer = bool | None
"""True, False, or None if the scatter leaves it undecided."""


@dataclass(frozen=True)
class Interval:
    """A number and the bounds of its interval; NaN if unknown."""

    value: float
    low: float
    high: float

    def above(self, other: Interval) -> Answer:
        """True if the whole interval lies above another; undecided if they overlap."""
        if self.low > other.high:
            return True
        return False if self.high < other.low else None


@dataclass(frozen=True)
class Comparison:
    """Comparison of a number with a bound; by default one of unknown scatter."""

    side: Answer = None  # of the bound, on which the number lies
    p: float = math.nan  # two-sided probability of a number so far from the bound by chance, if it were equal to it
    away: float = math.nan  # distance from the bound, in standard errors
    trials: float = math.nan  # number that would decide it with the probability POWER, if all is as found

    @property
    def answer(self) -> Answer:
        """The side, if it is decided."""
        return self.side if self.p < 1.0 - LEVEL else None

    def words(self, yes: str = "higher", no: str = "lower") -> str:
        """Side by how many standard errors, and whether that decides."""
        if self.side is None:
            return f"undecided (fewer than {DISTINCT} different values)"
        said = f"{yes if self.side else no} by {self.away:.1f} standard errors"
        return f"undecided ({said})" if self.answer is None else said

    @property
    def needs(self) -> str:
        """Number of trials that would decide, in words; empty if it is decided."""
        if self.answer is not None:
            return ""
        if math.isnan(self.trials):
            return f"at least {DISTINCT} different values are needed to decide"
        count = f"about {self.trials:.0f}" if self.trials <= MOST else f"more than {MOST}"
        return f"{count} trials are needed to decide"


@dataclass(frozen=True)
class Estimate:
    """A number from trials with its standard error."""

    value: float = math.nan
    error: float = math.nan  # NaN if unknown
    freedom: float = math.inf  # degrees of freedom of the error
    trials: int = 0  # number of them, under every condition if there are several
    reciprocal: bool = False  # if one over the number scatters evenly, as springs of a fit in 1/k do

    @property
    def interval(self) -> Interval:
        """Interval by the quantile of Student's t."""
        half = float(stdtrit(self.freedom, 0.5 + 0.5 * LEVEL)) * self.error
        if not self.reciprocal:
            return Interval(self.value, self.value - half, self.value + half)
        low, high = (1.0 / self.value + sign * half / self.value**2 for sign in (1.0, -1.0))
        return Interval(self.value, 1.0 / low, 1.0 / high if not high <= 0.0 else math.inf)

    def between(self, low: float, high: float) -> Comparison:
        """Comparison with the nearer of two bounds: True between them."""
        if self.reciprocal:  # what scatters evenly is value ** 2 / number
            low, high = (self.value**2 / end if end else math.inf for end in (high, low))
        return self._compared(min(self.value - low, high - self.value))

    def above(self) -> Comparison:
        """Comparison with zero: True above it."""
        return self._compared(self.value)

    def _compared(self, margin: float) -> Comparison:
        if not self.error > 0.0 or math.isnan(margin):
            return Comparison()
        away = abs(margin) / self.error
        p = 2.0 * float(stdtr(self.freedom, -away))
        wanted = float(ndtri(0.5 + 0.5 * LEVEL) + ndtri(POWER))
        trials = math.ceil(self.trials * (wanted / away) ** 2 + 2.0) if away * MOST > wanted else math.inf
        return Comparison(bool(margin >= 0.0), p, away, max(trials, self.trials + 1))


def mean(values: ArrayLike, size: float = 0.0) -> Estimate:
    """Mean of the finite numbers; its error is unknown for fewer than three different values.

    Values are alike if they differ by the rounding of the largest of them, or of numbers of some size."""
    finite = np.asarray(values, dtype=np.float64)
    finite = np.sort(finite[np.isfinite(finite)])
    count = finite.size
    if count == 0:
        return Estimate()
    distinct = 1 + int((np.diff(finite) > _FLOOR * max(size, np.abs(finite).max())).sum())
    error = finite.std(ddof=1) / math.sqrt(count) if distinct >= DISTINCT else math.nan
    return Estimate(float(finite.mean()), float(error), count - 1.0, count)


def means(values: Array, here: NDArray[np.bool_] | bool = True) -> tuple[Array, Array]:
    """Means and standard errors of the rows of a table, of the trials chosen; NaN where unknown."""
    found = [mean(row) for row in np.where(here, values, np.nan)]
    return np.array([each.value for each in found]), np.array([each.error for each in found])


def half_interval(samples: Array | NDArray[np.complex128], axis: int = 0) -> Array:
    """Half of the 95 % interval of the mean of independent samples along an axis, by Student's t."""
    count = samples.shape[axis]
    errors = samples.std(axis=axis, ddof=1) / math.sqrt(count)
    return np.asarray(stdtrit(count - 1, 0.5 + 0.5 * LEVEL) * errors)


def ratio(of: ArrayLike, to: ArrayLike) -> Estimate:
    """Sum over sum of independent groups, shape (groups,); groups in which both are 0 count for nothing."""
    above, below = np.asarray(of, dtype=np.float64), np.asarray(to, dtype=np.float64)
    groups = (above != 0.0) | (below != 0.0)
    above, below = above[groups], below[groups]
    if not below.any():
        return Estimate()
    value = above.sum() / below.sum()
    return mean(value + (above - value * below) / below.mean())


def grouped_mean(values: ArrayLike) -> Estimate:
    """Mean of the finite numbers in independent groups, shape (groups, members), whose members may be dependent."""
    table = np.asarray(values, dtype=np.float64)
    known = np.isfinite(table)
    return ratio(np.where(known, table, 0.0).sum(axis=1), known.sum(axis=1))


def share(reached: ArrayLike) -> Interval:
    """Share of True in independent groups, shape (groups,) or (groups, members). The interval is Wilson's (1927), with
    as many trials as independent ones would scatter as the shares of the groups do: the number of groups at least, that
    of all members at most. ParameterError for other values than True and False."""
    table = np.asarray(reached, dtype=np.float64)
    if (wrong := table[(table != 0.0) & (table != 1.0)]).size:
        allowed = "True, False, 1, 0"
        raise ParameterError("must be True or False", field="reached", value=float(wrong[0]), allowed=allowed)
    if table.size == 0:
        return Interval(math.nan, math.nan, math.nan)
    table = table.reshape(len(table), -1)
    groups, members = table.shape
    part, z = float(table.mean()), float(ndtri(0.5 + 0.5 * LEVEL))
    alone = part * (1.0 - part) / members
    design = table.mean(axis=1).var(ddof=1) / alone if alone > 0.0 and groups > 1 else members
    spread = z * z / (table.size / np.clip(design, 1.0, members))
    middle = (part + 0.5 * spread) / (1.0 + spread)
    half = math.sqrt(part * (1.0 - part) * spread + 0.25 * spread**2) / (1.0 + spread)
    return Interval(part, max(0.0, float(middle - half)), min(1.0, float(middle + half)))


def difference(one: ArrayLike, other: ArrayLike, *, paired: bool = False) -> Estimate:
    """Mean of some trials minus that of others, shapes (n,) and (m,), by Welch's test; only finite numbers count.

    Paired trials have equal indices, and the error is that of their differences; ParameterError for other numbers."""
    if paired:
        if np.shape(one) != np.shape(other):
            raise ParameterError(f"has the wrong shape {np.shape(other)}", field="other", allowed=str(np.shape(one)))
        return mean(np.asarray(one) - np.asarray(other), size=float(np.nanmax(np.abs(one), initial=0.0)))
    first, second = mean(one), mean(other)
    error, freedom = _together([first.error**2, second.error**2], [first.freedom, second.freedom])
    return Estimate(first.value - second.value, error, freedom, min(first.trials, second.trials))


def spread_difference(one: ArrayLike, other: ArrayLike) -> Estimate:
    """Difference of the scatter of trials: of their mean distances from the median, whose variances are pooled (the
    test of Brown and Forsythe, scipy's ``levene``). It hardly ever decides for fewer than six trials."""
    known = difference(one, other)  # as is their scatter
    distances = [np.abs(each - np.nanmedian(each)) for each in (np.asarray(one), np.asarray(other))]
    counts = [int(np.isfinite(each).sum()) for each in distances]
    value, freedom = float(np.nanmean(distances[0]) - np.nanmean(distances[1])), sum(counts) - 2.0
    if math.isnan(known.error):
        return Estimate(value)
    pooled = sum(count * np.nanvar(each) for count, each in zip(counts, distances, strict=True)) / freedom
    return Estimate(value, math.sqrt(pooled * (1.0 / counts[0] + 1.0 / counts[1])), freedom, known.trials)


def propagated(of: Callable[[Array], ArrayLike], trials: Array, *, reciprocal: bool = False) -> list[Estimate]:
    """Numbers from the means of conditions, with the errors that their scatter gives them, to first order. ``of`` gives
    the numbers of a table of trials, shape (conditions, trials), NaN where there is none. The trials of every condition
    are moved by their standard error to both sides."""
    values, steps = np.atleast_1d(of(trials)), np.sqrt(_row_variances(trials)[0])
    effects = np.zeros((len(steps), values.size))
    for row, step in enumerate(np.nan_to_num(steps)):
        if step > 0.0:
            move = step * (np.arange(len(steps)) == row)[:, None]
            above, below = (np.atleast_1d(of(trials + each)) for each in (move, -move))
            effects[row] = (1.0 / below - 1.0 / above if reciprocal else above - below) / (2.0 * step)
    effects *= values**2 if reciprocal else 1.0
    pairs = zip(values, effects.T, strict=True)
    return [weighted(float(value), effect, trials, reciprocal=reciprocal) for value, effect in pairs]


def weighted(value: float, effects: Array, trials: Array, *, reciprocal: bool = False) -> Estimate:
    """A number and its error by the scatter of trials, shape (conditions, trials), NaN where there is none. ``effects``
    are derivatives of the number with respect to the mean of every condition. A single trial is taken to scatter as
    those of the other conditions do."""
    variances, freedoms = _row_variances(trials)
    error, freedom = _together(effects**2 * variances, freedoms)
    count = int(np.median(np.isfinite(trials).sum(axis=1)))
    return Estimate(value, error if error > _FLOOR * abs(value) else math.nan, freedom, count, reciprocal)


def _row_variances(trials: Array) -> tuple[Array, Array]:
    """Variance of the mean of every condition, and its degrees of freedom; NaN if all are single trials."""
    counts = np.isfinite(trials).sum(axis=1)
    several, known = counts > 1, np.maximum(counts, 1)
    apart = trials - (np.nansum(trials, axis=1) / known)[:, None]
    freedoms = np.maximum(counts - 1.0, 1.0)
    scatter = np.nansum(apart**2, axis=1) / freedoms
    usual = scatter[several].mean() if several.any() else np.nan
    return np.where(several, scatter, usual) / known, freedoms


def _together(variances: ArrayLike, freedoms: ArrayLike) -> tuple[float, float]:
    """Standard error of a sum, and its degrees of freedom (Welch and Satterthwaite)."""
    each = np.asarray(variances, dtype=np.float64)
    total = each.sum()
    freedom = total**2 / (each**2 / np.asarray(freedoms)).sum() if total > 0.0 else math.inf
    return float(np.sqrt(total)), float(freedom)


def every(comparisons: Iterable[Comparison]) -> Comparison:
    """All of several comparisons at once: no if any is no where as many are looked at (Bonferroni), yes if all are."""
    given = list(comparisons)
    no = [len(given) * each.p for each in given if each.side is False]
    yes = math.nan if not given or any(each.side is None for each in given) else max(each.p for each in given)
    trials = max((each.trials for each in given if each.answer is None), default=math.nan)
    away = min((each.away for each in given), default=math.nan)
    if no:
        return Comparison(False, min(1.0, *no), away, trials)
    return Comparison(None if math.isnan(yes) else True, yes, away, trials)


def increases(trials: Iterable[ArrayLike]) -> Comparison:
    """Comparison of every set of independent trials with the next: True if all means rise."""
    sets = list(trials)
    return every(difference(after, before).above() for before, after in zip(sets[:-1], sets[1:], strict=True))


def holm(p: Sequence[float]) -> NDArray[np.bool_]:
    """Those of several comparisons that are decided with a chance 1 - LEVEL of any error among all (Holm, 1979)."""
    values = np.asarray(p, dtype=np.float64)
    order = np.argsort(values)
    small = values[order] < (1.0 - LEVEL) / np.arange(len(values), 0, -1)
    found = np.zeros(len(values), dtype=bool)
    found[order] = np.logical_and.accumulate(small)
    return found
