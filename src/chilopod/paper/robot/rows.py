"""Lines of the robot's table about its walks and its turning tasks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper import printed, statements
from chilopod.paper.measures import change, law_ratio, onset_point, radius_at, radius_ratio, shares, spring_for
from chilopod.paper.printed import Band, Said, Task
from chilopod.paper.robot.turning import RobotTurning
from chilopod.paper.robot.walks import UNDULATION, RobotWalks
from chilopod.paper.statements import listed
from chilopod.paper.table import INCREASES, OfTwin, Result, Statement, Verdict, compared, estimated, of_twin, within
from chilopod.paper.turning.study import SCALES, all_lower, around, in_words, minima, saturation, softest_minima
from chilopod.paper.turning.trials import LegYaw, arrivals, by_leg_yaw, outcome_words, springs_by_outcome
from chilopod.show.words import listing
from chilopod.statistics import Answer, Estimate, increases, mean, spread_difference
from chilopod.steering import Outcome
from chilopod.tasks.radius_law import in_settled_curve

PAPER_SPRING = printed.TASKS["A"].k_hat.value


def walk_rows(found: RobotWalks) -> list[OfTwin]:
    """Onset, radius and speed of curved walks, and their dependence on the duration."""
    base = found.base
    (straight, most), rising = _most(base, "straight", printed.STRAIGHT), increases(_curved_angles(base).values())
    rows = [
        OfTwin(statements.STRAIGHT, Result(straight), within(most)),
        _curved(base),
        _spring(statements.ONSET, onset_point(base)),
        *(estimated(said, radius_at(base, k), "m", none="no two trials curve") for k, said in statements.RADII.items()),
        estimated(statements.SPEED, mean(base.speed.sel(spring=PAPER_SPRING).values), "m/s", 4),
        compared(statements.RISING, Result(INCREASES[rising.answer]), rising),
        _fluctuation(base),
    ]
    if found.uniform is not None:
        rows += [_uniform(found.uniform.sel(mode=mode)) for mode in found.uniform.mode.values]
    for name, data in found.variants.items():
        lower = found.lower_steps.get(name)
        rows += variant_rows(base, data, name, "" if lower is None else "steps as high")
        if lower is not None:
            rows += variant_rows(base, lower, name, "steps lower in proportion")
    return rows + duration_rows(found.durations)


def _spring(statement: Statement[Band], twin: Estimate) -> OfTwin:
    """Spring (N*mm/deg) beside the paper's; NaN if the trials determine no spring, or no error."""
    number = Result("", twin.value, twin.error, PAPER_UNIT, 1).words
    words = f"{number} ({100.0 * (twin.value / statement.said.middle - 1.0):+.0f} %)"
    return estimated(statement, twin, PAPER_UNIT, 1, words, "not determined")


def _uniform(mode: xr.Dataset) -> OfTwin:
    """Spring at which the straight walk ends by a mode, with all springs alike. Its error is no scatter of trials."""
    point = Estimate(float(mode.end), float(mode.end_error), reciprocal=True)
    reading = f"by {mode.mode.item()}s of {np.rad2deg(mode.amplitude):.0f} deg"
    return replace(_spring(statements.UNIFORM, point), reading=reading, comparison=None)


def _curved(base: xr.Dataset) -> OfTwin:
    words, most = _most(base, "curved", printed.CURVED)
    directions = base.direction.sel(spring=list(printed.CURVED)).values
    left, right = (int((directions == side).sum()) for side in ("left", "right"))
    result = Result(f"{words}; {left} to the left, {right} to the right")
    return OfTwin(statements.CURVED, result, within(most and min(left, right) > 0))


def _most(base: xr.Dataset, what: str, springs: tuple[float, ...]) -> tuple[str, bool]:
    """Numbers of curved or straight walks at some springs, in words; True if they are the majority at each spring."""
    share, repeats = shares(base)[what].sel(spring=list(springs)).values, base.sizes["repeat"]
    pairs = zip(springs, repeats * share, strict=True)
    counts = ", ".join(f"{count:.0f} of {repeats} at {spring:g}" for spring, count in pairs)
    return f"{what}: {counts}", bool((share > 0.5).all())


def _curved_angles(base: xr.Dataset) -> dict[float, NDArray[np.float64]]:
    """Angles of joint 1 in all trials that curve, rad, by spring (N*mm/deg), the stiffest first."""
    ordered = base.sortby("spring", ascending=False)
    angles = np.where(in_settled_curve(ordered), np.abs(ordered.mean_angle.sel(joint=1).values), np.nan)
    pairs = zip(ordered.spring.values, angles, strict=True)
    return {float(spring): row[np.isfinite(row)] for spring, row in pairs if np.isfinite(row).any()}


def _fluctuation(base: xr.Dataset) -> OfTwin:
    several = {spring: row for spring, row in _curved_angles(base).items() if row.size > 1}
    if len(several) < 2:
        none = Result("no two springs at which two trials curve")
        return OfTwin(statements.FLUCTUATION, none, Verdict.NOT_DETERMINED)
    (stiff, one), *_, (soft, other) = several.items()
    wider = spread_difference(other, one).above()
    spreads = [f"{np.rad2deg(row.std(ddof=1)):.2f} deg at {k:g}" for k, row in ((stiff, one), (soft, other))]
    words = f"{' and '.join(spreads)} {PAPER_UNIT} (standard deviation): {wider.words()}"
    return compared(statements.FLUCTUATION, Result(words), wider)


def variant_rows(base: xr.Dataset, data: xr.Dataset, name: str, reading: str = "") -> list[OfTwin]:
    """Onset and radius of one of the paper's variants, from trials of the robot as built and of the variant, and the
    reading of the variant, if there are several."""
    said = statements.VARIANTS[name]
    ratio = radius_ratio(base, data)
    law = law_ratio(ratio.compared, printed.ONSET.value, printed.onset(name).value)
    words = [f"{change(ratio.distance)} at equal distance in 1/k1 from its own onset"]
    if np.isnan(ratio.distance.value):
        words = ["no distance from the onset in common with the robot as built"]
    if ratio.compared:
        words.append(
            f"{change(ratio.springs)} at equal springs, {listed(ratio.compared)}"
            + ("" if np.isnan(law) else f" (the robot's onsets alone would make it {change(Estimate(law))})")
        )
    rows = [_spring(said.onset, onset_point(data)), estimated(said.radius, ratio.distance, "", words="; ".join(words))]
    return [replace(row, reading=reading) for row in rows]


def duration_rows(data: xr.Dataset) -> list[OfTwin]:
    """Quantities of :func:`chilopod.paper.robot.walks.by_duration`, and their dependence on the duration of walks."""
    answers = _answers(data, "onset", printed.ONSET.band, reciprocal=True)
    values = f"{_numbers(data.onset.values, 1)} {PAPER_UNIT}"
    rows = [_duration_row(data, statements.ONSET_BY_DURATION, values, answers)]
    for spring, statement in statements.RADII_BY_DURATION.items():
        at = data.sel(spring=spring)
        answers = _answers(at, "axis_radius", printed.RADII[spring].band)
        rows.append(_duration_row(data, statement, f"{_numbers(at.axis_radius.values, 2)} m", answers))
    for what, statement in statements.WALKS_BY_DURATION.items():
        part = data[what].sel(spring=statements.SLOWEST[what]).values
        rows.append(_duration_row(data, statement, f"{_numbers(100.0 * part, 0)} %", list(map(bool, part > 0.5))))
    return rows


def _answers(data: xr.Dataset, name: str, said: Band, *, reciprocal: bool = False) -> list[Answer]:
    """Answers after every duration."""
    columns = (data[f"{name}{ending}"].values for ending in ("", "_error", "_freedom"))
    found = [
        Estimate(value, error, freedom, reciprocal=reciprocal) for value, error, freedom in zip(*columns, strict=True)
    ]
    return [each.between(said.low, said.high).answer for each in found]


def _duration_row(data: xr.Dataset, statement: Statement[Said], values: str, answers: Sequence[Answer]) -> OfTwin:
    """Row on a quantity that is judged after every duration."""
    times = [f"{each:g}" for each in data.duration.values]
    by = {within(key): [t for t, one in zip(times, answers, strict=True) if one is key] for key in (True, False, None)}
    judged = [
        f"{word} after {listing(those) if len(those) < len(times) else 'each'}" for word, those in by.items() if those
    ]
    same = False if {True, False} <= set(answers) else None if None in answers else True
    return OfTwin(statement, Result(f"{values} after {listing(times)} s: {', '.join(judged)}"), within(same))


def _numbers(values: NDArray[np.float64], digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" if np.isfinite(value) else "none" for value in values)


def turning_rows(found: RobotTurning, walks: RobotWalks | None) -> list[OfTwin]:
    """The turning tasks."""
    rows: list[OfTwin] = []
    for letter, task in found.tasks.items():
        said = statements.TASKS[letter]
        if walks is not None:
            spring = spring_for(walks.base, task.target.radius)
            rows.append(estimated(said.k_hat, spring, PAPER_UNIT, 1, none="none of the springs walked"))
        words = outcome_words(task.criteria, lambda springs: ", ".join(f"{k:g}" for k in springs))
        rows.append(OfTwin(said.outcomes, Result(words), within(_became(task.criteria, printed.TASKS[letter]))))
        low = minima(task.criteria)
        for name, statement in said.minima.items():
            at, (factor, unit) = low.sel(criterion=name), SCALES[name]
            words = (
                f"{factor * float(at['mean']):.3g} ± {factor * float(at['error']):.2g} {unit} at k1 = "
                f"{float(at['at']):.3g} (of the springs that walked {float(at.softest):g} to "
                f"{float(at.stiffest):g} are no worse)"
            )
            result = Result(words, float(at["at"]), unit=PAPER_UNIT)
            rows.append(OfTwin(statement, result, within(around(at, statement.said))))
    task = found.tasks["A"]
    time = task.time if (task.criteria.outcome == Outcome.ARRIVED.label).any() else np.nan
    arrival = f"{time:.1f} s, the earliest, which has no error" if np.isfinite(time) else "none arrives"
    alone = by_leg_yaw(found.without)
    rows += [
        of_twin(statements.ARRIVAL, Result(arrival, time, unit="s")),
        *(OfTwin(statements.WITHOUT, Result(str(each)), within(_needs_leg_yaw(each))) for each in alone),
    ]
    if found.hopf is None:
        return rows
    own = float(walks.uniform.end.sel(mode=UNDULATION)) if walks and walks.uniform is not None else np.nan
    words, below = softest_minima(found.hopf, own if np.isfinite(own) else printed.UNIFORM.value)
    both = f"{in_words(task, found.hopf)} ({saturation(task, found.hopf)})"
    return [
        *rows,
        compared(statements.HOPF, Result(both), all_lower(task, found.hopf)),
        OfTwin(statements.HOPF_SPRINGS, Result(words), within(below)),
    ]


def _became(criteria: xr.Dataset, task: Task) -> bool:
    """True if a task has the outcome at the paper's own springs, or between two that miss to either side."""
    outcomes, k_hat = springs_by_outcome(criteria), task.k_hat.value
    if not task.outcomes:
        return bool(outcomes[Outcome.OUTSIDE] and outcomes[Outcome.INSIDE]) and k_hat in outcomes[Outcome.ARRIVED]
    met = all(spring in outcomes[outcome] for outcome, spring in task.outcomes.items())
    return met and bool((criteria.outcome.sel(spring=k_hat) == Outcome.ARRIVED.label).all())


def _needs_leg_yaw(walks: LegYaw) -> bool:
    """True if many walks fail without leg yaw, and none with it."""
    (few, without), (many, with_) = arrivals(walks.alone), arrivals(walks.helped)
    return few <= without // 2 and many == with_
