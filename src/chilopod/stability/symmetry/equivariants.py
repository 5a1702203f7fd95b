"""Bifurcations with a critical multiplier in a block of a symmetry group.

The block determines the multipliers that are critical together, the terms of the normal form and, at +1 and -1, the
lines of new orbits: those fixed by an axial isotropy subgroup (equivariant branching lemma; Golubitsky, Stewart
& Schaeffer, Singularities and Groups in Bifurcation Theory II, Springer 1988, theorem XIII.3.3; for period doublings of
maps Chossat & Golubitsky, SIAM J. Math. Anal. 19 (1988) 1259).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.stability.symmetry.groups import Images
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.spectra import Event

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


def symmetric_crossing(block: Block, critical: Event, returns: int = 1) -> SymmetricCrossing:
    """Crossing of the unit circle by a simple eigenvalue of a block's reduced matrix. With an even number of returns in
    a period, -1 breaks the symmetry in time: the new orbits have the same period, not twice that."""
    # At -1 the shift by one return makes all terms odd.
    quadratic = _quadratics(block.representation) if critical is Event.PLUS else 0
    kind = _kind(block, critical, quadratic, returns)
    if critical is Event.PAIR or not block.real:  # fixed-point spaces of the complex type have even dimensions
        return SymmetricCrossing(kind, quadratic, (), True)
    lines, complete = _fixed_lines(block.representation, critical)
    branches = [_branch(line, block, critical) for line in lines]
    branches.sort(key=lambda branch: (-branch.isotropy.size, branch.reversed))
    return SymmetricCrossing(kind, quadratic, tuple(branches), complete)


def _kind(block: Block, critical: Event, quadratic: int, returns: int) -> SymmetricKind:
    if block.trivial and not (critical is Event.MINUS and returns % 2 == 0):
        return SymmetricKind.SYMMETRY_KEPT
    if critical is Event.PAIR:
        return SymmetricKind.SYMMETRIC_NEIMARK_SACKER
    if critical is Event.MINUS and returns % 2:
        return SymmetricKind.SYMMETRIC_PERIOD_DOUBLING
    if block.dimension == 1:
        return SymmetricKind.PITCHFORK
    return SymmetricKind.EQUIVARIANT_TRANSCRITICAL if quadratic else SymmetricKind.EQUIVARIANT_PITCHFORK


def _quadratics(rho: Array) -> int:
    """Number of quadratic equivariants V -> V: multiplicity of V in its symmetric square."""
    one, two = (np.trace(power, axis1=1, axis2=2) for power in (rho, rho @ rho))
    return round(float((one * (one**2 + two)).mean() / 2.0))


def _fixed_lines(rho: Array, critical: Event) -> tuple[list[Array], bool]:
    """Unit vectors of the lines that are the fixed-point space of a subgroup (an intersection of those of single
    elements, at -1 with either sign), one of each class of conjugate ones; and True if the search was complete."""
    rho = _once(rho)
    most = _MOST_ENTRIES // rho.shape[1] ** 2
    signed = np.concatenate([rho, -rho]) if critical is Event.MINUS else rho
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
        if size == 0 or seen.known(projector @ seen.probes):
            return
        for image in rho @ projector @ np.swapaxes(rho, 1, 2) @ seen.probes:
            seen.new(image)
        space = np.linalg.eigh(projector)[1][:, -size:]
        if size == 1:
            lines.append(space[:, 0])
        else:
            waiting.append(space)

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
    return lines, complete and not waiting


def _once(matrices: Array) -> Array:
    """Matrices of some, shape (k, d, d), each once."""
    images = Images(matrices.shape[1])
    return matrices[[images.new(image) for image in matrices @ images.probes]]


def _branch(line: Array, block: Block, critical: Event) -> AxialBranch:
    w = line * np.sign(line[np.abs(line).argmax()])
    cosines = np.einsum("a,gab,b->g", w, block.representation, w)
    kept = (np.abs(cosines) if critical is Event.MINUS else cosines) > 1.0 - _ALIGNED
    turned = critical is Event.MINUS or bool((cosines < _ALIGNED - 1.0).any())
    return AxialBranch(w, np.flatnonzero(kept), turned)
