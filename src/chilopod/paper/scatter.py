"""Statements about trials that scatter, decided or left undecided.

Every answer is yes, no, or undecided: True, False or None.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.frozen import Array

Answer = bool | None
"""True, False, or None if the scatter leaves it undecided."""

INCREASES: Mapping[Answer, str] = {True: "increases", False: "not throughout", None: "not told apart everywhere"}
"""Words for the answers of :func:`increases`."""

SURE = 2.0
"""Number of standard errors that distinguish two means, or a mean and a bound."""


@dataclass(frozen=True)
class Difference:
    """Difference of two means, and its standard error; NaN if unknown, as for single trials."""

    value: float
    error: float

    @property
    def lower(self) -> Answer:
        """True if the first mean is the lower one."""
        if np.isnan(self.value) or not abs(self.value) > SURE * self.error:
            return None
        return bool(self.value < 0.0)

    @property
    def higher(self) -> Answer:
        """True if the first mean is the higher one."""
        return None if self.lower is None else not self.lower

    def __str__(self) -> str:
        """Lower, higher or undecided, with the difference in standard errors."""
        side = "lower" if self.value < 0.0 else "higher"
        if not self.error > 0.0:
            return "undecided" if self.lower is None else side
        by = f"by {abs(self.value) / self.error:.1f} standard errors"
        return f"undecided ({side} {by})" if self.lower is None else f"{side} {by}"


def difference(one: ArrayLike, other: ArrayLike, *, paired: bool = False) -> Difference:
    """Mean of some trials minus that of others, shapes (n,) and (m,); NaN is left out.

    Paired trials have equal indices, as those of one seed, and the error is that of their differences. Other trials are
    independent.
    """
    x, y = np.asarray(one, dtype=np.float64), np.asarray(other, dtype=np.float64)
    if paired:
        return Difference(*mean_and_error(x - y))
    (first, error), (second, other_error) = mean_and_error(x), mean_and_error(y)
    return Difference(first - second, float(np.hypot(error, other_error)))


def spread_difference(one: ArrayLike, other: ArrayLike) -> Difference:
    """Ratio of the scatter of trials to that of others: the difference of the mean distances from the median (the test
    of Brown and Forsythe). Its error is not known for fewer than three trials: the distances of two are equal."""
    distances = [np.abs(each - np.nanmedian(each)) for each in (np.asarray(one), np.asarray(other))]
    found = difference(*distances)
    return found if min(np.isfinite(each).sum() for each in distances) > 2 else Difference(found.value, float("nan"))


def mean_and_error(values: ArrayLike) -> tuple[float, float]:
    """Mean and standard error of the numbers that are not NaN; the error is NaN for fewer than two values, the mean for
    none."""
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    mean = float(finite.mean()) if finite.size else float("nan")
    return mean, float(finite.std(ddof=1) / np.sqrt(finite.size)) if finite.size > 1 else float("nan")


def means(values: Array, here: NDArray[np.bool_] | bool = True) -> tuple[Array, Array]:
    """Mean and standard error at every spring (row) of the trials chosen; the error is NaN for a single one."""
    mean, error = np.array([mean_and_error(row) for row in np.where(here, values, np.nan)]).T
    return mean, error


def with_error(value: float, error: float, digits: int) -> str:
    """Text of a number with some decimals, and of its standard error, if known and not zero."""
    return f"{value:.{digits}f}" + (f" ± {error:.{digits}f}" if error > 0.0 else "")


def between(value: float, error: float, low: float, high: float) -> Answer:
    """True if a mean lies between two bounds: undecided within :data:`SURE` standard errors of the nearer bound.

    False for a mean that is not finite; undecided for an unknown error (NaN).
    """
    if not np.isfinite(value):
        return False
    margin = min(value - low, high - value)
    if margin == 0.0 or abs(margin) > SURE * error:
        return bool(margin >= 0.0)
    return None


def every(answers: Iterable[Answer]) -> Answer:
    """No if any answer is no, undecided if any other is undecided, else yes."""
    given = list(answers)
    if any(answer is False for answer in given):
        return False
    return None if None in given else True


def increases(trials: Iterable[ArrayLike]) -> Answer:
    """True if the mean rises from every set of independent trials to the next; undecided for fewer than two sets."""
    sets = list(trials)
    if len(sets) < 2:
        return None
    return every(difference(after, before).higher for before, after in zip(sets[:-1], sets[1:], strict=True))


def drawn_anew(trials: Array, rng: np.random.Generator) -> Array:
    """Set of trials for a bootstrap, shape (conditions, trials): mean of every row plus drawn deviations from it.

    Deviations from the mean of n trials are too small by sqrt((n - 1) / n) on average, so they are widened by this
    factor. NaN stays NaN, and single trials do not change.
    """
    drawn = trials.copy()
    for row in drawn:
        here = np.flatnonzero(np.isfinite(row))
        if here.size > 1:
            mean = row[here].mean()
            apart = np.sqrt(here.size / (here.size - 1.0)) * (row[here] - mean)
            row[here] = mean + rng.choice(apart, size=here.size)
    return drawn
