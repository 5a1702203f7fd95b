"""The walks of the paper's two movies: effect of the springs, and three attempts at a turn."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import K1, stiffness
from chilopod.paper import printed
from chilopod.paper.section import Context, Movie, Size
from chilopod.progress import Progress
from chilopod.steering import LegYawController
from chilopod.trials import NONE, Trial, run, together

TASK_A = printed.TASKS["A"].target

_FILMED, _ROBOT_FILMED = (41.0, 11.0, 8.0), (41.0, 26.0, 15.0)  # N*mm/deg; the paper's large, small and very small
_ROBOT_TRIED = (41.0, 21.0, 15.0)  # N*mm/deg, the paper's of task A
_WALK, _ROBOT_WALK = 45.0, 90.0  # s
_TASK, _ROBOT_TASK = 24.0, 32.0  # s
_ROBOT_STILLS = ((2.0, 30.0, 60.0, 88.0), (0.5, 8.0, 16.0, 24.0))  # s
_QUICK_FPS = 12  # frames take long to render
_BEND = tuple(float(angle) for angle in np.deg2rad([20.0, 10.0, 14.0, 12.0, 4.0]))


def movies(context: Context, progress: Progress, best: float) -> list[Movie]:
    """Walk the films of the planar robot.

    Movie 1 has a straight walk, a wide curve and a tight curve. They start bent in the shape of the critical mode, as
    the bend would take minutes to grow from straight. Movie 2 shows the best first spring for task A (N*mm/deg)
    between one that is too stiff and one that is too soft.
    """
    robot, shorter, spring = context.robot, context.size.cut(1.0, 0.1), stiffness(best)
    joints = robot.body.modules - 1
    walk = Trial(robot, shorter * _WALK, 0, (_BEND + (0.0,) * joints)[:joints], disturbance=NONE, rate=25.0)
    springs = (*map(stiffness, _FILMED), 4.0 * spring, spring, 0.7 * spring)
    return _movies(context, progress, "", walk, shorter * _TASK, springs)


def robot_movies(context: Context, progress: Progress) -> list[Movie]:
    """Walk the films of the whole robot; movie 1 starts straight but for the disturbance, as in the paper."""
    shorter, springs = context.size.cut(1.0, 0.013), tuple(map(stiffness, (*_ROBOT_FILMED, *_ROBOT_TRIED)))
    walk = Trial(context.whole, shorter * _ROBOT_WALK, 1, rate=25.0, engine="twin", poses=True)
    found = _movies(context, progress, "robot-", walk, shorter * _ROBOT_TASK, springs)
    moments = [tuple(shorter * moment for moment in stills) for stills in _ROBOT_STILLS]
    first, second = (replace(movie, stills=stills) for movie, stills in zip(found, moments, strict=True))
    faster = 3.0 if context.size is Size.QUICK else 1.0
    return [replace(first, speed=3.0 * faster), replace(second, speed=faster)]


def _movies(
    context: Context, progress: Progress, prefix: str, walk: Trial, duration: float, springs: tuple[float, ...]
) -> list[Movie]:
    """Movie 1 of a walk and movie 2 of task A, in the same engine and duration, with three springs (N*m/rad) each."""
    steered: dict[str, Any] = {"target": TASK_A, "controller": LegYawController(), "disturbance": NONE}
    task = replace(walk, duration=duration, seed=0, joint_angles=(), **steered)
    pairs = zip([walk] * 3 + [task] * 3, springs, strict=True)
    asked = [replace(each, robot=walk.robot.with_value(K1, spring)) for each, spring in pairs]
    records = run(asked, context.folder, progress)
    kinds = ("straight", "curved a little", "curved a lot", "too stiff", "best", "too soft")
    names = [units.format(value, "N*mm/deg", digits=3).replace("*", "·") for value in springs]
    fps = _QUICK_FPS if context.size is Size.QUICK else Movie.fps
    titles = tuple(f"k1 = {name}: {kind}" for name, kind in zip(names, kinds, strict=True))
    first, second = "One spring decides how the robot walks", f"Turning to a target, {TASK_A}"
    return [
        Movie(f"{prefix}movie-1", first, titles[:3], together(records[:3]), 2.0, fps, size=(1280, 400), follow=True),
        Movie(f"{prefix}movie-2", second, titles[3:], together(records[3:]), 1.0, fps),
    ]
