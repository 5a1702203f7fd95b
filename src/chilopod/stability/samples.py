"""A family of systems sampled along its parameter: orbits that are known, or followed from a first guess."""

from __future__ import annotations

import bisect
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.branches.fold import Fold, find_fold
from chilopod.stability.capabilities import Family, SystemLike, is_autonomous
from chilopod.stability.orbits import find_orbit, from_known, known_state
from chilopod.stability.returns import ReturnMap, return_maps, section_at
from chilopod.stability.scales import sizes

Array = NDArray[np.float64]

_FIRST_STEPS = 8
_SHORTEST = 2.0**-10  # step of an orbit that is followed, relative to the first
_KEPT = 64  # systems: around a point the same one is asked for again and again
_JUMP = 0.3  # of the orbit between prediction and correction, relative to its size


@dataclass(frozen=True)
class Sample(ReadOnlyArrays):
    """The return map on the orbit at a value of the parameter."""

    value: float
    orbit: Array
    image: ReturnMap


class Samples:
    """Samples of a family, each computed once.

    Parameters
    ----------
    family
        ``family(value)`` is the system.
    guess
        Of the orbit at the lower end, or None if the systems know theirs.
    low, high
        The interval.
    budget
        Orbits that may be computed until the upper end is reached.

    Attributes
    ----------
    low, width
        Of the interval.
    first
        The orbit at the lower end, with its error bounds.
    known
        Whether the systems know their orbits.
    end
        Where the orbit ends, at most ``high``.
    fold
        The fold it ends in, if it does.
    ending
        A sentence where it ends otherwise; else empty.
    """

    def __init__(self, family: Family, guess: ArrayLike | None, low: float, high: float, budget: int) -> None:
        self._family = family
        self.low, self.width = low, high - low
        self.known = guess is None
        self._systems: dict[float, SystemLike] = {}
        self._by_value: dict[float, Sample] = {}
        self._values: list[float] = []
        self._budget = budget
        self._dimension, self._timed = 0, True
        self.count = 0
        self.ending = ""
        self.end, self.fold = high, None
        self.first = find_orbit(self.family(low), guess)
        self._size = sizes(self.family(low), self.first.state, self.first.period / self.first.image.returns)
        if guess is not None:
            self.end, self.fold = self._followed(low, high)

    def family(self, value: float) -> SystemLike:
        """The system at a value of the parameter, once it is seen to be of the same kind as the others."""
        if value in self._systems:
            return self._systems[value]
        system = self._family(value)
        timed = not is_autonomous(system)
        if self._dimension == 0:
            self._dimension, self._timed = system.dimension, timed
        if system.dimension != self._dimension or timed is not self._timed:
            what = "dimension" if system.dimension != self._dimension else "kind of period"
            raise ParameterError(f"changes its {what} at {value:g}", field="family", allowed="systems of one kind")
        if len(self._systems) >= _KEPT:
            self._systems.pop(next(iter(self._systems)))
        self._systems[value] = system
        return system

    def at(self, values: Array) -> list[Sample]:
        """Samples at some values within the interval; together where the systems allow it."""
        wanted = [float(value) for value in values]
        missing = sorted({value for value in wanted if value not in self._by_value})
        if missing and self.known:
            systems = [self.family(value) for value in missing]
            states = [known_state(system) for system in systems]
            images = return_maps(systems, states) if self._timed else [None] * len(systems)
            for value, system, state, image in zip(missing, systems, states, images, strict=True):
                orbit = from_known(system, state, image=image)
                self._keep(Sample(value, orbit.state, orbit.image))
        else:
            for value in missing:
                self._keep(self._between(value))
        return [self._by_value[value] for value in wanted]

    def _keep(self, sample: Sample) -> None:
        self.count += 1
        self._by_value[sample.value] = sample
        bisect.insort(self._values, sample.value)

    def _sampled(self, value: float, near: Array, beside: Sample) -> Sample:
        system = self.family(value)
        # The orbit beside tells how long an orbit takes, where it is the orbit's to say.
        section = section_at(system, near, self._size, beside.image.period / beside.image.returns)
        orbit = find_orbit(system, near, with_error=False, section=section, settle=False)
        return Sample(value, orbit.state, orbit.image)

    def _between(self, value: float) -> Sample:
        """A sample between two that are there, from their orbits."""
        right = min(max(bisect.bisect(self._values, value), 1), len(self._values) - 1)
        a, b = (self._by_value[self._values[i]] for i in (right - 1, right))
        t = (value - a.value) / (b.value - a.value)
        try:
            return self._sampled(value, (1 - t) * a.orbit + t * b.orbit, a)
        except AnalysisError:
            reached = self._follow([a], value)
            if not reached or reached[-1].value != value:
                raise
            return reached[-1]

    def _followed(self, low: float, high: float) -> tuple[float, Fold | None]:
        """Follow the orbit from the lower end; where it gets to, and the fold it ends in before the upper end."""
        samples = [Sample(low, self.first.state, self.first.image)]
        self._keep(samples[0])
        for value in np.linspace(low, high, _FIRST_STEPS + 1)[1:].tolist():
            reached = self._follow(samples, value)
            for sample in reached:
                self._keep(sample)
            samples += reached
            last = samples[-1]
            if last.value != value:
                fold = find_fold(self.family, last.value, last.orbit, high - low)
                if fold is not None and not self._ends_in(last, fold):
                    fold = None
                if fold is None:
                    self.ending = f"the orbit cannot be followed beyond {last.value:.9g}"
                return last.value, fold if fold is not None and low <= fold.value <= high else None
        return high, None

    def _follow(self, behind: list[Sample], value: float) -> list[Sample]:
        """Samples from the last one behind to ``value``, by smaller steps where Newton's method does not carry that
        far.

        They end early where the orbit does, or the budget.
        """
        behind = behind[-2:]
        reached: list[Sample] = []
        smallest = _SHORTEST * abs(value - behind[-1].value)
        target = value
        while self.count + len(reached) < self._budget:
            last = behind[-1]
            guess = last.orbit
            if len(behind) > 1:
                slope = (last.orbit - behind[-2].orbit) / (last.value - behind[-2].value)
                guess = guess + (target - last.value) * slope
            try:
                found = self._sampled(target, guess, last)
            except AnalysisError:
                found = None
            # A large jump means that Newton's method has found another orbit.
            if found is None or self._jumped(found.orbit, guess):
                target = 0.5 * (last.value + target)
                if abs(target - last.value) < smallest:
                    return reached
                continue
            reached.append(found)
            if target == value:
                return reached
            longer = target + 2.0 * (target - last.value)
            behind, target = [last, found], longer if abs(value - longer) > smallest and longer < value else value
        return reached

    def _ends_in(self, last: Sample, fold: Fold) -> bool:
        """Whether a fold is just past the last sample, on the same orbit; others may be anywhere."""
        further = fold.value - last.value
        return (
            bool(np.isfinite(fold.error_bound))
            and -fold.error_bound <= further <= self.width / _FIRST_STEPS
            and not self._jumped(fold.image.state, last.orbit)
        )

    def _jumped(self, orbit: Array, guess: Array) -> bool:
        return bool((np.abs(orbit - guess) > _JUMP * np.maximum(self._size, np.abs(guess))).any())
