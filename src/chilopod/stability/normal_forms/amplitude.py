"""The best amplitude to sample the nonlinear terms of a return map, and the terms found there.

The search lowers the amplitude where the map is far from its linear part, raises it where the noise hides the nonlinear
terms, bends the sampled curve along the centre manifold, and continues while the error of the cubic coefficient falls.
"""

from __future__ import annotations

import numpy as np

from chilopod.labels import Labelled
from chilopod.stability.normal_forms.center_manifold import (
    CriticalOrbit,
    Curve,
    Manifold,
    Powers,
    ReturnedStates,
    Sampled,
    Term,
    displacements,
    images,
    turns,
)

_TRIALS = 40  # largest number of sampled amplitudes
_SHARE = 0.03  # wanted departure of the map from its linear part, relative to the amplitude
_FAR = 5.0  # largest departure that a step upward for accuracy may reach, relative to the wanted one
_TOO_FAR = 0.3  # largest useful departure
_UP, _FIRST_DOWN = 30.0, 0.1  # longest step of the amplitude upward; step where the map cannot be evaluated
_FAR_DOWN, _LEAST_DOWN = 1e-3, 0.3  # longest and shortest step downward where the map is far from linear
_LOST = 1e-6  # relative departure from linearity that is too small to start from
_BLURRED = 1e-3  # largest error at the orbit itself, relative to the amplitude
_LONG_UP, _UPS = 1e3, 5  # step of the amplitude while a map seems linear, and number of such steps
_CLOSE = 4.0  # ratio of amplitudes that ends the search
_RESOLVED = 0.7  # proposed factor of the amplitude above which a series has converged to the noise
_DOWNS = 6  # largest number of steps down for convergence: the series of a map that is not smooth never converges
_BENDS = 3  # largest number of bends of the curve at one amplitude
_ENOUGH = 3e-8  # relative error that ends the search
_FULL = 8  # highest visible order above which a larger amplitude would lose accuracy
_BETTER = 0.3  # factor on the error that justifies a further step


class NormalFormStatus(Labelled):
    """Status of a normal form; each member's ``sentence`` describes it in words."""

    FOUND = "found", "the coefficients hold within their errors"
    LINEAR = "linear", "no nonlinear term was seen along the mode, however large the amplitude"
    OUT_OF_REACH = "out of reach", "at no amplitude does the return map follow a power series"
    STRONG_RESONANCE = ("strong resonance", "the pair is at a root of unity of order 1 to 4, where more terms decide")
    SEVERAL_CRITICAL = "several critical", "another multiplier is on the unit circle as well"


Fit = tuple[NormalFormStatus, Sampled, Term]
"""Status, FOUND or LINEAR, the map at the best amplitude, and the resonant cubic term of one return."""


def fitted(mapped: ReturnedStates, at: CriticalOrbit, radius: float) -> Fit | None:
    """The terms at the amplitude and bend of the most accurate cubic coefficient; None if none is suitable."""
    third: Powers = (3, 0) if at.real else (2, 1)
    manifold = Manifold(mapped, at, 3)
    low, high = 0.0, np.inf  # largest amplitude without visible terms, and smallest too large one
    best = None
    best_error, status = np.inf, NormalFormStatus.LINEAR
    bends = ups = downs = turned = 0
    growing = 0.0
    for _ in range(_TRIALS):
        found = manifold.sample(radius)
        share, order, seen = (np.inf, 2, True) if found is None else _departure(found, at)
        if found is not None and found.blur > _BLURRED * radius:
            low, factor = radius, _UP
        elif found is None or share > _TOO_FAR:
            high, factor = radius, _FIRST_DOWN if found is None else _toward(share, order)
        elif (
            seen and status is NormalFormStatus.LINEAR and downs < _DOWNS and found.falling and found.shrink < _RESOLVED
        ):
            high, factor, downs = radius, max(found.shrink, _FIRST_DOWN), downs + 1
        elif bends < _BENDS and manifold.bend(found):
            bends += 1
            continue  # once more, along the better curve
        elif not seen:
            best, low, ups = (found, dict(manifold.curve)), radius, ups + 1
            factor = _linear_up(mapped, at, manifold.curve, radius, high) if ups <= _UPS else np.inf
        else:
            value, error = found.term(third)
            better = error < _BETTER * best_error
            if error < best_error:
                best, best_error, status = (found, dict(manifold.curve)), error, NormalFormStatus.FOUND
            full = _highest(found) > _FULL
            if error <= _ENOUGH * abs(value) or (full and found.shrink > _RESOLVED):
                break
            if growing == 0.0:
                growing = -1.0 if full else 1.0
            elif not better:
                growing, turned = -growing, turned + 1
                radius = best[0].radius if best else radius
            if turned > 1:
                break
            # The noise in the coefficient falls with the third power of the amplitude.
            wanted = min(float(np.cbrt(error / max(_ENOUGH * abs(value), 1e-300))), _toward(share / _FAR, order))
            factor = max(_toward(share, order) ** 0.5, wanted, 2.0) if growing > 0.0 else 0.5
        bends = 0
        nearer = _within(radius * factor, low, high)
        if nearer is None:
            break
        radius = nearer
    if best is None or (status is NormalFormStatus.LINEAR and np.isfinite(high)):
        return None
    found, manifold.curve = best
    return status, found, manifold.coefficient(found, third)


def _linear_up(mapped: ReturnedStates, at: CriticalOrbit, curve: Curve, radius: float, high: float) -> float:
    """Least factor on the amplitude at which nonlinear terms may become visible."""
    factor = 1.0
    reach = np.abs(at.image.jacobian)
    for _ in range(_UPS):
        factor *= _LONG_UP
        if factor * radius >= high:
            break
        shift = displacements(at, curve, factor * radius * turns(at))
        image = images(mapped, at, shift)
        if image is None:
            break
        size = np.abs(at.state) + np.abs(shift) @ reach.T
        if (np.abs(image - shift @ at.image.jacobian.T) > _LOST * size).any():
            break
    else:
        return np.inf
    return factor


def _departure(found: Sampled, at: CriticalOrbit) -> tuple[float, int, bool]:
    """Departure from linearity relative to the amplitude, order of its main term, True if it exceeds the noise."""
    sizes = np.abs([one.coefficients[1:, -1] for one in found.harmonics])
    h, k = np.unravel_index(int(sizes.argmax()), sizes.shape)
    share, order = float(sizes[h, k]), found.harmonics[h].parity + 2 * int(k) + 2
    seen = share > 4.0 * float(found.noise[-1])
    # A saturating map is linear again far out, with another slope.
    slope = abs(found.harmonics[1].coefficients[0, -1] - at.multiplier * found.radius)
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
