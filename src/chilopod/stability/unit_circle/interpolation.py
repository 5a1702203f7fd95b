"""Polynomials of degree eight or sixteen on a piece -1 ... 1, compared with the function at two more places."""

from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

from chilopod.frozen import Array

DEGREE = 8
PLACES: Array = np.append(np.cos(np.pi * np.arange(DEGREE, -1, -1) / DEGREE), [-0.618, 0.137])
"""Nodes of the polynomial, and the two places of the comparison."""

MORE_PLACES: Array = np.append(PLACES, np.cos(np.pi * (np.arange(DEGREE) + 0.5) / DEGREE))
"""The same, and the nodes in between, for twice the degree."""

DENSE = np.linspace(-1.0, 1.0, 65)
"""Places where the polynomial is evaluated."""

_CHECKS = [DEGREE + 1, DEGREE + 2]


def interpolated(values: Array) -> tuple[Array, Array, Array]:
    """Chebyshev coefficients of the polynomial through the values of a function, or of several as columns, at
    ``PLACES`` or ``MORE_PLACES``; its error; and its values at ``DENSE``."""
    fit, at_checks, at_dense = _matrices(len(values))
    coefficients: Array = fit @ np.delete(values, _CHECKS, axis=0)
    off = np.abs(at_checks @ coefficients - values[_CHECKS]).max(axis=0)
    return coefficients, np.maximum(off, np.abs(coefficients[-2:]).max(axis=0)), at_dense @ coefficients


@cache
def _matrices(count: int) -> tuple[Array, Array, Array]:
    """Coefficients from the values at the nodes among so many places, and values at the checks and at ``DENSE`` from
    coefficients."""
    nodes = np.delete(MORE_PLACES[:count], _CHECKS)
    fit, checks, dense = (chebyshev.chebvander(each, nodes.size - 1) for each in (nodes, MORE_PLACES[_CHECKS], DENSE))
    return np.asarray(np.linalg.inv(fit)), np.asarray(checks), np.asarray(dense)
