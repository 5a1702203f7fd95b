"""Registry of the report's sections, in the order in which they are computed and shown; loads nothing heavy."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chilopod.paper.section import Section

REGISTRY: dict[str, str] = {
    "mode": "straight.sections.MODE",
    "exponents": "straight.sections.EXPONENTS",
    "variants": "straight.sections.VARIANTS",
    "modules": "straight.sections.MODULES",
    "uniform": "straight.sections.UNIFORM",
    "curved": "curved.sections.CURVED",
    "branch": "curved.sections.BRANCH",
    "undulation": "curved.sections.UNDULATION",
    "turning": "turning.sections.TURNING",
    "movies": "turning.sections.MOVIES",
    "robot-walks": "robot.sections.WALKS",
    "robot-turning": "robot.sections.TASKS",
    "robot-movies": "robot.sections.FILMS",
    "identification": "straight.sections.IDENTIFICATION",
    "robot-spread": "robot.sections.SPREAD",
    "robot-numerics": "robot.sections.NUMERICS",
    "robot-structures": "robot.sections.STRUCTURES",
    "robot-why": "robot.sections.WHY",
    "courses": "courses.sections.COURSES",
    "courses-robust": "courses.sections.ROBUST",
    "robot-courses": "courses.sections.ROBOT_COURSES",
    "courses-movie": "courses.sections.COURSES_FILM",
}
"""Module below :mod:`chilopod.paper` and constant of each section, by its name."""


def load_sections() -> tuple[Section[Any], ...]:
    """All sections that are registered."""
    homes = (home.rpartition(".") for home in REGISTRY.values())
    return tuple(getattr(import_module(f"chilopod.paper.{module}"), name) for module, _, name in homes)
