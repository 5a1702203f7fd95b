"""Sizes of states that balance a matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgebal

Array = NDArray[np.float64]


def numerical_balance(matrix: Array) -> Array:
    """Sizes d of the states for which rows and columns of ``matrix[i, j] * d[j] / d[i]`` have similar norms, by
    LAPACK, for bounds on round-off."""
    d: Array = dgebal(matrix, scale=1, permute=0)[3]
    return d
