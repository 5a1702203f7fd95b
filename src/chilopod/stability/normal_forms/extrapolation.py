"""Taylor coefficients of a sampled function, with error bounds.

An even or odd function of the radius r is sampled at Chebyshev points of (0, s], which gives its values at those of
[-s, s]. Its Chebyshev coefficients t_k fall geometrically down to the noise of the samples, so the series itself
shows the size of that noise, the truncation error, and the quality of s (Trefethen,
*Approximation Theory and Approximation Practice*, chapters 3, 4 and 8). A Taylor coefficient is a sum over the t_k up
to the degree with the least sum of noise and truncation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays

RADII = 8  # number of radii at which a function is sampled

_SAFETY = 5.0  # factor on the noise, estimated from few samples, and the truncation, from the next two terms
_FALL = 4.0
_TAIL = 2  # number of last coefficients of every parity that count as noise


def radii() -> Array:
    """Positive Chebyshev points of the first kind of [-1, 1], falling, shape (RADII,)."""
    return np.cos((2 * np.arange(RADII) + 1) * np.pi / (4 * RADII))


@dataclass(frozen=True)
class Series(ReadOnlyArrays):
    """Chebyshev coefficients over [-1, 1] of functions that are even or odd."""

    coefficients: ComplexArray  # coefficients of T_parity, T_(parity + 2), ..., shape (RADII, entries)
    parity: int  # 0 for even functions, 1 for odd ones

    @property
    def roughness(self) -> Array:
        """Size of the last coefficients, shape (entries,): noise of the samples, or truncation error."""
        tail: Array = np.abs(self.coefficients[-_TAIL:]).max(axis=0)
        return tail

    @property
    def falling(self) -> NDArray[np.bool_]:
        """True if the coefficients still fall at their end, unlike noise, shape (entries,)."""
        before: Array = np.abs(self.coefficients[-2 * _TAIL : -_TAIL]).max(axis=0)
        return np.asarray(before > _FALL * self.roughness)

    def taylor(self, order: int, noise: Array) -> tuple[ComplexArray, Array]:
        """Taylor coefficients of one order, and bounds on their errors from those of the samples, shape (entries,)."""
        weights, gains = _weights(order, self.parity)
        terms = weights[:, None] * self.coefficients
        sizes = np.abs(terms)
        # Coefficients after the next two count only above the noise.
        standing_out = np.maximum(sizes - 2.0 * np.abs(weights[:, None]) * self.roughness, 0.0)
        beyond = np.cumsum(np.vstack([np.zeros(noise.size), standing_out[::-1]]), axis=0)[::-1]
        first, last = (order - self.parity) // 2, RADII - _TAIL
        after = sizes[first + 1 : last + 1] + sizes[first + 2 : last + 2] + beyond[first + 3 : last + 3]
        errors = _SAFETY * (gains[first:last, None] * noise + after)
        errors = np.where(errors < np.inf, errors, np.inf)
        best, entries = errors.argmin(axis=0), np.arange(noise.size)
        return np.cumsum(terms, axis=0)[first + best, entries], errors[best, entries]


def series(values: ComplexArray, parity: int) -> Series:
    """The series of functions sampled at the :func:`radii`, shape (RADII, entries)."""
    return Series(_transform(parity) @ values, parity)


@cache
def _transform(parity: int) -> Array:
    """Discrete cosine transform of a function of one parity, from its values at positive points."""
    orders = np.arange(parity, 2 * RADII, 2)
    matrix = 2.0 / RADII * np.cos(np.outer(orders, np.arccos(radii())))
    if parity == 0:
        matrix[0] *= 0.5
    return matrix


@cache
def _weights(order: int, parity: int) -> tuple[Array, Array]:
    """Coefficient of r^order in every T_k, and the factor of the sum up to each k on an error of the samples."""
    orders = np.arange(parity, 2 * RADII, 2)
    weights = np.array([chebyshev.cheb2poly(np.eye(2 * RADII)[k])[order] if k >= order else 0.0 for k in orders])
    gains = np.abs(np.cumsum(weights[:, None] * _transform(parity), axis=0)).sum(axis=1)
    return weights, gains
