"""Location of a pitchfork from trials beside it, by the square-root law that the paper fits to its robot's walks.

Beside a supercritical pitchfork the bend grows as |angle| = a sqrt(1/k - 1/kc). The law is the first term of a series:
it holds near the point only, so a fit over a wide range of springs has a systematic error, which the error bars of
repeated trials do not cover.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array
from chilopod.statistics import Estimate, weighted

_GRID = 2000
_CLOSEST, _FARTHEST = 1e-3, 0.999  # to the springs fitted: of their distance, and on the way to an infinite kc


@dataclass(frozen=True)
class SquareRootFit:
    """|angle| = amplitude * sqrt(1/k - 1/critical).

    Attributes
    ----------
    critical, error
        The spring kc, in the unit of the fitted springs; its standard error from the covariance of the least squares,
        which treats the residuals, lack of fit included, as independent and of equal variance.
    estimate
        kc with the error of another set of trials at the same springs, whatever the law, from the scatter of the
        trials at every spring; 1/kc has an even interval. Unknown if every spring has only one trial.
    amplitude, residual
        Amplitude, in the unit of the angles times the root of that of the springs; root mean square of the residuals.
    trials
        Number of trials that were fitted.
    """

    critical: float
    error: float
    estimate: Estimate
    amplitude: float
    residual: float
    trials: int

    def angle(self, inverse: ArrayLike) -> Array:
        """Angle of the law at values of 1/k; zero on the stiff side."""
        return self.amplitude * _root(np.asarray(inverse, dtype=np.float64), 1.0 / self.critical)


def square_root_fit(inverse: ArrayLike, angle: ArrayLike) -> SquareRootFit:
    """Fit the square-root law to trials by least squares in the angle: 1/k of every trial, positive, equal for trials
    at one spring, and their mean angles, whose sign is ignored, shape (trials,). ParameterError if the arrays differ in
    shape or are not finite; AnalysisError if the trials do not determine the point: fewer than three, at fewer than two
    springs that bend, or with angles that do not fall towards it."""
    x, y = np.asarray(inverse, dtype=np.float64), np.abs(np.asarray(angle, dtype=np.float64))
    if x.ndim != 1 or x.shape != y.shape:
        raise ParameterError("must have one value for each spring", field="angle", value=y.shape, allowed=f"{x.shape}")
    if not (np.isfinite(y).all() and (x > 0.0).all() and np.isfinite(x).all()):
        raise ParameterError("must be finite, and every spring must be positive", field="angle")
    bent = np.unique(x[y > 0.0])
    if x.size < 3 or bent.size < 2:
        said = "must come from at least two springs that bend the robot and three trials"
        raise AnalysisError(said, field="angle", value=bent.size)
    # Given 1/kc the amplitude follows, so only 1/kc is searched: at least two springs have to lie beyond it.
    grid = bent[-2] - np.geomspace(_CLOSEST * (bent[-1] - bent[-2]), _FARTHEST * bent[-2], _GRID)
    basis = _root(x, grid[:, None])
    best = int(_lost(basis, y[:, None])[:, 0].argmin())
    if best in (0, len(grid) - 1):
        raise AnalysisError("must fall to zero as a square root of the distance to the pitchfork", field="angle")
    how = {"bounds": (grid[best + 1], grid[best - 1]), "options": {"xatol": 1e-13 * grid[best]}}
    found = minimize_scalar(lambda at: _lost(_root(x, at)[None], y[:, None])[0, 0], method="bounded", **how)
    at = float(found.x)
    root = _root(x, at)
    amplitude = float(root @ y / (root @ root))
    residuals = y - amplitude * root
    beyond = root > 0.0
    slopes = np.stack([root[beyond], -0.5 * amplitude / root[beyond]], axis=1)
    # Trials on the stiff side carry no information about the error of the law and do not count.
    spread = float(residuals[beyond] @ residuals[beyond]) / max(int(beyond.sum()) - 2, 1)
    inverted = np.linalg.inv(slopes.T @ slopes)
    effects = np.zeros(x.size)  # of every trial on 1/kc
    effects[beyond] = inverted[1] @ slopes.T
    error, residual = float(np.sqrt(spread * inverted[1, 1])) / at**2, float(np.sqrt(np.mean(residuals**2)))
    return SquareRootFit(1.0 / at, error, _estimate(x, y, at, effects), amplitude, residual, trials=x.size)


def _root(inverse: Array, critical: ArrayLike) -> Array:
    return np.sqrt(np.maximum(inverse - np.asarray(critical), 0.0))


def _lost(basis: Array, angles: Array) -> Array:
    """Sum of squared residuals for the best amplitude, shape (values of 1/kc, sets of trials), for the law without its
    amplitude, shape (values, trials), and angles, shape (trials, sets)."""
    return (angles**2).sum(axis=0) - (basis @ angles) ** 2 / (basis**2).sum(axis=1, keepdims=True)


def _estimate(x: Array, y: Array, at: float, effects: Array) -> Estimate:
    """The point 1/at by the scatter of the trials at every spring."""
    springs, place = np.unique(x, return_inverse=True)
    trials = zip_longest(*(y[place == row] for row in range(springs.size)), fillvalue=np.nan)
    return weighted(1.0 / at, np.bincount(place, effects) / at**2, np.array(list(trials)).T, reciprocal=True)
