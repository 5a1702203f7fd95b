"""Whether the number of multipliers outside the unit circle changes by what crosses it, and what crosses where it does
not."""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.stability.unit_circle.critical import LOST, UNKNOWN, Critical, Group, Point, Root
from chilopod.stability.unit_circle.spectra import Event, Spectra, margins
from chilopod.stability.unit_circle.zeros import Interval, between

Array = NDArray[np.float64]

_CLEARLY = 1e-5  # a multiplier this far from the circle is decided, if errors elsewhere are far smaller
_ROOM = 1e3
_GREY = 32.0  # a multiplier between one and this many errors from the circle may have left it or not
_ROUNDS = 200
_GROWTH = 8.0
_JUMP = 0.5
_SHADOW = 1.5  # widths of a touch within which a crossing explains it
_WIDER = 100.0
_EPSILON = float(np.finfo(float).eps)


class _Anew(NamedTuple):
    """Roots to go on with, where the counts are to be compared once more."""

    roots: list[Root]


class Accounts:
    """The numbers of multipliers outside the circle along a family, and the roots that explain their changes.

    Parameters
    ----------
    spectra
        Eigenvalues; all values at which they are known are used.
    ends
        The interval.
    idle
        For each event, how many factors of its function vanish throughout.
    resting
        Number of multipliers that are +1 or -1 throughout.
    conservative
        True if multipliers may stay on the circle.
    parameter
        The parameter at a place, for remarks.
    """

    def __init__(
        self,
        spectra: Spectra,
        ends: Interval,
        idle: dict[Event, int],
        resting: int,
        conservative: bool,
        parameter: Callable[[float], float],
    ) -> None:
        self.remarks: list[str] = []
        self.spent = False
        self.open = False
        self._spectra = spectra
        self._ends = ends
        self._idle = idle
        self._resting = resting
        self._conservative = conservative
        self._critical = Critical(spectra, idle, conservative)
        self._parameter = parameter
        self._counts: dict[float, int | None] = {}
        self._settled: set[Interval] = set()  # gaps about which a remark was made
        probes = [spectra.values[0], spectra.values[len(spectra.values) // 2], spectra.values[-1]]
        spectra.disturbed(np.array(probes))  # together
        self._clearly = max(_CLEARLY, _ROOM * max(float(spectra.margin_errors(u).max()) for u in probes))

    def balance(self, roots: list[Root]) -> list[Point]:
        """Points that explain the counts, in order."""
        self._spectra.at(np.array(self._ends))
        roots = [root for root in roots if self._is_critical(root) or self._lost(root)]
        for _ in range(_ROUNDS):
            roots, points, again = self._walk(sorted(_without_shadows(roots), key=lambda root: root.place))
            if not again:
                break
        else:
            self.open = True
            self.remarks.append("the counts of multipliers outside did not settle")
        return points

    def count(self, place: float) -> int | None:
        """Number of multipliers outside the circle; None where one of them is too near to say."""
        self._count_clear([place])
        if place not in self._counts:
            self._counts[place] = self._counted(place)
        return self._counts[place]

    def _count_clear(self, places: list[float]) -> None:
        """Count where all multipliers are clear of the circle; where not, compute their errors together."""
        new = np.array([place for place in places if place not in self._counts])
        if not new.size:
            return
        found = margins(self._spectra.at(new))
        clear = np.abs(found).min(axis=1, initial=np.inf) > self._clearly
        if self._resting or self._conservative:
            clear[:] = False
        self._counts.update(zip(new[clear].tolist(), (found[clear] > 0.0).sum(axis=1).tolist(), strict=True))
        self._spectra.disturbed(new[~clear])

    def _counted(self, place: float) -> int | None:
        found = self._spectra.margins(place)
        errors = self._spectra.margin_errors(place)
        outside = int((found > errors).sum())
        if self._conservative:
            sizes = np.abs(found) / errors
            for event in Event:
                # Those that meet may have left the circle or not.
                distances, uncertain = self._spectra.distances(place, event)
                idle = self._idle[event]
                if (distances[idle:] <= _GREY * uncertain[idle:]).any():
                    return None
            return None if ((sizes > 1.0) & (sizes <= _GREY)).any() else outside
        return outside if int((np.abs(found) <= errors).sum()) <= self._resting else None

    def _walk(self, roots: list[Root]) -> tuple[list[Root], list[Point], bool]:
        """Compare counts along all gaps between decided places; the roots after that, the points, and whether to do
        it again."""
        decided = self._decided(roots)
        if not decided:
            self._remark("the multipliers are nowhere clear of the circle", self._ends)
            return roots, [self._point(root, 0, None, None) for root in roots], False
        kept = self._beyond(roots, decided)
        points = [self._at_end(root, decided) for root in kept]
        again = False
        index = 0
        for (x, before), (y, after) in itertools.pairwise(decided):
            inside = []
            while index < len(roots) and roots[index].place < y:
                if roots[index].place > x:
                    inside.append(roots[index])
                index += 1
            found = self._in_gap(inside, x, y, before, after)
            if isinstance(found, _Anew):
                kept += found.roots
                again = True
            else:
                kept += inside
                points += found
        return kept, sorted(points, key=lambda point: point.place), again

    def _beyond(self, roots: list[Root], decided: list[tuple[float, int]]) -> list[Root]:
        """Roots beyond the first and the last decided place, the ends of the interval among them."""
        first, last = decided[0][0], decided[-1][0]
        kept = [root for root in roots if not first <= root.place <= last]
        for place in self._ends:
            if first <= place <= last or place not in self._spectra.values:
                continue
            if not any((root.place < first, root.place > last) == (place < first, place > last) for root in kept):
                end = Root(place, place, place, None, True)
                if self._is_critical(end):
                    kept.append(end)
                else:
                    self._lost(end)
        return kept

    def _in_gap(self, inside: list[Root], x: float, y: float, before: int, after: int) -> list[Point] | _Anew:
        """Points of the roots in a gap, if they explain the change of the count; else the roots to go on with."""
        change = after - before
        unexplained = [self._point(root, 0, None, None) for root in inside]
        if (not inside and change == 0) or (x, y) in self._settled:
            return unexplained
        explained = len(inside) == 1 and self._explains(inside[0], change)
        if self._spectra.left <= 0 and not explained:
            self.spent = True
            return unexplained
        if not inside:
            return _Anew(self._followed(x, y, before, after))
        if len(inside) > 1:
            return _Anew(self._separated(inside))
        if not explained:
            if inside[0].touch and change != 0:
                return _Anew(self._followed(x, y, before, after))
            if self._tightened(inside[0], x, y):
                return _Anew(inside)
            # Or it is a collision whose ends are too near each other.
            if not (self._conservative and change == 0):
                critical = sum(group.multiplicity for group in self._critical.groups(inside[0]))
                self._remark(f"{change:+d} multipliers outside where {critical} are on the circle", (x, y))
        return [self._point(inside[0], change, x, y)]

    def _decided(self, roots: list[Root]) -> list[tuple[float, int]]:
        """Places with a count, those within the brackets of roots left out."""
        values = self._spectra.values
        within: set[float] = set()
        for root in roots:
            left, right = (root.place, root.place) if root.touch else (root.left, root.right)
            within.update(values[bisect.bisect_left(values, left) : bisect.bisect_right(values, right)])
        self._count_clear([v for v in values if v not in within])
        return [(v, count) for v in values if v not in within and (count := self.count(v)) is not None]

    def _remark(self, remark: str, gap: Interval) -> None:
        self.open = True
        self._settled.add(gap)
        self.remarks.append(f"{remark}, {between(*map(self._parameter, gap))}")

    # ---- whether a root explains a change ---------------------------------------------------------------------------

    def _is_critical(self, root: Root) -> bool:
        return self._spectra.exists(root.place) and bool(self._critical.groups(root))

    def _lost(self, root: Root) -> bool:
        """Say so where a root is none only because the multipliers there are not known; False."""
        if self._spectra.exists(root.place) and float(self._critical.tolerances(root).max()) > UNKNOWN:
            gap = root.left, root.right
            if gap not in self._settled and not (root.touch and root.event is not None):
                self._remark(LOST, gap)
        return False

    def _explains(self, root: Root, change: int) -> bool:
        """Whether a change of the count is what the critical multipliers at a root may do."""
        groups = self._critical.groups(root)
        number = sum(group.multiplicity for group in groups)
        if self._conservative and all(group.collision for group in groups):
            return 2 * abs(change) <= number and (root.touch or change != 0)
        if root.touch:
            return change == 0
        alone = len(groups) == 1 and number == (2 if groups[0].event is Event.PAIR else 1)
        return abs(change) == number if alone else abs(change) <= number and (change - number) % 2 == 0

    def _point(self, root: Root, change: int, x: float | None, y: float | None) -> Point:
        groups = self._critical.groups(root)
        if len(groups) > 1 and x is not None and y is not None:
            changes = [self._critical.outside_near(g, y) - self._critical.outside_near(g, x) for g in groups]
        else:
            changes = [change] * len(groups)
        return Point(
            root.place,
            root.left,
            root.right,
            tuple(
                Group(g.event, g.multiplicity, c, g.multiplier, g.collision)
                for g, c in zip(groups, changes, strict=True)
            ),
        )

    def _at_end(self, root: Root, decided: list[tuple[float, int]]) -> Point:
        """A root beyond the last decided place: as if the multipliers went on as they come."""
        first = root.place < decided[0][0]
        count = decided[0 if first else -1][1]
        number = sum(group.multiplicity for group in self._critical.groups(root))
        surely = int((self._spectra.margins(root.place) > self._critical.tolerances(root)).sum())
        outside = count - surely
        change = (2 * outside - number) * (1 if first else -1)
        return self._point(root, change if 0 <= outside <= number else 0, None, None)

    # ---- refinement ------------------------------------------------------------------------------------------------

    def _followed(self, x: float, y: float, before: int, after: int) -> list[Root]:
        """Roots of the multipliers of those ranks that are inside the circle at one end of a gap and outside at the
        other."""
        if self._spectra.holes(x, y):
            self._remark(f"{after - before:+d} multipliers outside, and no matrices in between", (x, y))
            return []
        if self._conservative:
            return self._bisected(x, y, before, after)
        roots: list[Root] = []
        for rank in range(min(before, after), max(before, after)):
            if self._spectra.left <= 0:
                self.spent = True
                break

            def margin(place: float, rank: int = rank) -> float:
                # Those that rest on the circle are of any rank in between, and add nothing.
                found = float(self._spectra.margins(place)[rank : rank + self._resting + 1].sum())
                return found if np.isfinite(found) else 0.0

            if margin(x) * margin(y) >= 0.0:
                break  # errors were not what they were said to be
            most = min(200, max(self._spectra.left, 1))
            place = float(brentq(margin, x, y, xtol=5e-324, rtol=4 * _EPSILON, maxiter=most, disp=False))
            if not self._spectra.exists(place):
                self.spent |= self._spectra.left <= 0
                if not self.spent:
                    self._remark(f"{after - before:+d} multipliers outside, and no matrices in between", (x, y))
                break
            reach = 4.0 * _EPSILON * abs(place)
            root = Root(place, max(place - reach, x), min(place + reach, y), None, False)
            if self._jumps(place, rank):
                values = self._spectra.values
                here = int(np.searchsorted(values, place))
                near = [v for v in values[max(here - 6, 0) : here + 7] if self.count(v) is not None]
                left = max((v for v in near if v <= place and (margin(v) > 0) == (margin(x) > 0)), default=x)
                right = min((v for v in near if v >= place and (margin(v) > 0) == (margin(y) > 0)), default=y)
                self._remark(f"a multiplier jumps across the circle at {self._parameter(place):.9g}", (left, right))
                continue
            if all(abs(place - other.place) > 4.0 * reach for other in roots) and self._is_critical(root):
                roots.append(root)
        if not roots and not self.spent and not self._settled & set(self._gaps(x, y)):
            self._remark(f"{after - before:+d} multipliers outside, and none found on the circle", (x, y))
        return roots

    def _bisected(self, x: float, y: float, before: int, after: int) -> list[Root]:
        """The root of a conservative family where the count changes: found by halving, as far as counts are certain."""
        gap = (x, y)
        while x < (middle := 0.5 * x + 0.5 * y) < y and self._spectra.left > 0:
            if not self._spectra.exists(middle) or (count := self.count(middle)) is None:
                break
            x, y = (middle, y) if count == before else (x, middle)
        for event in (Event.MINUS, Event.PLUS, Event.PAIR):
            root = Root(0.5 * x + 0.5 * y, x, y, event, False)
            if (x, y) != gap and self._is_critical(root) and self._explains(root, after - before):
                return [root]
        self._remark("multipliers leave the circle, or come back, and none were found to meet", (x, y))
        return []

    def _gaps(self, x: float, y: float) -> list[Interval]:
        inside = [v for v in self._spectra.values if x <= v <= y and self.count(v) is not None]
        return list(itertools.pairwise(inside))

    def _jumps(self, place: float, rank: int) -> bool:
        """Whether the multiplier of a rank is not continuous at a place: its change does not fall with the width."""
        values = self._spectra.values
        here = int(np.searchsorted(values, place))
        left = values[here - 1] if here > 0 else place
        right = next((v for v in values[here:] if v > place), place)
        width = max(right - left, 4.0 * float(np.spacing(abs(place))))
        wide_left = next((v for v in reversed(values[:here]) if place - v >= _WIDER * width), values[0])
        wide_right = next((v for v in values[here:] if v - place >= _WIDER * width), values[-1])
        small = abs(self._spectra.margins(right)[rank] - self._spectra.margins(left)[rank])
        large = abs(self._spectra.margins(wide_right)[rank] - self._spectra.margins(wide_left)[rank])
        errors = self._spectra.margin_errors(left)[rank] + self._spectra.margin_errors(right)[rank]
        return bool(small > _JUMP * large and small > _WIDER * errors)

    def _separated(self, inside: list[Root]) -> list[Root]:
        """Roots with a decided place between them; those without one made a single root."""
        roots = [inside[0]]
        for root in inside[1:]:
            last = roots[-1]
            middle = 0.5 * last.place + 0.5 * root.place
            if last.place < middle < root.place and self._spectra.exists(middle) and self.count(middle) is not None:
                roots.append(root)
                continue
            if last.touch != root.touch:
                roots[-1] = last if root.touch else root
            else:
                roots[-1] = Root(
                    last.place, min(last.left, root.left), max(last.right, root.right), last.event, last.touch
                )
        return roots

    def _tightened(self, root: Root, x: float, y: float) -> bool:
        """Whether places nearer to a root could be decided."""
        found = False
        for side, end in ((-1.0, x), (1.0, y)):
            reach = max(8.0 * float(np.spacing(abs(root.place))), root.right - root.left)
            while True:
                place = root.place + side * reach
                if not x < place < y or self._spectra.left <= 0 or abs(place - end) < 0.1 * reach:
                    break
                if self._spectra.exists(place) and self.count(place) is not None:
                    found = True
                    break
                reach *= _GROWTH
        return found


def _without_shadows(roots: list[Root]) -> list[Root]:
    """Roots without the touches that are but the uncertain surroundings of a crossing."""
    crossings = [root.place for root in roots if not root.touch]
    return [
        root
        for root in roots
        if not root.touch
        or not any(abs(place - root.place) <= _SHADOW * (root.right - root.left) for place in crossings)
    ]
