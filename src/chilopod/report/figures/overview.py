"""The picture at the top of the README: ``python -m chilopod.report.figures.overview docs/images/overview.png``."""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib.figure import Figure

from chilopod.output import write_atomic
from chilopod.paper import Results, reproduce
from chilopod.report.figures.exponents import over_k1
from chilopod.report.figures.mode import bent_body
from chilopod.report.kit import style
from chilopod.report.kit.words import spring
from chilopod.robot import load_robot

_LAYOUT = style.Layout("AB", 3.9, widths=(1.15, 1.0))
_DRAWN_BEND = 75.0


def write_overview(results: Results, path: str | Path) -> Path:
    """Draw the growth rates and the bent body side by side.

    Parameters
    ----------
    results
        With the sections "mode" and "exponents".
    path
        Of the PNG; its folder must exist.
    """
    with style.house_style():
        return write_atomic(path, style.png(_draw(results), dpi=130))


def _draw(results: Results) -> Figure:
    figure, axes = style.figure(_LAYOUT, _LAYOUT, False)
    mode = results.datasets["mode"]
    over_k1(axes["A"], results.datasets["exponents"], mode.attrs["value"])
    axes["A"].set_title("How fast disturbances grow as k₁ softens")
    axes["A"].set_ylim(bottom=-0.5)
    bent_body(axes["B"], mode.computed.values, _DRAWN_BEND)
    axes["B"].set_title(f"Below k₁ = {spring(mode.attrs['value'])} it turns")
    return figure


if __name__ == "__main__":
    write_overview(reproduce(load_robot("aoi2022-planar"), only=["mode", "exponents"]), sys.argv[1])
