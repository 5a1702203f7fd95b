"""Spatial symmetries of a state and of a mode, within their accuracy."""

from __future__ import annotations

import functools

import numpy as np

from chilopod.frozen import Array, ComplexArray
from chilopod.stability.problem.capabilities import SystemLike, spatial_symmetries
from chilopod.stability.symmetry.groups import finite_group

_LOOSE = 1e-6  # largest residual of a symmetry of a state, relative to the size of the states


def symmetric_states(system: SystemLike, state: Array, size: Array, near: float = _LOOSE) -> Array:
    """Orthonormal basis, in units of the sizes, of states with the symmetries of one: changed by ``near`` at most."""
    n, generators = size.size, spatial_symmetries(system)
    elements = _elements(np.stack(generators).tobytes(), n) if generators else np.empty((0, n, n))
    kept = (np.abs(elements @ state - state) <= near * size).all(axis=1)
    _, values, right = np.linalg.svd((elements[kept] * size / size[:, None] - np.eye(n)).reshape(-1, n))
    return np.asarray(right[int((values > _LOOSE).sum()) :].T)


@functools.lru_cache(maxsize=8)
def _elements(generators: bytes, n: int) -> Array:
    """Elements of the group of some generators, shape (order, n, n)."""
    return finite_group(np.frombuffer(generators).reshape(-1, n, n)).elements


def reverses(system: SystemLike, mode: ComplexArray, size: Array) -> bool:
    """True if a spatial symmetry of a system turns a mode, shape (n,), into its negative; ``size`` is of the states."""
    own = np.abs(mode / size).max()
    return any(
        bool((np.abs(matrix @ mode + mode) / size).max() <= _LOOSE * own) for matrix in spatial_symmetries(system)
    )
