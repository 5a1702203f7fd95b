"""Where one critical multiplier is not alone: strong resonances, and further multipliers on the unit circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chilopod.flows.balance import numerical_balance

Array = NDArray[np.float64]

STRONG = (1, 2, 3, 4)


def uncertainties(jacobian: Array, relative: float) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues of a matrix and bounds on their errors, shape (n,) both, for a relative error of the matrix.

    Norms are those of the balanced matrix, so that units do not matter.
    """
    units = numerical_balance(jacobian)
    balanced = jacobian * units / units[:, None]
    values, right = np.linalg.eig(balanced)
    try:
        left = np.linalg.inv(right).conj().T
    except np.linalg.LinAlgError:
        left = np.full(right.shape, np.inf)
    error = relative * np.linalg.norm(balanced)
    # To first order each is off by its condition; but even those of a defective pair not by more than the square root.
    condition = np.linalg.norm(right, axis=0) * np.linalg.norm(left, axis=0)
    return values.astype(np.complex128), np.minimum(error * condition, np.sqrt(error))


def strong_resonance(multiplier: complex, uncertainty: float) -> int | None:
    """The k = 1 ... 4 for which a pair's multiplier may be exp(+-2 pi i / k), None if there is none.

    There the terms z^(k-1) of the conjugate are resonant as well, and the cubic coefficient alone decides nothing
    (Kuznetsov, *Elements of Applied Bifurcation Theory*, sections 9.5.1 to 9.5.4).
    """
    upper = complex(multiplier.real, abs(multiplier.imag))
    for k in STRONG:
        if abs(upper - np.exp(2j * np.pi / k)) <= uncertainty:
            return k
    return None
