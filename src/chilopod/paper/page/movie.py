"""A movie as files: replay, film and stills."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from chilopod.errors import OutputError
from chilopod.output import write_atomic
from chilopod.paper.movies import Movie
from chilopod.paper.page.page import Film
from chilopod.show.scene.encoder import has_encoder
from chilopod.show.scene.film import filmed
from chilopod.show.scene.film_3d import film_3d, stills
from chilopod.show.scene.played import replay


def write_movie(shown: Movie, folder: Path) -> Film:
    """Write a movie as ``NAME.html``, ``NAME.mp4`` where films can be encoded and, of some moments of it in 3-D,
    ``NAME.png`` where it can be rendered.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    solid = "pose" in shown.record
    replay(shown.record, titles=shown.titles, heading=shown.heading).write(folder / f"{shown.name}.html", replace=True)
    look: dict[str, Any] = {"titles": shown.titles, "heading": shown.heading, "speed": shown.speed}
    file, encoded = folder / f"{shown.name}.mp4", has_encoder()
    if encoded and not (solid and _rendered(file, lambda: film_3d(shown.record, **look))):
        write_atomic(file, filmed(shown.record, **look, size=shown.size))
    picture = folder / f"{shown.name}.png"
    pictured = bool(shown.stills) and _rendered(
        picture, lambda: stills(shown.record, shown.stills, titles=shown.titles)
    )
    return Film(shown.name, shown.heading, shown.speed, encoded, pictured)


def _rendered(path: Path, render: Callable[[], bytes]) -> bool:
    """Write what graphics here can render. The film from above needs none; `chilopod doctor` says what is missing."""
    try:
        write_atomic(path, render())
    except OutputError:
        return False
    return True
