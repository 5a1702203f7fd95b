"""Turning to a target: the sections of this chapter."""

from __future__ import annotations

from chilopod.analysis.parameters import stiffness
from chilopod.paper.movies import Movie, movies
from chilopod.paper.section import Context, Section
from chilopod.paper.turning.figures import panels
from chilopod.paper.turning.rows import rows
from chilopod.paper.turning.study import Turning, turning
from chilopod.progress import Progress

CHAPTER = "Turning to a target"

_FILMED = (stiffness(41.0), stiffness(11.0), stiffness(8.0))  # straight, curved a little, curved a lot
# N*mm/deg: what `chilopod turn` finds for task A; the movie takes the best of the trials where there are any.
_BEST = 9.8


def _movies(context: Context, report: Progress, tasks: Turning | None) -> list[Movie]:
    best = stiffness(_BEST if tasks is None else tasks.tasks["A"].best)
    return movies(context.robot, _FILMED, best, context.folder, report, shorter=context.size.cut(1.0, 0.1))


TURNING: Section[Turning] = Section("turning", CHAPTER, "turning to targets", turning, rows, panels)
MOVIES: Section[list[Movie]] = Section(
    "movies", CHAPTER, "the paper's two movies", _movies, films=lambda films: films, needs=(TURNING,)
)
