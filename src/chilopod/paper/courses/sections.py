"""Sections of this chapter: courses of targets, with a first spring that is set while the robot walks."""

from __future__ import annotations

import xarray as xr

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.courses import figures, study
from chilopod.paper.courses.rows import compared_rows, condition_rows, robust_rows
from chilopod.paper.courses.study import PLANAR, WHOLE, Robust, compared, prepared, without_setting
from chilopod.paper.section import Context, Movie, Section
from chilopod.progress import Progress, part
from chilopod.steering import COURSES as COURSES_NAMED
from chilopod.steering import STRATEGIES, Course
from chilopod.tasks.course import Driven, drive, patience_of

CHAPTER = "One target after another"

# N*mm/deg: the best for all of a course by the search, in the planar model and in the twin; what was found counts
# where there is something.
_BEST, _WHOLE_BEST = 14.0, 24.0
_FILMED = "eight"  # of the courses of chilopod.steering


def _robust(context: Context, report: Progress, found: xr.Dataset | None) -> Robust:
    variable, seeds = prepared(context), context.size.of(*study.PLANAR_COURSES)
    best, conditions = best_fixed(found, _BEST), study.planar_conditions(context.robot)
    steps = study.ablated(context, variable, seeds, part(report, 0.0, 0.2, "steps"))
    return Robust(steps, study.under(context, variable, best, conditions, seeds, part(report, 0.2, 1.0)))


def _whole(context: Context, report: Progress) -> Robust:
    variable, seeds = prepared(context, "twin"), context.size.of(*study.WHOLE_COURSES)
    data = compared(context, variable, WHOLE[context.size], part(report, 0.0, 0.7))
    best, conditions = best_fixed(data, _WHOLE_BEST), study.whole_conditions(context.whole)
    return Robust(data, study.under(context, variable, best, conditions, seeds, part(report, 0.7, 1.0)))


def _film(context: Context, report: Progress, found: xr.Dataset | None) -> list[Movie]:
    """A film of one course, driven with a spring that is set on the way and with the best one for all of it."""
    variable, best, goals = prepared(context), best_fixed(found, _BEST), COURSES_NAMED[_FILMED]
    course = Course(goals[: max(1, round(context.size.cut(1.0, 0.1) * len(goals)))], patience_of("planar"))
    fixed = without_setting(context.robot, variable, "pitchfork", best)
    first, second = (
        drive(each, course, seed=0, folder=context.folder, progress=part(report, begin, begin + 0.5))
        for each, begin in ((variable, 0.0), (fixed, 0.5))
    )
    both = Driven(first.trials + second.trials, variable, first.records + second.records)
    titles = "k1 set on the way", f"k1 = {best:g} {PAPER_UNIT.replace('*', '·')}"
    heading = f"One target after another: {_FILMED}"
    # Two panels, higher than wide.
    return [Movie("courses-movie", heading, titles, both.record, speed=10.0, size=(960, 640))]


def best_fixed(data: xr.Dataset | None, otherwise: float) -> float:
    """Best constant first spring for a course, N*mm/deg."""
    return otherwise if data is None else float(data.spring.sel(case=STRATEGIES["pitchfork"].name))


COURSES: Section[xr.Dataset] = Section(
    "courses",
    CHAPTER,
    "random courses: a spring set on the way beside what does without",
    lambda context, report: compared(context, prepared(context), PLANAR[context.size], report),
    compared_rows,
    figures.panels,
    beyond=True,
    headline=True,
)
ROBUST: Section[Robust] = Section(
    "courses-robust",
    CHAPTER,
    "random courses: what the law owes to its steps, and what it stands",
    _robust,
    lambda data, courses: robust_rows(data.courses, data.conditions),
    figures.robust,
    needs=(COURSES,),
    beyond=True,
)
ROBOT_COURSES: Section[Robust] = Section(
    "robot-courses",
    CHAPTER,
    "random courses of the whole robot in 3-D",
    _whole,
    lambda data: [*compared_rows(data.courses), *condition_rows(data.conditions)],
    lambda data: [figures.strategies(data.courses), figures.whole(data.conditions)],
    beyond=True,
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
