"""Polynomials of degree eight on a piece -1 ... 1, compared with the function at two more places."""

import numpy as np
from numpy.polynomial import chebyshev

from chilopod.frozen import Array

DEGREE = 8
PLACES: Array = np.append(np.cos(np.pi * np.arange(DEGREE, -1, -1) / DEGREE), [-0.618, 0.137])
"""Nodes of the polynomial, and the two places of the comparison."""

DENSE = np.linspace(-1.0, 1.0, 65)
"""Places where the polynomial is evaluated."""

_FIT = np.linalg.inv(chebyshev.chebvander(PLACES[: DEGREE + 1], DEGREE))
_AT_CHECKS = chebyshev.chebvander(PLACES[DEGREE + 1 :], DEGREE)
_AT_DENSE = chebyshev.chebvander(DENSE, DEGREE)


def interpolated(values: Array) -> tuple[Array, Array, Array]:
    """Chebyshev coefficients of the polynomial through the values of a function, or of several as columns, at
    ``PLACES``; its error; and its values at ``DENSE``."""
    coefficients: Array = _FIT @ values[: DEGREE + 1]
    off = np.abs(_AT_CHECKS @ coefficients - values[DEGREE + 1 :]).max(axis=0)
    return coefficients, np.maximum(off, np.abs(coefficients[-2:]).max(axis=0)), _AT_DENSE @ coefficients
