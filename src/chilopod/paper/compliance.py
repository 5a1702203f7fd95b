"""Parts that figures over the compliance 1/k1 have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from chilopod.paper.printed import Band
from chilopod.paper.scatter import mean_and_error
from chilopod.show import style
from chilopod.show.words import SPRING_UNIT, k, typeset

Array = NDArray[np.float64]

INVERSE_UNIT = "deg/(N·mm)"


def errorbars(axes: Axes, x: Array, y: Array, error: Array, color: str, marker: str, name: str = "") -> None:
    """Means with standard errors."""
    axes.errorbar(
        x,
        y,
        error,
        color=color,
        marker=marker,
        markersize=5,
        linestyle="none",
        capsize=2.5,
        elinewidth=1.2,
        label=name or None,
        zorder=4,
    )


def means(values: Array, here: NDArray[np.bool_] | bool = True) -> tuple[Array, Array]:
    """Mean and standard error at every spring (row) of the trials chosen; the error is NaN for a single one."""
    mean, error = np.array([mean_and_error(row) for row in np.where(here, values, np.nan)]).T
    return mean, error


def over_compliance(axes: Axes, springs: tuple[float, ...]) -> None:
    """Label an axis of 1/k1, with a second scale along its top: the springs themselves."""
    axes.set_xlabel(f"1/{k(1)} ({INVERSE_UNIT})")
    top = axes.secondary_xaxis("top", functions=(_inverse, _inverse))
    top.set_xticks(springs, [f"{value:g}" for value in springs])
    top.tick_params(length=3, pad=1)
    top.set_xlabel(f"{k(1)} ({SPRING_UNIT})", labelpad=6, fontsize=style.SMALL)
    top.spines["top"].set_visible(False)


def _inverse(x: ArrayLike) -> Array:
    return 1.0 / np.maximum(np.asarray(x, dtype=np.float64), 1e-9)


def draw_times(axes: Axes, walk: xr.Dataset) -> tuple[float, float]:
    """Joint angles (deg) over time; returns the limits of the axis."""
    for joint, (color, _) in zip(walk.joint.values, style.joint_styles(walk.sizes["joint"]), strict=True):
        angle = np.rad2deg(walk.joint_angle.sel(joint=joint).values)
        axes.plot(walk.time.values, angle, color=color, lw=0.9, label=f"joint {joint}")
    axes.set(xlabel="time (s)", ylabel="yaw joint angle (deg)")
    style.grid(axes)
    axes.margins(x=0.0)
    return axes.get_ylim()


def draw_asked(axes: Axes, asked: Sequence[tuple[str, float, Band]]) -> None:
    """Band of what agrees with the paper's robot, a row for each printed number, under its name."""
    for row, (_, paper, band) in enumerate(asked):
        axes.plot([band.low, band.high], [row, row], color=style.PALE, lw=9, zorder=1, solid_capstyle="butt")
        axes.plot(paper, row, "D", color=style.ORANGE, markersize=8, label=None if row else "robot, paper")
    axes.set_yticks(range(len(asked)), [typeset(name) for name, *_ in asked])
    axes.set_ylim(len(asked) - 0.5, -0.8)
    style.grid(axes, "x")
