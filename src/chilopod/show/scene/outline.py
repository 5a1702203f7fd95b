"""The chain of modules seen from above."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch
from matplotlib.transforms import Affine2D
from numpy.typing import ArrayLike

from chilopod.frozen import Array
from chilopod.kinematics import directions, module_centres, module_headings
from chilopod.show import style

SLIMNESS = 0.36
"""Width of a drawn module over its length; the robot file has none."""


def chain(angles: ArrayLike, length: float) -> tuple[Array, Array, Array]:
    """Centres (N, 2), headings (N,) and joints (N-1, 2) of modules of one length with given joint angles (rad), about
    their mean position and heading."""
    headings = module_headings(0.0, angles)
    headings -= headings.mean()
    centres = module_centres(np.zeros(2), headings, length)
    centres -= centres.mean(axis=0)
    return centres, headings, (centres - 0.5 * length * directions(headings)[0])[:-1]


def turned_about_tail(centres: Array, headings: Array, joints: Array) -> tuple[Array, Array, Array]:
    """Chain with its last module at the origin, pointing along x."""
    angle = -headings[-1]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return (centres - centres[-1]) @ turn.T, headings + angle, (joints - centres[-1]) @ turn.T


def draw_modules(axes: Axes, centres: Array, headings: Array, length: float, **look: Any) -> None:
    """Draw modules as rounded boxes; `look` as for a patch."""
    gap, width = 0.04 * length, SLIMNESS * length
    corner, shape = (-0.5 * length + gap, -0.5 * width), f"round,pad=0,rounding_size={0.4 * width}"
    for (x, y), heading in zip(centres, headings, strict=True):
        box = FancyBboxPatch(corner, length - 2.0 * gap, width, boxstyle=shape, **look)
        box.set_transform(Affine2D().rotate(heading).translate(x, y) + axes.transData)
        axes.add_patch(box)


def draw_spines(axes: Axes, spines: Array) -> None:
    """Draw bodies (moments, points, 2) as lines with their joints, and as a larger dot the centre of module 1, from
    which distances are measured."""
    look: dict[str, Any] = {"alpha": 0.35, "linewidth": 2.5, "markersize": 3, "markevery": slice(1, -1), "zorder": 2}
    for spine in spines:
        axes.plot(spine[:, 0], spine[:, 1], "-o", color=style.BLACK, **look)
        axes.plot(*spine[:2].mean(axis=0), "o", color=style.BLACK, markersize=4.5, zorder=4)


def draw_joints(axes: Axes, joints: Array, color: str, size: float = 4.0) -> None:
    """Draw yaw joints as dots."""
    axes.plot(joints[:, 0], joints[:, 1], "o", color="white", markeredgecolor=color, markersize=size, zorder=4)


def draw_heading(axes: Axes, centre: Array, heading: float, length: float, color: str) -> None:
    """Draw the arrow that says which end is the front."""
    ahead = np.array([np.cos(heading), np.sin(heading)])
    style.arrow(axes, tuple(centre + 0.6 * length * ahead), tuple(centre + 1.15 * length * ahead), color=color, lw=1.6)
