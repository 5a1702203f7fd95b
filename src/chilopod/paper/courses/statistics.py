"""Intervals of 95 % for shares of trials, and for differences between paired trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm

from chilopod.paper.scatter import Answer

LEVEL = 0.95
"""Level of all intervals."""

_DRAWN = 2000


@dataclass(frozen=True)
class Interval:
    """A number and the bounds of its interval at :data:`LEVEL`; NaN if unknown."""

    value: float
    low: float
    high: float

    def above(self, other: Interval) -> Answer:
        """True if the whole interval lies above another; undecided if they overlap."""
        if self.low > other.high:
            return True
        return False if self.high < other.low else None

    @property
    def sign(self) -> Answer:
        """Sign of the interval: True if both bounds are positive, undecided if zero lies between them."""
        return self.above(Interval(0.0, 0.0, 0.0))


def wilson(successes: int, count: int) -> Interval:
    """Share of successes among independent trials with the interval of Wilson (1927), which holds for few trials and
    for shares near 0 and 1."""
    if count == 0:
        return Interval(float("nan"), float("nan"), float("nan"))
    z = float(norm.ppf(0.5 + 0.5 * LEVEL))
    share, spread = successes / count, z * z / count
    middle = (share + 0.5 * spread) / (1.0 + spread)
    half = z * np.sqrt(share * (1.0 - share) / count + 0.25 * spread / count) / (1.0 + spread)
    return Interval(share, max(0.0, float(middle - half)), min(1.0, float(middle + half)))


def bootstrap_mean(values: ArrayLike, seed: int = 0) -> Interval:
    """Mean of the numbers that are not NaN, with the percentile interval of the bootstrap.

    Groups, shape (groups,) or (groups, members), are independent and are drawn anew as a whole. Members of a group,
    as the targets of one course, may depend on each other.
    """
    table = np.asarray(values, dtype=np.float64)
    table = table.reshape(len(table), -1)
    return bootstrap_ratio(np.nansum(table, axis=1), np.isfinite(table).sum(axis=1), seed)


def bootstrap_ratio(of: ArrayLike, to: ArrayLike, seed: int = 0) -> Interval:
    """Sum over sum of independent groups, shape (groups,), which are drawn anew as a whole, with the percentile
    interval of the bootstrap; groups in which both are 0 count for nothing."""
    above, below = np.asarray(of, dtype=np.float64), np.asarray(to, dtype=np.float64)
    groups = np.flatnonzero((above != 0.0) | (below != 0.0))
    if not below.any():
        return Interval(float("nan"), float("nan"), float("nan"))
    above, below = above[groups], below[groups]
    picked = np.random.default_rng(seed).integers(len(groups), size=(_DRAWN, len(groups)))
    sums, counts = above[picked].sum(axis=1), below[picked].sum(axis=1)
    drawn = sums[counts > 0.0] / counts[counts > 0.0]
    low, high = np.quantile(drawn, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return Interval(float(above.sum() / below.sum()), float(low), float(high))
