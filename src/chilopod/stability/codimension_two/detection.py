"""Detection of points of codimension two along a curve, as zeros of test functions.

Test functions after Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 9.1 and 10.3, and Kuznetsov and
Meijer, SIAM J. Sci. Comput. 26, 2005.
"""

from __future__ import annotations

import contextlib
import enum
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.errors import AnalysisError
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.codimension_two.bordered import CriticalCurve, Evaluated, Frame, Spot
from chilopod.stability.codimension_two.curve2 import DEGENERATE, CodimensionTwo, Point2, SpecialPoint2, together
from chilopod.stability.normal_forms.amplitude import NormalFormStatus
from chilopod.stability.normal_forms.center_manifold import CriticalOrbit, ReturnedStates
from chilopod.stability.normal_forms.normal_form import NormalForm, Quintic, normal_form, quintic
from chilopod.stability.points import WITHOUT_CRITICALITY, Kind
from chilopod.stability.problem.returns import returned_states
from chilopod.stability.spectrum.eigenvalues import Spectrum, spectrum
from chilopod.stability.symmetry.mirrored import reverses
from chilopod.stability.tracing.step import Step
from chilopod.stability.tracing.tracer import Parts
from chilopod.stability.unit_circle.spectra import TARGETS, Event

_SAFETY = 1.5
_BESIDE = 1e-3  # step of the differences of a test function, relative to the curve's step
_NEARER = (-0.1, 0.1, -0.01, 0.01, -0.001, 0.001)  # distances, in steps, from a place without a test function
_POLE = 0.1  # value at a sign change, relative to those at the ends of a step, above which it is a pole
_RESOLVED = 3.0  # factor on its error that a test function must reach within a step to be resolved
_COMPLEX = 1e-6  # least imaginary part of a pair
_OVERLAP = 1e-5  # overlap of the two critical eigenvectors below which a multiplier is double
_EPSILON = float(np.finfo(float).eps)


class Own(enum.Enum):
    """Coefficient of the normal form, and w . v of the critical eigenvectors, zero for a double multiplier."""

    COEFFICIENT = enum.auto()
    DOUBLE = enum.auto()


Signal = Own | Event | CodimensionTwo
"""Test functions: those above; of other multipliers, +1, -1 or a pair on the circle; of a pair, one resonance each."""

Signals = dict[Signal, tuple[float, float]]
"""Test functions and their errors."""

_COSINES = {
    CodimensionTwo.RESONANCE_1_1: 1.0,
    CodimensionTwo.RESONANCE_1_2: -1.0,
    CodimensionTwo.RESONANCE_1_3: -0.5,
    CodimensionTwo.RESONANCE_1_4: 0.0,
}


class _NoValue(AnalysisError):
    """A test function is undefined at a place."""


@dataclass(frozen=True)
class Critical(ReadOnlyArrays):
    """A place of a curve with its multipliers."""

    at: Evaluated  # equations there and their frame
    frame: Frame
    shift: Array | None  # errors of the coordinates, if the image has error bounds; else None
    spectrum: Spectrum  # all multipliers of the return map
    others: NDArray[np.intp]  # indices of the multipliers that are not critical, shape (others,)
    multiplier: complex  # critical multiplier: +1, -1, or on the unit circle with positive imaginary part
    mode: ComplexArray  # unit right eigenvector and left one with left^H mode = 1, shape (n,)
    left: ComplexArray
    overlap: float  # overlap of the two, each a unit vector in the frame: 0 for a double multiplier, NaN for a pair


def critical(target: int, at: Evaluated, frame: Frame, shift: Array | None = None) -> Critical:
    """A place of a curve, with the critical multipliers separated from the others."""
    spec = spectrum(at.image)
    if target:
        own = [int(np.abs(spec.values - target).argmin())]
        v, w = at.right[:, 0], at.left[:, 0]
        overlap = float(w @ v / (np.linalg.norm(w) * np.linalg.norm(v)))
        nu, mode, left = complex(target), (frame.size * v).astype(np.complex128), (w / frame.size).astype(np.complex128)
        mode /= np.linalg.norm(mode)
        with np.errstate(divide="ignore", invalid="ignore"):
            left /= left @ mode
    else:
        cosine, overlap = at.place.cosine, np.nan
        nu = complex(cosine + 1j * np.sqrt(complex(1.0 - cosine * cosine)))
        first = int(np.abs(spec.values - nu).argmin())
        distance = np.abs(spec.values - 1.0 / nu)
        distance[first] = np.inf
        own = [first, int(distance.argmin())]
        mode, left = spec.right[:, first], spec.left[:, first]
        turn = np.abs(mode).max() / mode[np.abs(mode).argmax()]
        mode, left = mode * turn, left * turn
    others = np.delete(np.arange(spec.values.size), own)
    return Critical(at, frame, shift, spec, others, nu, mode, left, overlap)


@dataclass(frozen=True)
class Station:
    """A spot of a curve with the point there, and the test functions."""

    spot: Spot
    point: Point2
    signals: Signals


class Detector:
    """Test functions along a curve of bifurcations, with that of the normal form if ``coefficients``."""

    def __init__(self, curve: CriticalCurve, kind: Kind, coefficients: bool) -> None:
        self._curve, self._kind, self._coefficients = curve, kind, coefficients
        form = (Own.COEFFICIENT,) if coefficients else ()
        self._signals: tuple[Signal, ...] = (*form, *((Own.DOUBLE,) if curve.target else _COSINES), *Event)

    def station(self, spot: Spot) -> Station:
        """A spot with the point there, and the test functions."""
        here = critical(self._curve.target, spot.at, spot.frame, spot.shift)
        form = self.form(here) if self._coefficients and abs(spot.place.cosine) < 1.0 else None
        signals = {signal: self._measured(signal, here, form) for signal in self._signals}
        bound = across(spot) + 4.0 * _EPSILON * np.abs(spot.values)
        return Station(spot, _point(here, bound, (np.nan, np.nan) if form is None else self._decides(form)), signals)

    def events(self, step: Step[Spot, Evaluated], before: Signals, after: Signals) -> list[tuple[Spot, SpecialPoint2]]:
        """Points of codimension two within a step, in order."""
        parts, found = Parts(self._curve, step), []
        for signal in self._signals:
            one, other = before[signal][0], after[signal][0]
            if not (one * other < 0.0 or (other == 0.0 and one != 0.0)):
                continue
            # A function that vanishes along the whole curve changes its sign as well.
            if any(abs(value) > _RESOLVED * error for value, error in (before[signal], after[signal])):
                found += self._located(signal, parts)
        return [(spot, point) for _, spot, point in sorted(found, key=lambda each: each[0])]

    def form(self, here: Critical) -> NormalForm:
        """The normal form at a place."""
        orbit_error = error = 0.0
        if here.shift is not None:
            frame, m = here.frame, here.frame.basis.shape[1]
            orbit_error = float(np.abs(here.left) @ (frame.size * (np.abs(frame.basis) @ here.shift[:m])))
            error = float(here.at.error.max())
        return normal_form(
            *self.sampled(here),
            uncertainty=error / float(np.linalg.norm(here.at.jacobian)),
            scale=here.frame.size,
            orbit_error=orbit_error,
        )

    def sampled(self, here: Critical) -> tuple[ReturnedStates, CriticalOrbit]:
        """Return map and critical orbit of a normal form."""
        at, section = here.at, here.frame.section
        system = self._curve.system(at.place.values)
        orbit = CriticalOrbit(
            at.place.state, at.image.jacobian, here.multiplier, here.mode, here.left, at.image.returns
        )
        return lambda states: returned_states(system, states, section), orbit

    def fifth(self, here: Critical, *forms: NormalForm) -> Quintic | None:
        """The terms of fifth order at a place, given those of third order there or beside it."""
        amplitude = next((form.amplitude for form in forms if np.isfinite(form.amplitude)), np.nan)
        return None if np.isnan(amplitude) else quintic(*self.sampled(here), amplitude)

    def _decides(self, form: NormalForm) -> tuple[float, float]:
        """The decisive coefficient on a curve of this kind, and its error; NaN if undefined."""
        if form.status not in (NormalFormStatus.FOUND, NormalFormStatus.LINEAR):
            return np.nan, np.nan
        if self._kind in (Kind.FOLD, Kind.TRANSCRITICAL, Kind.BRANCH_POINT):
            return form.quadratic, form.quadratic_error
        return form.cubic, form.cubic_error

    def _measured(self, signal: Signal, here: Critical, form: NormalForm | None = None) -> tuple[float, float]:
        """A test function and its error, which needs an image with error bounds, and errors of the coordinates."""
        if isinstance(signal, CodimensionTwo):
            return here.at.place.cosine - _COSINES[signal], 0.0 if here.shift is None else float(here.shift[-1])
        if signal is Own.DOUBLE:
            return here.overlap, 2.0 * here.at.reach * float(np.linalg.norm(here.at.error))
        if signal is Own.COEFFICIENT:
            if not self._curve.target and abs(here.at.place.cosine) >= 1.0:
                return np.nan, np.nan  # past the end of the curve: two real multipliers with product 1
            value, error = self._decides(self.form(here) if form is None else form)
            # A fold's is positive for one sign of its mode, and has a pole where the multiplier is double.
            factor = here.overlap if self._curve.target else 1.0
            return value * factor, error * abs(factor)
        nu, errors = here.spectrum.values[here.others], here.spectrum.error[here.others]
        if signal is Event.PAIR:
            first, second = np.triu_indices(nu.size, 1)
            sizes, off = np.abs(nu), errors[first] * np.abs(nu[second]) + errors[second] * np.abs(nu[first])
            return _product(nu[first] * nu[second] - 1.0, 1.0 + sizes[first] * sizes[second], off)
        return _product(nu - TARGETS[signal], 1.0 + np.abs(nu), errors)

    def _located(
        self, signal: Signal, parts: Parts[Spot, Evaluated, Evaluated]
    ) -> list[tuple[float, Spot, SpecialPoint2]]:
        """Points where a test function vanishes within a step, with their distances along the step."""
        curve, start, length = self._curve, parts.step.start, parts.step.size
        seen: dict[float, tuple[float, float]] = {}

        def test(place: float) -> float:
            if place not in seen:
                seen[place] = self._measured(signal, critical(curve.target, parts.at(place).found, start.frame))
            if np.isnan(seen[place][0]):
                raise _NoValue("the test function does not exist", field="special")
            return seen[place][0]

        zero = _zero(test, seen, length)
        if zero is None:
            return []
        root, beside, unsure = zero
        spot = curve.spot(parts.at(root).found.place, start.frame, start.tangent)
        here = critical(curve.target, spot.at, spot.frame, spot.shift)
        value, error = self._measured(signal, here)
        if np.isnan(value):
            value, error = 0.0, max(error for _, error in seen.values() if not np.isnan(error))
        if not unsure and abs(value) > _POLE * max(abs(test(0.0)), abs(test(length))):
            return []
        kind = self._named(signal, here)
        along = _along(test, parts, root, beside, abs(value) + error + unsure)
        off = _SAFETY * spot.frame.widths * spot.shift[spot.frame.parameters]
        bound = off + along + 4.0 * _EPSILON * np.abs(spot.values)
        if kind is None or not (bound < np.ptp(curve.box, axis=1)).all():  # a bound of the size of the box
            return []
        point = SpecialPoint2(**vars(_point(here, bound)), kind=kind)
        if signal is Own.COEFFICIENT:
            slope = abs(test(root + beside) - test(root - beside)) / 2.0
            there = critical(curve.target, parts.at(root + beside).found, start.frame)
            point = self._with_next_term(point, here, there, _SAFETY * (abs(value) + error + unsure) / slope)
        return [(root, spot, point)]

    def _with_next_term(self, point: SpecialPoint2, here: Critical, beside: Critical, share: float) -> SpecialPoint2:
        """A point with its next coefficient, whose error includes its change over the error of the place."""
        terms, forms = [], [self.form(each) for each in (here, beside)]
        for each, form in zip((here, beside), forms, strict=True):
            value, error = form.cubic, form.cubic_error
            if self._kind not in WITHOUT_CRITICALITY:
                fifth = self.fifth(each, form, *forms)
                value, error = (np.nan, np.nan) if fifth is None else (fifth.coefficient, fifth.error)
            terms.append((value, error))
        (value, error), (other, unsure) = terms
        error += share * (abs(other - value) + error + unsure)
        return replace(point, next_coefficient=value, next_coefficient_error=error) if np.isfinite(error) else point

    def _named(self, signal: Signal, here: Critical) -> CodimensionTwo | None:
        """Kind of the point at a zero of a test function; None for a zero without meaning."""
        target = self._curve.target
        if isinstance(signal, CodimensionTwo):
            return signal
        if signal is Own.COEFFICIENT:
            return DEGENERATE.get(self._kind)
        if signal is Own.DOUBLE:
            return CodimensionTwo.RESONANCE_1_1 if target > 0 else CodimensionTwo.RESONANCE_1_2
        nu = here.spectrum.values[here.others]
        if signal is Event.PAIR:
            complex_ones = np.abs(np.abs(nu) - 1.0)[np.abs(nu.imag) > _COMPLEX]
            # Two real multipliers with product 1 are not critical.
            reals = nu[np.abs(nu.imag) <= _COMPLEX].real
            products = np.abs(reals[:, None] * reals - 1.0)[np.triu_indices(reals.size, 1)]
            if not complex_ones.size or (products.size and products.min() < complex_ones.min()):
                return None
            return together(self._kind, Kind.NEIMARK_SACKER)
        sign = TARGETS[signal]
        if sign == target and abs(here.overlap) < _OVERLAP:
            return None  # the overlap identifies a double multiplier
        mode = here.spectrum.right[:, here.others[int(np.abs(nu - sign).argmin())]]
        if reverses(self._curve.system(here.at.place.values), mode, here.frame.size):
            return together(self._kind, Kind.PITCHFORK)
        if sign < 0:
            return together(self._kind, Kind.PITCHFORK if here.at.image.returns == 2 else Kind.PERIOD_DOUBLING)
        return together(self._kind, Kind.BRANCH_POINT if self._curve.known else Kind.FOLD)


def _point(here: Critical, bound: Array, coefficient: tuple[float, float] = (np.nan, np.nan)) -> Point2:
    image, place = here.at.image, here.at.place
    value, error = (None, None) if np.isnan(coefficient[0]) else coefficient
    frequency = abs(float(np.angle(here.multiplier**image.returns))) / image.period
    return Point2(
        place.values, bound, place.state, here.mode, here.multiplier, here.spectrum.values, frequency, value, error
    )


def _zero(
    test: Callable[[float], float], seen: dict[float, tuple[float, float]], length: float
) -> tuple[float, float, float] | None:
    """Zero of a test function within a step, distance to the nearest place where it is known, and its largest value
    there; None without a zero. ``seen``: its values and errors, NaN where undefined."""

    def resolved(place: float) -> float:
        value = test(place)
        # An image without bounds has no error.
        return 0.0 if abs(value) <= seen[place][1] < np.inf else value

    try:
        if test(0.0) * test(length) > 0.0:
            return None
        root = brentq(resolved, 0.0, length, xtol=1e-15 * length, rtol=8.9e-16, maxiter=60, disp=False)
        return float(root), _BESIDE * length, 0.0
    except _NoValue:
        # A coefficient of zero may be harder to compute than those beside it, which then bracket it.
        (gap,) = (place for place, (value, _) in seen.items() if np.isnan(value))
    for share in _NEARER:
        if 0.0 < gap + share * length < length:
            with contextlib.suppress(_NoValue):
                test(gap + share * length)
    known = {place: value for place, (value, _) in seen.items() if not np.isnan(value)}
    if not known.keys() >= {0.0, length}:
        return None
    low = max(place for place, value in known.items() if value * known[0.0] > 0.0)
    high = min(place for place in known if place > low)
    return 0.5 * (low + high), 0.5 * (high - low), max(abs(known[low]), abs(known[high]))


def across(spot: Spot) -> Array:
    """Errors of both parameters, shape (2,), at right angles to the curve in the plane of the parameters."""
    frame = spot.frame
    response = np.linalg.pinv(spot.matrix[:-1])[frame.parameters]
    tangent = spot.tangent[frame.parameters]
    length = float(np.linalg.norm(tangent))
    if length > np.sqrt(_EPSILON):  # at a cusp the curve has no direction
        normal = np.array([-tangent[1], tangent[0]]) / length
        response = np.outer(normal, normal @ response)
    return np.asarray(_SAFETY * frame.widths * (np.abs(response) @ spot.uncertainty))


def _along(
    test: Callable[[float], float], parts: Parts[Spot, Evaluated, Evaluated], root: float, h: float, error: float
) -> Array:
    """Changes of both parameters, shape (2,), over the part of the curve that a test function leaves open."""
    try:
        slope = abs(test(root + h) - test(root - h)) / (2.0 * h)
        low, middle, high = (parts.at(root + s).found.place.values for s in (-h, 0.0, h))
    except AnalysisError:
        return np.full(2, np.inf)
    if not slope > 0.0:
        return np.full(2, np.inf)
    off = _SAFETY * error / slope
    first, second = np.abs(high - low) / (2.0 * h), np.abs(high - 2.0 * middle + low) / (h * h)
    return np.asarray(first * off + 0.5 * second * off * off)


def _product(factors: ComplexArray, sizes: Array, errors: Array) -> tuple[float, float]:
    """The product of ``factors / sizes``, which is real, and its error from those of the factors."""
    scaled = factors / sizes
    value = float(np.prod(scaled).real)
    without = [float(np.abs(np.prod(np.delete(scaled, i)))) for i in range(scaled.size)]
    return value, float(np.dot(without, errors / sizes)) if scaled.size else 0.0
