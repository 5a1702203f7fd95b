"""Curves of folds that leave points of codimension two.

Where the cubic coefficient c of a -> (1 + b) a + c a^3 + e a^5 vanishes on a curve of period doublings or pitchforks
(b = 0), the orbits that branch off have folds at c = -2 e a^2, b = e a^4, the curve b = c^2 / (4 e) (Kuznetsov,
*Elements of Applied Bifurcation Theory*, section 9.3; Govaerts, Ghaziani, Kuznetsov & Meijer, SIAM J. Sci. Comput. 29,
2007). How b and c change with the parameters is measured, and the fold so predicted at some amplitude is corrected.
"""

from __future__ import annotations

import math

import numpy as np

from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array
from chilopod.stability.codimension_two.bordered import CriticalCurve, Family2, Place, Spot
from chilopod.stability.codimension_two.curve2 import CodimensionTwo, SpecialPoint2, Start2
from chilopod.stability.codimension_two.detection import Critical, Detector, across
from chilopod.stability.codimension_two.two_parameters import BUDGET, over_periods
from chilopod.stability.normal_forms.center_manifold import displacements
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.arguments import Budget, check_arguments, checked_box, system_of
from chilopod.stability.problem.capabilities import offers

_BESIDE = 1e-3  # step of differences of the cubic coefficient, in units of the box and of the states
_FARTHEST = 0.1  # largest distance of a fold along the curve, in the same units
_HALVINGS = 12  # halvings of the amplitude
_NEAR = 0.25  # largest error of a predicted fold, relative to the amplitude and its distance from the point

_CURVES = {
    CodimensionTwo.GENERALISED_PERIOD_DOUBLING: Kind.PERIOD_DOUBLING,
    CodimensionTwo.DEGENERATE_PITCHFORK: Kind.PITCHFORK,
}
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
    kind = _CURVES.get(point.kind)
    if kind is None:
        why = _OTHERS.get(point.kind, f"is a {point.kind.label} point, from which no curve can be followed")
        raise ParameterError(why, field="point", allowed="a generalised period doubling or a degenerate pitchfork")
    check_arguments(family2=family2, budget=budget)
    allowed = Budget(budget, seconds)
    periods = 2 if kind is Kind.PERIOD_DOUBLING else 1
    folds = CriticalCurve(over_periods(family2, periods), 1, False, box, allowed)
    signs = (1.0,) if kind is Kind.PERIOD_DOUBLING else (1.0, -1.0)
    with allowed:
        there = _Unfolding(family2, point, kind, box, allowed)
        return tuple(_start(there, folds, sign, periods) for sign in signs)


class _Unfolding:
    """Unfolding of a degenerate point on a curve: terms of fifth order, and changes of coefficient and multiplier."""

    def __init__(self, family2: Family2, point: SpecialPoint2, kind: Kind, box: Array, budget: Budget) -> None:
        system = system_of(family2, *point.values.tolist())
        targets = (-1,) if kind is Kind.PERIOD_DOUBLING else (1,) if system.symmetry is None else (1, -1)
        target = min(targets, key=lambda one: float(np.abs(point.multipliers - one).min()))
        self._equations = curve = CriticalCurve(family2, target, offers(system, "orbit"), box, budget)
        # For a point on the edge of the box the other side is used.
        curve.box = box + 2.0 * _FARTHEST * curve.widths[:, None] * [-1.0, 1.0]
        self.spot = spot = curve.begin(Place(point.orbit, point.values, 0.0), point.period)
        detector = Detector(curve, kind, True)
        here = Critical(target, spot)
        beside = [Critical(target, curve.along(spot, size)) for size in (-_BESIDE, _BESIDE)]
        low, high = forms = [detector.form(each) for each in beside]
        if not abs(high.cubic - low.cubic) > low.cubic_error + high.cubic_error:
            raise AnalysisError("the cubic coefficient does not change measurably along the curve", field="point")
        fifth = detector.fifth(here, detector.form(here), *forms)
        if fifth is None:
            raise AnalysisError("no coefficient of fifth order was found", field="point")
        if abs(fifth.coefficient) <= fifth.error:
            raise AnalysisError("the coefficient of fifth order is zero within its error", field="point")
        self.at, self.fifth = detector.sampled(here)[1], fifth
        returns = spot.image.returns
        self._times = returns if target > 0 or returns % 2 == 0 else 2 * returns  # in the map of the coefficients
        self._slope = (high.cubic - low.cubic) / (2.0 * _BESIDE)  # by the length of ``spot.tangent``
        self._response = _across(spot, target)

    def fold(self, a: float) -> Place | None:
        """Predicted place of a fold at an amplitude along the mode, negative against it; None if that is too far."""
        spot, fifth = self.spot, self.fifth
        away = -2.0 * fifth.coefficient * a * a / self._slope
        across = fifth.coefficient * a**4 / self._times
        if not (abs(away) <= _FARTHEST and np.abs(across * self._response).max() <= _FARTHEST):
            return None
        base = self._equations.along(spot, away)
        place = spot.frame.moved(base.place, across * self._response)
        bent = displacements(self.at, fifth.curve, np.array(a, dtype=np.complex128))
        return Place(place.state + bent, place.values, 0.0)


def _across(spot: Spot, target: int) -> Array:
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
            if place is None:
                continue
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
            mode, period = Critical(1, found).mode, found.image.period
            fold = BifurcationPoint(Kind.FOLD, value, bound, state, mode, 1.0 + 0j, 0.0, period=period)
            return Start2(fold, float(values[1]), outward, periods)
    raise AnalysisError("no curve of folds was found where one is predicted to leave", field="point") from cause
