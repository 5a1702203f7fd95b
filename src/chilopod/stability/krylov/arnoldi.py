"""Block Krylov subspaces of a matrix that is known by what it does to directions.

A block meets multipliers that agree, as those of a ring do, in as many copies as it has columns, and the compiled flow
carries several directions at nearly the cost of one, so nothing is gained by one direction at a time (Arnoldi's method
as in ARPACK), nor by restarts: the subspace may grow to the whole space, where it is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_ROUND_OFF = 1e-14
"""Part of an image outside the subspace, relative to the largest image, that is round-off."""

_GROWTH = 1.125
_SINGULAR = 1e-13  # singular values of A - 1 that count as zero, A or the unit matrix being one


@dataclass(frozen=True)
class KrylovSubspace(ReadOnlyArrays):
    """A subspace V with A V = V H + Q R, where A is applied to the last block alone in every round, and Q continues V.

    Attributes
    ----------
    basis
        V, orthonormal, shape (n, m).
    first
        Columns of V that span the block it started from.
    matrix
        H = V^T A V, shape (m, m).
    coupling
        R, shape (q, m), zero but for the columns of the last block; q = 0 where V is invariant.
    """

    basis: Array
    first: int
    matrix: Array
    coupling: Array

    def residuals(self, vectors: ComplexArray) -> Array:
        """|A V s - theta V s| of unit eigenvectors s of H, which are columns, shape (m, count)."""
        return np.asarray(np.linalg.norm(self.coupling @ vectors, axis=0))

    def solve_shifted(self, right: Array) -> tuple[Array, float]:
        """The v in V with the least |(A - 1) v - right|, and what is left of it relative to |right|, for a ``right`` in
        the block that V started from: block GMRES (Saad, *Iterative Methods for Sparse Linear Systems*, 2003, section
        6.12)."""
        m = self.matrix.shape[0]
        whole = np.concatenate([self.matrix - np.eye(m), self.coupling])
        inside = np.concatenate([self.basis.T @ right, np.zeros(len(self.coupling))])
        left, values, right_vectors = np.linalg.svd(whole, full_matrices=False)
        # A - 1 may be nothing but round-off: its largest singular value is not what the others are to be compared with.
        kept = values > _SINGULAR * max(1.0, float(np.linalg.norm(self.matrix)))
        found = right_vectors[kept].T @ (left[:, kept].T @ inside / values[kept])
        return self.basis @ found, float(np.linalg.norm(whole @ found - inside) / np.linalg.norm(inside))


def krylov_subspaces(apply: Callable[[Array], Array], start: Array) -> Iterator[KrylovSubspace]:
    """Subspaces of a matrix, given by what it makes of directions, shape (n, any), from a block to start from, shape
    (n, columns). Each is larger by an eighth or more, so that what is made of all of them costs no more than a few
    times what is made of the last one, which is invariant."""
    n = len(start)
    block = _orthonormal(start, _ROUND_OFF * float(np.linalg.norm(start)), n)[0]
    first = block.shape[1]
    basis, matrix, coupling = block, np.zeros((0, 0)), np.zeros((first, 0))
    largest, look = 0.0, 0.0
    while True:
        m, old = basis.shape[1], matrix.shape[0]
        image = apply(block)
        largest = max(largest, float(np.linalg.norm(image, axis=0).max()))
        inside = basis.T @ image
        outside = image - basis @ inside
        again = basis.T @ outside  # once more, for an orthogonal basis (Giraud et al., Numer. Math. 101, 2005)
        inside += again
        outside -= basis @ again
        block, tail = _orthonormal(outside, _ROUND_OFF * largest, n - m)
        matrix = np.hstack([np.concatenate([matrix, coupling]), inside])
        coupling = np.concatenate([np.zeros((tail.shape[0], old)), tail], axis=1)
        if m >= look or not tail.size:
            yield KrylovSubspace(basis, first, matrix, coupling)
            look = _GROWTH * m
        if not tail.size:
            return
        basis = np.concatenate([basis, block], axis=1)


def _orthonormal(block: Array, negligible: float, most: int) -> tuple[Array, Array]:
    """An orthonormal basis of the columns of a block and their coordinates in it, but for what is negligible."""
    left, values, right = np.linalg.svd(block, full_matrices=False)
    count = min(int((values > negligible).sum()), most)
    return left[:, :count], values[:count, None] * right[:count]
