"""Weighted samples of constants that meet data, when each evaluation of the constants is expensive.

The likelihood of constants is exp(-chi2/2), where chi2 is the sum of their squared residuals: tolerances are taken as
standard errors. The prior is uniform in the ranges of the constants. A surrogate, one Gaussian process for each
residual, is fitted to all evaluations. New constants are drawn from the likelihood that it expects, and evaluated, and
so on. At the end the surrogate is frozen; the weight of each draw from it is its true likelihood over the expected one.
The weights correct the errors of the surrogate; their effective number tells how well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from chilopod.frozen import Array
from chilopod.tasks.identify.constants import CONFIDENCE

LEAST = 20.0
"""Number of effective samples below which the ends of an interval are not reliable."""

_SQUASHED = 6.0  # largest residual of the surrogate; the likelihood hardly knows larger ones
_TREND = 30.0  # prior standard deviation of the surrogate's constant and slopes
_LEAST_NOISE = 1e-3
_SCALES, _LENGTH = (0.5, -1.5), 0.5  # logarithms of likely deviation, noise and lengths
_MOST_STEPS = 40  # of the search for them
_WALKERS, _STEPS, _STRETCH = 200, 300, 2.0


@dataclass(frozen=True)
class Samples:
    """Constants in parts of their ranges, shape (samples, constants), and normalised weights, shape (samples,)."""

    parts: Array
    weights: Array

    @property
    def effective(self) -> float:
        """Number of equally weighted samples that scatter as much: (sum w)^2 / sum w^2; 0 without a sample."""
        return float(1.0 / np.sum(self.weights**2)) if len(self.weights) else 0.0

    def interval(self, values: Array) -> tuple[float, float]:
        """Ends of the central interval that holds one more draw of a number with 90 %, from its values at the samples.
        The order statistics r and s of n draws hold one more with probability (s - r)/(n + 1), here with n the
        effective number (Wilks 1941); below n = 19 the interval ends at the smallest and largest value."""
        order, n = np.argsort(values), self.effective
        middles = np.cumsum(self.weights[order]) - 0.5 * self.weights[order]
        beyond = 0.5 * (1.0 - CONFIDENCE) * (n + 1.0) / n - 0.5 / n
        low, high = np.interp([beyond, 1.0 - beyond], middles, values[order])
        return float(low), float(high)

    def drawn(self, count: int) -> Array:
        """Constants drawn by their weights, evenly along them, shape (count, constants)."""
        places = (np.arange(count) + 0.5) / max(count, 1)
        return np.asarray(self.parts[np.searchsorted(np.cumsum(self.weights), places)])


class _Process:
    """Gaussian process of one number over parts of the constants' ranges: linear trend, smooth deviation with a length
    for each constant, noise (Rasmussen and Williams 2006, equations 2.25 and 5.9)."""

    def __init__(self, parts: Array, values: Array) -> None:
        self._parts, self._values = parts, values
        likely = np.r_[_SCALES, np.full(parts.shape[1], _LENGTH)]
        bounds = [(-5.0, 4.0), (-5.0, 2.0), *[(-2.5, 4.0)] * parts.shape[1]]
        # Logarithms of deviation, noise and lengths that the values make most likely, with a weak prior.
        how = {"bounds": bounds, "options": {"maxiter": _MOST_STEPS}}
        self.scales = np.asarray(minimize(self._unlikely, likely, (likely,), jac=True, **how).x)
        lower = cho_factor(self._covariance(parts, self.scales) + self._noise(self.scales), lower=True)[0]
        self._inverse = np.asarray(solve_triangular(lower, np.eye(len(parts)), lower=True))
        self._solved = self._inverse.T @ (self._inverse @ values)

    def _smooth(self, parts: Array, scales: Array) -> Array:
        ours, theirs = self._parts / np.exp(scales[2:]), parts / np.exp(scales[2:])
        apart = np.sum(theirs**2, axis=1)[:, None] + np.sum(ours**2, axis=1) - 2.0 * theirs @ ours.T
        return np.asarray(np.exp(2.0 * scales[0] - 0.5 * np.maximum(apart, 0.0)))

    def _covariance(self, parts: Array, scales: Array) -> Array:
        return _TREND**2 * (1.0 + parts @ self._parts.T) + self._smooth(parts, scales)

    def _noise(self, scales: Array) -> Array:
        return (np.exp(2.0 * scales[1]) + _LEAST_NOISE**2) * np.eye(len(self._parts))

    def _unlikely(self, scales: Array, likely: Array) -> tuple[float, Array]:
        """Minus the logarithm of the likelihood, and its slopes."""
        factor = cho_factor(self._covariance(self._parts, scales) + self._noise(scales), lower=True)
        solved = cho_solve(factor, self._values)
        off: Array = cho_solve(factor, np.eye(len(self._values))) - np.outer(solved, solved)
        apart = ((self._parts[:, None] - self._parts) / np.exp(scales[2:])) ** 2
        pull = off * self._smooth(self._parts, scales)
        slopes = np.r_[2.0 * pull.sum(), 2.0 * np.exp(2.0 * scales[1]) * off.trace(), np.tensordot(pull, apart)]
        beyond = scales - likely
        value = 0.5 * self._values @ solved + np.log(np.diag(factor[0])).sum() + 0.5 * beyond @ beyond
        return float(value), 0.5 * slopes + beyond

    def __call__(self, parts: Array) -> tuple[Array, Array]:
        """Means and variances, shape (points,) each."""
        across = self._covariance(parts, self.scales)
        own = _TREND**2 * (1.0 + np.sum(parts**2, axis=1)) + np.exp(2.0 * self.scales[:2]).sum()
        return across @ self._solved, np.maximum(own - np.sum((across @ self._inverse.T) ** 2, axis=1), _LEAST_NOISE**2)


class Surrogate:
    """Gaussian processes of squashed residuals, shape (evaluations, residuals), over parts of the constants' ranges,
    shape (evaluations, constants), but of none that never changes. Variances are multiplied by ``excess``."""

    def __init__(self, parts: Array, residuals: Array, excess: float = 1.0) -> None:
        self._parts, self._excess = parts, excess
        self._vary = np.flatnonzero(np.ptp(residuals, axis=0) > 0.0)
        self._processes = [_Process(parts, _squashed(residuals[:, i])) for i in self._vary.tolist()]

    def __call__(self, parts: Array) -> tuple[Array, Array]:
        """Means and variances of the residuals that vary, shape (points, residuals) each."""
        found = np.array([each(parts) for each in self._processes]).reshape(-1, 2, len(parts))
        means, variances = found.transpose(1, 2, 0)
        return means, self._excess * variances

    def log_likelihood(self, parts: Array) -> Array:
        """Logarithm of the likelihood that the surrogate expects, shape (points,); minus infinity outside 0 to 1."""
        means, variances = self(parts)
        found = -0.5 * np.sum(means**2 / (1.0 + variances) + np.log1p(variances), axis=1)
        return np.where(((parts >= 0.0) & (parts <= 1.0)).all(axis=1), found, -np.inf)

    def draws(self, count: int, rng: np.random.Generator) -> Array:
        """Parts drawn from the likelihood that the surrogate expects, shape (count, constants), by ensembles of walkers
        with stretch moves (Goodman and Weare 2010)."""
        return np.concatenate([self._ensemble(rng) for _ in range(0, max(count, 1), _WALKERS)])[:count]

    def _ensemble(self, rng: np.random.Generator) -> Array:
        size = self._parts.shape[1]
        points = np.concatenate([rng.uniform(size=(20 * _WALKERS, size)), self._parts])
        # From tempered weights, so that walkers begin everywhere.
        weight = np.exp((heights := 0.25 * self.log_likelihood(points)) - heights.max())
        chosen = rng.choice(len(points), _WALKERS, p=weight / weight.sum())
        places = np.clip(points[chosen] + rng.normal(0.0, 0.02, (_WALKERS, size)), 0.0, 1.0)
        height = self.log_likelihood(places)
        for _ in range(_STEPS):
            halves = np.array_split(rng.permutation(_WALKERS), 2)
            for movers, others in (halves, halves[::-1]):
                stretch = (1.0 + (_STRETCH - 1.0) * rng.uniform(size=len(movers))) ** 2 / _STRETCH
                pivots = places[rng.choice(others, len(movers))]
                moved = pivots + stretch[:, None] * (places[movers] - pivots)
                level = self.log_likelihood(moved)
                accept = np.log(rng.uniform(size=len(movers))) < (size - 1) * np.log(stretch) + level - height[movers]
                places[movers[accept]], height[movers[accept]] = moved[accept], level[accept]
        return places[rng.permutation(_WALKERS)]

    def misjudged(self, parts: Array, residuals: Array) -> float:
        """Mean square error at other evaluations, over that which the surrogate expects; 1 without any."""
        if not (len(parts) and len(self._vary)):
            return 1.0
        means, variances = self(parts)
        return float(np.mean((_squashed(residuals[:, self._vary]) - means) ** 2 / variances))


def _squashed(residuals: Array) -> Array:
    """Residuals with large ones bounded, for the surrogate."""
    return np.asarray(_SQUASHED * np.tanh(residuals / _SQUASHED))
