"""The term of fifth order at a real critical multiplier: what decides where the cubic one vanishes.

Kuznetsov, *Elements of Applied Bifurcation Theory*, section 9.3, for the flip.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from chilopod.stability.normal_forms.amplitude import Fit, effect_of_bend
from chilopod.stability.normal_forms.center_manifold import (
    CriticalOrbit,
    Powers,
    ReturnedStates,
    Sampled,
    sample,
    solve_homological,
)

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_ORDER = 5
_PASSES = 4  # one for every order of the curve, and one to measure on it
_AMPLITUDES = (1.0, 1.5, 2.25)  # of that which shows the cubic term best


def quintic_term(mapped: ReturnedStates, at: CriticalOrbit, fit: Fit, noise: float) -> tuple[float, float]:
    """Coefficient of a^5 in one return on the centre manifold, and a bound on its error.

    The manifold is W(a) = x + a q + a^2 w2 + a^3 w3 + a^4 w4, without a part along q at resonant orders; the map on it
    is g(a), and H(W(a)) = W(g(a)) gives one w after another. Arguments as for
    :func:`chilopod.stability.normal_forms.normal_form.normal_form`, and the terms up to third order.
    """
    best, best_error = np.nan, np.inf
    for times in _AMPLITUDES:
        value, error = _measured(mapped, at, fit, times * fit.sampled.radius, noise)
        if error < best_error:
            best, best_error = value, error
    return best, best_error


def _measured(mapped: ReturnedStates, at: CriticalOrbit, fit: Fit, radius: float, noise: float) -> tuple[float, float]:
    nu = at.multiplier.real
    resonant = {(k, 0): nu**k == nu for k in range(2, _ORDER)}
    curve: dict[Powers, ComplexArray] = dict(fit.curve)
    for powers in resonant:
        curve.setdefault(powers, np.zeros(at.state.size, dtype=np.complex128))
    for last in [False] * (_PASSES - 1) + [True]:
        found = sample(mapped, at, curve, radius, noise)
        if found is None:
            break
        excess = _excess(found, at, curve, resonant)
        if last:
            value, error = found.taylor((_ORDER, 0))
            off = {powers: np.abs(difference) + uncertain for powers, (difference, uncertain) in excess.items()}
            bend = effect_of_bend(mapped, at, curve, found, off, resonant, _ORDER)
            return float(value[-1].real), float(error[-1]) + bend
        for powers, (difference, _) in excess.items():
            curve[powers] = curve[powers] + solve_homological(at, powers, difference, resonant[powers])
    return np.nan, np.inf


def _excess(
    found: Sampled, at: CriticalOrbit, curve: dict[Powers, ComplexArray], resonant: dict[Powers, bool]
) -> dict[Powers, tuple[ComplexArray, Array]]:
    """What H(W) has in excess of W(g) at every order of the curve, with the error of that: shape (n,) both."""
    terms = {powers: found.taylor(powers) for powers in resonant}
    inner = np.zeros(_ORDER)
    inner[1] = at.multiplier.real
    for (k, _), critical in resonant.items():
        inner[k] = terms[k, 0][0][-1].real if critical else 0.0
    outer = np.zeros((_ORDER, at.state.size), dtype=np.complex128)
    for (m, _), coefficient in curve.items():
        power = polynomial.polypow(inner, m)[:_ORDER]
        outer[: power.size] += power[:, None] * coefficient
    return {powers: (value[:-1] - outer[powers[0]], error[:-1]) for powers, (value, error) in terms.items()}
