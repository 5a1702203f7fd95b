"""Lines of the robot's table about its turning tasks."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper import printed, statements
from chilopod.paper.printed import Task
from chilopod.paper.robot.turning import RobotTurning
from chilopod.paper.robot.walks import RobotWalks
from chilopod.paper.table import OfTwin, Result, of_twin, within
from chilopod.paper.turning import hopf
from chilopod.paper.turning.minima import SCALES, around, minima
from chilopod.paper.turning.trials import LegYaw, arrivals, by_leg_yaw, outcome_words, springs_by_outcome
from chilopod.paper.walk_measures import spring_for
from chilopod.steering import Outcome


def turning_rows(found: RobotTurning, walks: RobotWalks | None) -> list[OfTwin]:
    """The turning tasks."""
    rows: list[OfTwin] = []
    for letter, task in found.tasks.items():
        said = statements.TASKS[letter]
        if walks is not None:
            own, error = spring_for(walks.base, task.target.radius)
            words = "" if np.isfinite(own) else "none of the springs walked"
            rows.append(of_twin(said.k_hat, Result(words, own, error, PAPER_UNIT, 1)))
        words = outcome_words(task.criteria, lambda springs: ", ".join(f"{k:g}" for k in springs))
        rows.append(OfTwin(said.outcomes, Result(words), within(_became(task.criteria, printed.TASKS[letter]))))
        low = minima(task.criteria)
        for name, statement in said.minima.items():
            at, (factor, unit) = low.sel(criterion=name), SCALES[name]
            words = (
                f"{factor * float(at['mean']):.3g} ± {factor * float(at['error']):.2g} {unit} at k1 = "
                f"{float(at['at']):.3g} (no worse: {float(at.softest):g} to {float(at.stiffest):g})"
            )
            rows.append(
                OfTwin(statement, Result(words, float(at["at"]), unit=PAPER_UNIT), within(around(at, statement.said)))
            )
    task = found.tasks["A"]
    time = task.time if (task.criteria.outcome == Outcome.ARRIVED.label).any() else np.nan
    arrival = f"{time:.1f} s, the earliest, which has no error" if np.isfinite(time) else "none arrives"
    own = walks.uniform.attrs["critical_k"] if walks else np.nan
    words, below = hopf.softest_minima(found.hopf, own if np.isfinite(own) else printed.UNIFORM.value)
    return [
        *rows,
        of_twin(statements.ARRIVAL, Result(arrival, time, 0.0, "s")),
        *(
            OfTwin(statements.WITHOUT, Result(str(each)), within(_needs_leg_yaw(each)))
            for each in by_leg_yaw(found.without)
        ),
        OfTwin(
            statements.HOPF,
            Result(f"{hopf.words(task, found.hopf)} ({hopf.saturation(task, found.hopf)})"),
            within(hopf.all_lower(task, found.hopf)),
        ),
        OfTwin(statements.HOPF_SPRINGS, Result(words), within(below)),
    ]


def _became(criteria: xr.Dataset, task: Task) -> bool:
    """True if that becomes of a task at the paper's own springs, or between two that miss to either side."""
    outcomes, k_hat = springs_by_outcome(criteria), task.k_hat.value
    if not task.outcomes:
        return bool(outcomes[Outcome.OUTSIDE] and outcomes[Outcome.INSIDE]) and k_hat in outcomes[Outcome.ARRIVED]
    met = all(spring in outcomes[outcome] for outcome, spring in task.outcomes.items())
    return met and bool((criteria.outcome.sel(spring=k_hat) == Outcome.ARRIVED.label).all())


def _needs_leg_yaw(walks: LegYaw) -> bool:
    """True if many fail without leg yaw, and none with it."""
    (few, without), (many, with_) = arrivals(walks.alone), arrivals(walks.helped)
    return few <= without // 2 and many == with_
