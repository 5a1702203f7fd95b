"""The whole robot in three dimensions: the sections of this chapter."""

from __future__ import annotations

import xarray as xr

from chilopod.analysis.parameters import stiffness
from chilopod.paper.movies import Movie, robot_movies
from chilopod.paper.robot import numerics, why
from chilopod.paper.robot.figures import structures as structure_figures
from chilopod.paper.robot.figures import turning as turning_figures
from chilopod.paper.robot.figures import walks as walk_figures
from chilopod.paper.robot.figures import why as why_figures
from chilopod.paper.robot.rows import walk_rows
from chilopod.paper.robot.spread import twin_spread
from chilopod.paper.robot.structures import structures
from chilopod.paper.robot.turning import RobotTurning, robot_turning
from chilopod.paper.robot.turning_rows import turning_rows
from chilopod.paper.robot.walks import RobotWalks, robot_walks
from chilopod.paper.section import Section

CHAPTER = "The whole robot in three dimensions"

_FILMED = (stiffness(41.0), stiffness(26.0), stiffness(15.0))  # the paper's large, small and very small
_TRIED = (stiffness(41.0), stiffness(21.0), stiffness(15.0))  # the paper's of task A


WALKS: Section[RobotWalks] = Section(
    "robot-walks",
    CHAPTER,
    "the whole robot in 3-D: its walks",
    lambda context, found, report: robot_walks(context, report),
    lambda walks, found: walk_rows(walks),
    lambda walks, found: walk_figures.panels(walks),
)
TASKS: Section[RobotTurning] = Section(
    "robot-turning",
    CHAPTER,
    "the whole robot in 3-D: turning to targets",
    lambda context, found, report: robot_turning(context, report),
    lambda tasks, found: turning_rows(tasks, found[WALKS]),
    lambda tasks, found: turning_figures.panels(tasks, found[WALKS]),
    needs=(WALKS,),
    beside=(WALKS,),
)
FILMS: Section[list[Movie]] = Section(
    "robot-movies",
    CHAPTER,
    "the paper's two movies in 3-D",
    lambda context, found, report: robot_movies(
        context.whole, _FILMED, _TRIED, context.folder, report, shorter=context.size.cut(1.0, 0.013)
    ),
    films=lambda films: films,
)
SPREAD: Section[xr.Dataset] = Section(
    "robot-spread",
    CHAPTER,
    "the whole robot in 3-D: other constants that fit as well",
    lambda context, found, report: twin_spread(context, report),
    panels=lambda data, found: [why_figures.spread(data, found.context.whole)],
    beyond=True,
    full=True,
)
NUMERICS: Section[xr.Dataset] = Section(
    "robot-numerics",
    CHAPTER,
    "the whole robot in 3-D: finer steps",
    lambda context, found, report: numerics.twin_numerics(context, report),
    lambda data, found: numerics.rows(data),
    beyond=True,
)
STRUCTURES: Section[xr.Dataset] = Section(
    "robot-structures",
    CHAPTER,
    "the whole robot in 3-D: what else it could be made of",
    lambda context, found, report: structures(context, report),
    panels=lambda data, found: [structure_figures.panel(data)],
    beyond=True,
    on_request=True,
)
WHY: Section[xr.Dataset] = Section(
    "robot-why",
    CHAPTER,
    "why the robot bends earlier than the planar model",
    lambda context, found, report: why.ablation(context, report),
    lambda data, found: why.rows(data),
    lambda data, found: [why_figures.why(data)],
    beyond=True,
)
