"""Writing the report: page, figures, and the data behind them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import xarray as xr

from chilopod.errors import OutputError
from chilopod.output import netcdf, prepare_folder, write_atomic
from chilopod.paper import CHAPTERS, Results
from chilopod.paper.movies import Movie
from chilopod.report.figures import (
    branch,
    critical,
    curved_trials,
    curved_variants,
    exponents,
    identification,
    mode,
    robot_structures,
    robot_turning,
    robot_walks,
    robot_why,
    schematic,
    turning,
    undulation,
    uniform,
)
from chilopod.report.kit import style, tables
from chilopod.report.kit.page import Drawn, Film, page
from chilopod.report.kit.panel import Panel
from chilopod.report.scene.film import has_encoder, movie
from chilopod.report.scene.film_3d import film_3d, stills
from chilopod.report.scene.replay import replay
from chilopod.report.scene.replay_3d import replay_3d
from chilopod.robot import Robot, load_robot, presets
from chilopod.tasks.identify import Identification

_STRAIGHT: Mapping[str, Callable[[Results], Panel]] = {
    "exponents": exponents.panel,
    "variants": critical.variants,
    "modules": critical.modules,
    "mode": mode.panel,
    "uniform": uniform.panel,
    "identification": identification.panel,
}
_FILM_SIZE = (1280, 320)  # three panels in a row
_STILLS = {"robot-movie-1": (2.0, 30.0, 60.0, 88.0), "robot-movie-2": (0.5, 8.0, 16.0, 24.0)}  # s, of films in 3-D


def panels(results: Results) -> dict[str, list[Panel]]:
    """The figures of every chapter, those of the sections that were computed."""
    straight, curved, turns, whole = CHAPTERS
    study, data = results.curved, results.datasets
    found: dict[str, list[Panel]] = {
        straight: [schematic.panel(results), *(make(results) for name, make in _STRAIGHT.items() if name in data)],
        curved: [],
        turns: [] if results.turning is None else list(turning.panels(results.turning)),
        whole: [],
    }
    if study:
        found[curved] += [curved_trials.walks(study), curved_trials.joints(study)]
    if "branch" in data:
        found[curved].append(branch.panel(data["branch"]))
    if study:
        found[curved] += [curved_trials.onset(study), curved_variants.panel(study)]
    if "undulation" in data:
        found[curved].append(undulation.panel(data["undulation"]))
    if results.robot_walks:
        found[whole] += robot_walks.panels(results.robot_walks)
    if results.robot_turning:
        found[whole] += robot_turning.panels(results.robot_turning, results.robot_walks)
    if "robot-spread" in data and results.whole:
        found[whole].append(robot_why.spread(data["robot-spread"], results.whole))
    if "robot-structures" in data:
        found[whole].append(robot_structures.panel(data["robot-structures"]))
    if "robot-why" in data:
        found[whole].append(robot_why.why(data["robot-why"]))
    return {chapter: figures for chapter, figures in found.items() if figures}


def write_report(results: Results, folder: str | Path) -> Path:
    """Draw what was found and write it as a page that opens from disk and shows all figures without any other file.

    Beside ``index.html`` there are ``figures/NAME.png`` and ``.svg``, ``data/NAME.csv`` and ``.nc`` for every figure,
    ``movies/NAME.mp4`` and ``.html``, and ``data/robot.toml``. Files of these names are replaced, each as a whole; the
    page comes last. Where films cannot be encoded, the replays are there without them.

    Parameters
    ----------
    results
        From :func:`chilopod.paper.sections`; only its sections are shown.
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
    drawn: dict[str, list[Drawn]] = {}
    for chapter, of_chapter in panels(results).items():
        for panel in of_chapter:
            wide = _write(panel, figures, data)
            with style.house_style():
                narrow = style.svg(panel.draw(True), panel.name)
            drawn.setdefault(chapter, []).append(Drawn(panel, wide, narrow))
    films = {
        list(CHAPTERS)[2]: _write_films(results.movies, folder / "movies"),
        list(CHAPTERS)[3]: _write_films(results.robot_movies, folder / "movies"),
    }
    robot_file = write_atomic(data / "robot.toml", results.robot.to_toml())
    if results.whole:
        write_atomic(data / "robot-3d.toml", results.whole.to_toml())
    name = results.robot.name if _is_preset(results.robot) else str(robot_file)
    return write_atomic(folder / "index.html", page(results, drawn, films, name))


def _write_films(movies: Sequence[Movie], folder: Path) -> list[Film]:
    written = []
    for each in movies:
        prepare_folder(folder)
        solid = "pose" in each.record
        page_of = replay_3d if solid else replay
        write_atomic(folder / f"{each.name}.html", page_of(each.record, titles=each.titles, heading=each.heading))
        encoded, pictured = has_encoder(), False
        if encoded:
            file = folder / f"{each.name}.mp4"
            encoded_solid = False
            if solid:
                try:
                    film_3d(each.record, file, titles=each.titles, heading=each.heading, speed=each.speed)
                    encoded_solid = True
                except OutputError:
                    pass  # no graphics here: the film from above needs none, and `chilopod doctor` says what is missing
            if not encoded_solid:
                movie(each.record, file, titles=each.titles, heading=each.heading, speed=each.speed, size=_FILM_SIZE)
        if solid:
            try:
                stills(each.record, _STILLS[each.name], folder / f"{each.name}.png", titles=each.titles)
                pictured = True
            except OutputError:
                pass
        written.append(Film(each.name, each.heading, each.speed, encoded, pictured))
    return written


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
        From :mod:`chilopod.analysis.branch`.
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
