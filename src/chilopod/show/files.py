"""Writing figures and the data behind them, and walks as pictures, replays and films."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from chilopod.analysis import StabilityMap
from chilopod.analysis.map_picture import draw, keys
from chilopod.netcdf import netcdf, sealed, storable
from chilopod.notebook import Summary
from chilopod.output import Content, write_all
from chilopod.show import style
from chilopod.show.figures import branch, undulation
from chilopod.show.panel import Panel
from chilopod.show.scene.encoder import has_encoder
from chilopod.show.scene.film import FASTEST, Film
from chilopod.show.scene.replay import SHOWN, replay

_LONGEST_FILM = 15.0  # s: it takes half as long to make
_FILM_SIZE = (960, 640)
_MAP, _KEYS_IN_ROW = (5.2, 4.6), 4  # inches, of one picture of a map; and entries of its legend
_ALONE = style.Layout("A", 4.5), style.Layout("A", 4.5)


def files_of(name: str, folder: str | Path) -> list[Path]:
    """Files of the figure with this name."""
    return [Path(folder) / f"{name}.{kind}" for kind in ("png", "svg", "csv", "nc")]


def write_branch(data: xr.Dataset, folder: str | Path, *, replace: bool = True) -> list[Path]:
    """Write a branch from :mod:`chilopod.analysis.branch` as ``branch`` with ``.png``, ``.svg``, ``.csv`` (for readers)
    and ``.nc`` (to resume it); files and errors as of :func:`chilopod.output.write_all`."""
    return _write_alone(branch.panel(data), folder, replace, branch.table(data), sealed(netcdf(data)))


def write_undulation(data: xr.Dataset, folder: str | Path, *, replace: bool = True) -> list[Path]:
    """Write undulating walks as ``undulation``, with the same endings as :func:`write_branch`."""
    return _write_alone(undulation.panel(data), folder, replace)


def write_result(
    result: Summary, texts: Mapping[str, str], name: str, folder: str | Path, *, replace: bool = True
) -> list[Path]:
    """Write texts of a result by the names of their files, and its plot as ``.svg`` and ``.png``; errors as of
    :func:`chilopod.output.write_all`."""
    files = [Path(folder) / each for each in (*texts, f"{name}.svg", f"{name}.png")]
    with style.house_style():
        drawn, axes = style.figure(*_ALONE, False)
        result.plot(axes["A"])
        contents: list[Content] = [*texts.values(), style.svg(drawn, name), style.png(drawn)]
    write_all(zip(files, contents, strict=True), replace=replace)
    return files


def files_of_map(folder: str | Path) -> list[Path]:
    """Files that :func:`write_map` writes."""
    return [Path(folder) / name for name in ("map.json", "map.nc", "map.csv", "map-curves.csv", "map.svg", "map.png")]


def write_map(
    found: StabilityMap, text: str, shown: Sequence[str], folder: str | Path, *, replace: bool = True
) -> list[Path]:
    """Write the text of a map as ``map.json``, the map as ``map.nc``, its grid as ``map.csv``, its curves as
    ``map-curves.csv``, and its pictures of some names, see :meth:`StabilityMap.plot`, as ``map.svg`` and ``map.png``;
    files and errors as of :func:`chilopod.output.write_all`."""
    data = found.to_dataset()
    about = data.assign_attrs({"robot_toml": ""})
    del about.attrs["robot_toml"]
    table = about.drop_dims("point", errors="ignore")
    curves = about.drop_dims(["x", "y"])
    with style.house_style():
        figure = Figure(figsize=(_MAP[0] * len(shown), _MAP[1]), layout="constrained")
        axes = figure.subplots(1, len(shown), squeeze=False)[0]
        for each, name in zip(axes, shown, strict=True):
            draw(found, each, name)
        columns = _KEYS_IN_ROW if len(shown) > 1 else _KEYS_IN_ROW // 2
        figure.legend(handles=keys(found, axes[0]), loc="outside lower center", ncols=columns)
        pictures = style.svg(figure, "map"), style.png(figure)
    contents = text, netcdf(data), csv(table).encode(), csv(curves).encode(), *pictures
    return write_all(zip(files_of_map(folder), contents, strict=True), replace=replace)


def panel_files(
    panel: Panel, figures: Path, data: Path, table: xr.Dataset | None = None, stored: bytes | None = None
) -> Iterator[tuple[Path, bytes]]:
    """Files of a figure: the data behind it as ``.nc`` and ``.csv``, then, as ``.svg`` and ``.png``, what is drawn
    when these are asked for, into two folders; ``table`` takes the place of the data in the ``.csv``, ``stored`` in the
    ``.nc``."""
    yield data / f"{panel.name}.nc", netcdf(panel.data) if stored is None else stored
    yield data / f"{panel.name}.csv", csv(panel.data if table is None else table).encode()
    with style.house_style():
        drawn = panel.draw(False)
        vector, pixels = style.svg(drawn, panel.name), style.png(drawn)
    yield figures / f"{panel.name}.svg", vector
    yield figures / f"{panel.name}.png", pixels


def _write_alone(
    panel: Panel, folder: str | Path, replace: bool, table: xr.Dataset | None = None, stored: bytes | None = None
) -> list[Path]:
    write_all(panel_files(panel, Path(folder), Path(folder), table, stored), replace=replace)
    return files_of(panel.name, folder)


def files_of_walks(what: str, folder: str | Path) -> list[Path]:
    """Files that :func:`write_walks` writes of a ``turn`` or a ``course``; a film only where films can be encoded."""
    film = ("mp4",) if what == "course" and has_encoder() else ()
    return [Path(folder) / f"{what}.{kind}" for kind in ("png", "svg", "nc", "html", *film)]


def write_walks(what: str, done: Any, folder: str | Path, *, replace: bool = True) -> list[Path]:
    """Write a ``turn`` or a ``course`` as a picture (``.png``, ``.svg``), record (``.nc``), replay (``.html``) and, of
    a course, film (``.mp4``); files and errors as of :func:`chilopod.output.write_all`."""
    files = files_of_walks(what, folder)
    write_all(_contents(import_module(f"chilopod.show.figures.{what}"), done, files), replace=replace)
    return files


def _contents(figure: Any, done: Any, files: list[Path]) -> Iterator[tuple[Path, Content]]:
    """Contents in the order of writing: files that cannot be made again come first."""
    pixels, vector, record, page, *film = files
    yield record, netcdf(done.record)
    with style.house_style():
        drawn = figure.draw(done)
        pictures = (pixels, style.png(drawn)), (vector, style.svg(drawn, vector.stem))
    yield from pictures
    shown, title = done.record.isel(robot=slice(SHOWN)), figure.title(done)
    several = done.record.sizes["robot"] > 1
    labels = [f"walk {i + 1}" if several else done.strategy.name for i in range(len(shown.robot))]
    yield page, replay(shown, titles=labels, heading=title).html
    for file in film:
        # As many times faster as makes it short; from above all of a course is seen.
        seconds = float(shown.time[-1] - shown.time[0])
        speed = min(max(1.0, np.ceil(seconds / _LONGEST_FILM)), FASTEST)
        yield file, Film(shown, titles=labels, heading=title, speed=speed, size=_FILM_SIZE).mp4()


def csv(data: xr.Dataset) -> str:
    """A table with one line per point, units in the header, attributes in comment lines (#) above it.

    Variables of different points have a table each, and an empty line between: a table has the variables that share its
    dimensions or some of them.
    """
    stored = storable(data)
    over = [frozenset(each.dims) for each in stored.data_vars.values()]
    largest = [each for each in dict.fromkeys(over) if not any(each < other for other in over)]
    tables: dict[frozenset[Hashable], list[Hashable]] = {each: [] for each in largest}
    for name, dims in zip(stored.data_vars, over, strict=True):
        tables[next(each for each in largest if dims <= each)].append(name)
    units = {str(name): variable.attrs.get("units", "") for name, variable in stored.variables.items()}
    headers = {name: f"{name} [{unit}]" for name, unit in units.items() if unit}
    notes = "".join(f"# {key} = {value}\n" for key, value in stored.attrs.items())
    frames = [stored[names].to_dataframe().reset_index().rename(columns=headers) for names in tables.values()]
    return notes + "\n".join(str(frame.to_csv(index=False, lineterminator="\n")) for frame in frames)
