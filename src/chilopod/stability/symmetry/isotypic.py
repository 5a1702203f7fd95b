"""Symmetry-adapted bases of finite groups, and bifurcations with a critical multiplier in one of their blocks.

Matrices that commute with a group get one :class:`Block` for each irreducible representation. To find them,
:func:`isotypic` needs no tables of characters: the eigenspaces of a generic symmetric matrix that commutes with the
group are irreducible (a mean over the group of a random one is generic). Characters give their equivalence and type
(Serre, Linear Representations of Finite Groups, Springer 1977, sections 2.7 and 13.2), and projections from one give
all its copies (Golubitsky, Stewart & Schaeffer, Singularities and Groups in Bifurcation Theory II, Springer 1988,
sections XII.2 and XII.3).

The block determines the multipliers that are critical together, the terms of the normal form and, at +1 and -1, the
lines of new orbits: those fixed by an axial isotropy subgroup (equivariant branching lemma, theorem XIII.3.3 there; for
period doublings of maps Chossat & Golubitsky, SIAM J. Math. Anal. 19 (1988) 1259). :func:`symmetric_crossing` finds
them as intersections of the spaces that single elements fix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.stability.symmetry.groups import Group, Images
from chilopod.stability.unit_circle.spectra import CircleEvent

_TRIES = 8  # random matrices, of which one in millions is not generic
_DISTINCT = 1e-7  # distance of eigenvalues of a random matrix of norm one that count as equal
_EXACT = 1e-6  # distance of entries of orthogonal matrices and numbers from 0 and from whole numbers


@dataclass(frozen=True, eq=False)
class Block(ReadOnlyArrays):
    """An irreducible real representation of a group, of dimension d, with all its m copies in the space of states."""

    # True for the real type, whose representation commutes with multiples of the identity only; False for the complex
    # type, such as turns of a plane
    real: bool
    # symmetry-adapted basis B, shape (n, m d); for the real type one copy after the other: P B = B (I_m ⊗ rho(P))
    basis: Array
    dual: Array  # left inverse of the basis, zero on the other blocks, shape (m d, n)
    representation: Array  # orthogonal matrices rho(P) of the elements, shape (order, d, d)
    kernel: NDArray[np.bool_]  # True for elements that act as the identity, which new orbits keep, shape (order,)

    @property
    def dimension(self) -> int:
        """Dimension d of the irreducible representation over the reals."""
        return int(self.representation.shape[1])

    @property
    def multiplicity(self) -> int:
        return self.basis.shape[1] // self.dimension

    @property
    def trivial(self) -> bool:
        """True if every element acts as the identity: a bifurcation in this block breaks no symmetry."""
        return bool(self.kernel.all())

    @property
    def repeats(self) -> int:
        """Multiplicity in the full matrix of an eigenvalue of the reduced form."""
        return self.dimension if self.real else 1

    def reduced(self, matrices: Array) -> Array:
        """Reduced form of matrices M, shape (..., n, n), that commute with the group (else of the mean of P M P^-1):
        A, shape (..., m, m), with dual @ M @ basis = A ⊗ I_d for the real type, dual @ M @ basis for the complex."""
        return self._diagonal(self.dual @ matrices @ self.basis)

    def reduced_error(self, matrices: Array, error: Array | float = 0.0) -> Array:
        """Bound on the error of the reduced matrices, from that of the entries (one number or all) and round-off."""
        entries = error + 2.0 * len(self.basis) * np.finfo(float).eps * np.abs(matrices)
        return self._diagonal(np.abs(self.dual) @ entries @ np.abs(self.basis))

    def _diagonal(self, full: Array) -> Array:
        """Means over the diagonals of the parts between two copies for the real type; else the argument."""
        if not self.real:
            return full
        m, d = self.multiplicity, self.dimension
        return np.asarray(np.einsum("...iaja->...ij", full.reshape(*full.shape[:-2], m, d, m, d)) / d)

    def mode(self, eigenvector: ComplexArray, direction: Array) -> ComplexArray:
        """The eigenvector of the full matrix to one of its reduced matrix of real type, and any vector, shape (d,)."""
        return np.asarray(self.basis @ np.kron(eigenvector, direction), dtype=np.complex128)


def isotypic(group: Group) -> tuple[Block, ...]:
    """The blocks of a finite group, the trivial one first; an AnalysisError if inexact or of quaternionic type."""
    random = np.random.default_rng(0)
    for _ in range(_TRIES):
        blocks = _blocks(group, random)
        if blocks is not None:
            return tuple(sorted(blocks, key=_rank))
    said = "no symmetry-adapted basis found: the matrices are not exact symmetries"
    raise AnalysisError(said, field="group", allowed="matrices exact to 1e-9 or better")


def _blocks(group: Group, random: np.random.Generator) -> list[Block] | None:
    """The blocks of a group; None if a random matrix was not generic, or the group is not exact."""
    q, n = group.orthogonal, group.dimension
    sets = [np.flatnonzero(group.component == number) for number in range(group.component.max() + 1)]
    blocks: list[Block] = []
    for space in (each for coordinates in sets for each in _irreducible(q, coordinates, random)):
        rho = space.T @ q @ space
        character = np.trace(rho, axis1=1, axis2=2)
        if any(abs(character @ np.trace(each.representation, axis1=1, axis2=2)) > 0.5 * group.order for each in blocks):
            continue
        real = _is_real(rho, character)
        if real is None:
            return None
        d = space.shape[1]
        # Real type: projection to the first coordinate of all copies, and from there to the others; else to all copies.
        weights = rho[:, :, 0] if real else 0.5 * character[:, None]
        transfers = d * np.tensordot(weights, q, (0, 0)) / group.order
        firsts = np.hstack([_image(transfers[0], coordinates) for coordinates in sets])
        basis = np.einsum("axy,yi->xia", transfers, firsts).reshape(n, -1)
        copies = np.kron(np.eye(basis.shape[1] // d), rho) if real else basis.T @ q @ basis
        if np.abs(q @ basis - basis @ copies).max() > _EXACT:
            return None
        kernel = np.abs(rho - np.eye(d)).max(axis=(1, 2)) < _EXACT
        blocks.append(Block(real, group.from_orthogonal @ basis, basis.T @ group.to_orthogonal, rho, kernel))
    whole = np.hstack([group.to_orthogonal @ block.basis for block in blocks])
    return blocks if whole.shape == (n, n) and np.abs(whole.T @ whole - np.eye(n)).max() <= _EXACT else None


def _irreducible(q: Array, coordinates: NDArray[np.intp], random: np.random.Generator) -> list[Array]:
    """Orthonormal bases, shape (n, d) each, of irreducible subspaces of the space of some of the coordinates."""
    own = q[:, coordinates[:, None], coordinates]
    k = len(coordinates)
    matrix = random.standard_normal((k, k))
    values, vectors = np.linalg.eigh(_mean(own, matrix + matrix.T))
    border = np.flatnonzero(np.diff(values) > _DISTINCT * np.abs(values).max()) + 1
    # Again with evenly spaced eigenvalues: the gaps between eigenvalues determine the accuracy of eigenvectors.
    levels = 1.0 + np.searchsorted(border, np.arange(k), side="right")
    embedded = np.zeros((q.shape[1], k))
    embedded[coordinates] = np.linalg.eigh(_mean(own, (vectors * levels) @ vectors.T))[1]
    return np.split(embedded, border, axis=1)


def _mean(q: Array, matrix: Array) -> Array:
    """Mean of Q M Q^T over all elements, symmetric as M, as one product."""
    order, k = len(q), len(matrix)
    products = np.swapaxes(q @ matrix, 0, 1).reshape(k, order * k)
    mean = products @ np.swapaxes(q, 0, 1).reshape(k, order * k).T / order
    return np.asarray(0.5 * (mean + mean.T))


def _image(projector: Array, coordinates: NDArray[np.intp]) -> Array:
    """Orthonormal basis, shape (n, any), of a projector's image of some coordinates, which it mixes with no others."""
    values, vectors = np.linalg.eigh(projector[np.ix_(coordinates, coordinates)])
    embedded = np.zeros((len(projector), int((values > 0.5).sum())))
    embedded[coordinates] = vectors[:, values > 0.5]
    return embedded


def _is_real(rho: Array, character: Array) -> bool | None:
    """True for the real type, by the means of chi(g)^2 and chi(g^2); None if the representation is reducible."""
    means = np.array([character @ character, np.einsum("gab,gba->", rho, rho)]) / len(rho)
    whole = tuple(np.round(means).astype(int))
    if np.abs(means - whole).max() > _EXACT:
        return None
    if whole == (4, -2):
        said, allowed = "the group has a representation of quaternionic type", "those of real or complex type"
        raise AnalysisError(said, field="group", allowed=allowed)
    return {(1, 1): True, (2, 0): False}.get(whole)


def _rank(block: Block) -> tuple[bool, int, int, tuple[float, ...]]:
    characters = np.trace(block.representation, axis1=1, axis2=2)
    return not block.trivial, block.dimension, -int(block.kernel.sum()), tuple(-np.round(characters, 6))


_ALIGNED = 1e-9  # difference from one of a cosine that counts as one: an angle of 4e-5 (elements differ by 6e-4)
_NULL = 1e-8  # difference of equal eigenvalues of elements; 1 - cos(2 pi / 10 000) is 2e-7
_MOST_SPACES = 500  # largest number of fixed-point spaces, counting conjugate ones once
_MOST_ENTRIES = 2**23  # numbers in the projectors to the fixed-point spaces of single elements: 64 MiB


class SymmetricKind(Labelled):
    """Kind of a bifurcation in a block; each member's ``sentence`` describes it in words."""

    SYMMETRY_KEPT = "symmetry kept", "no spatial symmetry is broken: the kind of the point says what happens"
    PITCHFORK = "pitchfork", "half of the symmetries are lost, and a pair of orbits that they exchange branches off"
    EQUIVARIANT_PITCHFORK = "equivariant pitchfork", "branches with less symmetry grow, each on one side of the point"
    EQUIVARIANT_TRANSCRITICAL = "equivariant transcritical", "branches with less symmetry leave, unstable as a rule"
    SYMMETRIC_PERIOD_DOUBLING = "symmetric period doubling", "orbits of twice the period and less symmetry branch off"
    SYMMETRIC_NEIMARK_SACKER = "symmetric Neimark-Sacker", "oscillations at a second frequency branch off as waves"


@dataclass(frozen=True, eq=False)
class AxialBranch(ReadOnlyArrays):
    """Line of directions in a block along which new orbits branch off, one of each class of conjugate lines.

    Attributes
    ----------
    direction
        Unit vector w of the irreducible representation, shape (d,): the new orbits leave along ``block.mode(a, w)``.
    isotropy
        Indices of the elements with rho(P) w = w, at -1 also those with -w, shape (k,): symmetries of the new orbits.
    reversed
        True if an element, or at -1 the shift by one return, maps w to -w: both halves are images of each other.
    """

    direction: Array
    isotropy: NDArray[np.intp]
    reversed: bool


@dataclass(frozen=True)
class SymmetricCrossing:
    """Crossing of the unit circle by multipliers in a block.

    Attributes
    ----------
    kind
        Kind of the crossing.
    quadratic
        Number of quadratic terms of the normal form: linearly independent maps that commute with the representation.
    branches
        Axial branches, those with the most symmetries first; not computed for a pair.
    complete
        True if these are all; the search has a budget.
    """

    kind: SymmetricKind
    quadratic: int
    branches: tuple[AxialBranch, ...]
    complete: bool


def symmetric_crossing(block: Block, critical: CircleEvent, returns: int = 1) -> SymmetricCrossing:
    """Crossing of the unit circle by a simple eigenvalue of a block's reduced matrix. With an even number of returns in
    a period, -1 breaks the symmetry in time: the new orbits have the same period, not twice that."""
    # At -1 the shift by one return makes all terms odd.
    quadratic = _quadratics(block.representation) if critical is CircleEvent.PLUS else 0
    kind = _kind(block, critical, quadratic, returns)
    if critical is CircleEvent.PAIR or not block.real:  # fixed-point spaces of the complex type have even dimensions
        return SymmetricCrossing(kind, quadratic, (), True)
    lines, complete = _fixed_lines(block.representation, critical)
    branches = [_branch(line, block, critical) for line in lines]
    branches.sort(key=lambda branch: (-branch.isotropy.size, branch.reversed))
    return SymmetricCrossing(kind, quadratic, tuple(branches), complete)


def _kind(block: Block, critical: CircleEvent, quadratic: int, returns: int) -> SymmetricKind:
    if block.trivial and not (critical is CircleEvent.MINUS and returns % 2 == 0):
        return SymmetricKind.SYMMETRY_KEPT
    if critical is CircleEvent.PAIR:
        return SymmetricKind.SYMMETRIC_NEIMARK_SACKER
    if critical is CircleEvent.MINUS and returns % 2:
        return SymmetricKind.SYMMETRIC_PERIOD_DOUBLING
    if block.dimension == 1:
        return SymmetricKind.PITCHFORK
    return SymmetricKind.EQUIVARIANT_TRANSCRITICAL if quadratic else SymmetricKind.EQUIVARIANT_PITCHFORK


def _quadratics(rho: Array) -> int:
    """Number of quadratic equivariants V -> V: multiplicity of V in its symmetric square."""
    one, two = (np.trace(power, axis1=1, axis2=2) for power in (rho, rho @ rho))
    return round(float((one * (one**2 + two)).mean() / 2.0))


def _fixed_lines(rho: Array, critical: CircleEvent) -> tuple[list[Array], bool]:
    """Unit vectors of the lines that are the fixed-point space of a subgroup (an intersection of those of single
    elements, at -1 with either sign), one of each class of conjugate ones; and True if the search was complete."""
    rho = _once(rho)
    most = _MOST_ENTRIES // rho.shape[1] ** 2
    signed = np.concatenate([rho, -rho]) if critical is CircleEvent.MINUS else rho
    # Eigenvectors of an orthogonal matrix to the eigenvalue 1 are those of its symmetric part.
    cosines, vectors = np.linalg.eigh(0.5 * (signed + np.swapaxes(signed, 1, 2)))
    projectors = _once((vectors * (cosines > 1.0 - _NULL)[:, None]) @ np.swapaxes(vectors, 1, 2))
    complete, projectors = len(projectors) <= most, projectors[:most]
    seen = Images(rho.shape[1])
    lines: list[Array] = []
    waiting: list[Array] = []

    def take(projector: Array) -> None:
        """Note a space, unless it or a conjugate one is known."""
        size = round(float(np.trace(projector)))
        if size == 0 or not seen.new(projector @ seen.probes):
            return
        for image in rho @ projector @ np.swapaxes(rho, 1, 2) @ seen.probes:
            seen.new(image)
        (lines if size == 1 else waiting).append(np.linalg.eigh(projector)[1][:, -size:])

    for projector in projectors:
        take(projector)
    for _ in range(_MOST_SPACES):
        if not waiting:
            break
        space = waiting.pop()
        # Its directions that a projector leaves unchanged.
        cosines, vectors = np.linalg.eigh(space.T @ projectors @ space)
        sizes = (cosines > 1.0 - _ALIGNED).sum(axis=1)
        for size in range(1, space.shape[1]):
            bases = space @ vectors[sizes == size][:, :, -size:]
            for common in _once(bases @ np.swapaxes(bases, 1, 2)):
                take(common)
    return [space[:, 0] for space in lines], complete and not waiting


def _once(matrices: Array) -> Array:
    """Matrices of some, shape (k, d, d), each once."""
    images = Images(matrices.shape[1])
    return matrices[[images.new(image) for image in matrices @ images.probes]]


def _branch(line: Array, block: Block, critical: CircleEvent) -> AxialBranch:
    w = line * np.sign(line[np.abs(line).argmax()])
    cosines = np.einsum("a,gab,b->g", w, block.representation, w)
    kept = (np.abs(cosines) if critical is CircleEvent.MINUS else cosines) > 1.0 - _ALIGNED
    turned = critical is CircleEvent.MINUS or bool((cosines < _ALIGNED - 1.0).any())
    return AxialBranch(w, np.flatnonzero(kept), turned)
