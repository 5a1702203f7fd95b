"""One target after another, with a spring that is set on the way: the sections of this chapter."""

from __future__ import annotations

import xarray as xr

from chilopod.paper.courses.figures import courses as figures
from chilopod.paper.courses.figures import robust as robust_figures
from chilopod.paper.courses.film import film
from chilopod.paper.courses.robust import (
    PLANAR_COURSES,
    WHOLE_COURSES,
    Robust,
    Whole,
    ablated,
    planar_conditions,
    under,
    whole_conditions,
)
from chilopod.paper.courses.rows import compared_rows, condition_rows, robust_rows
from chilopod.paper.courses.study import PLANAR, WHOLE, compared, prepared
from chilopod.paper.movies import Movie
from chilopod.paper.section import Context, Found, Section
from chilopod.progress import Progress, part
from chilopod.steering import STRATEGIES

CHAPTER = "One target after another"

# N*mm/deg: the best for all of a course by the search, in the planar model and in the twin; what was found counts
# where there is something.
_BEST, _WHOLE_BEST = 14.0, 24.0


def _compared(context: Context, found: Found, report: Progress) -> xr.Dataset:
    plan = PLANAR[context.size]
    return compared(context.robot, prepared(context), plan, context.size, context.folder, report)


def _robust(context: Context, found: Found, report: Progress) -> Robust:
    variable, seeds = prepared(context), PLANAR_COURSES[context.size]
    best = best_fixed(found[COURSES], _BEST)
    steps = ablated(variable, seeds, context.size, context.folder, part(report, 0.0, 0.2, "steps"))
    conditions = planar_conditions(context.robot)
    walks = under(
        context.robot, variable, best, conditions, seeds, context.size, context.folder, part(report, 0.2, 1.0)
    )
    return Robust(steps, walks)


def _whole(context: Context, found: Found, report: Progress) -> Whole:
    robot, size, folder = context.whole, context.size, context.folder
    variable = prepared(context, "twin")
    data = compared(robot, variable, WHOLE[size], size, folder, part(report, 0.0, 0.7))
    best, conditions = best_fixed(data, _WHOLE_BEST), whole_conditions(robot)
    walks = under(robot, variable, best, conditions, WHOLE_COURSES[size], size, folder, part(report, 0.7, 1.0))
    return Whole(data, walks)


def _film(context: Context, found: Found, report: Progress) -> list[Movie]:
    best = best_fixed(found[COURSES], _BEST)
    return [film(context.robot, prepared(context), best, context.folder, report, shorter=context.size.cut(1.0, 0.1))]


def best_fixed(data: xr.Dataset | None, otherwise: float) -> float:
    """The best first spring for all of a course, N*mm/deg."""
    return otherwise if data is None else float(data.spring.sel(case=STRATEGIES["pitchfork"].name))


COURSES: Section[xr.Dataset] = Section(
    "courses",
    CHAPTER,
    "random courses: a spring set on the way beside what does without",
    _compared,
    lambda data, found: compared_rows(data),
    lambda data, found: figures.panels(data),
    beyond=True,
)
ROBUST: Section[Robust] = Section(
    "courses-robust",
    CHAPTER,
    "random courses: what the law owes to its steps, and what it stands",
    _robust,
    lambda data, found: robust_rows(data.steps, data.conditions),
    lambda data, found: [robust_figures.panel(data)],
    needs=(COURSES,),
    beyond=True,
)
ROBOT_COURSES: Section[Whole] = Section(
    "robot-courses",
    CHAPTER,
    "random courses of the whole robot in 3-D",
    _whole,
    lambda data, found: [*compared_rows(data.compared), *condition_rows(data.conditions)],
    lambda data, found: [figures.strategies(data.compared), robust_figures.whole(data.conditions)],
    beyond=True,
    full=True,
)
COURSES_FILM: Section[list[Movie]] = Section(
    "courses-movie",
    CHAPTER,
    "an eight with a spring set on the way and with one for all",
    _film,
    films=lambda films: films,
    needs=(COURSES,),
    beyond=True,
)
