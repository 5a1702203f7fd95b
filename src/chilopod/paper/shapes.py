"""Shapes that figures of the paper have in common: trials over the compliance 1/k1, beside the paper's numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from chilopod.analysis.square_root import SquareRootFit
from chilopod.frozen import Array
from chilopod.paper import printed
from chilopod.paper.printed import Band
from chilopod.show import style
from chilopod.show.style import finish as finish
from chilopod.show.words import SPRING_UNIT, k, typeset
from chilopod.statistics import means

INVERSE_UNIT: Final = "deg/(N·mm)"
DASHED: Final[Any] = (0, (4, 2))
DOTTED: Final[Any] = (0, (1, 1.5))

WALKS: Final = (style.Layout("AB;CD", 7.4), style.Layout("A;B;C;D", 13.6))
"""Layouts of the paper's Fig. "curved": two examples, the bend, and the radius."""

JOINTS: Final = (style.Layout("A", 4.0), style.Layout("A", 4.4))
"""Layouts of the paper's Fig. "absolute"."""


def errorbars(
    axes: Axes, x: Array, y: Array, error: Array, color: str, marker: str, name: str = "", *, joined: bool = False
) -> None:
    """Means with standard errors, joined by thin lines if asked for."""
    look: dict[str, Any] = {"color": color, "marker": marker, "markersize": 5, "capsize": 2.5, "elinewidth": 1.2}
    axes.errorbar(x, y, error, linestyle="-" if joined else "none", lw=1.0, label=name or None, zorder=4, **look)


def over_compliance(axes: Axes, springs: Sequence[float], name: str = k(1)) -> None:
    """Label an axis of 1/k1, with a second scale along its top: the springs themselves."""
    axes.set_xlabel(f"1/{name} ({INVERSE_UNIT})")
    top = axes.secondary_xaxis("top", functions=(_inverse, _inverse))
    top.set_xticks(springs, [f"{value:g}" for value in springs])
    top.tick_params(length=3, pad=1)
    top.set_xlabel(f"{name} ({SPRING_UNIT})", labelpad=6, fontsize=style.SMALL)
    top.spines["top"].set_visible(False)


def _inverse(x: ArrayLike) -> Array:
    return 1.0 / np.maximum(np.asarray(x, dtype=np.float64), 1e-9)


def draw_examples(axes: style.Mosaic, examples: xr.Dataset) -> None:
    """Joint angles (deg) over time of a straight walk in A and of a curved one in B, on one scale."""
    for letter, what, spring in zip("AB", ("Straight", "Curved"), examples.spring.values, strict=True):
        for joint, (color, _) in zip(examples.joint.values, style.joint_styles(examples.sizes["joint"]), strict=True):
            angle = np.rad2deg(examples.joint_angle.sel(spring=spring, joint=joint).values)
            axes[letter].plot(examples.time.values, angle, color=color, lw=0.9, label=f"joint {joint}")
        title = f"{letter}  {what}, {k(1)} = {spring:g} {SPRING_UNIT}"
        finish(axes[letter], xlabel="time (s)", ylabel="yaw joint angle (deg)", title=title)
        axes[letter].margins(x=0.0)
    low, high = zip(*(axes[letter].get_ylim() for letter in "AB"), strict=True)
    for letter in "AB":
        axes[letter].set_ylim(min(low), max(high))
    axes["A"].legend(loc="upper left", ncols=2 if axes.narrow else 3)


def draw_fork(
    axes: Axes,
    data: xr.Dataset,
    sides: Mapping[str, tuple[str, str, str]],
    fit: SquareRootFit | None,
    law: tuple[str, str],
) -> None:
    """Mean angle of joint 1 over 1/k1 of trials over spring, repeat and joint, with colour, marker and name of the
    trials in each direction, and the square-root law through them, if there is one, with its colour and name."""
    inverse, angles = 1.0 / data.spring.values, np.rad2deg(data.mean_angle.sel(joint=1).values)
    for side, look in sides.items():
        errorbars(axes, inverse, *means(angles, data.direction.values == side), *look)
    if fit:
        along = np.linspace(1.0 / fit.critical, inverse.max(), 200)
        for sign, name in ((1.0, law[1]), (-1.0, None)):
            axes.plot(along, sign * np.rad2deg(fit.angle(along)), color=law[0], linestyle=DASHED, lw=1.3, label=name)
    finish(axes, legend="upper left", ylabel="mean angle of joint 1 (deg)", title="C  Joint 1")


def draw_robot_radii(axes: Axes, places: Sequence[float]) -> None:
    """The radii that the paper prints of its robot, and labels of an axis of radii."""
    radii = [radius.value for radius in printed.RADII.values()]
    look: dict[str, Any] = {"color": style.ORANGE, "markerfacecolor": "none", "markeredgewidth": 1.8, "markersize": 9}
    axes.plot(places, radii, "D", label="robot, paper", zorder=5, **look)
    finish(axes, legend="upper right", ylabel="radius of the body axis (m)", title="D  Radius")


def draw_joints(axes: Axes, data: xr.Dataset, here: NDArray[np.bool_] | bool, along: Array, angles: Array) -> None:
    """Mean absolute angle of every joint over 1/k1, of the trials chosen, on lines through angles (deg, shape (points,
    joint)) at values of 1/k1."""
    inverse = 1.0 / data.spring.values
    styles = style.joint_styles(data.sizes["joint"])
    for joint, line, (color, marker) in zip(data.joint.values, np.abs(angles).T, styles, strict=True):
        axes.plot(along, line, color=color, lw=1.2)
        mean, error = means(np.abs(np.rad2deg(data.mean_angle.sel(joint=joint).values)), here)
        errorbars(axes, inverse, mean, error, color, marker, f"joint {joint}")
    finish(axes, legend="upper left", ylabel="mean absolute angle (deg)")


def draw_bands(axes: Axes, asked: Sequence[tuple[str, float, Band]]) -> None:
    """Band that agrees with the paper's robot, a row for each printed number, under its name."""
    for row, (_, paper, band) in enumerate(asked):
        axes.plot([band.low, band.high], [row, row], color=style.PALE, lw=9, zorder=1, solid_capstyle="butt")
        axes.plot(paper, row, "D", color=style.ORANGE, markersize=8, label=None if row else "robot, paper")
    axes.set_yticks(range(len(asked)), [typeset(name) for name, *_ in asked])
    finish(axes, "x", ylim=(len(asked) - 0.5, -0.8))
