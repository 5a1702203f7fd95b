"""Lines of the two tables: the paper's planar model beside ours, and its robot beside the twin and the planar model.

What the paper says of its robot is a :class:`Statement`. What the twin makes of it and what the planar model does are
found by different sections, and put into one line by :func:`robot_rows`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

from chilopod.paper.printed import Band, Said
from chilopod.paper.scatter import Answer

S = TypeVar("S", bound=Said, covariant=True)

AGREES: Mapping[Answer, str] = {True: "agrees", False: "differs", None: "undecided"}
"""Verdicts on the planar model; undecided is what the scatter of trials leaves open."""

NOT_PRINTED = "not printed"
"""In place of a verdict on what the paper does not say of its planar model."""

WITHIN: Mapping[Answer, str] = {True: "within", False: "outside", None: "undecided"}
"""Verdicts on the twin."""

NOT_COMPUTED = "not computed"
"""In place of a verdict on a twin that was not asked."""


@dataclass(frozen=True)
class Row:
    """A line of the table paper | planar model.

    Attributes
    ----------
    quantity, paper, computed
        In words and numbers with units; ``paper`` says so where it prints none.
    where
        Section or figure of the paper.
    verdict
        One of :data:`AGREES`, or :data:`NOT_PRINTED`.
    remark
        Reason for a difference, if there is one.
    """

    quantity: str
    paper: str
    computed: str
    where: str
    verdict: str
    remark: str = ""


class Kind(Enum):
    """Whether the twin's constants were fitted to what is said; "checked" is what is about the twin itself."""

    FITTED = "fitted"
    PREDICTED = "predicted"
    CHECKED = "checked"


@dataclass(frozen=True)
class Statement(Generic[S]):
    """Something that the paper says of its robot, or that is asked of the twin besides.

    Attributes
    ----------
    quantity
        Subject of the statement.
    said
        Statement of the paper and condition on the twin, on a number if it is a :class:`Band`.
    kind
        True if the twin was fitted to it.
    """

    quantity: str
    said: S
    kind: Kind


@dataclass(frozen=True)
class OfTwin:
    """What the twin does.

    Attributes
    ----------
    statement
        Statement of the paper's robot.
    words
        In words and numbers with units.
    answer
        True if that is what is asked.
    reading
        Reading of what the paper leaves open, if the twin has several.
    """

    statement: Statement[Said]
    words: str
    answer: Answer
    reading: str = ""


@dataclass(frozen=True)
class OfPlanar:
    """What the planar model does where the paper speaks of its robot; nobody says that it should do the same."""

    statement: Statement[Said]
    words: str


@dataclass(frozen=True)
class RobotRow:
    """A line of the table robot | twin | planar model.

    Attributes
    ----------
    quantity, robot
        See :class:`Statement`.
    twin, planar
        Results of both, in words and numbers with units; empty where nothing was computed.
    kind
        One of :class:`Kind`.
    verdict
        One of :data:`WITHIN`, or :data:`NOT_COMPUTED`.
    asked
        Condition for a verdict of *within*.
    """

    quantity: str
    robot: str
    twin: str
    planar: str
    kind: str
    verdict: str
    asked: str


def of_twin(statement: Statement[Band], words: str, value: float, error: float = 0.0, reading: str = "") -> OfTwin:
    """A number, with its standard error, beside what is asked of it."""
    return OfTwin(statement, words, statement.said.answer(value, error), reading)


def robot_rows(found: Iterable[Row | OfTwin | OfPlanar], order: Iterable[Statement[Said]]) -> list[RobotRow]:
    """What was found of statements, in their order; others come behind."""
    rows, lines = [row for row in found if not isinstance(row, Row)], []
    for each in dict.fromkeys([*order, *(row.statement for row in rows)]):
        said, kind = each.said, each.kind.value
        planar = "; ".join(row.words for row in rows if isinstance(row, OfPlanar) and row.statement == each)
        twins = [row for row in rows if isinstance(row, OfTwin) and row.statement == each]
        for twin in twins:
            quantity = f"{each.quantity} ({twin.reading})" if twin.reading else each.quantity
            lines.append(RobotRow(quantity, said.words, twin.words, planar, kind, WITHIN[twin.answer], said.asked))
        if planar and not twins:
            lines.append(RobotRow(each.quantity, said.words, "", planar, kind, NOT_COMPUTED, said.asked))
    return lines
