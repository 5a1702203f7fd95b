"""Turning to a target: the sections of this chapter."""

from __future__ import annotations

from chilopod.paper.movies import movies
from chilopod.paper.section import Context, Movie, Section
from chilopod.paper.turning.figures import panels
from chilopod.paper.turning.rows import rows
from chilopod.paper.turning.study import Turning, turning
from chilopod.progress import Progress

CHAPTER = "Turning to a target"

# N*mm/deg: what `chilopod turn` finds for task A; the movie takes the best of the trials where there are any.
_BEST = 9.8


def _movies(context: Context, report: Progress, tasks: Turning | None) -> list[Movie]:
    return movies(context, report, _BEST if tasks is None else tasks.tasks["A"].best)


TURNING: Section[Turning] = Section("turning", CHAPTER, "turning to targets", turning, rows, panels)
MOVIES: Section[list[Movie]] = Section(
    "movies", CHAPTER, "the paper's two movies", _movies, films=lambda films: films, needs=(TURNING,)
)
