"""Figures on the robot's earlier onset, the reliability of the twin's predictions, and the predictions of other
structures."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, NullLocator

from chilopod import units
from chilopod.paper import printed
from chilopod.paper.robot.spread import VALLEYS, printed_number
from chilopod.paper.robot.structures import TOLERANCE
from chilopod.paper.robot.walks import SPRINGS
from chilopod.paper.robot.why import ORDERS, SEARCHED, cause
from chilopod.paper.shapes import DASHED, draw_bands, finish
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, listing, number, spring, typeset
from chilopod.tasks.identify.data import FITTED, WITH_FRICTION
from chilopod.tasks.identify.valley import LEAST

_MET = 1.0  # misfit at which the base series is met
_FARTHEST = 60.0  # per cent, where predictions are cut off
_MOST = 100.0  # chi squared, where bars are cut off
_MARKERS = "osD^v"
_FREED = "with friction"
_FEWEST = 3  # sets that an interval needs
_TOLD = 2.0  # effective sets below which their mean says nothing


def why(data: xr.Dataset) -> Panel:
    """Parts of the assumptions of the planar model in the end of the straight walk."""
    inside = int((np.isfinite(data.end_high) & (data.end_low > 0.0)).sum())
    parts = [
        f"{about} {_times(share)} ({_times(low)} to {_times(high)}; ± {100.0 * error:.0f}\u00a0%)"
        for about, share, low, high, error in zip(
            data.about.values, data.share, data.share_low, data.share_high, data.share_error.values, strict=True
        )
    ]
    return Panel(
        name="robot-why",
        title=f"Why {printed.ONSET.value:g} and not {printed.CRITICAL_K1.value:g}: from the planar model to the robot",
        draw=_draw_why(data),
        alt="A: by how much each assumption of the planar model multiplies the spring at which the straight walk ends. "
        "B: that spring in the planar limit with one assumption less, and of the twin with one more.",
        text=(
            "With stiff legs that lift their feet high and a floor that holds feet as a viscous one does, the twin is "
            f"the planar model in another engine: its straight walk ends at {spring(data.attrs['vouched'])}, that "
            f"of the planar model at {spring(data.attrs['exact'])}.",
            f"{cause(data)}. Multipliers of bends of 1° tell where the straight walk ends, in the planar limit at "
            f"{spring(data.end[0], 3)}, in the twin at {spring(data.end[-1], 3)}. "
            f"{data.sizes['subset']} subsets of {data.sizes['factor']} assumptions were removed; {inside} of them end "
            f"between {SEARCHED[0]:g} and {spring(SEARCHED[1], 3)}, the others count as the end that they are beyond. "
            f"A is the mean over all orders in which assumptions are removed, with what {100.0 * ORDERS:.0f} % of the "
            f"orders give (and the error by the multipliers): {listing(parts)}.",
            f"The viscous coefficient of the planar model's feet is {number(data.attrs['viscous'], 4)}\u00a0N·s/m. A "
            f"foot of the twin that does not slide creeps like one of {number(data.attrs['grip'], 2)}\u00a0N·s/m: it "
            "is held, and lets go only beyond the Coulomb limit.",
        ),
        data=data,
    )


def _times(value: float) -> str:
    return f"×{number(value, 3)}" if np.isfinite(value) else "?"


@style.in_layouts(style.Layout("AB", 4.6, widths=(1.2, 1.0)), style.Layout("A;B", 9.0))
def _draw_why(axes: style.Mosaic, data: xr.Dataset) -> None:
    rows = np.arange(data.sizes["factor"])
    span = np.abs(np.array([data.share_low, data.share_high]) - data.share.values)
    axes["A"].errorbar(data.share, rows, xerr=np.nan_to_num(span), fmt="o", color=style.BLUE, capsize=3.0)
    _times_axis(axes["A"], "A  Part of each")
    _bars(axes["B"], rows - 0.19, data.alone.values, [style.SKY] * len(rows), 0.34)
    _bars(axes["B"], rows + 0.19, data.without.values, [style.ORANGE] * len(rows), 0.34)
    axes["B"].set_title("B  Each by itself")
    for value, color, name in ((data.end[0], style.GREY, "planar limit"), (data.end[-1], style.VERMILLION, "twin")):
        label = f"{name}, {number(value, 2)}"
        axes["B"].axvline(value, color=color, lw=1.2, linestyle=DASHED, label=label)
    for letter in "AB":
        axes[letter].set_yticks(
            rows, [str(name) for name in data.factor.values] if letter == "A" or axes.narrow else []
        )
        axes[letter].invert_yaxis()
    finish(axes["B"], "x", xlim=(0.0, SEARCHED[1]), xlabel=f"end of the straight walk ({SPRING_UNIT})")
    handles, labels = axes["B"].get_legend_handles_labels()
    handles += [Patch(color=style.SKY), Patch(color=style.ORANGE)]
    labels += ["planar limit and this alone", "twin without this"]
    axes.figure.legend(handles, labels, loc="outside lower center", ncols=1 if axes.narrow else 4)


def _times_axis(axes: Axes, title: str) -> None:
    """Axis of the parts of the assumptions, which are factors."""
    axes.axvline(1.0, color=style.GREY, lw=1.2, linestyle=DASHED)
    axes.set(xscale="log", title=title)
    axes.xaxis.set_major_locator(FixedLocator([0.5, 1.0, 2.0, 4.0]))
    axes.xaxis.set_major_formatter("×{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    finish(axes, "x", xlabel="factor on the spring")


def why_sets(data: xr.Dataset) -> Panel:
    """Parts of the assumptions of the planar model, by the preset and other sets of constants."""
    others = data.share.isel(set=slice(1, None))
    parts = [
        f"{about} {_times(own)} ({', '.join(_times(each) for each in rest)})"
        for about, own, rest in zip(data.about.values, data.share.values[0], others.values.T, strict=True)
    ]
    always = [str(about) for about, least in zip(data.about.values, data.share.min("set"), strict=True) if least > 1.0]
    ends = [f"{spring(end, 3)}{' or more' * (end == SEARCHED[1])}" for end in data.end.values[:, -1].tolist()]
    return Panel(
        name="robot-why-sets",
        title="The reasons, by other constants that fit as well",
        draw=_draw_why_sets(data),
        alt="By how much each assumption multiplies the spring at which the walk ends, for several sets of constants.",
        text=(
            f"The preset (filled), and {others.sizes['set']} sets drawn from the valley of constants that the data "
            f"leave. Straight walks end at {ends[0]}, and at {listing(ends[1:])}. Parts are estimated from the subsets "
            f"in which an assumption is removed first or last: {listing(parts)}.",
            f"What raises the spring in all of these sets: {listing(always) or 'nothing'}.",
        ),
        data=data,
    )


@style.in_layouts(style.Layout("A", 4.2), style.Layout("A", 4.6))
def _draw_why_sets(axes: style.Mosaic, data: xr.Dataset) -> None:
    count = data.sizes["set"]
    for index, parts in enumerate(data.share.values):
        rows = np.arange(parts.size) + 0.5 * (index / max(count - 1, 1) - 0.5)
        label = {0: "preset", 1: "other sets"}.get(index)
        color, fill = (style.GREEN, "none") if index else (style.BLUE, style.BLUE)
        axes["A"].plot(parts, rows, "o", color=color, markerfacecolor=fill, markersize=6, label=label)
    axes["A"].set_yticks(range(data.sizes["factor"]), [str(name) for name in data.factor.values])
    axes["A"].invert_yaxis()
    _times_axis(axes["A"], "Part of each")
    axes.legend_below("A", 2, 2)


def _bars(axes: Axes, rows: np.ndarray, values: np.ndarray, colors: list[str], height: float) -> None:
    for row, value, color in zip(rows, values, colors, strict=True):
        if np.isnan(value):
            continue
        axes.barh(row, value, height, color=color)
        text = f"{value:g} or more" if value == SEARCHED[1] else number(value, 3)
        away, side, ink = (-4, "right", "white") if value > 0.8 * SEARCHED[1] else (4, "left", style.BLACK)
        style.note(axes, text, (value, row), (away, 0), va="center", ha=side, color=ink)


def spread(data: xr.Dataset) -> Panel:
    """Predictions over the valleys."""
    sets = {valley: data.isel(set=np.flatnonzero(data.valley.values == valley)) for valley in VALLEYS}
    text = [
        f"{data.attrs['numbers']} printed numbers and {data.attrs['answers']} yes-or-no answers do not determine "
        f"{len(FITTED.paths)} constants: they leave a valley, and a wider one if the joints may have dry friction. "
        "Shown are the preset (filled) and sets drawn from weighted samples of both."
    ]
    for valley, found in sets.items():
        opened = [path for path in data.constant.values if valley == _FREED or path in FITTED.paths]
        effective = float(data.effective.sel({"from": valley}))
        count = found.sizes["set"]
        few = ", too few for reliable intervals" if effective < LEAST else ""
        within = listing(_range(data, path, found.constants.sel(constant=path)) for path in opened)
        text.append(
            f"{valley.capitalize()} the samples count as {number(effective, 2)} of equal weight{few}. "
            f"The {count} sets drawn from them have (A) {within}. Onsets that they predict (B), mean, smallest and "
            f"largest, in {SPRING_UNIT}: {_predicted(found)}. They come nearest to the target in {_nearest(found)}"
            f"\u00a0{SPRING_UNIT}. A further set lies between the smallest and largest of {count} with probability "
            f"{number((count - 1.0) / (count + 1.0), 2)}."
        )
    text.append(
        "These walks are undisturbed: the intervals are those of the valleys alone. The standard errors in the table "
        f"of the robot are those of its trials alone, all with the preset. {_refitted(sets[_FREED])}"
    )
    return Panel(
        name="robot-spread",
        title="How far to trust the predictions: the valleys of constants that the data leave open",
        draw=_draw_spread(data),
        alt="A: the constants of several sets, in parts of their ranges. B: what each predicts, beside the robot.",
        text=tuple(text),
        data=data,
    )


def _range(data: xr.Dataset, path: str, values: xr.DataArray) -> str:
    unit = str(data.unit.sel(constant=path).values)
    low, high = (units.format(float(each), unit, digits=2) for each in (values.min(), values.max()))
    return f"{path} {low} to {high}".replace("*", "·")


def _points(found: xr.Dataset) -> dict[str, xr.DataArray]:
    """Onsets that sets predict, by name."""
    variants = {str(name): found.onset.sel(variant=name) for name in found.variant.values}
    return variants | {"all springs alike": found.uniform}


def _predicted(found: xr.Dataset) -> str:
    said = []
    for name, values in _points(found).items():
        if count := int(np.isfinite(values).sum()):
            mean, low, high = (number(each, 3) for each in (values.mean(), values.min(), values.max()))
            spread = f"{low} to {high}, " if count >= _FEWEST else ""
            said.append(f"{name} {mean} ({spread}{count} of {values.size} sets have one)")
    return listing(said) or "no point"


def _nearest(found: xr.Dataset) -> str:
    return listing(
        f"task {task} with {listing(sorted({f'{float(each):g}' for each in found.best.sel(task=task)}))}"
        for task in found.task.values
    )


def _refitted(found: xr.Dataset) -> str:
    """Sets that one more datum leaves, in words, by weights from their distance to it."""
    name = next(iter(printed.VARIANTS))
    paper = printed.VARIANTS[name].onset.value
    off = found.onset.sel(variant=name).values / paper - 1.0
    weights = np.where(np.isfinite(off), np.exp(-0.5 * (np.nan_to_num(off) / printed.FIT_TOLERANCE) ** 2), 0.0)
    same = np.unique(found.constants.values, axis=0, return_inverse=True)[1].ravel()  # a set may be drawn twice
    effective = float(weights.sum() ** 2 / max(np.sum(np.bincount(same, weights) ** 2), 1e-300))
    said = f"With the onset for {name}, {number(paper, 2)} ± {100.0 * printed.FIT_TOLERANCE:g} %, as one more datum"
    if effective < _TOLD:
        return f"{said} fewer than two of these sets would be left."
    parts = weights / weights.sum()
    yaw = float(found.constants.sel(constant="twin.yaw_friction").values @ parts)
    means = []
    for each, values in _points(found).items():
        known = np.isfinite(values.values)
        means.append(f"{each} {number(np.average(values.values[known], weights=weights[known]), 3)}")
    return (
        f"{said}, a fit and no prediction, {found.sizes['set']} sets count as {number(effective, 2)}: yaw friction "
        f"{number(1e3 * yaw, 2)}\u00a0mN·m, {listing(means)} on average."
    )


@style.in_layouts(style.Layout("AB", 4.2, widths=(1.0, 1.1)), style.Layout("A;B", 8.2))
def _draw_spread(axes: style.Mosaic, data: xr.Dataset) -> None:
    paths = WITH_FRICTION.paths
    for index in data.set.values[::-1]:
        parts = WITH_FRICTION.parts_of(data.constants.values[index])
        axes["A"].plot(parts, np.arange(len(parts)), "o", **_marked(data, int(index)))
    axes["A"].set_yticks(range(len(paths)), [path.partition(".")[2].replace("_", " ") for path in paths])
    axes["A"].invert_yaxis()
    finish(axes["A"], xlim=(-0.03, 1.03), xlabel="part of the range searched", title="A  Constants")

    names = [str(name) for name in data.variant.values[1:]]
    asked = [("base series (fitted)", printed.ONSET), *((name, printed_number(name)) for name in names)]
    rows = [(name, paper.value, paper.band) for name, paper in (*asked, ("all springs alike", printed.UNIFORM))]
    for task in map(str, data.task.values):
        rows.append((f"best spring, task {task}", printed.TASKS[task].k_hat.value, printed.TASKS[task].minima))
    draw_bands(axes["B"], rows)
    firsts = set(np.unique(data.valley.values, return_index=True)[1].tolist())
    for row, values in enumerate([*data.onset.values.T, data.uniform.values, *data.best.values.T]):
        for index, value in enumerate(values):
            place = row + 0.6 * (index / max(len(values) - 1, 1) - 0.5)
            label = str(data.valley.values[index]) if row == 0 and index in firsts else None
            axes["B"].plot(value, place, "o", **_marked(data, index), label=label)
    axes["B"].set(xlim=(10.0, max(45.0, *SPRINGS[:-1])), xlabel=SPRING_UNIT, title="B  Predictions")
    # Inside it would hide points.
    axes.legend_below("B", 4, 2)


def _marked(data: xr.Dataset, index: int) -> dict[str, Any]:
    """Look of one set of constants: that of the preset is filled."""
    color = {"preset": style.BLUE, _FREED: style.PURPLE}.get(str(data.valley.values[index]), style.GREEN)
    fill, size = ("none", 5.0) if index else (color, 8.0)
    return {"color": color, "markerfacecolor": fill, "markersize": size, "markeredgewidth": 1.4}


def structures(data: xr.Dataset) -> Panel:
    """Predictions of other structures."""
    fitted = data.misfit.sel(fit="fitted").values
    met = fitted <= _MET
    squared = data.chi_squared.values
    better = [
        f"{name} ({_squares(value)})"
        for name, value, good in zip(data.structure.values[1:], squared[1:], met[1:], strict=True)
        if good and value < squared[0]
    ]
    missed = [str(name) for name, good in zip(data.structure.values, met, strict=True) if not good]
    ratio = data.criteria.sel(strategy="pitchfork") / data.criteria.sel(strategy="hopf")
    below = (ratio < 1.0).all("criterion").values
    lower = [str(name) for name, yes in zip(data.structure.values, below & met, strict=True) if yes]
    tried = [f"{name} ({about})" for name, about in zip(data.structure.values, data.about.values, strict=True)]
    return Panel(
        name="robot-structures",
        title="What else the robot could be made of",
        draw=_draw_structures(data),
        alt="A: how far each structure's predictions are from the paper's. B: predictions, relative to the paper's.",
        text=(
            f"Each of these structures was given to the preset, and its {len(FITTED.paths)} constants moved until it "
            f"meets the base series again, from few and undisturbed walks: {'; '.join(tried)}.",
            f"A adds up the squares of how far its predictions are from the paper's, over {100.0 * TOLERANCE:g} %: the "
            f"preset has {_squares(squared[0])}, {f'less have {listing(better)}' if better else 'none has less'}."
            + (f" Pale: {listing(missed)}, which did not meet the base series within its tolerance." if missed else "")
            + " For the shorter stride the nearer of its two readings counts.",
            "In task A the smallest criteria of one soft spring are all three below those of springs all alike with "
            f"{listing(lower) or 'none of those that meet it'}.",
        ),
        data=data,
    )


def _squares(value: float) -> str:
    if np.isnan(value):
        return "a prediction without a point"
    return f"{value:.0f}" if value >= 10.0 else f"{value:.1f}"


@style.in_layouts(style.Layout("AB", 5.4, widths=(0.7, 1.0)), style.Layout("A;B", 10.0))
def _draw_structures(axes: style.Mosaic, data: xr.Dataset) -> None:
    rows = np.arange(data.sizes["structure"])
    met = data.misfit.sel(fit="fitted").values <= _MET
    names = [str(name) for name in data.structure.values]
    values = np.clip(np.nan_to_num(data.chi_squared.values, nan=0.0), 0.0, _MOST)
    axes["A"].barh(rows, values, 0.6, color=[style.BLUE if good else style.PALE for good in met])
    for row, value, end in zip(rows, data.chi_squared.values, values, strict=True):
        style.note(axes["A"], _squares(value), (end, float(row)), (4, 0), va="center")
    axes["A"].set_yticks(rows, names)
    axes["A"].set(xlim=(0.0, 1.2 * _MOST), title="A  From the paper's")
    off = 100.0 * (data.predicted / data.paper - 1.0)
    axes["B"].axvspan(-100.0 * printed.ONSETS, 100.0 * printed.ONSETS, color=style.PALE, zorder=0)
    for column, name in enumerate(data.prediction.values):
        values = np.clip(off.values[:, column], -_FARTHEST, _FARTHEST)
        marker, color = _MARKERS[column % len(_MARKERS)], style.CURVES[column % len(style.CURVES)]
        axes["B"].plot(values, rows, marker, color=color, markersize=6, label=typeset(str(name)))
    axes["B"].set_yticks(rows, names if axes.narrow else [""] * len(names))
    axes["B"].set(xlim=(-_FARTHEST - 3.0, _FARTHEST + 3.0), title="B  Predictions")
    for letter, label in (("A", "chi squared"), ("B", "onset relative to the paper's (%)")):
        axes[letter].invert_yaxis()
        finish(axes[letter], "x", xlabel=label)
    axes.legend_below("B", 3)
