"""Adaptive grid of growth rates over two numbers of a robot, fine where neighbours differ in their fate.

The nodes are those of the finest grid. Cells begin with the coarsest size. The corners of all cells are computed; those
whose corners differ are split, and so on down to the finest ones. Between the corners of the others values are
interpolated. A cell is a row and a column of its first corner; all cells at a time have one size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from chilopod.analysis.growth import growth_rates
from chilopod.analysis.map_axes import Plane
from chilopod.errors import ChilopodError
from chilopod.frozen import Array
from chilopod.progress import Progress, part
from chilopod.robot import Robot

GROWTH, FREQUENCY, ERROR, UNSTABLE, FATE = range(5)
_COARSE = 12  # cells along an axis, at least
_AT_ONCE = 20_000  # nodes between two savings


class Grid:
    """Nodes of the finest grid at SI values ``x``, shape (columns,), and ``y``, shape (rows,), of which those are
    ``computed``, shape (rows, columns), whose cell is not uniform. ``values`` are growth, frequency, error, unstable
    and fate as of :class:`chilopod.analysis.growth.Growth`, shape (5, rows, columns); in uniform cells growth and
    frequency between the corners are interpolated."""

    def __init__(self, plane: Plane, points: int, keep: Callable[[Grid], None] = lambda grid: None) -> None:
        self.plane, self.keep = plane, keep
        step = 2 ** max(0, int(np.log2((points - 1) / _COARSE)))
        parts = -(-(points - 1) // step) * step
        self.x, self.y = plane.x.values(parts), plane.y.values(parts)
        self.step = tuple(1 if axis.whole else step for axis in (plane.y, plane.x))
        shape = self.y.size, self.x.size
        self.values, self.computed = np.full((5, *shape), np.nan), np.zeros(shape, dtype=bool)

    @property
    def unstable(self) -> Array:
        """Number of unstable multipliers, -1 without a result and NaN if not computed, shape (rows, columns)."""
        return np.where(self.computed, self.values[UNSTABLE], np.nan)

    def compute(self, nodes: NDArray[np.bool_], progress: Progress) -> None:
        """Compute those of the nodes that are not yet."""
        rows, columns = np.nonzero(nodes & ~self.computed)
        for first in range(0, rows.size, _AT_ONCE):
            j, i = rows[first : first + _AT_ONCE], columns[first : first + _AT_ONCE]
            robots = self.robots(self.x[i].tolist(), self.y[j].tolist())
            shown = part(progress, first / rows.size, min(1.0, (first + _AT_ONCE) / rows.size))
            self.values[:, j, i] = growth_rates(robots, j.size, shown)
            self.computed[j, i] = True
            if rows.size > 1:
                self.keep(self)

    def robots(self, xs: list[float], ys: list[float]) -> Iterator[Robot | ChilopodError]:
        """Robots at SI values, or the error that says why there is none."""
        for x, y in zip(xs, ys, strict=True):
            try:
                yield self.plane.at(x, y)
            except ChilopodError as error:
                yield error

    def refine(self, wanted: NDArray[np.bool_], progress: Progress) -> None:
        """Compute the corners of cells from coarse to fine, and split cells whose corners differ, and those that hold a
        finest cell that is wanted, shape (rows - 1, columns - 1)."""
        sy, sx = self.step
        rows, columns = (np.arange(0, axis.size - 1, step) for axis, step in ((self.y, sy), (self.x, sx)))
        cells = np.stack(np.meshgrid(rows, columns, indexing="ij"), -1).reshape(-1, 2)
        uniform: list[tuple[Array, int, int]] = []
        while cells.size:
            corners = _corners(cells, sy, sx)
            nodes = np.zeros_like(self.computed)
            nodes[corners] = True
            self.compute(nodes, progress)
            if max(sy, sx) == 1:
                break
            there = self.values[:, *corners]
            # The leading multiplier changes where one is real and the other is not.
            there = np.stack([there[UNSTABLE], there[FATE], there[FREQUENCY] > 0.0])
            split = (there != there[:, :1]).any(axis=(0, 1))
            split |= [wanted[j : j + sy, i : i + sx].any() for j, i in cells]
            uniform.append((cells[~split], sy, sx))
            half = max(1, sy // 2), max(1, sx // 2)
            parts = [(j, i) for j in range(0, sy, half[0]) for i in range(0, sx, half[1])]
            cells = (cells[split][:, None] + np.array(parts)).reshape(-1, 2)
            sy, sx = half
        # Cells of other sizes share nodes, which are computed by now.
        for cells, sy, sx in uniform:
            self._interpolate(cells, sy, sx)

    def _interpolate(self, cells: Array, sy: int, sx: int) -> None:
        """Interpolate within uniform cells between their corners."""
        v, u = np.meshgrid(np.arange(sy + 1) / sy, np.arange(sx + 1) / sx, indexing="ij")
        weights = np.stack([(1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u])
        corners = self.values[:, *_corners(cells, sy, sx)]
        inside = np.einsum("kcn,cvu->nkvu", corners, weights)
        inside[:, [UNSTABLE, FATE]] = corners[[UNSTABLE, FATE], 0].T[:, :, None, None]
        inside[:, ERROR] = np.nan
        for (j, i), block in zip(cells, inside, strict=True):
            place = np.s_[j : j + sy + 1, i : i + sx + 1]
            self.values[:, *place] = np.where(self.computed[place], self.values[:, *place], block)


def _corners(cells: Array, sy: int, sx: int) -> tuple[Array, Array]:
    """Rows and columns of the corners of cells of one size, shape (4, cells) each."""
    places = cells + np.array([(0, 0), (0, sx), (sy, 0), (sy, sx)])[:, None]
    return places[..., 0], places[..., 1]
