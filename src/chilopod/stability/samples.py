"""A family of systems sampled along its parameter: orbits that are known, or followed from a first guess."""

from __future__ import annotations

import bisect
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.capabilities import Autonomous, Family
from chilopod.stability.fold import Fold, find_fold
from chilopod.stability.orbits import find_orbit, from_known, known_state
from chilopod.stability.returns import ReturnMap, return_maps, section_at

Array = NDArray[np.float64]

_FIRST_STEPS = 8
_SHORTEST = 2.0**-10  # step of an orbit that is followed, relative to the first
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

    Attributes
    ----------
    end
        Where the orbit ends, at most ``high``.
    fold
        The fold it ends in, if it does.
    """

    def __init__(self, family: Family, guess: ArrayLike | None, low: float, high: float) -> None:
        self.family = family
        self._known = guess is None
        self._by_value: dict[float, Sample] = {}
        self._values: list[float] = []
        self.end, self.fold = high, None
        if guess is not None:
            self.end, self.fold = self._followed(guess, low, high)

    def at(self, values: Array) -> list[Sample]:
        """Samples at some values within the interval; together where the systems allow it."""
        wanted = [float(value) for value in values]
        missing = sorted({value for value in wanted if value not in self._by_value})
        if missing and self._known:
            systems = [self.family(value) for value in missing]
            states = [known_state(system) for system in systems]
            autonomous = any(isinstance(system, Autonomous) for system in systems)
            images = [None] * len(systems) if autonomous else return_maps(systems, states)
            for value, system, state, image in zip(missing, systems, states, images, strict=True):
                orbit = from_known(system, state, image=image)
                self._keep(Sample(value, orbit.state, orbit.image))
        else:
            for value in missing:
                self._keep(self._between(value))
        return [self._by_value[value] for value in wanted]

    def _keep(self, sample: Sample) -> None:
        self._by_value[sample.value] = sample
        bisect.insort(self._values, sample.value)

    def _sampled(self, value: float, near: ArrayLike, beside: Sample | None = None) -> Sample:
        system = self.family(value)
        section = None
        if beside is not None:  # which tells how long an orbit takes, where it is the orbit's to say
            section = section_at(system, np.asarray(near), None, beside.image.period / beside.image.returns)
        orbit = find_orbit(system, near, with_error=False, section=section)
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

    def _followed(self, guess: ArrayLike, low: float, high: float) -> tuple[float, Fold | None]:
        """Follow the orbit from the lower end; where it gets to, and the fold it ends in before the upper end."""
        samples = [self._sampled(low, guess)]
        self._keep(samples[0])
        for value in np.linspace(low, high, _FIRST_STEPS + 1)[1:].tolist():
            reached = self._follow(samples, value)
            for sample in reached:
                self._keep(sample)
            samples += reached
            last = samples[-1]
            if last.value != value:
                fold = find_fold(self.family, last.value, last.orbit, high - low)
                if fold is None:
                    raise AnalysisError(
                        "the orbit cannot be followed further",
                        field="parameter",
                        value=last.value,
                        allowed="an interval in which it exists",
                    )
                return last.value, fold if low <= fold.value <= high else None
        return high, None

    def _follow(self, behind: list[Sample], value: float) -> list[Sample]:
        """Samples from the last one behind to ``value``, by smaller steps where Newton's method does not carry that
        far.

        They end early where the orbit does.
        """
        behind = behind[-2:]
        reached: list[Sample] = []
        smallest = _SHORTEST * abs(value - behind[-1].value)
        target = value
        while True:
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
            if found is None or np.abs(found.orbit - guess).max() > _JUMP * max(1e-3, float(np.abs(guess).max())):
                target = 0.5 * (last.value + target)
                if abs(target - last.value) < smallest:
                    return reached
                continue
            reached.append(found)
            if target == value:
                return reached
            longer = target + 2.0 * (target - last.value)
            behind, target = [last, found], longer if abs(value - longer) > smallest and longer < value else value
