"""What the paper says of its curved walks beside what the trials of the planar model show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from chilopod.paper.curved.study import CurvedStudy, axis_radius, bent
from chilopod.paper.printed import printed
from chilopod.paper.scatter import INCREASES, Difference, between, increases, near, spread_difference
from chilopod.paper.table import Row, agrees


def rows(study: CurvedStudy) -> list[Row]:
    """The table paper | computed."""
    text: Mapping[str, Any] = printed()["curved"]
    trials, exact = study.trials, study.trials.attrs["critical_k1"]
    here = bent(trials)
    curved = trials.isel(spring=here.any(axis=1))
    sides = {name: int((trials.direction == name).sum()) for name in ("left", "right")}
    unsettled = int((~trials.settled).sum())
    stiff = trials.spring.values > exact
    straight = bool((trials.direction.values[stiff] == "straight").all())
    angles = np.where(bent(curved)[..., None], np.abs(curved.mean_angle.values), np.nan)
    spread = np.nanstd(angles, axis=1, ddof=1)
    joint_1 = angles[..., 0]
    rising, wider = increases(joint_1[::-1]), spread_difference(joint_1[0], joint_1[-1])
    ratios = np.nanmean(np.abs(curved.mean_angle.values)[-1], axis=0)
    # The largest first: joints by how far they bend, and by the size of their share in the mode.
    order, mode = np.argsort(-ratios), np.argsort(-np.array(printed()["pitchfork"]["joint_components"]))
    fit = study.fit
    closest, law = study.fits.isel(softest=0), study.law
    below = law.sel(softest=0.99 * exact, method="nearest")
    where = text["source"]
    springs = ", ".join(f"{value:g}" for value in trials.spring.values)
    found = [
        Row(
            "walks from straight on: which springs end in a curve",
            f"k1 = {text['curved']} curve, {text['straight']} do not",
            f"of {springs} N*mm/deg, {', '.join(f'{value:g}' for value in curved.spring.values)} curve",
            where,
            agrees(straight and bool(here[~stiff].any(axis=1).all())),
            "springs are spread about the planar model's 12 as the paper's about the robot's 34"
            + (f"; {unsettled} of {trials.settled.size} trials had not settled and count nowhere" if unsettled else ""),
        ),
        Row(
            "curved walks to the left and to the right",
            "both",
            f"{sides['left']} and {sides['right']}",
            where,
            agrees(min(sides.values()) > 0),
        ),
        Row(
            "angle of joint 1 over 1/k1",
            "increases",
            INCREASES[rising],
            where,
            agrees(rising),
        ),
        Row(
            "fluctuation among trials over 1/k1",
            "increases",
            f"{np.rad2deg(spread[-1, 0]):.2f} deg at k1 = {curved.spring.values[-1]:g}, "
            f"{np.rad2deg(spread[0, 0]):.2f} deg at {curved.spring.values[0]:g} N*mm/deg (standard deviation, joint "
            f"1): {wider}",
            where,
            agrees(wider.higher),
            "in the model uneven feet move the critical spring of a trial, which shows most beside it, where the angle "
            "rises steeply; a straight walk they leave straight",
        ),
        Row(
            "joints by how far they bend",
            f"{', '.join(str(1 + j) for j in mode)} (mode)",
            f"{', '.join(str(1 + j) for j in order)} (trials at {curved.spring.values[-1]:g} N*mm/deg: "
            + " ".join(f"{value:.2f}" for value in ratios / np.linalg.norm(ratios))
            + ")",
            printed()["pitchfork"]["source"],
            agrees(list(order) == list(mode)),
        ),
        Row(
            "critical k1 from the square-root fit to trials",
            f"{printed()['pitchfork']['robot_critical_k1']} (robot)",
            f"{fit.critical:.2f} ± {fit.bootstrap_error:.2f} N*mm/deg; the point itself is at {exact:.4f}",
            where,
            "differs",
            f"{100 * (fit.critical / exact - 1):+.1f} % off, {(fit.critical - exact) / fit.bootstrap_error:.0f} of its "
            "standard errors: the law holds beside the point only. Over the two stiffest curved springs alone it gives "
            f"{float(closest.critical_k1):.2f} ± {float(closest.bootstrap_error):.2f}",
        ),
        Row(
            "how the bend of joint 1 grows from the point",
            "square root of 1/k1",
            f"power {float(below.power):.2f} of the distance {100 * (1 - float(below.softest) / exact):.1f} % below, "
            f"{float(law.power[0]):.2f} at {100 * (1 - float(law.softest[0]) / exact):.2g} %",
            where,
            "differs",
            "the pitchfork is close to turning subcritical: its cubic coefficient is so small that the square root "
            "gives way to a fourth root almost at once",
        ),
        Row(
            "where trials settle",
            "not printed",
            f"within {float(study.agreement.max()):.0e} rad of the branch, "
            f"{int(study.agreement.notnull().sum())} trials",
            where,
            "not printed",
            "with even feet: uneven ones make each trial's robot another one",
        ),
    ]
    robot = float(printed()["pitchfork"]["robot_critical_k1"].split()[0])
    for spring, radius in text["radius"].items():
        ratio = float(spring) / robot
        model = axis_radius(study.branch, ratio * exact)
        found.append(
            Row(
                f"radius at {ratio:.2f} of the critical k1 (robot: {spring} N*mm/deg)",
                f"{radius} (robot)",
                f"{model:.3f} m (k1 = {ratio * exact:.2f} N*mm/deg)",
                where,
                "differs",
                f"the planar model bends {float(radius.split()[0]) / model:.1f} times as tightly",
            )
        )
    return found + _variant_rows(study)


def _variant_rows(study: CurvedStudy) -> list[Row]:
    found, data, table = [], study.comparison, printed()
    where = table["curved"]["different"]
    for name in data.variant.values[1:]:
        at, base = data.sel(variant=name), data.isel(variant=0)
        apart = Difference(float(at.fitted_k1 - base.fitted_k1), float(np.hypot(at.error, base.error)))
        robot_lower = float(at.robot_k1) < float(base.robot_k1)
        found.append(
            Row(
                f"square-root fit to trials, {name}",
                f"{float(at.robot_k1):g} N*mm/deg, {100 * float(at.robot_k1 / base.robot_k1 - 1):+.0f} % (robot)",
                f"{float(at.fitted_k1):.2f} ± {float(at.error):.2f} N*mm/deg, "
                f"{100 * float(at.fitted_k1 / base.fitted_k1 - 1):+.0f} %; exact {float(at.exact_k1):.3f}, "
                f"{100 * float(at.exact_k1 / base.exact_k1 - 1):+.0f} %",
                where,
                agrees(apart.lower if robot_lower else apart.higher),
                f"{at.criticality.item()}"
                + (
                    f": curved walks last up to {float(at.stiffest_k1):.3f} N*mm/deg, and no square root sets in"
                    if float(at.stiffest_k1) > float(at.exact_k1) * (1.0 + 1e-9)
                    else ""
                ),
            )
        )
        says = table["variants"][name]["radius"]
        ratio, error = float(at.equal_ratio), float(at.equal_ratio_error)
        fits = between(ratio, error, 0.0, 0.98) if says == "smaller" else near(ratio, error, 1.0, 0.05)
        found.append(
            Row(
                f"radius, {name}",
                says,
                f"{100 * (ratio - 1):+.1f} ± {100 * error:.1f} % at the same k1 over its critical value",
                where,
                agrees(fits),
                "the paper does not say at which springs it compares; "
                f"at the same k1, {data.attrs['spring']:.2f} N*mm/deg: {100 * (float(at.equal_spring) - 1):+.0f} %",
            )
        )
    return found
