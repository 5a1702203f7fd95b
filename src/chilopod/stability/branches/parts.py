"""Short parts of a branch, for a search along the parameter that ends in a fold or where the orbit changes steeply."""

from __future__ import annotations

import contextlib
import itertools
import math

from chilopod.errors import ChilopodError
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array
from chilopod.stability.branches.branch import LONGEST, followed, opened
from chilopod.stability.branches.branch_points import Anchor, BranchPoint, OnCurve
from chilopod.stability.branches.branch_starts import Start, begin
from chilopod.stability.branches.curve import Curve
from chilopod.stability.branches.inspection import inspect
from chilopod.stability.continuation.equations import Step
from chilopod.stability.continuation.tracer import Ending, trace
from chilopod.stability.interface import Family
from chilopod.stability.points import BifurcationPoint, Kind

_FIRST, _FOLD_STEPS = 0.01, 40  # first step, in units of the states' sizes, and number of steps round a fold


def find_fold(
    family: Family, value: float, orbit: Array, scale: float, rising: bool = True, budget: Budget | None = None
) -> BifurcationPoint | None:
    """Follow an orbit, with the systems' symmetry in time, round the next fold; None without one.

    The orbit must not be in the fold: a curve that starts there does not pass it. The search extends as far as
    ``scale``, to higher values if ``rising``, else to lower ones.
    """
    between = value - scale, value + scale
    with contextlib.suppress(ChilopodError):
        symmetric, allowed = family(value).symmetry is not None, budget or Budget(math.inf)
        curve = Curve(family, 2.0 * scale, between=between, symmetric=symmetric, budget=allowed)
        with curve.budget:
            start = begin(family, value, orbit, rising, symmetric=symmetric)
            branch = followed(curve, *opened(curve, start, _FIRST), LONGEST, _FOLD_STEPS, False, until=Kind.FOLD)
            return next((each.bifurcation for each in branch.special_points if each.special is Kind.FOLD), None)
    return None


def rising_part(
    family: Family, start: Start, between: tuple[float, float], scale: float, budget: Budget, points: int
) -> tuple[list[BranchPoint], BifurcationPoint | None]:
    """Ordinary points of a curve, with the systems' symmetry in time, from a start at the lower end of an interval to
    the upper end, or to where the curve turns back or is lost; and the fold in which it turns back, if any."""
    found: list[BranchPoint] = []

    def look(step: Step[Anchor, OnCurve], ending: Ending | None) -> tuple[list[BranchPoint], Ending | None]:
        end = step.end.last
        rises = bool(end.tangent[-1] > 0.0)  # perhaps past two folds, which a close look finds
        return [*inspect(curve, step, rises).points, end], ending if rises else Ending.ENOUGH_POINTS

    with contextlib.suppress(ChilopodError):
        symmetric = family(start.value).symmetry is not None
        curve = Curve(family, scale, between=between, symmetric=symmetric, budget=budget)
        branch, anchor = opened(curve, start, _FIRST)
        curve.first, curve.long_steps = branch.points[0], True
        trace(curve, anchor, (_FIRST, LONGEST), points, look, lambda looked, _: found.extend(looked))
    rising = list(itertools.takewhile(lambda each: each.special is not Kind.FOLD and each.tangent[-1] > 0.0, found))
    fold = next((each.bifurcation for each in found[len(rising) :] if each.special is Kind.FOLD), None)
    return [each for each in rising if each.special is None], fold
