"""The table quantity | the paper's robot | twin | planar model | within?."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.steering import Outcome
from chilopod.studies.paper import printed
from chilopod.studies.robot_turning import PAPER_SPRING, RobotTurning
from chilopod.studies.robot_walks import RobotWalks, onset, radius_at, spring_for
from chilopod.studies.turning import minima, springs_by_outcome
from chilopod.studies.turning_rows import AROUND, NAMES, SCALES
from chilopod.tasks.radius_law import is_curved

FITTED, PREDICTED, CHECKED = "fitted", "predicted", "checked"

_SPRING = "N*mm/deg"


@dataclass(frozen=True)
class RobotRow:
    """A line of the table.

    Attributes
    ----------
    quantity
        What it is about.
    robot, twin, planar
        What the paper prints of its robot, what the twin does, and what the planar model does, empty where it was not
        asked; in words and numbers with units.
    kind
        "fitted" if the twin's constants were fitted to it, else "predicted"; "checked" for what is about the twin.
    verdict
        "within" or "outside" of what is asked of the twin, or "not printed".
    asked
        What counts as within.
    """

    quantity: str
    robot: str
    twin: str
    planar: str
    kind: str
    verdict: str
    asked: str

    def as_json(self) -> dict[str, str]:
        """The row by column."""
        return asdict(self)


Planar = Mapping[str, str]
"""What the planar model does, in words, by the keys of :func:`planar_words`."""


def walk_rows(found: RobotWalks, planar: Planar) -> list[RobotRow]:
    """Where walks curve, and how tightly."""
    base, fit = found.base, found.fit
    at = {float(k): row for k, row in zip(base.spring.values, is_curved(base).mean(axis=1), strict=True)}
    curving = [k for k, part in at.items() if part > 0.5]
    wanted = printed_number("pitchfork", "robot_critical_k1")
    sides = {name: int((base.direction == name).sum()) for name in ("left", "right")}
    rows = [
        RobotRow(
            "walks with k1 = 41 and 75 N*mm/deg",
            "straight",
            _share({k: 1.0 - at[k] for k in (41.0, 75.0)}, base.sizes["repeat"], "straight"),
            planar.get("straight", ""),
            FITTED,
            _verdict(all(at[k] < 0.5 for k in (41.0, 75.0))),
            "most trials",
        ),
        RobotRow(
            "walks with k1 = 15, 17, 21 and 28 N*mm/deg",
            "curved",
            _share({k: at[k] for k in (15.0, 17.0, 21.0, 28.0)}, base.sizes["repeat"], "curved"),
            planar.get("curved", ""),
            FITTED,
            _verdict(all(k in curving for k in (15.0, 17.0, 21.0, 28.0))),
            "most trials",
        ),
        RobotRow(
            "curved walks to the left and to the right",
            "both",
            f"{sides['left']} and {sides['right']}",
            planar.get("sides", ""),
            PREDICTED,
            _verdict(min(sides.values()) > 0),
            "both",
        ),
        _number(
            "where curved walks set in (square-root fit)",
            wanted,
            fit.critical if fit else None,
            0.10,
            FITTED,
            planar,
            "onset",
        ),
    ]
    for spring, text in printed()["curved"]["radius"].items():
        mean, error = radius_at(base, float(spring))
        paper = units.parse(text, "m")
        rows.append(
            RobotRow(
                f"radius at k1 = {spring} {_SPRING}",
                text,
                "no two trials curve" if np.isnan(mean) else f"{mean:.2f} ± {error:.2f} m",
                planar.get(f"radius {spring}", ""),
                FITTED,
                _verdict(abs(mean / paper - 1.0) <= 0.10),
                "10 %",
            )
        )
    means = np.array(
        [
            np.nanmean(np.where(here, np.abs(row), np.nan))
            for here, row in zip(is_curved(base), base.mean_angle.sel(joint=1).values, strict=True)
            if here.any()
        ]
    )
    rising = bool((np.diff(means) < 0.0).all())
    rows.append(
        RobotRow(
            "angle of joint 1 over 1/k1",
            "increases",
            "increases" if rising else "not throughout",
            planar.get("rising", ""),
            PREDICTED,
            _verdict(rising),
            "at every spring",
        )
    )
    return rows + _variant_rows(found, planar) + [_uniform(found, planar)]


def _variant_rows(found: RobotWalks, planar: Planar) -> list[RobotRow]:
    rows, base = [], found.base
    shared = [float(k) for k in base.spring.values if k in found.variants[next(iter(found.variants))].spring.values]
    for name, data in found.variants.items():
        fit = onset(data)
        wanted = units.from_si(units.parse(printed()["variants"][name]["robot_critical_k1"], "N*m/rad"), PAPER_UNIT)
        rows.append(
            _number(
                f"where curved walks set in, {name}",
                wanted,
                fit.critical if fit else None,
                0.15,
                PREDICTED,
                planar,
                name,
            )
        )
        says = printed()["variants"][name]["radius"]
        ratios = [radius_at(data, k)[0] / radius_at(base, k)[0] for k in shared]
        ratios = [ratio for ratio in ratios if np.isfinite(ratio)]
        ratio = float(np.mean(ratios)) if ratios else float("nan")
        fits = ratio < 0.97 if says == "smaller" else abs(ratio - 1.0) < 0.15
        rows.append(
            RobotRow(
                f"radius, {name}",
                says,
                f"{100.0 * (ratio - 1.0):+.0f} % at the same springs" if np.isfinite(ratio) else "no two trials curve",
                planar.get(f"radius {name}", ""),
                PREDICTED,
                _verdict(fits),
                "smaller by 3 %" if says == "smaller" else "15 %",
            )
        )
    return rows


def _uniform(found: RobotWalks, planar: Planar) -> RobotRow:
    wanted = printed_number("uniform", "robot_critical_k")
    return _number(
        "where a body with springs all alike undulates",
        wanted,
        found.uniform.attrs["critical_k"],
        0.20,
        PREDICTED,
        planar,
        "uniform",
    )


def turning_rows(found: RobotTurning, walks: RobotWalks | None, planar: Planar) -> list[RobotRow]:
    """The turning tasks."""
    rows: list[RobotRow] = []
    for letter, task in found.tasks.items():
        entry = printed()["turning"]["tasks"][letter]
        k_hat = float(entry["k_hat"].split()[0])
        if walks is not None:
            own = spring_for(walks.base, task.target.radius)
            rows.append(
                RobotRow(
                    f"task {letter}: k1 whose walk has the radius of the circle",
                    entry["k_hat"],
                    f"{own:.1f} {_SPRING}",
                    planar.get(f"k_hat {letter}", ""),
                    PREDICTED,
                    _verdict(abs(own / k_hat - 1.0) <= 0.15),
                    "15 %",
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
                    f"around k1 = {k_hat:g} {_SPRING}",
                    f"{factor * float(at['mean']):.3g} ± {factor * float(at['error']):.2g} {unit} at k1 = {spring:.3g} "
                    f"(no worse: {float(at.softest):g} to {float(at.stiffest):g})",
                    planar.get(f"{name} {letter}", ""),
                    PREDICTED,
                    _verdict(AROUND[0] * k_hat <= spring <= AROUND[1] * k_hat),
                    f"{AROUND[0] * k_hat:.3g} to {AROUND[1] * k_hat:.3g} {_SPRING}",
                )
            )
    return [*rows, _arrival(found, planar), *_without(found, planar), *_hopf(found, planar)]


def _outcomes(
    criteria: xr.Dataset, letter: str, entry: Mapping[str, Any], k_hat: float, said: str, planar: Planar
) -> RobotRow:
    """What became of the task: at the paper's own springs, or between two that miss to either side."""
    outcomes = springs_by_outcome(criteria)
    if "outcomes" in entry:
        wanted = {label: float(text.split()[0]) for label, text in entry["outcomes"].items()}
        met = all(k in outcomes[label] for label, k in wanted.items())
        every = bool((criteria.outcome.sel(spring=k_hat) == Outcome.ARRIVED.label).all())
        robot = ", ".join(f"{label} at {k:g}" for label, k in wanted.items()) + f" {_SPRING}, all five at {k_hat:g}"
        asked = "the same at these springs, and all repeats arrive"
    else:
        met = bool(outcomes[Outcome.OUTSIDE.label] and outcomes[Outcome.INSIDE.label])
        every = k_hat in outcomes[Outcome.ARRIVED.label]
        robot, asked = f"best around {k_hat:g} {_SPRING}", "arrives there; stiffer miss outside, softer inside"
    return RobotRow(
        f"task {letter}: what becomes of it",
        robot,
        said,
        planar.get(f"outcomes {letter}", ""),
        PREDICTED,
        _verdict(met and every),
        asked,
    )


def _arrival(found: RobotTurning, planar: Planar) -> RobotRow:
    return RobotRow(
        "task A: earliest arrival",
        printed()["turning"]["evaluation_time"],
        f"{found.tasks['A'].time:.1f} s",
        planar.get("arrival", ""),
        PREDICTED,
        _verdict(abs(found.tasks["A"].time / units.parse(printed()["turning"]["evaluation_time"], "s") - 1.0) <= 0.15),
        "15 %",
    )


def _without(found: RobotTurning, planar: Planar) -> list[RobotRow]:
    data = found.without
    alone, helped = (data.isel(case=int(np.flatnonzero(data.leg_yaw.values == which)[0])) for which in (False, True))
    counts = [(int(np.nansum(case.arrived)), int(np.isfinite(case.arrived).sum())) for case in (alone, helped)]
    left = int((alone.turned > 0.0).sum())
    return [
        RobotRow(
            f"task A without leg yaw, k1 = {PAPER_SPRING:g} {_SPRING}",
            "many of 9 fail, with it 5 of 5 arrive",
            f"{counts[0][0]} of {counts[0][1]} arrive ({left} turn left), with it {counts[1][0]} of {counts[1][1]}",
            planar.get("without", ""),
            PREDICTED,
            _verdict(counts[0][0] <= counts[0][1] // 2 and counts[1][0] == counts[1][1]),
            "at most 4 arrive without, all with",
        )
    ]


def _hopf(found: RobotTurning, planar: Planar) -> list[RobotRow]:
    ours, other = minima(found.tasks["A"].criteria), minima(found.hopf.criteria)
    pairs, lower = [], True
    for name, title in NAMES.items():
        factor, unit = SCALES[name]
        one, two = (factor * float(each["mean"].sel(criterion=name)) for each in (ours, other))
        pairs.append(f"{title} {one:.3g} against {two:.3g} {unit}")
        lower &= one < two
    return [
        RobotRow(
            "task A, pitchfork against Hopf: smallest criteria",
            "lower for the pitchfork, all three",
            "; ".join(pairs),
            planar.get("hopf", ""),
            PREDICTED,
            _verdict(lower),
            "all three lower",
        )
    ]


def printed_number(section: str, key: str) -> float:
    """A spring that the paper prints, N*mm/deg."""
    return units.from_si(units.parse(printed()[section][key], "N*m/rad"), PAPER_UNIT)


def _number(
    quantity: str, paper: float, twin: float | None, tolerance: float, kind: str, planar: Planar, key: str
) -> RobotRow:
    good = twin is not None and np.isfinite(twin)
    return RobotRow(
        quantity,
        f"{paper:g} {_SPRING}",
        f"{twin:.1f} {_SPRING} ({100.0 * (twin / paper - 1.0):+.0f} %)"
        if good and twin
        else "not determined by trials",
        planar.get(key, ""),
        kind,
        _verdict(bool(good and twin and abs(twin / paper - 1.0) <= tolerance)),
        f"{100.0 * tolerance:.0f} %",
    )


def _share(parts: Mapping[float, float], repeats: int, what: str) -> str:
    return f"{what}: " + ", ".join(f"{round(part * repeats)} of {repeats} at {k:g}" for k, part in parts.items())


def _verdict(yes: bool) -> str:
    return "within" if yes else "outside"
