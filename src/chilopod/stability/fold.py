"""Folds: where an orbit that is followed through a parameter ends, because it meets another one and both vanish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.capabilities import SystemLike
from chilopod.stability.returns import ReturnMap, return_map

Array = NDArray[np.float64]

_STEP = 6e-6  # of central differences; it only sets how fast Newton's method converges, not where to
_ROUNDS = 40


@dataclass(frozen=True)
class Fold:
    """A fold of periodic orbits.

    Attributes
    ----------
    value
        Of the parameter.
    error_bound
        Bound on its error.
    image
        Return map at the critical orbit.
    """

    value: float
    error_bound: float
    image: ReturnMap


def find_fold(family: Callable[[float], SystemLike], value: float, orbit: Array, scale: float) -> Fold | None:
    """Solve for the fold next to an orbit that is close to it; None if Newton's method does not find one.

    Unknowns are the state x and the parameter p; the equations are H(x, p) = x and g(x, p) = 0, where g is the last
    entry of the solution of [[dH/dx - 1, b], [c, 0]] (v, g) = (0, 1), a smooth function that vanishes with the
    determinant of dH/dx - 1 (Govaerts, *Numerical Methods for Bifurcations of Dynamical Equilibria*, 2000, ch. 4).

    Parameters
    ----------
    family
        ``family(value)`` is the system.
    value, orbit
        Parameter and orbit to start from.
    scale
        Of the parameter, for differences.
    """
    n = orbit.size
    x, p = orbit.copy(), value
    try:
        image = return_map(family(p), x, with_error=False)
        left, _, right = np.linalg.svd(image.jacobian - np.eye(n))
        b, c = left[:, -1], right[-1]

        def equations(state: Array, parameter: float) -> tuple[Array, ReturnMap]:
            here = return_map(family(parameter), state, with_error=False)
            bordered = np.block([[here.jacobian - np.eye(n), b[:, None]], [c[None], np.zeros((1, 1))]])
            g = np.linalg.solve(bordered, np.append(np.zeros(n), 1.0))[-1]
            return np.append(here.state - state, g), here

        best = np.inf
        for _ in range(_ROUNDS):
            values, image = equations(x, p)
            size = float(np.abs(values).max())
            if size <= 1e-13 * max(1.0, float(np.abs(x).max())) or (size < 1e-9 and size >= 0.5 * best):
                return _described(family, x, p, scale)
            best = min(best, size)
            derivative = np.empty((n + 1, n + 1))
            for j in range(n + 1):
                h = _STEP * (scale if j == n else max(1.0, abs(x[j])))
                dx, dp = (np.zeros(n), h) if j == n else (h * np.eye(n)[j], 0.0)
                up, down = equations(x + dx, p + dp)[0], equations(x - dx, p - dp)[0]
                derivative[:, j] = (up - down) / (2.0 * h)
            derivative[:n, :n] = image.jacobian - np.eye(n)
            move = np.linalg.solve(derivative, -values)
            x, p = x + move[:n], float(p + move[n])
            if not (np.isfinite(x).all() and abs(p - value) < scale):
                return None
    except (AnalysisError, np.linalg.LinAlgError):
        return None
    return None


def _described(family: Callable[[float], SystemLike], x: Array, p: float, scale: float) -> Fold:
    image = return_map(family(p), x)
    left = np.linalg.svd(image.jacobian - np.eye(x.size))[0][:, -1]
    h = _STEP * scale
    up, down = (return_map(family(p + step), x, with_error=False).state for step in (h, -h))
    slope = abs(float(left @ (up - down) / (2.0 * h)))
    # left . (H(x, p) - x) = 0 fixes p to first order; x itself enters in second order only.
    residual = float(np.abs(image.state - x).max()) + float(np.max(image.error)) * float(np.abs(x).max())
    return Fold(p, 2.0 * residual / slope if slope > 0.0 else np.inf, image)
