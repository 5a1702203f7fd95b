"""Head of a page: the findings in five sentences."""

from __future__ import annotations

from chilopod.paper.section import Found
from chilopod.paper.straight.sections import MODE, UNIFORM
from chilopod.paper.table import Kind, Verdict
from chilopod.paper.turning.sections import TURNING
from chilopod.paper.turning.trials import outcome_words, span
from chilopod.show.words import SPRING_UNIT, spring


def _predictions(found: Found) -> list[Verdict]:
    """Verdicts on statements that the twin was not fitted to."""
    return [row.verdict for row in found.robot_rows() if row.twin and row.kind == Kind.PREDICTED.value]


def summary(results: Found) -> str:
    """Findings, in five plain sentences at most."""
    parts, mode, uniform, turning = [], results[MODE], results[UNIFORM], results[TURNING]
    modules = results.context.robot.body.modules
    parts.append(
        f"A {modules}-module robot walks straight as long as the springs between its modules are "
        "stiff enough; below a critical stiffness the straight walk cannot hold, and the body bends by itself."
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
    return " ".join(parts)
