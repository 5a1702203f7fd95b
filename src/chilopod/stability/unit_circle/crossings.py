"""Search for all crossings of the unit circle by eigenvalues of a family of matrices.

Two methods are combined. Zeros of functions that are analytic in the parameter (:mod:`.spectra`) show events however
close they lie, but not two equal ones together. The number of eigenvalues outside the circle, known at every evaluated
matrix, must change by the crossings in between: if not, the crossing multiplier is followed by its continuous rank.

A search evaluates a few matrices, leaves aside what is critical at all of them, looks for the zeros of the function of
each kind of event (:mod:`.zeros`), encloses a root in each change of sign, and balances the roots with the numbers
outside (:mod:`.counts`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from chilopod.errors import ParameterError
from chilopod.flows.deadline import SpentError
from chilopod.frozen import Array
from chilopod.labels import Labelled
from chilopod.stability.spectrum import EPSILON
from chilopod.stability.unit_circle.counts import LOST, Accounts, Report
from chilopod.stability.unit_circle.spectra import CircleEvent, Crossing, Matrices, Root, Spectra, factors, margins
from chilopod.stability.unit_circle.zeros import PLACES, Zeros, find_zeros, places_in

BUDGET = 5000  # default budget of matrices of a search

_DECADES = 4.0
_SEARCH = 0.7  # part of the budget for the zeros of the functions; the rest is for counting
_IDLE = 1e-4  # size up to which factors are checked for vanishing throughout
_HUGE = 1e150
_TELLING = 0.1  # error of a factor that decides whether it vanishes
_FEWEST_TELLING = 3  # least number of such places
_MOSTLY = 0.25  # part of the first places that may disagree on factors that vanish throughout, as errors are estimates
_MANY = 800  # pairs of multipliers beyond which the bialternate product has too many meaningless zeros
_PROBES = 65
_FINEST_PROBE = 1e-6  # finest spacing of probes, relative to the interval
_OF_ERROR = 1e-4  # width of a root's enclosure, relative to its error from those of all entries
_NARROW = 1e-13  # narrowest enclosure of a root, relative to its value
_DIGITS = 4.0 * EPSILON  # rounding of a root's place, relative to its value
_CLOSE = 0.25  # predicted approach to the circle, relative to the nearer end, that calls for a probe


class SearchStatus(Labelled):
    """End of a search; each member's ``sentence`` says it in words."""

    COMPLETE = "complete", "the counts at both ends and between all points add up"
    CONSERVATIVE = "conservative", "multipliers come in pairs with product 1; where pairs leave the circle is listed"
    INCOMPLETE = "incomplete", "not everything is accounted for; the remarks say what and where"
    BUDGET = "budget", "the budget was spent; what was found until then is listed"

    def worst(self, *others: SearchStatus) -> SearchStatus:
        """The worst of some statuses; members are ordered from best to worst."""
        return max(self, *others, key=list(SearchStatus).index)


@dataclass(frozen=True)
class Crossings:
    """Crossings by rising value, status of the search, remarks of a sentence each, and number of evaluations."""

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
    known: Sequence[float] = (),
) -> Crossings:
    """Every value of a parameter at which eigenvalues of real matrices cross the unit circle.

    Matrices are evaluated at up to ``budget`` values, or ``affordable()`` more if their cost decides, and at ``known``
    values of the interval, where they cost nothing. Remarks show a value as ``shown(value)``. A ParameterError refuses
    an empty or infinite interval.
    """
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ParameterError("must be two finite values", field="between", value=(low, high), allowed="(lower, higher)")
    if budget < (least := 2 * PLACES.size):
        return Crossings((), SearchStatus.BUDGET, (f"a search takes {least} matrices or more (`budget`)",), 0)
    a, b, parameter, place = _coordinate(low, high)
    spectra = Spectra(lambda places: matrices(parameter(places)), budget + len(known), affordable)
    finder = _Finder(spectra, a, b, Report(lambda place: shown(float(parameter(place)))))
    try:
        status, found = finder.search(np.clip(place(np.array(known)), a, b))
    except SpentError:  # in the errors of multipliers, without which nothing is certain
        return Crossings((), SearchStatus.BUDGET, (), len(spectra.known))
    crossings = []
    for each in found:
        value, left, right, before, after = parameter(np.array([each.value, *each.bracket, *each.around])).tolist()
        crossings.append(replace(each, value=value, bracket=(left, right), around=(before, after)))
    return Crossings(tuple(crossings), status, tuple(dict.fromkeys(finder.report.remarks)), len(spectra.known))


def first_values(low: float, high: float) -> Array:
    """First values of the parameter at which a search of an interval evaluates matrices, in order."""
    a, b, parameter, _ = _coordinate(low, high)
    return np.sort(parameter(places_in(a, b, PLACES)))


def _coordinate(low: float, high: float) -> tuple[float, float, Callable[[Any], Any], Callable[[Any], Any]]:
    """Ends of an interval in an even coordinate, over decades the logarithm; the parameter at places; the inverse."""
    inward, outward = (np.log, np.exp) if low > 0.0 and high / _DECADES > low else (np.asarray, np.asarray)
    a, b = float(inward(low)), float(inward(high))

    def parameter(places: Any) -> Any:
        # The exact ends, in spite of rounding in the logarithm.
        return np.where(places <= a, low, np.where(places >= b, high, np.clip(outward(places), low, high)))

    return a, b, parameter, inward


@dataclass(frozen=True)
class _Finder:
    """The search, in a coordinate with an even effect of the parameter."""

    spectra: Spectra
    a: float
    b: float
    report: Report

    def search(self, known: Array) -> tuple[SearchStatus, list[Crossing]]:
        """Find the crossings; eigenvalues outside are counted at ``known`` places too."""
        report, spectra = self.report, self.spectra
        first = places_in(self.a, self.b, PLACES)
        spectra.at(first)
        if not spectra.values:
            if spectra.left <= 0:
                return SearchStatus.BUDGET, []
            report.leave("there is no matrix anywhere")
            return SearchStatus.INCOMPLETE, []
        spectra.at(known)
        self._rest(first)
        events = [event for event in CircleEvent if spectra.idle[event] < self._factors(event) <= _MANY]
        if self._factors(CircleEvent.PAIR) > _MANY:
            self._probe()
        found = self._searched(events)
        roots = [root for event in events for root in self._roots(event, found[event])]
        crossings = Accounts(spectra, (self.a, self.b), report).balance(roots)
        status = SearchStatus.CONSERVATIVE if spectra.conservative else SearchStatus.COMPLETE
        if report.spent or report.open:
            status = SearchStatus.BUDGET if report.spent else SearchStatus.INCOMPLETE
        return status, crossings

    def _factors(self, event: CircleEvent) -> int:
        m = self.spectra.size
        return m if event is not CircleEvent.PAIR else m * (m - 1) // 2

    def _rest(self, places: Array) -> None:
        """Find factors that are critical at all places, with remarks."""
        idle = self.spectra.idle = {event: self._idle(places, event) for event in CircleEvent}
        real = CircleEvent.PLUS, CircleEvent.MINUS
        for event in real:
            if idle[event]:
                many = "a multiplier is" if idle[event] == 1 else f"{idle[event]} multipliers are"
                self.report.remarks.append(f"{many} {event.label} throughout and left aside")
        if idle[CircleEvent.PAIR] > sum(idle[event] * (idle[event] - 1) // 2 for event in real):
            self.spectra.conservative = True
            pairs = "multipliers come in pairs with product 1 throughout: the family is conservative"
            self.report.remarks.append(pairs)

    def _idle(self, places: Array, event: CircleEvent) -> int:
        """Number of factors of an event's function that vanish at all values of the parameter."""
        if self._factors(event) == 0:
            return 0
        few, nu = places.size < _PROBES, self.spectra.at(places)
        here = np.isfinite(nu).all(axis=1)
        places, nu = places[here], nu[here]
        # A large eigenvalue makes the small ones, and their products with it, uncertain.
        largest = np.maximum(1.0, np.abs(nu).max(axis=1))
        if event is CircleEvent.PAIR:
            largest = np.minimum(largest, _HUGE) ** 2
        clear = np.abs(factors(nu, event)).min(axis=1) > _IDLE * largest
        numbers = [0] * int(clear.sum())
        for place in places[~clear].tolist():
            if numbers.count(0) > _MOSTLY * places.size:
                return 0
            sizes, errors = self.spectra.factor_sizes(place, event)
            if errors[0] <= _TELLING:
                numbers.append(int(np.argmin(np.append(sizes <= errors, False))))
        if len(numbers) < _FEWEST_TELLING:
            if few and self.spectra.left > _PROBES:  # errors are estimates: more places may tell
                return self._idle(np.linspace(self.a, self.b, _PROBES), event)
            if self.spectra.left > 0:
                self.report.leave(LOST)
            self.report.spent |= self.spectra.left <= 0
            return 0
        return int(sorted(numbers)[int(_MOSTLY * len(numbers))])

    def _probe(self) -> None:
        """Evaluate matrices wherever a multiplier may reach the circle and come back: near it at both ends of a gap."""
        self.report.remarks.append("with many multipliers pairs are found by counting, not by zeros of a function")
        places = np.linspace(self.a, self.b, _PROBES)
        while places.size and self.spectra.left > places.size:
            self.spectra.at(places)
            known = np.array(self.spectra.values)
            found = margins(self.spectra.at(known))
            gaps = np.diff((0.5 * known - 0.5 * self.a) / (0.5 * self.b - 0.5 * self.a))
            start, end, gap = found[1:-2], found[2:-1], gaps[1:-1]
            # Near an enclosed crossing a gap may round to zero: the slope is then undefined.
            with np.errstate(divide="ignore", invalid="ignore"):
                slopes = np.diff(found, axis=0) / gaps[:, None]
                into, out = slopes[:-2], -slopes[2:]  # both towards the inside of the gap
                reach = np.clip((end - start + out * gap[:, None]) / (into + out), 0.0, gap[:, None])
                towards = np.sign(start) * (start + into * np.nan_to_num(reach))
            turning = (start * end > 0.0) & (np.sign(start) * into < 0.0) & (np.sign(start) * out < 0.0)
            again = (turning & (towards < _CLOSE * np.minimum(np.abs(start), np.abs(end)))).any(axis=1)
            again &= gap > _FINEST_PROBE
            places = (0.5 * known[1:-2] + 0.5 * known[2:-1])[again]

    def _searched(self, events: list[CircleEvent]) -> dict[CircleEvent, Zeros]:
        """Zeros of the functions of some events: each with an even share of the budget, then with the rest."""
        reserve = int((1.0 - _SEARCH) * self.spectra.left)
        found: dict[CircleEvent, Zeros] = {}
        for number, event in enumerate(events):
            share = (self.spectra.left - reserve) // (len(events) - number)
            found[event] = self._zeros(event, self.spectra.left - share)
        for event in events:
            if found[event].spent:
                found[event] = self._zeros(event, reserve)
        return found

    def _zeros(self, event: CircleEvent, spare: int) -> Zeros:
        spectra = self.spectra
        function, error = partial(spectra.function, event=event), partial(spectra.function_error, event=event)
        skip = spectra.without_pair if event is CircleEvent.PAIR else None
        return find_zeros(function, self.a, self.b, error=error, left=lambda: spectra.left - spare, skip=skip)

    def _roots(self, event: CircleEvent, found: Zeros) -> list[Root]:
        report, spectra = self.report, self.spectra
        report.spent |= found.spent or spectra.left <= 0
        if not found.spent:
            for piece in found.unresolved:
                report.leave(f"the multipliers do not depend smoothly on the parameter {report.between(piece)}")
        if not report.spent:  # else they were not searched
            for piece in found.missing:
                report.leave(f"there are no matrices {report.between(piece)}, or only in part")
        roots = []
        for left, right in found.changes:
            if spectra.left <= 0:
                report.spent = True
                break
            if event is CircleEvent.PAIR and spectra.without_pair(left, right):
                continue
            if left == right and spectra.factor_sizes(left, event)[1][0] > _TELLING:
                # Zero only by rounding, or two real multipliers have product 1.
                if (np.abs(spectra.margins(left)) <= spectra.margin_errors(left)).any():
                    report.leave(f"{LOST}, at {report.shown(left):.9g}")
                continue
            roots.append(Root(left, left, left, event) if left == right else self._root(event, left, right))
        return roots + [Root(0.5 * a + 0.5 * b, a, b, event, True) for a, b in found.touches]

    def _root(self, event: CircleEvent, left: float, right: float) -> Root:
        logs = self.spectra.function(np.array([left, right]), event)[1]
        reference, within, slope = float(logs.max()), 0.1 * (right - left), 0.0
        if within > _NARROW * max(abs(left), abs(right)):
            error = float(self.spectra.function_error(np.array([left]), event)[0])
            wrong, within = float(np.exp(min(error - reference, 0.0))), 0.0
            if wrong < _TELLING:  # the signs are certain, and the function is nearly linear in between
                within = _OF_ERROR * wrong * (0.5 * right - 0.5 * left)
                slope = float(np.exp(logs - reference).sum()) / (right - left)

        def value(place: float) -> float:
            (sign,), (log,) = self.spectra.function(np.array([place]), event)
            found = float(sign * np.exp(log - reference))
            # Zero within the digits of the place, or where there is no matrix.
            return found if abs(found) > slope * max(within, _DIGITS * abs(place)) else 0.0

        return self.spectra.rooted(value, left, right, event, within)
