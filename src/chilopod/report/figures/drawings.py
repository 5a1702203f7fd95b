"""What is drawn of every section."""

from __future__ import annotations

from typing import Any

from chilopod.paper.courses.sections import COURSES, COURSES_FILM, ROBOT_COURSES, ROBUST
from chilopod.paper.curved.sections import BRANCH, CURVED, UNDULATION
from chilopod.paper.robot.sections import FILMS, NUMERICS, SPREAD, STRUCTURES, TASKS, WALKS, WHY
from chilopod.paper.straight.sections import EXPONENTS, IDENTIFICATION, MODE, MODULES, UNIFORM, VARIANTS
from chilopod.paper.turning.sections import MOVIES, TURNING
from chilopod.report.figures import (
    branch,
    courses,
    courses_robust,
    critical,
    curved_trials,
    curved_variants,
    exponents,
    identification,
    mode,
    robot_structures,
    robot_turning,
    robot_walks,
    robot_why,
    turning,
    undulation,
    uniform,
)
from chilopod.report.kit.drawing import Drawing

DRAWINGS: tuple[Drawing[Any], ...] = (
    Drawing(MODE, lambda data, found: [mode.panel(data)]),
    Drawing(EXPONENTS, lambda data, found: [exponents.panel(data, found[MODE])], beside=(MODE,)),
    Drawing(VARIANTS, lambda data, found: [critical.variants(data)]),
    Drawing(MODULES, lambda data, found: [critical.modules(data, found.context.robot)]),
    Drawing(UNIFORM, lambda data, found: [uniform.panel(data, found.context.robot)]),
    Drawing(IDENTIFICATION, lambda fit, found: [identification.panel(fit)]),
    Drawing(CURVED, lambda study, found: [curved_trials.walks(study), curved_trials.joints(study)]),
    Drawing(BRANCH, lambda data, found: [branch.panel(data)]),
    Drawing(CURVED, lambda study, found: [curved_trials.onset(study), curved_variants.panel(study)]),
    Drawing(UNDULATION, lambda data, found: [undulation.panel(data)]),
    Drawing(TURNING, lambda tasks, found: turning.panels(tasks)),
    Drawing(MOVIES, films=lambda films: films),
    Drawing(WALKS, lambda walks, found: robot_walks.panels(walks)),
    Drawing(TASKS, lambda tasks, found: robot_turning.panels(tasks, found[WALKS]), beside=(WALKS,)),
    Drawing(SPREAD, lambda data, found: [robot_why.spread(data, found.context.whole)]),
    Drawing(STRUCTURES, lambda data, found: [robot_structures.panel(data)]),
    Drawing(WHY, lambda data, found: [robot_why.why(data)]),
    Drawing(NUMERICS),  # in the table only
    Drawing(FILMS, films=lambda films: films),
    Drawing(COURSES, lambda data, found: courses.panels(data)),
    Drawing(ROBUST, lambda data, found: [courses_robust.panel(data)]),
    Drawing(
        ROBOT_COURSES, lambda data, found: [courses.strategies(data.compared), courses_robust.whole(data.conditions)]
    ),
    Drawing(COURSES_FILM, films=lambda films: films),
)
"""In the order in which figures stand on the page within their chapter, but for those that have the letters of the
paper's figure: these come first, in its order."""
