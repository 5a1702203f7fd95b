"""Eight maps of the straight walk that a designer wants, with the critical springs that the scaling law predicts.

A :class:`Chart` says what a map shows. :func:`atlas` computes the maps of all :data:`CHARTS`, and :func:`panel` draws
them side by side. The sentences below them take their numbers from the curves of the maps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chilopod import analysis
from chilopod.analysis import StabilityMap
from chilopod.analysis.map_axes import Given, Plane
from chilopod.analysis.map_picture import draw, keys
from chilopod.analysis.parameters import K1, spring_scale
from chilopod.paper.atlas.scaling import CHAPTER, SCALING, predicted
from chilopod.paper.section import Context, Section
from chilopod.progress import Progress, part
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import number


@dataclass(frozen=True)
class Chart:
    """A map of the atlas: its vertical axis, sentences with places for the critical values at the lower and upper end
    of that axis and for the least and largest of them, its horizontal axis, k1 if that is on no axis (text with a
    unit), and True if all robots of the map have one shape, so that the scaling law holds."""

    y: Given
    words: str
    x: Given = (K1, "1 N*mm/deg", "30 N*mm/deg")
    k1: str | None = None
    scaled: bool = False


CHARTS = {
    "A": Chart(
        ("springs.stiffness[1:]", "2 N*mm/deg", "45 N*mm/deg"),
        "The stiffer the other springs are, the stiffer is the first spring at which the robot bends. Where they are "
        "soft, the body undulates, whatever the first spring is.",
        x=(K1, "1 N*mm/deg", "14 N*mm/deg"),
        scaled=True,
    ),
    "B": Chart(
        ("gait.stride", "10 mm", "60 mm"),
        "Longer strides at the same rhythm bend the robot with stiffer springs: {low} N·mm/deg at 10 mm, {high} at "
        "60 mm. Short strides make the onset sudden.",
        scaled=True,
    ),
    "C": Chart(
        ("gait.module_phase", "60 deg", "180 deg"),
        "From 60° to 180° the phase between modules hardly moves the onset, from {least} to {most} N·mm/deg. It "
        "decides whether the onset is gentle or sudden.",
    ),
    "D": Chart(
        ("modules", 3, 16),
        "From six modules on, more of the same modules hardly change the onset, as the front bends: {high} N·mm/deg at "
        "sixteen. Four modules bend with stiffer springs, three with softer ones ({low}).",
    ),
    "E": Chart(
        ("legs.forward_offset", "0 mm", "80 mm"),
        "Feet further ahead bend the robot with stiffer springs: {low} N·mm/deg at 0 mm, {high} at 80 mm. Feet near "
        "the middle of their modules make the onset sudden.",
    ),
    "F": Chart(
        ("legs.forward_offset", "0 mm", "80 mm"),
        "With all springs alike the robot undulates before it bends. Feet further ahead make it undulate with stiffer "
        "springs: {high} N·mm/deg at 80 mm.",
        x=("springs.stiffness", "1 N*mm/deg", "30 N*mm/deg"),
    ),
    "G": Chart(
        ("body.mass", "1 kg", "100 kg"),
        "With k1 = 12 N·mm/deg the robot bends on a floor of more friction than {low} N·s/m if it weighs 1 kg, and "
        "than {high} if it weighs 100. So a hundred times the mass changes that by a third.",
        x=("ground.friction", "20 N*s/m", "500 N*s/m"),
        k1="12 N*mm/deg",
        scaled=True,
    ),
    "H": Chart(
        ("speed", "0.02 m/s", "0.3 m/s"),
        "A spring that is safe at a slow walk bends a fast robot. The onset is at {low} N·mm/deg at 0.02 m/s and at "
        "{high} at 0.3 m/s.",
        scaled=True,
    ),
}
"""Maps by the letter of their axes."""

_LAW = 40  # most values on an axis, for the line of the law
_ROW, _ONE = 3.9, 3.6  # inches, height of a row of two maps, and of one


def atlas(context: Context, progress: Progress) -> dict[str, StabilityMap]:
    """The maps of :data:`CHARTS` by their letters; two of them if the report is tiny."""
    found, points, letters = {}, context.size.of(97, 49, 5), context.size.cut("".join(CHARTS), "BG")
    for row, letter in enumerate(letters):
        chart = CHARTS[letter]
        robot = context.robot if chart.k1 is None else context.robot.override(K1, chart.k1)
        share = part(progress, row / len(letters), (row + 1) / len(letters), f"map {letter}")
        found[letter] = analysis.map(robot, chart.x, chart.y, points=points, progress=share)
    return found


def words(letter: str, found: StabilityMap) -> str:
    """Sentences about a map, with its critical values on the curve at which the straight walk ends."""
    y = np.concatenate([curve.values[:, 1] for curve in found.curves])
    x = found.x.shown(np.concatenate([curve.values[:, 0] for curve in found.curves]))
    ends = x[np.isclose(y, found.y.low)], x[np.isclose(y, found.y.high)]
    low, high = (number(each.max(), 3) if each.size else "none" for each in ends)
    return CHARTS[letter].words.format(low=low, high=high, least=number(x.min(), 3), most=number(x.max(), 3))


def panel(maps: Mapping[str, StabilityMap], curves: xr.Dataset | None) -> Panel:
    """Figure of all maps, with the scaling law of :func:`chilopod.paper.atlas.scaling.collapse` if that is there."""
    said = tuple(f"{letter}. {words(letter, found)}" for letter, found in maps.items())
    return Panel(
        name="atlas",
        title="An atlas for designers",
        draw=lambda narrow: _draw(maps, curves, narrow),
        alt="Maps of the straight walk of the planar robot: where it holds, bends and undulates. " + " ".join(said),
        text=(
            "Colours say what becomes of a small disturbance of the straight walk. Curves are exact; a dashed one is a "
            "sudden onset. Where robots have one shape, the dotted line is the scaling law.",
            *said,
        ),
        data=_merged(maps),
    )


def _merged(maps: Mapping[str, StabilityMap]) -> xr.Dataset:
    """Grids and curves of all maps, with the letter before each name."""
    parts = []
    for letter, found in maps.items():
        data = found.to_dataset()
        parts.append(data.rename({name: f"{letter}_{name}" for name in {*data.variables, *data.dims}}))
    return xr.merge(parts, combine_attrs="drop")


def _draw(maps: Mapping[str, StabilityMap], curves: xr.Dataset | None, narrow: bool) -> Figure:
    letters = "".join(maps)
    pairs = ";".join(letters[i : i + 2] for i in range(0, len(letters), 2))
    wide = style.Layout(pairs, _ROW * len(letters) / 2 + 0.6)
    figure, axes = style.figure(wide, style.Layout(";".join(letters), _ONE * len(letters) + 1.2), narrow)
    handles: dict[str, Any] = {}
    for letter, found in maps.items():
        draw(found, axes[letter], "kind")
        axes[letter].set_title(letter)
        if CHARTS[letter].scaled and curves is not None:
            _law(axes[letter], found, curves)
        handles |= {each.get_label(): each for each in keys(found, axes[letter])}
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=1 if narrow else 4)
    return figure


def _law(axes: Axes, found: StabilityMap, curves: xr.Dataset) -> None:
    """Line on which k1 is the critical spring that the scaling law predicts."""
    plane = Plane(found.robot, found.x, found.y)
    x, y = (
        each[np.linspace(0, each.size - 1, min(_LAW, each.size)).astype(int)]
        for each in (found.x_values, found.y_values)
    )
    robots = [[plane.at(float(a), float(b)) for a in x] for b in y]
    ratio = [[each.get(K1) / spring_scale(each) / predicted(each, curves) for each in row] for row in robots]
    axes.contour(
        found.x.shown(x), found.y.shown(y), ratio, [1.0], colors=style.PURPLE, linestyles=[(0, (1, 3))], linewidths=2.5
    )
    axes.plot([], [], ":", color=style.PURPLE, linewidth=2.5, label="scaling law")


ATLAS: Section[dict[str, StabilityMap]] = Section(
    "atlas", CHAPTER, "eight maps of the straight walk", atlas, panels=panel, beside=(SCALING,), beyond=True
)
