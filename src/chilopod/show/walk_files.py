"""Files of a turn or a course: the record, a picture, a replay and, of a course, a film."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from chilopod.netcdf import netcdf
from chilopod.output import Content, write_all
from chilopod.show import style
from chilopod.show.scene.encoder import has_encoder
from chilopod.show.scene.film import FASTEST, Film
from chilopod.show.scene.replay import SHOWN, replay

_LONGEST_FILM = 15.0  # s: it takes half as long to make
_FILM_SIZE = (960, 640)


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
