"""Detection of points of codimension two along a curve, as zeros of test functions.

A test function measures one condition beside that of the curve: that the coefficient of the normal form vanishes, that
the critical multipliers are in resonance, or that other multipliers are on the unit circle. :class:`Critical` separates
the critical multipliers at a place from the others. The :class:`Detector` measures all test functions at every point of
the curve, a :class:`Station`. Where one changes its sign over a step, it finds the zero on corrected parts of the step,
discards a pole or one without a useful error bound, and names the point from the multipliers beside it.

Test functions after Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 9.1 and 10.3, and Kuznetsov and
Meijer, SIAM J. Sci. Comput. 26, 2005.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from chilopod.errors import AnalysisError
from chilopod.frozen import Array, ComplexArray
from chilopod.stability.codimension_two.bordered import CriticalCurve, Evaluated, Spot
from chilopod.stability.codimension_two.curve2 import DEGENERATE, CodimensionTwo, Point2, SpecialPoint2, together
from chilopod.stability.continuation.equations import Step
from chilopod.stability.continuation.tracer import Parts
from chilopod.stability.interface import SystemLike
from chilopod.stability.normal_forms.manifold import CriticalOrbit
from chilopod.stability.normal_forms.normal_form import NormalForm, NormalFormStatus, Quintic, normal_form, quintic
from chilopod.stability.points import WITHOUT_CRITICALITY, Kind, mean_size
from chilopod.stability.returns import returned_states
from chilopod.stability.spectrum import EPSILON, spectrum
from chilopod.stability.symmetry.groups import reverses
from chilopod.stability.unit_circle.spectra import TARGETS, CircleEvent

_SAFETY = 1.5
_BESIDE = 1e-3  # step of the differences of a test function, relative to the curve's step
_AROUND = 0.001, 0.01, 0.1  # distances, in steps, from a place without a test function
_POLE = 0.1  # value at a sign change, relative to those at the ends of a step, above which it is a pole
_JUMP = 0.5  # the same for values beside it, which are at most 0.2 at a simple zero
_RESOLVED = 3.0  # factor on its error that a test function must reach within a step to be resolved
_COMPLEX = 1e-6  # least imaginary part of a pair
_OVERLAP = 1e-5  # overlap of the two critical eigenvectors below which a multiplier is double
_COSINES = {  # of the angle of the critical multipliers at a resonance
    CodimensionTwo.RESONANCE_1_1: 1.0,
    CodimensionTwo.RESONANCE_1_2: -1.0,
    CodimensionTwo.RESONANCE_1_3: -0.5,
    CodimensionTwo.RESONANCE_1_4: 0.0,
}

Signal = CodimensionTwo | CircleEvent
"""A test function: of the critical multipliers by the kind of its zeros, of the other ones by their event there."""

Signals = dict[Signal, tuple[float, float]]  # test functions and their errors
Test = Callable[[float], tuple[float, float]]  # a test function and its error along a step; NaN where undefined

_Parts = Parts[Spot, Evaluated, Evaluated]


class Critical:
    """A place of a curve, with the critical multipliers separated from the others, and its normal form.

    ``spectrum`` has all multipliers, ``others`` the indices of those that are not critical, shape (others,).
    ``multiplier`` is +1, -1, or on the unit circle with positive imaginary part. ``overlap`` is that of its two
    eigenvectors, each a unit vector in the frame: 0 for a double multiplier; 1 for a pair.
    """

    def __init__(self, curve: CriticalCurve, at: Evaluated) -> None:
        self._curve, self.at, self.spectrum, self.overlap = curve, at, spectrum(at.image), 1.0
        values = self.spectrum.values
        if curve.target:
            own = [self.spectrum.nearest(curve.target)]
            v, w, size = at.right[:, 0], at.left[:, 0], at.frame.size
            self.multiplier = complex(curve.target)
            self.overlap = float(w @ v / (np.linalg.norm(w) * np.linalg.norm(v)))
            mode, left = (size * v).astype(np.complex128), (w / size).astype(np.complex128)
            mode /= np.linalg.norm(mode)
            with np.errstate(divide="ignore", invalid="ignore"):
                left /= left @ mode
        else:
            cosine = at.place.cosine
            self.multiplier = nu = complex(cosine + 1j * np.sqrt(complex(1.0 - cosine * cosine)))
            upper = np.abs(values - nu).argsort()[: curve.copies]
            distance = np.abs(values - 1.0 / nu)
            distance[upper] = np.inf
            first, own = upper[0], [*upper, *distance.argsort()[: curve.copies]]
            mode, left = self.spectrum.right[:, first], self.spectrum.left[:, first]
            turn = np.abs(mode).max() / mode[np.abs(mode).argmax()]
            mode, left = mode * turn, left * turn
        self.others = np.delete(np.arange(values.size), own)
        self._modes = mode, left

    @functools.cached_property
    def system(self) -> SystemLike:
        return self._curve.system(self.at.place.values)

    @functools.cached_property
    def orbit(self) -> CriticalOrbit:
        """The orbit, as normal forms take it."""
        place, image = self.at.place, self.at.image
        image = image if np.isfinite(image.error).all() else replace(image, error=0.0)
        mode, left = self._modes
        size = mean_size(self.system, place.state, image.duration, mode)
        return CriticalOrbit(place.state, image, self.multiplier, mode / size, left * size)

    @functools.cached_property
    def form(self) -> NormalForm:
        at, orbit_error = self.at, 0.0
        if isinstance(at, Spot):  # whose errors are known
            state = at.frame.size * (np.abs(at.frame.basis) @ at.shift[: at.frame.parameters.start])
            moved = state > 0.0  # the left mode of a double multiplier is infinite
            orbit_error = float(np.abs(self.orbit.left[moved]) @ state[moved])
        return normal_form(self._returned, self.orbit, scale=at.frame.size, orbit_error=orbit_error)

    def fifth(self, *beside: Critical) -> Quintic | None:
        """The terms of fifth order, sampled up to about the amplitude of the normal form here, or else beside."""
        amplitude = next(filter(np.isfinite, (each.form.amplitude for each in (self, *beside))), None)
        return None if amplitude is None else quintic(self._returned, self.orbit, amplitude)

    def _returned(self, states: Array) -> Array:
        return returned_states(self.system, states, self.at.frame.section)


class Station(NamedTuple):
    """A spot on a curve, its point, and the test functions there."""

    spot: Spot
    point: Point2
    signals: Signals


class Detector:
    """Test functions along a curve of bifurcations, with that of the normal form if ``coefficients``."""

    def __init__(self, curve: CriticalCurve, kind: Kind, coefficients: bool) -> None:
        self.curve, self._kind, self._coefficients = curve, kind, coefficients
        self._degenerate = DEGENERATE.get(kind) if coefficients else None
        resonances = [each for each, cosine in _COSINES.items() if curve.target in (0, cosine)]
        self._signals: list[Signal] = [*filter(None, [self._degenerate]), *resonances, *CircleEvent]

    def station(self, spot: Spot) -> Station:
        here = Critical(self.curve, spot)
        signals = {signal: self._measured(signal, here) for signal in self._signals}
        bound = across(spot) + 4.0 * EPSILON * np.abs(spot.values)
        coefficient = self._decisive(here) if self._coefficients else (np.nan, np.nan)
        return Station(spot, _point(here, bound, coefficient), signals)

    def events(self, step: Step[Spot, Evaluated], before: Signals, after: Signals) -> list[tuple[Spot, SpecialPoint2]]:
        """Points of codimension two within a step, in order."""
        parts, found = Parts(self.curve, step), []
        for signal in self._signals:
            (one, one_error), (other, other_error) = before[signal], after[signal]
            changes = one * other < 0.0 or (other == 0.0 and one != 0.0)
            # A function that vanishes along the whole curve changes its sign as well.
            if changes and (abs(one) > _RESOLVED * one_error or abs(other) > _RESOLVED * other_error):
                found.append(self._located(signal, parts))
        return [each[1:] for each in sorted(filter(None, found), key=lambda each: each[0])]

    def _measured(self, signal: Signal, here: Critical) -> tuple[float, float]:
        """A test function and its error, which needs an image with error bounds, and errors of the coordinates."""
        at = here.at
        if signal is self._degenerate:
            # A fold's coefficient is positive for one sign of its mode, and has a pole where the multiplier is double.
            value, error = self._decisive(here)
            return value * here.overlap, error * abs(here.overlap)
        if isinstance(signal, CodimensionTwo):
            if self.curve.target:
                # The error of the multiplier is as that of an entry, and moves the overlap of a double one as much.
                wrong = float(np.linalg.norm(at.error)) + abs(float(at.residual[-1]))
                return here.overlap, 2.0 * at.reach * wrong
            return at.place.cosine - _COSINES[signal], float(at.shift[-1]) if isinstance(at, Spot) else 0.0
        nu, errors = here.spectrum.values[here.others], here.spectrum.error[here.others]
        if signal is CircleEvent.PAIR:
            first, second = np.triu_indices(nu.size, 1)
            sizes, off = np.abs(nu), errors[first] * np.abs(nu[second]) + errors[second] * np.abs(nu[first])
            return _product(nu[first] * nu[second] - 1.0, 1.0 + sizes[first] * sizes[second], off)
        return _product(nu - TARGETS[signal], 1.0 + np.abs(nu), errors)

    def _decisive(self, here: Critical) -> tuple[float, float]:
        """The decisive coefficient on a curve of this kind, and its error; NaN if undefined."""
        # Past the end of a pair's curve are two real multipliers with product 1; equal pairs have no single form.
        none = abs(here.at.place.cosine) >= 1.0 or self.curve.copies > 1
        if none or here.form.status not in (NormalFormStatus.FOUND, NormalFormStatus.LINEAR):
            return np.nan, np.nan
        if self._kind in (Kind.FOLD, Kind.TRANSCRITICAL, Kind.BRANCH_POINT):
            return here.form.quadratic, here.form.quadratic_error
        return here.form.cubic, here.form.cubic_error

    def _located(self, signal: Signal, parts: _Parts) -> tuple[float, Spot, SpecialPoint2] | None:
        """Point where a test function vanishes within a step, with its distance along the step."""
        curve, start, length = self.curve, parts.step.start, parts.step.size

        @functools.cache
        def test(place: float) -> tuple[float, float]:
            return self._measured(signal, Critical(curve, parts.at(place).found))

        zero = _zero(test, length)
        if zero is None:
            return None
        root, beside, unsure = zero
        spot = curve.spot(parts.at(root).found.place, start.frame, start.tangent)
        here = Critical(curve, spot)
        value, error = self._measured(signal, here)
        if np.isnan(value):
            value, error = 0.0, max(test(root - beside)[1], test(root + beside)[1])
        if not unsure and abs(value) > _POLE * max(abs(test(0.0)[0]), abs(test(length)[0])):
            return None
        wrong = _SAFETY * (abs(value) + error + unsure)
        off = _SAFETY * spot.frame.widths * spot.shift[spot.frame.parameters]
        bound = off + _along(test, parts, root, beside, wrong) + 4.0 * EPSILON * np.abs(spot.values)
        if not (bound < np.ptp(curve.box, axis=1)).all():  # a bound of the size of the box
            return None
        there = Critical(curve, parts.at(root + beside).found)
        kind = self._named(signal, spot, here, there)
        low, high = test(root - beside)[0], test(root + beside)[0]
        # A pole grows towards the place, also where it hides the value there; an end may be nearer than these.
        ends = [abs(test(end)[0]) for end in (0.0, length) if abs(end - root) > beside]
        if kind is None or max(abs(low), abs(high)) > _JUMP * max(ends):
            return None
        point = SpecialPoint2(**vars(_point(here, bound)), kind=kind)
        if signal is self._degenerate:
            point = self._with_next_term(point, here, there, wrong / (abs(high - low) / 2.0))
        return root, spot, point

    def _with_next_term(self, point: SpecialPoint2, here: Critical, beside: Critical, share: float) -> SpecialPoint2:
        """A point with its next coefficient, whose error includes its change over the error of the place."""
        if self._kind in WITHOUT_CRITICALITY:
            terms = [(each.form.cubic, each.form.cubic_error) for each in (here, beside)]
        else:
            fifths = here.fifth(beside), beside.fifth(here)
            terms = [(np.nan, np.nan) if each is None else (each.coefficient, each.error) for each in fifths]
        (value, error), (other, unsure) = terms
        error += share * (abs(other - value) + error + unsure)
        if not np.isfinite(error):
            return point
        flat = point.kind is CodimensionTwo.CUSP and abs(value) <= error
        kind = CodimensionTwo.DEGENERATE_FOLD if flat else point.kind
        return replace(point, kind=kind, next_coefficient=value, next_coefficient_error=error)

    def _named(self, signal: Signal, spot: Spot, here: Critical, there: Critical) -> CodimensionTwo | None:
        """Kind of the point at a zero of a test function, by a place beside it; None for a zero without meaning."""
        if isinstance(signal, CodimensionTwo):
            return signal
        nu = here.spectrum.values[here.others]
        if signal is CircleEvent.PAIR:
            off_circle = np.abs(np.abs(nu) - 1.0)[np.abs(nu.imag) > _COMPLEX].min(initial=np.inf)
            # Two real multipliers with product 1 are not critical.
            reals = nu[np.abs(nu.imag) <= _COMPLEX].real
            products = np.abs(reals[:, None] * reals - 1.0)[np.triu_indices(reals.size, 1)]
            return together(self._kind, Kind.NEIMARK_SACKER) if off_circle <= products.min(initial=np.inf) else None
        sign = TARGETS[signal]
        if sign == self.curve.target and abs(here.overlap) < _OVERLAP:
            return None  # the overlap identifies a double multiplier
        if sign < 0:
            return together(self._kind, Kind.PITCHFORK if here.at.image.returns % 2 == 0 else Kind.PERIOD_DOUBLING)
        # At the point itself the modes of two equal multipliers are any combinations of both.
        nearest = there.others[np.abs(there.spectrum.values[there.others] - sign).argmin()]
        mode = there.spectrum.right[:, nearest]
        if reverses(here.system, mode, here.at.frame.size):
            return together(self._kind, Kind.PITCHFORK)
        return together(self._kind, Kind.BRANCH_POINT if self.curve.known or self.curve.meets(spot) else Kind.FOLD)


def _point(here: Critical, bound: Array, coefficient: tuple[float, float] = (np.nan, np.nan)) -> Point2:
    image, place, nu = here.at.image, here.at.place, here.multiplier
    both = (None, None) if np.isnan(coefficient[0]) else coefficient
    frequency = abs(float(np.angle(nu**image.returns))) / image.period
    mode, multipliers = here.orbit.right, here.spectrum.values
    return Point2(place.values, bound, place.state, mode, nu, multipliers, frequency, image.period, *both)


def _zero(test: Test, length: float) -> tuple[float, float, float] | None:
    """Zero of a test function in a step, distance to known places, and largest value there if undefined; or None."""

    def resolved(place: float) -> float:
        value, error = test(place)
        # A coefficient of zero may be undefined; an image without bounds has no error.
        return 0.0 if np.isnan(value) or abs(value) <= error < np.inf else value

    if not test(0.0)[0] * test(length)[0] <= 0.0:
        return None
    root = float(brentq(resolved, 0.0, length, xtol=1e-15 * length, rtol=8.9e-16, maxiter=60, disp=False))
    if not np.isnan(test(root)[0]):
        return root, _BESIDE * length, 0.0
    for share in _AROUND:
        low, high = max(root - share * length, 0.0), min(root + share * length, length)
        before, after = test(low)[0], test(high)[0]
        if before * after < 0.0:
            return 0.5 * (low + high), 0.5 * (high - low), max(abs(before), abs(after))
    return None


def across(spot: Spot) -> Array:
    """Errors of both parameters, shape (2,), at right angles to the curve in the plane of the parameters."""
    frame = spot.frame
    response = np.linalg.pinv(spot.matrix[:-1])[frame.parameters]
    tangent = spot.tangent[frame.parameters]
    length = float(np.linalg.norm(tangent))
    if length > np.sqrt(EPSILON):  # at a cusp the curve has no direction
        normal = np.array([-tangent[1], tangent[0]]) / length
        response = np.outer(normal, normal @ response)
    return np.asarray(_SAFETY * frame.widths * (np.abs(response) @ spot.uncertainty))


def _along(test: Test, parts: _Parts, root: float, h: float, wrong: float) -> Array:
    """Changes of both parameters, shape (2,), along the curve over the error ``wrong`` of a test function."""
    with contextlib.suppress(AnalysisError):
        slope = abs(test(root + h)[0] - test(root - h)[0]) / (2.0 * h)
        low, middle, high = (parts.at(root + s).found.place.values for s in (-h, 0.0, h))
        if slope > 0.0:
            off = wrong / slope
            first, second = np.abs(high - low) / (2.0 * h), np.abs(high - 2.0 * middle + low) / (h * h)
            return np.asarray(first * off + 0.5 * second * off * off)
    return np.full(2, np.inf)


def _product(factors: ComplexArray, sizes: Array, errors: Array) -> tuple[float, float]:
    """The product of ``factors / sizes``, which is real, and its error from those of the factors."""
    scaled = factors / sizes
    value = float(np.prod(scaled).real)
    without = [float(np.abs(np.prod(np.delete(scaled, i)))) for i in range(scaled.size)]
    with np.errstate(invalid="ignore"):  # an unknown error of a factor beside another factor of zero
        error = float(np.dot(without, errors / sizes)) if scaled.size else 0.0
    return value, np.inf if np.isnan(error) else error
