"""A branch of curved walks: bend, radius and cost over the parameter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from chilopod.show import style
from chilopod.show.panel import Panel

_LINES: dict[str, Any] = {
    "stable": "-",
    "unstable": (0, (4, 2)),
    "undecided": (0, (4, 2, 1, 2)),
    "out of range": (0, (1, 2)),
}


def panel(data: xr.Dataset) -> Panel:
    """The figure of a branch from :func:`chilopod.analysis.branch.curved_walks`."""
    shown = data.attrs["varied"]
    return Panel(
        name="branch",
        title=f"Curved walks over {shown}",
        draw=_draw(data),
        alt=f"Mean joint angles, radii of axis and path, and cost of transport over {shown}; the legend names lines "
        "of parts that are not stable.",
        text=(),
        data=data,
    )


def table(data: xr.Dataset) -> xr.Dataset:
    """Branch with one line per point and one column per joint, without the data for continuing it, which netCDF has."""
    angles = {f"mean_angle_{joint}": data.mean_angle.sel(joint=joint, drop=True) for joint in data.joint.values}
    single = data[[name for name in data.data_vars if data[name].dims == ("point",)]].drop_vars("parameter_si")
    found = single.assign(angles)
    found.attrs = {name: value for name, value in data.attrs.items() if name != "robot_toml"}
    return found


@style.in_layouts(style.Layout("ABC", 3.7), style.Layout("A;B;C", 9.5))
def _draw(axes: style.Mosaic, data: xr.Dataset) -> None:
    x = data.parameter.values
    verdicts = _between(data)
    unit = data.parameter.attrs["units"].replace("*", "·")
    label = f"{data.attrs['varied']} ({unit})"

    for joint, (color, _) in zip(data.joint.values, style.joint_styles(data.sizes["joint"]), strict=True):
        angle = np.rad2deg(data.mean_angle.sel(joint=joint).values)
        _curve(axes["A"], x, angle, verdicts, color, f"joint {joint}")
    axes["A"].set(ylabel="mean joint angle (deg)", title="Bend")

    _curve(axes["B"], x, data.axis_radius.values, verdicts, style.BLUE, "body axis, (N−1) L / Σ|θ|")
    _curve(axes["B"], x, data.path_radius.values, verdicts, style.ORANGE, "path of module 1")
    # The radius grows without bound towards the pitchfork; what matters is what a robot can turn in.
    axes["B"].set(ylim=(0.0, 2.0), ylabel="radius (m)", title="Radius of the turn")

    _curve(axes["C"], x, data.cost_of_transport.values, verdicts, style.GREEN, "")
    axes["C"].set(ylabel="cost of transport (1)", title="What it costs")

    for each in axes.values():
        style.finish(each, xlabel=label)
    _mark(axes["A"], data)
    bottom, top = axes["A"].get_ylim()
    axes["A"].set_ylim(top=top + 0.4 * (top - bottom))  # room for the legend
    axes["A"].legend(loc="upper right", ncols=max(2, data.sizes["joint"] // 3))
    shown = {verdict for *_, verdict in stretches(verdicts)}
    if shown != {"stable"}:
        for verdict in sorted(shown):
            axes["B"].plot([], [], color=style.GREY, linestyle=_LINES[verdict], label=verdict)
    axes["B"].legend(loc="upper left")


def _between(data: xr.Dataset) -> list[str]:
    """Verdicts along a branch; at special points, where a multiplier is 1, that of the point before."""
    found: list[str] = []
    for verdict, special in zip(data.verdict.values, data.special.values, strict=True):
        found.append(found[-1] if found and special and verdict == "undecided" else str(verdict))
    return found


def _curve(
    axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64], verdicts: list[str], color: Any, name: str
) -> None:
    if name:
        axes.plot([], [], color=color, label=name)  # the legend names the colour, whatever the stability
    for first, last, verdict in stretches(verdicts):
        axes.plot(x[first : last + 1], y[first : last + 1], color=color, linestyle=_LINES[verdict])


def stretches(verdicts: Sequence[Any]) -> Iterator[tuple[int, int, Any]]:
    """First and last point of every stretch of equal verdicts; the next one starts where the last one ends."""
    first = 0
    # What a stretch is called is decided by its second point: its first may be the critical one in between.
    for index in range(1, len(verdicts)):
        if index == len(verdicts) - 1 or verdicts[index + 1] != verdicts[index]:
            yield first, index, verdicts[index]
            first = index


def _mark(axes: Axes, data: xr.Dataset) -> None:
    for special in sorted(set(data.special.values) - {""}):
        here, marker = data.special.values == special, {"pitchfork": "o", "fold": "s"}.get(special, "D")
        points = data.parameter.values[here], np.rad2deg(data.mean_angle.values[here, 0])
        axes.plot(*points, marker, color=style.VERMILLION, label=special, zorder=5)
