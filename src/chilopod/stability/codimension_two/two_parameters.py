"""Curves of bifurcation points in two parameters: where a bifurcation goes as a second parameter changes.

A curve is followed by its arclength (see :mod:`~chilopod.stability.branches.branch` for that of orbits in one
parameter) with the equations of :mod:`.bordered`, and on the way the points of codimension two are located (see
:mod:`.detection`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability.codimension_two.bordered import Equations, Family2, Place, Spot, knows_orbit
from chilopod.stability.codimension_two.codimension2 import Codimension2, CodimensionTwo, Start2
from chilopod.stability.codimension_two.curve2 import Curve2, Point2
from chilopod.stability.codimension_two.detection import Detector, Signals, across, critical
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.budget import Budget
from chilopod.stability.problem.returns import return_duration, whole_period
from chilopod.stability.problem.scales import sizes
from chilopod.stability.symmetry.mirrored import reverses
from chilopod.stability.tracing.ending import Ending
from chilopod.stability.tracing.tracer import Pace, trace

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

BUDGET = 20_000
"""Return maps, with derivatives, that a curve may take by default."""

_FEW, _MANY = 7, 10  # corrections after which steps grow, and shrink
_SHARPEST_TURN = 0.9  # cosine between tangents at both ends of a step
_FARTHEST = 0.3  # of a step, from where it was predicted to end
_SAME = 1e-6  # of a step: how near a curve comes to its start to be closed

_MEETINGS = CodimensionTwo.RESONANCE_1_1, CodimensionTwo.RESONANCE_1_2

Progress2 = Callable[[int, Point2], None]


def follow2(
    family2: Family2,
    start: BifurcationPoint | Start2,
    between: tuple[tuple[float, float], tuple[float, float]],
    *,
    second: float | None = None,
    rising: bool | None = None,
    points: int = 100,
    step: float = 0.01,
    longest: float = 0.05,
    coefficients: bool = True,
    budget: int = BUDGET,
    seconds: float = math.inf,
    progress: Progress2 = lambda count, point: None,
) -> Curve2:
    """Follow a bifurcation point as two parameters change.

    Parameters
    ----------
    family2
        ``family2(p, q)`` is the system at values of both parameters.
    start
        A point that :func:`chilopod.stability.locate` found in the family of p with q = ``second``; or one that
        :func:`chilopod.stability.switch2` gives, from which the curve goes away from the point that it leaves, and
        which knows its q.
    between
        Intervals of both parameters: the box in which the curve is followed. Their widths are the parameters' units.
    second
        The value of q at the start.
    rising
        True to start towards rising or falling q; None for both, which makes one curve of the two halves. It means
        nothing for a curve that leaves another one.
    points
        At most so many, in each direction.
    step, longest
        First and largest step along the curve, in units of the box and of the states.
    coefficients
        True to compute normal forms, without which cusps and degenerate points are not found.
    budget, seconds
        Number of return maps with derivatives (normal forms have a budget of their own), and time in s, after which the
        curve ends.
    progress
        Called with the number of points and the newest one.

    Raises
    ------
    ParameterError
        If an argument is out of range; for a pitchfork, transcritical or branch point, if nothing keeps it one as
        both parameters change: neither a symmetry nor an orbit that the systems know; for a Krein collision.
    AnalysisError
        If no point of a curve is found at the start.
    """
    box = checked_box(between)
    for name, number in (("points", points), ("step", step), ("longest", longest), ("budget", budget)):
        if not number > 0:
            raise ParameterError("must be positive", field=name, value=number)
    outward, periods = None, 1
    if isinstance(start, Start2):
        outward, periods, second = start.outward, start.periods, start.second
        family2, start = over_periods(family2, periods), start.point
    if not isinstance(start, BifurcationPoint):
        raise ParameterError("is no located point", field="start", value=start, allowed="one that `locate` gives")
    if second is None:
        raise ParameterError("must be given", field="second", allowed="the value of q at the start")
    values = np.array([start.value, second], dtype=np.float64)
    if not ((box[:, 0] <= values) & (values <= box[:, 1])).all():
        raise ParameterError("does not hold the start", field="between", value=between, allowed=f"{values} within")
    target, known = _what(family2, start, second)
    equations = Equations(family2, target, known, box, Budget(budget, seconds))
    nu = complex(start.multiplier)
    with equations.budget:
        first = equations.begin(Place(start.orbit, values, 0.0 if target else nu.real / abs(nu)))
    curve, pace = _Critical(equations, start.kind, coefficients, progress), Pace(longest, _FEW, _MANY)
    origin = curve.station(first)
    if outward is not None:
        beside = Place(first.place.state + outward[:-2], first.place.values + outward[-2:], 0.0)
        along = float(first.frame.between(first.place, beside) @ first.tangent)
        half = curve.traced(origin, math.copysign(1.0, along), step, pace, points)
        joined = _joined(start.kind, origin, _Half((), (), Ending.START, ""), half)
        return replace(joined, periods=periods)
    upward = float(np.sign(first.tangent[first.frame.parameters][1]) or 1.0)
    signs = (1.0, -1.0) if rising is None else (1.0,) if rising else (-1.0,)
    halves = []
    for sign in signs:
        halves.append(curve.traced(origin, sign * upward, step, pace, points))
        if halves[-1].ending is Ending.CLOSED:
            return _joined(start.kind, origin, _Half((), (), Ending.CLOSED, ""), halves[-1])
    if rising is None:
        return _joined(start.kind, origin, halves[1], halves[0])
    return _joined(start.kind, origin, _Half((), (), Ending.START, ""), halves[0])


def checked_box(between: object) -> Array:
    """Intervals of both parameters, shape (2, 2)."""
    try:
        box = np.array(between, dtype=np.float64)
    except (TypeError, ValueError):
        box = np.zeros(0)
    if box.shape != (2, 2) or not (np.isfinite(box).all() and (box[:, 0] < box[:, 1]).all()):
        raise ParameterError(
            "must be two intervals", field="between", value=between, allowed="((p_low, p_high), (q_low, q_high))"
        )
    return box


def over_periods(family2: Family2, periods: int) -> Family2:
    """The same systems for orbits that take several periods, or do not have their symmetry in time."""
    return lambda p, q: whole_period(family2(p, q), periods)


def _what(family2: Family2, start: BifurcationPoint, second: float) -> tuple[int, bool]:
    """The critical multiplier, 0 for a pair, and whether the orbit is no unknown."""
    system = family2(start.value, second)
    if start.orbit.shape != (system.dimension,):
        raise ParameterError("is of another system", field="start", value=start.orbit.shape)
    if start.kind is Kind.KREIN_COLLISION:
        raise ParameterError("is a Krein collision, which is not followed", field="start", value=start.value)
    known = knows_orbit(system) and start.kind is not Kind.FOLD
    if start.kind is Kind.NEIMARK_SACKER:
        return 0, known
    target = 1 if start.multiplier.real > 0.0 else -1
    if target < 0 or start.kind is Kind.FOLD or known:
        return target, known
    if not reverses(system, start.mode, sizes(system, start.orbit, return_duration(system))):
        raise ParameterError(
            f"is a {start.kind.label} that two parameters would unfold",
            field="start",
            allowed="one that the systems' spatial_symmetry keeps, or systems that know their orbit",
        )
    return target, known


@dataclass(frozen=True)
class _Station:
    """A spot with what is said of it."""

    spot: Spot
    point: Point2
    signals: Signals


@dataclass(frozen=True)
class _Half:
    """A curve in one direction, without its start."""

    stations: tuple[_Station, ...]
    special: tuple[Codimension2, ...]
    ending: Ending
    reason: str


def _joined(kind: Kind, origin: _Station, before: _Half, after: _Half) -> Curve2:
    points = (*(each.point for each in reversed(before.stations)), origin.point)
    return Curve2(
        kind,
        (*points, *(each.point for each in after.stations)),
        (*reversed(before.special), *after.special),
        (before.ending, after.ending),
        (before.reason, after.reason),
    )


class _Advance(NamedTuple):
    """A step to a station, what happens within it, and why the curve ends with it, if it does."""

    station: _Station | None
    special: tuple[Codimension2, ...] = ()
    ending: Ending | None = None


class _Critical:
    """A curve of critical orbits that is being followed: see :class:`chilopod.stability.tracing.tracer.Traced`."""

    def __init__(self, equations: Equations, kind: Kind, coefficients: bool, progress: Progress2) -> None:
        self._equations = equations
        self._detector = Detector(equations, kind, coefficients)
        self._coefficients = coefficients
        self._progress = progress

    def station(self, spot: Spot) -> _Station:
        """A spot with what is said of it."""
        own = critical(self._equations.target, spot.at, spot.frame)
        form = None
        if self._coefficients and abs(spot.place.cosine) < 1.0:  # else the pair has met, and the curve has ended
            form = self._detector.form(own, spot.at, spot.frame, spot.shift)
        value, error = (np.nan, np.nan) if form is None else self._detector.coefficient(form)
        image = spot.at.image
        angle = abs(float(np.angle(own.multiplier**image.returns)))
        point = Point2(
            spot.place.values,
            across(spot) + 4.0 * np.finfo(float).eps * np.abs(spot.place.values),
            spot.place.state,
            own.mode,
            own.multiplier,
            own.spectrum.values,
            angle / image.period,
            None if np.isnan(value) else value,
            None if np.isnan(value) else error,
        )
        return _Station(spot, point, self._detector.measured(spot, own, form))

    def traced(self, origin: _Station, sign: float, size: float, pace: Pace, points: int) -> _Half:
        """The curve from its start on, along the tangent or against it."""
        self._last = replace(origin, spot=replace(origin.spot, tangent=sign * origin.spot.tangent))
        self._home = self._last.spot
        self._found: list[_Station] = []
        self._special: list[Codimension2] = []
        with self._equations.budget:
            ending, reason, _ = trace(self, min(size, pace.longest), pace, points, self._equations.budget)
        return _Half(tuple(self._found), tuple(self._special), ending, reason)

    def advance(self, size: float, count: int) -> tuple[_Advance, int]:
        """A step of some size, with what happens within it."""
        last = self._last
        new, corrections, edge = self._step(last.spot, size)
        if count > 2 and self._closes(last.spot, new, self._home):
            return _Advance(None, ending=Ending.CLOSED), corrections
        station = self.station(new)
        special: tuple[Codimension2, ...] = ()
        for _, spot, event in self._detector.between(last.spot, last.signals, new, station.signals):
            special += (event,)
            if self._equations.target == 0 and event.kind in _MEETINGS:
                return _Advance(self.station(spot), special, Ending.RESONANCE), corrections
        if np.array_equal(new.place.values, last.spot.place.values):
            return _Advance(None, special, Ending.LEFT_INTERVAL), corrections
        return _Advance(station, special, Ending.LEFT_INTERVAL if edge else None), corrections

    def arrive(self, step: _Advance, count: int) -> Ending | None:
        """Go on to the end of a step."""
        self._special += step.special
        if step.station is not None:
            self._found.append(step.station)
            self._last = step.station
            if step.ending is not Ending.RESONANCE:
                self._progress(count, step.station.point)
        return step.ending

    def _step(self, last: Spot, size: float) -> tuple[Spot, int, bool]:
        """The spot a step further, how many corrections it took, and whether it is on the edge of the box."""
        predicted = last.frame.moved(last.place, size * last.tangent)
        edge = self._edge(last.place, predicted)
        if edge is None:
            at, corrections = self._equations.corrected(last, predicted, last.tangent, size)
            _check_near(last, predicted, at.place, size)
            predicted = at.place
            edge = self._edge(last.place, predicted)
            if edge is None:
                return self._arrived(last, predicted), corrections, False
        place, corrections = self._on_edge(last, predicted, edge, size)
        edge = self._edge(last.place, place)
        if edge is not None:  # of the other parameter, and before
            place, corrections = self._on_edge(last, place, edge, size)
            if self._edge(last.place, place) is not None:
                raise AnalysisError("the step does not end within the box", field="step")
        return self._arrived(last, place), corrections, True

    def _edge(self, last: Place, place: Place) -> tuple[int, float, float] | None:
        """The edge that is crossed first on the way to a place: of which parameter, where, and after what share."""
        edges = []
        for j, (low, high) in enumerate(self._equations.box):
            value = float(place.values[j])
            if not low <= value <= high:
                bound = float(high if value > high else low)
                edges.append((j, bound, float((bound - last.values[j]) / (value - last.values[j]))))
        return min(edges, key=lambda edge: edge[2]) if edges else None

    def _on_edge(self, last: Spot, beyond: Place, edge: tuple[int, float, float], size: float) -> tuple[Place, int]:
        """The point of the curve on an edge of the box, which is crossed on the way to a place beyond."""
        j, bound, share = edge
        frame = last.frame
        row = np.zeros(last.tangent.size)
        row[frame.parameters.start + j] = 1.0
        guess = frame.moved(last.place, share * frame.between(last.place, beyond))
        target = (bound - float(last.place.values[j])) / float(frame.widths[j])
        at, corrections = self._equations.corrected(last, guess, row, target)
        _check_near(last, guess, at.place, size)
        if last.tangent @ frame.between(last.place, at.place) < 0.0:
            raise AnalysisError("the curve meets the edge of the box elsewhere", field="step")
        values = at.place.values.copy()
        values[j] = bound
        return replace(at.place, values=values), corrections

    def _arrived(self, last: Spot, place: Place) -> Spot:
        new = self._equations.spot(place, last.frame, last.tangent)
        before = new.frame.carried(last.tangent, last.frame)
        if new.tangent @ before < _SHARPEST_TURN * np.linalg.norm(before):
            raise AnalysisError("the curve turns too sharply", field="step")
        return new

    def _closes(self, last: Spot, new: Spot, home: Spot) -> bool:
        """True if the start of the curve lies within the step from one spot to the next."""
        frame = last.frame
        # The same orbit may be met at another instant where the system does not depend on time.
        seen = slice(frame.parameters.start if frame.section is not None else 0, None)
        tangent = last.tangent[seen]
        if tangent @ frame.carried(home.tangent, home.frame)[seen] <= 0.0:
            return False
        whole = frame.between(last.place, new.place)
        length = float(last.tangent @ whole)

        def ahead(start: Place) -> float:
            return float(tangent @ frame.between(start, home.place)[seen])

        if ahead(last.place) <= 0.0 or ahead(new.place) > 0.0:
            return False
        if np.linalg.norm(frame.between(last.place, home.place)[seen]) > 2.0 * length:
            return False

        def at(place: float) -> Place:
            guess = frame.moved(last.place, whole * (place / length))
            return self._equations.corrected(last, guess, last.tangent, place)[0].place

        nearest = at(float(brentq(lambda place: ahead(at(place)), 0.0, length, xtol=1e-12 * length)))
        return bool(np.abs(frame.between(nearest, home.place)[seen]).max() <= _SAME * length)


def _check_near(last: Spot, predicted: Place, place: Place, size: float) -> None:
    if np.linalg.norm(last.frame.between(predicted, place)) > _FARTHEST * size:
        raise AnalysisError("the step ends far from where it was predicted to, perhaps on another curve", field="step")
