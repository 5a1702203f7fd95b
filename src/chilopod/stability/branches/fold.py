"""Folds: an orbit ends along the parameter where it meets another one and both vanish."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chilopod.errors import ChilopodError
from chilopod.frozen import Array
from chilopod.stability.branches.branch import Branch, follow, proceed
from chilopod.stability.branches.branch_points import BranchPoint
from chilopod.stability.branches.branch_starts import begin
from chilopod.stability.points import Kind
from chilopod.stability.problem.budget import SpentError
from chilopod.stability.problem.capabilities import Family, SystemLike, returns_per_period
from chilopod.stability.problem.returns import ReturnMap, return_map, section_at
from chilopod.stability.tracing.ending import Ending

_STEPS = 40
_FLOWS = 2000  # budget of a step
_STEP = 0.01  # step along the curve, in units of the states' sizes and the parameter's scale


@dataclass(frozen=True)
class Fold:
    """A fold of periodic orbits."""

    value: float  # value of the parameter
    error_bound: float  # bound on its error
    image: ReturnMap  # return map at the critical orbit


def find_fold(
    family: Family, value: float, orbit: Array, scale: float, rising: bool = True, *, systems: float = np.inf
) -> Fold | None:
    """Follow an orbit, with the systems' symmetry in time, round the next fold; None without one.

    The orbit must not be in the fold: a curve that starts there does not pass it. The search extends as far as
    ``scale``, to higher values if ``rising``, else to lower ones, and makes at most as many systems as ``systems``.
    """
    between, made = (value - scale, value + scale), 0

    def counted(at: float) -> SystemLike:
        nonlocal made
        made += 1
        if made > systems:
            raise SpentError("the budget of the search for a fold is spent", field="budget")
        return family(at)

    try:
        start = begin(counted, value, orbit, rising, symmetric=True)
        branch = follow(counted, start, between, points=1, step=_STEP, closely=False, symmetric=True, budget=_FLOWS)
        while not _folds(branch) and branch.ending is Ending.ENOUGH_POINTS and len(branch.points) < _STEPS:
            branch = proceed(counted, branch, between, points=1, closely=False, budget=_FLOWS)
        fold = next(iter(_folds(branch)), None)
        if fold is None or fold.bifurcation is None:
            return None
        system = family(fold.value)
        duration = None if fold.period is None else fold.period / returns_per_period(system)
        image = return_map(system, fold.orbit, section=section_at(system, fold.orbit, branch.sizes, duration))
    except ChilopodError:
        return None
    return Fold(fold.value, fold.bifurcation.error_bound, image)


def _folds(branch: Branch) -> list[BranchPoint]:
    return [point for point in branch.points if point.special is Kind.FOLD]
