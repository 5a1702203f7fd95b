"""Walks as they show themselves in notebooks: their paths over the floor."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.notebook import COLORS, Line, Mark, plot
from chilopod.steering import ARRIVAL_RADIUS

_MOST = 12  # walks that are drawn
_SIZE = (560.0, 340.0)  # px


def paths(record: xr.Dataset) -> str:
    """SVG: the way of module 1 in every walk of a record, the first dozen of them, and its targets."""
    drawn = record.isel(robot=slice(_MOST))
    lines = [
        Line([(float(x), float(y)) for x, y in way], COLORS[index % len(COLORS)])
        for index, way in enumerate(drawn.position.transpose("robot", "time", "axis").values)
    ]
    marks = [Mark(float(x), float(y), ARRIVAL_RADIUS) for x, y in _targets(drawn) if np.isfinite(x + y)]
    count = record.sizes["robot"]
    alt = f"paths of {'a walk' if count == 1 else f'{count} walks'} from above"
    if count > _MOST:
        alt += f", the first {_MOST} drawn"
    return plot(lines, marks, x="x (m)", y="y (m)", alt=alt, size=_SIZE, equal=True)


def _targets(record: xr.Dataset) -> np.ndarray:
    """Places on the floor, shape (targets, 2), each once."""
    if "goal_place" in record:
        places = record.goal_place.transpose("robot", "goal", "axis").values
    elif "target" in record:
        places = record.target.transpose(..., "robot", "axis").values
    else:
        places = np.empty((0, 2))
    return np.unique(places.reshape(-1, 2), axis=0)
