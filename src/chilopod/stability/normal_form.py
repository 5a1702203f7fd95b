"""Normal-form coefficients at a bifurcation, from evaluations of the return map alone.

Near the critical orbit the return map H is sampled on circles of amplitude s along the critical mode; the term of
third order, corrected for the part of second order that leaves the critical space (Kuznetsov, *Elements of Applied
Bifurcation Theory*, sections 5.4 and 9.2), is read off by extrapolation to s = 0 in powers of s^2. Nothing but H is
needed: no derivative of the right-hand side by hand, no symbolic algebra; and the extrapolation says how sure it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.stability.capabilities import SystemLike
from chilopod.stability.returns import ReturnMap, returned_states

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_LEVELS, _FIRST_LEVELS, _MORE_LEVELS = 12, 6, 3
_RATIO = np.sqrt(0.5)  # of neighbouring amplitudes
_ENOUGH = 1e-10  # relative error at which no smaller amplitudes are sampled
_ANGLES = 8


@dataclass(frozen=True)
class NormalForm:
    """Leading coefficients of the full-period map on the critical space.

    With a the amplitude along the unit critical mode: real multiplier 1, a -> a + quadratic a^2 + cubic a^3; flip or
    half-period pitchfork, the same for the map of twice the return; Neimark-Sacker (mode q a + complex conjugate), |a|
    -> |a| + cubic |a|^3, while the phase of a advances by that of the multiplier + rotation |a|^2.

    Attributes
    ----------
    quadratic, cubic
        Coefficients. A negative ``cubic`` bounds the growth: supercritical.
    rotation
        rad per period; 0 unless the critical multipliers are complex.
    quadratic_error, cubic_error, rotation_error
        How far they may be off, from the extrapolation.
    """

    quadratic: float
    quadratic_error: float
    cubic: float
    cubic_error: float
    rotation: float = 0.0
    rotation_error: float = 0.0


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
    ladder = amplitude * _RATIO ** np.arange(_LEVELS)
    x = image.state  # the fixed point is its own image
    center = returned_states(system, x[None])[0]

    def sampled(s: Array, correction: Array) -> tuple[Array, Array]:
        """Even and odd part of H along the curve x + a q + a^2/2 correction, shape (levels, n) each."""
        path = x + 0.5 * s[:, None] ** 2 * correction
        plus, minus = np.split(
            returned_states(system, np.vstack([path + s[:, None] * right, path - s[:, None] * right])), 2
        )
        return 0.5 * (plus + minus) - center, 0.5 * (plus - minus)

    n = x.size
    second, error = _limit(lambda s: sampled(s, np.zeros(n))[0] / s[:, None] ** 2, ladder)
    # (I - A) w = B(q, q) away from the critical direction: solved with it bordered out when nu = +1.
    if nu > 0:
        bordered = np.block([[np.eye(n) - image.jacobian, right[:, None]], [left[None], np.zeros((1, 1))]])
        w = np.linalg.solve(bordered, np.append(2.0 * second - 2.0 * (left @ second) * right, 0.0))[:n]
    else:
        w = np.linalg.solve(np.eye(n) - image.jacobian, 2.0 * second)
    third, third_error = _limit(lambda s: ((sampled(s, w)[1] @ left - nu * s) / s**3)[:, None], ladder)
    cubic, cubic_error = float(third[0]), float(third_error[0])
    if nu < 0:
        # a -> -a + c a^3 twice: a -> a - 2 c a^3.
        return NormalForm(0.0, 0.0, -2.0 * cubic, 2.0 * cubic_error)
    return NormalForm(float(left @ second), float(np.abs(left) @ error), cubic, cubic_error)


def complex_normal_form(
    system: SystemLike, image: ReturnMap, nu: complex, right: ComplexArray, left: ComplexArray, amplitude: float
) -> NormalForm:
    """Normal form at a complex pair on the unit circle; arguments as for :func:`real_normal_form`, with left^H right =
    1."""
    ladder = amplitude * _RATIO ** np.arange(_LEVELS)
    turns = np.exp(2j * np.pi * np.arange(_ANGLES) / _ANGLES)
    x = image.state
    center = returned_states(system, x[None])[0]

    def harmonics(s: Array, h20: ComplexArray, h11: ComplexArray) -> ComplexArray:
        """Fourier coefficients of H over circles of radius s, shape (levels, angles, n)."""
        z = (s[:, None] * turns)[..., None]
        path = x + 2.0 * (z * right).real + (z**2 * h20).real + s[:, None, None] ** 2 * h11.real
        mapped = returned_states(system, path.reshape(-1, x.size)).reshape(path.shape) - center
        return np.fft.fft(mapped, axis=1) / _ANGLES

    none = np.zeros(x.size, dtype=np.complex128)

    def second_order(s: Array) -> ComplexArray:
        first = harmonics(s, none, none)
        return np.hstack([2.0 * first[:, 2], first[:, 0]]) / s[:, None] ** 2

    b_qq, b_qc = np.split(_limit(second_order, ladder)[0], 2)
    identity = np.eye(x.size)
    h20 = np.linalg.solve(nu**2 * identity - image.jacobian, b_qq).astype(np.complex128, copy=False)
    h11 = np.linalg.solve(identity - image.jacobian, b_qc).astype(np.complex128, copy=False)

    def third_order(s: Array) -> Array:
        # nu a + c a |a|^2 = nu a (1 + conj(nu) c |a|^2) on the circle: a growth, and a turn, for every return.
        resonant = np.conj(nu) * (harmonics(s, h20, h11)[:, 1] @ left.conj()) - s
        return np.stack([resonant.real, resonant.imag], axis=1) / s[:, None] ** 3

    found, errors = _limit(third_order, ladder)
    cubic, rotation = (image.returns * found).tolist()
    cubic_error, rotation_error = (image.returns * errors).tolist()
    return NormalForm(0.0, 0.0, cubic, cubic_error, rotation, rotation_error)


def _limit(measure: Callable[[Array], NDArray[Any]], ladder: Array) -> tuple[NDArray[Any], Array]:
    """Limit of ``measure(s)`` for s to 0, entry by entry, with an error estimate.

    ``measure`` is a power series in s^2; it takes amplitudes, shape (levels,), and gives shape (levels, entries). Only
    as much of the ladder is used as it takes.
    """
    values = measure(ladder[:_FIRST_LEVELS])
    while True:
        limit, error = _extrapolate(values)
        used = len(values)
        if used == len(ladder) or error.max() <= _ENOUGH * np.abs(limit).max():
            break
        values = np.vstack([values, measure(ladder[used : used + _MORE_LEVELS])])
    # Below this, the estimate would claim more than the round-off of the sampled map allows.
    floor = 4.0 * np.finfo(float).eps * np.abs(limit) + 1e-15 / float(ladder[0]) ** 2
    # The best-looking entry of a table looks better than it is.
    return limit, 10.0 * error + floor


def _extrapolate(values: NDArray[Any]) -> tuple[NDArray[Any], Array]:
    """Richardson's table over s_k^2 = s_0^2 / 2^k.

    Of its entries the one that differs least from its two parents and from its neighbours of the same order is taken:
    further down truncation still shows, further up round-off does. (Parents alone, as in Ridders' method, agree by
    chance too often: in a table of sixty entries one always does.)
    """
    table = [values]
    best = values[-1].copy()
    error = np.full(best.shape, np.inf)
    for order in range(1, len(values) - 1):
        previous = table[-1]
        factor = 2.0**order
        current = (factor * previous[1:] - previous[:-1]) / (factor - 1.0)
        table.append(current)
        beside = np.abs(np.diff(current, axis=0))
        for row in range(len(current)):
            near = [np.abs(current[row] - previous[row + 1]), np.abs(current[row] - previous[row])]
            estimate = np.maximum.reduce([*near, *beside[max(0, row - 1) : row + 1]])
            better = estimate < error
            error = np.where(better, estimate, error)
            best = np.where(better, current[row], best)
    return best, error
