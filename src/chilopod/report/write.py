"""Writing the report: page, figures, and the data behind them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import xarray as xr

from chilopod.output import netcdf, prepare_folder, write_atomic
from chilopod.report import (
    branch,
    critical,
    exponents,
    identification,
    mode,
    schematic,
    style,
    tables,
    undulation,
    uniform,
)
from chilopod.report.page import Drawn, page
from chilopod.report.panel import Panel
from chilopod.robot import Robot, load_robot, presets
from chilopod.studies import Identification, Results

_PANELS: Mapping[str, Callable[[Results], Panel]] = {
    "exponents": exponents.panel,
    "variants": critical.variants,
    "modules": critical.modules,
    "mode": mode.panel,
    "uniform": uniform.panel,
    "identification": identification.panel,
}


def panels(results: Results) -> list[Panel]:
    """The schematic, and a figure for every section that was computed."""
    return [schematic.panel(results), *(make(results) for name, make in _PANELS.items() if name in results.datasets)]


def write_report(results: Results, folder: str | Path) -> Path:
    """Draw what was found and write it as a page that opens from disk and needs no other file.

    Beside ``index.html`` there are ``figures/NAME.png`` and ``.svg``, ``data/NAME.csv`` and ``.nc`` for every figure,
    and ``data/robot.toml``. Files of these names are replaced, each as a whole; the page comes last.

    Parameters
    ----------
    results
        From :func:`chilopod.studies.reproduce`; only its sections are shown.
    folder
        Created where there is none.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    folder = prepare_folder(folder)
    figures, data = prepare_folder(folder / "figures"), prepare_folder(folder / "data")
    drawn = []
    for panel in panels(results):
        wide = _write(panel, figures, data)
        with style.house_style():
            narrow = style.svg(panel.draw(True), panel.name)
        drawn.append(Drawn(panel, wide, narrow))
    robot_file = write_atomic(data / "robot.toml", results.robot.to_toml())
    name = results.robot.name if _is_preset(results.robot) else str(robot_file)
    return write_atomic(folder / "index.html", page(results, drawn, name))


def write_identification(found: Identification, folder: str | Path) -> list[Path]:
    """Write the profile of an identification as ``identification`` with ``.png``, ``.svg``, ``.csv`` and ``.nc``.

    Returns
    -------
    The files.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    return _write_alone(identification.panel_of(found), folder)


def write_branch(data: xr.Dataset, folder: str | Path, *, replace: bool = True) -> list[Path]:
    """Write a branch of curved walks as ``branch`` with ``.png``, ``.svg``, ``.csv`` and ``.nc``.

    The netCDF file holds all that the branch goes on from, the table what a reader wants.

    Parameters
    ----------
    data
        From :mod:`chilopod.studies.curved_walk`.
    folder
        Created where there is none.
    replace
        Whether files of these names may be replaced.

    Returns
    -------
    The files.

    Raises
    ------
    OutputError
        If the folder cannot be written, or a file exists and may not be replaced.
    """
    return _write_alone(branch.panel(data), folder, branch.table(data), replace)


def write_undulation(data: xr.Dataset, folder: str | Path) -> list[Path]:
    """Write undulating walks as ``undulation`` with ``.png``, ``.svg``, ``.csv`` and ``.nc``.

    Returns
    -------
    The files.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    return _write_alone(undulation.panel(data), folder)


def _write_alone(panel: Panel, folder: str | Path, table: xr.Dataset | None = None, replace: bool = True) -> list[Path]:
    folder = prepare_folder(folder)
    _write(panel, folder, folder, table, replace)
    return [folder / f"{panel.name}.{kind}" for kind in ("png", "svg", "csv", "nc")]


def _write(panel: Panel, figures: Path, data: Path, table: xr.Dataset | None = None, replace: bool = True) -> bytes:
    """Write a figure, its data, and as a table the data or what is given for them; returns the SVG."""
    with style.house_style():
        drawn = panel.draw(False)
        vector, pixels = style.svg(drawn, panel.name), style.png(drawn)
    # The data first: if they may not be replaced, nothing is.
    write_atomic(data / f"{panel.name}.nc", netcdf(panel.data), replace=replace)
    write_atomic(data / f"{panel.name}.csv", tables.csv(panel.data if table is None else table), replace=replace)
    write_atomic(figures / f"{panel.name}.svg", vector, replace=replace)
    write_atomic(figures / f"{panel.name}.png", pixels, replace=replace)
    return vector


def _is_preset(robot: Robot) -> bool:
    return robot.name in presets() and load_robot(robot.name) == robot
