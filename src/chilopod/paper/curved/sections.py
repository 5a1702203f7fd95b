"""Curved walks: the sections of this chapter, and their rows beside the paper's model and its robot."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.undulation import DISTANCES, undulating_walks
from chilopod.paper import printed, statements
from chilopod.paper.curved import figures
from chilopod.paper.curved.study import CurvedStudy, axis_radius, bend_order, curved_study, fluctuation
from chilopod.paper.measures import change, radius_ratio
from chilopod.paper.section import Section
from chilopod.paper.table import INCREASES, OfPlanar, Result, Row, Verdict, agreement, unprinted
from chilopod.show.figures import branch, undulation
from chilopod.statistics import Estimate, increases
from chilopod.tasks.radius_law import is_curved

CHAPTER = "Curved walks"

_SPRINGS = (stiffness(6.0), stiffness(20.0))


def rows(study: CurvedStudy) -> list[Row | OfPlanar]:
    """Lines of both tables."""
    return [*_model_rows(study), *_beside_robot(study), *_variants_beside_robot(study)]


def _model_rows(study: CurvedStudy) -> list[Row]:
    trials, law = study.trials, study.law
    exact = trials.attrs["critical_k1"]
    stiffest = trials.isel(spring=[np.flatnonzero(is_curved(trials).any(axis=1))[-1]])
    order, bends = bend_order(stiffest), np.abs(stiffest.mean_angle.values[is_curved(stiffest)]).mean(axis=0)
    shape = " ".join(f"{value:.2f}" for value in bends / np.linalg.norm(bends))
    below = law.sel(softest=0.99 * exact, method="nearest")
    mode, unsettled = f"{', '.join(map(str, printed.MODE_ORDER))} (mode)", int((~trials.settled).sum())
    bent = f"{', '.join(map(str, order))} (trials at {float(stiffest.spring[0]):g} N*mm/deg: {shape})"
    grows = (
        f"power {float(below.power):.2f} of the distance {100 * (1 - float(below.softest) / exact):.1f} % "
        f"below, {float(law.power[0]):.2f} at {100 * (1 - float(law.softest[0]) / exact):.2g} %"
    )
    none = "not printed (robot: fitted by a square root of 1/k1)"
    off, count = float(study.agreement.max()), int(study.agreement.notnull().sum())
    remark = "with even feet: uneven ones make each trial's robot another one"
    if unsettled:
        remark += f"; of uneven ones {unsettled} of {trials.settled.size} had not settled"
    said, where, verdict = Result(grows), printed.EXPERIMENTS, agreement(order == printed.MODE_ORDER)
    return [
        Row("joints by how far they bend", mode, Result(bent), printed.ANALYSIS, verdict),
        Row("how the bend of joint 1 grows from the point", none, said, where, Verdict.NOT_PRINTED),
        unprinted("where trials settle", f"within {off:.0e} rad of the branch, {count} trials", where, remark),
    ]


def _beside_robot(study: CurvedStudy) -> list[OfPlanar]:
    trials, here = study.trials, is_curved(study.trials)
    exact, springs = trials.attrs["critical_k1"], trials.spring.values
    left, right = (int((trials.direction == side).sum()) for side in ("left", "right"))
    curving = here.any(axis=1)
    angles = np.where(here, np.abs(trials.mean_angle.sel(joint=1).values), np.nan)
    rising = increases(list(angles[curving & np.isfinite(angles).any(axis=1)])[::-1])
    wider, softest, stiffest = fluctuation(trials)
    curved = f"curved up to {max(springs[curving]):g} N*mm/deg, {left} to the left and {right} to the right"
    words = [
        OfPlanar(statements.STRAIGHT, Result(f"straight from {min(springs[~curving]):g} N*mm/deg up")),
        OfPlanar(statements.CURVED, Result(curved)),
        OfPlanar(statements.ONSET, _onset(study.fit.critical, exact)),
        OfPlanar(statements.RISING, Result(INCREASES[rising.answer])),
        OfPlanar(statements.FLUCTUATION, Result(f"{wider} at {softest:g} than at {stiffest:g} N*mm/deg")),
    ]
    for spring, statement in statements.RADII.items():
        radius = float(axis_radius(study.branch, spring / printed.ONSET.value * exact))
        words.append(OfPlanar(statement, Result(f"{radius:.2f} m at the same share of its point", radius, unit="m")))
    return words


def _variants_beside_robot(study: CurvedStudy) -> list[OfPlanar]:
    words = []
    for name, statement in statements.VARIANTS.items():
        at = study.comparison.sel(variant=name)
        ratio = radius_ratio(study.variants[printed.AS_BUILT], study.variants[name])
        text = (
            f"{change(ratio.distance)} at equal distance from its own onset; "
            f"{change(Estimate(float(at.equal_spring)))} at the same spring"
        )
        words.append(OfPlanar(statement.onset, _onset(float(at.fitted_k1), float(at.exact_k1))))
        words.append(OfPlanar(statement.radius, Result(text, ratio.distance.value, ratio.distance.error)))
    return words


def _onset(fitted: float, exact: float) -> Result:
    return Result(f"{fitted:.2f} {PAPER_UNIT}; the point is at {exact:.2f}", fitted, unit=PAPER_UNIT)


CURVED: Section[CurvedStudy] = Section(
    "curved", CHAPTER, "walks from straight on, trial by trial", curved_study, rows, figures.panels
)
BRANCH: Section[xr.Dataset] = Section(
    "branch",
    CHAPTER,
    "the curved walks beyond the pitchfork",
    lambda context, report: curved_walks(context.robot, K1, _SPRINGS, longest=0.05, progress=report),
    panels=branch.panel,
)
UNDULATION: Section[xr.Dataset] = Section(
    "undulation",
    CHAPTER,
    "undulating walks of uniform springs",
    lambda context, report: undulating_walks(context.robot, context.size.cut(DISTANCES, DISTANCES[-2:]), report),
    panels=undulation.panel,
)
