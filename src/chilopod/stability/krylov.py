"""Multipliers of largest modulus of a large system, without its derivative as a matrix, for ``multipliers(leading=)``.

:class:`TangentMap` applies the derivative of the return map to a block of directions. A block resolves multiple
multipliers, as of a ring, and the compiled flow carries several directions at nearly the cost of one. From a block,
:func:`krylov_subspaces` makes a growing subspace; it may grow to the whole space, where it is exact.

:func:`closed_orbit` finds the orbit by Newton's method, with linear systems solved in such a subspace to about the
accuracy that it can use (Dembo, Eisenstat and Steihaug, *SIAM J. Numer. Anal.* 19, 400, 1982), from a block with the
least contracting directions of earlier rounds: a strongly dissipative system takes a few directions (compare the
Newton-Picard methods of Lust, Roose, Spence and Champneys, *SIAM J. Sci. Comput.* 19, 1188, 1998). Then
:func:`leading_multipliers` takes the eigenvalues of the derivative in a subspace, and bounds their errors.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.arguments import UserCode, shape_of
from chilopod.flows.carrying import REPEATED
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability import returns
from chilopod.stability.interface import Capabilities, check_finite, returns_per_period
from chilopod.stability.returns import Section
from chilopod.stability.spectrum import EPSILON, FIRST_ORDER, ContractionError, eigensystem, eigenvalue_errors

LARGE = 100  # number of states from which a few directions are cheaper than the whole derivative

_LANES = 4  # columns that the compiled code carries together
_ROUND_OFF = 1e-14  # part outside a subspace that is round-off, relative to the largest image
_GROWTH = 1.125  # growth from one tested subspace to the next
_SINGULAR = 1e-13  # singular value of H' - 1 that counts as zero, relative to H' or the unit matrix

_PARTS = 16  # parts of a return at which the sizes of the states are computed
_SWEEPS, _MOST_SWEEPS = 3, 30  # sweeps through the couplings of the states; more if the orbit gives no sizes
_STEADY = 2.0  # change of the ratios of sizes below which they are accurate enough

_ROUNDS = 30  # rounds of Newton's method
_WORSE = 10.0  # largest growth of a residual
RESTS = 1e-8  # motion, relative to the sizes, that counts as rest
_UNSOLVED = 0.5  # remaining part of a residual, in the whole space, that fails a step of Newton's method
_COARSE, _FINE = 1e-2, 1e-6  # accuracy of linear systems, relative to the residual

_FEWEST, _SPARE = 8, 2  # columns of a block, and those beyond the requested multipliers
_TELLING = 0.1  # error in the whole space, relative to the largest multiplier, from which none is resolved
_CONVERGED = 1e-13  # residual, relative to the size of the matrix
_SAFETY = 4.0  # factor on a norm estimated from eight or more random components


class KrylovSubspace(NamedTuple):
    """A subspace V with A V = V H + Q R; every round applies A to the last block only, and Q continues V."""

    basis: Array  # V, orthonormal, shape (n, m)
    first: int  # number of columns of V that span the first block
    matrix: Array  # H = V^T A V, shape (m, m)
    coupling: Array  # R, shape (q, m), zero but for the columns of the last block; q = 0 where V is invariant

    def solve_shifted(self, right: Array) -> tuple[Array, float]:
        """The v in V with the least |(A - 1) v - right|, and that relative to |right|, for a ``right`` in the first
        block of V: block GMRES (Saad, *Iterative Methods for Sparse Linear Systems*, 2003, section 6.12)."""
        whole = np.concatenate([self.matrix - np.eye(len(self.matrix)), self.coupling])
        inside = np.concatenate([self.basis.T @ right, np.zeros(len(self.coupling))])
        left, values, rows = np.linalg.svd(whole, full_matrices=False)
        kept = values > _SINGULAR * max(1.0, float(np.linalg.norm(self.matrix)))
        found = rows[kept].T @ (left[:, kept].T @ inside / values[kept])
        return self.basis @ found, float(np.linalg.norm(whole @ found - inside) / np.linalg.norm(inside))


def krylov_subspaces(apply: Callable[[Array], Array], start: Array) -> Iterator[KrylovSubspace]:
    """Growing subspaces of a matrix, given by its products with directions, from a block; the last one is invariant."""
    block = _orthonormal(start, _ROUND_OFF * float(np.linalg.norm(start)), len(start))[0]
    first = block.shape[1]
    basis, matrix, coupling = block, np.zeros((0, 0)), np.zeros((first, 0))
    largest, look = 0.0, 0.0
    while True:
        m, old = basis.shape[1], matrix.shape[0]
        image = apply(block)
        largest = max(largest, float(np.linalg.norm(image, axis=0).max()))
        inside = basis.T @ image
        outside = image - basis @ inside
        again = basis.T @ outside  # once more, for an orthogonal basis (Giraud et al., Numer. Math. 101, 2005)
        inside += again
        outside -= basis @ again
        block, tail = _orthonormal(outside, _ROUND_OFF * largest, len(start) - m)
        matrix = np.hstack([np.concatenate([matrix, coupling]), inside])
        coupling = np.concatenate([np.zeros((tail.shape[0], old)), tail], axis=1)
        if m >= look or not tail.size:
            yield KrylovSubspace(basis, first, matrix, coupling)
            look = _GROWTH * m
        if not tail.size:
            return
        basis = np.concatenate([basis, block], axis=1)


def _orthonormal(block: Array, negligible: float, most: int) -> tuple[Array, Array]:
    """An orthonormal basis of the columns of a block and their coordinates in it, without negligible parts."""
    left, values, right = np.linalg.svd(block, full_matrices=False)
    count = min(int((values > negligible).sum()), most)
    return left[:, :count], values[:count, None] * right[:count]


@dataclass(frozen=True, eq=False)
class TangentMap(ReadOnlyArrays):
    """The return map H at a state (see :mod:`~chilopod.stability.returns`), its derivative H' as a product."""

    system: Capabilities
    point: Array  # state at time 0, shape (n,)
    state: Array  # H(point)
    duration: float  # duration of a return
    returns: int  # number of returns in the full period
    section: Section | None  # section of returns, through ``point``, if the system does not depend on time
    velocity: Array | None  # dx/dt at ``state``, likewise

    def images(self, directions: Array) -> Array:
        """H' times directions, shape (n, m) both."""
        return self._in_parts(directions)[1]

    def images_with_error(self, directions: Array) -> tuple[Array, Array, Array]:
        """The same with bounds on the errors of the images and of ``state``, from a second computation in parts."""
        state, images = self._in_parts(directions)
        other, parts = self._in_parts(directions, returns.CUTS)
        return images, REPEATED * np.abs(parts - images), REPEATED * np.abs(self._across(other - state))

    def _in_parts(self, directions: Array, cuts: tuple[float, ...] = (0.0,)) -> tuple[Array, Array]:
        state, images = self.point, directions
        for a, b in itertools.pairwise([*(cut * self.duration for cut in cuts), self.duration]):
            with UserCode("flow_tangents"):
                state, images = self.system.flow_tangents(np.array(state), np.array(images), a, b)
            shapes, allowed = (shape_of(state), shape_of(images)), (self.point.shape, directions.shape)
            if shapes != allowed:
                said = "gives shapes {} and {}".format(*shapes)
                raise AnalysisError(said, field="flow_tangents", allowed="{} and {}".format(*allowed))
            state, images = np.array(state), np.array(images)  # it may return the same arrays at every call
        check_finite(images)
        if self.system.symmetry is not None:
            state, images = self.system.symmetry @ state, self.system.symmetry @ images
        return state, self._across(images)

    def _across(self, directions: Array) -> Array:
        """Directions at the end of a return, projected along the motion into the section."""
        if self.velocity is None or self.section is None:
            return directions
        normal = self.section.normal
        along: Array = np.multiply.outer(self.velocity, normal @ directions) / float(normal @ self.velocity)
        return directions - along


def tangent_map(system: Capabilities, x: Array, section: Section | None = None) -> TangentMap:
    """The return map at a state at time 0, shape (n,), on a section if the system does not depend on time."""
    if section is None:
        duration = returns.return_duration(system)
    else:
        duration = sum(returns.crossing(system, x, section, derived=False)[:2])
        section = replace(section, point=x, duration=duration)
    state = returns.turned(system, returns.carried(system, x[None], 0.0, duration))[0]
    check_finite(state)
    velocity = None if section is None else returns.velocity_at(system, state)
    return TangentMap(system, x, state, duration, returns_per_period(system), section, velocity)


def tangent_sizes(system: Capabilities, x: Array, duration: float) -> Array:
    """Sizes of the states, shape (n,), as :func:`.interface.sizes`, without the matrix: the
    largest value of a state during a return, or its change within a part of it when the others are disturbed at random
    by their own sizes (the one-sided Krylov balancing of Chen and Demmel, *Linear Algebra Appl.* 309, 2000)."""
    given = getattr(system, "scale", None)
    if given is not None:
        return given
    random = np.random.default_rng(0)
    times = np.linspace(0.0, duration, _PARTS + 1).tolist()
    state, size = x, np.abs(x)
    for a, b in itertools.pairwise(times):
        state = returns.carried(system, state[None], a, b)[0]
        check_finite(state)
        size = np.maximum(size, np.abs(state))
    moves = bool(size.any())
    if not moves:
        size = np.ones(x.size)
    for _ in range(_SWEEPS if moves else _MOST_SWEEPS):
        signs = random.choice([-1.0, 1.0], (x.size, _LANES))
        driven = system.flow_tangents(np.array(x), size[:, None] * signs, 0.0, times[1])[1]
        larger = np.maximum(size, np.sqrt(np.square(driven).mean(axis=1)))
        if not moves:
            larger /= larger.max()
            if float((larger / size).max()) <= _STEADY * float((larger / size).min()):
                break
        size = larger
    return np.where(size > 0.0, size, size[size > 0.0].min())


def closed_orbit(
    system: Capabilities, x: Array, section: Section | None = None, limit: float = np.inf, budget: Budget | None = None
) -> tuple[TangentMap, Array]:
    """The return map at a state on a periodic orbit near a guess, and the sizes of the states, shape (n,); an
    AnalysisError without one. The first return may displace the guess by ``limit``, relative to the sizes."""
    size = tangent_sizes(system, x, returns.return_duration(system) if section is None else section.duration)
    section = returns.section_at(system, x, size) if section is None else section
    best = np.inf
    slowest = np.random.default_rng(0).standard_normal((x.size, _LANES - 1))
    for rounds in range(_ROUNDS):
        if budget is not None:
            budget.take()
        image = tangent_map(system, x, section)
        size = np.maximum(size, np.maximum(np.abs(x), np.abs(image.state)) if x.any() else 0.0)
        residual = (image.state - x) / size
        off = float(np.abs(residual).max())
        if returns.RETURN.met(off, best):
            if image.velocity is not None and np.abs(image.velocity * image.duration / size).max() <= RESTS:
                break
            if section is not None:
                image = tangent_map(system, x, returns.section_at(system, x, size, image.duration))
            return image, size
        if off > limit or (rounds > 4 and off > _WORSE * best):
            break
        best, limit = min(best, off), np.inf
        move, slowest = _move(image, residual, size, slowest, float(np.clip(off, _FINE, _COARSE)))
        x = x - size * move
        if not np.isfinite(x).all():
            break
        if section is not None:
            section = replace(section, duration=image.duration)
    said = f"no periodic orbit found near the guess (it misses itself by {best:.1e} of its size)"
    raise AnalysisError(said, field="orbit", allowed="a guess closer to the orbit")


def _move(image: TangentMap, residual: Array, size: Array, slowest: Array, accuracy: float) -> tuple[Array, Array]:
    """The solution of (H' - 1) move = residual, in units of the sizes, and the least contracting directions."""
    units = size[:, None]
    start = np.column_stack([residual / np.linalg.norm(residual), slowest])
    for subspace in krylov_subspaces(lambda directions: image.images(units * directions) / units, start):
        move, left = subspace.solve_shifted(residual)
        if left <= accuracy:
            break
    if left > _UNSOLVED:
        raise AnalysisError("no correction closes the motion: a return moves all states near the guess alike")
    largest = eigensystem(subspace.matrix)[1][:, : _LANES - 1]
    return move, subspace.basis @ np.where(largest.imag.any(axis=0), largest.imag + largest.real, largest.real)


def leading_multipliers(image: TangentMap, size: Array, count: int) -> tuple[ComplexArray, Array, float]:
    """The ``count`` multipliers of largest modulus of a return map, or one more to complete a pair, for given sizes of
    the states, shape (n,); bounds on their errors; and the approximate modulus of the next one. A ContractionError
    where round-off of a matrix far from normal fills the whole space.

    A value theta with the vector y, |y| = 1, has the exact error w^T (H' y - theta y) / w^T y, with w the left
    eigenvector of the multiplier. H' y is computed again, with its error; the components of w in the random directions
    of the first block are known, and its norm is almost never much larger than they show (Kenney and Laub, *SIAM J.
    Sci. Comput.* 15, 36, 1994).
    """
    n, units = size.size, size[:, None]
    width = min(n, max(_FEWEST, -(-(count + _SPARE) // _LANES) * _LANES))
    start = np.random.default_rng(0).standard_normal((n, width))
    for subspace in krylov_subspaces(lambda directions: image.images(units * directions) / units, start):
        every, vectors, left = eigensystem(subspace.matrix)
        chosen = whole_pairs(every, count)
        # Distances from eigenvalues of the matrix: the chosen ones are known to round-off, no other may become larger.
        off = np.linalg.norm(subspace.coupling @ vectors, axis=0)
        known = off <= _CONVERGED * float(np.linalg.norm(subspace.matrix, 2))
        rising = ~known & (np.abs(every) + off > np.abs(every[chosen - 1]))
        if every.size > chosen and known[:chosen].all() and not rising.any():
            break
    values, vectors = every[:chosen], subspace.basis @ vectors[:, :chosen]
    directions = units * np.hstack([vectors.real, vectors.imag])
    both, errors, state_error = image.images_with_error(directions)
    images = (both[:, :chosen] + 1j * both[:, chosen:]) / units
    residual = np.linalg.norm(images - values * vectors, axis=0)
    residual += np.linalg.norm((errors[:, :chosen] + errors[:, chosen:]) / units, axis=0)
    residual += 4.0 * EPSILON * np.linalg.norm(images, axis=0)
    residual += _bend(image, size, subspace, state_error, directions, both)
    condition = np.linalg.norm(left[:, :chosen], axis=0)
    if subspace.coupling.size:
        seen = np.linalg.norm(left[: subspace.first, :chosen], axis=0)
        condition = np.maximum(condition, _SAFETY * np.sqrt(n / subspace.first) * seen)
    error = condition * residual
    if (error > FIRST_ORDER * np.abs(values).max(initial=0.0)).any():
        wrong = np.full(subspace.matrix.shape, float(residual.max()))
        error = np.minimum(error, eigenvalue_errors(every, subspace.matrix, wrong)[:chosen])
    if len(subspace.matrix) == n and error.max() > _TELLING * np.abs(values).max():
        raise ContractionError("its derivative is only resolved in units that balance it", field="flow")
    following = float(np.abs(every[chosen])) if chosen < every.size else 0.0
    return values, error, following


def whole_pairs(values: ComplexArray, count: int) -> int:
    """A number of multipliers, or more to include the conjugates of all; equal pairs may stand in any order."""
    whole = np.cumsum(np.sign(values.imag)) == 0.0
    count = min(count, values.size)
    return count + int(whole[count - 1 :].argmax()) if count else 0


def _bend(
    image: TangentMap, size: Array, subspace: KrylovSubspace, state_error: Array, directions: Array, images: Array
) -> Array:
    """Change of the derivative's images within the error of the orbit, along its least certain direction."""
    _, values, right = np.linalg.svd(subspace.matrix - np.eye(len(subspace.matrix)))
    values = values[values > _SINGULAR * values[0]]
    weakest = subspace.basis @ right[values.size - 1]
    wrong = float(np.linalg.norm((np.abs(image.state - image.point) + state_error) / size))
    off = wrong * max(1.0, 1.0 / float(values[-1]))
    moved = tangent_map(image.system, image.point + returns.BESIDE * size * weakest, image.section)
    change = np.linalg.norm((moved.images(directions) - images) / size[:, None], axis=0)
    half = change.size // 2
    return (change[:half] + change[half:]) * (off / returns.BESIDE)
