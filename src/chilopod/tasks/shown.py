"""Walks as they show themselves in notebooks: their paths over the floor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from chilopod.notebook import axes_for, picture
from chilopod.steering import ARRIVAL_RADIUS
from chilopod.tasks.runs import Runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST = 12  # walks that are drawn


class Pathed(Runs):
    """Base of walks that have a record, and are drawn as paths over the floor."""

    if TYPE_CHECKING:

        @property
        def record(self) -> xr.Dataset: ...

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the path of module 1 in every walk, the first dozen of them, and the targets."""
        axes = axes_for(axes)
        draw_paths(axes, self.record)
        return axes

    def _picture(self) -> str:
        count = self.record.sizes["robot"]
        alt = f"paths of {'a walk' if count == 1 else f'{count} walks'} from above"
        return picture(self.plot, alt if count <= _MOST else f"{alt}, the first {_MOST} drawn")


def draw_paths(axes: Axes, record: xr.Dataset) -> None:
    """Draw the path of module 1 in every walk of a record, the first dozen of them, and the targets."""
    from matplotlib.patches import Circle

    drawn = record.isel(robot=slice(_MOST))
    for way in drawn.position.transpose("robot", "time", "axis").values:
        axes.plot(*way.T)
    for x, y in _targets(drawn):
        if np.isfinite(x + y):
            axes.add_patch(Circle((x, y), ARRIVAL_RADIUS, color="C2", alpha=0.35))
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")


def _targets(record: xr.Dataset) -> np.ndarray:
    """Places on the floor, shape (targets, 2), each once."""
    if "goal_place" in record:
        places = record.goal_place.transpose("robot", "goal", "axis").values
    elif "target" in record:
        places = record.target.transpose(..., "robot", "axis").values
    else:
        places = np.empty((0, 2))
    return np.unique(places.reshape(-1, 2), axis=0)
