"""Normal-form coefficients at a bifurcation, from evaluations of the return map alone.

The return map is sampled along the critical mode, bent along the centre manifold (:mod:`.manifold`). At the amplitude
with the least error of the cubic coefficient, :func:`normal_form` takes the terms of second and third order of one
return, and converts them to those of the map over a full period. :func:`quintic` does the same for the term of fifth
order, which decides where the cubic one vanishes. The series of the samples show their own accuracy and so lead to the
amplitude: any units give the same digits.

Terms after Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 5.4, 8.7, 9.2 and 9.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from chilopod.labels import Labelled
from chilopod.stability.normal_forms.manifold import CriticalOrbit, Manifold, ManifoldCurve, Sampled, StateMap, Term
from chilopod.stability.spectrum import spectrum

_START = 0.1  # first amplitude of the search, relative to the scale of the states


class NormalFormStatus(Labelled):
    """Status of a normal form; each member's ``sentence`` describes it in words."""

    FOUND = "found", "the coefficients hold within their errors"
    LINEAR = "linear", "no nonlinear term was seen along the mode, at the amplitude with the least error"
    OUT_OF_REACH = "out of reach", "at no amplitude does the return map follow a power series"
    STRONG_RESONANCE = ("strong resonance", "the pair is at a root of unity of order 1 to 4, where more terms decide")
    SEVERAL_CRITICAL = "several critical", "another multiplier is on the unit circle as well"


@dataclass(frozen=True)
class NormalForm:
    """Leading coefficients on the critical space, of the map over one period, or over two at a period doubling.

    With a the amplitude along the unit critical mode: real multiplier +1, a -> a + quadratic a^2 + cubic a^3. A
    multiplier -1 of the return map: the same, with ``quadratic`` zero, of the first map that has +1 again: over one
    period if it is an even number of returns (a pitchfork that breaks a symmetry in time), else over two (a period
    doubling, with ``cubic`` -2 (b^2 + d) where one period maps a to -a + b a^2 + d a^3). Neimark-Sacker (state = 2 Re(a
    mode)): |a| -> |a| + cubic |a|^3, while the phase of a advances by that of the multiplier + rotation |a|^2.

    A mode k times as long has coefficients k times (quadratic) and k^2 times as large (cubic, rotation).

    Attributes
    ----------
    status
        Status of the numbers. If it is neither FOUND nor LINEAR they are NaN with infinite errors.
    quadratic, cubic
        Coefficients. A negative ``cubic`` bounds the growth: supercritical.
    rotation
        Change of phase in rad per period; 0 unless the critical multipliers are complex.
    quadratic_error, cubic_error, rotation_error
        Bounds on their errors: noise of the map, truncation, and error of the orbit.
    amplitude
        Largest amplitude at which the map was sampled for these numbers.
    resonance
        Number k, 1 to 4, if the pair is exp(+-2 pi i / k) within its uncertainty; else None.
    """

    status: NormalFormStatus
    quadratic: float = np.nan
    quadratic_error: float = np.inf
    cubic: float = np.nan
    cubic_error: float = np.inf
    rotation: float = 0.0
    rotation_error: float = 0.0
    amplitude: float = np.nan
    resonance: int | None = None


def normal_form(
    mapped: StateMap,
    at: CriticalOrbit,
    *,
    scale: ArrayLike = 1.0,  # sizes of the states, shape (n,), where the search for an amplitude starts
    orbit_error: float | None = None,  # error of the orbit along the mode; by default from its residual
) -> NormalForm:
    """Normal form on the centre manifold of a critical orbit of a map of several states, shape (k, n)."""
    spec = spectrum(at.image)
    own = [spec.nearest(one) for one in (at.multiplier, at.multiplier.conjugate())]
    if (np.abs(np.abs(np.delete(spec.values, own)) - 1.0) <= np.delete(spec.error, own)).any():
        return NormalForm(NormalFormStatus.SEVERAL_CRITICAL)
    # Where the terms z^(k-1) of the conjugate are resonant as well (Kuznetsov, sections 9.5.1 to 9.5.4).
    upper = complex(at.multiplier.real, abs(at.multiplier.imag))
    for k in () if at.real else (1, 2, 3, 4):
        if abs(upper - np.exp(2j * np.pi / k)) <= spec.error[own[0]]:
            return NormalForm(NormalFormStatus.STRONG_RESONANCE, resonance=k)
    manifold = Manifold(mapped, at, 3)
    # An overflow far out is a valid result.
    with np.errstate(all="ignore"):
        fit = _fitted(manifold, _START * float(np.nanmin(np.abs(scale) / np.abs(at.right))))
    if fit is None:
        return NormalForm(NormalFormStatus.OUT_OF_REACH)
    if at.real:
        return _of_full_period(fit, manifold, orbit_error)
    status, sampled, (cubic, error) = fit
    cubic, error = at.image.returns * np.conj(at.multiplier) * cubic, at.image.returns * error
    return NormalForm(status, 0.0, 0.0, float(cubic.real), error, float(cubic.imag), error, sampled.radius)


def _of_full_period(fit: Fit, manifold: Manifold, orbit_error: float | None) -> NormalForm:
    """Coefficients of the map with multiplier +1 from those of one return at a real multiplier."""
    status, sampled, (third, cubic_error) = fit
    cubic, (quadratic, quadratic_error) = third.real, sampled.term((2, 0))
    off = _loose_by(manifold, abs(quadratic), abs(cubic) + cubic_error) if orbit_error is None else orbit_error
    if off > 0.0:
        quadratic_error += 3.0 * (abs(cubic) + cubic_error) * off
        fourth, fourth_error = sampled.term((4, 0))
        cubic_error += 4.0 * (abs(fourth) + fourth_error) * off
    k = manifold.at.times
    if manifold.at.multiplier.real < 0.0:
        # a -> -a + c a^3 twice: a -> a - 2 c a^3.
        return NormalForm(status, 0.0, 0.0, -k * cubic, k * cubic_error, amplitude=sampled.radius)
    cubic = k * cubic + k * (k - 1) * quadratic.real**2
    cubic_error = k * cubic_error + k * (k - 1) * (2.0 * abs(quadratic) + quadratic_error) * quadratic_error
    return NormalForm(status, k * quadratic.real, k * quadratic_error, cubic, cubic_error, amplitude=sampled.radius)


def _loose_by(manifold: Manifold, quadratic: float, cubic: float) -> float:
    """Error d along the mode of an orbit with this residual, where H - 1 is singular: beside the symmetric orbit of a
    pitchfork the residual is at least cubic d^3, with an apparent quadratic term 3 cubic d; beside a transcritical
    point it is quadratic d^2."""
    at = manifold.at
    image = None if at.multiplier.real < 0.0 else manifold.images(np.zeros((1, at.state.size)))
    if image is None:
        return 0.0
    rounding = 2.0 * float(np.finfo(float).eps)
    missed = float(abs(image[0] @ at.left) + rounding * (np.abs(at.left) @ np.abs(at.state)))
    if missed == 0.0:
        return 0.0
    by_cubic = float(1.5 * np.cbrt(missed / cubic)) if cubic > 0.0 else np.inf
    # A quadratic term that no near pitchfork explains bounds the error more closely.
    return min(by_cubic, 2.0 * float(np.sqrt(missed / quadratic))) if quadratic > 6.0 * cubic * by_cubic else by_cubic


_TRIALS = 40  # largest number of sampled amplitudes
_SHARE = 0.03  # wanted departure of the map from its linear part, relative to the amplitude
_FAR = 5.0  # largest departure that a step upward for accuracy may reach, relative to the wanted one
_TOO_FAR = 0.3  # largest useful departure
_UP, _FIRST_DOWN = 30.0, 0.1  # longest step of the amplitude upward; step where the map cannot be evaluated
_FAR_DOWN, _LEAST_DOWN = 1e-3, 0.3  # longest and shortest step downward where the map is far from linear
_LOST = 1e-6  # relative departure from linearity that is too small to start from
_BLURRED = 1e-3  # largest error at the orbit itself, or hiding terms, relative to the amplitude
_LONG_UP, _UPS = 1e3, 5  # step of the amplitude while a map seems linear, and number of such steps
_CLOSE = 4.0  # ratio of amplitudes that ends the search
_RESOLVED = 0.7  # proposed factor of the amplitude above which a series has converged to the noise
_DOWNS = 6  # largest number of steps down for convergence: the series of a map that is not smooth never converges
_BENDS = 3  # largest number of bends of the curve at one amplitude
_ENOUGH = 3e-8  # relative error that ends the search
_FULL = 8  # highest visible order above which a larger amplitude would lose accuracy
_BETTER = 0.3  # factor on the error that justifies a further step

Fit = tuple[NormalFormStatus, Sampled, Term]  # FOUND or LINEAR, the map at the best amplitude, cubic term of a return


def _fitted(manifold: Manifold, radius: float) -> Fit | None:
    """The terms at the amplitude and bend of the most accurate cubic coefficient; None if none is suitable.

    The search lowers the amplitude where the map is far from its linear part, raises it where the noise hides the
    nonlinear terms, bends the curve along the centre manifold, and continues while the error of the coefficient falls.
    """
    third = (3, 0) if manifold.at.real else (2, 1)
    # Hill climbing in the amplitude, up or down (`direction`, 0 before an error is known). `best` tells whether terms
    # are visible where the error of the coefficient is the `least`; `least_seen` is the least one with visible terms.
    low, high = 0.0, np.inf  # largest amplitude without visible terms, and smallest too large one
    best, least, least_seen = None, np.inf, np.inf
    bends = ups = downs = reversals = 0
    direction = 0.0
    for _ in range(_TRIALS):
        sample = manifold.sample(radius)
        departure, order, visible = (np.inf, 2, True) if sample is None else _departure(sample, manifold.at.multiplier)
        if sample is not None and sample.blur > _BLURRED * radius:  # the orbit's error hides the terms
            low, factor = radius, _UP
        elif sample is None or departure > _TOO_FAR:
            high, factor = radius, _FIRST_DOWN if sample is None else _toward(departure, order)
        elif visible and least_seen == np.inf and downs < _DOWNS and sample.falling and sample.shrink < _RESOLVED:
            high, factor, downs = radius, max(sample.shrink, _FIRST_DOWN), downs + 1  # the series has not converged
        elif bends < _BENDS and manifold.bend(sample):
            bends += 1
            continue  # once more, along the better curve
        elif not visible:  # the map is linear to its error, unless this grows, as beyond a kink
            error = sample.term(third)[1]
            if error >= least and best and radius > best[1].radius:
                high, factor = radius, _LEAST_DOWN
            else:
                best, least = ((False, sample, dict(manifold.curve)), error) if error < least else (best, least)
                low, ups = radius, ups + 1
                factor = _linear_up(manifold, radius, high) if ups <= _UPS else np.inf
        else:
            value, error = sample.term(third)
            better, least_seen = error < _BETTER * least_seen, min(error, least_seen)
            best, least = ((True, sample, dict(manifold.curve)), error) if error < least else (best, least)
            full = _highest(sample) > _FULL
            if error <= _ENOUGH * abs(value) or (full and sample.shrink > _RESOLVED):
                break
            if direction == 0.0:
                direction = -1.0 if full else 1.0
            elif not better:
                direction, reversals = -direction, reversals + 1
                radius = best[1].radius if best else radius
            if reversals > 1:
                break
            # The noise in the coefficient falls with the third power of the amplitude.
            wanted = min(float(np.cbrt(error / max(_ENOUGH * abs(value), 1e-300))), _toward(departure / _FAR, order))
            factor = max(_toward(departure, order) ** 0.5, wanted, 2.0) if direction > 0.0 else 0.5
        bends = 0
        if (nearer := _within(radius * factor, low, high)) is None:
            break
        radius = nearer
    # Terms that are hidden near a border of the map may matter.
    if best is None or (not best[0] and np.isfinite(high) and best[1].noise[-1] > _BLURRED * best[1].radius):
        return None
    visible, sample, manifold.curve = best
    status = NormalFormStatus.FOUND if visible else NormalFormStatus.LINEAR
    return status, sample, manifold.coefficient(sample, third)


def _linear_up(manifold: Manifold, radius: float, high: float) -> float:
    """Least factor on the amplitude at which nonlinear terms may become visible; infinite if none is found."""
    at, factor = manifold.at, 1.0
    for _ in range(_UPS):
        factor *= _LONG_UP
        if factor * radius >= high:
            break
        shift = at.displacements(manifold.curve, factor * radius * at.turns())
        image = manifold.images(shift)
        if image is None:
            break
        size = np.abs(at.state) + np.abs(shift) @ np.abs(at.image.jacobian).T
        if (np.abs(image - shift @ at.image.jacobian.T) > _LOST * size).any():
            break
    else:
        return np.inf
    return factor


def _departure(found: Sampled, multiplier: complex) -> tuple[float, int, bool]:
    """Departure from linearity relative to the amplitude, order of its main term, True if it exceeds the noise."""
    sizes = np.abs([one.coefficients[1:, -1] for one in found.harmonics])
    h, k = np.unravel_index(int(sizes.argmax()), sizes.shape)
    share, order = float(sizes[h, k]), found.harmonics[h].parity + 2 * int(k) + 2
    seen = share > 4.0 * float(found.noise[-1])
    # A saturating map is linear again far out, with another slope.
    slope = abs(found.harmonics[1].coefficients[0, -1] - multiplier * found.radius)
    if slope > _TOO_FAR * found.radius:
        share, seen = max(share, float(slope)), True
    return share / found.radius, order, seen


def _highest(found: Sampled) -> int:
    """The highest order above the noise in the projected map."""
    return max(
        one.parity + 2 * int(np.flatnonzero(np.abs(one.coefficients[:, -1]) > found.noise[-1]).max(initial=0))
        for one in found.harmonics
    )


def _toward(share: float, order: int) -> float:
    """The factor of the amplitude at which a term of some order has the wanted size."""
    if share == 0.0:
        return _UP
    factor = float((_SHARE / share) ** (1.0 / (order - 1)))
    return min(max(factor, _FAR_DOWN), _LEAST_DOWN) if share > _TOO_FAR else min(factor, _UP)


def _within(radius: float, low: float, high: float) -> float | None:
    """An amplitude between two, preferably a given one; None if they are close together."""
    if low < radius < high:
        return radius
    between = float(np.sqrt(low) * np.sqrt(high))
    return between if 0.0 < between < np.inf and high > _CLOSE * low else None


_QUINTIC_BENDS = 4  # one for every order of the manifold, and one more
_STEP = 1.5  # ratio of successive amplitudes
_TRIES = 8  # largest number of amplitudes each way
_WORSE = 2  # amplitudes tried beyond the best one


@dataclass(frozen=True)
class Quintic:
    """The map over the full period on the centre manifold, where its cubic coefficient vanishes."""

    # Coefficient e of a -> a + e a^5 (a pair: |a| -> |a| + e |a|^5), of the map of the cubic coefficient of a
    # :class:`~chilopod.stability.normal_forms.normal_form.NormalForm`, and a bound on its error.
    coefficient: float
    error: float
    curve: ManifoldCurve  # the centre manifold, up to fourth order
    amplitude: float  # largest amplitude at which the return map was sampled


def quintic(mapped: StateMap, at: CriticalOrbit, amplitude: float) -> Quintic | None:
    """The coefficient of fifth order at a critical orbit, from the amplitude with the smallest error; the search starts
    at that of the normal form of third order. None if the map is undefined at all amplitudes. A multiplier +1 belongs
    to a pitchfork, whose symmetry excludes terms of even order."""
    best: Quintic | None = None
    manifold = Manifold(mapped, at, 5)
    curve: ManifoldCurve = manifold.curve
    for factor, radius in ((_STEP, amplitude), (1.0 / _STEP, amplitude / _STEP)):
        worse, tries = 0, 0
        while worse < _WORSE and tries < _TRIES:
            manifold.curve = dict(curve)
            with np.errstate(all="ignore"):
                found = _fifth_at(manifold, radius * factor**tries)
            tries, worse = tries + 1, worse + 1
            if found is not None and (best is None or found.error < best.error):
                best, curve, worse = found, found.curve, 0
    return best


def _fifth_at(manifold: Manifold, radius: float) -> Quintic | None:
    """The coefficient of fifth order from samples up to a radius; None if the map is undefined there."""
    found, bends = manifold.sample(radius), 0
    while found is not None and bends < _QUINTIC_BENDS and manifold.bend(found):
        found, bends = manifold.sample(radius), bends + 1
    if found is None:
        return None
    powers = ((3, 0), (5, 0)) if manifold.at.real else ((2, 1), (3, 2))
    third, fifth = (manifold.coefficient(found, each) for each in powers)
    coefficient, error = _fifth_of_full_period(manifold.at, third, fifth)
    return Quintic(coefficient, error, manifold.curve, found.radius) if np.isfinite(error) else None


def _fifth_of_full_period(at: CriticalOrbit, third: Term, fifth: Term) -> tuple[float, float]:
    """Coefficient of fifth order over a full period, or over two, from the terms of one return."""
    (c, c_error), (e, e_error) = third, fifth
    cubic, cubic_error, value, error, times = c.real, c_error, e.real, e_error, at.times
    if not at.real:
        # z -> nu z (1 + c |z|^2 + e |z|^4): |1 + u| = 1 + Re u + (Im u)^2 / 2 + ...
        c, e = c * at.multiplier.conjugate(), e * at.multiplier.conjugate()
        cubic, value = c.real, e.real + 0.5 * c.imag * c.imag
        error += (abs(c.imag) + 0.5 * c_error) * c_error
    elif at.multiplier.real < 0.0:
        # a -> -a + c a^3 + e a^5 twice: a -> a - 2 c a^3 + (3 c^2 - 2 e) a^5.
        value = 3.0 * cubic * cubic - 2.0 * value
        error = 2.0 * error + 3.0 * (2.0 * abs(cubic) + cubic_error) * cubic_error
        cubic, cubic_error = -2.0 * cubic, 2.0 * cubic_error
        times //= 2
    # a -> a + c a^3 + e a^5, iterated.
    pairs = 1.5 * times * (times - 1)
    error = times * error + pairs * (2.0 * abs(cubic) + cubic_error) * cubic_error
    return times * value + pairs * cubic * cubic, error
