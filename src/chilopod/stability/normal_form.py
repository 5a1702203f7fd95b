"""Normal-form coefficients at a bifurcation, from evaluations of the return map alone.

Near the critical orbit the return map H is sampled on circles of amplitude s along the critical mode; the term of
third order, corrected for the part of second order that leaves the critical space (Kuznetsov, *Elements of Applied
Bifurcation Theory*, sections 5.4 and 9.2), is read off by extrapolation to s = 0 in powers of s^2. Nothing but H is
needed: no derivative of the right-hand side by hand, no symbolic algebra; and the extrapolation says how sure it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.stability.system import ReturnMap, SystemLike, returned_states

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_LEVELS = 12
_RATIO = np.sqrt(0.5)


@dataclass(frozen=True)
class NormalForm:
    """Leading coefficients of the full-period map on the critical space.

    With a the amplitude along the unit critical mode: real multiplier 1, a -> a + quadratic a^2 + cubic a^3; flip or
    half-period pitchfork, the same for the map of twice the return; Neimark-Sacker (mode q a + complex conjugate), |a|
    -> |a| + cubic |a|^3.

    Attributes
    ----------
    quadratic, cubic
        Coefficients. A negative ``cubic`` bounds the growth: supercritical.
    quadratic_error, cubic_error
        How far they may be off, from the extrapolation.
    """

    quadratic: float
    quadratic_error: float
    cubic: float
    cubic_error: float


def real_normal_form(
    system: SystemLike, image: ReturnMap, nu: float, right: Array, left: Array, amplitude: float
) -> NormalForm:
    """Normal form at a real critical multiplier nu = +1 or -1 of the return map.

    Parameters
    ----------
    system, image
        The system and its return map at the critical orbit.
    nu
        +1.0 or -1.0.
    right, left
        Critical eigenvectors, shape (n,), with left . right = 1.
    amplitude
        Largest amplitude to sample at.

    Raises
    ------
    AnalysisError
        If the return map cannot be evaluated at that amplitude.
    """
    s = amplitude * _RATIO ** np.arange(_LEVELS)
    x = image.state  # the fixed point is its own image
    center = returned_states(system, x[None])[0]

    def sampled(correction: Array) -> tuple[Array, Array]:
        """Even and odd part of H along the curve x + a q + a^2/2 correction, shape (levels, n) each."""
        path = x + 0.5 * s[:, None] ** 2 * correction
        plus, minus = np.split(
            returned_states(system, np.vstack([path + s[:, None] * right, path - s[:, None] * right])), 2
        )
        return 0.5 * (plus + minus) - center, 0.5 * (plus - minus)

    even, odd = sampled(np.zeros_like(x))
    second, _ = _extrapolate(even / s[:, None] ** 2)
    quadratic, quadratic_error = _scalar(even @ left / s**2, s)
    # (I - A) w = B(q, q) away from the critical direction: solved with it bordered out when nu = +1.
    n = x.size
    if nu > 0:
        bordered = np.block([[np.eye(n) - image.jacobian, right[:, None]], [left[None], np.zeros((1, 1))]])
        w = np.linalg.solve(bordered, np.append(2.0 * second - 2.0 * (left @ second) * right, 0.0))[:n]
    else:
        w = np.linalg.solve(np.eye(n) - image.jacobian, 2.0 * second)
    _, odd = sampled(w)
    cubic, cubic_error = _scalar((odd @ left - nu * s) / s**3, s)
    if nu < 0:
        # a -> -a + c a^3 twice: a -> a - 2 c a^3.
        return NormalForm(0.0, 0.0, -2.0 * cubic, 2.0 * cubic_error)
    return NormalForm(quadratic, quadratic_error, cubic, cubic_error)


def complex_normal_form(
    system: SystemLike, image: ReturnMap, nu: complex, right: ComplexArray, left: ComplexArray, amplitude: float
) -> NormalForm:
    """Normal form at a complex pair on the unit circle; arguments as for :func:`real_normal_form`, with left^H right =
    1."""
    s = amplitude * _RATIO ** np.arange(_LEVELS)
    turns = np.exp(2j * np.pi * np.arange(8) / 8)
    z = s[:, None] * turns
    x = image.state  # the fixed point is its own image
    center = returned_states(system, x[None])[0]

    def harmonics(h20: ComplexArray, h11: ComplexArray) -> ComplexArray:
        """Fourier coefficients of H over the circle, shape (levels, 8, n)."""
        path = x + 2.0 * (z[..., None] * right).real + (z[..., None] ** 2 * h20).real + s[:, None, None] ** 2 * h11.real
        image_of = returned_states(system, path.reshape(-1, x.size)).reshape(*z.shape, x.size) - center
        return np.fft.fft(image_of, axis=1) / 8.0

    none = np.zeros(x.size, dtype=np.complex128)
    first = harmonics(none, none)
    b_qq, _ = _extrapolate(2.0 * first[:, 2] / s[:, None] ** 2)
    b_qc, _ = _extrapolate(first[:, 0] / s[:, None] ** 2)
    identity = np.eye(x.size)
    h20 = np.linalg.solve(nu**2 * identity - image.jacobian, b_qq).astype(np.complex128, copy=False)
    h11 = np.linalg.solve(identity - image.jacobian, b_qc).astype(np.complex128, copy=False)
    second = harmonics(h20, h11)
    resonant = second[:, 1] @ left.conj()
    # |nu a + c a |a|^2| = |a| + Re(conj(nu) c) |a|^3 on the circle, for every return.
    cubic, error = _scalar(((np.conj(nu) * resonant).real - s) / s**3, s)
    return NormalForm(0.0, 0.0, image.halves * cubic, image.halves * error)


def _extrapolate(values: NDArray[np.inexact]) -> tuple[NDArray[np.inexact], Array]:
    """Limit of a sequence v(s_k), s_k^2 = s_0^2 / 2^k, that is a power series in s^2; entry by entry, with an error
    estimate.

    Richardson's table; of its entries the one that differs least from its two parents is taken (Ridders): further down
    truncation still shows, further up round-off does.
    """
    table = [values]
    best = values[-1].copy()
    error = np.full(best.shape, np.inf)
    for order in range(1, len(values)):
        previous = table[-1]
        factor = 2.0**order
        current = (factor * previous[1:] - previous[:-1]) / (factor - 1.0)
        table.append(current)
        for row in range(len(current)):
            estimate = np.maximum(np.abs(current[row] - previous[row + 1]), np.abs(current[row] - previous[row]))
            better = estimate < error
            error = np.where(better, estimate, error)
            best = np.where(better, current[row], best)
    return best, error


def _scalar(values: Array, s: Array) -> tuple[float, float]:
    value, error = _extrapolate(values)
    # Below this, the estimate would claim more than the round-off of the sampled map allows.
    floor = 4.0 * np.finfo(float).eps * abs(float(value)) + 1e-15 / float(s[0]) ** 2
    return float(value), float(error) + floor
