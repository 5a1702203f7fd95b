"""How points of codimension two are found along a curve: each is a zero of a test function.

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
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.codimension_two.bordered import Equations, Evaluated, Frame, Spot
from chilopod.stability.codimension_two.codimension2 import DEGENERATE, Codimension2, CodimensionTwo, together
from chilopod.stability.normal_forms.amplitude import NormalFormStatus
from chilopod.stability.normal_forms.center_manifold import CriticalOrbit, ReturnedStates
from chilopod.stability.normal_forms.normal_form import NormalForm, normal_form
from chilopod.stability.normal_forms.quintic import Quintic, quintic
from chilopod.stability.points import WITHOUT_CRITICALITY, Kind
from chilopod.stability.problem.returns import returned_states
from chilopod.stability.spectrum.eigenvalues import Spectrum, spectrum
from chilopod.stability.symmetry.mirrored import reverses

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_SAFETY = 1.5
_BESIDE = 1e-3  # of a step: how far apart a test function is differentiated
_NEARER = (-0.1, 0.1, -0.01, 0.01, -0.001, 0.001)  # of a step, beside where a test function was found to have no value
_POLE = 0.1  # of its values at the ends of a step: where a test function changes sign and is larger, it has a pole
_RESOLVED = 3.0  # times the error of a test function that it has to reach within a step to mean anything
_COMPLEX = 1e-6  # imaginary part from which a pair counts as one
_OVERLAP = 1e-5  # of the two critical eigenvectors, below which a multiplier is double


class Signal(enum.Enum):
    """A test function along a curve."""

    COEFFICIENT = enum.auto()  # of the normal form
    DOUBLE = enum.auto()  # w . v, zero where a critical multiplier is double
    PLUS = enum.auto()  # another multiplier +1
    MINUS = enum.auto()  # another multiplier -1
    PAIR = enum.auto()  # another pair on the unit circle
    AT_PLUS = enum.auto()  # the pair itself at +1, -1, and the two resonances in between
    AT_MINUS = enum.auto()
    AT_THIRD = enum.auto()
    AT_QUARTER = enum.auto()


class _NoValue(AnalysisError):
    """A test function has no value at a place."""


Signals = dict[Signal, tuple[float, float]]
"""Test functions and their errors."""

_COSINES = {Signal.AT_PLUS: 1.0, Signal.AT_MINUS: -1.0, Signal.AT_THIRD: -0.5, Signal.AT_QUARTER: 0.0}

_RESONANCES = {
    Signal.AT_PLUS: CodimensionTwo.RESONANCE_1_1,
    Signal.AT_MINUS: CodimensionTwo.RESONANCE_1_2,
    Signal.AT_THIRD: CodimensionTwo.RESONANCE_1_3,
    Signal.AT_QUARTER: CodimensionTwo.RESONANCE_1_4,
}


def _signals(target: int, coefficients: bool) -> tuple[Signal, ...]:
    own = (Signal.DOUBLE,) if target else tuple(_COSINES)
    form = (Signal.COEFFICIENT,) if coefficients else ()
    return (*form, *own, Signal.PLUS, Signal.MINUS, Signal.PAIR)


@dataclass(frozen=True)
class Critical(ReadOnlyArrays):
    """The critical multiplier at a place of a curve, and the others.

    Attributes
    ----------
    spectrum
        All multipliers of the return map.
    others
        Numbers of those that are not critical, shape (others,).
    multiplier
        The critical one: +1, -1, or on the unit circle with positive imaginary part.
    mode, left
        Unit right eigenvector and left one with left^H mode = 1, shape (n,).
    overlap
        Overlap of the two where both have unit length in units of the frame: 0 where the multiplier is double. NaN for
        a pair.
    """

    spectrum: Spectrum
    others: NDArray[np.intp]
    multiplier: complex
    mode: ComplexArray
    left: ComplexArray
    overlap: float


def critical(target: int, at: Evaluated, frame: Frame) -> Critical:
    """Multipliers at a place of a curve, the critical ones apart."""
    spec = spectrum(at.image)
    if target:
        own = [int(np.abs(spec.values - target).argmin())]
        v, w = at.right[:, 0], at.left[:, 0]
        overlap = float(w @ v / (np.linalg.norm(w) * np.linalg.norm(v)))
        mode = (frame.size * v).astype(np.complex128)
        mode /= np.linalg.norm(mode)
        left = (w / frame.size).astype(np.complex128)
        with np.errstate(divide="ignore", invalid="ignore"):
            left /= left @ mode
        return Critical(spec, _without(spec, own), complex(target), mode, left, overlap)
    cosine = at.place.cosine
    nu = cosine + 1j * np.sqrt(complex(1.0 - cosine * cosine))
    first = int(np.abs(spec.values - nu).argmin())
    distance = np.abs(spec.values - 1.0 / nu)
    distance[first] = np.inf
    own = [first, int(distance.argmin())]
    mode, left = spec.right[:, first], spec.left[:, first]
    turn = np.abs(mode).max() / mode[np.abs(mode).argmax()]
    return Critical(spec, _without(spec, own), complex(nu), mode * turn, left * turn, np.nan)


def _without(spec: Spectrum, own: list[int]) -> NDArray[np.intp]:
    return np.delete(np.arange(spec.values.size), own)


class Detector:
    """Test function that is watched along a curve.

    Parameters
    ----------
    equations
        Equations of the curve.
    kind
        Kind of the bifurcation along it.
    coefficients
        True if normal forms are computed.
    """

    def __init__(self, equations: Equations, kind: Kind, coefficients: bool) -> None:
        self._equations = equations
        self._kind = kind
        self._signals = _signals(equations.target, coefficients)

    def form(self, own: Critical, at: Evaluated, frame: Frame, shift: Array | None) -> NormalForm:
        """The normal form at a place; ``shift`` is how far its coordinates may be off, if that is to count."""
        orbit_error = 0.0
        if shift is not None:
            orbit_error = float(np.abs(own.left) @ (frame.size * (np.abs(frame.basis) @ shift[: frame.basis.shape[1]])))
        error = 0.0 if shift is None else float(np.max(at.image.error * frame.size / frame.size[:, None]))
        return normal_form(
            *self.sampled(own, at, frame),
            uncertainty=error / float(np.linalg.norm(at.jacobian)),
            scale=frame.size,
            orbit_error=orbit_error,
        )

    def sampled(self, own: Critical, at: Evaluated, frame: Frame) -> tuple[ReturnedStates, CriticalOrbit]:
        """Samples at a place that a normal form is computed from."""
        system, image = self._equations.system(at.place.values), at.image
        orbit = CriticalOrbit(at.place.state, image.jacobian, own.multiplier, own.mode, own.left, image.returns)
        return lambda states: returned_states(system, states, frame.section), orbit

    def fifth(self, own: Critical, at: Evaluated, frame: Frame, *forms: NormalForm) -> Quintic | None:
        """The terms of fifth order at a place, given those of third order there or beside it."""
        amplitude = next((form.amplitude for form in forms if np.isfinite(form.amplitude)), np.nan)
        return None if np.isnan(amplitude) else quintic(*self.sampled(own, at, frame), amplitude)

    def coefficient(self, form: NormalForm) -> tuple[float, float]:
        """The coefficient that decides what happens on a curve of this kind, and its error; NaN where there is none."""
        if form.status not in (NormalFormStatus.FOUND, NormalFormStatus.LINEAR):
            return np.nan, np.nan
        if self._kind in (Kind.FOLD, Kind.TRANSCRITICAL, Kind.BRANCH_POINT):
            return form.quadratic, form.quadratic_error
        return form.cubic, form.cubic_error

    def measured(self, spot: Spot, own: Critical, form: NormalForm | None) -> Signals:
        """The test functions at a point of the curve, with their errors."""
        return {signal: self._measure(signal, own, spot.at, spot.frame, spot.shift, form) for signal in self._signals}

    def between(
        self, before: Spot, there: Signals, after: Spot, here: Signals
    ) -> list[tuple[float, Spot, Codimension2]]:
        """Points of codimension two within a step, in order, with how far along it they are."""
        found = []
        for signal in self._signals:
            one, other = there[signal][0], here[signal][0]
            if not (one * other < 0.0 or (other == 0.0 and one != 0.0)):
                continue
            # What vanishes all along a curve changes its sign as well.
            if not any(abs(value) > _RESOLVED * error for value, error in (there[signal], here[signal])):
                continue
            located = self._located(signal, before, after)
            if located is not None:
                found.append(located)
        return sorted(found, key=lambda each: each[0])

    def _measure(
        self,
        signal: Signal,
        own: Critical,
        at: Evaluated,
        frame: Frame,
        shift: Array | None,
        form: NormalForm | None = None,
    ) -> tuple[float, float]:
        """A test function and its error, which takes an image with error bounds and ``shift``."""
        if signal in _COSINES:
            return at.place.cosine - _COSINES[signal], 0.0 if shift is None else float(shift[-1])
        if signal is Signal.DOUBLE:
            wrong = np.asarray(at.image.error * frame.size / frame.size[:, None])
            return own.overlap, 2.0 * at.reach * float(np.linalg.norm(np.broadcast_to(wrong, at.jacobian.shape)))
        if signal is Signal.COEFFICIENT:
            if not self._equations.target and abs(at.place.cosine) >= 1.0:
                return np.nan, np.nan  # past the end of the curve: two real multipliers with product 1
            form = self.form(own, at, frame, shift) if form is None else form
            value, error = self.coefficient(form)
            # A fold's is positive for one sense of its mode; where the multiplier is double it has a pole.
            factor = own.overlap if self._equations.target else 1.0
            return value * factor, error * abs(factor)
        nu, errors = own.spectrum.values[own.others], own.spectrum.error[own.others]
        if signal is Signal.PAIR:
            first, second = np.triu_indices(nu.size, 1)
            sizes, off = np.abs(nu), errors[first] * np.abs(nu[second]) + errors[second] * np.abs(nu[first])
            return _product(nu[first] * nu[second] - 1.0, 1.0 + sizes[first] * sizes[second], off)
        return _product(nu - (1.0 if signal is Signal.PLUS else -1.0), 1.0 + np.abs(nu), errors)

    def _located(self, signal: Signal, before: Spot, after: Spot) -> tuple[float, Spot, Codimension2] | None:
        equations, frame = self._equations, before.frame
        whole = frame.between(before.place, after.place)
        length = float(before.tangent @ whole)

        def at(place: float) -> Evaluated:
            guess = frame.moved(before.place, whole * (place / length))
            return equations.corrected(before, guess, before.tangent, place)[0]

        seen: dict[float, tuple[float, float]] = {}

        def test(place: float) -> float:
            if place not in seen:
                there = at(place)
                seen[place] = self._measure(signal, critical(equations.target, there, frame), there, frame, None)
            if np.isnan(seen[place][0]):
                raise _NoValue("the test function does not exist", field="special")
            return seen[place][0]

        def resolved(place: float) -> float:
            value = test(place)
            # Of an image without bounds the error is none.
            return 0.0 if abs(value) <= seen[place][1] < np.inf else value

        beside, unsure = _BESIDE * length, 0.0
        try:
            ends = test(0.0), test(length)
            if ends[0] * ends[1] > 0.0:
                return None
            root = float(brentq(resolved, 0.0, length, xtol=1e-15 * length, rtol=8.9e-16, maxiter=60, disp=False))
        except _NoValue:
            # A coefficient that is zero may be harder to find than those beside it, which then bracket it.
            (gap,) = (place for place, (value, _) in seen.items() if np.isnan(value))
            for share in _NEARER:
                place = gap + share * length
                if 0.0 < place < length:
                    with contextlib.suppress(_NoValue):
                        test(place)
            known = {place: value for place, (value, _) in seen.items() if not np.isnan(value)}
            if not known.keys() >= {0.0, length}:
                return None
            low = max(place for place, value in known.items() if value * known[0.0] > 0.0)
            high = min(place for place in known if place > low)
            root, beside = 0.5 * (low + high), 0.5 * (high - low)
            unsure = max(abs(known[low]), abs(known[high]))
        spot = equations.spot(at(root).place, frame, before.tangent)
        own = critical(equations.target, spot.at, spot.frame)
        value, error = self._measure(signal, own, spot.at, spot.frame, spot.shift)
        if np.isnan(value):
            value, error = 0.0, max(error for _, error in seen.values() if not np.isnan(error))
        if not unsure and abs(value) > _POLE * max(map(abs, ends)):
            return None
        kind = self._named(signal, spot, own)
        if kind is None:
            return None
        along = _along(test, at, root, beside, abs(value) + error + unsure)
        off = _SAFETY * spot.frame.widths * spot.shift[spot.frame.parameters]
        bound = off + along + 4.0 * np.finfo(float).eps * np.abs(spot.place.values)
        if not (bound < np.ptp(equations.box, axis=1)).all():  # which tells nothing
            return None
        found = Codimension2(kind, spot.place.values, bound, spot.place.state, own.spectrum.values)
        if signal is Signal.COEFFICIENT:
            slope = abs(test(root + beside) - test(root - beside)) / 2.0
            share = _SAFETY * (abs(value) + error + unsure) / slope
            found = self._with_next_term(found, spot, at(root + beside), frame, share)
        return root, spot, found

    def _with_next_term(
        self, found: Codimension2, spot: Spot, beside: Evaluated, frame: Frame, share: float
    ) -> Codimension2:
        """A point with the coefficient that does not vanish there, whose error has a share of its change to a place
        ``beside``: the point itself may be as far off."""
        target, terms = self._equations.target, []
        places = ((spot.at, spot.frame, spot.shift), (beside, frame, None))
        critical_there = [critical(target, at, written) for at, written, _ in places]
        forms = [self.form(own, *place) for own, place in zip(critical_there, places, strict=True)]
        for own, (at, written, _), form in zip(critical_there, places, forms, strict=True):
            value, error = form.cubic, form.cubic_error
            if self._kind not in WITHOUT_CRITICALITY:
                fifth = self.fifth(own, at, written, form, *forms)
                value, error = (np.nan, np.nan) if fifth is None else (fifth.coefficient, fifth.error)
            terms.append((value, error))
        (value, error), (other, unsure) = terms
        error += share * (abs(other - value) + error + unsure)
        return replace(found, next_coefficient=value, next_coefficient_error=error) if np.isfinite(error) else found

    def _named(self, signal: Signal, spot: Spot, own: Critical) -> CodimensionTwo | None:
        """Kind of the point at a zero of a test function; None where it means nothing."""
        target = self._equations.target
        if signal is Signal.COEFFICIENT:
            return DEGENERATE.get(self._kind)
        if signal in _RESONANCES:
            return _RESONANCES[signal]
        if signal is Signal.DOUBLE:
            return CodimensionTwo.RESONANCE_1_1 if target > 0 else CodimensionTwo.RESONANCE_1_2
        nu = own.spectrum.values[own.others]
        if signal is Signal.PAIR:
            complex_ones = np.abs(np.abs(nu) - 1.0)[np.abs(nu.imag) > _COMPLEX]
            # Two real multipliers with product 1 are nothing.
            reals = nu[np.abs(nu.imag) <= _COMPLEX].real
            products = np.abs(reals[:, None] * reals - 1.0)[np.triu_indices(reals.size, 1)]
            if not complex_ones.size or (products.size and products.min() < complex_ones.min()):
                return None
            return together(self._kind, Kind.NEIMARK_SACKER)
        sign = 1 if signal is Signal.PLUS else -1
        if sign == target and abs(own.overlap) < _OVERLAP:
            return None  # of a double multiplier the overlap tells
        index = own.others[int(np.abs(nu - sign).argmin())]
        mode = own.spectrum.right[:, index]
        system = self._equations.system(spot.place.values)
        if reverses(system, mode, spot.frame.size):
            kind = Kind.PITCHFORK
        elif sign < 0:
            kind = Kind.PITCHFORK if spot.at.image.returns == 2 else Kind.PERIOD_DOUBLING
        else:
            kind = Kind.BRANCH_POINT if self._equations.known else Kind.FOLD
        return together(self._kind, kind)


def across(spot: Spot) -> Array:
    """How far both parameters may be off, shape (2,), at right angles to the curve in the plane of the parameters."""
    frame = spot.frame
    response = np.linalg.pinv(spot.matrix)[frame.parameters]
    tangent = spot.tangent[frame.parameters]
    length = float(np.linalg.norm(tangent))
    if length > np.sqrt(np.finfo(float).eps):  # else a cusp, of which no direction is along
        normal = np.array([-tangent[1], tangent[0]]) / length
        response = np.outer(normal, normal @ response)
    return np.asarray(_SAFETY * frame.widths * (np.abs(response) @ spot.uncertainty))


def _along(
    test: Callable[[float], float], at: Callable[[float], Evaluated], root: float, h: float, error: float
) -> Array:
    """How far both parameters move, shape (2,), as far along the curve as a test function leaves open; from
    differences over h."""
    try:
        slope = abs(test(root + h) - test(root - h)) / (2.0 * h)
        low, middle, high = (at(root + s).place.values for s in (-h, 0.0, h))
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
