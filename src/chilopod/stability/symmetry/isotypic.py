"""Symmetry-adapted bases: what commutes with a finite group becomes block-diagonal, one block for each irreducible
representation.

Without tables of characters: the eigenspaces of a generic symmetric matrix that commutes with the group are irreducible
(a mean over the group of a random one is generic); characters tell which of them are equivalent and of which type
(quaternionic ones are refused), and
means of random matrices between two of them, the intertwiners, align their bases. Golubitsky, Stewart & Schaeffer,
Singularities and Groups in Bifurcation Theory II, Springer 1988, sections XII.2 and XII.3; the types: Serre, Linear
Representations of Finite Groups, Springer 1977, section 13.2.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.symmetry.groups import Group

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_TRIES = 8
"""Random matrices: one in millions is not generic."""

_DISTINCT = 1e-7
"""Eigenvalues of a random matrix of norm one that lie closer together are one."""

_EXACT = 1e-6
"""Entries of orthogonal matrices that are told apart from zero, and numbers from whole numbers; the elements are exact
to about 1e-12."""


class Type(enum.Enum):
    """Type of an irreducible real representation: it commutes with real or complex numbers."""

    REAL = "real"
    COMPLEX = "complex"


@dataclass(frozen=True)
class Block(ReadOnlyArrays):
    """An irreducible real representation of a group, with all its copies in the space of states.

    Attributes
    ----------
    type
        Real or complex.
    basis
        Symmetry-adapted basis B, one copy after the other, in all of them the same matrices: P B = B (I_m ⊗ rho(P)),
        shape (n, m d).
    dual
        Its left inverse, zero on the other blocks, shape (m d, n).
    representation
        rho(P) of each element, orthogonal matrices, shape (order, d, d).
    units
        Basis of what commutes with rho: the identity, and with the complex type a matrix J with J^2 = -1; shape
        (1, d, d) or (2, d, d).
    kernel
        Elements that act as the identity, truth values of shape (order,): new orbits keep these symmetries whatever
        else they break.
    """

    type: Type
    basis: Array
    dual: Array
    representation: Array
    units: Array
    kernel: NDArray[np.bool_]

    @property
    def dimension(self) -> int:
        """Dimension d of the irreducible representation over the reals."""
        return int(self.representation.shape[1])

    @property
    def multiplicity(self) -> int:
        """Number m of copies."""
        return self.basis.shape[1] // self.dimension

    @property
    def trivial(self) -> bool:
        """True if every element acts as the identity: what happens in this block breaks no symmetry."""
        return bool(self.kernel.all())

    def reduced(self, matrices: ArrayLike) -> Array | ComplexArray:
        """Reduced form of matrices that commute with the group.

        Parameters
        ----------
        matrices
            M, shape (..., n, n).

        Returns
        -------
        Real type: A, shape (..., m, m), with dual @ M @ basis = A ⊗ I_d. Complex type: A + i B, of the same shape, with
        dual @ M @ basis = A ⊗ 1 + B ⊗ J. Of a matrix that does not commute, the mean of P M P^-1 over the group is
        taken.
        """
        given = np.asarray(matrices, dtype=np.float64)
        m, d = self.multiplicity, self.dimension
        full = (self.dual @ given @ self.basis).reshape(*given.shape[:-2], m, d, m, d)
        parts = np.einsum("...iajb,uab->u...ij", full, self.units) / d
        return np.asarray(parts[0] if self.type is Type.REAL else parts[0] + 1j * parts[1])

    def reduced_error(self, matrices: ArrayLike, error: ArrayLike = 0.0) -> Array:
        """Bound on the absolute error of the entries of the reduced matrices.

        Parameters
        ----------
        matrices
            M, shape (..., n, n).
        error
            Bound on the absolute error of the entries of M: one for all, or anything that fits their shape.

        Returns
        -------
        Shape of :meth:`reduced`: what ``error`` and the round-off of the reduction amount to.
        """
        given = np.asarray(matrices, dtype=np.float64)
        m, d, n = self.multiplicity, self.dimension, self.basis.shape[0]
        entries = np.asarray(error, dtype=np.float64) + 2.0 * n * np.finfo(float).eps * np.abs(given)
        full = (np.abs(self.dual) @ entries @ np.abs(self.basis)).reshape(*given.shape[:-2], m, d, m, d)
        return np.asarray(np.einsum("...iajb,uab->...ij", full, np.abs(self.units)) / d)

    def mode(self, eigenvector: ArrayLike, direction: ArrayLike) -> ComplexArray:
        """The eigenvector of a matrix that commutes with the group, to an eigenvector of its reduced matrix.

        Parameters
        ----------
        eigenvector
            Eigenvector of the reduced matrix, shape (m,).
        direction
            For the real type any vector, for the complex type one with J w = i w, shape (d,).
        """
        a, w = np.asarray(eigenvector, dtype=np.complex128), np.asarray(direction, dtype=np.complex128)
        return np.asarray(self.basis @ np.kron(a, w))


def isotypic(group: Group) -> tuple[Block, ...]:
    """The blocks of a finite group, the trivial one first, then by rising dimension and falling kernel.

    Raises
    ------
    AnalysisError
        The matrices of the group are not exact enough to tell its representations apart, or one of these is of
        quaternionic type.
    """
    random = np.random.default_rng(0)
    for _ in range(_TRIES):
        spaces = _irreducible(group, random)
        if spaces is None:
            continue
        blocks = [_block(group, copies, kind, random) for copies, kind in spaces]
        blocks.sort(key=_rank)
        if _verified(group, blocks):
            return tuple(blocks)
    raise AnalysisError(
        "no symmetry-adapted basis found: the matrices are no exact symmetries",
        field="group",
        allowed="matrices exact to 1e-9 or better",
    )


def _mean(left: Array, matrix: Array, right: Array) -> Array:
    """Mean of L M R^T over all elements, as one product; shapes (order, p, p), (p, q) and (order, q, q)."""
    order, p, q = len(left), matrix.shape[0], matrix.shape[1]
    products = np.swapaxes(left @ matrix, 0, 1).reshape(p, order * q)
    return np.asarray(products @ np.swapaxes(right, 0, 1).reshape(q, order * q).T / order)


def _irreducible(group: Group, random: np.random.Generator) -> list[tuple[list[Array], Type]] | None:
    """Orthonormal bases of irreducible spaces, equivalent ones together, with their types; None after bad luck."""
    bases = [
        basis
        for number in range(group.component.max() + 1)
        for basis in _invariant(group.orthogonal, np.flatnonzero(group.component == number), random)
    ]
    q = group.orthogonal
    restricted = [basis.T @ q @ basis for basis in bases]
    characters = np.array([np.trace(rho, axis1=1, axis2=2) for rho in restricted])
    products = characters @ characters.T / group.order
    groups: list[tuple[list[Array], Type]] = []
    firsts: list[int] = []
    for i, rho in enumerate(restricted):
        of_squares = float(np.einsum("gab,gba->", rho, rho)) / group.order
        kind = _type(float(products[i, i]), of_squares)
        if kind is None:
            return None
        for (copies, _), first in zip(groups, firsts, strict=True):
            if products[i, first] > 0.5:
                copies.append(bases[i])
                break
        else:
            groups.append(([bases[i]], kind))
            firsts.append(i)
    return groups


def _invariant(q: Array, coordinates: NDArray[np.intp], random: np.random.Generator) -> list[Array]:
    """Orthonormal bases, shape (n, d) each, of invariant subspaces of the space of some of the coordinates."""
    own = q[:, coordinates[:, None], coordinates]
    k = len(coordinates)
    matrix = random.standard_normal((k, k))
    values, vectors = np.linalg.eigh(_symmetric(_mean(own, matrix + matrix.T, own)))
    border = np.flatnonzero(np.diff(values) > _DISTINCT * np.abs(values).max()) + 1
    # Once more with eigenvalues that lie evenly: eigenvectors are as exact as their eigenvalues are far apart.
    levels = 1.0 + np.searchsorted(border, np.arange(k), side="right")
    vectors = np.linalg.eigh(_symmetric(_mean(own, (vectors * levels) @ vectors.T, own)))[1]
    embedded = np.zeros((q.shape[1], k))
    embedded[coordinates] = vectors
    return np.split(embedded, border, axis=1)


def _type(square: float, of_squares: float) -> Type | None:
    """Type of an irreducible representation by the means of chi(g)^2 and chi(g^2); None if it is reducible."""
    known = {(1, 1): Type.REAL, (2, 0): Type.COMPLEX}
    whole = round(square), round(of_squares)
    if abs(square - whole[0]) > _EXACT or abs(of_squares - whole[1]) > _EXACT:
        return None
    if whole == (4, -2):
        raise AnalysisError(
            "the group has a representation of quaternionic type",
            field="group",
            allowed="those of real or complex type",
        )
    return known.get(whole)


def _block(group: Group, copies: list[Array], kind: Type, random: np.random.Generator) -> Block:
    q = group.orthogonal
    first = copies[0]
    if first.shape[1] == 1:
        first = first * np.sign(first[np.abs(first[:, 0]).argmax(), 0])
    rho = np.asarray(first.T @ q @ first)
    d = first.shape[1]
    aligned = [first]
    for other in copies[1:]:
        intertwiner = _mean(other.T @ q @ other, random.standard_normal((d, d)), rho)
        # By Schur's lemma a multiple of an orthogonal matrix.
        left, _, right = np.linalg.svd(intertwiner)
        aligned.append(other @ (left @ right))
    basis = np.hstack(aligned)
    return Block(
        kind,
        group.from_orthogonal @ basis,
        basis.T @ group.to_orthogonal,
        rho,
        _units(rho, kind, random),
        np.abs(rho - np.eye(d)).max(axis=(1, 2)) < _EXACT,
    )


def _units(rho: Array, kind: Type, random: np.random.Generator) -> Array:
    identity = np.eye(rho.shape[1])
    if kind is Type.REAL:
        return identity[None]
    matrix = random.standard_normal(identity.shape)
    unit = _mean(rho, matrix - matrix.T, rho)
    unit = 0.5 * (unit - unit.T)
    unit *= np.sqrt(len(unit)) / np.linalg.norm(unit)
    # Which of the two square roots of -1: the one with which the first element that tells them apart turns.
    turns = np.einsum("gab,ab->g", rho, unit)
    telling = turns[np.abs(turns) > _EXACT]
    return np.array([identity, -unit if telling.size and telling[0] < 0.0 else unit])


def _rank(block: Block) -> tuple[bool, int, int, tuple[float, ...]]:
    characters = np.trace(block.representation, axis1=1, axis2=2)
    return not block.trivial, block.dimension, -int(block.kernel.sum()), tuple(-np.round(characters, 6))


def _verified(group: Group, blocks: Sequence[Block]) -> bool:
    """True if the bases are what they should be: together one basis, in which generators and commutants have their
    forms."""
    basis = np.hstack([group.to_orthogonal @ block.basis for block in blocks])
    n = group.dimension
    if basis.shape != (n, n) or np.abs(basis.T @ basis - np.eye(n)).max() > _EXACT:
        return False
    for block in blocks:
        own = group.to_orthogonal @ block.basis
        rho, m, d = block.representation, block.multiplicity, block.dimension
        moved = (own.T @ group.orthogonal @ own).reshape(-1, m, d, m, d)
        copies = np.einsum("ij,gab->giajb", np.eye(m), rho)
        commuting = rho[:, None] @ block.units - block.units @ rho[:, None]
        squares = block.units[1:] @ block.units[1:] + np.eye(d)
        if max(np.abs(moved - copies).max(), np.abs(commuting).max(), np.abs(squares).max(initial=0.0)) > _EXACT:
            return False
    return True


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))
