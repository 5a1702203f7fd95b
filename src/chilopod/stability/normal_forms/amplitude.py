"""The amplitude at which a return map shows most of its nonlinear terms, and the terms that it shows there.

The search compares the map only with itself: it goes down where the map is far from its linear part, up where nothing
stands out of the noise, bends the curve it samples along the centre manifold, and then moves on while the error of the
cubic coefficient falls.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.labels import Labelled
from chilopod.stability.normal_forms.center_manifold import (
    CriticalOrbit,
    Curve,
    Powers,
    ReturnedStates,
    Sampled,
    displacements,
    images,
    sample,
    solve_homological,
    turns,
)
from chilopod.stability.normal_forms.extrapolation import radii

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_TRIALS = 40  # times that the map is sampled at an amplitude
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
_DRAWS = 3  # of curves that are off at random
_SURE = 2.0  # for the worst of which
_WRONG = 0.3  # how far off they are, of what the states move


class NormalFormStatus(Labelled):
    """What became of a normal form; each member's ``sentence`` says it in words."""

    FOUND = "found", "the coefficients hold within their errors"
    LINEAR = "linear", "no nonlinear term was seen along the mode, however large the amplitude"
    OUT_OF_REACH = "out of reach", "at no amplitude does the return map follow a power series"
    STRONG_RESONANCE = (
        "strong resonance",
        "the pair is at a root of unity of order 1 to 4, where more terms decide",
    )
    SEVERAL_CRITICAL = "several critical", "another multiplier is on the unit circle as well"


@dataclass(frozen=True)
class Fit:
    """Terms of one return on the centre manifold.

    Attributes
    ----------
    status
        FOUND or LINEAR.
    sampled
        The map where it shows most.
    cubic, cubic_error
        Coefficient of the resonant cubic term.
    """

    status: NormalFormStatus
    sampled: Sampled
    cubic: complex
    cubic_error: float

    def term(self, powers: Powers) -> tuple[complex, float]:
        """Coefficient of a monomial in the projection of H, and its error."""
        value, error = self.sampled.taylor(powers)
        return complex(value[-1]), float(error[-1])


class Search:
    """For the amplitude, and for the bend of the curve, at which the cubic coefficient is best known."""

    def __init__(self, mapped: ReturnedStates, at: CriticalOrbit, noise: float, resonance: int | None) -> None:
        self._mapped, self._at, self._noise = mapped, at, noise
        self._third: Powers = (3, 0) if at.real else (2, 1)
        # Whether nu^i conj(nu)^j is critical itself.
        self._second = {(2, 0): at.multiplier == 1.0} if at.real else {(2, 0): resonance == 3, (1, 1): False}
        self._curve: dict[Powers, ComplexArray] = {(1, 0): at.right.astype(np.complex128)}
        for powers in self._second:
            self._curve[powers] = np.zeros(at.state.size, dtype=np.complex128)

    def run(self, radius: float) -> Fit | None:
        """Search on from an amplitude; None if there is none that serves."""
        low, high = 0.0, np.inf  # amplitudes at which nothing is seen, and that are too large
        best: tuple[Sampled, dict[Powers, ComplexArray]] | None = None
        best_error, status = np.inf, NormalFormStatus.LINEAR
        bends = ups = downs = turned = 0
        growing = 0.0
        for _ in range(_TRIALS):
            found = sample(self._mapped, self._at, self._curve, radius, self._noise)
            share, order, seen = (np.inf, 2, True) if found is None else _departure(found, self._at)
            if found is not None and found.blur > _BLURRED * radius:
                low, factor = radius, _UP
            elif found is None or share > _TOO_FAR:
                high, factor = radius, _FIRST_DOWN if found is None else _toward(share, order)
            elif (
                seen
                and status is NormalFormStatus.LINEAR
                and downs < _DOWNS
                and found.falling
                and found.shrink < _RESOLVED
            ):
                high, factor, downs = radius, max(found.shrink, _FIRST_DOWN), downs + 1
            elif bends < _BENDS and self._bend(found):
                bends += 1
                continue  # once more, along the better curve
            elif not seen:
                best, low, ups = (found, dict(self._curve)), radius, ups + 1
                factor = self._linear_up(radius, high) if ups <= _UPS else np.inf
            else:
                value, error = (float(np.abs(one[-1])) for one in found.taylor(self._third))
                better = error < _BETTER * best_error
                if error < best_error:
                    best, best_error, status = (found, dict(self._curve)), error, NormalFormStatus.FOUND
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
        if best is None or (status is NormalFormStatus.LINEAR and np.isfinite(high)):
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
                self._curve[powers] = self._curve[powers] + solve_homological(self._at, powers, excess, resonant)
        return bent

    def _described(self, found: Sampled, status: NormalFormStatus) -> Fit:
        value, error = found.taylor(self._third)
        off = {}
        for powers in self._second:
            excess, uncertain = self._excess(found, powers)
            off[powers] = np.abs(excess) + uncertain
        bend = effect_of_bend(self._mapped, self._at, self._curve, found, off, self._second, order=3)
        return Fit(status, found, complex(value[-1]), float(error[-1]) + bend)


def effect_of_bend(
    mapped: ReturnedStates,
    at: CriticalOrbit,
    curve: Curve,
    found: Sampled,
    off: Mapping[Powers, Array],
    resonant: Mapping[Powers, bool],
    order: int,
) -> float:
    """How far a coefficient of odd order may be off because the sampled curve is not quite the centre manifold.

    Parameters
    ----------
    curve, found
        The curve and what was sampled on it.
    off
        Difference of H(W) and W at every monomial, shape (n,): curves that are off by as much, with signs drawn at
        random, are sampled as well.
    resonant
        As in :func:`solve_homological`, of every monomial.
    order
        Order of the coefficient.
    """
    n = at.state.size
    if n == (1 if at.real else 2):
        return 0.0
    random = np.random.default_rng(0)
    directions = turns(at)
    largest = found.radius * radii()[0]
    z = largest * directions
    worst = 0.0
    for _ in range(_DRAWS):
        wrong = {}
        for powers, difference in off.items():
            signs = random.choice([-1.0, 1.0], n) if at.real else np.exp(2j * np.pi * random.random(n))
            wrong[powers] = solve_homological(at, powers, signs * difference, resonant[powers])
        shift = displacements(at, wrong, z)
        ratios = np.abs(shift).max(axis=0) / found.size
        ratios = ratios[np.isfinite(ratios) & (ratios > 0.0)]
        if not ratios.size:
            continue
        times = _WRONG / float(ratios.max())
        image = images(mapped, at, displacements(at, curve, z) + times * shift)
        if image is None:
            return np.inf
        harmonic = np.fft.fft(image @ at.left.conj())[1] / directions.size
        worst = max(worst, float(abs(harmonic - found.outermost[1])) / (times * largest**order))
    return _SURE * worst


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
