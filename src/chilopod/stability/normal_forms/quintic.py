"""The coefficient of fifth order, which decides where the cubic one vanishes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chilopod.stability.normal_forms.center_manifold import CriticalOrbit, Curve, Manifold, ReturnedStates

_BENDS = 4  # one for every order of the manifold, and one more
_STEP = 1.5  # ratio of successive amplitudes
_TRIES = 8  # largest number of amplitudes each way
_WORSE = 2  # amplitudes tried beyond the best one

Term = tuple[complex, float]
"""A coefficient and its error."""


@dataclass(frozen=True)
class Quintic:
    """The map over the full period on the centre manifold, where its cubic coefficient vanishes."""

    # Coefficient e of a -> a + e a^5 (a pair: |a| -> |a| + e |a|^5), of the map of the cubic coefficient of a
    # :class:`~chilopod.stability.normal_forms.normal_form.NormalForm`, and a bound on its error.
    coefficient: float
    error: float
    curve: Curve  # the centre manifold, up to fourth order
    amplitude: float  # largest amplitude at which the return map was sampled


def quintic(mapped: ReturnedStates, at: CriticalOrbit, amplitude: float) -> Quintic | None:
    """The coefficient of fifth order at a critical orbit, from the amplitude with the smallest error; the search starts
    at that of the normal form of third order. None if the map is undefined at all amplitudes. A multiplier +1 belongs
    to a pitchfork, whose symmetry excludes terms of even order."""
    best: Quintic | None = None
    manifold = Manifold(mapped, at, 5)
    curve: Curve = manifold.curve
    for factor, radius in ((_STEP, amplitude), (1.0 / _STEP, amplitude / _STEP)):
        worse, tries = 0, 0
        while worse < _WORSE and tries < _TRIES:
            manifold.curve = dict(curve)
            with np.errstate(all="ignore"):
                found = _measured(manifold, at, radius * factor**tries)
            tries, worse = tries + 1, worse + 1
            if found is not None and (best is None or found.error < best.error):
                best, curve, worse = found, found.curve, 0
    return best


def _measured(manifold: Manifold, at: CriticalOrbit, radius: float) -> Quintic | None:
    found = manifold.sample(radius)
    for _ in range(_BENDS):
        if found is None or not manifold.bend(found):
            break
        found = manifold.sample(radius)
    if found is None:
        return None
    powers = ((3, 0), (5, 0)) if at.real else ((2, 1), (3, 2))
    third, fifth = (manifold.coefficient(found, each) for each in powers)
    coefficient, error = _of_full_period(at, third, fifth)
    return Quintic(coefficient, error, manifold.curve, found.radius) if np.isfinite(error) else None


def _of_full_period(at: CriticalOrbit, third: Term, fifth: Term) -> tuple[float, float]:
    """Coefficient of fifth order over a full period, or over two, from the terms of one return."""
    (c, c_error), (e, e_error) = third, fifth
    cubic, cubic_error, value, error, times = c.real, c_error, e.real, e_error, at.returns
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
        times = times // 2 if times % 2 == 0 else times
    # a -> a + c a^3 + e a^5, iterated.
    pairs = 1.5 * times * (times - 1)
    error = times * error + pairs * (2.0 * abs(cubic) + cubic_error) * cubic_error
    return times * value + pairs * cubic * cubic, error
