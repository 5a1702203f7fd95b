"""Folds: an orbit ends along the parameter where it meets another one and both vanish."""

from __future__ import annotations

from dataclasses import dataclass

from chilopod.errors import ChilopodError
from chilopod.frozen import Array
from chilopod.stability.branches.branch import LONGEST, followed, opened
from chilopod.stability.branches.branch_starts import begin
from chilopod.stability.branches.curve import Curve
from chilopod.stability.points import Kind
from chilopod.stability.problem.budget import Budget
from chilopod.stability.problem.capabilities import Family
from chilopod.stability.problem.returns import ReturnMap

_STEPS = 40
_STEP = 0.01  # step along the curve, in units of the states' sizes and the parameter's scale


@dataclass(frozen=True)
class Fold:
    """A fold of periodic orbits."""

    value: float  # value of the parameter
    error_bound: float  # bound on its error
    image: ReturnMap  # return map at the critical orbit


def find_fold(
    family: Family, value: float, orbit: Array, scale: float, rising: bool = True, budget: Budget | None = None
) -> Fold | None:
    """Follow an orbit, with the systems' symmetry in time, round the next fold; None without one.

    The orbit must not be in the fold: a curve that starts there does not pass it. The search extends as far as
    ``scale``, to higher values if ``rising``, else to lower ones.
    """
    between = value - scale, value + scale
    try:
        curve = Curve(family, 2.0 * scale, between=between, symmetric=True, budget=budget)
        with curve.budget:
            start = begin(family, value, orbit, rising, symmetric=True)
            branch = followed(curve, *opened(curve, start, _STEP), LONGEST, _STEPS, False, until=Kind.FOLD)
            for fold in branch.special_points:
                if fold.special is Kind.FOLD and fold.bifurcation is not None:
                    section = curve.section_at(fold.orbit, fold.value, fold.period)
                    image = curve.image(fold.orbit, fold.value, section)
                    return Fold(fold.value, fold.bifurcation.error_bound, image)
    except ChilopodError:
        pass
    return None
