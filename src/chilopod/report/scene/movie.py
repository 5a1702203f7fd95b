"""A movie as files: replay, film and stills."""

from __future__ import annotations

from pathlib import Path

from chilopod.errors import OutputError
from chilopod.output import prepare_folder, write_atomic
from chilopod.paper.movies import Movie
from chilopod.report.kit.page import Film
from chilopod.report.scene.film import has_encoder, movie
from chilopod.report.scene.film_3d import film_3d, stills
from chilopod.report.scene.replay import replay
from chilopod.report.scene.replay_3d import replay_3d

_FILM_SIZE = (1280, 320)  # three panels in a row
_STILLS = {"robot-movie-1": (2.0, 30.0, 60.0, 88.0), "robot-movie-2": (0.5, 8.0, 16.0, 24.0)}  # s, of films in 3-D


def write_movie(shown: Movie, folder: Path) -> Film:
    """Write a movie as ``NAME.html``, ``NAME.mp4`` where films can be encoded and, in 3-D, ``NAME.png`` where it can be
    rendered.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    prepare_folder(folder)
    solid = "pose" in shown.record
    page_of = replay_3d if solid else replay
    write_atomic(folder / f"{shown.name}.html", page_of(shown.record, titles=shown.titles, heading=shown.heading))
    encoded, pictured = has_encoder(), False
    if encoded:
        file = folder / f"{shown.name}.mp4"
        encoded_solid = False
        if solid:
            try:
                film_3d(shown.record, file, titles=shown.titles, heading=shown.heading, speed=shown.speed)
                encoded_solid = True
            except OutputError:
                pass  # no graphics here: the film from above needs none, and `chilopod doctor` says what is missing
        if not encoded_solid:
            movie(shown.record, file, titles=shown.titles, heading=shown.heading, speed=shown.speed, size=_FILM_SIZE)
    if solid:
        try:
            stills(shown.record, _STILLS[shown.name], folder / f"{shown.name}.png", titles=shown.titles)
            pictured = True
        except OutputError:
            pass
    return Film(shown.name, shown.heading, shown.speed, encoded, pictured)
