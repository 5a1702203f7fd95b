"""One term of the planar model's matrix Taylor series: `planar/series.py` beside plain numba loops and BLAS.

Run by `make bench`; rewrites a table in README.md. The written-out registers stay only as long as this table defends
them.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numba import njit

from chilopod.planar.series import PANEL, ROWS, panels, series_term

from _timing import machine, median_seconds, table, write_section

TERMS = 2000


@njit
def unchanged(array: Any) -> Any:
    return array


def repeated(term: Callable[..., None]) -> Callable[..., None]:
    """Many terms in a row, as the flow computes them, in compiled code."""
    view = panels if term is series_term else unchanged

    @njit(error_model="numpy", fastmath={"contract"})
    def run(matrix: Any, terms: Any, total: Any) -> None:
        start, last, summed = terms.shape[0] - matrix.shape[1], view(terms), view(total)
        for k in range(TERMS):
            term(matrix, last, start, 1.0 / (k % 30 + 1), summed)

    return run


@njit(error_model="numpy", fastmath=True)
def rows_first(matrix: Any, terms: Any, start: int, scale: float, total: Any) -> None:
    """The loop one would write: row by row, a sum for every column."""
    rows, inner = matrix.shape
    last, new = terms[start : start + inner], terms[start - rows : start]
    for i in range(rows):
        new[i] = 0.0
        for k in range(inner):
            a = scale * matrix[i, k]
            for q in range(PANEL):
                new[i, q] += a * last[k, q]
        for q in range(PANEL):
            total[i, q] += new[i, q]


@njit(error_model="numpy", fastmath=True)
def four_rows(matrix: Any, terms: Any, start: int, scale: float, total: Any) -> None:
    """The same with four rows at a time in a small array, which a compiler may keep in registers."""
    rows, inner = matrix.shape
    last, new = terms[start : start + inner], terms[start - rows : start]
    sums = np.empty((ROWS, PANEL))
    for i in range(0, rows, ROWS):
        sums[:] = 0.0
        for k in range(inner):
            for r in range(ROWS):
                for q in range(PANEL):
                    sums[r, q] += matrix[i + r, k] * last[k, q]
        for r in range(ROWS):
            for q in range(PANEL):
                new[i + r, q] = scale * sums[r, q]
                total[i + r, q] += new[i + r, q]


@njit(error_model="numpy")
def by_blas(matrix: Any, terms: Any, start: int, scale: float, total: Any) -> None:
    rows, inner = matrix.shape
    new = terms[start - rows : start]
    np.dot(matrix, terms[start : start + inner], new)
    for i in range(rows):
        for q in range(PANEL):
            new[i, q] *= scale
            total[i, q] += new[i, q]


PEERS = {
    "**chilopod**, registers written out": series_term,
    "numba, row by row": rows_first,
    "numba, four rows at a time": four_rows,
    "numba calling BLAS": by_blas,
}


def main() -> None:
    parts = [machine()]
    for modules in (6, 20):
        rows = (2 * modules + 1 + ROWS - 1) // ROWS * ROWS
        random = np.random.default_rng(0)
        matrix = random.normal(0.0, 0.1, (rows, 3 * rows))
        terms = random.normal(0.0, 1.0, (4 * rows, PANEL))
        found, times = {}, {}
        for name, term in PEERS.items():
            run, at, total = repeated(term), terms.copy(), np.zeros((rows, PANEL))
            run(matrix, at, total)
            found[name] = at[:rows] / np.abs(at[:rows]).max()
            times[name] = median_seconds(partial(run, matrix, at, total)) / TERMS
        first = next(iter(found.values()))
        for name, other in found.items():
            assert np.allclose(other, first, rtol=1e-9, atol=1e-12), name
        best = min(times.values())
        lines = [
            [name, f"{seconds * 1e6:.3g} µs", f"{seconds / best:.1f}"]
            for name, seconds in sorted(times.items(), key=lambda item: item[1])
        ]
        parts.append(f"**{modules} modules: {rows} x {3 * rows} times {3 * rows} x {PANEL}**\n")
        parts[-1] += "\n" + table(("who", "time", "ratio"), lines)
    write_section("series-term", "\n\n".join(parts))


if __name__ == "__main__":
    main()
