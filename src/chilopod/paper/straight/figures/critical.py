"""C and D: the critical spring of the paper's variants, and over the number of modules."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from chilopod.paper import printed
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number, signed, spans, spring, typeset

_VARIANTS = (style.Layout("AB", 3.9, widths=(1.25, 1.0)), style.Layout("A;B", 7.4))
_MODULES = (style.Layout("A", 3.6), style.Layout("A", 3.6))
_SERIES = (("planar model, computed", style.BLUE, "o", "full"), ("robot, paper", style.ORANGE, "D", "none"))


def variants(data: xr.Dataset) -> Panel:
    """Panel of the paper's variants."""
    model, robot = data.critical_k1.values, data.robot_printed.values
    names = [typeset(str(name)) for name in data.variant.values[1:]]
    changes = 100.0 * (data.critical_k1.values / model[0] - 1.0), 100.0 * (robot / robot[0] - 1.0)
    same_order = list(np.argsort(model)) == list(np.argsort(robot))
    listed = listing(
        f"{signed(ours)}\u00a0% for {name} (robot {signed(theirs)}\u00a0%)"
        for name, ours, theirs in zip(names, changes[0][1:], changes[1][1:], strict=True)
    )
    return Panel(
        name="variants",
        letter="C",
        title="Critical k₁ of the paper's variants",
        draw=lambda narrow: _draw_variants(data, narrow),
        alt="Critical front spring for four variants, planar model beside robot: "
        + listing(
            f"{typeset(str(name))} {number(a)} against {b:g}"
            for name, a, b in zip(data.variant.values, model, robot, strict=True)
        )
        + f" {SPRING_UNIT}.",
        text=(
            "The front spring below which the straight walk is lost, as built and with one thing changed: "
            f"{listing(names)}. Filled dots are computed here for the planar model. Open diamonds are not: they are "
            "what the paper reports of its robot, from a square-root law fitted to trials.",
            f"Why {number(model[0], 2)} and not {robot[0]:.0f}? The planar model bends at {spring(model[0])}, the "
            f"real robot at about {spring(robot[0], 2)}. The paper's own planar model has "
            f"{printed.CRITICAL_K1.value:g} as well, so this is no failure to reproduce it: the simple model needs a "
            "softer spring than the robot does, and the paper leaves open why. In the model feet follow their path "
            "exactly, never touch the floor in the air, and rub like dampers; a robot's legs give way, may drag, and "
            "rub dry.",
            "What carries over is the direction of the changes, drawn in the second panel: "
            + listed
            + (". Model and robot put the four in the same order." if same_order else "."),
        ),
        data=data,
    )


def modules(data: xr.Dataset, robot: Robot) -> Panel:
    """Panel of longer and shorter robots."""
    counts, values, says = data.modules.values, data.critical_k1.values, data.says.values
    found = ~np.isnan(values)
    sub = [int(count) for count, word in zip(counts, says, strict=True) if word == "subcritical"]
    above = [int(count) for count, word in zip(counts, says, strict=True) if word == "supercritical"]
    missing = [int(count) for count in counts[~found]]
    long = values[found & (counts > 6)]
    level = (
        f"From 7 modules on it stays between {number(long.min())} and {spring(long.max(), 3)}; the paper says "
        f"{printed.LITTLE_CHANGE.words}. "
        if long.size
        else ""
    )
    direction = (
        "The marker tells what the paper's linear analysis cannot: how the straight walk is lost. Supercritical "
        "(filled): the bend sets in gently and grows as the spring softens. Subcritical (open): just below the "
        "critical spring there is no slightly bent walk to settle on, the robot goes over to a strong bend at once, "
        "and just above it the straight walk survives only small pushes. Here it is supercritical for "
        f"{spans(above) if above else 'no'} modules and subcritical for {spans(sub) if sub else 'none'}."
    )
    return Panel(
        name="modules",
        letter="D",
        title="Critical k₁ over the number of modules",
        draw=lambda narrow: _draw_modules(data, robot.body.modules, narrow),
        alt=f"Critical front spring for {counts[0]} to {counts[-1]} modules, between {number(np.nanmin(values))} and "
        f"{spring(float(np.nanmax(values)), 3)}; open markers where the pitchfork is subcritical.",
        text=(
            f"The same critical spring for shorter and longer robots made of the same modules. {level}"
            + (f"For {spans(missing)} modules the straight walk is not lost through a pitchfork." if missing else ""),
            direction,
        ),
        data=data,
    )


def _draw_variants(data: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(*_VARIANTS, narrow)
    both = data.critical_k1.values, data.robot_printed.values
    names = [_broken(typeset(str(name))) for name in data.variant.values]
    rows = np.arange(len(names))
    for axes_, title, label in (
        (axes["A"], "Critical value", f"critical k₁ ({SPRING_UNIT})"),
        (axes["B"], "Change from as built", "change of critical k₁ (%)"),
    ):
        relative = axes_ is axes["B"]
        for (name, color, marker, fill), values, shift in zip(_SERIES, both, (-0.17, 0.17), strict=True):
            shown = 100.0 * (values / values[0] - 1.0) if relative else values
            axes_.hlines(
                rows + shift, 0.0, shown, color=color, lw=1.6, linestyle="-" if fill == "full" else (0, (3, 2))
            )
            axes_.plot(
                shown,
                rows + shift,
                marker,
                color=color,
                markersize=8,
                markeredgewidth=1.8,
                markerfacecolor=color if fill == "full" else "white",
                label=name,
            )
            for value, row in zip(shown, rows + shift, strict=True):
                if not (relative and row < 0.5):
                    text = f"{signed(value)} %" if relative else number(value, 3 if fill == "full" else 2)
                    style.note(
                        axes_,
                        text,
                        (value, row),
                        (-9 if relative else 9, 0),
                        ha="right" if relative else "left",
                        va="center",
                    )
        axes_.set_yticks(rows, names)
        axes_.tick_params(axis="y", length=0)
        axes_.set(ylim=(rows[-1] + 0.55, -0.55), title=title, xlabel=label)
        style.grid(axes_, "x")
    axes["A"].set_xlim(0.0, 1.2 * max(values.max() for values in both))
    lowest = min(100.0 * (values / values[0] - 1.0).min() for values in both)
    highest = max(100.0 * (values / values[0] - 1.0).max() for values in both)
    axes["B"].set_xlim(1.45 * min(lowest, -5.0), max(1.2 * highest, 3.0))
    axes["B"].axvline(0.0, color=style.BLACK, lw=0.8)
    if not narrow:
        axes["B"].set_yticklabels([])
    handles, labels = axes["A"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=1 if narrow else 2)
    return figure


def _broken(name: str) -> str:
    """A name on two lines."""
    words = name.split()
    # Before the value, if there is one: "stride" over "1.8 cm".
    cut = next((index for index, word in enumerate(words) if word[0].isdigit()), len(words))
    return "\n".join(" ".join(part) for part in (words[:cut], words[cut:]) if part)


def _draw_modules(data: xr.Dataset, built: int, narrow: bool) -> Figure:
    figure, axes_by = style.figure(*_MODULES, narrow)
    axes: Axes = axes_by["A"]
    counts, values, says = data.modules.values, data.critical_k1.values, data.says.values
    axes.plot(counts, values, color=style.GREY, lw=0.9, zorder=1)
    for word, fill in (("supercritical", style.BLUE), ("subcritical", "white")):
        those = says == word
        if those.any():
            axes.plot(
                counts[those],
                values[those],
                "o" if fill != "white" else "s",
                color=style.BLUE,
                markerfacecolor=fill,
                markersize=8,
                markeredgewidth=1.8,
                linestyle="",
                label=word,
            )
    here = counts == built
    if here.any() and not np.isnan(values[here][0]):
        axes.annotate(
            f"this robot: {number(float(values[here][0]), 4)}",
            (built, float(values[here][0])),
            (0, -34),
            textcoords="offset points",
            ha="center",
            va="top",
            arrowprops={"arrowstyle": "-", "color": style.BLACK, "lw": 0.8, "shrinkB": 6},
        )
    missing = np.isnan(values)
    if missing.any():
        axes.plot(
            counts[missing],
            np.zeros(missing.sum()),
            "x",
            color=style.BLACK,
            markersize=8,
            clip_on=False,
            label="no pitchfork",
        )
    axes.set(ylim=(0.0, 1.3 * np.nanmax(values)), xlim=(counts[0] - 0.6, counts[-1] + 0.6))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_locator(MaxNLocator(9 if narrow else 20, integer=True))
    axes.set(xlabel="number of modules", ylabel=f"critical {k(1)} ({SPRING_UNIT})")
    axes.legend(loc="upper right", ncols=1 if narrow else 3)
    style.grid(axes, "y")
    return figure
