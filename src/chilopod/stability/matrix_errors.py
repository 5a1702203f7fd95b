"""How far the eigenvalues of a matrix move when its entries are off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIRST_ORDER = 1e-6
"""Of the largest eigenvalue: errors up to here are those of first-order perturbations."""

DRAWN = 10.0
"""How much farther eigenvalues may move than by the worst of some changes at random."""

VERDICTS = {True: "stable", False: "unstable", None: "undecided"}
"""Words for what :func:`stable_within` finds."""

_DRAWS = 8


def stable_within(
    values: NDArray[np.complex128], bound: float, bounds: NDArray[np.float64] | float | None = None
) -> bool | None:
    """Stability by multipliers, shape (n,), with a bound on the error of all that are not small, or bounds one by one:
    True if all lie inside the unit circle by more than it, False if one lies outside by more than its own, None if the
    errors leave it undecided."""
    modulus = np.abs(values)
    if (modulus < 1.0 - bound).all():
        return True
    return False if (modulus > 1.0 + (bound if bounds is None else bounds)).any() else None


def eigenvalues_moved(values: NDArray[np.complex128], matrix: Array, error: Array) -> Array:
    """How far eigenvalues move when a matrix changes by its error: where several nearly agree without eigenvectors of
    their own, by its square root, which no condition number tells."""
    random = np.random.default_rng(0)
    error = error + 4.0 * np.finfo(float).eps * np.abs(matrix)
    if not np.isfinite(error).all():
        return np.full(values.size, np.inf)
    moved = np.zeros(values.size)
    for _ in range(_DRAWS):
        others = np.linalg.eigvals(matrix + error * random.choice([-1.0, 1.0], matrix.shape))
        moved = np.maximum(moved, np.abs(values[:, None] - others).min(axis=1))
        moved = np.maximum(moved, np.abs(values[:, None] - others).min(axis=0).max())
    return DRAWN * moved
