"""Extent of the orbit that a search follows: where it begins and ends, and why.

An orbit may end before its interval in a fold, which a short branch round it shows (``_fold_beside``), in an
equilibrium (``_at_rest``), or at another orbit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.deadline import Budget, SpentError
from chilopod.frozen import Array
from chilopod.stability.branches.parts import find_fold
from chilopod.stability.crossing_place import Sample
from chilopod.stability.equilibria import SHRINKS, has_centre
from chilopod.stability.interface import SystemLike, checked_flow, returns_per_period
from chilopod.stability.points import BifurcationPoint
from chilopod.stability.returns import event_beside
from chilopod.stability.search.samples import NEAR_FOLD, Samples

_BEFORE = 1e-6  # distance from a fold at which the search for crossings ends, relative to the interval
_JUST_PAST = 0.125  # farthest fold past the end of an orbit that was followed, relative to the interval
_TRIES = 2  # starts of curves round a fold
_FLOWS = 2  # flows of each, for every orbit of the budget
_CLEAR_OF_FOLD = 1e-3  # distance of a multiplier from +1 from which a curve that starts there passes the fold
_COMES, _FARTHER = 1e-5, 100.0  # distance from a fold, relative to the interval, and factor of a second one
_MERGING = 1e-4  # distance from a meeting of orbits, relative to the interval, at which multipliers are uncertain
_BETWEEN_POWERS = 0.75  # mean of the powers one half and one
_AT_REST = 0.03  # motion, relative to the first orbit's, that counts as rest
_PER_UNIT = 16.0  # part of the interval that counts as a unit beyond the path, whose last step may be as short
_PARTS = 5  # parts of a return at which the extent of the motion is sampled


@dataclass(frozen=True)
class Extent:
    """Part of the interval in which an orbit exists, apart from others."""

    start: float
    end: float
    folds: tuple[BifurcationPoint, ...] = ()  # folds at the ends of the orbit
    ending: str = ""  # sentence on another end before that of the interval
    shrinks: bool = False  # it ends in an equilibrium
    beside: float = 0.0  # distance of a fold from start and end

    def explains(self, value: float) -> bool:
        """True if a value is so near an end of the orbit that a multiplier +1 belongs to that end."""
        ends = [fold.value for fold in self.folds] + [self.end] * self.shrinks
        return any(abs(value - end) <= 2.0 * self.beside for end in ends)


def extent(samples: Samples) -> Extent:
    """Extent of the orbit through some samples."""
    path, high = samples.path, samples.high
    if samples.known:
        return Extent(samples.low, high)
    first, last, beside = path[0], path[-1], _BEFORE * samples.width
    if samples.spent:
        ending = f"{samples.spent} before the orbit was followed beyond {last.value:.9g}"
        return Extent(first.value, last.value, ending=ending)
    folds: tuple[BifurcationPoint, ...] = ()
    start = first.value
    if first.off_plus_one <= NEAR_FOLD:
        fold = _fold_beside(samples, first, path[1:], rising=False)
        if fold is not None and fold.value + beside >= start:
            start = min(start + beside, last.value)
            folds = (fold,) if fold.value >= first.value - fold.error_bound else ()
    if last.value == high and last.off_plus_one > NEAR_FOLD:
        return Extent(start, high, folds, beside=beside)
    fold = _fold_beside(samples, last, path[-2::-1], rising=True)
    here = (last.value, last.orbit, last.image.period) if fold is None else (fold.value, fold.orbit, fold.period)
    if last.value != high and _at_rest(samples, *here):
        ending = f"{SHRINKS} near {here[0]:.9g}: a Hopf point"
        return Extent(start, last.value, folds, ending, shrinks=True, beside=beside)
    if fold is None:
        ending, end = "" if last.value == high else _lost(samples), last.value
        if samples.merges:
            lost = "a multiplier comes to +1 and the corrector loses the orbit"
            ending = f"near {end:.9g} {lost}: it touches +1 there, or another orbit meets it"
            end = max(start, end - _MERGING * samples.width)
        return Extent(start, end, folds, ending, beside=beside)
    # Near the fold multipliers move as a root of the distance, which a search cannot resolve.
    end = max(first.value, min(last.value, fold.value - beside))
    return Extent(start, end, folds + (fold,) * (fold.value <= high + fold.error_bound), beside=beside)


def _lost(samples: Samples) -> str:
    """Sentence on the end of the path, with the event that is there if one is."""
    last, value = samples.path[-1], samples.path[-1].value

    def ahead(distance: float) -> tuple[SystemLike, Array]:
        beyond = min(max(value + _PER_UNIT * distance * samples.width, samples.low), samples.high)
        return samples.family(beyond), samples.ahead(beyond)

    said = f"the orbit cannot be followed beyond {value:.9g}"
    event = event_beside(samples.family(value), last.orbit, last.image.duration, ahead)
    return f"{said}: {event}" if event else said


def _fold_beside(samples: Samples, sample: Sample, others: list[Sample], rising: bool) -> BifurcationPoint | None:
    """The fold next to a sample, from the nearest of the others that is clear of it."""
    if rising and samples.fold is not None:
        sure = np.isfinite(samples.fold.error_bound) and _as_a_root(samples, sample, samples.fold, rising)
        return samples.fold if sure else None
    near = [sample, *others]
    clear = min(_CLEAR_OF_FOLD, max(each.off_plus_one for each in near) / 2.0)
    for each in [each for each in near if each.off_plus_one > clear][:_TRIES]:
        budget = Budget(_FLOWS * samples.orbits, samples.budget.remaining)
        fold = find_fold(samples.family, each.value, each.orbit, samples.width, rising, budget)
        # Close to it a step may land on another curve with another fold.
        if fold is not None and _next_to(samples, sample, fold, rising) and _as_a_root(samples, sample, fold, rising):
            return fold
    return None


def _next_to(samples: Samples, sample: Sample, fold: BifurcationPoint, rising: bool) -> bool:
    """True if a fold is just past a sample at either end, on the same orbit."""
    further = fold.value - sample.value if rising else sample.value - fold.value
    return (
        bool(np.isfinite(fold.error_bound))
        # In a fold Newton's method may converge to states that are not orbits.
        and -max(fold.error_bound, _BEFORE * samples.width) <= further <= _JUST_PAST * samples.width
        and not samples.jumped(fold.orbit, sample.orbit)
    )


def _as_a_root(samples: Samples, sample: Sample, fold: BifurcationPoint, rising: bool) -> bool:
    """True if the multiplier approaches +1 as a root, as in a fold; at a crossing branch it does so linearly."""
    near = max(_COMES * samples.width, abs(fold.value - sample.value))
    away = np.array([near, min(_FARTHER * near, 0.5 * samples.width)])
    places = np.clip(fold.value + (-away if rising else away), samples.low, samples.end)
    away = np.abs(places - fold.value)
    try:
        off = [each.off_plus_one for each in samples.at(places)]
    except (AnalysisError, SpentError):
        return True  # no evidence against it
    return bool(away[1] <= away[0] or off[1] < off[0] * (away[1] / away[0]) ** _BETWEEN_POWERS)


def _at_rest(samples: Samples, value: float, state: Array, period: float) -> bool:
    """True if the motion nearly vanishes at the end of an orbit, around an equilibrium, as spikes may lie between the
    samples of a motion: past a fold there the same orbit comes again."""

    def moved(value: float, state: Array, period: float) -> float:
        """Extent of the motion within a return, relative to the sizes of the states."""
        system, path = samples.family(value), [state]
        for _ in range(_PARTS - 1):
            path.append(checked_flow(system, path[-1], 0.0, period / returns_per_period(system) / _PARTS)[0])
        return float((np.ptp(np.array(path), axis=0) / samples.size).max())

    first = samples.low, samples.first.state, samples.first.period
    small = not samples.family.timed and moved(value, state, period) < _AT_REST * moved(*first)
    return small and has_centre(samples.family(value), state, period)
