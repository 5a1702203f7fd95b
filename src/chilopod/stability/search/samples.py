"""A family of systems sampled along its parameter: known orbits, or orbits followed from a first guess.

A followed orbit is first sampled along a path to the upper end (``_whole_path``), each sample corrected (``_sampled``)
from a prediction (``_predicted``); later ones lie between two of them (``_between``). Newton's method may find another
orbit near by: a sample that jumps, turns back at a multiplier +1, or has one on another side than predicted, or is not
on the branch of the last one is not taken, and a shorter step is tried (``_followed``). Where steps of the parameter
are too long, the orbit is traced by arclength (``_traced``), to the next value or to a fold.
"""

from __future__ import annotations

import bisect
import contextlib
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError
from chilopod.flows.arguments import UserCode
from chilopod.flows.deadline import Budget, SpentError
from chilopod.frozen import Array
from chilopod.stability.branches.branch_starts import Start
from chilopod.stability.branches.parts import rising_part
from chilopod.stability.crossing_place import Sample, through
from chilopod.stability.interface import CheckedFamily, Family, is_autonomous, sizes
from chilopod.stability.orbits.orbit import Orbit, known_orbits, near_orbit, past_event, rounds_in, searched_orbit
from chilopod.stability.orbits.shooting import Nodes
from chilopod.stability.points import BifurcationPoint
from chilopod.stability.returns import JUMPS, events_in, return_duration, section_at
from chilopod.stability.unit_circle.crossings import first_values

NEAR_FOLD = 0.02  # distance of a multiplier from +1 within which the search may not resolve a fold
SPENT = "the orbits (`budget`) were spent"  # remark of a search that computed as many orbits as it may

# Budgets.
_FIRST = 400  # least number of return maps allowed for the first orbit
_RETURNS = 2  # return maps for every orbit of the budget, to follow the orbit and again to search
_DEAREST = 8.0  # largest assumed cost of an orbit, in return maps
# Predictions, and steps along the path.
_BEHIND = 6  # number of samples of a prediction
_APART = 0.1  # least distance of a third sample on the curve through two, relative to theirs
_BENT = 0.3  # largest distance of an orbit from the line between its neighbours, relative to theirs
_ACROSS = 0.7  # least cosine between the motion and the normal of a section that is kept
_CLOSE, _BRIEF = 0.2, 0.01  # distance of a first multiplier from +1 that calls for a brief step, relative to the usual
_SHORTEST = 2.0**-11  # shortest step of a followed orbit, relative to the first
_ATTEMPTS = 24  # largest number of steps to a value from the sample beside it: ten halvings, then more
# Is it the same orbit?
_JUMP = 0.3  # difference of prediction and correction, relative to the orbit's size, that counts as a jump
_FORESEEN, _SMALL = 0.3, 0.01  # largest errors of a prediction, relative to the orbit's change and to the sizes
_SAME = 1e-7  # error of a prediction, relative to the sizes, below which a correction gains nothing
_ROUNDING = 1e-14, 1e-7  # least and largest error of multipliers, which is otherwise that of the first return
_HALFWAY = 0.25  # largest distance of an orbit halfway from the mean of its neighbours, relative to their distance
_TO_EVENT, _TOGETHER = 24, 1e-4  # halvings of the way to where events change, and distance of orbits there: its root
_HALVED, _CLOSER = 13, 0.75  # halvings of a gap with a multiplier +1, and factor of each on its orbits' distance
_MEETING = 1e-4  # distance of a first multiplier from +1 that does not tell its side
_TELLING = 1.0 / 128.0  # step, relative to the interval, that resolves a multiplier that turns back at +1
# Does it meet another orbit?
_TOUCHING = 0.25  # distance from +1, relative to the multiplier's, at which straight lines that meet may touch it
_NEAR_MERGED = 1e-2  # gap, relative to the interval, in which a failed correction confirms that two orbits meet
_MERGED = 1e-5  # gap, relative to the interval, below which no sample between two orbits that meet is tried


class Samples:
    """Samples of a family between two values of its parameter, each computed once.

    From a guess at the lower end, or the state that its system gives, the orbit is followed to the upper end, within
    ``budget`` orbits, twice as many return maps, and ``seconds``; as many return maps again serve the samples in
    between. Without a guess the orbits of systems that depend on time are known.

    Where an event passes time 0 they end at a lower ``high``: ``onward`` is the orbit there with another time 0.
    """

    def __init__(
        self, family: Family, guess: ArrayLike | None, low: float, high: float, budget: int, seconds: float
    ) -> None:
        self.family = CheckedFamily(family)
        self.low, self.high, self.width = low, high, high - low
        self.spent = ""  # the limit that ended the path
        self.fold: BifurcationPoint | None = None  # the fold in which the path ends, if its curve was traced to it
        self.merges = False  # the path ends where the orbit meets another one, which continues alone
        self._steep: set[float] = set()  # values up to which the curve was traced from the sample before
        self.jumps: list[str] = []  # sentences on grazing orbits where multipliers jump
        self.count = 0  # orbits computed
        self._by_value: dict[float, Sample] = {}
        self._values: list[float] = []  # its keys by size
        self._missing: dict[float, AnalysisError] = {}  # reasons for missing samples, by value
        self._normal: Array | None = None  # of the section of the last orbit
        self.orbits, allowed = budget, _RETURNS * budget
        self.budget = Budget(max(allowed, _FIRST), seconds)
        with self.budget, UserCode("family", low):
            try:
                self.first = searched_orbit(self.family(low), guess, budget=self.budget)
            except AnalysisError as error:
                if error.field == "orbit":
                    error.problem = f"at {low:.9g} {error.problem}"
                raise
            self.size = sizes(self.family(low), self.first.state, self.first.image.duration)
            events = events_in(self.family(low), self.first.state, self.first.period)
        noise = np.nan_to_num(self.first.image.error, posinf=1.0) * self.size / self.size[:, None]
        self._rounding = float(np.clip(noise.max(), *_ROUNDING))  # which decides the side so close to +1
        self.budget.left, self.budget.taken = allowed, 0.0  # without the first orbit
        self.known = guess is None and self.family.timed
        if not self.known:
            self._keep(Sample(low, self.first.state, self.first.image, events))
        with self.budget:
            self.path = [] if self.known else self._up_to_merging(self._whole_path())
            self.end = self.path[-1].value if self.path else high
            lost = self.end < high and not (self.spent or self.merges or self.fold)
            self.onward = None
            if lost and (self.end > low or not isinstance(guess, Orbit)):
                last = self.path[-1]
                self.onward = past_event(self.family(self.end), last.orbit, last.image.duration, self.budget)
        self.high = high if self.onward is None else self.end
        self.budget.left = allowed

    def at(self, values: Array) -> list[Sample]:
        """Samples at values in the interval; an AnalysisError if one is missing, while the others are kept."""
        wanted = [float(value) for value in values]
        missing = sorted(set(wanted) - self._by_value.keys())
        if len(missing) > 1 and self.known:
            with contextlib.suppress(AnalysisError):  # after a failure each is computed alone
                self._keep_known(missing)
        for value in missing:
            if value in self._by_value or value in self._missing:
                continue
            try:
                if self.known:
                    self._keep_known([value])
                else:
                    self._keep(self._between(value))
            except AnalysisError as error:
                self._missing[value] = error
        for value in missing:
            if value in self._missing:
                raise self._missing[value]
        return [self._by_value[value] for value in wanted]

    def within(self, low: float, high: float) -> list[float]:
        """Values with a sample between two others."""
        return self._values[bisect.bisect_left(self._values, low) : bisect.bisect_right(self._values, high)]

    def affordable(self) -> int:
        """Number of further orbits, at the mean cost of those so far."""
        if self.budget.late:
            return 0
        price = self.budget.taken / max(self.count, 1)
        # Failed orbits do not predict the cost of the next ones.
        return int(self.budget.left / min(max(price, 1.0), _DEAREST))

    def jumped(self, orbit: Array, guess: Array) -> bool:
        """True if an orbit is so far from its prediction that it must be another one."""
        return bool((np.abs(orbit - guess) > _JUMP * np.maximum(self.size, np.abs(guess))).any())

    def ahead(self, value: float) -> Array:
        """The orbit at a value beyond the path, as its end predicts it."""
        return self._predicted(self.path[: -_BEHIND - 1 : -1], value)

    def _keep(self, *samples: Sample) -> None:
        for sample in samples:
            self.count += 1
            self._by_value[sample.value] = sample
            bisect.insort(self._values, sample.value)

    def _keep_known(self, values: list[float]) -> None:
        """Samples of systems that depend on time and know their orbits."""
        systems = []
        for value in values:
            self.budget.take()
            systems.append(self.family(value))
        with self.family.calling(values[0]) if len(values) == 1 else UserCode("family", values[0]):
            orbits = known_orbits(systems, self.budget)
        for value, orbit in zip(values, orbits, strict=True):
            self._keep(Sample(value, orbit.state, orbit.image))

    def _sampled(self, value: float, near: Array, beside: Sample) -> Sample:
        """A sample near a state, with about the period of a neighbouring sample."""
        self.budget.take(0)  # before a family that may be slow
        system = self.family(value)
        with self.family.calling(value):
            duration = beside.image.duration if is_autonomous(system) else return_duration(system)
            section = section_at(system, near, self.size, duration)
            if section is not None:  # one normal while it serves, so that orbits are smooth
                if self._normal is None or (section.normal * self.size) @ (self._normal * self.size) < _ACROSS:
                    self._normal = section.normal
                section = replace(section, normal=self._normal)
            orbit = near_orbit(system, Nodes(near[None], duration), False, self.budget, section, units=self.size)
            long = orbit.image.duration
            if section is not None and (rounds := rounds_in(system, orbit.state, long, self.size, duration)) > 1:
                once, section = Nodes(orbit.state[None], long / rounds), replace(section, duration=long / rounds)
                orbit = near_orbit(system, once, False, self.budget, section, units=self.size)
            return Sample(value, orbit.state, orbit.image, events_in(system, orbit.state, orbit.period))

    def _between(self, value: float) -> Sample:
        """A sample between two others, from their orbits."""
        around = self._around(min(max(bisect.bisect(self._values, value), 1), len(self._values) - 1))
        try:
            found = self._sampled(value, guess := self._predicted(around, value), around[0])
            passes = found.passes(around[0]) and found.passes(around[1])
            other = not self._on_its_side(around, guess, found) or (passes and not self._goes_through(around[0], found))
            other |= found.events != around[1].events and not self._meets(around[0], found)
            if other or not self._continues(around, guess, found):
                raise AnalysisError("is another orbit", field="orbit")
            return found
        except AnalysisError:
            behind = sorted((each for each in around if each.value < value), key=lambda each: each.value)
            for sample in self._followed(behind, value, _ATTEMPTS):
                if sample.value == value:
                    return sample
                self._keep(sample)
            raise

    def _around(self, right: int) -> list[Sample]:
        """Two neighbouring samples, the second with the number ``right``, and one beyond either."""
        a, b = self._values[right - 1 : right + 1]
        # Far enough from the two that round-off does not spoil a polynomial through them.
        before = bisect.bisect_right(self._values, a - _APART * (b - a))
        after = bisect.bisect_left(self._values, b + _APART * (b - a))
        beyond = self._values[max(before - 1, 0) : before] + self._values[after : after + 1]
        return [self._by_value[v] for v in (a, b, *beyond)]

    def _predicted(self, samples: list[Sample], value: float) -> Array:
        """The orbit at a value by the polynomial through samples, or the line through two if that differs much."""
        if len(samples) == 1:
            return samples[0].orbit
        first, second = samples[:2]
        step = second.orbit - first.orbit
        line = first.orbit + (value - first.value) / (second.value - first.value) * step
        if len(samples) == 2:
            return line
        orbits = np.array([each.orbit for each in samples])
        curve = through(np.array([each.value for each in samples]), orbits, value)
        allowed = _BENT * float((np.abs(step) / self.size).max())
        return curve if (np.abs(curve - line) <= allowed * self.size).all() else line

    def _whole_path(self) -> list[Sample]:
        """Samples of the followed orbit from the lower end, those of the first values of a search among them."""
        path = [self._by_value[self.low]]
        places = first_values(self.low, self.high)[1:].tolist()
        if _MEETING < path[0].off_plus_one < _CLOSE:
            # The direction of the orbit tells it from another one that crosses it.
            places.insert(0, self.low + _BRIEF * (places[0] - self.low))
        for value in places:
            for way in (self._followed, self._traced):
                reached = way(path, value)
                self._keep(*reached)
                path += reached
            if path[-1].value != value:
                self.spent = self.budget.spent or (SPENT if self.count >= self.orbits else "")
                break
        return path

    def _up_to_merging(self, path: list[Sample]) -> list[Sample]:
        """The path up to a pitchfork where the orbit meets another one: a multiplier comes to +1 and turns back."""
        i, end, sided = 1, path[-1].value, [each for each in path if each.off_plus_one > self._rounding]
        while i < len(sided) - 2:
            if not _touches(sided[i - 1 : i + 3]):
                i += 1
                continue
            gap = sided[i + 1].value - sided[i].value
            try:
                found = None if gap <= _MERGED * self.width else self._nearer(sided[: i + 1], sided[i + 1])
            except SpentError:
                break
            if found is not None:
                self._keep(found)
                sided.insert(i + 1, found)
                i = max(i - 1, 1)
            elif gap <= _NEAR_MERGED * self.width and sided[i + 1].value not in self._steep:
                self.merges, self.fold, end = True, None, sided[i].value  # H - 1 is singular where they meet
                break
            else:
                i += 1
        return [each for each in sorted({*path, *sided}, key=lambda each: each.value) if each.value <= end]

    def _nearer(self, behind: list[Sample], ahead: Sample) -> Sample | None:
        """Sample between the last one and another, in the middle or nearer to the last; None if there is none. Its
        multipliers are off +1."""
        for part in (0.5, 0.25, 0.125, 0.0625):
            value = behind[-1].value + part * (ahead.value - behind[-1].value)
            with contextlib.suppress(AnalysisError):
                found = self._sampled(value, self._predicted(behind[: -_BEHIND - 1 : -1], value), behind[-1])
                if found.off_plus_one > self._rounding:
                    return found
        return None

    def _followed(self, behind: list[Sample], value: float, attempts: int | None = None) -> list[Sample]:
        """Samples from the last one to ``value``, by smaller steps after failures; fewer where these end."""
        path, target, closes = list(behind), value, False
        smallest = _SHORTEST * abs(value - path[-1].value)
        while path[-1].value != value:
            if attempts == 0 or (attempts is None and self.count + len(path) - len(behind) >= self.orbits):
                break
            attempts = None if attempts is None else attempts - 1
            last, recent = path[-1], path[: -_BEHIND - 1 : -1]
            guess = self._predicted(recent, target)
            # Where this orbit ends at another one the path may go on there in the end: it is cut later.
            sided = attempts is not None or target - last.value >= 2.0 * smallest
            try:
                found = self._sampled(target, guess, last)
                passes = found.passes(last)  # then another orbit may be arbitrarily near
                same = (
                    not self.jumped(found.orbit, guess)
                    and (not sided or self._on_its_side(recent, guess, found))
                    and (not passes or self._goes_through(last, found))
                    and self._continues(recent, guess, found, _SAME if passes else _SMALL)
                    and not self._turns_back(path[-2:], found)
                    and self._meets(last, found)
                )
            except SpentError:
                break
            except AnalysisError as error:
                same, closes = False, error.field == "period"
            if same:
                path.append(found)
                longer = target + 2.0 * (target - last.value)
                target = longer if abs(value - longer) > smallest and longer < value else value
            else:
                target = 0.5 * (last.value + target)
                if abs(target - last.value) < smallest:
                    self.merges |= closes and attempts is None  # an orbit of two rounds meets that of one
                    break
        return path[len(behind) :]

    def _traced(self, behind: list[Sample], value: float) -> list[Sample]:
        """Samples from the last one to ``value``, or to one that is next to a fold, by arclength: the orbit may change
        so steeply that no step of the parameter is short enough."""
        last, left, found = behind[-1], self.orbits - self.count, list[Sample]()
        if last.value == value or self.merges or self.budget.spent or left <= 0:
            return found
        start = Start(last.value, last.orbit, period=last.image.period)
        points, self.fold = rising_part(self.family, start, (last.value, value), self.width, self.budget, left)
        try:
            for point in points:
                if self.fold is not None and not self.jumped(self.fold.orbit, last.orbit):
                    break
                if point.value > last.value:  # one that hardly rises may fall by rounding
                    last = self._sampled(point.value, point.orbit, last)
                    found.append(last)
                    self._steep.add(last.value)
        except (AnalysisError, SpentError):  # what lies between is not sampled
            self.fold = None
        return found

    def _turns_back(self, behind: list[Sample], found: Sample) -> bool:
        """True if a multiplier heads for +1 and is on the same side after a step that should pass or come nearer. The
        orbit may be one that leaves at a pitchfork; shorter steps tell. Multipliers grow exponentially."""
        if len(behind) < 2 or found.value - behind[-1].value <= _TELLING * self.width:
            return False
        first, left = behind
        off = _on_one_side([first, left, found])
        if off is None or not (off > -1.0).all() or np.abs(off).min() <= self._rounding:
            return False
        rates = np.log1p(off)
        ahead = rates[1] + (rates[1] - rates[0]) * (found.value - left.value) / (left.value - first.value)
        return bool(np.sign(ahead) != np.sign(rates[1]) or abs(ahead) < abs(rates[1]) < abs(rates[2]))

    def _on_its_side(self, samples: list[Sample], guess: Array, found: Sample) -> bool:
        """True if the multiplier nearest +1 is on the side predicted by samples, the first two next to the one found.
        On a branch that crosses theirs, as at a transcritical point, it is as far on the other side."""
        if (len(samples) == 1 and abs(samples[0].side) <= _MEETING) or abs(found.side) <= _SAME:
            return True  # where branches meet they are not told apart
        if (np.abs(found.orbit - guess) <= _SAME * self.size).all():
            return True
        places, sides = np.array([[each.value, each.side] for each in samples]).T
        ahead = [float(through(places[:count], sides[:count], found.value)) for count in (2, 3)]
        return max(abs(side - found.side) for side in ahead) <= abs(found.side)

    def _continues(self, samples: list[Sample], guess: Array, found: Sample, small: float = _SMALL) -> bool:
        """True if an orbit was predicted by samples, or another lies about halfway between it and the first of them: in
        a fold at the square root of a half, while towards another branch a jump remains."""
        last = samples[0]
        change = found.orbit - last.orbit
        size = self.size * float((np.abs(change) / self.size).max())
        near = (np.abs(found.orbit - guess) <= np.maximum(_FORESEEN * size, small * self.size)).all()
        if near and _in_time(samples, found):
            return True
        try:
            middle = self._sampled(0.5 * (last.value + found.value), last.orbit + 0.5 * change, last)
        except AnalysisError:
            return False
        connected = bool((np.abs(middle.orbit - last.orbit - 0.5 * change) <= _HALFWAY * size).all())
        connected = connected and self._on_its_side([last, found], last.orbit + 0.5 * change, middle)
        connected = connected and _in_time([last, found], middle)
        if connected and middle.value not in self._by_value:
            self._keep(middle)  # no orbit is left out of the counts
        return connected

    def _meets(self, left: Sample, right: Sample) -> bool:
        """True if two samples have the same events, or their orbits come together where these change."""
        ends, units = (left, right), self.size / self.size[:, None]
        if left.events == right.events:
            return True
        for _ in range(_TO_EVENT):
            middle = self._sampled(0.5 * (left.value + right.value), 0.5 * (left.orbit + right.orbit), left)
            left, right = (middle, right) if middle.events == left.events else (left, middle)
        if right.events != ends[1].events or (np.abs(right.orbit - left.orbit) > _TOGETHER * self.size).any():
            return False
        self._keep(*[each for each in {left, right}.difference(ends) if each.value not in self._by_value])
        before, after = left.image.jacobian * units, right.image.jacobian * units
        if np.linalg.norm(after - before) > JUMPS * max(1.0, float(np.linalg.norm(before))):
            self.jumps.append(f"multipliers jump at a grazing between {left.value!r} and {right.value!r}")
        return True

    def _goes_through(self, left: Sample, right: Sample) -> bool:
        """True if one orbit has a multiplier that passes +1 between two samples, which come together there: two orbits
        that pass each other at a distance have multipliers on different sides, and samples stay apart."""
        apart = np.inf
        for _ in range(_HALVED):
            before, apart = apart, float((np.abs(right.orbit - left.orbit) / self.size).max())
            if apart <= _SAME or apart > _CLOSER * before:
                return apart <= _SAME
            try:
                middle = self._sampled(0.5 * (left.value + right.value), 0.5 * (left.orbit + right.orbit), left)
            except AnalysisError:  # H - 1 is singular at the passage
                return bool(np.isfinite(before))
            left, right = (left, middle) if middle.passes(left) else (middle, right)
        return True


def _in_time(samples: list[Sample], found: Sample) -> bool:
    """True if the period of an orbit is the one predicted by samples: at time 0 another orbit may be near by."""
    times = np.array([each.image.duration for each in samples])
    places, duration = np.array([each.value for each in samples]), found.image.duration
    off = min(abs(float(through(places[:count], times[:count], found.value)) - duration) for count in (2, 3))
    return off <= max(_FORESEEN * float(np.ptp([*times[:2], duration])), _SMALL * duration)


def _touches(samples: list[Sample]) -> bool:
    """True if a multiplier on one side of +1 approaches it from both sides of the gap between two of four samples."""
    off = _on_one_side(samples)
    if off is None:
        return False
    places, off = np.array([each.value for each in samples]), np.abs(off)
    into, out = np.diff(off)[[0, 2]] / np.diff(places)[[0, 2]]
    if not into < 0.0 < out:
        return False
    meeting = (off[2] - off[1] + into * places[1] - out * places[2]) / (into - out)
    return bool(off[1] + into * (meeting - places[1]) < _TOUCHING * off[1:3].max())


def _on_one_side(samples: list[Sample]) -> Array | None:
    """Signed distances of real multipliers from +1, shape (samples,); None unless all are on one side."""
    off = np.array([each.beside_plus_one for each in samples])
    return off if np.isfinite(off).all() and (np.sign(off) == np.sign(off[1])).all() else None
