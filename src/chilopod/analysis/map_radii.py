"""Radii of the curved walks on a map, on a coarse lattice of its values."""

from __future__ import annotations

import numpy as np

from chilopod.analysis.growth import FATES, Fate
from chilopod.analysis.map_axes import DERIVED, Plane
from chilopod.analysis.map_grid import FATE, Grid
from chilopod.analysis.parameters import ALL
from chilopod.analysis.quantities import Measured, Onset
from chilopod.errors import ChilopodError, ParameterError
from chilopod.frozen import Array
from chilopod.progress import Progress

_LATTICE = 24  # values along an axis
_BRANCHES = 12  # that are followed from the onset, a few seconds each, before other radii are left out


def check_radius(plane: Plane) -> None:
    """Refuse a plane on which no branch of curved walks can be followed."""
    _number(plane)


def radii(plane: Plane, grid: Grid, progress: Progress) -> tuple[Array, list[str]]:
    """Radius of the curved walk that leaves the straight one, m, shape (rows, columns): NaN off the lattice, where the
    robot does not bend, and where no curved walk is found, with a sentence on how many these are."""
    bends = grid.values[FATE] == FATES.index(Fate.BENDS)
    found, measured, lost = np.full(bends.shape, np.nan), Measured(_number(plane)), 0
    rows, columns = (np.unique(np.linspace(0, size - 1, min(size, _LATTICE)).astype(int)) for size in bends.shape)
    nodes = []
    for j in rows.tolist():
        own = columns[bends[j, columns]].tolist()
        # From the onset on, so that each walk is near the last.
        nodes += [(j, i) for i in (own if bends[j, -1] else own[::-1])]
    for done, (j, i) in enumerate(nodes):
        progress(done / len(nodes), f"{done} radii")
        if measured.branches < _BRANCHES:
            try:
                found[j, i] = measured.radius(plane.at(float(grid.x[i]), float(grid.y[j])))
            except ChilopodError:
                lost += 1
        else:
            lost += 1
    return found, [f"{lost} of {len(nodes)} radii are not found"] if lost else []


def _number(plane: Plane) -> Onset:
    """Number of an axis along which a robot bends."""
    for axis in (plane.x, plane.y):
        if axis.path not in DERIVED and not axis.whole:
            return Onset(axis.path, None if axis.path.startswith(ALL) else (axis.low, axis.high))
    said, allowed = "must be left out of this map", "maps with a number of the robot on an axis"
    raise ParameterError(said, field="radius", allowed=allowed)
