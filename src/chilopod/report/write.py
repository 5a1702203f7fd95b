"""Writing figures and the data behind them."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from chilopod.output import netcdf, prepare_folder, write_atomic
from chilopod.report.figures import branch, identification, undulation
from chilopod.report.kit import style, tables
from chilopod.report.kit.panel import Panel
from chilopod.tasks.identify import Identification


def files_of(name: str, folder: str | Path) -> list[Path]:
    """What is written of the figure of that name alone."""
    return [Path(folder) / f"{name}.{kind}" for kind in ("png", "svg", "csv", "nc")]


def write_identification(found: Identification, folder: str | Path) -> list[Path]:
    """Write the profile of an identification as ``identification``, with the same endings as :func:`write_branch`."""
    return _write_alone(identification.panel(found), folder)


def write_branch(data: xr.Dataset, folder: str | Path) -> list[Path]:
    """Write a branch of curved walks as ``branch`` with ``.png``, ``.svg``, ``.csv`` and ``.nc``.

    The netCDF file holds all that the branch goes on from, the table what a reader wants.

    Parameters
    ----------
    data
        From :mod:`chilopod.analysis.branch`.
    folder
        Created where there is none.

    Returns
    -------
    The files.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    return _write_alone(branch.panel(data), folder, branch.table(data))


def write_undulation(data: xr.Dataset, folder: str | Path) -> list[Path]:
    """Write undulating walks as ``undulation``, with the same endings as :func:`write_branch`."""
    return _write_alone(undulation.panel(data), folder)


def _write_alone(panel: Panel, folder: str | Path, table: xr.Dataset | None = None) -> list[Path]:
    write_panel(panel, Path(folder), Path(folder), table)
    return files_of(panel.name, folder)


def write_panel(panel: Panel, figures: Path, data: Path, table: xr.Dataset | None = None) -> bytes:
    """Write a figure as ``.png`` and ``.svg``, and the data behind it as ``.nc`` and ``.csv``.

    Parameters
    ----------
    panel
        The figure.
    figures, data
        Folders, created where there are none.
    table
        For the ``.csv``, in place of the data.

    Returns
    -------
    bytes
        The SVG.

    Raises
    ------
    OutputError
        If a folder cannot be written.
    """
    with style.house_style():
        drawn = panel.draw(False)
        vector, pixels = style.svg(drawn, panel.name), style.png(drawn)
    for folder in (figures, data):
        prepare_folder(folder)
    write_atomic(data / f"{panel.name}.nc", netcdf(panel.data))
    write_atomic(data / f"{panel.name}.csv", tables.csv(panel.data if table is None else table))
    write_atomic(figures / f"{panel.name}.svg", vector)
    write_atomic(figures / f"{panel.name}.png", pixels)
    return vector
