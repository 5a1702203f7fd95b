"""Other structures of the robot, and what each of them predicts."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from chilopod.paper import printed
from chilopod.paper.robot.structures import TOLERANCE
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import listing, typeset
from chilopod.tasks.identify.twin_constants import FREE

_LAYOUTS = (style.Layout("AB", 5.4, widths=(0.7, 1.0)), style.Layout("A;B", 10.0))
_MET = 1.0  # misfit at which the base series is met
_FARTHEST = 60.0  # per cent, where predictions are cut off
_MOST = 100.0  # chi squared, where bars are cut off
_MARKERS = "osD^v"


def panel(data: xr.Dataset) -> Panel:
    """Predictions of other structures."""
    fitted = data.misfit.sel(fit="fitted").values
    met = fitted <= _MET
    squared = data.chi_squared.values
    better = [
        f"{name} ({_shown(value)})"
        for name, value, good in zip(data.structure.values[1:], squared[1:], met[1:], strict=True)
        if good and value < squared[0]
    ]
    missed = [str(name) for name, good in zip(data.structure.values, met, strict=True) if not good]
    ratio = data.criteria.sel(strategy="pitchfork") / data.criteria.sel(strategy="hopf")
    below = (ratio < 1.0).all("criterion").values
    lower = [str(name) for name, yes in zip(data.structure.values, below & met, strict=True) if yes]
    return Panel(
        name="robot-structures",
        title="What else the robot could be made of",
        draw=lambda narrow: _draw(data, narrow),
        alt="A: how far each structure's predictions are from the paper's. B: predictions, relative to the paper's.",
        text=(
            f"Each of these structures was given to the preset, and its {len(FREE)} constants moved until it meets the "
            "base series again, from few and undisturbed walks: "
            + "; ".join(
                f"{name} ({about})" for name, about in zip(data.structure.values, data.about.values, strict=True)
            )
            + ".",
            f"A adds up the squares of how far its predictions are from the paper's, over {100.0 * TOLERANCE:g} %: the "
            f"preset has {_shown(squared[0])}, "
            + (f"less have {listing(better)}." if better else "none has less.")
            + (f" Pale: {listing(missed)}, which did not meet the base series within its tolerance." if missed else "")
            + " For the shorter stride the nearer of its two readings counts.",
            "In task A the smallest criteria of one soft spring are all three below those of springs all alike with "
            + (listing(lower) if lower else "none of those that meet it")
            + ".",
        ),
        data=data,
    )


def _shown(value: float) -> str:
    if np.isnan(value):
        return "a prediction without a point"
    return f"{value:.0f}" if value >= 10.0 else f"{value:.1f}"


def _draw(data: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(*_LAYOUTS, narrow)
    rows = np.arange(data.sizes["structure"])
    met = data.misfit.sel(fit="fitted").values <= _MET
    names = [str(name) for name in data.structure.values]
    values = np.clip(np.nan_to_num(data.chi_squared.values, nan=0.0), 0.0, _MOST)
    axes["A"].barh(rows, values, 0.6, color=[style.BLUE if good else style.PALE for good in met])
    for row, value, end in zip(rows, data.chi_squared.values, values, strict=True):
        style.note(axes["A"], _shown(value), (end, float(row)), (4, 0), va="center")
    axes["A"].set_yticks(rows, names)
    axes["A"].set(xlim=(0.0, 1.2 * _MOST), xlabel="chi squared", title="A  From the paper's")
    off = 100.0 * (data.predicted / data.paper - 1.0)
    axes["B"].axvspan(-100.0 * printed.ONSETS, 100.0 * printed.ONSETS, color=style.PALE, zorder=0)
    for column, name in enumerate(data.prediction.values):
        axes["B"].plot(
            np.clip(off.values[:, column], -_FARTHEST, _FARTHEST),
            rows,
            _MARKERS[column % len(_MARKERS)],
            color=style.CURVES[column % len(style.CURVES)],
            markersize=6,
            label=typeset(str(name)),
        )
    axes["B"].set_yticks(rows, names if narrow else [""] * len(names))
    axes["B"].set(
        xlim=(-_FARTHEST - 3.0, _FARTHEST + 3.0), xlabel="onset relative to the paper's (%)", title="B  Predictions"
    )
    for letter in "AB":
        axes[letter].invert_yaxis()
        style.grid(axes[letter], "x")
    handles, labels = axes["B"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=1 if narrow else 3)
    return figure
