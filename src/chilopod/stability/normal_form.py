"""Normal-form coefficients at a bifurcation, from evaluations of the return map alone.

Near the critical orbit the return map H is sampled along the critical mode, bent by its quadratic part that leaves the
critical space; the terms of second and third order on the critical space are read off (Kuznetsov, *Elements of Applied
Bifurcation Theory*, sections 5.4, 8.7 and 9.2). Nothing but H is needed: no derivative of the right-hand side by hand,
no symbolic algebra. The amplitude at which H is sampled is found from H itself, by what its series look like: any
units give the same digits.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.stability.center_manifold import (
    CriticalOrbit,
    Powers,
    ReturnedStates,
    Sampled,
    displacements,
    images,
    sample,
    solve_homological,
    turns,
)
from chilopod.stability.extrapolation import radii
from chilopod.stability.resonances import strong_resonance, uncertainties

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_TRIALS = 40  # times that the map is sampled at an amplitude
_START = 0.2  # of the scale of the states, where the search for the amplitude starts
_SHARE = 0.03  # of the amplitude by which the map departs from its linear part, to look for
_TOO_FAR = 0.3  # of the same, beyond which nothing is learnt
_UP, _FIRST_DOWN = 30.0, 0.1  # longest step of the amplitude upward; step where the map cannot be evaluated
_FAR_DOWN, _LEAST_DOWN = 1e-3, 0.3  # longest and shortest step downward where the map is far from linear
_LOST = 1e-6  # relative departure from linearity that is too small to start from
_BLURRED = 1e-3  # share of the amplitude that errors at the orbit itself may have
_LONG_UP, _UPS = 1e3, 5  # step of the amplitude while a map seems linear, and how many make it so
_CLOSE = 4.0  # ratio of amplitudes between which no more is tried
_RESOLVED = 0.7  # factor of the amplitude that would be better, above which a series has fallen to the noise
_DOWNS = 6  # times that one is made smaller for that: a map that is not smooth never has
_BENDS = 3  # times that the curve is bent at one amplitude
_ENOUGH = 3e-8  # relative error at which no other amplitude is tried
_FULL = 8  # highest order to be seen beyond which a larger amplitude would rather lose
_BETTER = 0.3  # of the error, to go on for
_DRAWS = 3


class Status(enum.Enum):
    """What became of a normal form; each member's ``sentence`` says it in words."""

    FOUND = "found", "the coefficients hold within their errors"
    LINEAR = "linear", "no nonlinear term was seen along the mode, however large the amplitude"
    OUT_OF_REACH = "out of reach", "at no amplitude does the return map follow a power series"
    STRONG_RESONANCE = "strong resonance", "the pair is at a root of unity of order 1 to 4, where other terms decide too"
    SEVERAL_CRITICAL = "several critical", "another multiplier is on the unit circle as well"

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


@dataclass(frozen=True)
class NormalForm:
    """Leading coefficients of the full-period map on the critical space.

    With a the amplitude along the unit critical mode: real multiplier +1, a -> a + quadratic a^2 + cubic a^3. A
    multiplier -1 of the return map: the same, of the first map that has +1 again: the full period's where that is an
    even number of returns, else that of two periods. Neimark-Sacker (state = 2 Re(a mode)): |a| -> |a| + cubic |a|^3,
    while the phase of a advances by that of the multiplier + rotation |a|^2.

    A mode that is k times as long (because a unit is) has amplitudes that are 1/k of these, and so coefficients that
    are k (quadratic) and k^2 times as large (cubic, rotation).

    Attributes
    ----------
    status
        Whether the numbers mean anything. Where it is neither FOUND nor LINEAR they are NaN, their errors infinite;
        except at the resonances 1:3 and 1:4, where they are those of Kuznetsov's normal form but decide nothing alone.
    quadratic, cubic
        Coefficients. A negative ``cubic`` bounds the growth: supercritical.
    rotation
        rad per period; 0 unless the critical multipliers are complex.
    quadratic_error, cubic_error, rotation_error
        Bounds on how far they may be off: noise of the map, truncation, and an orbit that is not exact.
    amplitude
        Largest amplitude at which the map was sampled for these numbers.
    resonance
        k where the pair is exp(+-2 pi i / k) within its uncertainty, k = 1 ... 4; else None.
    resonant, resonant_error
        At 1:3 and 1:4: coefficient of conj(a)^2, or conj(a)^3, of one return; turning the mode by an angle turns it.
    ratio
        At 1:4: A = -i C / |D| of Kuznetsov, section 9.5.3, with C and D the coefficients of a |a|^2 and conj(a)^3.
    """

    status: Status
    quadratic: float = np.nan
    quadratic_error: float = np.inf
    cubic: float = np.nan
    cubic_error: float = np.inf
    rotation: float = 0.0
    rotation_error: float = 0.0
    amplitude: float = np.nan
    resonance: int | None = None
    resonant: complex | None = None
    resonant_error: float | None = None
    ratio: complex | None = None


def normal_form(
    mapped: ReturnedStates,
    at: CriticalOrbit,
    *,
    noise: float = 0.0,
    uncertainty: float = 0.0,
    scale: ArrayLike | None = None,
    orbit_error: float | None = None,
) -> NormalForm:
    """Normal form on the centre manifold of a critical orbit.

    Parameters
    ----------
    mapped
        The return map, of states of shape (k, n) at once.
    at
        The critical orbit.
    noise
        Relative error of the map: an image's entries are off by at most ``noise`` of the largest value they take
        near the orbit. What is seen in the samples, and round-off, is allowed for anyway.
    uncertainty
        Relative error of the jacobian: how near to a root of unity, or to the unit circle, a multiplier is on it.
    scale
        Sizes of the states, shape (n,), in their units: where the search for an amplitude starts. Without it, it
        starts from the size of the orbit, if that has one.
    orbit_error
        How far off ``at.state`` may be along the mode (in the amplitude's unit); 0 where it is exact. Without it, what
        its residual and the noise allow: beside a singular H - 1 that is much.

    Returns
    -------
    The normal form, with a status that says why where there is none.
    """
    values, errors = uncertainties(at.jacobian, max(uncertainty, noise, 16.0 * np.finfo(float).eps))
    own = [int(np.abs(values - one).argmin()) for one in (at.multiplier, at.multiplier.conjugate())]
    others = np.delete(np.arange(values.size), own)
    if (np.abs(np.abs(values[others]) - 1.0) <= errors[others]).any():
        return NormalForm(Status.SEVERAL_CRITICAL)
    resonance = None if at.real else strong_resonance(at.multiplier, float(errors[own[0]]))
    if resonance in (1, 2):
        return NormalForm(Status.STRONG_RESONANCE, resonance=resonance)
    fit = _Search(mapped, at, noise, resonance).run(_start(at, scale))
    if fit is None:
        return NormalForm(Status.OUT_OF_REACH, resonance=resonance)
    if at.real:
        return _of_full_period(fit, mapped, at, noise, orbit_error)
    cubic = at.returns * np.conj(at.multiplier) * fit.cubic
    error = at.returns * fit.cubic_error
    form = NormalForm(
        fit.status, 0.0, 0.0, float(cubic.real), error, float(cubic.imag), error, fit.sampled.radius, resonance
    )
    return form if resonance is None else _with_resonant_terms(form, fit, at, resonance)


def _start(at: CriticalOrbit, scale: ArrayLike | None) -> float:
    """An amplitude to start the search from; what comes out does not depend on it."""
    mode = np.abs(at.right)
    if scale is not None:
        known = mode > 0.0
        return _START * float((np.abs(np.asarray(scale, dtype=np.float64))[known] / mode[known]).min())
    orbit = float(np.abs(at.state).max())
    # Nothing is known of an orbit at the origin: the search has all the way to go then, up or down.
    return orbit / float(mode.max()) if orbit > 0.0 else _START


def _loose_by(mapped: ReturnedStates, at: CriticalOrbit, noise: float, quadratic: float, cubic: float) -> float:
    """How far along the mode an orbit may be off that returns as nearly as this one does, where H - 1 is singular.

    Off by d, where the multiplier is 1 all the same, it misses itself by quadratic d^2 - cubic d^3, with the
    coefficients as they are seen there; beside the symmetric orbit of a pitchfork that is 2 cubic d^3.
    """
    image = None if at.multiplier.real < 0.0 else images(mapped, at, np.zeros((1, at.state.size)))
    if image is None:
        return 0.0
    rounding = max(noise, 2.0 * np.finfo(float).eps) * np.abs(at.state)
    missed = float(abs(image[0] @ at.left)) + float(np.abs(at.left) @ rounding)
    if missed == 0.0:
        return 0.0
    by_cubic = float(np.cbrt(missed / (2.0 * cubic))) if cubic > 0.0 else np.inf
    # A quadratic term that no pitchfork beside this orbit explains holds the orbit closer.
    return min(by_cubic, 2.0 * float(np.sqrt(missed / quadratic))) if quadratic > 6.0 * cubic * by_cubic else by_cubic


def _of_full_period(
    fit: _Fit, mapped: ReturnedStates, at: CriticalOrbit, noise: float, orbit_error: float | None
) -> NormalForm:
    """From one return at a real multiplier to the map whose multiplier is +1."""
    quadratic, quadratic_error = fit.term((2, 0))
    cubic, cubic_error = fit.cubic.real, fit.cubic_error
    fourth, fourth_error = fit.term((4, 0))
    off = orbit_error if orbit_error is not None else _loose_by(mapped, at, noise, abs(quadratic), abs(cubic) + cubic_error)
    if off > 0.0:
        quadratic_error += 3.0 * (abs(cubic) + cubic_error) * off
        cubic_error += 4.0 * (abs(fourth) + fourth_error) * off
    k = at.returns
    if at.multiplier.real < 0.0:
        # a -> -a + c a^3 twice: a -> a - 2 c a^3.
        times = k if k % 2 == 0 else 2 * k
        return NormalForm(fit.status, 0.0, 0.0, -times * cubic, times * cubic_error, amplitude=fit.sampled.radius)
    return NormalForm(
        fit.status,
        k * quadratic.real,
        k * quadratic_error,
        k * cubic + k * (k - 1) * quadratic.real**2,
        k * cubic_error + k * (k - 1) * (2.0 * abs(quadratic) + quadratic_error) * quadratic_error,
        amplitude=fit.sampled.radius,
    )


def _with_resonant_terms(form: NormalForm, fit: _Fit, at: CriticalOrbit, resonance: int) -> NormalForm:
    """The terms conj(a)^2 and conj(a)^3 of one return."""
    resonant, error = fit.term((0, resonance - 1))
    ratio = None
    if resonance == 4 and abs(resonant) > error:
        ratio = complex(-1j * fit.cubic / abs(resonant))
    return replace(
        form,
        status=Status.STRONG_RESONANCE,
        resonant=complex(resonant),
        resonant_error=float(error),
        ratio=ratio,
    )


@dataclass(frozen=True)
class _Fit:
    """Terms of one return on the centre manifold."""

    status: Status
    sampled: Sampled
    cubic: complex
    cubic_error: float

    def term(self, powers: Powers) -> tuple[complex, float]:
        """Coefficient of a monomial in the projection of H, and its error."""
        value, error = self.sampled.taylor(powers)
        return complex(value[-1]), float(error[-1])


class _Search:
    """For the amplitude, and for the bend of the curve, at which the cubic coefficient is best known."""

    def __init__(self, mapped: ReturnedStates, at: CriticalOrbit, noise: float, resonance: int | None) -> None:
        self._mapped, self._at, self._noise = mapped, at, noise
        self._third: Powers = (3, 0) if at.real else (2, 1)
        # Whether nu^i conj(nu)^j is critical itself.
        self._second = {(2, 0): at.multiplier == 1.0} if at.real else {(2, 0): resonance == 3, (1, 1): False}
        self._curve: dict[Powers, ComplexArray] = {(1, 0): at.right.astype(np.complex128)}
        for powers in self._second:
            self._curve[powers] = np.zeros(at.state.size, dtype=np.complex128)

    def run(self, radius: float) -> _Fit | None:
        """Search on from an amplitude; None if there is none that serves."""
        low, high = 0.0, np.inf  # amplitudes at which nothing is seen, and that are too large
        best: tuple[Sampled, dict[Powers, ComplexArray]] | None = None
        best_error, status = np.inf, Status.LINEAR
        bends = downs = turned = 0
        growing = 0.0
        for _ in range(_TRIALS):
            found = sample(self._mapped, self._at, self._curve, radius, self._noise)
            share, order, seen = (np.inf, 2, True) if found is None else _departure(found, self._at)
            if found is not None and found.blur > _BLURRED * radius:
                low, factor = radius, _UP
            elif found is None or share > _TOO_FAR:
                high, factor = radius, _FIRST_DOWN if found is None else _toward(share, order)
            elif status is Status.LINEAR and downs < _DOWNS and found.falling and found.shrink < _RESOLVED:
                high, factor, downs = radius, max(found.shrink, _FIRST_DOWN), downs + 1
            elif bends < _BENDS and self._bend(found):
                bends += 1
                continue  # once more, along the better curve
            elif not seen:
                best, low, factor = (found, dict(self._curve)), radius, self._linear_up(radius, high)
            else:
                value, error = (float(np.abs(one[-1])) for one in found.taylor(self._third))
                better = error < _BETTER * best_error
                if error < best_error:
                    best, best_error, status = (found, dict(self._curve)), error, Status.FOUND
                full = _highest(found) > _FULL
                if error <= _ENOUGH * value or (full and found.shrink > _RESOLVED):
                    break
                if growing == 0.0:
                    growing = -1.0 if full else 1.0
                elif not better:
                    growing, turned = -growing, turned + 1
                    radius = best[0].radius if best else radius
                if turned > 1:
                    break
                factor = max(_toward(share, order) ** 0.5, 2.0) if growing > 0.0 else 0.5
            bends = 0
            nearer = _within(radius * factor, low, high)
            if nearer is None:
                break
            radius = nearer
        if best is None or (status is Status.LINEAR and np.isfinite(high)):
            return None
        found, self._curve = best
        return self._described(found, status)

    def _linear_up(self, radius: float, high: float) -> float:
        """How many times as large an amplitude may be, at least, before anything nonlinear shows."""
        at, factor = self._at, 1.0
        reach = np.abs(at.jacobian)
        for _ in range(_UPS):
            factor *= _LONG_UP
            if factor * radius >= high:
                break
            shift = displacements(at, self._curve, factor * radius * turns(at))
            image = images(self._mapped, at, shift)
            if image is None:
                break
            size = np.abs(at.state) + np.abs(shift) @ reach.T
            if (np.abs(image - shift @ at.jacobian.T) > _LOST * size).any():
                break
        else:
            return np.inf
        return factor

    def _excess(self, found: Sampled, powers: Powers) -> tuple[ComplexArray, Array]:
        """What H(W) has at second order and W has not, with the error of that, shape (n,)."""
        at, (i, j) = self._at, powers
        value, error = found.taylor(powers)
        excess = value[:-1] - at.multiplier**i * at.multiplier.conjugate() ** j * self._curve[powers]
        if self._second[powers] and at.real:
            excess = excess - value[-1] * at.right
        return excess, error[:-1]

    def _bend(self, found: Sampled) -> bool:
        """Bend the curve along the centre manifold; whether that was called for."""
        bent = False
        for powers, resonant in self._second.items():
            excess, error = self._excess(found, powers)
            if (np.abs(excess) > 2.0 * error).any():
                bent = True
                self._curve[powers] = (
                    self._curve[powers] + solve_homological(self._at, powers, excess[:, None], resonant)[:, 0]
                )
        return bent

    def _described(self, found: Sampled, status: Status) -> _Fit:
        at = self._at
        value, error = found.taylor(self._third)
        return _Fit(status, found, complex(value[-1]), float(error[-1]) + self._bent_wrongly(found))

    def _bent_wrongly(self, found: Sampled) -> float:
        """How far the cubic coefficient may be off because the curve is: sampled on curves that are off by that."""
        at = self._at
        n = at.state.size
        if n == (1 if at.real else 2):
            return 0.0
        off = {powers: np.abs(excess) + error for powers in self._second for excess, error in [self._excess(found, powers)]}
        random = np.random.default_rng(0)
        directions = turns(at)
        largest = found.radius * radii()[0]
        z = largest * directions
        worst = 0.0
        for _ in range(_DRAWS):
            wrong = {}
            for powers, resonant in self._second.items():
                signs = random.choice([-1.0, 1.0], n) if at.real else np.exp(2j * np.pi * random.random(n))
                wrong[powers] = solve_homological(at, powers, (signs * off[powers])[:, None], resonant)[:, 0]
            shift = displacements(at, wrong, z)
            with np.errstate(divide="ignore", invalid="ignore"):
                ratios = np.abs(shift).max(axis=0) / found.size
            ratios = ratios[np.isfinite(ratios) & (ratios > 0.0)]
            if not ratios.size:
                continue
            times = 0.3 / float(ratios.max())
            curve = displacements(at, self._curve, z) + times * shift
            image = images(self._mapped, at, curve)
            if image is None:
                return np.inf
            harmonic = np.fft.fft(image @ at.left.conj())[1] / directions.size
            worst = max(worst, float(abs(harmonic - found.outermost[1])) / (times * largest**3))
        return 2.0 * worst


def _departure(found: Sampled, at: CriticalOrbit) -> tuple[float, int, bool]:
    """How far the projected map departs from its linear part, relative to the amplitude; by a term of which order
    mostly; and whether that is more than noise."""
    share, order = 0.0, 2
    for one in found.harmonics:
        sizes = np.abs(one.coefficients[1:, -1])
        largest = int(sizes.argmax())
        if sizes[largest] > share:
            share, order = float(sizes[largest]), one.parity + 2 * (largest + 1)
    seen = share > 4.0 * float(found.noise[-1])
    # A map that saturates is linear again far out, with another slope.
    slope = abs(found.harmonics[1].coefficients[0, -1] - at.multiplier * found.radius)
    if slope > _TOO_FAR * found.radius:
        share, seen = max(share, float(slope)), True
    return share / found.radius, order, seen


def _highest(found: Sampled) -> int:
    """The highest order that stands out of the noise in the projected map."""
    return max(
        one.parity + 2 * int(np.flatnonzero(np.abs(one.coefficients[:, -1]) > found.noise[-1]).max(initial=0))
        for one in found.harmonics
    )


def _toward(share: float, order: int) -> float:
    """The factor of the amplitude at which a term of some order has the share that is looked for."""
    if share == 0.0:
        return _UP
    factor = float((_SHARE / share) ** (1.0 / (order - 1)))
    return min(max(factor, _FAR_DOWN), _LEAST_DOWN) if share > _TOO_FAR else min(factor, _UP)


def _within(radius: float, low: float, high: float) -> float | None:
    """An amplitude between two, by preference a given one; None where they are close together."""
    if low < radius < high:
        return radius
    between = float(np.sqrt(low) * np.sqrt(high))
    return between if 0.0 < between < np.inf and high > _CLOSE * low else None
