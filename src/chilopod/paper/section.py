"""Sections of the report, their results, and their computation."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import xarray as xr

from chilopod.errors import OutputError
from chilopod.paper.statements import ORDER
from chilopod.paper.table import OfPlanar, OfTwin, RobotRow, Row, robot_rows
from chilopod.progress import Progress, silent
from chilopod.robot import Robot, load_robot
from chilopod.show.panel import Panel

S = TypeVar("S")
T = TypeVar("T")
Line = Row | OfTwin | OfPlanar

NEEDS_MORE = "needs more trials"
"""Words of a quick report for the studies that it leaves out."""

QUICK_REPEATS = 3
"""Walks of the whole robot with each spring in a quick report: the fewest whose scatter gives an interval."""

SectionProgress = Callable[[str, float, str], None]
"""Function of a section, the fraction of it that is done (0 to 1), and a few words."""


class Size(Enum):
    """Size of a report."""

    FULL = "the paper's own experiments and everything beyond them"
    MAIN = "the paper's own experiments, and one headline of every chapter beyond them from fewer trials"
    QUICK = "the paper's main experiments; some of its trials and what goes beyond are left out"
    TINY = "every section, but hardly anything of it: walks of the whole robot are cut before they have settled"

    def of(self, full: S, quick: S, tiny: S) -> S:
        """Value for this size, out of three."""
        return {Size.FULL: full, Size.MAIN: full, Size.QUICK: quick, Size.TINY: tiny}[self]

    def cut(self, usual: S, tiny: S) -> S:
        """Value ``usual``, or ``tiny`` for a tiny report."""
        return self.of(usual, usual, tiny)

    def has(self, section: Section[Any]) -> bool:
        """True if a report of this size has a section without being asked for it by name."""
        beyond = self is not Size.QUICK and (self is not Size.MAIN or section.headline)
        return not section.on_request and (beyond or not section.beyond)

    def within(self, section: Section[Any]) -> Size:
        """Size of one section in a report of this size."""
        if self is not Size.MAIN:
            return self
        return Size.QUICK if section.beyond else Size.FULL


@dataclass(frozen=True)
class Context:
    """Robots, size and folder of a report; the paper's numbers are those of ``aoi2022-planar`` and ``aoi2022``."""

    robot: Robot = field(default_factory=lambda: load_robot("aoi2022-planar"))  # of the planar model
    whole: Robot = field(default_factory=lambda: load_robot("aoi2022"))  # of the sections in three dimensions
    size: Size = Size.FULL  # amount of every computation
    folder: Path | None = None  # of the records of trials, which are not walked again


@dataclass(frozen=True, eq=False)
class Movie:
    """A film of walks side by side."""

    name: str  # of its files
    heading: str  # above all panels
    titles: tuple[str, ...]  # of the panels
    record: xr.Dataset
    speed: float  # seconds of the walks per second of the film
    fps: int = 25  # frames per second
    stills: tuple[float, ...] = ()  # moments of it that are pictured in three dimensions, s; none of a film from above
    size: tuple[int, int] = (1280, 320)  # of a film from above, pixels; that of three panels in a row
    follow: bool = False  # True if every panel follows its robot, from near


def nothing(*found: object) -> Sequence[Any]:
    """No rows, panels or films."""
    return ()


@dataclass(frozen=True, eq=False)
class Section(Generic[T]):
    """Part of the report: a computation, its lines of the tables, its figures and films."""

    name: str  # on the command line
    chapter: str  # of the page
    sentence: str  # description in a few words
    compute: Callable[..., T]  # of the context, where to say how far it is, and the results of what it needs
    rows: Callable[..., Sequence[Line]] = nothing  # of what was computed and the results of what it needs
    panels: Callable[..., Panel | Iterable[Panel]] = nothing  # of what was computed, and of the sections beside it
    films: Callable[[T], Iterable[Movie]] = nothing  # of what was computed
    needs: tuple[Section[Any], ...] = ()  # come before it
    beside: tuple[Section[Any], ...] = ()  # shown in its figures, which are drawn again when they are there
    beyond: bool = False  # beyond the paper's own experiments
    headline: bool = False  # the one of its chapter beyond them that a main report has
    on_request: bool = False  # computed only if it is asked for by name
    ahead: bool = False  # its trials need no compiled code: another process walks them from the start

    def figures(self, found: Found) -> list[Panel]:
        """Figures of the results."""
        drawn = self.panels(found[self], *found.of(self.beside))
        return [drawn] if isinstance(drawn, Panel) else list(drawn)


@dataclass
class Found:
    """Results by section: ``found[section]`` is the result, or None."""

    context: Context = field(default_factory=Context)  # of the computation
    values: dict[Section[Any], Any] = field(default_factory=dict)  # results
    rows: dict[Section[Any], Sequence[Line]] = field(default_factory=dict)  # lines of the tables
    seconds: dict[Section[Any], float] = field(default_factory=dict)  # durations
    failures: dict[Section[Any], Exception] = field(default_factory=dict)  # errors of those that could not be computed

    def __getitem__(self, section: Section[T]) -> T | None:
        return self.values.get(section)

    def __contains__(self, section: Section[Any]) -> bool:
        """True if it was computed, or failed."""
        return section in self.values or section in self.failures

    def of(self, sections: Iterable[Section[Any]]) -> list[Any]:
        """Results of some sections."""
        return [self[section] for section in sections]

    def add(self, section: Section[T], progress: Progress = silent) -> None:
        """Compute a section, and make its lines of the tables."""
        needed = self.of(section.needs)
        value = section.compute(replace(self.context, size=self.context.size.within(section)), progress, *needed)
        rows = section.rows(value, *needed)
        self.values[section], self.rows[section] = value, rows

    def copy(self) -> Found:
        """Copy that does not change when results are added."""
        return Found(self.context, {**self.values}, {**self.rows}, {**self.seconds}, {**self.failures})

    def planar_rows(self) -> dict[str, list[Row]]:
        """The table paper | planar model, by chapter."""
        found: dict[str, list[Row]] = {}
        for section, rows in self.rows.items():
            found.setdefault(section.chapter, []).extend(row for row in rows if isinstance(row, Row))
        return {chapter: rows for chapter, rows in found.items() if rows}

    def robot_rows(self) -> list[RobotRow]:
        """Rows of the table robot | twin | planar model."""
        rows = [row for each in self.rows.values() for row in each]
        left_out = self.context.size is Size.QUICK and any(isinstance(row, OfTwin) for row in rows)
        return robot_rows(rows, ORDER, NEEDS_MORE if left_out else "")


def reproduce(
    sections: Sequence[Section[Any]],
    context: Context | None = None,
    progress: SectionProgress = lambda what, done, words: None,
    callback: Callable[[Found, Section[Any]], None] = lambda found, section: None,
    ready: Callable[[Section[Any]], bool] = lambda section: False,
) -> Found:
    """Compute sections of the report; one that fails does not keep the others from being computed.

    ``sections`` are those of :func:`chilopod.paper.registry.chosen`, the context by default that of the paper's robots.
    ``progress`` is called during the work. ``callback`` is called after every section, with all results so far and the
    section. Sections that are ``ready``, as their trials are kept, come before others, except the first. An OutputError
    is raised if the folder of the trials cannot be used.
    """
    found = Found(context or Context())
    left = list(sections)
    while left:
        section = next(filter(ready, left), left[0]) if found.seconds else left[0]
        left.remove(section)
        started, report = time.perf_counter(), partial(progress, section.sentence)
        report(0.0, section.sentence)
        try:
            found.add(section, report)
        except OutputError:  # where nothing can be written any more, no other section fares better
            raise
        except Exception as error:
            found.failures[section] = error
        found.seconds[section] = time.perf_counter() - started
        report(1.0, "failed" if section in found.failures else "done")
        callback(found, section)
    return found
