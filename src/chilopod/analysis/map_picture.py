"""Picture of a map: what becomes of a disturbance in colours, growth rates or frequencies, and the curves over it.

:func:`draw` makes the picture without a legend; :func:`keys` has the entries of one, so that pictures can share it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod.analysis.growth import FATES, Fate
from chilopod.errors import known_names
from chilopod.frozen import Array
from chilopod.notebook import axes_for
from chilopod.stability import Kind

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chilopod.analysis.map_curves import MapCurve

SHOWN = {
    "kind": "What becomes of a disturbance",
    "growth": "Growth rate of the leading disturbance (1/s)",
    "frequency": "Frequency of the leading disturbance (rad/s)",
    "radius": "Radius of the curved walk (m)",
    "criticality": "Coefficient along the curves: gentle below 0",
}
"""Titles of the pictures of a map."""

# Okabe and Ito (2008), pale; what is stable is nearly white.
_COLORS = {
    Fate.STRAIGHT: "#f4f4f4",
    Fate.BENDS: "#efb44d",
    Fate.UNDULATES: "#7cc3e8",
    Fate.ALTERNATES: "#d9a0c0",
    Fate.UNDECIDED: "#ffffff",
    Fate.INVALID: "#bdbdbd",
    Fate.FAILED: "#6f6f6f",
}
_CURVES = {Kind.PITCHFORK: "#1a1a1a", Kind.NEIMARK_SACKER: "#0072b2", Kind.FOLD: "#d55e00"}
_OWN = {Kind.FOLD: (":", "fold of curved walks"), Kind.TRANSCRITICAL: ("-.", Kind.TRANSCRITICAL.label)}
_MARK = "#d55e00"


def draw(found: Any, axes: Axes | None, show: str) -> Axes:
    """Draw a :class:`StabilityMap` on axes of matplotlib or on new ones, see its ``plot``; without a legend."""
    known_names([show], SHOWN, "show", "must be a picture")
    axes = axes_for(axes)
    x, y = found.x.shown(found.x_values), found.y.shown(found.y_values)
    if show in ("kind", "criticality"):
        from matplotlib.colors import ListedColormap

        look: dict[str, Any] = {"cmap": ListedColormap([_COLORS[fate] for fate in FATES]), "vmin": -0.5}
        axes.pcolormesh(x, y, found.fate, shading="nearest", rasterized=True, vmax=len(FATES) - 0.5, **look)
        if (found.folded > 0.0).any():
            axes.contourf(x, y, np.nan_to_num(found.folded), levels=[0.5, 1.5], colors="none", hatches=["////"])
    else:
        _field(axes, x, y, found, show)
    if show == "criticality":
        _coefficients(axes, found)
    for curve in found.curves:
        if show != "criticality" or not np.isfinite(curve.coefficient).any():
            _curve(axes, found, curve)
    for point in found.special:
        at = (axis.shown(value) for axis, value in zip((found.x, found.y), point.values, strict=True))
        axes.plot(*at, "D", color=_MARK, markeredgecolor="white", markersize=7, zorder=6, label="codimension two")
    half = [np.array([-0.5, 0.5]) * axis.whole for axis in (found.x, found.y)]
    axes.set(xlabel=found.x.label, ylabel=found.y.label, title=SHOWN[show])
    axes.set(xlim=x[[0, -1]] + half[0], ylim=y[[0, -1]] + half[1])
    return axes


def keys(found: Any, axes: Axes) -> list[Any]:
    """Handles of a legend: colours of the fates that occur, and each kind of line and point on the axes once."""
    from matplotlib.patches import Patch

    patches = [Patch(facecolor=_COLORS[fate], edgecolor="#767676", label=fate.label) for fate in found.shares]
    if (found.folded > 0.0).any():
        patches.append(Patch(facecolor="none", edgecolor="#767676", hatch="////", label="curved walks too"))
    handles, labels = axes.get_legend_handles_labels()
    return [*patches, *dict(zip(labels, handles, strict=True)).values()]


def _field(axes: Axes, x: Array, y: Array, found: Any, show: str) -> None:
    """Colours of growth rates, red where a disturbance grows, of frequencies or of radii; grey where there is none."""
    from matplotlib.colors import LogNorm, TwoSlopeNorm

    axes.set_facecolor(_COLORS[Fate.INVALID])
    values = np.where(found.frequency > 0.0, found.frequency, np.nan) if show == "frequency" else getattr(found, show)
    if show == "radius":
        rows, columns = (np.flatnonzero(np.isfinite(values).any(axis=axis)) for axis in (1, 0))
        x, y, values = x[columns], y[rows], values[np.ix_(rows, columns)]
    inside = values[np.isfinite(values)]
    if not inside.size:
        return
    if show == "growth":
        # One side far longer than the other would leave no colours for it.
        most = float(np.percentile(np.abs(inside), 98.0)) or 1.0
        look: dict[str, Any] = {"cmap": "RdBu_r", "norm": TwoSlopeNorm(0.0, -most, most)}
    else:
        look = {"cmap": "viridis", "norm": LogNorm() if show == "radius" else None}
    mesh = axes.pcolormesh(x, y, np.ma.masked_invalid(values), shading="nearest", rasterized=True, **look)
    assert axes.figure is not None
    bar = axes.figure.colorbar(mesh, ax=axes, extend="both" if show == "growth" else "neither")
    if show == "radius":
        for formatter in (bar.ax.yaxis.set_major_formatter, bar.ax.yaxis.set_minor_formatter):
            formatter("{x:.2g}")


def _coefficients(axes: Axes, found: Any) -> None:
    """Points of the curves in colours of their coefficients, blue where supercritical and red where subcritical."""
    from matplotlib.colors import SymLogNorm

    chosen = [curve for curve in found.curves if np.isfinite(curve.coefficient).any()]
    if not chosen:
        return
    values = np.concatenate([curve.values for curve in chosen])
    coefficients = np.concatenate([curve.coefficient for curve in chosen])
    sizes = np.abs(coefficients[np.isfinite(coefficients)])
    norm = SymLogNorm(float(np.median(sizes)), vmin=-float(sizes.max()), vmax=float(sizes.max()))
    x, y = (axis.shown(values[:, k]) for k, axis in enumerate((found.x, found.y)))
    look: dict[str, Any] = {"c": coefficients, "cmap": "RdBu_r", "norm": norm, "edgecolors": "#767676", "zorder": 5}
    drawn = axes.scatter(x, y, s=40, linewidths=0.5, label="curves", **look)
    assert axes.figure is not None
    axes.figure.colorbar(drawn, ax=axes)


def _curve(axes: Axes, found: Any, curve: MapCurve) -> None:
    """A curve, dashed where it is subcritical; dash-dotted of transcritical points, which have no criticality."""
    x, y = (axis.shown(curve.values[:, k]) for k, axis in enumerate((found.x, found.y)))
    color, label = _CURVES.get(curve.kind, "#009e73"), curve.kind.label
    if not curve.line:
        axes.plot(x, y, "o", color=color, label=label)
        return
    subcritical = np.nan_to_num(curve.coefficient, nan=-1.0) > 0.0
    for style, chosen, name in (("-", ~subcritical, label), ("--", subcritical, f"{label}, subcritical")):
        style, name = _OWN.get(curve.kind, (style, name))
        # A piece between two points belongs to the side of its first one; at a turning point both sides meet.
        shown = chosen | np.append(False, chosen[:-1])
        if chosen.any():
            axes.plot(np.where(shown, x, np.nan), y, style, color=color, label=name, linewidth=2.0)
