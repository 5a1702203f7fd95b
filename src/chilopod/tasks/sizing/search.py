"""Search for the free numbers at which a robot does what is wished.

A place is a point of the unit cube of the free numbers. A robot's deviations there, one for each :class:`Wish`, are
what all methods of the :class:`Search` ask for; it counts them and keeps the best place.

One wish on one free number is a root, bracketed on a scan of the range and solved by Brent's method. More are a problem
of least squares within the ranges (scipy's trust region), from the robot itself and from scattered starts. Robots that
lack a quantity, as those that walk straight have no radius, stop these at a cliff; there the covariance matrix adapts
(CMA-ES) round the best robot so far. Where wishes conflict, weighted sums of the squares of two of them give points of
their Pareto front.

A radius enters as its squared curvature, which falls to zero at the onset in proportion to the growth rate, and goes on
with that where the robot walks straight.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np
from cmaes import CMA
from numpy.linalg import norm
from scipy.optimize import brentq, least_squares
from scipy.stats.qmc import Sobol

from chilopod import units
from chilopod.analysis.branch import NO_PAIR
from chilopod.analysis.map_axes import Axis
from chilopod.analysis.quantities import TOO_BENT, Measured, Onset, leading_mode
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.frozen import Array
from chilopod.labels import Labelled
from chilopod.progress import Progress
from chilopod.robot import Robot
from chilopod.stability import Criticality, Kind

FAILED = 10.0
"""Deviation of a robot without the quantity; negative where its curved walk bends too far, as one too tight."""

_MET = 1e-6  # largest relative deviation from a wish that is met
_SCANNED = 12  # intervals of a range in which a root is looked for
_STARTS = 8  # a power of two
_BRANCH = 20  # evaluations that take as long as a branch of curved walks
_UNCHANGED = 1e-9  # range of deviations that are the same
_AT_END = 1e-3  # distance from the end of a range, relative to it
_SHARES = 0.1, 0.3, 0.5, 0.7, 0.9  # of the second of two conflicting wishes in the sum of squares
_FAR = 100.0  # relative deviation of a point that is left out of a front
_OTHERS = 10.0  # weight of wishes beside those two
_EVOLVED, _ROUND = 0.4, 0.2  # part of the budget for evolution, and its first scatter in the unit cube
_ROUNDS = 40  # evaluations of least squares for each free number


class Outcome(Labelled):
    """Outcome of a search for a robot; each member's ``sentence`` describes it in words."""

    MET = "met", "every wish is met"
    OTHERWISE = "walks otherwise", "the wishes are met in theory, but a walk that starts bent does something else"
    SLOW = "not settled", "the wishes are met in theory; a walk of 1500 gait cycles that starts bent has not settled"
    UNMET = "unmet", "no robot that was tried meets every wish; this one comes nearest"
    BUDGET = "budget", "the evaluations of the search were spent before every wish was met; this robot came nearest"
    LACKING = "lacking", "no robot that was tried has every wished quantity"


@dataclass(frozen=True)
class Wish:
    """A quantity, see :data:`chilopod.analysis.quantities.QUANTITIES`, and its value, SI, to be met (``sense`` 0), not
    to be exceeded (-1), or at least to be reached (1)."""

    quantity: str
    value: float
    sense: int = 0

    def deviation(self, value: float) -> float:
        """Relative deviation of a value from the wish, zero if it is met; absolute for a wish of 0."""
        if self.quantity in ("speed", "settling"):  # which spread over decades
            return self._one_sided(float(np.log(value / self.value)))
        return self._one_sided((value - self.value) / (abs(self.value) or 1.0))

    def searched(self, measured: Measured, robot: Robot) -> float:
        """Smooth measure of that deviation of a robot, zero and signed alike; :data:`FAILED` without the quantity."""
        try:
            if self.quantity != "radius":
                return self.deviation(measured.walked(self.quantity, robot))
            growth = leading_mode(robot).growth
            if growth <= 0.0:
                return 1.0 - growth  # also of limits: a robot that walks straight has no radius
            return self._one_sided(1.0 - (self.value / measured.walked("radius", robot)) ** 2)
        except ChilopodError as error:
            return -FAILED if TOO_BENT in str(error) else FAILED

    def missed(self, searched: float) -> float:
        """Size of the deviation that :meth:`searched` measures; infinite for a radius without a curved walk."""
        if self.quantity != "radius":
            return abs(searched)
        return abs(1.0 / np.sqrt(1.0 - searched) - 1.0) if 1.0 > searched != -FAILED else np.inf

    def of(self, measured: Measured, robot: Robot) -> float:
        """The quantity of a robot, SI; NaN without it."""
        with suppress(ChilopodError):
            return measured.walked(self.quantity, robot)
        return np.nan

    @property
    def curved(self) -> bool:
        """True if only a curved walk meets it."""
        return self.quantity == "radius" or (self.quantity == "work" and self.value > 0.0 and self.sense >= 0)

    def _one_sided(self, deviation: float) -> float:
        return max(0.0, deviation * -self.sense) * -self.sense if self.sense else deviation


class _SpentError(Exception):
    """The evaluations of a search are spent."""


class Search:
    """Search for the robot in the unit cube of its free numbers."""

    def __init__(
        self, robot: Robot, wishes: tuple[Wish, ...], axes: tuple[Axis, ...], onset: Onset, budget: int, seed: int,
        progress: Progress,
    ) -> None:  # fmt: skip
        self.robot, self.wishes, self.axes, self.progress, self._seed = robot, wishes, axes, progress, seed
        # The other half of the evaluations is left to say what stands in the way.
        self._budget, self._limit, self.evaluations = budget, -(-budget // 2), 0
        self._following = partial(self._take, _BRANCH)
        self._measured = Measured(onset, following=self._following)
        self.again = Measured(onset, similar=False)  # for the best place alone
        scattered = Sobol(len(axes), rng=np.random.default_rng(seed)).random(_STARTS)
        own = [self._part(each) for each in axes]
        # The robot itself is the first start, so that of many answers one near it is found.
        self._starts = [np.clip(own, 0.01, 0.99), *scattered]
        self.best: Array = self._starts[0]
        self._least = np.full(len(wishes), np.inf)
        self._seen: list[Array] = []
        self.is_root = len(axes) == len(wishes) == 1 and not wishes[0].sense
        self._changed, self._spent = True, False  # by one number, if it alone is free; the evaluations of the search

    def check(self) -> None:
        """Check that curved walks are possible if they are wished."""
        number, robot, kind = self._measured.number, self.at(self._starts[0]), None
        wished = [wish.quantity for wish in self.wishes if wish.curved]
        changed = {number.parameter, *(each.path for each in self.axes)}
        if wished and not robot.gait.half_period_symmetric and "gait.side_phase" not in changed:
            with suppress(ChilopodError):
                kind = number.first(robot).point.kind
        if kind is Kind.TRANSCRITICAL:
            raise AnalysisError(NO_PAIR, field=wished[0], allowed="a gait.side_phase of 180 deg")

    def _take(self, count: int) -> None:
        """Count evaluations before they are made."""
        if self.evaluations + count > self._limit:
            raise _SpentError
        self.evaluations += count

    def numbers(self, place: Array) -> Array:
        """Free numbers at a place in the unit cube, SI, evenly by their logarithm where they are positive."""
        parts = ((a.low, a.high, part) for a, part in zip(self.axes, np.round(place, 15).tolist(), strict=True))
        # Both forms are exact at the ends; between them rounding may pass one.
        found = [(a ** (1.0 - p) * b**p if a > 0.0 else a * (1.0 - p) + b * p, a, b) for a, b, p in parts]
        return np.array([min(max(value, low), high) for value, low, high in found])

    def at(self, place: Array) -> Robot:
        """Robot at a place in the unit cube."""
        robot = self.robot
        for each, value in zip(self.axes, self.numbers(place).tolist(), strict=True):
            robot = each.change(robot, value)
        return robot

    def _part(self, each: Axis) -> float:
        """Part of the range below the robot's own number."""
        own = self.robot.gait.speed if each.path == "speed" else self.robot.get(sorted(each.numbers(self.robot))[0])
        if each.low > 0.0:
            return float(np.log(max(own, each.low) / each.low) / np.log(each.high / each.low))
        return (own - each.low) / (each.high - each.low)

    def deviations(self, place: Array) -> Array:
        """Deviations of a robot from all wishes, see :meth:`Wish.searched`; keeps the best place."""
        self._take(1)
        self.progress(min(0.99, self.evaluations / self._budget), f"{self.evaluations} evaluations")
        found = self._found(place, self._measured)
        self._seen.append(found)
        if self._sizes(found) < self._sizes(self._least):
            self.best, self._least = place, found
        return found

    def _sizes(self, deviations: Array) -> tuple[float, float]:
        """Far from all wishes, a robot that has every quantity is nearer than one that has not."""
        return float(norm(self._missed(deviations))), float(norm(deviations))

    def _found(self, place: Array, measured: Measured) -> Array:
        try:
            robot = self.at(place)
            return np.array([wish.searched(measured, robot) for wish in self.wishes])
        except ChilopodError:
            return np.full(len(self.wishes), FAILED)

    def _missed(self, deviations: Array) -> Array:
        return np.array([w.missed(d) for w, d in zip(self.wishes, deviations.tolist(), strict=True)])

    def run(self) -> Outcome:
        """Find the best place; what meets the wishes is computed anew without its neighbours, in ``again``."""
        outcome = self._searched()
        if outcome is Outcome.MET and not _met(self._found(self.best, self.again)):
            # Onsets of neighbours have led to another bifurcation of the robot than its first.
            self._measured = Measured(self._measured.number, similar=False, following=self._following)
            self._least = np.full(len(self.wishes), np.inf)
            outcome, self.again = self._searched(), Measured(self._measured.number, similar=False)
        self._spent = outcome is Outcome.BUDGET
        lacking = _failed(self._least) or not np.isfinite(self._missed(self._least)).all()
        return Outcome.LACKING if lacking else outcome

    def _searched(self) -> Outcome:
        limit, unmet = self._limit, Outcome.BUDGET
        self._limit -= int(_EVOLVED * (limit - self.evaluations)) if len(self.axes) > 1 else 0
        with suppress(_SpentError):
            if self.is_root:
                self._root()
            for start in self._starts:
                if not _met(self._least):
                    self._fit(start)
            unmet = Outcome.UNMET
        self._limit = limit
        cliff = any(_failed(found) or not np.isfinite(self._missed(found)).all() for found in self._seen)
        if len(self.axes) > 1 and not _met(self._least) and cliff:
            with suppress(_SpentError):
                self._evolve()
        try:
            self._to_ends()
        except _SpentError:
            unmet = Outcome.BUDGET
        return Outcome.MET if _met(self._least) else unmet

    def _to_ends(self) -> None:
        """Move the best place to the ends of ranges beside it, which least squares do not reach, if it is as near."""
        beside = (np.abs(self.best - 0.5) > 0.5 - _AT_END) & (self.best != np.round(self.best))
        for i in np.flatnonzero(beside & (not _met(self._least))).tolist():
            place = np.where(np.arange(self.best.size) == i, np.round(self.best), self.best)
            found, least = self.deviations(place), self._least
            if all(a <= b + _UNCHANGED for a, b in zip(self._sizes(found), self._sizes(least), strict=True)):
                self.best, self._least = place, found

    def _evolve(self) -> None:
        """Search round the best place by evolution, which no cliff stops."""
        ends = np.tile([0.0, 1.0], (len(self.axes), 1))
        found = CMA(np.clip(self.best, _AT_END, 1.0 - _AT_END), _ROUND, bounds=ends, seed=self._seed)
        while not (found.should_stop() or _met(self._least)):
            places = [found.ask() for _ in range(found.population_size)]
            missed = [float(norm(self._missed(self.deviations(place)))) for place in places]
            found.tell([(place, min(each, _FAR)) for place, each in zip(places, missed, strict=True)])

    def _root(self) -> None:
        """Root of one deviation over one number, that which is nearest to the robot's own value."""
        grid = np.linspace(0.0, 1.0, _SCANNED + 1)
        here = self.deviations(self._starts[0])[0]
        values = np.array([self.deviations(np.array([each]))[0] for each in grid.tolist()])
        self._changed = bool(abs(here) == FAILED or np.abs(values - here).max() > _UNCHANGED)
        if not self._changed:
            self.best, self._starts = self._starts[0], []
            return
        values[values == FAILED] = np.nan
        own = float(self._starts[0][0])
        brackets = [i for i in range(_SCANNED) if values[i] * values[i + 1] <= 0.0]
        known = dict(zip(grid.tolist(), values.tolist(), strict=True))  # which another path to them may change

        def deviation(x: float) -> float:
            return known[x] if x in known else float(self.deviations(np.array([x]))[0])

        for i in sorted(brackets, key=lambda i: abs(grid[i : i + 2].mean() - own)):
            brentq(deviation, float(grid[i]), float(grid[i + 1]), xtol=1e-15, rtol=1e-15)
            if _met(self._least):
                return
        self._starts.insert(0, np.clip(self.best, _AT_END, 1.0 - _AT_END))

    def _fit(self, start: Array, weights: Array | float = 1.0) -> tuple[Array, Array]:
        """Place and deviations of least squares of weighted deviations from a start."""
        shift = 1.0 + start  # numbers of the order of one, whose relative steps are even
        bounds = np.ones(start.size), np.full(start.size, 2.0)
        found = least_squares(
            lambda x: weights * self.deviations(x - 1.0), shift, bounds=bounds, diff_step=1e-6, xtol=1e-12, ftol=1e-12,
            gtol=1e-12, max_nfev=_ROUNDS,
        )  # fmt: skip
        place = found.x - 1.0
        return place, self.deviations(place)

    def bound(self) -> float:
        """Bound on the error of a root, SI, by what it misses, computed anew, and the error of that; NaN if unknown, or
        if the number changes nothing."""
        (wish,), step, again, missed = self.wishes, 1e-5, self.again, np.full(3, FAILED)
        places = [np.clip(self.best + side * step, 0.0, 1.0) for side in (-1.0, 0.0, 1.0)]
        with suppress(ChilopodError):
            # A radius counts by its square, relative to the wished one.
            share = (2.0 if wish.quantity == "radius" else 1.0) / (abs(wish.value) or 1.0)
            error = share * again.error(wish.quantity, self.at(self.best))
            missed = np.array([wish.searched(again, self.at(place)) for place in places])
        if _failed(missed) or not self._changed or (rise := abs(missed[2] - missed[0]) - 2.0 * error) <= 0.0:
            return np.nan
        wide = self.numbers(places[2]) - self.numbers(places[0])
        return float(2.0 * (abs(missed[1]) + error) / rise * wide[0])

    def reasons(self, outcome: Outcome) -> tuple[list[str], list[Array]]:
        """Sentences about what stands in the way, and places on the Pareto front of two wishes that conflict."""
        if outcome is Outcome.MET:
            return [] if self._changed else [_unchanged(self.wishes[0])], []
        self._limit = self._budget
        said, best, least = [], self.best, self._least
        front: list[Array] = []
        try:
            if len(self.wishes) > 1:
                left_out = [self._left_out(i, best) for i in range(len(self.wishes))]
                alone = [i for i, (_, found) in enumerate(left_out) if _met(np.delete(found, i))]
                said += [f"without the wish for {self.wishes[i].quantity} the others are met" for i in alone]
                ranked = np.argsort(-self._missed(least), kind="stable").tolist()
                front = self._front([*dict.fromkeys([*alone, *ranked])][:2], left_out, best)
        except _SpentError:
            said.append("the evaluations were spent before it was known which wishes conflict")
        if outcome is Outcome.LACKING or _met(self._least):
            self.best, self._least = best, least
        said = self._obstacles() + said
        if self._spent and outcome is Outcome.LACKING:
            said.append("the evaluations of the search were spent")
        if (outcome is Outcome.LACKING or not said) and any(-FAILED in each for each in self._seen):
            said.append(f"some robots are left out: {TOO_BENT}")
        nothing = "no end of a range and no other wish is known to stand in the way"
        return said or [nothing] * (outcome is Outcome.UNMET), front

    def _obstacles(self) -> list[str]:
        """Sentences about ends of ranges at the best place, and about wishes that nothing changes."""
        said = []
        for each, part, value in zip(self.axes, self.best.tolist(), self.numbers(self.best).tolist(), strict=True):
            if part in (0.0, 1.0):
                end = "lower" if part < 0.5 else "upper"
                said.append(f"{each.path} is at the {end} end of its range, {units.format(value, each.unit, digits=6)}")
        seen = np.array([found for found in self._seen if not _failed(found)]).reshape(-1, len(self.wishes))
        for wish, values in zip(self.wishes, seen.T, strict=True):
            if values.size and not self._spent and np.ptp(values) <= _UNCHANGED and abs(values[0]) > _MET:
                said.append(_unchanged(wish))
            if wish.quantity == "radius":
                said += self._without_walks(self.at(self.best))
        return said

    def _without_walks(self, robot: Robot) -> list[str]:
        """A sentence if no curved walk is searched at a robot because of the kind of its onset."""
        with suppress(ChilopodError):
            point = self._measured.number.first(robot, normal_form=True).point
            if point.kind is not Kind.PITCHFORK:
                return [f"the onset is no pitchfork ({point.kind.label}): only walks that leave one are searched"]
            if point.criticality is Criticality.SUBCRITICAL:
                return ["the onset is subcritical, and curved walks beside a stable straight one are not searched"]
        return []

    def _left_out(self, wish: int, start: Array) -> tuple[Array, Array]:
        """Place that meets all wishes but one best, and the deviations there."""
        weights = np.array([float(i != wish) for i in range(len(self.wishes))])
        tried = [self._fit(each, weights) for each in (start, self._starts[0])]
        return min(tried, key=lambda found: float(norm(weights * found[1])))

    def _front(self, pair: Sequence[int], ends: Sequence[tuple[Array, Array]], start: Array) -> list[Array]:
        """Places, from the best to those with a wish of a pair left out, of which none surpasses another in both."""
        found = [start, *(ends[i][0] for i in pair)]
        # Each deviation counts relative to that where its own wish is left out.
        largest = [max(abs(ends[i][1][i]), _MET) for i in pair]
        for share in _SHARES:
            weights = np.full(len(self.wishes), _OTHERS)
            weights[pair] = np.sqrt([1.0 - share, share]) / largest
            found.append(self._fit(np.clip(start, _AT_END, 1.0 - _AT_END), weights)[0])
        self._to_ends()
        found.append(self.best)
        self._take(len(found))
        again = Measured(self._measured.number, similar=False, following=self._following)
        again.near = self._measured.near
        there = [self._found(place, again) for place in found]
        missed = [np.where(_failed(each), np.inf, self._missed(each)) for each in there]

        def surpassed(own: Array) -> bool:
            gains = [own[pair] - other[pair] for other in missed]
            return any((gain >= -_MET).all() and (gain > _MET).any() for gain in gains)

        kept = [place for place, own in zip(found, missed, strict=True) if (own < _FAR).all() and not surpassed(own)]
        apart: list[Array] = []  # no place twice
        for place in sorted(kept, key=lambda place: tuple(place.tolist())):
            if not apart or np.abs(place - apart[-1]).max() > _AT_END:
                apart.append(place)
        return apart


def _failed(deviations: Array) -> bool:
    return bool((np.abs(deviations) == FAILED).any())


def _met(deviations: Array) -> bool:
    return bool(np.abs(deviations).max(initial=0.0) <= _MET)


def _unchanged(wish: Wish) -> str:
    return f"no free number changes the {wish.quantity}"
