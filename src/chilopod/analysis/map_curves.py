"""Curves of bifurcations of the straight walk through a map.

Neighbours on the grid that differ in the number of unstable multipliers are an :class:`Edge`. The :class:`Search` takes
an edge that no curve crosses yet, locates the bifurcation on it, continues that as a curve through the plane, and goes
on with the edges that are left. Where a pitchfork turns subcritical, the folds of the curved walks begin, which are
continued too if they are wanted. Along an axis of modules, which are whole, every edge has a point of its own.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod import stability
from chilopod.analysis.branch import TOLERANCE
from chilopod.analysis.map_axes import Plane
from chilopod.analysis.map_grid import Grid
from chilopod.analysis.straight_walk import coefficient_of
from chilopod.errors import ChilopodError
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.planar import PlanarModel
from chilopod.planar.along import FollowedModel
from chilopod.progress import Progress
from chilopod.stability import BifurcationPoint, CodimensionTwo, Curve2, Ending, Kind, Point2, follow2, switch2
from chilopod.stability.points import WITHOUT_CRITICALITY

_LONGEST = 0.04  # step along a curve, in units of the box
_MOST = 12  # curves
_COVERED = 1.5  # cells between an edge of the grid and the curve that crosses it
_ON = 0.1  # cells between a curve and a point on it
_FOLD_TOLERANCE = 1e-12  # of the flow; a fold is known to about its square root
_FOLD_POINTS = 100
_PIECES, _PIECE = 12, 5  # parts in which a branch is followed to its fold, and points of each
_ON_CIRCLE = 1.0 + 1e-6  # modulus of a critical multiplier, at most
_CUT_OFF = {Ending.LOST, Ending.BUDGET, Ending.ENOUGH_POINTS}


@dataclass(frozen=True, eq=False)
class MapPoint(ReadOnlyArrays):
    """A point where two conditions hold at once: kind, values of both numbers, SI, and error bounds, shape (2,)."""

    kind: CodimensionTwo
    values: Array
    error_bound: Array


@dataclass(frozen=True, eq=False)
class MapCurve(ReadOnlyArrays):
    """Bifurcation points of the straight walk, or folds of the curved walks: ``values`` of both numbers, SI, and bounds
    on their errors, shape (points, 2), which follow each other on a ``line``, or each belong to a number of modules;
    with ``special`` points of codimension two on the curve. ``coefficient`` is the cubic one of the normal form for an
    amplitude of joint angles, 1/rad^2, negative where it is supercritical, shape (points,). NaN where it is not known,
    and of transcritical points, which have none."""

    kind: Kind
    values: Array
    error_bound: Array
    coefficient: Array
    special: tuple[MapPoint, ...] = ()
    line: bool = True


@dataclass(frozen=True)
class Edge:
    """Two computed neighbours on the finest grid, at row j and column i and the next column (across) or row, and the
    difference of their numbers of unstable multipliers."""

    j: int
    i: int
    across: bool
    jump: int

    def ordered(self, along: Any, other: Any) -> tuple[Any, Any]:
        """Parts of the number that changes along it, and of the other number, in the order of the map's axes."""
        return (along, other) if self.across else (other, along)


@dataclass
class Search:
    """Search for the curves of a map: those found so far, sentences about those that may be missing, and numbers of
    pitchforks whose folds are ``lost``."""

    plane: Plane
    grid: Grid
    with_folds: bool
    progress: Progress
    curves: list[MapCurve] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    lost: list[int] = field(default_factory=list)
    _tried: set[Edge] = field(default_factory=set)

    def run(self) -> None:
        """Find a curve for every two neighbours that differ; along an axis of modules, points."""
        if self.plane.x.whole or self.plane.y.whole:
            self._points()
            return
        left = self._uncovered(self._edges())
        while left and len(self.curves) < _MOST:
            edge = left[len(left) // 2]
            self._tried.add(edge)
            known = [*self.curves]
            for point in self._located(edge):
                place = self._indices(np.array(edge.ordered(point.value, self._beside(edge))))
                if not any(c.kind is point.kind and _distance(self._indices(c.values), place) < _ON for c in known):
                    self._follow(point, edge)
            left = self._uncovered(left)
        if left:
            self.remarks.append(f"{_MOST} curves are followed; {len(left)} more places where a mode turns are left")

    def cells(self) -> NDArray[np.bool_]:
        """Cells of the finest grid through which the curves pass, shape (rows - 1, columns - 1)."""
        rows, columns = self.grid.computed.shape
        found = np.zeros((rows - 1, columns - 1), dtype=bool)
        for curve in self.curves:
            if curve.line and curve.kind is not Kind.FOLD:
                for start, end in pairwise(self._indices(curve.values)):
                    count = int(np.ceil(4.0 * np.abs(end - start).max())) + 1
                    i, j = np.floor(start + (end - start) * np.linspace(0.0, 1.0, count)[:, None]).astype(int).T
                    found[np.clip(j, 0, rows - 2), np.clip(i, 0, columns - 2)] = True
        return found

    def _points(self) -> None:
        """Points at every number of modules, one set for each kind, with the folds that begin there."""
        by_kind: dict[Kind, list[tuple[Array, Array, float]]] = {}
        for edge in self._edges():
            if edge.across is not self.plane.y.whole:  # along it the number of modules changes
                continue
            points, beside = self._located(edge, normal_form=True), self._beside(edge)
            stable = 0 in self.grid.unstable[edge.j : edge.j + 2 - edge.across, edge.i : edge.i + 1 + edge.across]
            for point in [*points] if self.with_folds and stable else ():
                if point.kind is Kind.PITCHFORK and (point.coefficient or 0.0) > 0.0:
                    points += self._fold(edge, point, point.value, beside, 1)
            for point in points:
                place = np.array(edge.ordered(point.value, beside))
                error = np.array(edge.ordered(point.error_bound, 0.0))
                by_kind.setdefault(point.kind, []).append((place, error, self._coefficient(point.kind, point, place)))
        for kind, found in by_kind.items():
            values, errors, coefficients = (np.array(column) for column in zip(*found, strict=True))
            self.curves.append(MapCurve(kind, values, errors, coefficients, line=False))

    def _edges(self) -> list[Edge]:
        """Neighbours that differ in the number of unstable multipliers."""
        count, found = self.grid.unstable, []
        for across in (True, False):
            one, other = (count[:, :-1], count[:, 1:]) if across else (count[:-1], count[1:])
            places = np.argwhere((one >= 0) & (other >= 0) & (one != other))
            found += [Edge(int(j), int(i), across, int(abs(one[j, i] - other[j, i]))) for j, i in places]
        return found

    def _uncovered(self, edges: list[Edge]) -> list[Edge]:
        """Edges whose difference no curves beside them explain, and that are not beside a like one that was tried."""
        lines = [(each.kind, self._indices(each.values)) for each in self.curves if each.kind is not Kind.FOLD]

        def covered(edge: Edge) -> bool:
            middle = np.array([edge.i + 0.5 * edge.across, edge.j + 0.5 * (not edge.across)])
            if any(np.abs(middle - (e.i, e.j)).max() <= _COVERED for e in self._tried if e.jump == edge.jump):
                return True
            near = [kind for kind, line in lines if _distance(line, middle) <= _COVERED]
            # One multiplier passes the unit circle on a curve, or a pair.
            single = len(near) - (pairs := near.count(Kind.NEIMARK_SACKER))
            return edge.jump % 2 <= single and edge.jump <= single + 2 * pairs

        return [edge for edge in edges if not covered(edge)]

    def _indices(self, values: Array) -> Array:
        """Columns and rows, in fractions, of SI values of both numbers."""
        ends = np.array([[axis[0], axis[-1]] for axis in (self.grid.x, self.grid.y)])
        sizes = np.array([self.grid.x.size - 1, self.grid.y.size - 1])
        return np.asarray((values - ends[:, 0]) / (ends[:, 1] - ends[:, 0]) * sizes)

    def _beside(self, edge: Edge) -> float:
        """Value of the number that does not change along an edge, SI."""
        return float(self.grid.y[edge.j] if edge.across else self.grid.x[edge.i])

    def _located(self, edge: Edge, normal_form: bool = False) -> list[BifurcationPoint]:
        """Bifurcations on an edge."""
        values, first = (self.grid.x, edge.i) if edge.across else (self.grid.y, edge.j)
        beside, ends = self._beside(edge), (float(values[first]), float(values[first + 1]))

        def family(value: float) -> PlanarModel:
            return self.plane.model(*edge.ordered(value, beside))

        try:
            return list(stability.locate(family, ends, normal_form=normal_form))
        except ChilopodError as error:
            self.remarks.append(f"a bifurcation between two neighbours is not located: {error.problem}")
            return []

    def _fold(self, edge: Edge, at: BifurcationPoint | Point2, p: float, q: float, n: int) -> list[BifurcationPoint]:
        """Fold, if it is on the map, of the curved walks that leave one of n subcritical pitchforks along an edge."""

        def family(value: float) -> PlanarModel:
            return FollowedModel(self.plane.at(*edge.ordered(value, q)), TOLERANCE)

        fork = BifurcationPoint(Kind.PITCHFORK, p, 0.0, at.orbit, at.mode, at.multiplier, 0.0, period=at.period)
        ends, *_ = edge.ordered(*self._box())
        with suppress(ChilopodError):
            branch: Any = stability.switch(family, fork)[0]  # the other is its mirror image
            for _ in range(_PIECES):
                branch = stability.follow(family, branch, ends, points=_PIECE, closely=False, precision=TOLERANCE)
                folds = [each.bifurcation for each in branch.points if each.special is Kind.FOLD]
                if folds:
                    return folds[:1]
        self.lost.append(n)
        return []

    def _follow(self, point: BifurcationPoint, edge: Edge) -> None:
        """Continue a curve through a located point, and the folds that begin on it."""
        between = edge.ordered(*self._box())
        how: dict[str, Any] = {"between": between, "longest": _LONGEST}
        how["progress"] = lambda count, point: self.progress(0.5, f"curve {len(self.curves) + 1}, {count} points")
        few: dict[str, Any] = {**how, "points": _FOLD_POINTS, "coefficients": False}

        def family(p: float, q: float) -> PlanarModel:
            return self.plane.model(*edge.ordered(p, q))

        def loose(p: float, q: float) -> PlanarModel:
            return FollowedModel(family(p, q).robot, _FOLD_TOLERANCE, use_symmetry=False)

        try:
            curve = follow2(family, point, second=self._beside(edge), points=400, **how)
            self._add(curve, edge)
            turns = [each for each in curve.special if each.kind is CodimensionTwo.DEGENERATE_PITCHFORK]
            if not self.with_folds:
                return
            for turn in turns:
                # Both starts are mirror images of one curve.
                self._add(follow2(loose, switch2(family, turn, between)[0], **few), edge, turn)
            leading = [each for each in curve.points if np.abs(each.multipliers).max() < _ON_CIRCLE]
            subcritical = [each for each in leading if (each.coefficient or 0.0) > 0.0]
            if curve.kind is Kind.PITCHFORK and subcritical and not turns:
                middle = subcritical[len(subcritical) // 2]
                p, q = middle.values.tolist()
                for fold in self._fold(edge, middle, p, q, len(subcritical)):
                    self._add(follow2(loose, fold, second=q, **few), edge)
        except ChilopodError as error:
            begun = f"a curve that begins at a {point.kind.label}"
            self.remarks.append(f"{begun} is not followed to its end: {error.problem}")

    def _add(self, curve: Curve2, edge: Edge, *begin: Any) -> None:
        """Keep a curve in the order of the map's axes, from where it begins, and say where it ends before it should."""
        order = [*edge.ordered(0, 1)]
        special = tuple(MapPoint(each.kind, each.values[order], each.error_bound[order]) for each in curve.special)
        coefficients = [self._coefficient(curve.kind, each, each.values[order]) for each in curve.points]
        points = [(each.values[order], each.error_bound[order]) for each in (*begin, *curve.points)]
        values, errors = (np.array(column) for column in zip(*points, strict=True))
        coefficient = np.array([np.nan] * len(begin) + coefficients)
        self.curves.append(MapCurve(curve.kind, values, errors, coefficient, special))
        for ending in dict.fromkeys(each for each in curve.endings if each in _CUT_OFF):
            why = f"after {len(curve.points)} points" if ending is Ending.ENOUGH_POINTS else ending.sentence
            self.remarks.append(f"a curve of {curve.kind.label} points ends on the map: {why}")

    def _coefficient(self, kind: Kind, point: BifurcationPoint | Point2, place: Array) -> float:
        """Cubic coefficient for an amplitude of joint angles, as of one robot; NaN if there is none."""
        found = coefficient_of(point, self.plane.at(*place.tolist()).body.modules)
        # That of a curve without criticality is quadratic, and changes its sign with the mode.
        return np.nan if found is None or kind in WITHOUT_CRITICALITY else found

    def _box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Part of the plane in which there are results."""
        rows, columns = np.nonzero(self.grid.unstable >= 0)
        x, y = self.grid.x[[columns.min(), columns.max()]], self.grid.y[[rows.min(), rows.max()]]
        return (float(x[0]), float(x[1])), (float(y[0]), float(y[1]))


def _distance(line: Array, point: Array) -> float:
    """Distance of a point from a line of straight pieces."""
    start, along = line[:-1], np.diff(line, axis=0)
    if not len(start):
        return float(np.linalg.norm(line - point, axis=1).min())
    length = np.maximum((along**2).sum(1), 1e-300)
    part = np.clip(((point - start) * along).sum(1) / length, 0.0, 1.0)
    return float(np.linalg.norm(start + part[:, None] * along - point, axis=1).min())
