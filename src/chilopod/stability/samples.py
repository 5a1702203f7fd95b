"""A family of systems sampled along its parameter: orbits that are known, or followed from a first guess."""

from __future__ import annotations

import bisect
import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ParameterError, in_words
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.budget import Budget, SpentError, UserCode, UserError
from chilopod.stability.capabilities import Family, SystemLike, is_autonomous
from chilopod.stability.floquet import return_multipliers
from chilopod.stability.orbits import Orbit, find_orbit, from_known, known_state
from chilopod.stability.returns import ReturnMap, return_map, return_maps, section_at
from chilopod.stability.scales import sizes

Array = NDArray[np.float64]

FIRST_STEPS = 8
"""Steps in which an orbit is followed through the interval, if it takes no shorter ones."""
_SHORTEST = 2.0**-10  # step of an orbit that is followed, relative to the first
_RETURNS = 2  # return maps for every orbit of the budget, to follow the orbit and again to search
_DEAREST = 8.0  # return maps for an orbit
_ATTEMPTS = 24  # steps to a value from the sample beside it: ten halvings, and on from there
_KEPT = 64  # systems: around a point the same one is asked for again and again
NEAR_FOLD = 0.02
"""Distance of a multiplier from +1 within which a fold may be so near that the search does not tell it."""
_SURE = 1e-4  # singular value of H - 1, in units, above which the orbit is as good as the flow
_BESIDE = 1e-6  # of the sizes of the states, where the derivative is taken once more to see it change
_FORESEEN, _SMALL = 0.3, 0.01  # of a change of the orbit, and of the sizes: what a prediction may miss
_SAME = 1e-7  # of the sizes: orbits that are nearer to what was foreseen are solved for no better
_HALVED, _CLOSER = 12, 0.75  # times, and by how much less samples beside a multiplier +1 are apart each time
_HALFWAY = 0.25  # of a change: an orbit halfway between two is as near as that to their mean
_BEYOND, _APART = 8, 0.1  # samples beyond two to choose from, and how far from these, of the distance of the two
_BEHIND = 4  # samples by which the next one is foreseen
_BENT = 0.3  # of the distance of two orbits: how far from the straight line the one between them may be
_TOUCHING = 0.25  # of a multiplier's distance from +1: straight lines that meet nearer to it may touch it
_MERGED = 1e-5  # of the interval: a gap in which they still do
_JUMP = 0.3  # of the orbit between prediction and correction, relative to its size


@dataclass(frozen=True)
class Sample(ReadOnlyArrays):
    """The return map on the orbit at a value of the parameter."""

    value: float
    orbit: Array
    image: ReturnMap

    @property
    def off_plus_one(self) -> float:
        """Distance of the return map's multipliers from +1, that along the motion left aside."""
        return float(np.abs(return_multipliers(self.image) - 1.0).min(initial=np.inf))

    @property
    def beside_plus_one(self) -> float:
        """Signed distance of the nearest real multiplier from +1; NaN if a pair is nearer."""
        off = return_multipliers(self.image) - 1.0
        nearest = complex(off[np.abs(off).argmin()]) if off.size else np.nan
        return nearest.real if nearest.imag == 0.0 else np.nan

    def passes(self, other: Sample) -> bool:
        """Whether the multiplier nearest +1 is on its other side in another sample."""
        return self.beside_plus_one * other.beside_plus_one < 0.0


def _touches(first: Sample, left: Sample, right: Sample, last: Sample) -> bool:
    """Whether a multiplier on one side of +1 heads for it from both sides of the gap between two of four samples."""
    places = np.array([each.value for each in (first, left, right, last)])
    off = np.array([each.beside_plus_one for each in (first, left, right, last)])
    if not np.isfinite(off).all() or (np.sign(off) != np.sign(off[1])).any():
        return False
    off = np.abs(off)
    into, out = np.diff(off)[[0, 2]] / np.diff(places)[[0, 2]]
    if not into < 0.0 < out:
        return False
    meeting = (off[2] - off[1] + into * places[1] - out * places[2]) / (into - out)
    return bool(off[1] + into * (meeting - places[1]) < _TOUCHING * off[1:3].min())


class Samples:
    """Samples of a family, each computed once.

    Parameters
    ----------
    family
        ``family(value)`` is the system.
    guess
        Guess of the orbit at the lower end, or None if the systems know theirs.
    low, high
        The interval.
    budget
        Orbits that may be computed until the upper end is reached, by twice as many return maps, and as many return
        maps once more for those in between.
    seconds
        Time for all that, once the first orbit is found.

    Attributes
    ----------
    low, high, width
        Low, high and width of the interval.
    first
        The orbit at the lower end, with its error bounds.
    known
        True if the systems know their orbits.
    timed
        True if the systems depend on time.
    size
        Size of the states on the first orbit, shape (n,).
    path
        The samples by which an orbit that is not known was followed from ``low``, as far as it goes.
    end
        Value at which the orbit ends, at most ``high``.
    spent
        True if the path ends because the budget was spent.
    merges
        True if the path ends where the orbit meets another one, which goes on alone.
    """

    def __init__(
        self, family: Family, guess: ArrayLike | None, low: float, high: float, budget: int, seconds: float
    ) -> None:
        self._family = family
        self.low, self.high, self.width = low, high, high - low
        self.known = guess is None
        self._systems: dict[float, SystemLike] = {}
        self._by_value: dict[float, Sample] = {}
        self._values: list[float] = []
        self._missing: dict[float, AnalysisError] = {}
        self._bends: dict[float, float] = {}
        self._orbits = budget
        self._allowed = _RETURNS * budget
        self._refused: dict[str, tuple[str, set[float]]] = {}
        self._dimension, self.timed = 0, True
        self.count = self._counted = 0
        self.budget = Budget(self._allowed, seconds)
        with self.budget, UserCode("family", low):
            self.first = find_orbit(self.family(low), guess, budget=self.budget)
            self.size = sizes(self.family(low), self.first.state, self.first.period / self.first.image.returns)
        self.budget.left = self._allowed
        if not (self.known and self.timed):
            self._keep(_sample(low, self.first))
        self.spent = False
        self.merges = False
        with self.budget:
            self.path = [] if guess is None else self._to_merging(self._followed(low, high))
        self.end = self.path[-1].value if self.path else high
        self.allow(self._allowed)

    def family(self, value: float) -> SystemLike:
        """The system at a value of the parameter, once it is seen to be of the same kind as the others."""
        if value in self._systems:
            return self._systems[value]
        with self._asking(value):
            system = self._family(value)
        timed = not is_autonomous(system)
        if self._dimension == 0:
            self._dimension, self.timed = system.dimension, timed
        if system.dimension != self._dimension or timed is not self.timed:
            what = "dimension" if system.dimension != self._dimension else "kind of period"
            self._refuse(value, what, f"the family changes its {what}")
            raise AnalysisError(f"changes its {what} at {value:g}", field="family", allowed="systems of one kind")
        if len(self._systems) >= _KEPT:
            self._systems.pop(next(iter(self._systems)))
        self._systems[value] = system
        return system

    def at(self, values: Array) -> list[Sample]:
        """Samples at some values within the interval; together where the systems allow it.

        Raises
        ------
        AnalysisError
            If there is none at one of them; those at the others are kept.
        """
        wanted = [float(value) for value in values]
        missing = sorted({value for value in wanted if value not in self._by_value})
        if len(missing) > 1 and self.known and self.timed:
            try:
                self._keep_known(missing)
                missing = []
            except SpentError:
                raise
            except AnalysisError:
                pass  # which one it was shows when each is asked for alone
        for value in missing:
            if value in self._by_value or value in self._missing:
                continue
            try:
                if self.known and self.timed:
                    self._keep_known([value])
                else:
                    self._keep(self._of_itself(value) if self.known else self._between(value))
            except SpentError:
                raise
            except AnalysisError as error:
                self._missing[value] = error
        for value in wanted:
            if value in self._missing:
                raise self._missing[value]
        return [self._by_value[value] for value in wanted]

    def _keep_known(self, values: list[float]) -> None:
        """Samples of systems that depend on time and know their orbits."""
        systems = [self.family(value) for value in values]
        for _ in systems:
            self.budget.take()
        with self._asking(values[0]) if len(values) == 1 else UserCode("family", values[0]):
            states = [known_state(system) for system in systems]
            images = return_maps(systems, states)
        for value, system, state, image in zip(values, systems, states, images, strict=True):
            orbit = from_known(system, state, image=image, budget=self.budget)
            self._keep(Sample(value, orbit.state, orbit.image))

    def allow(self, returns: int) -> None:
        """From now on, at most so many return maps."""
        self._allowed, self._counted = returns, self.count
        self.budget.left = returns

    def affordable(self) -> int:
        """How many more orbits there may be, at the price of those since :meth:`allow`."""
        if self.budget.late:
            return 0
        price = (self._allowed - self.budget.left) / max(self.count - self._counted, 1)
        # Those that were not found say nothing of the next ones.
        return int(self.budget.left / min(max(price, 1.0), _DEAREST))

    @property
    def remarks(self) -> list[str]:
        """Where there was no system, and why, a sentence each."""
        return [
            said + (f", and at {len(values) - 1} more values" if len(values) > 1 else "")
            for said, values in self._refused.values()
        ]

    def _refuse(self, value: float, kind: str, why: str) -> None:
        self._refused.setdefault(kind, (f"{why} at {value:.9g}", set()))[1].add(value)

    @contextlib.contextmanager
    def _asking(self, value: float) -> Iterator[None]:
        """Around calls of the user's functions: exceptions of theirs mean that there is no system."""
        try:
            with UserCode("family", value):
                yield
        except (UserError, ParameterError) as error:
            if not self._dimension:
                raise
            cause = error.__cause__ if isinstance(error, UserError) else error
            assert cause is not None
            self._refuse(value, type(cause).__name__, f"the family raised {in_words(cause)}")
            raise UserError(error.problem, field=error.field, value=error.value, allowed=error.allowed) from cause

    def error(self, sample: Sample, of_flow: float) -> float:
        """Relative error of the derivative at a sample of an orbit that is followed: that of the flow, and what comes
        of the orbit's own, which is the flow's times what H - 1 makes of it.

        Parameters
        ----------
        sample
            From :meth:`at`.
        of_flow
            Relative error of the flow and of its derivative.
        """
        scaled = sample.image.jacobian * self.size / self.size[:, None]
        _, values, rows = np.linalg.svd(scaled - np.eye(self.size.size))
        if values[-1] > _SURE:
            return of_flow
        if sample.value not in self._bends:
            beside = sample.orbit + _BESIDE * self.size * rows[-1]
            section = section_at(
                self.family(sample.value), sample.orbit, self.size, sample.image.period / sample.image.returns
            )
            change = return_map(self.family(sample.value), beside, False, section).jacobian - sample.image.jacobian
            self._bends[sample.value] = float(np.linalg.norm(change * self.size / self.size[:, None])) / _BESIDE
        # Where H - 1 vanishes along a direction, what is left there is of third order at most in all but odd cases.
        off = min(of_flow / max(float(values[-1]), of_flow), of_flow ** (1.0 / 3.0))
        return min(1.0, of_flow + self._bends[sample.value] * off)

    def of_flow(self) -> ReturnMap:
        """The return map at the first orbit, with the error of the flow alone."""
        if _sample(self.low, self.first).off_plus_one > NEAR_FOLD:
            return self.first.image  # the orbit is as good as the flow
        return return_map(self.family(self.low), self.first.state, True, self.first.section)

    def _keep(self, sample: Sample) -> None:
        self.count += 1
        self._by_value[sample.value] = sample
        bisect.insort(self._values, sample.value)

    def _of_itself(self, value: float) -> Sample:
        """A sample of a system that tells a state on its orbit, or near it, or from the orbit beside."""
        system = self.family(value)
        try:
            with self._asking(value):
                return _sample(value, find_orbit(system, known_state(system), settle=False, budget=self.budget))
        except SpentError:
            raise
        except AnalysisError:
            index = bisect.bisect(self._values, value)
            beside = self._by_value[min(self._values[max(index - 1, 0) : index + 1], key=lambda v: abs(v - value))]
        try:
            return self._sampled(value, beside.orbit, beside)
        except SpentError:
            raise
        except AnalysisError:
            with self._asking(value):
                return _sample(value, find_orbit(system, known_state(system), budget=self.budget))

    def _sampled(self, value: float, near: Array, beside: Sample) -> Sample:
        system = self.family(value)
        with self._asking(value):
            # The orbit beside tells how long an orbit takes, where it is the orbit's to say.
            section = section_at(system, near, self.size, beside.image.period / beside.image.returns)
            return _sample(
                value,
                find_orbit(system, near, with_error=self.known, section=section, settle=False, budget=self.budget),
            )

    def _between(self, value: float) -> Sample:
        """A sample between two that are there, from their orbits."""
        right = min(max(bisect.bisect(self._values, value), 1), len(self._values) - 1)
        around = self._around(right)
        try:
            found = self._sampled(value, self._foreseen(around, value), around[0])
            if found.passes(around[0]) and found.passes(around[1]) and not self._goes_through(around[0], found):
                raise AnalysisError("is another orbit", field="orbit")
            return found
        except SpentError:
            raise
        except AnalysisError:
            reached = self._follow(around[:1], value, _ATTEMPTS)
            for sample in reached:
                if sample.value != value:
                    self._keep(sample)
            if not reached or reached[-1].value != value:
                raise
            return reached[-1]

    def _around(self, right: int) -> list[Sample]:
        """Two samples that follow each other, the second of which is number ``right``, and one beyond either."""
        left = right - 1
        a, b = self._values[left], self._values[right]
        # Not so close to the two that a polynomial through them would be told by round-off.
        before = [v for v in self._values[max(left - _BEYOND, 0) : left][::-1] if a - v >= _APART * (b - a)]
        after = [v for v in self._values[right + 1 : right + 1 + _BEYOND] if v - b >= _APART * (b - a)]
        return [self._by_value[v] for v in (a, b, *before[:1], *after[:1])]

    def _foreseen(self, samples: list[Sample], value: float) -> Array:
        """The orbit at a value by the polynomial through samples; by the straight line through the first two where
        that is very different, or the states are anywhere on their orbits."""
        if not self.timed:
            samples = samples[:2]
        if len(samples) == 1:
            return samples[0].orbit
        orbits = np.array([sample.orbit for sample in samples])
        nodes = [sample.value for sample in samples]
        t = (value - nodes[0]) / (nodes[1] - nodes[0])
        line = (1.0 - t) * orbits[0] + t * orbits[1]
        weights = [np.prod([(value - w) / (v - w) for w in nodes if w != v]) for v in nodes]
        curve = np.array(weights) @ orbits
        allowed = _BENT * float((np.abs(orbits[1] - orbits[0]) / self.size).max())
        return curve if (np.abs(curve - line) <= allowed * self.size).all() else line

    def _followed(self, low: float, high: float) -> list[Sample]:
        """Follow the orbit from the lower end."""
        path = [self._by_value[low]]
        for value in np.linspace(low, high, FIRST_STEPS + 1)[1:].tolist():
            reached = self._follow(path, value)
            for sample in reached:
                self._keep(sample)
            path += reached
            if path[-1].value != value:
                self.spent = self.budget.spent or self.count >= self._orbits
                break
        return path

    def _to_merging(self, path: list[Sample]) -> list[Sample]:
        """The path up to where the orbit meets another one at a pitchfork, and what is followed is that one: a
        multiplier comes to +1 from one side, and goes back to it from there."""
        for i in range(1, len(path) - 2):
            behind, ahead, beyond = path[: i + 1], path[i + 1], path[i + 2]
            while _touches(behind[-2], behind[-1], ahead, beyond):
                if ahead.value - behind[-1].value <= _MERGED * self.width:
                    self.merges = True
                    return behind
                middle = 0.5 * (behind[-1].value + ahead.value)
                try:
                    found = self._sampled(middle, self._foreseen(behind[: -_BEHIND - 1 : -1], middle), behind[-1])
                except AnalysisError:
                    break
                self._keep(found)
                if _touches(behind[-2], behind[-1], found, ahead):
                    ahead, beyond = found, ahead
                else:
                    behind.append(found)
        return path

    def _follow(self, behind: list[Sample], value: float, attempts: float = np.inf) -> list[Sample]:
        """Samples from the last one behind to ``value``, by smaller steps where Newton's method does not carry that
        far.

        They end early where the orbit does, the budget, or the attempts.
        """
        behind = behind[-_BEHIND:]
        reached: list[Sample] = []
        smallest = _SHORTEST * abs(value - behind[-1].value)
        target = value
        while attempts > 0 and (np.isfinite(attempts) or self.count + len(reached) < self._orbits):
            attempts -= 1
            last = behind[-1]
            guess = self._foreseen(behind[::-1], target)
            try:
                found = self._sampled(target, guess, last)
            except SpentError:
                return reached
            except AnalysisError:
                found = None
            # A large jump means that Newton's method has found another orbit.
            if found is None or self.jumped(found.orbit, guess) or not self._connected(last, guess, found):
                target = 0.5 * (last.value + target)
                if abs(target - last.value) < smallest:
                    return reached
                continue
            reached.append(found)
            if target == value:
                return reached
            behind = [*behind, found][-_BEHIND:]
            longer = target + 2.0 * (target - last.value)
            target = longer if abs(value - longer) > smallest and longer < value else value
        return reached

    def _connected(self, last: Sample, guess: Array, found: Sample) -> bool:
        """Whether an orbit that was not foreseen is on the branch of the last one: then there is one about halfway
        between them, in a fold at the square root of a half; to another orbit it is a jump at any place."""
        change = found.orbit - last.orbit
        size = self.size * float((np.abs(change) / self.size).max())
        # Where a multiplier passes +1 another orbit may be as near as anything.
        passes = found.passes(last)
        if passes and not self._goes_through(last, found):
            return False
        small = _SAME if passes else _SMALL
        if (np.abs(found.orbit - guess) <= np.maximum(_FORESEEN * size, small * self.size)).all():
            return True
        try:
            middle = self._sampled(0.5 * (last.value + found.value), last.orbit + 0.5 * change, last)
        except AnalysisError:
            return False
        return bool((np.abs(middle.orbit - last.orbit - 0.5 * change) <= _HALFWAY * size).all())

    def _goes_through(self, left: Sample, right: Sample) -> bool:
        """Whether one orbit has a multiplier that passes +1 between two samples: then samples come together there.

        Two orbits that pass each other at a distance have multipliers on either side, and none comes together.
        """
        apart = np.inf
        for _ in range(_HALVED):
            before, apart = apart, float((np.abs(right.orbit - left.orbit) / self.size).max())
            if apart <= _SAME or apart > _CLOSER * before:
                return apart <= _SAME
            try:
                middle = self._sampled(0.5 * (left.value + right.value), 0.5 * (left.orbit + right.orbit), left)
            except SpentError:
                raise
            except AnalysisError:  # where it passes, H - 1 is singular
                return bool(np.isfinite(before))
            left, right = (left, middle) if middle.passes(left) else (middle, right)
        return True

    def jumped(self, orbit: Array, guess: Array) -> bool:
        """Whether an orbit is so far from what was foreseen that it must be another one."""
        return bool((np.abs(orbit - guess) > _JUMP * np.maximum(self.size, np.abs(guess))).any())


def _sample(value: float, orbit: Orbit) -> Sample:
    return Sample(value, orbit.state, orbit.image)
