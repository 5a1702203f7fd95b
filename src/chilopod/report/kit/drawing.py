"""What is drawn of a section."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from chilopod.paper.movies import Movie
from chilopod.paper.section import Found, Section
from chilopod.report.kit.panel import Panel

T = TypeVar("T")


@dataclass(frozen=True)
class Drawing(Generic[T]):
    """The figures and films of a section.

    Attributes
    ----------
    section
        What is drawn.
    panels
        Its figures, given what it found and what the sections beside it have found.
    films
        Its films.
    beside
        Other sections that are seen in its figures where they were computed; it is drawn once more when they are.
    """

    section: Section[T]
    panels: Callable[[T, Found], Iterable[Panel]] = lambda value, found: ()
    films: Callable[[T], Iterable[Movie]] = lambda value: ()
    beside: tuple[Section[Any], ...] = ()
