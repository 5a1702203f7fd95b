"""Curves of bifurcation points in two parameters, and curves of folds that leave points of codimension two.

The tracer (see :mod:`chilopod.stability.continuation.tracer`) follows them with the equations of :mod:`.bordered`, and
points of codimension two are located within each step (see :mod:`.detection`).

Where the cubic coefficient c of a -> (1 + b) a + c a^3 + e a^5 vanishes on a curve of period doublings or pitchforks
(b = 0), the orbits that branch off have folds at c = -2 e a^2, b = e a^4, the curve b = c^2 / (4 e) (Kuznetsov,
*Elements of Applied Bifurcation Theory*, section 9.3; Govaerts, Ghaziani, Kuznetsov & Meijer, SIAM J. Sci. Comput. 29,
2007). How b and c change with the parameters is measured, and the fold so predicted at some amplitude is corrected.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.arguments import UserCode, check_arguments, checked_box, finite_array
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array, in_one_line
from chilopod.stability.codimension_two.bordered import CriticalCurve, Evaluated, Family2, Place, Spot
from chilopod.stability.codimension_two.curve2 import CodimensionTwo, Curve2, Point2, SpecialPoint2, Start2
from chilopod.stability.codimension_two.detection import Critical, Detector, Station, across
from chilopod.stability.continuation.equations import Step
from chilopod.stability.continuation.tracer import Ending, trace
from chilopod.stability.crossing_place import orbit_blocks
from chilopod.stability.equilibria import SHRINKS
from chilopod.stability.interface import SystemLike, offers, sizes, system_of, with_shared_symmetries
from chilopod.stability.orbits.orbit import find_orbit
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.returns import event_beside, return_duration, returned_states, section_at, whole_period
from chilopod.stability.symmetry.groups import reverses

BUDGET = 20_000  # default budget of a curve, in return maps with derivatives
_MOVED = 1e-4  # largest correction of the start, relative to the box, and of its orbit, relative to the states
_MEETINGS = CodimensionTwo.RESONANCE_1_1, CodimensionTwo.RESONANCE_1_2

Progress2 = Callable[[int, Point2], None]


@with_shared_symmetries
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
        family2, start = _over_periods(family2, periods), start.point
    if not isinstance(start, BifurcationPoint):
        allowed = "a BifurcationPoint from `locate`, or a start from `switch2`"
        raise ParameterError("must be a located point", field="start", value=in_one_line(start), allowed=allowed)
    if second is None:
        raise ParameterError("must be given", field="second", allowed="the value of q at the start")
    values = np.array([start.value, finite_array(second, (), "second")], dtype=np.float64)
    if not ((box[:, 0] <= values) & (values <= box[:, 1])).all():
        raise ParameterError("must hold the start", field="between", value=between, allowed=f"around {values}")
    if outward is None:
        family2, periods = _over_its_periods(family2, values, start.orbit, start.period)
    target, known = _target(family2, start, second)
    curve = CriticalCurve(family2, target, known, box, Budget(budget, seconds))
    if start.kind is Kind.FOLD:
        curve.shrinks = f"{SHRINKS}: a Bautin point (generalised Hopf)"
    nu = complex(start.multiplier)
    with curve.budget:
        if target == 0 and start.multiplicity > 2:
            _keep_one(curve, curve.system(values), start)
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
        wanted, sign = ((min(step, longest), longest), points, progress), math.copysign(1.0, ahead)
        after, last, why = _followed(detector, origin._replace(spot=first.towards(sign)), *wanted)
        before, begin, whence = list[Point2](), Ending.CLOSED if last is Ending.CLOSED else Ending.START, ""
        if begin is Ending.START and outward is None and rising is None:
            before, begin, whence = _followed(detector, origin._replace(spot=first.towards(-sign)), *wanted)
    return Curve2(start.kind, (*reversed(before), origin.point, *after), (begin, last), (whence, why), periods)


def _over_periods(family2: Family2, periods: int) -> Family2:
    """Systems for orbits over several periods, or without their symmetry in time."""
    return lambda p, q: whole_period(family2(p, q), periods)


def _over_its_periods(family2: Family2, values: Array, orbit: Array, period: float) -> tuple[Family2, int]:
    """Systems for the orbits of a point, and the number of their periods in one period of these."""
    system = system_of(family2, *values.tolist())
    if not np.isfinite(period) or orbit.shape != (system.dimension,):
        return family2, 1
    periods, duration = max(1, round(period / (system.period or period))), return_duration(system, period)
    whole = periods > 1
    if system.symmetry is not None and not whole:
        back = returned_states(system, orbit[None], section_at(system, orbit, duration=duration))[0]
        whole = bool((np.abs(back - orbit) > _MOVED * sizes(system, orbit, duration)).any())
    return (_over_periods(family2, periods) if whole else family2), periods


def _target(family2: Family2, start: BifurcationPoint, second: float) -> tuple[int, bool]:
    """The target of the curve, a critical multiplier +1 or -1, or 0 for a pair; and True if the orbit is known."""
    system = system_of(family2, start.value, second)
    if start.orbit.shape != (system.dimension,):
        raise ParameterError("must be a point of these systems", field="start", value=start.orbit.shape)
    if start.kind in (Kind.KREIN_COLLISION, Kind.HOPF):
        said, allowed = "must be of a kind that is followed", "a point of another kind"
        raise ParameterError(said, field="start", value=start.kind.label, allowed=allowed)
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


def _keep_one(curve: CriticalCurve, system: SystemLike, start: BifurcationPoint) -> None:
    """Reduce the equations to one of several pairs, which a symmetry of the orbit makes equal: the first coordinate of
    its representation in every copy."""
    for block in orbit_blocks(system, find_orbit(system, None if curve.known else start.orbit, settle=False))[0]:
        if block is None or 2 * block.repeats != start.multiplicity:
            continue
        if np.allclose(block.basis @ (block.dual @ start.mode), start.mode):
            rest = np.arange(block.basis.shape[1]) % block.dimension > 0
            curve.copies = block.repeats
            curve.single = np.eye(start.mode.size) - block.basis[:, rest] @ block.dual[rest]
            return
    said = f"has {start.multiplicity // 2} critical pairs that no spatial symmetry makes equal"
    raise ParameterError(said, field="start", allowed="a point with a single pair, or spatial_symmetry")


_Looked = tuple[Station | None, list[SpecialPoint2]]  # the station at the end of a step, if any, and its events


def _followed(
    detector: Detector, origin: Station, steps: tuple[float, float], points: int | None, progress: Progress2
) -> tuple[list[Point2], Ending, str]:
    """The points after the first one of a curve, towards the tangent there, its ending, and the reason."""
    curve, kept, last = detector.curve, list[Point2](), origin
    curve.first = origin.spot

    def look(step: Step[Spot, Evaluated], ending: Ending | None) -> tuple[_Looked, Ending | None]:
        """Station at the end of a step, and events within it. The curve of a pair ends where the pair meets."""
        station, special = detector.station(step.end), []
        for spot, point in detector.events(step, last.signals, station.signals):
            special.append(point)
            if curve.target == 0 and point.kind in _MEETINGS:
                return (detector.station(spot), special), Ending.RESONANCE
        return (None if ending is Ending.CLOSED else station, special), ending

    def keep(found: _Looked, count: int) -> None:
        nonlocal last
        station, special = found
        kept.extend(special)
        if station is not None:
            kept.append(station.point)
            last = station
            with UserCode("progress"):
                progress(count, station.point)

    ending, reason, _ = trace(curve, origin.spot, steps, points, look, keep)
    if ending is Ending.LOST:
        end = last.spot

        def ahead(distance: float) -> tuple[SystemLike, Array]:
            there = end.frame.moved(end.place, distance * end.tangent)
            return curve.system(there.values), there.state

        about = curve.system(end.values), end.place.state, end.image.duration
        if reason.startswith("step:") and curve.meets(end):
            reason = _TIP
        reason = event_beside(*about, ahead) or reason
    return kept, ending, reason


_TIP = "the equations are singular here, as beside another curve, or in a continuum at the tip of an Arnold tongue"
_BESIDE = 1e-3  # step of differences of the cubic coefficient, in units of the box and of the states
_FARTHEST = 0.1  # largest distance of a fold along the curve, in the same units
_HALVINGS = 12  # halvings of the amplitude
_NEAR = 0.25  # largest error of a predicted fold, relative to the amplitude and its distance from the point

_OTHERS = {
    CodimensionTwo.CUSP: "is a cusp: the curve of folds itself goes through it",
    CodimensionTwo.CHENCINER: "is a Chenciner point: folds of tori leave it, which cannot be followed",
}


def switch2(
    family2: Family2,
    point: SpecialPoint2,
    between: tuple[tuple[float, float], tuple[float, float]],
    *,
    budget: int = BUDGET,
    seconds: float = math.inf,
) -> tuple[Start2, ...]:
    """The starts of the curves of folds that leave a point of codimension two, for :func:`chilopod.stability.follow2`.

    Parameters
    ----------
    family2, between
        Arguments of the :func:`chilopod.stability.follow2` that found the point.
    point
        Generalised period doubling or degenerate pitchfork, among the ``special`` points of its curve; an AnalysisError
        if its coefficient of fifth order is zero within its error, or no fold is found near its prediction.
    budget, seconds
        Largest number of return maps with derivatives, and time in s.

    Returns
    -------
    A generalised period doubling has one start, at a fold of orbits of twice the period; a degenerate pitchfork has
    two, at folds of the orbits that branch off along the critical mode and against it.
    """
    box = checked_box(between)
    if not isinstance(point, SpecialPoint2):
        said, allowed = "must be a point of codimension two", "one of the `special` points of a curve from `follow2`"
        raise ParameterError(said, field="point", value=point, allowed=allowed)
    flips = point.kind is CodimensionTwo.GENERALISED_PERIOD_DOUBLING
    if not flips and point.kind is not CodimensionTwo.DEGENERATE_PITCHFORK:
        why = _OTHERS.get(point.kind, f"is a {point.kind.label} point, from which no curve can be followed")
        raise ParameterError(why, field="point", allowed="a generalised period doubling or a degenerate pitchfork")
    check_arguments(family2=family2, budget=budget)
    allowed = Budget(budget, seconds)
    family2, periods = _over_its_periods(family2, point.values, point.orbit, point.period)
    times, signs = (2, (1.0,)) if flips else (1, (1.0, -1.0))
    folds = CriticalCurve(_over_periods(family2, times), 1, False, box, allowed)
    with allowed:
        there = _Unfolding(family2, point, box, allowed)
        found = [_start(there, folds, sign, times) for sign in signs]
    return tuple(replace(each, periods=periods * times) for each in found)


class _Unfolding:
    """Unfolding of a degenerate point on a curve: terms of fifth order, and changes of coefficient and multiplier."""

    def __init__(self, family2: Family2, point: SpecialPoint2, box: Array, budget: Budget) -> None:
        system = system_of(family2, *point.values.tolist())
        flips = point.kind is CodimensionTwo.GENERALISED_PERIOD_DOUBLING
        targets = (-1,) if flips else (1,) if system.symmetry is None else (1, -1)
        target = min(targets, key=lambda one: float(np.abs(point.multipliers - one).min()))
        self._equations = curve = CriticalCurve(family2, target, offers(system, "orbit"), box, budget)
        # For a point on the edge of the box the other side is used.
        curve.box = box + 2.0 * _FARTHEST * curve.widths[:, None] * [-1.0, 1.0]
        self.spot = spot = curve.begin(Place(point.orbit, point.values, 0.0), point.period)
        here = Critical(curve, spot)
        beside = [Critical(curve, curve.along(spot, size)) for size in (-_BESIDE, _BESIDE)]
        low, high = (each.form for each in beside)
        if not abs(high.cubic - low.cubic) > low.cubic_error + high.cubic_error:
            raise AnalysisError("the cubic coefficient does not change measurably along the curve", field="point")
        fifth = here.fifth(*beside)
        if fifth is None:
            raise AnalysisError("no coefficient of fifth order was found", field="point")
        if abs(fifth.coefficient) <= fifth.error:
            raise AnalysisError("the coefficient of fifth order is zero within its error", field="point")
        self.at, self.fifth = here.orbit, fifth
        self._slope = (high.cubic - low.cubic) / (2.0 * _BESIDE)  # by the length of ``spot.tangent``
        self._response = _response(spot, target)

    def fold(self, a: float) -> Place:
        """Predicted place of a fold at an amplitude along the mode, negative against it; AnalysisError if too far."""
        spot, fifth = self.spot, self.fifth
        away = -2.0 * fifth.coefficient * a * a / self._slope
        aside = fifth.coefficient * a**4 / self.at.times * self._response
        if not (abs(away) <= _FARTHEST and np.abs(aside).max() <= _FARTHEST):
            raise AnalysisError("the fold is predicted too far from the point", field="point")
        place = spot.frame.moved(self._equations.along(spot, away).place, aside)
        bent = self.at.displacements(fifth.curve, np.array(a, dtype=np.complex128))
        return Place(place.state + bent, place.values, 0.0)


def _response(spot: Spot, target: int) -> Array:
    """Change of orbit and parameters with the multiplier's modulus; g changes by -(w . v) times the multiplier's."""
    m = spot.frame.basis.shape[1]
    matrix, overlap = spot.matrix, float(spot.left[:, 0] @ spot.right[:, 0])
    orbit = -np.linalg.solve(matrix[:m, :m], matrix[:m, m:])
    modulus = -target / overlap * (matrix[m, m:] + matrix[m, :m] @ orbit)
    along = modulus / float(modulus @ modulus)
    return np.concatenate([orbit @ along, along])


def _start(there: _Unfolding, folds: CriticalCurve, sign: float, periods: int) -> Start2:
    """The fold at the largest amplitude at which it is found near its prediction."""
    left, widths = there.at.left.real, there.spot.frame.widths
    cause: Exception | None = None
    for k in range(_HALVINGS):
        amplitude = there.fifth.amplitude * 0.5**k
        try:
            place = there.fold(sign * amplitude)
            found = folds.begin(place, periods * there.spot.image.period)
        except (AnalysisError, ArithmeticError, ValueError) as error:
            cause = error
            continue
        values, origin = found.values, there.spot.place
        off = abs(float(left @ (found.place.state - place.state))) / amplitude
        missed, way = (float(np.linalg.norm((values - one) / widths)) for one in (place.values, origin.values))
        inside = (folds.box[:, 0] <= values) & (values <= folds.box[:, 1])
        if off <= _NEAR and missed <= _NEAR * way and inside.all():
            outward = np.concatenate([place.state - origin.state, place.values - origin.values])
            value, bound, state = float(values[0]), float(across(found)[0]), found.place.state
            mode, period = Critical(folds, found).orbit.right, found.image.period
            fold = BifurcationPoint(Kind.FOLD, value, bound, state, mode, 1.0 + 0j, 0.0, period=period)
            return Start2(fold, float(values[1]), outward, periods)
    raise AnalysisError("no curve of folds was found where one is predicted to leave", field="point") from cause
