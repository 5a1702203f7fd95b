"""Head of a page: the findings in a few sentences, and the numbers that matter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from chilopod.paper import printed, statements
from chilopod.paper.section import Found
from chilopod.paper.straight.sections import MODE, UNIFORM
from chilopod.paper.table import Kind, Verdict
from chilopod.paper.turning.sections import TURNING
from chilopod.paper.turning.trials import outcome_words, span
from chilopod.show.words import SPRING_UNIT, listing, spring, typeset

_MOST_LISTED: Final = 4
_TOLD: Final = {
    statements.ONSET: "front spring at which the robot begins to curve, in three dimensions",
    statements.RADII[21.0]: "radius of its walk with a front spring of 21 N*mm/deg",
    statements.ARRIVAL: "earliest arrival at the target of task A",
}
"""Statements on the twin that stand at the top of the page."""


@dataclass(frozen=True)
class Fact:
    """A number that matters: value that is computed here, its description, and the paper's value, empty if there is
    none."""

    value: str
    about: str
    paper: str = ""


def facts(found: Found) -> list[Fact]:
    """The most important numbers of the results."""
    facts, mode = [], found[MODE]
    if mode is not None:
        about = "front spring at which the straight walk gives way, in the planar model"
        facts.append(Fact(spring(mode.attrs["value"], 5), about, typeset(str(printed.CRITICAL_K1))))
    twins = {row.statement: row.twin for row in found.robot_rows() if row.twin}
    for statement, about in _TOLD.items():
        if twin := twins.get(statement):
            facts.append(Fact(typeset(twin.words), typeset(about), typeset(statement.said.words)))
    if predicted := _predictions(found):
        about = "statements about the robot met by its twin that it was not fitted to"
        facts.append(Fact(f"{predicted.count(Verdict.WITHIN)} of {len(predicted)}", about))
    return facts


def _predictions(found: Found) -> list[Verdict]:
    """Verdicts on statements that the twin was not fitted to."""
    return [row.verdict for row in found.robot_rows() if row.twin and row.kind == Kind.PREDICTED.value]


def summary(results: Found) -> str:
    """Findings, in a few plain sentences."""
    parts, mode, uniform, turning = [], results[MODE], results[UNIFORM], results[TURNING]
    modules = results.context.robot.body.modules
    parts.append(
        f"A {modules}-module robot walks straight as long as the springs between its modules are "
        "stiff enough. Below a critical stiffness the straight walk cannot hold, and the body bends by itself."
    )
    if mode is not None:
        found = mode.attrs
        parts.append(
            f"Softening the front spring alone, that happens at {spring(found['value'], 5)}: a {found['criticality']} "
            f"{found['kind']}, and the robot turns left or right."
        )
    if uniform is not None:
        found = uniform.attrs
        parts.append(
            f"Softening all springs together, it happens at {spring(found['value'], 5)} and the body undulates, once "
            f"in {found['oscillation_period_s']:.1f} s."
        )
    if turning is not None:
        task = turning.tasks["A"]
        parts.append(
            f"Sent to a target at {task.target}, it comes nearest with a front spring of {spring(task.best, 3)}; most "
            f"walks have {outcome_words(task.criteria, span)}\u00a0{SPRING_UNIT}."
        )
    if predicted := _predictions(results):
        open_, none = predicted.count(Verdict.UNDECIDED), predicted.count(Verdict.NOT_DETERMINED)
        left = f"; {open_} more {'is' if open_ == 1 else 'are'} left open by the scatter of its trials" if open_ else ""
        left += f"; of {none} its trials determine nothing" if none else ""
        parts.append(
            "The same robot in three dimensions, its unknown constants fitted to the paper's base series of walks and "
            f"their speed alone, meets {predicted.count(Verdict.WITHIN)} of {len(predicted)} further statements about "
            f"the robot that it was not fitted to{left}."
        )
    rows = [row for part in results.planar_rows().values() for row in part]
    judged = [row.verdict for row in rows if row.verdict is not Verdict.NOT_PRINTED]
    if judged:
        differing = [typeset(row.quantity) for row in rows if row.verdict is Verdict.DIFFERS]
        said = [f"{judged.count(Verdict.AGREES)} agree"]
        if open_ := judged.count(Verdict.UNDECIDED):
            said.append(f"{open_} are left open by the scatter of the trials")
        if differing:
            listed = f": {listing(differing)}" if len(differing) <= _MOST_LISTED else ""
            said.append(f"{len(differing)} differ{listed}. The reasons are given below")
        parts.append(f"Of {len(judged)} statements of the paper about its planar model, {listing(said)}.")
    return " ".join(parts)
