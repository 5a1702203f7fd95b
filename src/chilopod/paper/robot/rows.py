"""Lines of the robot's table about its walks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.fit_data import walking_speed
from chilopod.paper.printed import printed
from chilopod.paper.robot.equal_distance import change, law_ratio, radius_ratio
from chilopod.paper.robot.table import (
    CHECKED,
    FITTED,
    ONSET,
    PREDICTED,
    RADIUS,
    SPEED,
    UNCHANGED,
    VERDICTS,
    Planar,
    percent,
    printed_spring,
    spring_row,
    with_error,
)
from chilopod.paper.robot.turning import PAPER_SPRING
from chilopod.paper.robot.walk_measures import onset_with_error, radius_at, shares
from chilopod.paper.robot.walks import RobotWalks
from chilopod.paper.scatter import (
    INCREASES,
    Answer,
    between,
    every,
    increases,
    mean_and_error,
    near,
    spread_difference,
)
from chilopod.paper.table import RobotRow
from chilopod.tasks.radius_law import in_settled_curve

STRAIGHT, CURVED = (41.0, 75.0), (15.0, 17.0, 21.0, 28.0)
"""N*mm/deg: springs at which the paper's robot walks straight, and those at which it curves."""


def walk_rows(found: RobotWalks, planar: Planar) -> list[RobotRow]:
    """Where walks curve, how tightly and how fast, and what of it hangs on how long they last."""
    base = found.base
    rows = [
        _straight(base, planar),
        _curved(base, planar),
        spring_row(
            "where curved walks set in (square-root fit)",
            printed_spring("pitchfork", "robot_critical_k1"),
            onset_with_error(base),
            ONSET,
            FITTED,
            planar.get("onset", ""),
        ),
        *(_radius(base, spring, planar) for spring in printed_radii()),
        _speed(base, planar),
        _rising(base, planar),
        _fluctuation(base, planar),
    ]
    for name, data in found.variants.items():
        if name not in found.lower_steps:
            rows += variant_rows(base, data, name, name, planar)
            continue
        rows += variant_rows(base, data, name, f"{name} (steps as high)", planar)
        rows += variant_rows(base, found.lower_steps[name], name, f"{name} (steps lower in proportion)", planar)
    uniform = found.uniform.attrs
    rows.append(
        spring_row(
            "where a body with springs all alike undulates",
            printed_spring("uniform", "robot_critical_k"),
            (uniform["critical_k"], uniform["critical_k_error"]),
            ONSET,
            PREDICTED,
            planar.get("uniform", ""),
        )
    )
    return rows + duration_rows(found.durations)


def printed_radii() -> dict[float, float]:
    """Radii (m) that the paper prints, by k1 (N*mm/deg)."""
    return {float(key): units.parse(text, "m") for key, text in printed()["curved"]["radius"].items()}


def _straight(base: xr.Dataset, planar: Planar) -> RobotRow:
    return RobotRow(
        f"walks with k1 = {_listed(STRAIGHT)} {PAPER_UNIT}",
        "straight",
        f"straight: {_counts(base, 'straight', STRAIGHT)}",
        planar.get("straight", ""),
        FITTED,
        VERDICTS[_most(shares(base), "straight", STRAIGHT)],
        "most trials",
    )


def _curved(base: xr.Dataset, planar: Planar) -> RobotRow:
    directions = base.direction.sel(spring=list(CURVED)).values
    left, right = (int((directions == side).sum()) for side in ("left", "right"))
    both = ", ".join(planar[key] for key in ("curved", "sides") if key in planar)
    return RobotRow(
        f"walks with k1 = {_listed(CURVED)} {PAPER_UNIT}",
        "curved, to both sides",
        f"curved: {_counts(base, 'curved', CURVED)}; {left} to the left, {right} to the right",
        both,
        FITTED,
        VERDICTS[_most(shares(base), "curved", CURVED) and min(left, right) > 0],
        "most trials at each; both sides",
    )


def _radius(base: xr.Dataset, spring: float, planar: Planar) -> RobotRow:
    (mean, error), paper = radius_at(base, spring), printed_radii()[spring]
    return RobotRow(
        f"radius at k1 = {spring:g} {PAPER_UNIT}",
        f"{paper:g} m",
        "no two trials curve" if np.isnan(mean) else f"{with_error(mean, error, 2)} m",
        planar.get(f"radius {spring:g}", ""),
        FITTED,
        VERDICTS[near(mean, error, paper, RADIUS)],
        percent(RADIUS),
    )


def _speed(base: xr.Dataset, planar: Planar) -> RobotRow:
    entry = printed()["turning"]
    mean, error = mean_and_error(base.speed.sel(spring=PAPER_SPRING).values)
    return RobotRow(
        f"speed of module 1 at k1 = {PAPER_SPRING:g} {PAPER_UNIT}",
        f"{walking_speed():.3f} m/s, from {entry['evaluation_time']} to {entry['tasks']['A']['target']}",
        f"{with_error(mean, error, 4)} m/s",
        planar.get("speed", ""),
        FITTED,
        VERDICTS[near(mean, error, walking_speed(), SPEED)],
        percent(SPEED),
    )


def _curved_angles(base: xr.Dataset) -> dict[float, NDArray[np.float64]]:
    """Of joint 1 in all trials that curve, rad, by spring (N*mm/deg), the stiffest first."""
    ordered = base.sortby("spring", ascending=False)
    angles = np.where(in_settled_curve(ordered), np.abs(ordered.mean_angle.sel(joint=1).values), np.nan)
    pairs = zip(ordered.spring.values, angles, strict=True)
    return {float(spring): row[np.isfinite(row)] for spring, row in pairs if np.isfinite(row).any()}


def _rising(base: xr.Dataset, planar: Planar) -> RobotRow:
    rising = increases(_curved_angles(base).values())
    return RobotRow(
        "angle of joint 1 over 1/k1",
        "increases",
        INCREASES[rising],
        planar.get("rising", ""),
        PREDICTED,
        VERDICTS[rising],
        "from every spring to the next",
    )


def _fluctuation(base: xr.Dataset, planar: Planar) -> RobotRow:
    several = {spring: row for spring, row in _curved_angles(base).items() if row.size > 1}
    if len(several) < 2:
        said, answer = "no two springs at which two trials curve", None
    else:
        (stiff, one), *_, (soft, other) = several.items()
        wider = spread_difference(other, one)
        spreads = [f"{np.rad2deg(row.std(ddof=1)):.2f} deg at {k:g}" for k, row in ((stiff, one), (soft, other))]
        said, answer = f"{' and '.join(spreads)} {PAPER_UNIT} (standard deviation): {wider}", wider.higher
    return RobotRow(
        "fluctuation among trials over 1/k1, joint 1",
        "increases",
        said,
        planar.get("fluctuation", ""),
        PREDICTED,
        VERDICTS[answer],
        "from the stiffest spring that curves to the softest",
    )


def variant_rows(base: xr.Dataset, data: xr.Dataset, name: str, title: str, planar: Planar) -> list[RobotRow]:
    """Onset and radius of a variant.

    Parameters
    ----------
    base, data
        Trials of the robot as built and of the variant.
    name
        Of the variant, as the paper's.
    title
        What the rows call it: its name, and if there are several, which reading of it.
    planar
        What the planar model does.
    """
    own = printed_spring("variants", name, "robot_critical_k1")
    says = printed()["variants"][name]["radius"]
    ratio = radius_ratio(base, data)
    law = law_ratio(ratio.compared, printed_spring("pitchfork", "robot_critical_k1"), own)
    if says == "smaller":
        answer, asked = between(ratio.distance, ratio.distance_error, 0.0, 1.0), "not wider than as built"
    else:
        answer, asked = near(ratio.distance, ratio.distance_error, 1.0, UNCHANGED), percent(UNCHANGED)
    said = [f"{change(ratio.distance, ratio.distance_error)} at equal distance from its own onset, 1/k1 - 1/k1*"]
    if np.isnan(ratio.distance):
        said = ["no distance from the onset in common with the robot as built"]
    if ratio.compared:
        said.append(
            f"{change(ratio.springs, ratio.springs_error)} at equal springs, {_listed(ratio.compared)}"
            + ("" if np.isnan(law) else f" (the robot's onsets alone would make it {change(law)})")
        )
    return [
        spring_row(
            f"where curved walks set in, {title}",
            own,
            onset_with_error(data),
            ONSET,
            PREDICTED,
            planar.get(name, ""),
        ),
        RobotRow(
            f"radius, {title}",
            says,
            "; ".join(said),
            planar.get(f"radius {name}", ""),
            PREDICTED,
            VERDICTS[answer],
            f"{asked}, at equal distance",
        ),
    ]


def duration_rows(data: xr.Dataset) -> list[RobotRow]:
    """Which quantities of the base series would be judged otherwise if its walks were shorter.

    Parameters
    ----------
    data
        From :func:`chilopod.paper.robot.walks.by_duration`.
    """
    paper = printed_spring("pitchfork", "robot_critical_k1")
    each = [data.isel(duration=index) for index in range(data.sizes["duration"])]
    rows = [
        _duration_row(
            data,
            "onset",
            f"{_numbers(data.onset.values, 1)} {PAPER_UNIT}",
            [near(float(at.onset), float(at.onset_error), paper, ONSET) for at in each],
        )
    ]
    for spring, radius in printed_radii().items():
        pairs = data[["axis_radius", "axis_radius_error"]].sel(spring=spring).to_array("part").values.T
        rows.append(
            _duration_row(
                data,
                f"radius at {spring:g} {PAPER_UNIT}",
                f"{_numbers(pairs[:, 0], 2)} m",
                [near(mean, error, radius, RADIUS) for mean, error in pairs],
            )
        )
    # The springs next to the onset are those that need the longest.
    for what, spring in (("curved", max(CURVED)), ("straight", min(STRAIGHT))):
        rows.append(
            _duration_row(
                data,
                f"walks {what} at {spring:g} {PAPER_UNIT}",
                f"{_numbers(100.0 * data[what].sel(spring=spring).values, 0)} %",
                [_most(at, what, (spring,)) for at in each],
            )
        )
    return rows


def _duration_row(data: xr.Dataset, name: str, values: str, answers: Sequence[Answer]) -> RobotRow:
    """Whether a quantity is judged alike after every duration."""
    times, last = [f"{each:g}" for each in data.duration.values], answers[-1]
    by = {word: [t for t, each in zip(times, answers, strict=True) if each is key] for key, word in VERDICTS.items()}
    judged = [
        f"{word} after {_joined(those) if len(those) < len(times) else 'each'}" for word, those in by.items() if those
    ]
    return RobotRow(
        f"{name}, by how long the walks last",
        "not printed how long",
        f"{values} after {_joined(times)} s: {', '.join(judged)}",
        "",
        CHECKED,
        VERDICTS[every(None if None in (each, last) else each == last for each in answers)],
        "the same verdict after each",
    )


def _most(shares: xr.Dataset, what: str, springs: tuple[float, ...]) -> bool:
    """Whether most walks at each of some springs are "curved" or "straight"."""
    return bool((shares[what].sel(spring=list(springs)) > 0.5).all())


def _counts(data: xr.Dataset, what: str, springs: tuple[float, ...]) -> str:
    counts = data.sizes["repeat"] * shares(data)[what].sel(spring=list(springs)).values
    return ", ".join(
        f"{count:.0f} of {data.sizes['repeat']} at {spring:g}" for spring, count in zip(springs, counts, strict=True)
    )


def _numbers(values: NDArray[np.float64], digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" if np.isfinite(value) else "none" for value in values)


def _listed(springs: tuple[float, ...]) -> str:
    """15, 17 and 21."""
    return _joined([f"{spring:g}" for spring in sorted(springs)])


def _joined(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
