"""Lines of the robot's table about its turning tasks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.printed import printed
from chilopod.paper.robot.table import (
    ARRIVAL,
    FITTED,
    K_HAT,
    PREDICTED,
    VERDICTS,
    Planar,
    percent,
    with_error,
)
from chilopod.paper.robot.turning import PAPER_SPRING, RobotTurning
from chilopod.paper.robot.walk_measures import spring_for
from chilopod.paper.robot.walks import RobotWalks
from chilopod.paper.scatter import SURE, near
from chilopod.paper.table import RobotRow
from chilopod.paper.turning import hopf
from chilopod.paper.turning.minima import AROUND, NAMES, SCALES, around, minima
from chilopod.paper.turning.trials import springs_by_outcome
from chilopod.steering import Outcome


def turning_rows(found: RobotTurning, walks: RobotWalks | None, planar: Planar) -> list[RobotRow]:
    """The turning tasks."""
    rows: list[RobotRow] = []
    for letter, task in found.tasks.items():
        entry = printed()["turning"]["tasks"][letter]
        k_hat = float(entry["k_hat"].split()[0])
        if walks is not None:
            own, error = spring_for(walks.base, task.target.radius)
            rows.append(
                RobotRow(
                    f"task {letter}: k1 whose walk has the radius of the circle",
                    entry["k_hat"],
                    f"{with_error(own, error, 1)} {PAPER_UNIT}" if np.isfinite(own) else "none of the springs walked",
                    planar.get(f"k_hat {letter}", ""),
                    PREDICTED,
                    VERDICTS[near(own, error, k_hat, K_HAT)],
                    percent(K_HAT),
                )
            )
        outcomes = springs_by_outcome(task.criteria)
        said = "; ".join(
            f"{label} at {', '.join(f'{k:g}' for k in outcomes[label])}"
            for label in (Outcome.OUTSIDE.label, Outcome.ARRIVED.label, Outcome.INSIDE.label)
            if outcomes[label]
        )
        rows.append(_outcomes(task.criteria, letter, entry, k_hat, said, planar))
        low = minima(task.criteria)
        for name, title in NAMES.items():
            at, (factor, unit) = low.sel(criterion=name), SCALES[name]
            spring = float(at["at"])
            rows.append(
                RobotRow(
                    f"task {letter}: smallest {title}",
                    f"around k1 = {k_hat:g} {PAPER_UNIT}",
                    f"{factor * float(at['mean']):.3g} ± {factor * float(at['error']):.2g} {unit} at k1 = {spring:.3g} "
                    f"(no worse: {float(at.softest):g} to {float(at.stiffest):g})",
                    planar.get(f"{name} {letter}", ""),
                    PREDICTED,
                    VERDICTS[around(at, k_hat)],
                    f"{AROUND[0] * k_hat:.3g} to {AROUND[1] * k_hat:.3g} {PAPER_UNIT}, with all that are no worse",
                )
            )
    return [*rows, _arrival(found, planar), _without(found, planar), _hopf(found, planar)]


def _outcomes(
    criteria: xr.Dataset, letter: str, entry: Mapping[str, Any], k_hat: float, said: str, planar: Planar
) -> RobotRow:
    """What became of the task: at the paper's own springs, or between two that miss to either side."""
    outcomes = springs_by_outcome(criteria)
    if "outcomes" in entry:
        wanted = {label: float(text.split()[0]) for label, text in entry["outcomes"].items()}
        met = all(k in outcomes[label] for label, k in wanted.items())
        every = bool((criteria.outcome.sel(spring=k_hat) == Outcome.ARRIVED.label).all())
        robot = ", ".join(f"{label} at {k:g}" for label, k in wanted.items()) + f" {PAPER_UNIT}, all five at {k_hat:g}"
        asked = "the same at these springs, and all repeats arrive"
    else:
        met = bool(outcomes[Outcome.OUTSIDE.label] and outcomes[Outcome.INSIDE.label])
        every = k_hat in outcomes[Outcome.ARRIVED.label]
        robot, asked = f"best around {k_hat:g} {PAPER_UNIT}", "arrives there; stiffer miss outside, softer inside"
    return RobotRow(
        f"task {letter}: what becomes of it",
        robot,
        said,
        planar.get(f"outcomes {letter}", ""),
        PREDICTED,
        VERDICTS[met and every],
        asked,
    )


def _arrival(found: RobotTurning, planar: Planar) -> RobotRow:
    paper, task = printed()["turning"]["evaluation_time"], found.tasks["A"]
    arrives, time = bool(np.isfinite(task.criteria.arrival).any()), task.time
    return RobotRow(
        "task A: earliest arrival",
        paper,
        f"{time:.1f} s" if arrives else "none arrives",
        planar.get("arrival", ""),
        FITTED,
        VERDICTS[arrives and near(time, 0.0, units.parse(paper, "s"), ARRIVAL)],
        percent(ARRIVAL),
    )


def _without(found: RobotTurning, planar: Planar) -> RobotRow:
    data = found.without
    alone, helped = (data.isel(case=int(np.flatnonzero(data.leg_yaw.values == which)[0])) for which in (False, True))
    counts = [(int(np.nansum(case.arrived)), int(np.isfinite(case.arrived).sum())) for case in (alone, helped)]
    left = int((alone.turned > 0.0).sum())
    return RobotRow(
        f"task A without leg yaw, k1 = {PAPER_SPRING:g} {PAPER_UNIT}",
        "many of 9 fail, with it 5 of 5 arrive",
        f"{counts[0][0]} of {counts[0][1]} arrive ({left} turn left), with it {counts[1][0]} of {counts[1][1]}",
        planar.get("without", ""),
        PREDICTED,
        VERDICTS[counts[0][0] <= counts[0][1] // 2 and counts[1][0] == counts[1][1]],
        "at most 4 arrive without, all with",
    )


def _hopf(found: RobotTurning, planar: Planar) -> RobotRow:
    task = found.tasks["A"]
    return RobotRow(
        "task A, pitchfork against Hopf: smallest criteria",
        "lower for the pitchfork, all three",
        f"{hopf.words(task, found.hopf)} ({hopf.saturation(task, found.hopf)})",
        planar.get("hopf", ""),
        PREDICTED,
        VERDICTS[hopf.all_lower(task, found.hopf)],
        f"all three lower, by {SURE:g} standard errors",
    )
