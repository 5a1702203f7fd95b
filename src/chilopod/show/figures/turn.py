"""One turn to a target: the path over the floor with the body on it, and the distance to the target."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from chilopod import units
from chilopod.show import style
from chilopod.show.figures.course import LAYOUTS, WAYS, bearing
from chilopod.show.scene.frames import body_frames
from chilopod.show.scene.outline import draw_spines
from chilopod.steering import ARRIVAL_RADIUS
from chilopod.tasks import Turn

_STILLS = 5
_NAMED = 4  # seeds of one colour


def draw(done: Turn, narrow: bool = False) -> Figure:
    """The figure; call it within :func:`chilopod.show.style.house_style`."""
    figure, axes = style.figure(*LAYOUTS, narrow)
    record = done.record[["position", "distance", "bearing", "target"]]
    walks = [
        walk.where(walk.time <= end, drop=True) if np.isfinite(end) else walk
        for walk, end in ((record.isel(robot=robot), end) for robot, end in enumerate(done.criteria.arrival))
    ]
    _floor(axes["A"], done, walks)
    axes["A"].set_title(title(done))
    for robot, walk in enumerate(walks):
        color = WAYS[robot % len(WAYS)]
        axes["B"].plot(walk.time, walk.distance, color=color)
        axes["C"].plot(walk.time, bearing(walk), color=color)
    axes["B"].axhline(ARRIVAL_RADIUS, color=style.GREY, linestyle=(0, (4, 2)), linewidth=1.2)
    style.note(
        axes["B"], "arrived below", (0.02, ARRIVAL_RADIUS), (0, 3), xycoords=("axes fraction", "data"), color=style.GREY
    )
    style.finish(axes["B"], ylim=(0.0, None), xlabel="time (s)", ylabel="target distance (m)")
    axes["C"].axhline(0.0, color=style.GREY, linewidth=0.8)
    style.finish(axes["C"], xlabel="time (s)", ylabel="target angle (deg)")
    return figure


def title(done: Turn) -> str:
    """Title of the picture."""
    spring = ""
    if done.stiffness is not None:
        which = "k1" if done.strategy.springs and done.strategy.springs.endswith("[0]") else "k"
        spring = f", {which} = {units.format(done.stiffness, 'N*mm/deg', digits=3).replace('*', '·')}"
    return f"{done.strategy.name}{spring}"


def _floor(axes: Axes, done: Turn, walks: Sequence[xr.Dataset]) -> None:
    """Paths to the target, the circle to it, and the first walk's body at several times."""
    record, target = done.record, done.target.position
    axes.set_aspect("equal", adjustable="datalim")
    if np.isfinite(done.target.radius):
        # From the origin along x; its centre lies on the target's side.
        side = np.sign(done.target.bearing)
        turned = np.linspace(0.0, 2.0 * abs(done.target.bearing), 200)
        radius = done.target.radius
        label = f"circle of {radius:.2f} m"
        x, y = radius * np.sin(turned), side * radius * (1.0 - np.cos(turned))
        axes.plot(x, y, color=style.GREY, linestyle=(0, (1, 2)), label=label)
    for robot, walk in enumerate(walks):
        place = walk.position.transpose("time", "axis").values
        name = _named(done.labels[robot :: len(WAYS)]) if robot < len(WAYS) else None
        axes.plot(place[:, 0], place[:, 1], color=WAYS[robot % len(WAYS)], label=name, zorder=3)
    end = float(done.criteria.arrival[0])
    if not np.isfinite(end):
        end = float(record.time[np.isfinite(record.heading.values[:, 0])][-1])
    draw_spines(axes, body_frames(record.isel(robot=[0]), np.linspace(0.0, end, _STILLS)).spine[:, 0])
    axes.add_patch(
        Circle((float(target[0]), float(target[1])), ARRIVAL_RADIUS, fill=False, ec=style.SCENE["target"], lw=1.5)
    )
    axes.plot(
        *target, "+", color=style.SCENE["target"], markersize=9, markeredgewidth=2, label="target", linestyle="none"
    )
    style.finish(axes, legend="best", xlabel="x (m)", ylabel="y (m)")


def _named(seeds: Sequence[str]) -> str:
    """Name of the paths of one colour, by the seeds of their walks."""
    said = ", ".join([*seeds[:_NAMED], *["…"] * (len(seeds) > _NAMED)])
    return f"module 1, seed {said}" if said != "-" else "path of module 1"
