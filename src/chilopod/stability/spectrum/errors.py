"""Errors of eigenvalues and of results from them.

Where first-order bounds do not hold, a matrix is changed at random within the errors of its entries, and the error of a
result is ``SAFETY`` times its largest observed change. This holds for simple and for defective eigenvalues, for which
a condition number gives no error. A draw moves a result along its gradient in a random
direction, which in one case of twelve is less than a tenth of the root mean square over all directions (Kenney and
Laub, *SIAM J. Sci. Comput.* 15, 36, 1994); all of ``DRAWS`` are so small in one case of 600 million.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import Array, ComplexArray

SAFETY, DRAWS = 10.0, 8  # factor on the largest change of a result under random changes, and their number

FIRST_ORDER = 1e-6  # error, relative to the largest eigenvalue, up to which first-order bounds hold

VERDICTS = {True: "stable", False: "unstable", None: "undecided"}
"""Words for the results of :func:`stable_within`."""

_EPSILON = float(np.finfo(float).eps)


def stable_within(values: ComplexArray, bound: float, bounds: Array | float | None = None) -> bool | None:
    """Stability by multipliers with a bound on the error of all that are not small, or one each: True if all lie inside
    the unit circle by more than their bounds, False if one lies outside by more, else None."""
    modulus = np.abs(values)
    if (modulus < 1.0 - bound).all():
        return True
    return False if (modulus > 1.0 + (bound if bounds is None else bounds)).any() else None


def falling_order(values: ComplexArray) -> NDArray[np.intp]:
    """Order by falling modulus within round-off; the two of a pair stand together, positive frequency first."""
    modulus = np.abs(values)
    relative = np.round(modulus / max(float(modulus.max()), 1e-300), 12)
    return np.lexsort((-values.imag, -np.round(np.abs(values.imag), 12), -relative))


def disturbed(matrix: Array, error: Array, draws: int = DRAWS) -> Array:
    """Copies of matrices, shape (draws, ...), every entry changed by its error with a random sign."""
    return np.asarray(matrix + error * _signs((draws, *matrix.shape)))


@lru_cache(maxsize=4)  # a search asks for one or two shapes
def _signs(shape: tuple[int, ...]) -> Array:
    return np.random.default_rng(0).choice(np.array([-1.0, 1.0]), shape)


def eigenvalue_errors(values: ComplexArray, matrix: Array, error: Array) -> Array:
    """Bounds on the errors of the eigenvalues of a matrix whose entries have errors, shape (n,)."""
    error = error + 4.0 * _EPSILON * np.abs(matrix)
    if not np.isfinite(error).all():
        return np.full(values.size, np.inf)
    others = np.linalg.eigvals(disturbed(matrix, error))
    away = np.abs(values[:, None] - others[:, None, :])  # draws, values, others
    nearest_other, nearest_value = away.min(axis=2), away.min(axis=1)
    return np.asarray(SAFETY * np.maximum(nearest_other.max(axis=0), nearest_value.max()))
