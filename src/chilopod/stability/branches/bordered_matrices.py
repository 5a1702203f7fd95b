"""Bordered matrix of a curve of periodic orbits, its space of states and its tangent."""

from __future__ import annotations

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.stability.problem.capabilities import SystemLike, spatial_symmetries
from chilopod.stability.symmetry.mirrored import symmetric_states

_UNCERTAIN = 1e-6  # singular value that counts as zero: the error of a difference


def symmetric_space(system: SystemLike, state: Array, sizes: Array, mode: Array | None) -> Array | None:
    """Projection onto the states with the spatial symmetries of an orbit, and of the ``mode`` of a leaving branch if
    given, in units of the states' ``sizes``, shape (n, n); None without symmetries.

    In this space the branch is regular where symmetry-breaking branches leave it (Golubitsky, Stewart & Schaeffer,
    *Singularities and Groups in Bifurcation Theory* II, 1988, section XIII.3).
    """
    if system.symmetry is not None or not spatial_symmetries(system):
        return None
    x = state if mode is None else state + sizes * mode / np.linalg.norm(mode)
    basis = symmetric_states(system, x, sizes)
    return basis @ basis.T if basis.shape[1] < x.size else None


def within_space(space: Array | None, matrix: Array) -> Array:
    """The matrix of a curve, shape (n, n+1) or with its tangent (n+1, n+1), restricted to a space of states, replaced
    by a contraction across it."""
    if space is None:
        return matrix
    n = len(space)
    across = np.eye(n) - space
    result = np.array(matrix)
    result[:n] = space @ result[:n]
    result[:n, :n] -= result[:n, :n] @ across + across
    return result


def null_vector(bordered: Array) -> Array:
    """Unit null vector of all but the last row of a matrix, on the side of the last row.

    At a branch point the matrix is singular within its errors, and the shortest solution is used. A return that
    magnifies errs along the magnified direction only, so its largest singular value does not matter.
    """
    n = len(bordered) - 1
    if not np.isfinite(bordered).all():
        raise AnalysisError("the return map is not finite", field="flow")
    least = _UNCERTAIN / max(1.0, float(np.linalg.norm(bordered, 2)))
    tangent: Array = np.linalg.lstsq(bordered, np.append(np.zeros(n), 1.0), rcond=least)[0]
    if not tangent.any():
        raise AnalysisError("the curve has no direction here", field="step")
    return tangent / np.linalg.norm(tangent)
