"""How far the eigenvalues of a matrix move when its entries are off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIRST_ORDER = 1e-6
"""Of the largest eigenvalue: errors up to here are those of first-order perturbations."""

DRAWN = 10.0
"""How much farther eigenvalues may move than by the worst of some changes at random."""

_DRAWS = 8


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
