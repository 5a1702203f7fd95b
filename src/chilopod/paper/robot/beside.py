"""What the planar model does where the robot and its twin are compared, in a few words each."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.paper.curved.study import CurvedStudy, axis_radius, bent
from chilopod.paper.printed import printed
from chilopod.paper.robot.equal_distance import change, radius_ratio
from chilopod.paper.scatter import INCREASES, increases, spread_difference
from chilopod.paper.turning import hopf
from chilopod.paper.turning.minima import NAMES, SCALES, minima
from chilopod.paper.turning.study import Turning
from chilopod.paper.turning.trials import springs_by_outcome
from chilopod.steering import Outcome


def planar_words(uniform: xr.Dataset | None, curved: CurvedStudy | None, turning: Turning | None) -> dict[str, str]:
    """By the keys that :mod:`chilopod.paper.robot.rows` asks for; only what was computed."""
    words: dict[str, str] = {}
    if uniform is not None:
        words["uniform"] = f"{uniform.attrs['value']:.2f} N*mm/deg"
    if curved is not None:
        words |= _curved(curved)
    if turning is not None:
        words |= _turning(turning)
    return words


def _curved(study: CurvedStudy) -> dict[str, str]:
    trials, here = study.trials, bent(study.trials)
    sides = [int((trials.direction == side).sum()) for side in ("left", "right")]
    curving = [float(k) for k, row in zip(trials.spring.values, here, strict=True) if row.any()]
    angles = np.where(here, np.abs(trials.mean_angle.sel(joint=1).values), np.nan)
    words = {
        "straight": f"straight from {min(set(trials.spring.values) - set(curving)):g} N*mm/deg up",
        "curved": f"curved up to {max(curving):g} N*mm/deg",
        "sides": f"{sides[0]} and {sides[1]}",
        "onset": f"{study.fit.critical:.2f} N*mm/deg; the point is at {trials.attrs['critical_k1']:.2f}",
        "rising": INCREASES[increases([row for row in angles if np.isfinite(row).any()][::-1])],
        "fluctuation": f"{spread_difference(angles[0], angles[len(curving) - 1])} at {curving[0]:g} than at "
        f"{curving[-1]:g} N*mm/deg",
    }
    ratio = trials.attrs["critical_k1"] / float(printed()["pitchfork"]["robot_critical_k1"].split()[0])
    for spring in printed()["curved"]["radius"]:
        radius = axis_radius(study.branch, ratio * float(spring))
        words[f"radius {spring}"] = f"{radius:.2f} m at the same share of its point"
    for name in study.comparison.variant.values[1:]:
        at = study.comparison.sel(variant=name)
        words[str(name)] = f"{float(at.fitted_k1):.2f} N*mm/deg; the point is at {float(at.exact_k1):.2f}"
        ratio = radius_ratio(study.variants["as built"], study.variants[str(name)])
        words[f"radius {name}"] = (
            f"{change(ratio.distance, ratio.distance_error)} at equal distance from its own onset; "
            f"{change(float(at.equal_spring))} at the same spring"
        )
    return words


def _turning(found: Turning) -> dict[str, str]:
    words = {"arrival": f"{found.tasks['A'].time:.1f} s"}
    for letter, task in found.tasks.items():
        words[f"k_hat {letter}"] = f"{found.laws.k_hat(task.target.radius)[0]:.1f} N*mm/deg"
        outcomes = springs_by_outcome(task.criteria)
        words[f"outcomes {letter}"] = "; ".join(
            f"{label} at {min(outcomes[label]):g} to {max(outcomes[label]):g}"
            for label in (Outcome.OUTSIDE.label, Outcome.ARRIVED.label, Outcome.INSIDE.label)
            if outcomes[label]
        )
        low = minima(task.criteria)
        for name in NAMES:
            factor, unit = SCALES[name]
            at = low.sel(criterion=name)
            words[f"{name} {letter}"] = f"{factor * float(at['mean']):.3g} {unit} at k1 = {float(at['at']):.3g}"
    words["hopf"] = hopf.counted(found.tasks["A"], found.hopf)
    alone, helped = found.without.isel(case=0), found.without.isel(case=1)
    words["without"] = (
        f"{int(np.nansum(alone.arrived))} of {int(np.isfinite(alone.arrived).sum())} arrive, with it "
        f"{int(np.nansum(helped.arrived))} of {int(np.isfinite(helped.arrived).sum())} (k1 = {float(alone.spring):g})"
    )
    return words
