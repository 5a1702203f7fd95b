"""Eigenvalues of a return map, with eigenvectors, and bounds on their errors and on those of results from them.

Where first-order bounds do not hold, a matrix is changed at random within the errors of its entries, and the error of a
result is ``SAFETY`` times its largest observed change. This holds for simple and for defective eigenvalues, for which
a condition number gives no error. A draw moves a result along its gradient in a random
direction, which in one case of twelve is less than a tenth of the root mean square over all directions (Kenney and
Laub, *SIAM J. Sci. Comput.* 15, 36, 1994); all of ``DRAWS`` are so small in one case of 600 million.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from chilopod.flows.carrying import numerical_balance
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.problem.returns import ReturnMap

SAFETY, DRAWS = 10.0, 8  # factor on the largest change of a result under random changes, and their number

FIRST_ORDER = 1e-6  # error, relative to the largest eigenvalue, up to which first-order bounds hold

VERDICTS = {True: "stable", False: "unstable", None: "undecided"}
"""Words for the results of :func:`stable_within`."""

_EPSILON = float(np.finfo(float).eps)


def stable_within(values: ComplexArray, bound: float, bounds: Array | float | None = None) -> bool | None:
    """Stability by multipliers with a bound on the error of all that are not small, or one each: True if all lie inside
    the unit circle by more than their bounds, False if one lies outside by more, else None."""
    modulus = np.abs(values)
    if (modulus < 1.0 - bound).all():
        return True
    return False if (modulus > 1.0 + (bound if bounds is None else bounds)).any() else None


def disturbed(matrix: Array, error: Array, draws: int = DRAWS) -> Array:
    """Copies of matrices, shape (draws, ...), every entry changed by its error with a random sign."""
    return np.asarray(matrix + error * _signs((draws, *matrix.shape)))


@lru_cache(maxsize=4)  # a search asks for one or two shapes
def _signs(shape: tuple[int, ...]) -> Array:
    return np.random.default_rng(0).choice(np.array([-1.0, 1.0]), shape)


def eigenvalue_errors(values: ComplexArray, matrix: Array, error: Array) -> Array:
    """Bounds on the errors of the eigenvalues of a matrix whose entries have errors, shape (n,)."""
    error = error + 4.0 * _EPSILON * np.abs(matrix)
    if not np.isfinite(error).all():
        return np.full(values.size, np.inf)
    others = np.linalg.eigvals(disturbed(matrix, error))
    away = np.abs(values[:, None] - others[:, None, :])  # draws, values, others
    nearest_other, nearest_value = away.min(axis=2), away.min(axis=1)
    return np.asarray(SAFETY * np.maximum(nearest_other.max(axis=0), nearest_value.max()))


@dataclass(frozen=True, eq=False)
class Spectrum(ReadOnlyArrays):
    """Eigenvalues of a return map with left and right eigenvectors."""

    values: ComplexArray  # by falling modulus, shape (n,)
    right: ComplexArray  # unit eigenvectors as columns
    left: ComplexArray  # likewise, with left[:, i]^H right[:, i] = 1
    error: Array  # bound on the error of each value, shape (n,)

    def nearest(self, target: complex) -> int:
        """Index of the eigenvalue nearest to a number."""
        return int(np.abs(self.values - target).argmin())


def eigensystem(matrix: Array) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Eigenvalues by falling modulus, unit right eigenvectors as columns, and left ones with left[:, i]^H right[:, i] =
    1; these are infinite for a defective matrix, whose conditions give no bound."""
    values, right = np.linalg.eig(matrix)
    relative = np.round(np.abs(values) / max(float(np.abs(values).max()), 1e-300), 12)
    # The two of a pair stand together, positive frequency first.
    order = np.lexsort((-values.imag, -np.round(np.abs(values.imag), 12), -relative))
    values, right = values[order].astype(np.complex128), right[:, order].astype(np.complex128)
    try:
        return values, right, np.linalg.inv(right).conj().T
    except np.linalg.LinAlgError:
        return values, right, np.full_like(right, np.inf)


def spectrum(image: ReturnMap) -> Spectrum:
    """Eigenvalues of a return map with their condition, without the zero of the direction of motion."""
    into, out_of = _across(image)
    jacobian = out_of @ image.jacobian @ into
    # In units that make all entries similar, the errors of the eigenvalue solver are small relative to each.
    units = numerical_balance(jacobian)
    scaled = jacobian * units / units[:, None]
    values, right, left = eigensystem(scaled)
    # The backward error of the eigenvalue solver, whose eigenvectors have length 1.
    error = 4.0 * _EPSILON * float(np.linalg.norm(scaled)) * np.linalg.norm(left, axis=0)
    right, left = into @ (units[:, None] * right), out_of.T @ (left / units[:, None])
    norms = np.linalg.norm(right, axis=0)
    right, left = right / norms, left * norms
    # d nu = left^H E right, bounded from every entry of E.
    wrong = np.broadcast_to(image.error, image.jacobian.shape)
    error += (np.abs(left) * (wrong @ np.abs(right))).sum(axis=0)
    error = np.where(np.isfinite(error), error, np.inf)
    if (error > FIRST_ORDER * np.abs(values[0])).any():
        error = np.minimum(error, eigenvalue_errors(values, jacobian, np.abs(out_of) @ wrong @ np.abs(into)))
    return Spectrum(values, right, left, error)


def return_multipliers(image: ReturnMap) -> ComplexArray:
    """Eigenvalues of a return map by falling modulus, without the zero of the direction of motion."""
    matrix = image.jacobian
    if image.normal is not None:
        into, out_of = _across(image)
        matrix = out_of @ matrix @ into
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    return values[np.lexsort((-values.imag, -np.abs(values)))]


def _across(image: ReturnMap) -> tuple[Array, Array]:
    """Coordinates on the section of a return map: matrices (n, n-1) from them, and (n-1, n) to them."""
    if image.normal is None:
        return image.across, image.across
    # Units in which the motion is across the section, so that its basis can be orthonormal.
    units = numerical_balance(image.jacobian)
    basis = normal_basis(image.normal * units)
    return units[:, None] * basis, (basis.T / units) @ image.across


def normal_basis(direction: Array) -> Array:
    """Orthonormal basis of the plane across a direction, shape (n, n-1)."""
    return np.asarray(np.linalg.svd(direction[None])[2][1:].T)


def phased(vectors: ComplexArray) -> ComplexArray:
    """Columns, or one vector, turned so that the largest entry is real and positive."""
    peaks = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=0, keepdims=True), axis=0)
    return np.asarray(vectors * (np.abs(peaks) / peaks))
