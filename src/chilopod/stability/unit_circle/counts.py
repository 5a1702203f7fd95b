"""Balance of the number of multipliers outside the unit circle with the crossings, and missing crossings.

The multipliers outside are counted wherever a matrix is known and they are clear of the circle. Neighbouring counts
enclose a gap, and the roots in a gap must explain the change of its count. Where they do not, the roots are mended:

- without a root, or at a mere touch, the multiplier that changed sides is followed by its rank, or in a conservative
  family the place of the change is bisected;
- several roots are separated by a count between them, or merged;
- beside a single root multipliers are counted nearer to it.

This is repeated until no gap can be mended. Remarks then say what is unexplained, and every root gives crossings.
"""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from chilopod.frozen import Array
from chilopod.stability.spectrum import EPSILON
from chilopod.stability.unit_circle.spectra import UNKNOWN, CircleEvent, Crossing, Root, Spectra, margins
from chilopod.stability.unit_circle.zeros import Interval

LOST = "multipliers near the circle are known no better than their distance from it"

_CLEARLY, _ROOM = 1e-5, 1e3  # distance from the circle, and multiple of errors elsewhere, that needs no error estimate
_GREY = 32.0  # distance from the circle, in errors, up to which a multiplier may have left it or not
_ROUNDS = 200  # rounds of balancing: each adds a root, joins two or counts nearer to one
_GROWTH = 8.0  # ratio of successive distances from a root at which multipliers are counted
_JUMP, _WIDER = 0.5, 100.0  # part of a multiplier's change that remains in a jump, and ratio of the intervals' widths
_NARROW = 1e-6  # largest width, relative to the whole interval, at which that tells: a search may end before
_SHADOW = 1.5  # distance of a crossing that explains a touch, in widths of the touch


@dataclass
class Report:
    """Remarks of a search, a sentence each, with places as ``shown`` values of the parameter; flags for a spent budget
    and for open questions."""

    shown: Callable[[float], float]
    remarks: list[str] = field(default_factory=list)
    spent: bool = False
    open: bool = False

    def leave(self, remark: str) -> None:
        """Note a remark on an open question."""
        self.open = True
        self.remarks.append(remark)

    def between(self, gap: Interval) -> str:
        """Words for an interval, with enough digits to separate its ends."""
        low, high = map(self.shown, gap)
        first, last = f"{low:.9g}", f"{high:.9g}"
        return f"between {first} and {last}" if first != last else f"between {float(low)!r} and {float(high)!r}"


class _Gap(NamedTuple):
    """Roots between two neighbouring counts of multipliers outside; before the first and after the last count, an end
    is infinite and the count on the other side stands for both."""

    x: float
    y: float
    before: int
    after: int
    inside: list[Root]

    @property
    def change(self) -> int:
        return self.after - self.before


@dataclass
class Accounts:
    """Numbers of multipliers outside the circle, at all values of an interval with known spectra, and the roots that
    explain their changes."""

    spectra: Spectra
    ends: Interval
    report: Report
    _counts: dict[float, int | None] = field(default_factory=dict)
    _known: dict[tuple[Root, int], list[Crossing]] = field(default_factory=dict)  # by root and number of spectra
    _settled: set[Interval] = field(default_factory=set)  # gaps about which a remark was made

    def __post_init__(self) -> None:
        probes = [self.spectra.values[0], self.spectra.values[len(self.spectra.values) // 2], self.spectra.values[-1]]
        self.spectra.disturbed(np.array(probes))  # together
        self._clearly = max(_CLEARLY, _ROOM * max(float(self.spectra.margin_errors(u).max()) for u in probes))

    def balance(self, roots: list[Root]) -> list[Crossing]:
        """Crossings that explain the counts, in order."""
        self.spectra.at(np.array(self.ends))
        roots = [root for root in roots if self._may_cross(root)]
        for _ in range(_ROUNDS):
            roots = sorted(_without_shadows(roots), key=lambda root: root.place)
            gaps = self._gaps(roots)
            if not gaps:
                self._remark("the multipliers are nowhere clear of the circle", self.ends)
                return [crossing for root in roots for crossing in self._critical(root)]
            mended = [self._mended(gap) for gap in gaps]
            if all(each is None for each in mended):
                break
            pairs = zip(gaps, mended, strict=True)
            roots = [root for gap, each in pairs for root in (gap.inside if each is None else each)]
        else:
            self.report.leave("the counts of multipliers outside did not settle")
        found = [crossing for gap in gaps for root in gap.inside for crossing in self._crossings(gap, root)]
        return sorted(found, key=lambda crossing: crossing.value)

    def _gaps(self, roots: list[Root]) -> list[_Gap]:
        """The interval cut where multipliers are counted, with the roots in every part; empty without counts."""
        values, within = self.spectra.values, set[float]()
        for root in roots:
            left, right = (root.place, root.place) if root.touch else root.known
            within.update(values[bisect.bisect_left(values, left) : bisect.bisect_right(values, right)])
        self._count_together(np.array([v for v in values if v not in within and v not in self._counts]))
        decided = [(v, count) for v in values if (count := self._counts.get(v)) is not None]
        if not decided:
            return []
        first, last = (-np.inf, decided[0][1]), (np.inf, decided[-1][1])
        gaps = [_Gap(x, y, u, v, []) for (x, u), (y, v) in itertools.pairwise([first, *decided, last])]
        places = [place for place, _ in decided]
        for root in roots:
            gaps[bisect.bisect_right(places, root.place)].inside.append(root)
        return gaps

    def _count_together(self, places: Array) -> None:
        """Count at some places with a matrix, without errors where all multipliers are far from the circle."""
        found = margins(self.spectra.at(places))
        clear = np.abs(found).min(axis=1, initial=np.inf) > self._clearly
        clear &= not (self.spectra.resting or self.spectra.conservative)
        self._counts.update(zip(places[clear].tolist(), (found[clear] > 0.0).sum(axis=1).tolist(), strict=True))
        self.spectra.disturbed(places[~clear])  # together
        for place in places[~clear].tolist():
            self._count(place)

    def _count(self, place: float) -> int | None:
        """Number of multipliers outside the circle; None if one is too near the circle, or without a spectrum."""
        if place not in self._counts:
            self._counts[place] = self._counted(place) if self.spectra.exists(place) else None
        return self._counts[place]

    def _counted(self, place: float) -> int | None:
        spectra = self.spectra
        found, errors = spectra.margins(place), spectra.margin_errors(place)
        outside = int((found > errors).sum())
        if not spectra.conservative:
            return outside if int((np.abs(found) <= errors).sum()) <= spectra.resting else None
        for event in CircleEvent:
            # Multipliers that meet may have left the circle or not.
            sizes, uncertain = spectra.factor_sizes(place, event)
            if (sizes <= _GREY * uncertain)[spectra.idle[event] :].any():
                return None
        away = np.abs(found) / errors
        return None if ((away > 1.0) & (away <= _GREY)).any() else outside

    def _mended(self, gap: _Gap) -> list[Root] | None:
        """Better roots for a gap whose roots do not explain its counts; None if they do, or without better ones."""
        inside = gap.inside
        if gap.x == -np.inf or gap.y == np.inf:
            return None if inside else self._at_end(gap)
        explained = self._explains(inside[0], gap.change) if len(inside) == 1 else not inside and gap.change == 0
        if explained or gap[:2] in self._settled:
            return None
        if self.spectra.left <= 0:
            self.report.spent = True
            return None
        if len(inside) > 1:
            return self._separated(inside)
        if not inside or (inside[0].touch and gap.change != 0):
            whole = not self.spectra.holes(gap.x, gap.y)
            return self._bisected(gap) if self.spectra.conservative and whole else self._followed(gap)
        if self._tightened(inside[0], gap):
            return inside
        # It may also be a collision whose ends are too near each other.
        if not (self.spectra.conservative and gap.change == 0):
            critical = sum(crossing.multiplicity for crossing in self._critical(inside[0]))
            self._remark(f"{gap.change:+d} multipliers outside where {critical} are on the circle", gap[:2])
        return None

    def _at_end(self, gap: _Gap) -> list[Root] | None:
        """A root at an end of the interval without a deciding count."""
        place = self.ends[0] if gap.x == -np.inf else self.ends[1]
        end = Root(place, place, place, None, True)
        return [end] if place not in gap[:2] and self._may_cross(end) else None

    def _followed(self, gap: _Gap) -> list[Root]:
        """Roots of the multipliers whose ranks are inside the circle at one end of a gap and outside at the other."""
        spectra, (x, y) = self.spectra, gap[:2]
        roots: list[Root] = []
        jumped = False
        for rank in range(min(gap.before, gap.after), max(gap.before, gap.after)):
            margin = partial(self._margin, rank)
            if spectra.holes(x, y) or spectra.left <= 0 or margin(x) * margin(y) >= 0.0:
                break  # the last one: the errors were larger than their bounds
            # A jump at zero has no last digits.
            root = spectra.rooted(margin, x, y, None, EPSILON * (self.ends[1] - self.ends[0]))
            if not spectra.exists(root.place):
                break
            if self._jumps(root.place, rank):
                near = [v for v in spectra.values if x <= v <= y and self._count(v) is not None]
                left = max(v for v in near if v <= root.place and (margin(v) > 0) == (margin(x) > 0))
                right = min(v for v in near if v >= root.place and (margin(v) > 0) == (margin(y) > 0))
                at = self.report.shown(root.place)
                self._remark(f"a multiplier jumps across the circle at {at:.9g}", (left, right))
                jumped = True
            elif all(abs(root.place - other.place) > 16.0 * EPSILON * abs(root.place) for other in roots):
                roots += [root] if self._critical(root) else []
        self.report.spent |= spectra.left <= 0
        if not (jumped or self.report.spent) and (not roots or spectra.holes(x, y)):
            why = "and no matrices in between" if spectra.holes(x, y) else "and none found on the circle"
            self._remark(f"{gap.change:+d} multipliers outside, {why}", (x, y))
        return roots

    def _margin(self, rank: int, place: float) -> float:
        """Margin of the multiplier of a rank, zero if unknown. Multipliers that rest on the circle have any rank in
        between, and add nothing."""
        found = float(self.spectra.margins(place)[rank : rank + self.spectra.resting + 1].sum())
        return found if np.isfinite(found) else 0.0

    def _jumps(self, place: float, rank: int) -> bool:
        """True if the multiplier of a rank is discontinuous at a place: its change does not fall with the width."""
        spectra = self.spectra
        left, right = spectra.beside(place)
        width = max(right - left, 4.0 * float(np.spacing(abs(place))))
        wide = spectra.beside(place, _WIDER * width)
        small, large = (abs(spectra.margins(b)[rank] - spectra.margins(a)[rank]) for a, b in ((left, right), wide))
        errors = (spectra.margin_errors(side)[rank] for side in (left, right))  # computed only if they decide
        narrow = width <= _NARROW * (self.ends[1] - self.ends[0])
        return bool(narrow and small > _JUMP * large and small > _WIDER * sum(errors))

    def _bisected(self, gap: _Gap) -> list[Root]:
        """The root of a conservative family where the count changes, by bisection while counts are certain."""
        x, y = gap[:2]
        while x < (middle := 0.5 * x + 0.5 * y) < y and self.spectra.left > 0:
            if (count := self._count(middle)) is None:
                break
            x, y = (middle, y) if count == gap.before else (x, middle)
        for event in (CircleEvent.MINUS, CircleEvent.PLUS, CircleEvent.PAIR):
            root = Root(0.5 * x + 0.5 * y, x, y, event)
            if (x, y) != gap[:2] and self._critical(root) and self._explains(root, gap.change):
                return [root]
        self._remark("multipliers leave the circle, or come back, and none were found to meet", gap[:2])
        return []

    def _separated(self, inside: list[Root]) -> list[Root]:
        """Roots with a counted place between them; those without one are merged."""
        roots = [inside[0]]
        for root in inside[1:]:
            last = roots[-1]
            middle = 0.5 * last.place + 0.5 * root.place
            if last.place < middle < root.place and self._count(middle) is not None:
                roots.append(root)
            elif last.touch != root.touch:
                roots[-1] = last if root.touch else root
            else:
                left, right = min(last.left, root.left), max(last.right, root.right)
                roots[-1] = Root(last.place, left, right, last.event, last.touch)
        return roots

    def _tightened(self, root: Root, gap: _Gap) -> bool:
        """True if places nearer to a root could be counted."""
        found = False
        for side, end in ((-1.0, gap.x), (1.0, gap.y)):
            reach = max(8.0 * float(np.spacing(abs(root.place))), root.right - root.left)
            while gap.x < (place := root.place + side * reach) < gap.y and self.spectra.left > 0:
                known = self._count(place) is not None
                found |= known
                if known or abs(place - end) < 0.1 * _GROWTH * reach:
                    break
                reach *= _GROWTH
        return found

    def _explains(self, root: Root, change: int) -> bool:
        """True if the critical multipliers at a root may explain a change of the count."""
        crossings = self._critical(root)
        number = sum(crossing.multiplicity for crossing in crossings)
        if self.spectra.conservative and all(crossing.collision for crossing in crossings):
            return 2 * abs(change) <= number and (root.touch or change != 0)
        if root.touch:
            return change == 0
        alone = len(crossings) == 1 and number == (2 if crossings[0].event is CircleEvent.PAIR else 1)
        return abs(change) == number if alone else abs(change) <= number and (change - number) % 2 == 0

    def _crossings(self, gap: _Gap, root: Root) -> list[Crossing]:
        """Crossings at a root in a gap, with the change of the number of multipliers outside."""
        crossings = self._critical(root)
        if gap.x == -np.inf or gap.y == np.inf:
            # As if the multipliers continued in their direction.
            number = sum(crossing.multiplicity for crossing in crossings)
            outside = gap.before - int((self.spectra.margins(root.place) > self.spectra.tolerances(root)).sum())
            change = (2 * outside - number) * (1 if gap.x == -np.inf else -1) if 0 <= outside <= number else 0
            return [replace(crossing, change=change) for crossing in crossings]
        if len(gap.inside) > 1 or not self._explains(root, gap.change):
            return crossings
        if len(crossings) == 1:
            return [replace(crossings[0], change=gap.change)]
        beyond = self._outside_near
        return [replace(each, change=beyond(each, gap.y) - beyond(each, gap.x)) for each in crossings]

    def _outside_near(self, crossing: Crossing, place: float) -> int:
        """Number of the multipliers nearest to the critical ones outside the circle, at a place beside a crossing."""
        nu, times = self.spectra.at(np.array([place]))[0], 1
        if crossing.event is CircleEvent.PAIR:
            nu, times = nu[nu.imag > 0.0], 2
        nearest = np.argsort(np.abs(nu - crossing.multiplier))[: crossing.multiplicity // times]
        return times * int((np.abs(nu[nearest]) > 1.0).sum())

    def _critical(self, root: Root) -> list[Crossing]:
        """Crossings at a root, with unknown changes; none without a matrix."""
        if not self.spectra.exists(root.place):
            return []
        key = root, len(self.spectra.values)  # all information on the multipliers beside a root
        if key not in self._known:
            self._known[key] = self.spectra.critical_at(root)
        return self._known[key]

    def _may_cross(self, root: Root) -> bool:
        """True if multipliers are critical at a root, and do not just jump over the circle there; a remark if only
        their errors leave that open."""
        crossings = self._critical(root)
        if not crossings and self.spectra.exists(root.place):
            gap = root.left, root.right
            unknown = float(self.spectra.tolerances(root).max()) > UNKNOWN
            if unknown and gap not in self._settled and not (root.touch and root.event is not None):
                self._remark(LOST, gap)
        if not crossings or root.touch or self.spectra.conservative:  # there those that meet leave like square roots
            return bool(crossings)
        nu = self.spectra.at(np.array([root.place]))[0]
        return not any(self._jumps(root.place, int(np.abs(nu - each.multiplier).argmin())) for each in crossings)

    def _remark(self, remark: str, gap: Interval) -> None:
        self._settled.add(gap)
        self.report.leave(f"{remark}, {self.report.between(gap)}")


def _without_shadows(roots: list[Root]) -> list[Root]:
    """Roots without the touches that lie in the uncertain surroundings of a crossing."""
    crossings = np.array([root.place for root in roots if not root.touch])

    def apart(touch: Root) -> bool:
        return bool((np.abs(crossings - touch.place) > _SHADOW * (touch.right - touch.left)).all())

    return [root for root in roots if not root.touch or apart(root)]
