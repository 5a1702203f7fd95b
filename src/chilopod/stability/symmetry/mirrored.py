"""Spatial symmetries of a state and of a mode, within their accuracy."""

from __future__ import annotations

import functools

import numpy as np

from chilopod.frozen import Array, ComplexArray
from chilopod.stability.problem.capabilities import SystemLike, spatial_symmetries
from chilopod.stability.symmetry.groups import finite_group

_LOOSE = 1e-6  # largest residual of a symmetry of a state, relative to the size of the states


def symmetric_states(system: SystemLike, state: Array, size: Array, near: float = _LOOSE) -> Array:
    """Orthonormal basis, in units of the states' sizes, shape (n,), of the space of states with the spatial symmetries
    of a state: those that change it by at most ``near``."""
    n = size.size
    conditions = [np.zeros((0, n))]
    generators = spatial_symmetries(system)
    for matrix in _elements(np.stack(generators).tobytes(), n) if generators else ():
        if (np.abs(matrix @ state - state) <= near * size).all():
            conditions.append(matrix * size / size[:, None] - np.eye(n))
    stacked = np.vstack(conditions)
    _, values, right = np.linalg.svd(stacked) if len(stacked) else (None, np.zeros(0), np.eye(n))
    rank = int((values > _LOOSE).sum())
    return np.asarray(right[rank:].T)


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
