"""Why the robot bends earlier than the planar model says, and how far to trust what the twin predicts."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from chilopod import units
from chilopod.paper import printed
from chilopod.paper.compliance import draw_asked
from chilopod.paper.robot.spread import printed_number
from chilopod.paper.robot.walks import SPRINGS
from chilopod.paper.robot.why import SPRINGS as TRIED
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, listing, number
from chilopod.tasks.identify.twin_constants import FREE, parts_of

_WHY = (style.Layout("AB", 4.6, widths=(1.2, 1.0)), style.Layout("A;B", 9.0))
_SPREAD = (style.Layout("AB", 4.2, widths=(1.0, 1.1)), style.Layout("A;B", 8.2))
_BEYOND = 60.0  # N*mm/deg, where bars that have no end are cut off


def why(data: xr.Dataset) -> Panel:
    """The point with the planar model's assumptions taken back."""
    limit, twin = data.attrs["limit"], data.attrs["twin"]
    steps = [limit, *(float(value) for value in data.path.values)]
    moves = np.diff([min(value, _BEYOND) if not np.isnan(value) else 0.0 for value in steps])
    largest = [str(data.factor.values[i]) for i in np.argsort(-np.abs(moves))[:2]]
    return Panel(
        name="robot-why",
        title=f"Why {printed.ONSET.value:g} and not {printed.CRITICAL_K1.value:g}: from the planar model to the robot",
        draw=lambda narrow: _draw_why(data, narrow),
        alt="A: where curved walks set in, from the planar limit to the twin, one assumption after the other. B: each "
        "of them alone, and the twin without each.",
        text=(
            "With stiff legs that lift their feet high and a floor that holds feet as a viscous one does, the twin is "
            f"the planar model in another engine: it loses the straight walk at {_shown(data.attrs['vouched'], 4)}, "
            f"the planar model at {_shown(data.attrs['exact'], 4)}. By the paper's method, a square-root fit to walks, "
            f"curved ones set in at {_shown(limit)} there, and with everything at {_shown(twin)}.",
            "In A the planar model's assumptions are taken back one after the other, from the top down: "
            + "; ".join(
                f"{name} ({about}): {_shown(float(value))}"
                for name, about, value in zip(data.factor.values, data.about.values, data.path.values, strict=True)
            )
            + f". The largest steps are {listing(largest)}. They are no independent contributions: B shows each "
            "alone in the planar limit and the twin without each. Where a bar runs out of the picture, walks "
            f"curve at every spring tried, up to {max(TRIED):g}; where there is none, their bends determine no point.",
            f"The viscous coefficient of the planar model's feet is {number(data.attrs['viscous'], 4)}\u00a0N·s/m. A "
            f"foot of the twin that does not slide creeps like one of {number(data.attrs['grip'], 2)}\u00a0N·s/m: it "
            "is held, and lets go only beyond the Coulomb limit.",
        ),
        data=data,
    )


def _shown(value: float, digits: int = 3) -> str:
    if np.isinf(value):
        return "beyond all springs tried"
    return "none" if np.isnan(value) else f"{number(value, digits)}\u00a0{SPRING_UNIT}"


def _draw_why(data: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(*_WHY, narrow)
    names = ["planar limit", *(f"+ {name}" for name in data.factor.values)]
    values = np.array([data.attrs["limit"], *data.path.values])
    colors = [style.GREY, *([style.BLUE] * (len(values) - 1))]
    _bars(axes["A"], np.arange(len(values)), values, colors, 0.6)
    axes["A"].set_yticks(range(len(names)), names)
    axes["A"].set_title("A  One after the other")
    rows = np.arange(data.sizes["factor"])
    _bars(axes["B"], rows - 0.19, data.alone.values, [style.SKY] * len(rows), 0.34)
    _bars(axes["B"], rows + 0.19, data.without.values, [style.ORANGE] * len(rows), 0.34)
    axes["B"].set_yticks(rows, [str(name) for name in data.factor.values])
    axes["B"].set_title("B  Each by itself")
    for letter in "AB":
        for value, color, name in (
            (data.attrs["exact"], style.GREY, "planar model"),
            (printed.ONSET.value, style.VERMILLION, "robot, paper"),
        ):
            label = f"{name}, {number(value, 2)}"
            axes[letter].axvline(value, color=color, lw=1.2, linestyle=(0, (4, 2)), label=label)
        axes[letter].invert_yaxis()
        axes[letter].set(xlim=(0.0, _BEYOND), xlabel=f"point ({SPRING_UNIT})")
        style.grid(axes[letter], "x")
    handles, labels = axes["B"].get_legend_handles_labels()
    handles += [Patch(color=style.SKY), Patch(color=style.ORANGE)]
    labels += ["planar limit and this alone", "twin without this"]
    figure.legend(handles, labels, loc="outside lower center", ncols=1 if narrow else 4)
    return figure


def _bars(axes: Axes, rows: np.ndarray, values: np.ndarray, colors: list[str], height: float) -> None:
    for row, value, color in zip(rows, values, colors, strict=True):
        if np.isnan(value):
            continue
        axes.barh(row, min(value, _BEYOND), height, color=color)
        inside = value > 0.8 * _BEYOND
        style.note(
            axes,
            "all springs tried" if np.isinf(value) else number(value, 3),
            (min(value, _BEYOND), row),
            (-4 if inside else 4, 0),
            va="center",
            ha="right" if inside else "left",
            color="white" if inside else style.BLACK,
        )


def spread(data: xr.Dataset, robot: Robot) -> Panel:
    """Predictions by sets of constants that fit as well."""
    ranges = []
    for index, path in enumerate(data.constant.values):
        values, unit = data.constants.values[:, index], robot.unit_of(str(path))
        low, high = (units.format(float(each), unit, digits=2) for each in (values.min(), values.max()))
        ranges.append(f"{path} {low} to {high}".replace("*", "·"))
    points = {str(name): data.onset.sel(variant=name).values for name in data.variant.values}
    predicted = [
        f"{name} {number(float(np.nanmin(values)), 3)} to {number(float(np.nanmax(values)), 3)}"
        for name, values in (points | {"all springs alike": data.uniform.values}).items()
        if np.isfinite(values).any()
    ]
    tasks = listing(
        f"task {task} with {listing(sorted({f'{float(each):g}' for each in data.best.sel(task=task)}))}"
        for task in data.task.values
    )
    return Panel(
        name="robot-spread",
        title="How far to trust the predictions: other constants that fit as well",
        draw=lambda narrow: _draw_spread(data, robot, narrow),
        alt="A: the constants of several fits, in parts of their ranges. B: what each predicts, beside the robot.",
        text=(
            f"{data.attrs['numbers']} printed numbers and {data.attrs['answers']} yes-or-no answers do not determine "
            f"{data.sizes['constant']} constants. {data.attrs['known']} sets that the search found meet them within "
            "5 %; shown are the preset (filled) and "
            f"those that are most unlike it and each other. What the data leave open (A): {listing(ranges)}.",
            f"What they predict (B), with few and undisturbed walks, in {SPRING_UNIT}: "
            f"{listing(predicted) or 'no point'}. They come nearest to the target in {tasks}\u00a0{SPRING_UNIT}.",
        ),
        data=data,
    )


def _draw_spread(data: xr.Dataset, robot: Robot, narrow: bool) -> Figure:
    figure, axes = style.figure(*_SPREAD, narrow)
    rows = np.arange(len(FREE))
    colors = (style.BLUE, *style.CURVES[1:])
    for index in data.set.values[::-1]:
        parts = parts_of(data.constants.values[index])
        first = index == 0
        axes["A"].plot(
            parts,
            rows,
            "o",
            color=colors[index % len(colors)],
            markerfacecolor=colors[0] if first else "none",
            markersize=8 if first else 6,
            markeredgewidth=1.6,
        )
    axes["A"].set_yticks(rows, [each.path.partition(".")[2].replace("_", " ") for each in FREE])
    axes["A"].set(xlim=(-0.03, 1.03), xlabel="part of the range searched", title="A  Constants")
    axes["A"].invert_yaxis()
    style.grid(axes["A"])

    names = [str(name) for name in data.variant.values[1:]]
    asked = [("base series (fitted)", printed.ONSET), *((name, printed_number(name)) for name in names)]
    rows_asked = [(name, paper.value, paper.band) for name, paper in (*asked, ("all springs alike", printed.UNIFORM))]
    for task in map(str, data.task.values):
        rows_asked.append((f"best spring, task {task}", printed.TASKS[task].k_hat.value, printed.TASKS[task].minima))
    draw_asked(axes["B"], rows_asked)
    found = [*data.onset.values.T, data.uniform.values, *data.best.values.T]
    for row, values in enumerate(found):
        for index, value in enumerate(values):
            axes["B"].plot(
                value,
                row + 0.12 * (index - 0.5 * (len(values) - 1)),
                "o",
                color=colors[index % len(colors)],
                markerfacecolor=colors[0] if index == 0 else "none",
                markersize=7 if index == 0 else 5.5,
                markeredgewidth=1.6,
                label="preset" if row == 0 and index == 0 else None,
            )
    axes["B"].set(
        xlim=(10.0, max(45.0, max(SPRINGS[:-1]))),
        xlabel=f"{SPRING_UNIT}",
        title="B  Predictions",
    )
    axes["B"].legend(loc="upper left")
    return figure
