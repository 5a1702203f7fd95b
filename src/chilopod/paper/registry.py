"""Registry of the report's sections, in the order in which they are computed and shown; loads nothing heavy."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from chilopod.errors import ParameterError, nearest_name

if TYPE_CHECKING:
    from chilopod.paper.section import Section, Size

REGISTRY: dict[str, str] = {
    "exponents": "straight.sections.EXPONENTS",  # needs the least compiled code: the first figure comes soonest
    "mode": "straight.sections.MODE",
    "variants": "straight.sections.VARIANTS",
    "modules": "straight.sections.MODULES",
    "uniform": "straight.sections.UNIFORM",
    "curved": "curved.sections.CURVED",
    "branch": "curved.sections.BRANCH",
    "undulation": "curved.sections.UNDULATION",
    "turning": "turning.sections.TURNING",
    "movies": "turning.sections.MOVIES",
    "robot-walks": "robot.sections.WALKS",
    "robot-movies": "robot.sections.FILMS",
    "robot-turning": "robot.sections.TASKS",
    "identification": "straight.sections.IDENTIFICATION",
    "robot-strategies": "robot.sections.STRATEGIES",
    "robot-spread": "robot.sections.SPREAD",
    "robot-numerics": "robot.sections.NUMERICS",
    "robot-structures": "robot.sections.STRUCTURES",
    "robot-why": "robot.sections.WHY",
    "robot-why-sets": "robot.sections.WHY_SETS",
    "courses": "courses.sections.COURSES",
    "courses-robust": "courses.sections.ROBUST",
    "robot-courses": "courses.sections.ROBOT_COURSES",
    "courses-movie": "courses.sections.COURSES_FILM",
    "scaling": "atlas.scaling.SCALING",
    "atlas": "atlas.maps.ATLAS",
}
"""Module and constant of each section, by its name: the paper's own experiments, then the studies beyond them."""


def load_sections() -> tuple[Section[Any], ...]:
    """All sections that are registered."""
    homes = (home.rpartition(".") for home in REGISTRY.values())
    return tuple(getattr(import_module(f"chilopod.paper.{module}"), name) for module, _, name in homes)


def chosen(only: Iterable[str] | None = None, size: Size | None = None, paper: bool = False) -> list[Section[Any]]:
    """Sections of a report, in the order in which they are computed: those of ``only``, else those of a report of
    ``size``, else all but those computed on request. With ``paper``, studies beyond the paper are left out.

    Raises ParameterError if a named section does not exist, or goes beyond the paper in a report of the paper.
    """
    sections = {section.name: section for section in load_sections()}
    if only is None:
        found = [each for each in sections.values() if (size.has(each) if size else not each.on_request)]
        return [section for section in found if not (paper and section.beyond)]
    names = list(only)
    for name in names:
        if name not in sections:
            near, allowed = nearest_name(name, sections), ", ".join(sections)
            raise ParameterError("must be a section", field="only", value=name, allowed=allowed, nearest=near)
    found = [section for name, section in sections.items() if name in names]
    for section in found:
        if paper and section.beyond:
            raise ParameterError("goes beyond the paper's own experiments", field="only", value=section.name)
    return found
