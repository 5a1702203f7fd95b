"""Periodic orbits of large systems: fixed points of the return map by Newton's method without the matrix.

Every linear system is solved in a block Krylov subspace to about the accuracy that Newton's method can use (Dembo,
Eisenstat and Steihaug, *SIAM J. Numer. Anal.* 19, 400, 1982), with the directions that contract least in the rounds
before in the block it starts from. Of a strongly dissipative system it takes a few directions (compare the
Newton-Picard methods of Lust, Roose, Spence and Champneys, *SIAM J. Sci. Comput.* 19, 1188, 1998).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.convergence import RETURN
from chilopod.stability.krylov.arnoldi import krylov_subspaces
from chilopod.stability.krylov.tangent_map import TangentMap, tangent_map, tangent_sizes
from chilopod.stability.problem.budget import Budget
from chilopod.stability.problem.capabilities import FlowsTangents
from chilopod.stability.problem.returns import Section, return_duration, section_at

Array = NDArray[np.float64]

LARGE = 100
"""States from which on a few directions are cheaper than the whole derivative."""

_ROUNDS = 30
_WORSE = 10.0  # residuals may grow by so much
_RESTS = 1e-8  # of the sizes: a motion that short is none
_BLOCK = 4  # columns: as many as the compiled code carries at once
_UNSOLVED = 0.5  # of a residual, in the whole space: no step of Newton's method
_COARSE, _FINE = 1e-2, 1e-6  # of a residual: how accurately linear systems are solved


def closed_orbit(
    system: FlowsTangents,
    x: Array,
    section: Section | None = None,
    farthest: float = np.inf,
    budget: Budget | None = None,
) -> tuple[TangentMap, Array]:
    """The return map in a state on a periodic orbit near a guess, and the sizes of the states, shape (n,).

    Parameters
    ----------
    system, x
        The system and the guess, shape (n,).
    section
        Section of a system that does not depend on time; by default, across the motion in the guess.
    farthest
        Largest distance by which the guess may miss itself, relative to the sizes of the states.
    budget
        Return maps that may be evaluated, of which each round takes one.

    Raises
    ------
    AnalysisError
        If Newton's method does not converge.
    """
    size = tangent_sizes(system, x, return_duration(system) if section is None else section.duration)
    section = section_at(system, x, size) if section is None else section
    best = np.inf
    slowest = np.random.default_rng(0).standard_normal((x.size, _BLOCK - 1))
    for rounds in range(_ROUNDS):
        if budget is not None:
            budget.take()
        image = tangent_map(system, x, section)
        size = np.maximum(size, np.maximum(np.abs(x), np.abs(image.state)) if x.any() else 0.0)
        residual = (image.state - x) / size
        off = float(np.abs(residual).max())
        if RETURN.met(off, best):
            if image.velocity is not None and np.abs(image.velocity * image.duration / size).max() <= _RESTS:
                break
            if section is not None:
                image = tangent_map(system, x, section_at(system, x, size, image.duration))
            return image, size
        if off > farthest or (rounds > 4 and off > _WORSE * best):
            break
        best, farthest = min(best, off), np.inf
        move, slowest = _move(image, residual, size, slowest, float(np.clip(off, _FINE, _COARSE)))
        x = x - size * move
        if not np.isfinite(x).all():
            break
        if section is not None:
            section = replace(section, duration=image.duration)
    raise AnalysisError(
        f"no periodic orbit found near the guess (it misses itself by {best:.1e} of its size)",
        field="orbit",
        allowed="a guess closer to the orbit",
    )


def _move(image: TangentMap, residual: Array, size: Array, slowest: Array, accuracy: float) -> tuple[Array, Array]:
    """The solution of (H' - 1) move = residual, in units of the sizes, and the directions that contract least."""
    units = size[:, None]
    start = np.column_stack([residual / np.linalg.norm(residual), slowest])
    for subspace in krylov_subspaces(lambda directions: image.images(units * directions) / units, start):
        move, left = subspace.solve_shifted(residual)
        if left <= accuracy:
            break
    if left > _UNSOLVED:
        raise AnalysisError("no move closes the motion: one return later all states near the guess are off alike")
    values, vectors = np.linalg.eig(subspace.matrix)
    largest = vectors[:, np.argsort(-np.abs(values))[: _BLOCK - 1]]
    return move, subspace.basis @ np.where(largest.imag.any(axis=0), largest.imag + largest.real, largest.real)
