"""Undulating walks below the Neimark-Sacker point: amplitude and frequency of the body's swing, beside the normal
form."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import number, spring


def panel(data: xr.Dataset) -> Panel:
    """The figure of :func:`chilopod.analysis.undulation.undulating_walks`."""
    near = data.isel(distance=int(data.distance.values.argmin()))
    off = 100.0 * abs(float(near.amplitude / near.predicted_amplitude) - 1.0)
    return Panel(
        name="undulation",
        title="Undulating walks of uniform springs",
        draw=_draw(data),
        alt="Amplitude and frequency of the settled undulation over the springs, and how far the normal form is off, "
        "in proportion to the distance from the point.",
        text=(
            f"Below {spring(data.attrs['value'], 5)} the body swings. The amplitude grows as the square root of the "
            f"distance and the frequency moves in proportion to it; {number(100.0 * float(near.distance), 2)} % below "
            f"the point the normal form misses the simulated amplitude by {number(off, 2)} %.",
        ),
        data=data,
    )


@style.in_layouts(style.Layout("ABC", 3.7), style.Layout("A;B;C", 9.5))
def _draw(axes: style.Mosaic, data: xr.Dataset) -> None:
    data = data.sortby("distance")
    distance, k = data.distance.values, data.k.values
    label = f"all springs ({data.attrs['unit'].replace('*', '·')})"

    # The prediction between the simulated springs: square root and straight line through the point itself.
    fine = np.linspace(0.0, distance[-1], 200)
    root = np.interp(fine, np.append(0.0, distance), np.append(0.0, data.predicted_amplitude.values**2)) ** 0.5
    axes["A"].plot(data.attrs["value"] * (1.0 - fine), np.rad2deg(root), color=style.ORANGE, label="normal form")
    _dots(axes["A"], k, np.rad2deg(data.amplitude.values), "simulated")
    axes["A"].set(ylabel="amplitude, norm over the joints (deg)", title="How far the body swings")

    first = data.attrs["frequency_rad_s"]
    at = np.append(data.attrs["value"], k)
    axes["B"].plot(at, np.append(first, data.predicted_frequency.values), color=style.ORANGE, label="normal form")
    small = np.append(first, data.linear_frequency.values)
    axes["B"].plot(at, small, color=style.GREY, linestyle=(0, (4, 2)), label="small undulation")
    _dots(axes["B"], k, data.frequency.values, "simulated")
    axes["B"].set(ylabel="frequency (rad/s)", title="How fast")

    amplitude_off = np.abs(data.predicted_amplitude.values / data.amplitude.values - 1.0)
    shift = data.frequency.values - first
    frequency_off = np.abs((data.predicted_frequency.values - first) / shift - 1.0)
    axes["C"].loglog(100 * distance, 100 * amplitude_off, "o-", color=style.BLUE, label="amplitude")
    axes["C"].loglog(100 * distance, 100 * frequency_off, "s-", color=style.GREEN, label="change of frequency")
    proportion = 70 * amplitude_off[0] * distance / distance[0]
    axes["C"].loglog(100 * distance, proportion, color=style.GREY, linestyle=(0, (1, 2)), label="in proportion")
    axes["C"].set(ylabel="normal form is off by (%)", title="How sure the normal form is")
    look: dict[str, Any] = {"color": style.VERMILLION, "label": "Neimark-Sacker", "zorder": 5, "clip_on": False}
    for letter, value in (("A", 0.0), ("B", first)):
        axes[letter].plot(data.attrs["value"], value, "D", **look)
    places = {"A": "lower left", "B": "best", "C": "upper left"}
    for letter, each in axes.items():
        below = "distance below the point (%)" if letter == "C" else label
        style.finish(each, legend=places[letter], xlabel=below)


def _dots(axes: Axes, x: np.ndarray, y: np.ndarray, name: str) -> None:
    axes.plot(x, y, linestyle="none", marker="o", color=style.BLUE, label=name, zorder=4)
