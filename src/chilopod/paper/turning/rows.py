"""The turning tasks in the table paper | computed."""

from __future__ import annotations

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.printed import printed
from chilopod.paper.scatter import every
from chilopod.paper.table import Row, agrees
from chilopod.paper.turning import hopf
from chilopod.paper.turning.minima import NAMES, SCALES, around, minima
from chilopod.paper.turning.study import ROUGH, Turning
from chilopod.paper.turning.trials import DURATION, springs_by_outcome
from chilopod.steering import Outcome


def rows(found: Turning) -> list[Row]:
    """What the paper says of its turning tasks, and what the planar model does."""
    table = printed()["turning"]
    lines: list[Row] = []
    for letter in found.tasks:
        entry = table["tasks"][letter]
        lines += [_radius(found, letter), _spring(found, letter), _arrival(found, letter)]
        lines += _minima(found, letter)
        if "outcomes" in entry:
            lines.append(_outcomes(found, letter))
    return [*lines, *_without(found), *_hopf(found), _rough(found)]


def _radius(found: Turning, letter: str) -> Row:
    entry, radius = printed()["turning"]["tasks"][letter], found.tasks[letter].target.radius
    paper = units.parse(entry["radius"], "m")
    digits = len(entry["radius"].split()[0].partition(".")[2])
    fits = round(radius, digits) == paper
    return Row(
        f"task {letter} ({entry['target']}): radius of the circle to the target",
        entry["radius"],
        f"{radius:.3f} m",
        entry["source"],
        "agrees" if fits else "differs",
        "" if fits else "geometry alone, R/(2 sin ψ); the printed value is smaller",
    )


def _spring(found: Turning, letter: str) -> Row:
    entry, radius = printed()["turning"]["tasks"][letter], found.tasks[letter].target.radius
    axis, path = found.laws.k_hat(radius)
    printed_radius = found.laws.k_hat(units.parse(entry["radius"], "m"))[0]
    return Row(
        f"task {letter}: k1 whose settled walk has this radius",
        f"{entry['k_hat']} (robot)",
        f"{axis:.3f} {PAPER_UNIT} by 5L/Σ|θ|, {path:.3f} by the path of module 1 (planar model)",
        entry["source"],
        "differs",
        f"the robot's pitchfork is at {printed()['pitchfork']['robot_critical_k1']}, the model's at 12; the printed "
        f"radius would give {printed_radius:.3f}",
    )


def _arrival(found: Turning, letter: str) -> Row:
    task = found.tasks[letter]
    return Row(
        f"task {letter}: earliest arrival, the time of ε1 and ε2",
        printed()["turning"]["evaluation_time"] + " (robot)",
        f"{task.time:.2f} s",
        printed()["turning"]["source"],
        "differs",
        f"found the same way; the model walks straight at {100 * found.robot.gait.speed:.1f} cm/s without slipping",
    )


def _minima(found: Turning, letter: str) -> list[Row]:
    entry, task = printed()["turning"]["tasks"][letter], found.tasks[letter]
    low = minima(task.criteria)
    k_hat = found.laws.k_hat(task.target.radius)[0]
    late = minima(task.criteria, 1)
    lines = []
    for name, title in NAMES.items():
        at, scale = low.sel(criterion=name), SCALES[name]
        part = float(at["at"]) / k_hat
        remark = f"{part:.2f} of the law's k1"
        if name == "distance":
            remark += f"; at the paper's {DURATION:g} s, when these robots are past the target, at "
            remark += f"{float(late['at'].sel(criterion=name)):.1f} {PAPER_UNIT}"
        if name == "effort":
            whole = low.sel(criterion="effort_until_arrival")
            remark += f"; integrated until each robot arrives, at {float(whole['at']):.1f} {PAPER_UNIT}"
        lines.append(
            Row(
                f"task {letter}: smallest {title}",
                f"around k1 = {entry['k_hat']} (robot)",
                f"{scale[0] * float(at['mean']):.3g} ± {scale[0] * float(at['error']):.2g} {scale[1]} at k1 = "
                f"{float(at['at']):.1f} {PAPER_UNIT} (no worse: {float(at.softest):g} to {float(at.stiffest):g})",
                entry["source"],
                agrees(every((around(at, k_hat), bool(at.between)))),
                remark,
            )
        )
    return lines


def _outcomes(found: Turning, letter: str) -> Row:
    entry = printed()["turning"]["tasks"][letter]
    springs = springs_by_outcome(found.tasks[letter].criteria)
    said = {outcome: springs[outcome.label] for outcome in (Outcome.OUTSIDE, Outcome.ARRIVED, Outcome.INSIDE)}
    in_order = all(said.values()) and (
        min(said[Outcome.OUTSIDE]) > max(said[Outcome.ARRIVED]) > min(said[Outcome.ARRIVED]) > max(said[Outcome.INSIDE])
    )
    curled = springs[Outcome.FAILED.label]
    return Row(
        f"task {letter}: what becomes of it",
        ", ".join(f"{label} at k1 = {value}" for label, value in entry["outcomes"].items()) + " (robot)",
        ", ".join(f"{outcome.label} at k1 = {_span(values)}" for outcome, values in said.items()) + f" {PAPER_UNIT}",
        entry["source"],
        "agrees" if in_order else "differs",
        f"softer ones ({_span(curled)}) curl up until a joint passes a right angle" if curled else "",
    )


def _span(values: list[float]) -> str:
    if not values:
        return "none"
    return f"{min(values):g} to {max(values):g}" if len(values) > 1 else f"{values[0]:g}"


def _without(found: Turning) -> list[Row]:
    data, lines = found.without, []
    for case in np.flatnonzero(~data.leg_yaw.values):
        alone, helped = data.isel(case=int(case)), data.isel(case=int(case) + 1)
        trials = int(np.isfinite(alone.arrived).sum()), int(np.isfinite(helped.arrived).sum())
        arrived = int(alone.arrived.sum()), int(helped.arrived.sum())
        left = int((alone.turned > 0.0).sum())
        fewer = arrived[0] / trials[0] < 0.5 and arrived[1] == trials[1]
        lines.append(
            Row(
                f"task A without leg yaw, {str(alone.case.values).partition(',')[0]}",
                "many of 9 fail, to both sides; with it 5 of 5 arrive (robot)",
                f"{arrived[0]} of {trials[0]} arrive, {left} turn left and {trials[0] - left} right; with it "
                f"{arrived[1]} of {trials[1]} (k1 = {float(alone.spring):.1f} {PAPER_UNIT})",
                "figure Comparison of the trajectory",
                "agrees" if fewer and 0 < left < trials[0] else "differs",
                "" if fewer else "the bend needs too long to grow for this spring, even helped by the legs",
            )
        )
    return lines


def _hopf(found: Turning) -> list[Row]:
    task, theirs = found.tasks["A"], minima(found.hopf.criteria)
    at = [float(theirs.spring.sel(criterion=name)) for name in NAMES]
    unstable = all(spring < found.hopf_point for spring in at)
    ever = int(np.isfinite(found.hopf.criteria.arrival.values).sum())
    return [
        Row(
            "task A, pitchfork against Hopf: smallest criteria",
            "lower for the pitchfork, all three (robot)",
            hopf.words(task, found.hopf),
            "figure Comparison of evaluation criteria",
            agrees(hopf.all_lower(task, found.hopf)),
            hopf.saturation(task, found.hopf),
        ),
        Row(
            "task A, Hopf: springs of the smallest criteria",
            f"below the Hopf point, {printed()['turning']['hopf']['point']} (robot)",
            f"{_span(sorted(set(at)))} {PAPER_UNIT}, below {found.hopf_point:.2f}",
            "figure Comparison of evaluation criteria",
            "agrees" if unstable else "differs",
            f"at the softest springs tried; ε3 is the same for all; {ever} of "
            f"{found.hopf.criteria.arrival.size} trials arrive",
        ),
    ]


def _rough(found: Turning) -> Row:
    usual, rough = minima(found.tasks["A"].criteria), minima(found.rough.criteria)
    pairs = [
        f"{title.partition(',')[0]} {float(usual['at'].sel(criterion=name)):.1f} → "
        f"{float(rough['at'].sel(criterion=name)):.1f}"
        for name, title in NAMES.items()
    ]
    return Row(
        f"task A, disturbances {ROUGH:g} times as large: springs of the smallest criteria",
        "not printed",
        ", ".join(pairs) + f" {PAPER_UNIT}",
        printed()["turning"]["source"],
        "not printed",
        f"evaluated at {found.rough.time:.2f} s, the earliest arrival there",
    )
