"""One term of a matrix Taylor series in vector registers, the innermost loop of the linearised flow.

For matrices of some ten rows a BLAS call costs more than its arithmetic, and the compiler does not keep sums in
registers across an inner loop over columns. So four rows times two vectors of eight columns are variables of their own,
which stay in registers while the inner index runs; on processors with narrower vectors the compiler splits the
operations. ``benchmarks/series_term.py`` compares it with plain loops and BLAS.
"""

from __future__ import annotations

from typing import Any

from chilopod.compiled import njit
from chilopod.lanes import LANES, as_lanes

PANEL = 2 * LANES
"""Number of columns."""

ROWS = 4
"""The number of rows of the matrix must be a multiple of this."""


@njit(inline="always")
def panels(array: Any) -> Any:
    """View of an array, shape (rows, PANEL), in lanes, shape (rows, 2)."""
    return as_lanes(array.reshape((len(array), 2, LANES)), LANES)


@njit(inline="always")
def _put(new: Any, total: Any, row: int, left: Any, right: Any) -> None:
    new[row, 0], new[row, 1] = left, right
    total[row, 0] += new[row, 0]  # of the rounded number: a product would be fused into the sum
    total[row, 1] += new[row, 1]


@njit(inline="always")
def series_term(matrix: Any, terms: Any, start: int, scale: float, total: Any) -> None:
    """Compute the next term of a series from the last ones, and add it to the sum.

    Puts ``new = scale * matrix @ terms[start : start + matrix.shape[1]]`` into the rows of ``terms`` just before
    ``start``, at least r, and adds it to ``total``: ``matrix`` (r, k) with r a multiple of ROWS, and the
    :func:`panels` of ``terms`` (any number, PANEL) and ``total`` (r, PANEL). Nothing is checked.
    """
    rows, inner = matrix.shape
    last, new = terms[start : start + inner], terms[start - rows : start]
    for i in range(0, rows, ROWS):
        a, b, c, d = matrix[i], matrix[i + 1], matrix[i + 2], matrix[i + 3]
        a_left, b_left, c_left, d_left = 0.0, 0.0, 0.0, 0.0
        a_right, b_right, c_right, d_right = 0.0, 0.0, 0.0, 0.0
        for k in range(inner):
            left, right = last[k, 0], last[k, 1]
            a_left += a[k] * left
            b_left += b[k] * left
            c_left += c[k] * left
            d_left += d[k] * left
            a_right += a[k] * right
            b_right += b[k] * right
            c_right += c[k] * right
            d_right += d[k] * right
        _put(new, total, i, scale * a_left, scale * a_right)
        _put(new, total, i + 1, scale * b_left, scale * b_right)
        _put(new, total, i + 2, scale * c_left, scale * c_right)
        _put(new, total, i + 3, scale * d_left, scale * d_right)
