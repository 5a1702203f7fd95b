"""Where eigenvalues of a family of matrices cross the unit circle, and whether these are all.

Two ways meet here. Zeros of functions that are analytic in the parameter (:mod:`.spectra`) show
events however close together they lie, but not two equal ones at once. The number of eigenvalues outside the circle,
known wherever a matrix was asked for, must change by what was found in between: where it does not, the multiplier that
crosses is followed by its rank, which is continuous whatever the multiplicities are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.errors import ParameterError
from chilopod.labels import Labelled
from chilopod.stability.unit_circle.counts import Accounts
from chilopod.stability.unit_circle.critical import LOST, Root
from chilopod.stability.unit_circle.spectra import Event, Matrices, Spectra, margins
from chilopod.stability.unit_circle.zeros import Interval, Zeros, between, find_zeros, first_places

Array = NDArray[np.float64]

BUDGET = 5000
"""Matrices that a search may ask for, if not told otherwise."""

_DECADES = 4.0
_SEARCH = 0.7  # of the budget for the zeros of the functions; the rest for counting
_IDLE = 1e-4  # factors larger than this are not looked at closely
_HUGE = 1e150
_TELLING = 0.1  # error of a factor that tells whether it vanishes
_FEWEST_TELLING = 3  # places where it does
_MOSTLY = 0.25  # of the first places may disagree on what vanishes everywhere: errors are estimates
_MANY = 800  # pairs of multipliers; beyond that the bialternate product has too many zeros that mean nothing
_PROBES = 65
_FINEST_PROBE = 1e-6  # of the interval
_CLOSE = 0.25  # of the nearer end: so far towards the circle a multiplier must be heading
_EPSILON = float(np.finfo(float).eps)

_Place = Callable[[float], float]


class SearchStatus(Labelled):
    """How a search ended; each member's ``sentence`` says it in words."""

    COMPLETE = "complete", "the counts at both ends and between all points add up"
    CONSERVATIVE = "conservative", "multipliers lie on the circle throughout; where they meet and leave it is listed"
    INCOMPLETE = "incomplete", "not everything is accounted for; the remarks say what and where"
    BUDGET = "budget", "the budget was spent; what was found until then is listed"


@dataclass(frozen=True)
class Crossing:
    """Multipliers on the unit circle at a value of the parameter.

    Attributes
    ----------
    value
        Value of the parameter.
    bracket
        Interval in which the root finder has enclosed it; errors of the matrices come on top.
    event
        Place on the circle.
    multiplicity
        Number of multipliers on the circle there, both of a pair counted.
    change
        By how much the number of multipliers outside rises there: positive out of the circle, negative into it, 0 for
        a touch, or for as many out as in. At an end of the interval: as if they went on as they come.
    multiplier
        One of the critical multipliers, of a pair the one with positive imaginary part.
    collision
        True if multipliers meet on the circle there and leave it, or come back: a conservative family.
    """

    value: float
    bracket: Interval
    event: Event
    multiplicity: int
    change: int
    multiplier: complex
    collision: bool = False


@dataclass(frozen=True)
class Crossings:
    """What :func:`find_crossings` found.

    Attributes
    ----------
    crossings
        By rising value.
    status
        Status of the search.
    remarks
        Sentences on what else is to be said.
    evaluations
        At how many values matrices were asked for.
    """

    crossings: tuple[Crossing, ...]
    status: SearchStatus
    remarks: tuple[str, ...]
    evaluations: int


def find_crossings(
    matrices: Matrices,
    low: float,
    high: float,
    *,
    budget: int = BUDGET,
    affordable: Callable[[], int] | None = None,
    shown: Callable[[float], float] = float,
) -> Crossings:
    """Find every value of a parameter at which eigenvalues of real matrices cross the unit circle.

    Parameters
    ----------
    matrices
        ``matrices(values)``, values of shape (k,), gives the matrices, shape (k, m, m), and bounds on the error of
        their entries: relative, shape (k,), or each, shape (k, m, m). It raises AnalysisError, or gives NaN, where
        there is no matrix, and may be asked for the same value twice.
    low, high
        The interval.
    budget
        At how many values matrices may be asked for.
    affordable
        Number of matrices that can still be had, where that is for their cost to say: the search ends when it says
        none.
    shown
        ``shown(value)`` is what remarks say of a value.

    Raises
    ------
    ParameterError
        If the interval is empty, reversed or not finite, or the budget too small to begin.
    """
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ParameterError("must be two finite values", field="between", value=(low, high), allowed="(lower, higher)")
    least = 2 * first_places(0.0, 1.0).size
    if budget < least:
        raise ParameterError("is too small to begin", field="budget", value=budget, allowed=f"{least} or more")
    # Over decades a parameter acts by its logarithm.
    inward, outward = (np.log, np.exp) if low > 0.0 and high / _DECADES > low else (_same, _same)
    a, b = float(inward(low)), float(inward(high))

    def parameter(places: Any) -> Any:
        # The ends exactly, whatever the logarithm rounds to.
        inner = np.clip(outward(places), low, high)
        return np.where(places <= a, low, np.where(places >= b, high, inner))

    spectra = Spectra(lambda places: matrices(parameter(places)), budget, affordable)
    return _Finder(spectra, a, b, lambda place: float(parameter(place)), shown).found()


def _same(values: Any) -> Any:
    return values


class _Finder:
    """The search, in a coordinate in which the parameter acts evenly."""

    def __init__(self, spectra: Spectra, a: float, b: float, parameter: _Place, shown: _Place) -> None:
        self.spectra = spectra
        self.a, self.b = a, b
        self.parameter = parameter
        self.shown: _Place = lambda place: shown(parameter(place))
        self.remarks: list[str] = []
        self.spent = False
        self.conservative = False
        self.open = False  # whether something is not accounted for

    def found(self) -> Crossings:
        first = first_places(self.a, self.b)
        self.spectra.at(first)
        if not self.spectra.values:
            if self.spectra.left <= 0:
                return Crossings((), SearchStatus.BUDGET, (), self.spectra.evaluations)
            return Crossings((), SearchStatus.INCOMPLETE, ("there is no matrix anywhere",), self.spectra.evaluations)
        idle = {event: self._idle(first, event) for event in Event}
        resting = idle[Event.PLUS] + idle[Event.MINUS]
        trivial = sum(idle[event] * (idle[event] - 1) // 2 for event in (Event.PLUS, Event.MINUS))
        conservative = self.conservative = idle[Event.PAIR] > trivial
        self._remark_on(idle, conservative)
        events = [e for e in Event if idle[e] < self._factors(e) <= _MANY]
        if self._factors(Event.PAIR) > _MANY:
            self._probe()
        found = self._searched(events, idle)
        roots = [root for event in events for root in self._roots(event, idle[event], found[event])]
        accounts = Accounts(self.spectra, (self.a, self.b), idle, resting, conservative, self.shown)
        points = accounts.balance(roots)
        self.remarks += accounts.remarks
        crossings = tuple(
            Crossing(
                self.parameter(point.place),
                (self.parameter(point.left), self.parameter(point.right)),
                group.event,
                group.multiplicity,
                group.change,
                group.multiplier,
                conservative and group.collision,
            )
            for point in points
            for group in point.groups
        )
        if self.spent or accounts.spent:
            status = SearchStatus.BUDGET
        elif self.open or accounts.open:
            status = SearchStatus.INCOMPLETE
        else:
            status = SearchStatus.CONSERVATIVE if conservative else SearchStatus.COMPLETE
        return Crossings(crossings, status, tuple(dict.fromkeys(self.remarks)), self.spectra.evaluations)

    def _factors(self, event: Event) -> int:
        m = self.spectra.size
        return m if event is not Event.PAIR else m * (m - 1) // 2

    def _idle(self, places: Array, event: Event) -> int:
        """How many factors of the function of an event vanish for all values of the parameter."""
        places = places[np.isfinite(self.spectra.at(places)).all(axis=1)]
        if self._factors(event) == 0:
            return 0
        numbers = []
        for place in places.tolist():
            # Of a matrix with a large eigenvalue the small ones are uncertain, and their products with it.
            largest = max(1.0, float(np.abs(self.spectra.at(np.array([place]))).max()))
            largest *= min(largest, _HUGE) if event is Event.PAIR else 1.0
            if self.spectra.smallest(place, event) > _IDLE * largest:
                numbers.append(0)
            else:
                sizes, errors = self.spectra.distances(place, event)
                if errors[0] <= _TELLING:
                    numbers.append(int(np.argmin(np.append(sizes <= errors, False))))
            if numbers.count(0) > _MOSTLY * places.size:
                return 0
        if len(numbers) < _FEWEST_TELLING:
            self._leave(LOST)
            return 0
        return int(sorted(numbers)[int(_MOSTLY * len(numbers))])

    def _probe(self) -> None:
        """Ask for matrices wherever a multiplier may cross the circle and come back: where it heads for the circle on
        both sides of a gap."""
        self.remarks.append("so many multipliers: pairs are found by counting, not by a function that vanishes")
        places = np.linspace(self.a, self.b, _PROBES)
        while places.size and self.spectra.left > places.size:
            self.spectra.at(places)
            known = np.array(self.spectra.values)
            found = margins(self.spectra.at(known))
            gaps = np.diff((0.5 * known - 0.5 * self.a) / (0.5 * self.b - 0.5 * self.a))
            start, end, gap = found[1:-2], found[2:-1], gaps[1:-1]
            # Where a crossing was closed in on, a gap may round to nothing: no slope, and nobody heads anywhere.
            with np.errstate(divide="ignore", invalid="ignore"):
                slopes = np.diff(found, axis=0) / gaps[:, None]
                into, out = slopes[:-2], -slopes[2:]  # both taken towards the inside of the gap
                reach = np.clip((end - start + out * gap[:, None]) / (into + out), 0.0, gap[:, None])
                towards = np.sign(start) * (start + into * np.nan_to_num(reach))
            turning = (start * end > 0.0) & (np.sign(start) * into < 0.0) & (np.sign(start) * out < 0.0)
            again = (turning & (towards < _CLOSE * np.minimum(np.abs(start), np.abs(end)))).any(axis=1)
            again &= gap > _FINEST_PROBE
            places = (0.5 * known[1:-2] + 0.5 * known[2:-1])[again]

    def _remark_on(self, idle: dict[Event, int], conservative: bool) -> None:
        for event in (Event.PLUS, Event.MINUS):
            if idle[event]:
                many = "a multiplier is" if idle[event] == 1 else f"{idle[event]} multipliers are"
                self.remarks.append(f"{many} {event.label} throughout and left aside")
        if conservative:
            self.remarks.append("multipliers come in pairs with product 1 throughout: the family is conservative")

    def _searched(self, events: list[Event], idle: dict[Event, int]) -> dict[Event, Zeros]:
        """Zeros of the functions of some events: each with an even share of the budget, then with what is left."""
        reserve = int((1.0 - _SEARCH) * self.spectra.left)
        found: dict[Event, Zeros] = {}
        for number, event in enumerate(events):
            share = (self.spectra.left - reserve) // (len(events) - number)
            found[event] = self._zeros(event, idle[event], self.spectra.left - share)
        for event in events:
            if found[event].spent:
                found[event] = self._zeros(event, idle[event], reserve)
        return found

    def _zeros(self, event: Event, idle: int, spare: int) -> Zeros:
        spectra = self.spectra
        return find_zeros(
            lambda places: spectra.function(places, event, idle),
            self.a,
            self.b,
            error=lambda places: spectra.function_error(places, event, idle),
            left=lambda: spectra.left - spare,
            skip=spectra.without_pair if event is Event.PAIR and not self.conservative else None,
        )

    def _roots(self, event: Event, idle: int, found: Zeros) -> list[Root]:
        self.spent |= found.spent or self.spectra.left <= 0
        if not found.spent:
            for piece in found.unresolved:
                self._leave(f"the multipliers do not depend smoothly on the parameter {self._between(piece)}")
        if not self.spent:  # or they were not looked for
            for piece in found.missing:
                self._leave(f"there are no matrices {self._between(piece)}, or only in part")
        roots = []
        for left, right in found.changes:
            if self.spectra.left <= 0:
                self.spent = True
                break
            if event is Event.PAIR and not self.conservative and self.spectra.without_pair(left, right):
                continue
            if left == right and self.spectra.distances(left, event)[1][0] > _TELLING:
                if self.spectra.clear(left):
                    continue  # two real multipliers with product 1
                self._leave(f"{LOST}, at {self.shown(left):.9g}")  # zero only by rounding
                continue
            place = left if left == right else self._root(event, idle, left, right)
            reach = 4.0 * _EPSILON * abs(place)
            roots.append(Root(place, max(place - reach, self.a), min(place + reach, self.b), event, False))
        return roots + [Root(0.5 * a + 0.5 * b, a, b, event, True) for a, b in found.touches]

    def _root(self, event: Event, idle: int, left: float, right: float) -> float:
        reference = float(self.spectra.function(np.array([left, right]), event, idle)[1].max())

        def value(place: float) -> float:
            signs, logs = self.spectra.function(np.array([place]), event, idle)
            return float(signs[0] * np.exp(logs[0] - reference)) if np.isfinite(signs[0]) else 0.0

        most = min(200, max(self.spectra.left, 1))
        return float(brentq(value, left, right, xtol=5e-324, rtol=4 * _EPSILON, maxiter=most, disp=False))

    def _between(self, piece: Interval) -> str:
        return between(*map(self.shown, piece))

    def _leave(self, remark: str) -> None:
        self.open = True
        self.remarks.append(remark)
