"""The multipliers of largest modulus of a large system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.krylov.arnoldi import KrylovSubspace, krylov_subspaces
from chilopod.stability.krylov.tangent_map import TangentMap, tangent_map
from chilopod.stability.matrix_errors import FIRST_ORDER, eigenvalues_moved

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_LANES = 4  # columns that the compiled code carries at once
_FEWEST, _SPARE = 8, 2  # columns of a block, and those beyond the multipliers that are asked for
_CONVERGED = 1e-13  # residual, of the size of the matrix
_SAFETY = 4.0  # on a norm of which eight components or more, in random directions, are known
_SINGULAR = 1e-13  # singular values of H' - 1 that count as zero
_BESIDE = 1e-6  # of the sizes of the states, where the derivative is taken once more to see it change


@dataclass(frozen=True)
class LeadingMultipliers(ReadOnlyArrays):
    """The largest eigenvalues of the derivative of a return map.

    Attributes
    ----------
    values
        By falling modulus, shape (count,), or one more where that would part a pair.
    error
        Bound on the error of each.
    following
        About the modulus of the next one.
    directions
        Number of directions that the flow has carried.
    """

    values: ComplexArray
    error: Array
    following: float
    directions: int


@dataclass(frozen=True)
class _Ritz:
    """Eigenvalues of H in a Krylov subspace, by falling modulus, and how far they are from those of the matrix."""

    values: ComplexArray
    vectors: ComplexArray  # unit columns
    condition: Array  # norm of the left eigenvector for a right one of norm 1
    residual: Array


def leading_multipliers(image: TangentMap, size: Array, count: int) -> LeadingMultipliers:
    """The multipliers of largest modulus of a return map, all others included only in that they are smaller.

    A value theta with the vector y, |y| = 1, is off by w^T (H' y - theta y) / w^T y, exactly, with w the left
    eigenvector of the multiplier. H' y is computed anew, with its error; of w, the components in the random directions
    from which the subspace grew are known, and w is almost never much longer than they tell (Kenney and Laub, *SIAM J.
    Sci. Comput.* 15, 36, 1994).

    Parameters
    ----------
    image
        The return map in a state on the orbit.
    size
        Sizes of the states, shape (n,).
    count
        Number of multipliers.
    """
    n, units = size.size, size[:, None]
    width = min(n, max(_FEWEST, -(-(count + _SPARE) // _LANES) * _LANES))
    start = np.random.default_rng(0).standard_normal((n, width))
    for subspace in krylov_subspaces(lambda directions: image.images(units * directions) / units, start):
        ritz = _ritz(subspace)
        chosen = whole_pairs(ritz.values, count)
        if _settled(ritz, chosen, float(np.linalg.norm(subspace.matrix, 2))):
            break
    values, vectors = ritz.values[:chosen], subspace.basis @ ritz.vectors[:, :chosen]
    both, errors, state_error = image.images_with_error(units * np.hstack([vectors.real, vectors.imag]))
    images = (both[:, :chosen] + 1j * both[:, chosen:]) / units
    residual = np.linalg.norm(images - values * vectors, axis=0)
    residual += np.linalg.norm((errors[:, :chosen] + errors[:, chosen:]) / units, axis=0)
    residual += 4.0 * np.finfo(float).eps * np.linalg.norm(images, axis=0)
    residual += _bend(image, size, subspace, state_error, units * np.hstack([vectors.real, vectors.imag]), both)
    error = ritz.condition[:chosen] * residual
    if (error > FIRST_ORDER * np.abs(values).max(initial=0.0)).any():
        wrong = np.full(subspace.matrix.shape, float(residual.max()))
        error = np.minimum(error, eigenvalues_moved(ritz.values, subspace.matrix, wrong)[:chosen])
    following = float(np.abs(ritz.values[chosen])) if chosen < ritz.values.size else 0.0
    return LeadingMultipliers(values, error, following, subspace.basis.shape[1])


def _ritz(subspace: KrylovSubspace) -> _Ritz:
    values, vectors = np.linalg.eig(subspace.matrix)
    # Moduli that differ by round-off are equal; the two of a pair stand together, positive frequency first.
    moduli = np.round(np.abs(values) / max(float(np.abs(values).max()), 1e-300), 12)
    order = np.lexsort((-values.imag, -np.round(np.abs(values.imag), 12), -moduli))
    values, vectors = values[order].astype(np.complex128), vectors[:, order].astype(np.complex128)
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        left = np.full_like(vectors, np.inf)
    n, known = subspace.basis.shape[0], left[:, : subspace.first]
    seen = _SAFETY * np.sqrt(n / subspace.first) * np.linalg.norm(known, axis=1)
    condition = np.linalg.norm(left, axis=1)
    if subspace.coupling.size:
        condition = np.maximum(condition, seen)
    return _Ritz(values, vectors, condition, subspace.residuals(vectors))


def whole_pairs(values: ComplexArray, count: int) -> int:
    """So many multipliers, or one more where the last one would be without its conjugate."""
    count = min(count, values.size)
    if count < values.size and values[count - 1].imag > 0.0 and values[count].imag < 0.0:
        count += 1
    return count


def _settled(ritz: _Ritz, chosen: int, largest: float) -> bool:
    """Whether those that are taken are known to round-off, and no other one may yet become larger."""
    if ritz.values.size <= chosen:
        return False
    least = float(np.abs(ritz.values[chosen - 1]))
    known = ritz.residual <= _CONVERGED * largest
    rising = ~known & (np.abs(ritz.values) + ritz.residual > least)
    return bool(known[:chosen].all() and not rising.any())


def _bend(
    image: TangentMap, size: Array, subspace: KrylovSubspace, state_error: Array, directions: Array, images: Array
) -> Array:
    """How much the derivative changes, along each of some vectors given by real and imaginary parts, within the error
    of the orbit: along the direction in which the orbit is least sure."""
    _, values, right = np.linalg.svd(subspace.matrix - np.eye(len(subspace.matrix)))
    values = values[values > _SINGULAR * values[0]]
    weakest = subspace.basis @ right[values.size - 1]
    wrong = float(np.linalg.norm((np.abs(image.state - image.point) + state_error) / size))
    off = wrong * max(1.0, 1.0 / float(values[-1]))
    x = image.point + _BESIDE * size * weakest
    beside = tangent_map(image.system, x, image.section).images(directions)
    change = np.linalg.norm((beside - images) / size[:, None], axis=0)
    half = change.size // 2
    return (change[:half] + change[half:]) * (off / _BESIDE)
