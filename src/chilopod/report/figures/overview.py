"""The picture at the top of the README: ``python -m chilopod.report.figures.overview docs/images/overview.png``."""

from __future__ import annotations

import sys
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from chilopod.output import write_atomic
from chilopod.paper.straight.study import critical_mode, exponent_sweep
from chilopod.report.figures.exponents import over_k1
from chilopod.report.figures.mode import bent_body
from chilopod.report.kit import style
from chilopod.report.kit.words import spring
from chilopod.robot import load_robot

_LAYOUT = style.Layout("AB", 3.9, widths=(1.15, 1.0))
_DRAWN_BEND = 75.0


def write_overview(mode: xr.Dataset, exponents: xr.Dataset, path: str | Path) -> Path:
    """Draw the growth rates and the bent body side by side.

    Parameters
    ----------
    mode, exponents
        Of :func:`chilopod.paper.straight.study.critical_mode` and of
        :func:`chilopod.paper.straight.study.exponent_sweep`.
    path
        Of the PNG; its folder must exist.
    """
    with style.house_style():
        return write_atomic(path, style.png(_draw(mode, exponents), dpi=130))


def _draw(mode: xr.Dataset, exponents: xr.Dataset) -> Figure:
    figure, axes = style.figure(_LAYOUT, _LAYOUT, False)
    over_k1(axes["A"], exponents, mode.attrs["value"])
    axes["A"].set_title("How fast disturbances grow as k₁ softens")
    axes["A"].set_ylim(bottom=-0.5)
    bent_body(axes["B"], mode.computed.values, _DRAWN_BEND)
    axes["B"].set_title(f"Below k₁ = {spring(mode.attrs['value'])} it turns")
    return figure


if __name__ == "__main__":
    robot = load_robot("aoi2022-planar")
    write_overview(critical_mode(robot), exponent_sweep(robot, 160), sys.argv[1])
