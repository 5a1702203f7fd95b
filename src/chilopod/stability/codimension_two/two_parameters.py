"""Curves of bifurcation points in two parameters.

The tracer (see :mod:`chilopod.stability.tracing.tracer`) follows them with the equations of :mod:`.bordered`, and
points of codimension two are located within each step (see :mod:`.detection`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from chilopod.errors import ParameterError
from chilopod.flows.arguments import finite_array
from chilopod.frozen import in_one_line
from chilopod.stability.codimension_two.bordered import CriticalCurve, Evaluated, Family2, Place, Spot
from chilopod.stability.codimension_two.curve2 import CodimensionTwo, Curve2, Point2, SpecialPoint2, Start2
from chilopod.stability.codimension_two.detection import Detector, Station
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.arguments import Budget, check_arguments, checked_box, system_of
from chilopod.stability.problem.capabilities import offers, sizes
from chilopod.stability.problem.returns import return_duration, whole_period
from chilopod.stability.symmetry.groups import reverses
from chilopod.stability.tracing.equations import Step
from chilopod.stability.tracing.tracer import Ending, trace

BUDGET = 20_000
"""Default budget of a curve, in return maps with derivatives."""

_MOVED = 1e-4  # largest correction of the start, relative to the box
_MEETINGS = CodimensionTwo.RESONANCE_1_1, CodimensionTwo.RESONANCE_1_2

Progress2 = Callable[[int, Point2], None]


def follow2(
    family2: Family2,
    start: BifurcationPoint | Start2,
    between: tuple[tuple[float, float], tuple[float, float]],
    *,
    second: float | None = None,
    rising: bool | None = None,
    points: int | None = 100,
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
        Point from :func:`chilopod.stability.locate` in the family of p with q = ``second``; or start from
        :func:`chilopod.stability.switch2`, which contains its q.
    between
        Intervals of both parameters, in which the family is called; their widths are the parameters' units.
    second
        Value of q at the start.
    rising
        True to start towards rising q, False towards falling q, None for both in one curve; unused from `switch2`.
    points
        Largest number of points in each direction; None for any number.
    step, longest
        First and largest step along the curve, in units of the box and of the states.
    coefficients
        True to compute normal forms, which are needed to find cusps and degenerate points.
    budget, seconds
        Number of return maps with derivatives, beside those of normal forms, and time in s, at which the curve ends.
    progress
        Called with the number of points and the newest one.

    A ParameterError refuses a Krein collision, and a pitchfork, transcritical or branch point that neither a symmetry
    nor a known orbit preserves; an AnalysisError says that no point of a curve is found at the start.
    """
    box = checked_box(between)
    check_arguments(family2=family2, points=points, step=step, longest=longest, budget=budget, progress=progress)
    check_arguments(coefficients=coefficients, rising=True if rising is None else rising)
    outward, periods = None, 1
    if isinstance(start, Start2):
        outward, periods, second = start.outward, start.periods, start.second
        family2, start = over_periods(family2, periods), start.point
    if not isinstance(start, BifurcationPoint):
        allowed = "a BifurcationPoint from `locate`, or a start from `switch2`"
        raise ParameterError("must be a located point", field="start", value=in_one_line(start), allowed=allowed)
    if second is None:
        raise ParameterError("must be given", field="second", allowed="the value of q at the start")
    values = np.array([start.value, finite_array(second, (), "second")], dtype=np.float64)
    if not ((box[:, 0] <= values) & (values <= box[:, 1])).all():
        raise ParameterError("must hold the start", field="between", value=between, allowed=f"around {values}")
    target, known = _what(family2, start, second)
    curve = CriticalCurve(family2, target, known, box, Budget(budget, seconds))
    nu = complex(start.multiplier)
    with curve.budget:
        first = curve.begin(Place(start.orbit, values, 0.0 if target else nu.real / abs(nu)), start.period)
        if outward is None and (np.abs(first.place.values - values) > _MOVED * np.ptp(box, axis=1)).any():
            said = f"is not that of the start: the nearest point of a curve is at {in_one_line(first.place.values)}"
            raise ParameterError(said, field="second", value=second, allowed="the q of the family of `locate`")
        detector = Detector(curve, start.kind, coefficients)
        origin = detector.station(first)

        if outward is not None:
            beside = Place(first.place.state + outward[:-2], first.place.values + outward[-2:], 0.0)
            ahead = float(first.frame.between(first.place, beside) @ first.tangent)
        else:
            ahead = float(first.tangent[first.frame.parameters][1]) * (-1.0 if rising is False else 1.0)
        after, before = (_Half(curve, detector, origin, progress) for _ in range(2))
        steps = min(step, longest), longest
        after.trace(first.towards(math.copysign(1.0, ahead)), steps, points)
        if after.ending is Ending.CLOSED:
            before.ending = Ending.CLOSED
        elif outward is None and rising is None:
            before.trace(first.towards(math.copysign(1.0, -ahead)), steps, points)
    found, endings = (*reversed(before.points), origin.point, *after.points), (before.ending, after.ending)
    return Curve2(start.kind, found, endings, (before.reason, after.reason), periods)


def over_periods(family2: Family2, periods: int) -> Family2:
    """Systems for orbits over several periods, or without their symmetry in time."""
    return lambda p, q: whole_period(family2(p, q), periods)


def _what(family2: Family2, start: BifurcationPoint, second: float) -> tuple[int, bool]:
    """The critical multiplier, 0 for a pair, and True if the orbit is known."""
    system = system_of(family2, start.value, second)
    if start.orbit.shape != (system.dimension,):
        raise ParameterError("must be a point of these systems", field="start", value=start.orbit.shape)
    if start.kind in (Kind.KREIN_COLLISION, Kind.HOPF):
        said, allowed = f"is of the kind {start.kind.label}, which is not followed", "a point of another kind"
        raise ParameterError(said, field="start", value=start.value, allowed=allowed)
    known = offers(system, "orbit") and start.kind is not Kind.FOLD
    if start.kind is Kind.NEIMARK_SACKER:
        return 0, known
    target = 1 if start.multiplier.real > 0.0 else -1
    kept = target < 0 or start.kind is Kind.FOLD or known
    if not (kept or reverses(system, start.mode, sizes(system, start.orbit, return_duration(system)))):
        said = f"is a {start.kind.label} that the second parameter unfolds"
        allowed = "a point that spatial_symmetry preserves, or systems with a known orbit"
        raise ParameterError(said, field="start", allowed=allowed)
    return target, known


_Looked = tuple[Station | None, list[SpecialPoint2]]
"""The station at the end of a step, if any, and the events within the step."""


@dataclass
class _Half:
    """Results of the tracer in one direction, without the start."""

    curve: CriticalCurve
    detector: Detector
    last: Station
    progress: Progress2
    points: list[Point2] = field(default_factory=list)
    ending: Ending = Ending.START
    reason: str = ""

    def trace(self, spot: Spot, steps: tuple[float, float], points: int | None) -> None:
        """Follow the curve from its first point, towards its tangent."""
        self.curve.first = spot
        self.ending, self.reason, _ = trace(self.curve, spot, steps, points, self.look, self.keep)

    def look(self, step: Step[Spot, Evaluated], ending: Ending | None) -> tuple[_Looked, Ending | None]:
        """Station at the end of a step, and events within it. The curve of a pair ends where the pair meets."""
        station, special = self.detector.station(step.end), []
        for spot, point in self.detector.events(step, self.last.signals, station.signals):
            special.append(point)
            if self.curve.target == 0 and point.kind in _MEETINGS:
                return (self.detector.station(spot), special), Ending.RESONANCE
        return (None if ending is Ending.CLOSED else station, special), ending

    def keep(self, found: _Looked, count: int) -> None:
        """Keep a step with its events."""
        station, special = found
        self.points += special
        if station is not None:
            self.points.append(station.point)
            self.last = station
            self.progress(count, station.point)
