"""Sizes of states that balance a matrix."""

from __future__ import annotations

from scipy.linalg.lapack import dgebal

from chilopod.frozen import Array


def numerical_balance(matrix: Array) -> Array:
    """Sizes d with rows and columns of ``matrix[i, j] * d[j] / d[i]`` of similar norms, for bounds on round-off."""
    d: Array = dgebal(matrix, scale=1, permute=0)[3]
    return d
