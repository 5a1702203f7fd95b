"""The coefficients of Radau IIA collocation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.special import roots_jacobi

from chilopod.frozen import ReadOnlyArrays

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Radau(ReadOnlyArrays):
    """Coefficients of Radau IIA.

    Attributes
    ----------
    nodes
        c, rising to 1, shape (s,).
    matrix
        a, shape (s, s); the last row has the weights.
    start
        Values at 0 of the Lagrange polynomials on the nodes, shape (s,): f there as the stages have it.
    filter
        gamma of the filter 1 / (1 - h gamma J) in the estimate of the error: the inverse of the real eigenvalue of the
        inverse of ``matrix`` (Hairer and Wanner, equation IV.8.18).
    """

    nodes: Array
    matrix: Array
    start: Array
    filter: float


def radau(stages: int) -> Radau:
    """The coefficients with an odd number of stages."""
    nodes = np.append(0.5 * (1.0 + roots_jacobi(stages - 1, 1.0, 0.0)[0]), 1.0)
    # In Legendre polynomials, whose integrals are known: Lagrange polynomial j is the sum over k of inverse[k, j] P_k.
    inverse = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, stages - 1))
    integrals = np.array([legendre.legval(2.0 * nodes - 1.0, legendre.legint(row, lbnd=-1)) for row in np.eye(stages)])
    matrix = 0.5 * integrals.T @ inverse
    values = np.linalg.eigvals(np.linalg.inv(matrix))
    real = values[np.abs(values.imag).argmin()].real
    return Radau(nodes, matrix, legendre.legvander(np.array([-1.0]), stages - 1)[0] @ inverse, float(1.0 / real))
