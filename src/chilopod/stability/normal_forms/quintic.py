"""The terms of fifth order: what decides where the cubic coefficient vanishes.

The centre manifold W(z) = x + z q + ... is found to fourth order, without a part along q at resonant monomials, from
H(W(z)) = W(g(z)), with the return map H and the map g on the critical space (Kuznetsov, *Elements of Applied
Bifurcation Theory*, sections 9.3 and 9.4; Govaerts, Ghaziani, Kuznetsov & Meijer, SIAM J. Sci. Comput. 29, 2007). All
terms are read off samples of H, as those of third order are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.stability.normal_forms.amplitude import effect_of_bend
from chilopod.stability.normal_forms.center_manifold import (
    CriticalOrbit,
    Curve,
    Powers,
    ReturnedStates,
    Sampled,
    sample,
    solve_homological,
)

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

Term = tuple[np.complex128, np.float64]
"""A coefficient and its error, of numpy: where units make it overflow it is infinite."""

_ORDER = 5
_PASSES = 5  # one for every order of the manifold, one to make sure, and one to measure on it
_STEP = 1.5  # ratio of amplitudes that are tried one after another
_TRIES = 8  # of them each way
_WORSE = 2  # that are tried beyond the best one


@dataclass(frozen=True)
class Quintic:
    """The map over the full period on the centre manifold, where its cubic coefficient vanishes.

    Attributes
    ----------
    coefficient, error
        Coefficient e of a -> a + e a^5 (a pair: |a| -> |a| + e |a|^5), of the map that the cubic coefficient of a
        :class:`~chilopod.stability.normal_forms.normal_form.NormalForm` is of, and a bound on its error.
    curve
        The centre manifold, up to fourth order.
    amplitude
        Largest amplitude at which the return map was sampled.
    """

    coefficient: float
    error: float
    curve: Curve
    amplitude: float


def quintic(mapped: ReturnedStates, at: CriticalOrbit, amplitude: float, noise: float = 0.0) -> Quintic | None:
    """The coefficient of fifth order at a critical orbit.

    Parameters
    ----------
    mapped, at, noise
        As for :func:`chilopod.stability.normal_forms.normal_form.normal_form`. A multiplier +1 is that of a pitchfork:
        a symmetry keeps terms of even order away.
    amplitude
        Amplitude of the normal form of third order, where the search for a better one starts.

    Returns
    -------
    The coefficient from the amplitude at which its error is smallest; None if the map exists at none.
    """
    best: Quintic | None = None
    nothing = np.zeros(at.state.size, dtype=np.complex128)
    curve: Curve = {(1, 0): at.right.astype(np.complex128), **dict.fromkeys(_resonant(at), nothing)}
    for factor, radius in ((_STEP, amplitude), (1.0 / _STEP, amplitude / _STEP)):
        worse, tries = 0, 0
        while worse < _WORSE and tries < _TRIES:
            with np.errstate(all="ignore"):
                found = _measured(mapped, at, curve, radius * factor**tries, noise)
            tries, worse = tries + 1, worse + 1
            if found is not None and (best is None or found.error < best.error):
                best, curve, worse = found, found.curve, 0
    return best


def _resonant(at: CriticalOrbit) -> dict[Powers, bool]:
    """Monomials of the manifold that reach the resonant one of fifth order, and whether they are resonant themselves;
    z^4 does not reach z^3 conj(z)^2."""
    if at.real:
        nu = at.multiplier.real
        return {(k, 0): nu**k == nu for k in range(2, _ORDER)}
    return {(2, 0): False, (1, 1): False, (3, 0): False, (2, 1): True, (3, 1): False, (2, 2): False}


def _measured(mapped: ReturnedStates, at: CriticalOrbit, curve: Curve, radius: float, noise: float) -> Quintic | None:
    resonant, curve = _resonant(at), dict(curve)
    for left in reversed(range(_PASSES)):
        found = sample(mapped, at, curve, radius, noise)
        if found is None:
            return None
        excess = _excess(found, at, curve, resonant)
        off = {powers: np.abs(difference) + uncertain for powers, (difference, uncertain) in excess.items()}
        if not left or all((off[powers] <= 3.0 * uncertain).all() for powers, (_, uncertain) in excess.items()):
            return _read(mapped, at, curve, found, off)
        for powers, (difference, _) in excess.items():
            curve[powers] = curve[powers] + solve_homological(at, powers, difference, resonant[powers])
    return None


def _read(
    mapped: ReturnedStates, at: CriticalOrbit, curve: Curve, found: Sampled, off: dict[Powers, Array]
) -> Quintic | None:
    terms: list[Term] = []
    for powers in ((3, 0), (5, 0)) if at.real else ((2, 1), (3, 2)):
        value, error = found.taylor(powers)
        bend = effect_of_bend(mapped, at, curve, found, off, _resonant(at), sum(powers))
        terms.append((value[-1], error[-1] + bend))
    coefficient, wrong = _of_full_period(at, *terms)
    return Quintic(coefficient, wrong, curve, found.radius) if np.isfinite(wrong) else None


def _excess(
    found: Sampled, at: CriticalOrbit, curve: Curve, resonant: dict[Powers, bool]
) -> dict[Powers, tuple[ComplexArray, Array]]:
    """What H(W) has in excess of W(g) at every monomial of the manifold, with the error of that: shape (n,) both."""
    terms = {powers: found.taylor(powers) for powers in resonant}
    inner = np.zeros((_ORDER, _ORDER), dtype=np.complex128)
    inner[1, 0] = at.multiplier
    for powers, critical in resonant.items():
        if critical:
            inner[powers] = terms[powers][0][-1]
    outer = np.zeros((_ORDER, _ORDER, at.state.size), dtype=np.complex128)
    for (i, j), coefficient in curve.items():
        outer += _monomial(inner, i, j)[..., None] * coefficient
        if not at.real and i != j:
            outer += _monomial(inner, j, i)[..., None] * coefficient.conj()
    return {powers: (value[:-1] - outer[powers], error[:-1]) for powers, (value, error) in terms.items()}


def _monomial(inner: ComplexArray, i: int, j: int) -> ComplexArray:
    """Coefficients of g^i conj(g)^j below the fifth power of z and of conj(z), as those of g are given."""
    result = np.zeros_like(inner)
    result[0, 0] = 1.0
    for factor in [inner] * i + [inner.conj().T] * j:
        product = np.zeros_like(inner)
        for k, m in np.argwhere(factor):
            product[k:, m:] += factor[k, m] * result[: _ORDER - k, : _ORDER - m]
        result = product
    return result


def _of_full_period(at: CriticalOrbit, third: Term, fifth: Term) -> tuple[float, float]:
    """From the terms of one return to the coefficient of fifth order over a full period, or over two."""
    (c, c_error), (e, e_error) = third, fifth
    cubic, cubic_error, value, error, times = c.real, c_error, e.real, e_error, at.returns
    if not at.real:
        # z -> nu z (1 + c |z|^2 + e |z|^4): |1 + u| = 1 + Re u + (Im u)^2 / 2 + ...
        c, e = c * at.multiplier.conjugate(), e * at.multiplier.conjugate()
        cubic, value = c.real, e.real + 0.5 * c.imag**2
        error += (abs(c.imag) + 0.5 * c_error) * c_error
    elif at.multiplier.real < 0.0:
        # a -> -a + c a^3 + e a^5 twice: a -> a - 2 c a^3 + (3 c^2 - 2 e) a^5.
        value = 3.0 * cubic**2 - 2.0 * value
        error = 2.0 * error + 3.0 * (2.0 * abs(cubic) + cubic_error) * cubic_error
        cubic, cubic_error = -2.0 * cubic, 2.0 * cubic_error
        times = times // 2 if times % 2 == 0 else times
    # a -> a + c a^3 + e a^5 so many times.
    pairs = 1.5 * times * (times - 1)
    error = times * error + pairs * (2.0 * abs(cubic) + cubic_error) * cubic_error
    return float(times * value + pairs * cubic**2), float(error)
