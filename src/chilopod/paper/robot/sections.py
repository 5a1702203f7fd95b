"""The whole robot in three dimensions: the sections of this chapter."""

from __future__ import annotations

import xarray as xr

from chilopod.paper.movies import robot_movies
from chilopod.paper.robot import why
from chilopod.paper.robot.figures import trust, turning, walks
from chilopod.paper.robot.rows import turning_rows, walk_rows
from chilopod.paper.robot.spread import numeric_rows, twin_numerics, twin_spread
from chilopod.paper.robot.structures import structures
from chilopod.paper.robot.turning import RobotTurning, robot_strategies, robot_turning
from chilopod.paper.robot.walks import RobotWalks, robot_walks
from chilopod.paper.section import Movie, Section

CHAPTER = "The whole robot in three dimensions"

WALKS: Section[RobotWalks] = Section(
    "robot-walks", CHAPTER, "the whole robot in 3-D: its walks", robot_walks, walk_rows, walks.panels, ahead=True
)
TASKS: Section[RobotTurning] = Section(
    "robot-turning",
    CHAPTER,
    "the whole robot in 3-D: turning to targets",
    lambda context, report, walks: robot_turning(context, report),
    turning_rows,
    turning.panels,
    needs=(WALKS,),
    beside=(WALKS,),
    ahead=True,
)
STRATEGIES: Section[xr.Dataset] = Section(
    "robot-strategies",
    CHAPTER,
    "the whole robot in 3-D: pitchfork against Hopf, and how far legs yaw",
    robot_strategies,
    panels=turning.strategies,
    beyond=True,
)
FILMS: Section[list[Movie]] = Section(
    "robot-movies", CHAPTER, "the paper's two movies in 3-D", robot_movies, films=lambda films: films, ahead=True
)
SPREAD: Section[xr.Dataset] = Section(
    "robot-spread",
    CHAPTER,
    "the whole robot in 3-D: other constants that fit as well",
    twin_spread,
    panels=trust.spread,
    beyond=True,
)
NUMERICS: Section[xr.Dataset] = Section(
    "robot-numerics", CHAPTER, "the whole robot in 3-D: finer steps", twin_numerics, numeric_rows, beyond=True
)
STRUCTURES: Section[xr.Dataset] = Section(
    "robot-structures",
    CHAPTER,
    "the whole robot in 3-D: what else it could be made of",
    structures,
    panels=trust.structures,
    beyond=True,
    on_request=True,
)
WHY: Section[xr.Dataset] = Section(
    "robot-why",
    CHAPTER,
    "why the robot bends earlier than the planar model",
    why.contributions,
    why.rows,
    trust.why,
    beyond=True,
    headline=True,
)
WHY_SETS: Section[xr.Dataset] = Section(
    "robot-why-sets",
    CHAPTER,
    "why the robot bends earlier: other constants that fit as well",
    why.over_sets,
    panels=trust.why_sets,
    beyond=True,
    on_request=True,
)
