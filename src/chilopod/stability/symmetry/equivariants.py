"""What can happen where a multiplier becomes critical in a block of a symmetry group.

The block says which multipliers are critical together, which terms the normal form has, and along which lines new
orbits branch off: those fixed by an axial isotropy subgroup (equivariant branching lemma; at a complex pair the
equivariant Hopf theorem). Golubitsky, Stewart & Schaeffer, Singularities and Groups in Bifurcation Theory II, Springer
1988, theorems XIII.3.3 and XVI.4.1; Crawford & Knobloch, Annu. Rev. Fluid Mech. 23 (1991) 341; for period doublings of
maps Chossat & Golubitsky, SIAM J. Math. Anal. 19 (1988) 1259.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.stability.symmetry.group_closure import Images
from chilopod.stability.symmetry.isotypic import Block, Type
from chilopod.stability.unit_circle.spectra import Event

ComplexArray = NDArray[np.complex128]
Matrices = NDArray[Any]
"""Real or complex, as the representation is."""

_ALIGNED = 1e-9
"""Below one by less than this, a cosine is one: an angle of 4e-5 (two elements differ by 6e-4 or more)."""

_NULL = 1e-8
"""Phases of elements that differ by less are one; 1 - cos(2 pi / 10 000) is 2e-7."""

_MOST_SPACES = 500
"""Fixed-point spaces looked at, conjugate ones counted once."""

_MOST_ENTRIES = 2**23
"""Numbers in the projectors to the fixed-point spaces of single elements: 128 MiB."""

_IRRATIONAL = 0.5 * (np.sqrt(5.0) - 1.0)
"""As far from all fractions as a number can be."""


class SymmetricKind(Labelled):
    """What happens in a block; each member's ``sentence`` says it in words."""

    SYMMETRY_KEPT = (
        "symmetry kept",
        "no spatial symmetry is broken: the kind of the point says what happens",
    )
    PITCHFORK = (
        "pitchfork",
        "the orbit loses half of its symmetries and a pair of orbits that they exchange branches off",
    )
    EQUIVARIANT_PITCHFORK = (
        "equivariant pitchfork",
        "several multipliers cross at once; branches of orbits with less symmetry grow, each on one side of the point",
    )
    EQUIVARIANT_TRANSCRITICAL = (
        "equivariant transcritical",
        "several multipliers cross at once; branches of orbits with less symmetry, those whose halves differ on both "
        "sides of the point, leave unstable as a rule",
    )
    PERIOD_DOUBLING = "period doubling", "an orbit of twice the period and with the same symmetries branches off"
    SYMMETRIC_PERIOD_DOUBLING = (
        "symmetric period doubling",
        "orbits of twice the period and with less symmetry at an instant branch off",
    )
    NEIMARK_SACKER = "Neimark-Sacker", "an oscillation at a second frequency branches off that keeps all symmetries"
    SYMMETRIC_NEIMARK_SACKER = (
        "symmetric Neimark-Sacker",
        "oscillations at a second frequency branch off that are waves: rotating, standing, or both kinds",
    )


@dataclass(frozen=True)
class AxialBranch(ReadOnlyArrays):
    """A line of directions in a block along which new orbits branch off, one of each class of conjugate lines.

    Attributes
    ----------
    direction
        Unit vector w on which the irreducible representation acts, shape (d,); real at a multiplier ±1. The new orbits
        leave along ``block.mode(a, w)``, a being the critical eigenvector of the reduced matrix.
    isotropy
        Numbers of the elements with rho(P) w = exp(i phase) w, shape (k,): what the new orbits keep, where there
        is a phase together with a shift in time.
    phases
        Their phases, rad in (-pi, pi], shape (k,): 0 at +1; 0 or pi, a shift by one return, at -1. At a pair, P
        shifts the new oscillation forward by phase / (2 pi) of its period.
    reversed
        Whether an element, or at -1 and at a pair a shift in time, takes w to -w: both halves of the branch are then
        the same orbits, seen differently.
    """

    direction: ComplexArray
    isotropy: NDArray[np.intp]
    phases: NDArray[np.float64]
    reversed: bool


@dataclass(frozen=True)
class SymmetricCrossing:
    """What happens where multipliers in a block cross the unit circle.

    Attributes
    ----------
    kind
        What it is.
    critical
        Number of critical multipliers, both of a pair counted.
    codimension
        Number of parameters that it takes: 1 as a rule. In blocks of complex type multipliers are complex as a rule,
        and ±1 is an exception.
    quadratic
        Number of linearly independent quadratic maps that commute with the representation (with its negatives too at
        -1; with phase shifts too at a pair): terms of the normal form.
    branches
        The axial ones, those that keep most elements first.
    complete
        Whether these are all of them: the search ends after a budget.
    """

    kind: SymmetricKind
    critical: int
    codimension: int
    quadratic: int
    branches: tuple[AxialBranch, ...]
    complete: bool


def symmetric_crossing(block: Block, critical: Event, returns: int = 1) -> SymmetricCrossing:
    """What happens where an eigenvalue of a block's reduced matrix, simple there, crosses the unit circle.

    Parameters
    ----------
    block
        The block; :func:`chilopod.stability.symmetry.isotypic.isotypic` makes them.
    critical
        Where it crosses.
    returns
        Number of returns in a period. Where it is even, -1 breaks the symmetry in time: the new orbits have the same
        period, not twice of it.
    """
    if critical is Event.PAIR:
        space: Matrices = block.half_space
        rho: Matrices = space.conj().T @ block.representation @ space
    else:
        space, rho = np.eye(block.dimension), block.representation
    # At -1 all is odd by the shift by one return.
    quadratic = _quadratics(rho) if critical is Event.PLUS else 0
    lines, complete = _fixed_lines(rho, critical)
    branches = [_branch(space @ line, block, critical) for line in lines]
    # At a pair, what rotates before what stands.
    branches.sort(key=lambda b: (-b.isotropy.size, b.reversed, round(abs(complex((b.direction**2).sum())), 6)))
    multipliers = 2 * block.repeated if critical is Event.PAIR else block.dimension
    codimension = 1 if critical is Event.PAIR or block.type is Type.REAL else 2
    return SymmetricCrossing(
        _kind(block, critical, quadratic, returns), multipliers, codimension, quadratic, tuple(branches), complete
    )


def _kind(block: Block, critical: Event, quadratic: int, returns: int) -> SymmetricKind:
    if critical is Event.PAIR:
        return SymmetricKind.NEIMARK_SACKER if block.trivial else SymmetricKind.SYMMETRIC_NEIMARK_SACKER
    if critical is Event.MINUS and returns % 2:
        return SymmetricKind.PERIOD_DOUBLING if block.trivial else SymmetricKind.SYMMETRIC_PERIOD_DOUBLING
    if block.trivial and critical is Event.PLUS:
        return SymmetricKind.SYMMETRY_KEPT
    if block.dimension == 1:
        return SymmetricKind.PITCHFORK
    return SymmetricKind.EQUIVARIANT_TRANSCRITICAL if quadratic else SymmetricKind.EQUIVARIANT_PITCHFORK


def _quadratics(rho: Matrices) -> int:
    """Number of quadratic equivariants V -> V: how often V is in its symmetric square (Sattinger, Group Theoretic
    Methods in Bifurcation Theory, Springer 1979)."""
    one, two = (np.trace(power, axis1=1, axis2=2) for power in (rho, rho @ rho))
    return round(float((one * (one**2 + two)).mean() / 2.0))


def _fixed_lines(rho: Matrices, critical: Event) -> tuple[list[Matrices], bool]:
    """Unit vectors of the lines that are the fixed-point space of a subgroup, one of each class of conjugate ones, and
    whether the search came to its end.

    Every fixed-point space is an intersection of those of single elements, with the phases by which they act.
    """
    rho = _once(rho)
    e = rho.shape[1]
    spaces, complete = _eigenspaces(rho, critical)
    projectors = np.array([space @ space.conj().T for space in spaces])
    seen = Images(2 * e)
    lines: list[Matrices] = []
    waiting: list[Matrices] = []

    def take(space: Matrices) -> None:
        """Note a space, unless it or a conjugate one was met before."""
        projector = space @ space.conj().T
        if seen.number(_probed(projector[None], seen)[0]) is not None:
            return
        for image in _probed(rho @ projector @ np.swapaxes(rho.conj(), 1, 2), seen):
            if seen.number(image) is None:
                seen.add(image)
        if space.shape[1] == 1:
            lines.append(space[:, 0])
        else:
            waiting.append(space)

    for space in spaces:
        take(space)
    for _ in range(_MOST_SPACES):
        if not waiting:
            break
        space = waiting.pop()
        # Directions of it that a projector leaves as they are.
        cosines, vectors = np.linalg.eigh(space.conj().T @ projectors @ space)
        sizes = (cosines > 1.0 - _ALIGNED).sum(axis=1)
        for size in range(1, space.shape[1]):
            bases = space @ vectors[sizes == size][:, :, -size:]
            for common in _once(bases @ np.swapaxes(bases.conj(), 1, 2)):
                take(np.linalg.eigh(common)[1][:, -size:])
    return lines, complete and not waiting


def _probed(matrices: Matrices, images: Images) -> NDArray[np.float64]:
    """What tells matrices from each other: images of probes, real parts above imaginary ones."""
    e = matrices.shape[1]
    products = matrices @ (images.probes[:e] + 1j * images.probes[e:])
    return np.concatenate([products.real, products.imag], axis=1)


def _once(matrices: Matrices) -> Matrices:
    """Matrices of some, shape (k, e, e), each once."""
    images = Images(2 * matrices.shape[1])
    first = []
    for number, image in enumerate(_probed(matrices, images)):
        if images.number(image) is None:
            images.add(image)
            first.append(number)
    return matrices[first]


def _eigenspaces(rho: Matrices, critical: Event) -> tuple[list[Matrices], bool]:
    """Orthonormal bases of the spaces on which single elements act as a phase that a shift in time can undo, each once,
    and whether these are all."""
    e = rho.shape[1]
    # Eigenvectors of a unitary matrix g are those of the Hermitian one with the eigenvalues 2 cos(angle + turn).
    turn = 1.0 if critical is not Event.PAIR else np.exp(1j * np.pi * _IRRATIONAL)
    turned = turn * rho
    vectors = np.linalg.eigh(turned + np.swapaxes(turned.conj(), 1, 2))[1]
    phases = np.einsum("gai,gab,gbi->gi", vectors.conj(), rho, vectors)
    spaces: list[Matrices] = [np.eye(e, dtype=rho.dtype)]
    images = Images(2 * e)
    images.add(_probed(np.eye(e)[None], images)[0])
    for columns, values in zip(vectors, phases, strict=True):
        if critical is Event.PAIR:
            wanted = [v for i, v in enumerate(values) if (np.abs(values[:i] - v) > _NULL).all()]
        else:
            wanted = [1.0, -1.0] if critical is Event.MINUS else [1.0]
        for phase in wanted:
            space = columns[:, np.abs(values - phase) < _NULL]
            image = _probed((space @ space.conj().T)[None], images)[0]
            if space.shape[1] and images.number(image) is None:
                if len(spaces) * e * e > _MOST_ENTRIES:
                    return spaces, False
                images.add(image)
                spaces.append(space)
    return spaces, True


def _branch(direction: Matrices, block: Block, critical: Event) -> AxialBranch:
    w = direction.astype(np.complex128)
    largest = w[np.abs(w).argmax()]
    w = w * (np.abs(largest) / largest)
    factors = np.einsum("a,gab,b->g", w.conj(), block.representation, w)
    if critical is Event.PAIR:
        kept = np.abs(factors) > 1.0 - _ALIGNED
    elif critical is Event.MINUS:
        kept = np.abs(factors.real) > 1.0 - _ALIGNED
    else:
        kept = factors.real > 1.0 - _ALIGNED
    phases = np.angle(factors[kept])
    phases[np.abs(phases) < _NULL] = 0.0
    phases[np.abs(phases) > np.pi - _NULL] = np.pi
    turned = critical is not Event.PLUS or bool((factors.real < _ALIGNED - 1.0).any())
    return AxialBranch(w, np.flatnonzero(kept), phases, turned)
