"""Lines of the two tables: the paper's planar model beside ours, and its robot beside the twin and the planar model.

A statement of the paper on its robot is a :class:`Statement`. Different sections find the results of the twin and of
the planar model, and :func:`robot_rows` puts them into one line.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum, StrEnum
from typing import Any, Generic, TypeVar

import numpy as np

from chilopod.paper.printed import Band, Said
from chilopod.show.words import listing
from chilopod.statistics import LEVEL, Answer, Comparison, Estimate, holm

S = TypeVar("S", bound=Said, covariant=True)

INCREASES: Mapping[Answer, str] = {True: "increases", False: "not throughout", None: "not told apart everywhere"}
"""Words for the answers of :func:`chilopod.statistics.increases`."""


class Verdict(StrEnum):
    """Result of a comparison: of the planar model with the paper's, of the twin with the paper's robot, or none."""

    AGREES = "agrees"
    DIFFERS = "differs"
    WITHIN = "within"
    OUTSIDE = "outside"
    UNDECIDED = "undecided"  # the scatter of trials leaves it open
    NOT_DETERMINED = "not determined"  # the trials give no number
    NOT_PRINTED = "not printed"
    NOT_COMPUTED = "not computed"


def agreement(answer: Answer) -> Verdict:
    """Verdict on the planar model."""
    return Verdict.UNDECIDED if answer is None else Verdict.AGREES if answer else Verdict.DIFFERS


def within(answer: Answer) -> Verdict:
    """Verdict on the twin."""
    return Verdict.UNDECIDED if answer is None else Verdict.WITHIN if answer else Verdict.OUTSIDE


@dataclass(frozen=True)
class Result:
    """Result of a computation."""

    text: str = ""  # for what is not one number, or with more than it; by default the number with error and unit
    value: float = np.nan  # that is compared
    error: float = np.nan  # its standard error or the bound of its error, NaN where there is none
    unit: str = ""
    digits: int = 2  # decimals that are shown

    @property
    def words(self) -> str:
        """Text, or the number with its error and unit."""
        error = f" ± {self.error:.{self.digits}f}" if self.error > 0.0 else ""
        return self.text or f"{self.value:.{self.digits}f}{error} {self.unit}".rstrip()

    def data(self) -> dict[str, Any]:
        """Number, error and unit as plain data, None where there is none."""
        number = float(self.value) if np.isfinite(self.value) else None
        return {"value": number, "error": float(self.error) if self.error > 0.0 else None, "unit": self.unit or None}


@dataclass(frozen=True)
class Row:
    """A line of the table paper | planar model."""

    quantity: str  # subject of the line
    paper: str  # statement of the paper in words; it says so where the paper prints none
    computed: Result
    where: str  # its place there
    verdict: Verdict
    remark: str = ""  # reason for a difference, if there is one

    def data(self) -> dict[str, Any]:
        """The line as plain data, with the result in words and as a number."""
        return {**vars(self), "computed": self.computed.words, **self.computed.data()}


def unprinted(quantity: str, computed: Result | str, where: str, remark: str = "") -> Row:
    """A line on something of which the paper prints nothing."""
    result = Result(computed) if isinstance(computed, str) else computed
    return Row(quantity, Verdict.NOT_PRINTED, result, where, Verdict.NOT_PRINTED, remark)


class Kind(Enum):
    """Kind of a statement: fitted, predicted, or "checked", which is about the twin itself."""

    FITTED = "fitted"
    PREDICTED = "predicted"
    CHECKED = "checked"


@dataclass(frozen=True)
class Statement(Generic[S]):
    """Statement of the paper on its robot, or a further condition on the twin: subject, statement and condition on the
    twin, on a number if it is a :class:`Band`, and whether the twin was fitted to it."""

    quantity: str
    said: S
    kind: Kind


@dataclass(frozen=True)
class OfTwin:
    """Result of the twin, its verdict, the reading of the paper, if it allows several, and the comparison behind the
    verdict, if it rests on trials that scatter."""

    statement: Statement[Said]
    result: Result
    verdict: Verdict
    reading: str = ""
    comparison: Comparison | None = None


@dataclass(frozen=True)
class OfPlanar:
    """Result of the planar model beside a statement on the robot; it is not judged."""

    statement: Statement[Said]
    result: Result


@dataclass(frozen=True)
class RobotRow:
    """A line of the table robot | twin | planar model; results are empty where nothing was computed."""

    statement: Statement[Said]
    quantity: str  # subject, with the reading of the statement if there are several
    robot: str  # words of the statement
    twin: Result | None
    planar: tuple[Result, ...]
    kind: str  # one of :class:`Kind`
    verdict: Verdict  # on the twin
    asked: str  # condition for a verdict of *within*
    p: float | None = None  # of the comparison behind the verdict; None for one that does not rest on scatter
    needs: str = ""  # words on the number of trials that would decide
    absent: str = ""  # words where the twin has no result

    def data(self) -> dict[str, Any]:
        """The line as plain data, with results in words and as numbers."""
        words = {
            "twin": self.twin.words if self.twin else self.absent,
            "planar": "; ".join(each.words for each in self.planar),
        }
        twin = (self.twin or Result()).data()
        planar = (self.planar[0] if len(self.planar) == 1 else Result()).data()
        line = {name: value for name, value in vars(self).items() if name not in ("statement", "absent")}
        return {**line, **words, **twin, "planar_value": planar["value"]}


def of_twin(statement: Statement[Band], result: Result, reading: str = "") -> OfTwin:
    """A number without an error beside the band in which it is to lie; such a number says so in its words."""
    verdict = within(statement.said.holds(result.value)) if np.isfinite(result.value) else Verdict.NOT_DETERMINED
    return OfTwin(statement, result, verdict, reading)


def estimated(
    statement: Statement[Band], found: Estimate, unit: str, digits: int = 2, words: str = "", none: str = ""
) -> OfTwin:
    """A number from trials beside the band in which it is to lie, in its words, or as a number; words for ``none``."""
    known = np.isfinite(found.value)
    result = Result(words if known else none or words, found.value, found.error, unit, digits)
    if not known:
        return OfTwin(statement, result, Verdict.NOT_DETERMINED)
    return compared(statement, result, found.between(statement.said.low, statement.said.high))


def compared(statement: Statement[Said], result: Result, comparison: Comparison) -> OfTwin:
    """A result with a verdict that rests on trials that scatter."""
    return OfTwin(statement, result, within(comparison.answer), comparison=comparison)


def robot_rows(
    found: Iterable[Row | OfTwin | OfPlanar], order: Iterable[Statement[Said]], absent: str = ""
) -> list[RobotRow]:
    """Rows on statements, in their order, with words where the twin has no result; others come behind."""
    rows, lines = [row for row in found if not isinstance(row, Row)], []
    for each in dict.fromkeys([*order, *(row.statement for row in rows)]):
        said, kind = each.said, each.kind.value
        planar = tuple(row.result for row in rows if isinstance(row, OfPlanar) and row.statement == each)
        twins = [row for row in rows if isinstance(row, OfTwin) and row.statement == each]
        for twin in twins:
            quantity = f"{each.quantity} ({twin.reading})" if twin.reading else each.quantity
            line = RobotRow(each, quantity, said.words, twin.result, planar, kind, twin.verdict, said.condition)
            if twin.comparison is not None:
                p = twin.comparison.p
                line = replace(line, p=p if np.isfinite(p) else None, needs=twin.comparison.needs)
            lines.append(line)
        if planar and not twins:
            none = Verdict.NOT_COMPUTED
            lines.append(
                RobotRow(each, each.quantity, said.words, None, planar, kind, none, said.condition, absent=absent)
            )
    return lines


def at_once(rows: Iterable[RobotRow]) -> str:
    """Statement about all comparisons of a table at once, in words; empty if none rests on scatter."""
    tested = [(row.quantity, row.p) for row in rows if row.p is not None]
    if not tested:
        return ""
    p, edge = [each for _, each in tested], 1.0 - LEVEL
    decided, left = [each < edge for each in p], holm(p)
    fallen = [name for (name, _), was, still in zip(tested, decided, left, strict=True) if was and not still]
    return (
        f"{len(p)} verdicts rest on trials that scatter: were all at the edge of what is asked, chance would decide "
        f"{edge * len(p):.1f} of them. {sum(decided)} {'is' if sum(decided) == 1 else 'are'} "
        f"decided, {sum(left)} with a chance of {100.0 * edge:.0f} % of any error "
        f"among all (Holm){f', not these: {listing(fallen)}' if fallen else ''}."
    )
