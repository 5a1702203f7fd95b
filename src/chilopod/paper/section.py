"""Sections of the report, and what they find."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from chilopod.paper.movies import Movie
from chilopod.paper.size import Size
from chilopod.paper.statements import ORDER
from chilopod.paper.table import OfPlanar, OfTwin, RobotRow, Row, robot_rows
from chilopod.progress import Progress
from chilopod.robot import Robot, load_robot
from chilopod.show.panel import Panel

T = TypeVar("T")
Line = Row | OfTwin | OfPlanar


@dataclass(frozen=True)
class Context:
    """Ground that sections are computed from.

    Attributes
    ----------
    robot
        Robot of the planar model; the paper's numbers are those of ``aoi2022-planar``.
    whole
        Whole of the sections in three dimensions, with a twin.
    size
        Amount of every computation.
    folder
        Folder of the records of trials, with which a stopped computation is resumed; without one nothing is
        kept.
    """

    robot: Robot = field(default_factory=lambda: load_robot("aoi2022-planar"))
    whole: Robot = field(default_factory=lambda: load_robot("aoi2022"))
    size: Size = Size.FULL
    folder: Path | None = None


@dataclass(frozen=True, eq=False)
class Section(Generic[T]):
    """A part of the report: something that is computed, its lines of the tables, its figures and films.

    Attributes
    ----------
    name
        Name on the command line.
    chapter
        Chapter of the page.
    sentence
        Description in a few words.
    compute
        Finds it, given the context, what the sections it needs have found, and where to say how far it is.
    rows
        Its lines of the tables, given what it found and what the sections it needs have found.
    panels
        Its figures, given what it found and what the sections beside it have found.
    films
        Its films, given what it found.
    needs
        Other sections whose results it uses where they were computed; they come before it.
    beside
        Other sections that its figures show where they were computed; they are drawn once more when these are.
    beyond
        True if it goes beyond the paper's own experiments.
    on_request
        True if it is computed only if it is asked for by name.
    full
        True if it is left out of a quick report unless it is asked for by name.
    """

    name: str
    chapter: str
    sentence: str
    compute: Callable[[Context, Found, Progress], T]
    rows: Callable[[T, Found], Sequence[Line]] = lambda value, found: ()
    panels: Callable[[T, Found], Iterable[Panel]] = lambda value, found: ()
    films: Callable[[T], Iterable[Movie]] = lambda value: ()
    needs: tuple[Section[Any], ...] = ()
    beside: tuple[Section[Any], ...] = ()
    beyond: bool = False
    on_request: bool = False
    full: bool = False


@dataclass
class Found:
    """Results by section: ``found[section]`` is its result, None if there is none.

    Attributes
    ----------
    context
        Robots, size and folder of the computation.
    values, rows, seconds
        Values, rows and seconds of the sections that were computed: result, lines of the tables, and how long it took.
    failures
        Errors of sections that could not be computed.
    """

    context: Context = field(default_factory=Context)
    values: dict[Section[Any], Any] = field(default_factory=dict)
    rows: dict[Section[Any], Sequence[Line]] = field(default_factory=dict)
    seconds: dict[Section[Any], float] = field(default_factory=dict)
    failures: dict[Section[Any], Exception] = field(default_factory=dict)

    def __getitem__(self, section: Section[T]) -> T | None:
        return self.values.get(section)

    def __contains__(self, section: Section[Any]) -> bool:
        """True if it was computed, or failed."""
        return section in self.values or section in self.failures

    def add(self, section: Section[T], value: T) -> None:
        """Keep a result, and make its lines of the tables."""
        rows = section.rows(value, self.seen_by(section.needs))
        self.values[section], self.rows[section] = value, rows

    def seen_by(self, needs: Iterable[Section[Any]]) -> Found:
        """The results of some sections; asking for others fails."""
        return _Seen(self.context, {section: self[section] for section in needs})

    def copy(self) -> Found:
        """As it is now, whatever is added later."""
        return Found(self.context, {**self.values}, {**self.rows}, {**self.seconds}, {**self.failures})

    def planar_rows(self) -> dict[str, list[Row]]:
        """The table paper | planar model, by chapter."""
        found: dict[str, list[Row]] = {}
        for section, rows in self.rows.items():
            found.setdefault(section.chapter, []).extend(row for row in rows if isinstance(row, Row))
        return {chapter: rows for chapter, rows in found.items() if rows}

    def robot_rows(self) -> list[RobotRow]:
        """The table robot | twin | planar model."""
        return robot_rows((row for rows in self.rows.values() for row in rows), ORDER)


class _Seen(Found):
    """Insists that what is used was said to be needed."""

    def __getitem__(self, section: Section[T]) -> T | None:
        if section not in self.values:
            raise KeyError(f"{section.name} is not among the sections that are needed")
        return super().__getitem__(section)
