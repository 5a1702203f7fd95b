"""Where one critical multiplier is not alone: strong resonances, and further multipliers on the unit circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STRONG = (1, 2, 3, 4)


def strong_resonance(multiplier: complex, uncertainty: float) -> int | None:
    """The k = 1 ... 4 for which a pair's multiplier may be exp(+-2 pi i / k), None if there is none.

    There the terms z^(k-1) of the conjugate are resonant as well, and the cubic coefficient alone decides nothing
    (Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 9.5.1 to 9.5.4).
    """
    for k in STRONG:
        distance = abs(complex(multiplier.real, abs(multiplier.imag)) - np.exp(2j * np.pi / k))
        if distance <= uncertainty:
            return k
    return None


def others_critical(jacobian: Array, multiplier: complex, uncertainty: float) -> NDArray[np.complex128]:
    """Multipliers on the unit circle within their uncertainty, apart from the given one and its conjugate.

    Parameters
    ----------
    jacobian
        Of the return map, shape (n, n).
    multiplier
        The critical one.
    uncertainty
        Relative error of the jacobian; each multiplier's own follows by its condition.
    """
    values, right = np.linalg.eig(jacobian)
    left = _reciprocal(right)
    condition = np.linalg.norm(right, axis=0) * np.linalg.norm(left, axis=0)
    error = uncertainty * np.linalg.norm(jacobian) * condition
    rest = np.ones(values.size, dtype=bool)
    for one in {multiplier, multiplier.conjugate()}:
        rest[np.where(rest, np.abs(values - one), np.inf).argmin()] = False
    found: NDArray[np.complex128] = values[rest & (np.abs(np.abs(values) - 1.0) <= error)].astype(np.complex128)
    return found


def _reciprocal(right: NDArray[np.inexact]) -> NDArray[np.inexact]:
    try:
        inverse: NDArray[np.inexact] = np.linalg.inv(right).conj().T
    except np.linalg.LinAlgError:  # defective: as sure of a value as the root of the round-off
        return np.full(right.shape, 1.0 / np.sqrt(np.finfo(float).eps))
    return inverse
