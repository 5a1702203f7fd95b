"""The size of every state, told by the orbit and by how the states drive each other: never by the number one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance

from chilopod.stability.capabilities import Scaled, SystemLike

Array = NDArray[np.float64]

_LEAST_WEIGHT = 1e-6  # of a coupling one way only, against one that goes both ways


def balance(matrix: Array) -> Array:
    """Sizes d of the states, shape (n,), for which the entries of ``matrix[i, j] * d[j] / d[i]`` are most alike.

    The logarithms of d solve a least-squares problem over all couplings, with the mean of each set of states that are
    coupled at all fixed at zero. States in other units, d_i -> c_i d_i, are followed exactly but for that mean: unlike
    the balancing of LAPACK (Osborne, J. ACM 7, 1960), this does not stop at powers of two.
    """
    n = len(matrix)
    size = np.abs(matrix)
    coupled = (size > 0.0) & ~np.eye(n, dtype=bool) & np.isfinite(size)
    if not coupled.any():
        return np.ones(n)
    logs = np.zeros((n, n))
    logs[coupled] = np.log(size[coupled])
    # The weight is of the couplings there and back, so that it has no unit.
    back = coupled & coupled.T
    both = np.where(back, 0.5 * (logs + logs.T), -np.inf)
    strongest = both.max() if back.any() else 0.0
    weight = np.where(coupled, np.exp(np.minimum(both - strongest, 0.0)) + _LEAST_WEIGHT, 0.0)
    weight = weight / weight.max()
    # minimise sum weight (log |m_ij| + log d_j - log d_i)^2
    total = weight + weight.T
    laplacian = np.diag(total.sum(axis=1)) - total
    right = (weight * logs).sum(axis=1) - (weight * logs).sum(axis=0)
    d: Array = np.exp(np.linalg.lstsq(laplacian, right)[0])
    return d


def numerical_balance(matrix: Array) -> Array:
    """As :func:`balance` for bounds on round-off, by LAPACK: states that act one way only keep their units.

    What acts one way only may be as small as it likes; units in which it is as large as the rest would blow up the
    round-off of the rest.
    """
    d: Array = matrix_balance(matrix, permute=False, separate=True)[1][0]
    return d


def sizes(system: SystemLike, x: Array, jacobian: Array) -> Array:
    """What is large for every state, shape (n,): from the system, or from a state and the derivative of the return.

    A state that passes through zero just here has the size that its coupling to the others gives it. Of an orbit that
    rests at zero only the ratios mean anything.
    """
    given = system.scale if isinstance(system, Scaled) else None
    if given is not None:
        return given
    d = balance(jacobian)
    own = np.abs(x) / d
    reach = float(own.max())
    if reach == 0.0 or not np.isfinite(reach):
        return d
    return np.maximum(np.abs(x), d * float(np.median(own[own > 0.0])))
