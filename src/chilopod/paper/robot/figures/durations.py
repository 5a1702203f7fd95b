"""Dependence of the whole robot's results on the duration of its walks."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from chilopod.paper import printed, statements
from chilopod.paper.compliance import errorbars
from chilopod.paper.robot.rows import duration_rows
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, typeset

_LAYOUTS = (style.Layout("ABC", 3.6), style.Layout("A;B;C", 9.6))
_STYLES = tuple(zip((style.BLUE, style.VERMILLION, style.GREEN, style.ORANGE), "os^D", strict=True))


def panel(data: xr.Dataset) -> Panel:
    """Onset, radii and shares of curved walks over the duration of the walks."""
    times = listing(f"{each:g}" for each in data.duration.values)
    said = "; ".join(f"{row.statement.quantity.partition(',')[0]} {row.result.words}" for row in duration_rows(data))
    return Panel(
        name="robot-durations",
        title="The robot in three dimensions: what if its walks had been shorter",
        draw=lambda narrow: _draw(data, narrow),
        alt=f"A: where curved walks set in, by walks of {times} s. B: the two radii that the paper prints. C: the "
        "share of walks that curve at some springs.",
        text=(
            "The paper does not say how long its robot walked before the angles were averaged. These are the walks of "
            f"the base series, {data.attrs['repeats']} at each spring, cut after {times}\u00a0s and judged as before; "
            f"a bend takes its time, the longer the closer {k(1)} is to the onset.",
            f"What the table asks, and whether it is met: {typeset(said)}.",
        ),
        data=data,
    )


def _draw(data: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(*_LAYOUTS, narrow)
    times = data.duration.values
    axes["A"].axhspan(printed.ONSET.band.low, printed.ONSET.band.high, color=style.PALE, zorder=0)
    errorbars(axes["A"], times, data.onset.values, data.onset_error.values, style.BLUE, "o")
    axes["A"].plot(times, data.onset.values, color=style.BLUE, lw=1.0)
    axes["A"].set(ylabel=f"onset ({SPRING_UNIT})", title="A  Where curved walks set in")
    for (spring, radius), (color, marker) in zip(printed.RADII.items(), _STYLES, strict=False):
        at = data.sel(spring=spring)
        axes["B"].axhspan(radius.band.low, radius.band.high, color=style.PALE, zorder=0)
        label = f"{k(1)} = {spring:g}"
        errorbars(axes["B"], times, at.axis_radius.values, at.axis_radius_error.values, color, marker, label)
        axes["B"].plot(times, at.axis_radius.values, color=color, lw=1.0)
    axes["B"].set(ylabel="radius of the body axis (m)", title="B  Radius")
    springs = sorted({*printed.RADII, *statements.SLOWEST.values()})
    for spring, (color, marker) in zip(springs, _STYLES, strict=False):
        share = 100.0 * data.curved.sel(spring=spring).values
        axes["C"].plot(times, share, color=color, marker=marker, lw=1.0, label=f"{k(1)} = {spring:g}")
    axes["C"].set(ylabel="walks that curve (%)", ylim=(-4.0, 104.0), title="C  Share that curves")
    for letter, each in axes.items():
        each.set(xlabel="walks last (s)", xlim=(0.0, 1.05 * times.max()))
        if letter != "C":
            each.set_ylim(0.0, 1.1 * max(each.dataLim.y1, np.nextafter(0.0, 1.0)))
        if letter != "A":
            each.legend(loc="best")
        style.grid(each)
    return figure
