"""Finite groups of matrices: the spatial symmetries P f(t, x) = f(t, P x) of a system.

:func:`finite_group` finds scales of the coordinates in which all powers of the generators have entries of order one,
then all products, and last coordinates in which every element is orthogonal: the mean of P^T P over the group is a
metric in which it is (Golubitsky, Stewart & Schaeffer, Singularities and Groups in Bifurcation Theory II, Springer
1988, proposition XII.1.3).

An orbit that is invariant under a group, P x(t) = x(t), has a return map whose derivative commutes with every P of it;
:func:`isotropy` and :func:`centraliser` find such a subgroup, and :mod:`.isotypic` splits the derivative into blocks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.carrying import numerical_balance
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays, read_only
from chilopod.stability.interface import SystemLike, spatial_symmetries

_PROBES = 3  # probe vectors: a single one may by chance lie close to a mirror plane
_SAME = 1e-7  # two elements of a cyclic group of ten thousand are 6e-4 apart; round-off of as many products is 1e-11
_CELL = 8.0 * _SAME
_LARGEST_ORDER = 10_000  # largest number of elements of a group
_MOST_GENERATORS = 500
_MOST_ENTRIES = 2**25  # numbers in the matrices of all elements: 256 MiB
_RETURNED = 1e-9  # difference from the identity's diagonal of a power that equals it; a turn by 2 pi / 10 000 has 2e-7
_MIXED = 1e-11  # least entry, relative to elements of order one, that mixes two coordinates
_CHANCE = 1e-12  # entry that is round-off, relative to the coupling of two coordinates through a third
_LEVELLED = 0.125  # exponent that makes a weight of 1e-17 one of 0.7 %
_ROUND_OFF = 64.0 * float(np.finfo(float).eps)
_LOOSE = 1e-6  # largest residual of a symmetry of a state or a mode, relative to the size of the states
_INFINITE = "generate an infinite group, or too large a one"


@dataclass(frozen=True, eq=False)
class Group(ReadOnlyArrays):
    """A finite group of matrices; :func:`finite_group` makes one."""

    generators: Array  # shape (generators, n, n)
    elements: Array  # all of them, the identity first, shape (order, n, n)
    to_orthogonal: Array  # to coordinates y in which every element is an orthogonal matrix, and back, shape (n, n) both
    from_orthogonal: Array
    # scales of the coordinates x, shape (n,): entry (i, j) of an element is of the order of scales[i] / scales[j] at
    # most; without meaning between coordinates that no element mixes
    scales: Array
    # number of each coordinate's set, shape (n,), such as one kind of state over all cells of a ring: neither elements
    # nor `to_orthogonal` mix the sets, so their units are independent
    component: NDArray[np.intp]

    @property
    def order(self) -> int:
        return len(self.elements)

    @property
    def dimension(self) -> int:
        return int(self.elements.shape[1])

    @cached_property
    def orthogonal(self) -> Array:
        """The elements as orthogonal matrices, in the coordinates y, shape (order, n, n)."""
        return read_only(np.asarray(self.to_orthogonal @ self.elements @ self.from_orthogonal))


def finite_group(generators: ArrayLike) -> Group:
    """The group of all products of matrices, shape (n, n), in any units; a ParameterError for too many."""
    try:
        given = np.atleast_1d(np.array(generators, dtype=np.float64))
    except (TypeError, ValueError):  # also for matrices of several shapes
        given = np.empty(0)
    n = given.shape[-1]
    if given.shape[1:] != (n, n) or not (n and 1 <= len(given) <= _MOST_GENERATORS and np.isfinite(given).all()):
        allowed = f"1 to {_MOST_GENERATORS} real and finite ones of shape (n, n)"
        raise ParameterError("must be square matrices", field="generators", value=generators, allowed=allowed)
    most = max(1, min(_LARGEST_ORDER, _MOST_ENTRIES // n**2))
    envelopes, residuals = zip(*(_powers(matrix, most) for matrix in given), strict=True)
    scales = _coordinate_scales(np.asarray(np.max(envelopes, axis=0)))
    for matrix, residual in zip(given, residuals, strict=True):
        if np.abs(_scaled(residual, scales)).max() > _SAME:
            raise _infinite(matrix, most)
    found = _closure(given, scales, most)
    if found is None:
        raise ParameterError(_INFINITE, field="generators", allowed=f"{most} elements or fewer in dimension {n}")
    return _with_metric(*found, scales)


def isotropy(group: Group, x: Array, error: Array | float = 0.0) -> Group:
    """The isotropy subgroup of a state, with a bound on its error, shapes (n,): all P with P x = x."""
    moved = np.abs(group.elements @ x - x)
    allowed = (np.abs(group.elements) + np.eye(group.dimension)) @ (error + _SAME * np.abs(x))
    return _subgroup(group, np.all(moved <= allowed, axis=1), "orbit")


def centraliser(group: Group, gamma: Array) -> Group:
    """The subgroup of all P that commute with a symmetry in time, gamma f(t + T/k, x) = f(t, gamma x): those that
    commute with the derivative of the flow on an invariant orbit then do so with the return map gamma Phi.

    The symmetry must normalise the group: gamma P gamma^-1 is an element for every element P.
    """
    matrix = _scaled(gamma, group.scales)
    own = _scaled(group.elements, group.scales)
    left, right = matrix @ own, own @ matrix
    size = np.abs(matrix).max()
    if np.linalg.matrix_rank(matrix) < group.dimension:
        raise ParameterError("is not invertible", field="symmetry")
    for image in matrix @ _scaled(group.generators, group.scales):  # which is P gamma for some element P
        if not np.abs(right - image).max(axis=(1, 2)).min() <= _SAME * size:
            said, allowed = "does not normalise the spatial symmetries", "S P S^-1 in their group for every P of it"
            raise ParameterError(said, field="symmetry", allowed=allowed)
    return _subgroup(group, np.all(np.abs(left - right) <= _SAME * size, axis=(1, 2)), "symmetry")


def commutes(group: Group, matrix: Array, error: Array | float = 0.0) -> float:
    """Commutator of a return map's derivative with a group, relative to its errors: at most 1 if it commutes."""
    n = group.dimension
    sizes = group.scales[:, None] / group.scales
    pairs = group.component[:, None], group.component[None, :]
    largest = np.full((n, n), np.finfo(float).tiny)
    np.maximum.at(largest, pairs, np.abs(matrix / sizes))
    bound = error + _ROUND_OFF * n * largest[pairs] * sizes
    p = group.generators
    return float((np.abs(p @ matrix - matrix @ p) / (np.abs(p) @ bound + bound @ np.abs(p))).max())


def _powers(matrix: Array, most: int) -> tuple[Array, Array]:
    """Largest absolute value of each entry over the powers, and the last one less the identity, shapes (n, n)."""
    n = len(matrix)
    power, envelope = matrix, np.maximum(np.abs(matrix), np.eye(n))
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(most):
            diagonal = np.diag(power)
            # The diagonal does not depend on the units.
            if np.abs(diagonal - 1.0).max() < _RETURNED:
                return envelope, power - np.eye(n)
            if not abs(diagonal.sum()) < n + 1.0:  # of finite order, its eigenvalues lie on the unit circle
                break
            power = power @ matrix
            envelope = np.maximum(envelope, np.abs(power))
    raise _infinite(matrix, most)


def _coordinate_scales(envelope: Array) -> Array:
    """Scales s, shape (n,), such that the entries of a group, divided by s_i / s_j, are of order one.

    A symmetry in a user's units is S P S^-1 with S diagonal. With P orthogonal, the inverse of a power is its transpose
    and another power, so s_i / s_j is the root of the ratio of the entries (i, j) and (j, i) of the envelope: by least
    squares of the logarithms, where round-off has little weight but connects what nothing else does. Coordinates that
    act on others but not in reverse (positions relative to a first one) are balanced afterwards.
    """
    envelope = np.where(envelope < _CHANCE * (envelope @ envelope), 0.0, envelope)
    weights = (np.sqrt(envelope) * np.sqrt(envelope.T)) ** _LEVELLED
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(weights > 0.0, 0.5 * np.log(envelope / envelope.T), 0.0)
    laplacian = np.diag(weights.sum(axis=1)) - weights
    scales = np.exp(np.linalg.lstsq(laplacian, (weights * ratios).sum(axis=1), rcond=None)[0])
    return np.asarray(scales * numerical_balance(_scaled(envelope, scales)))


def _infinite(matrix: Array, most: int) -> ParameterError:
    if np.linalg.slogdet(matrix)[1] < -1.0:  # ±1 in a finite group
        return ParameterError("is not invertible, or shrinks volumes", field="generators", allowed="determinant ±1")
    allowed = f"matrices of which a power up to {most} is the identity, to 9 digits"
    return ParameterError(_INFINITE, field="generators", allowed=allowed)


def _scaled(matrices: Array, scales: Array) -> Array:
    return np.asarray(matrices * (scales / scales[:, None]))


def _subgroup(group: Group, members: NDArray[np.bool_], field: str) -> Group:
    elements = group.elements[members]
    found = _closure(elements, group.scales, len(elements))
    if found is None:
        raise AnalysisError("is invariant under elements that do not form a group: its error is too large", field=field)
    return _with_metric(found[0], elements, group.scales)


def _with_metric(generators: Array, elements: Array, scales: Array) -> Group:
    n = elements.shape[1]
    # In scaled coordinates: the user's entries may differ by more than double precision.
    scaled = _scaled(elements, scales)
    component = connected_components(np.abs(scaled).max(axis=0) > _MIXED)[1]
    stacked = scaled.reshape(-1, n)
    metric = np.where(component[:, None] == component, stacked.T @ stacked / len(elements), 0.0)
    try:
        root = np.linalg.cholesky(metric).T
        inverse = np.linalg.inv(root)
    except np.linalg.LinAlgError:
        said, allowed = "have no invariant metric in double precision", "coordinates less oblique to each other"
        raise AnalysisError(said, field="generators", allowed=allowed) from None
    group = Group(generators, elements, root / scales, scales[:, None] * inverse, scales, component)
    q = group.orthogonal
    if not np.abs(np.swapaxes(q, 1, 2) @ q - np.eye(n)).max() < _SAME:
        said, allowed = "must be exact symmetries, less oblique", "matrices exact to 1e-9 or better"
        raise AnalysisError(said, field="generators", allowed=allowed)
    return group


class Images:
    """Set of images of the probes, shape (n, probes) each, that differ by more than rounding."""

    def __init__(self, dimension: int) -> None:
        random = np.random.default_rng(0)
        self.probes: Array = random.uniform(-1.0, 1.0, (dimension, _PROBES))
        self._weights: Array = random.uniform(-1.0, 1.0, (dimension, _PROBES)) / dimension
        self._cells: dict[int, list[Array]] = {}

    def new(self, image: Array) -> bool:
        """True if an image was not in the set, to which it is added."""
        cell = math.floor(float(np.vdot(self._weights, image)) / _CELL)
        near = (each for beside in (cell, cell - 1, cell + 1) for each in self._cells.get(beside, ()))
        if any(np.abs(each - image).max() < _SAME for each in near):
            return False
        self._cells.setdefault(cell, []).append(image)
        return True


def _closure(generators: Array, scales: Array, largest: int) -> tuple[Array, Array] | None:
    """Generators that suffice for a group, one at least, and its elements, the identity first; None if too many."""
    n, needed = len(scales), generators[:0]
    images, elements = Images(n), [np.eye(n)]
    images.new(images.probes)
    for generator in generators:
        if not images.new(_scaled(generator, scales) @ images.probes):
            continue
        needed = np.concatenate([needed, generator[None]])  # and the order at least doubles
        images, elements = Images(n), [np.eye(n)]
        images.new(images.probes)
        for element in elements:  # which grow meanwhile
            for product in needed @ element:
                if images.new(_scaled(product, scales) @ images.probes):
                    if len(elements) == largest:
                        return None
                    elements.append(product)
    return needed if len(needed) else generators[:1], np.array(elements)


def symmetric_states(system: SystemLike, state: Array, size: Array, near: float = _LOOSE) -> Array:
    """Orthonormal basis, in units of the sizes, of states with the symmetries of one: changed by ``near`` at most."""
    n, generators = size.size, spatial_symmetries(system)
    elements = _elements(np.stack(generators).tobytes(), n) if generators else np.empty((0, n, n))
    kept = (np.abs(elements @ state - state) <= near * size).all(axis=1)
    _, values, right = np.linalg.svd((elements[kept] * size / size[:, None] - np.eye(n)).reshape(-1, n))
    return np.asarray(right[int((values > _LOOSE).sum()) :].T)


def symmetric_basis(system: SystemLike, state: Array, size: Array, near: float = _LOOSE) -> Array | None:
    """As :func:`symmetric_states`; None if that are all states, or the system has a symmetry in time."""
    if system.symmetry is not None or not spatial_symmetries(system):
        return None
    basis = symmetric_states(system, state, size, near)
    return basis if basis.shape[1] < state.size else None


@lru_cache(maxsize=8)
def _elements(generators: bytes, n: int) -> Array:
    """Elements of the group of some generators, shape (order, n, n)."""
    return finite_group(np.frombuffer(generators).reshape(-1, n, n)).elements


def reverses(system: SystemLike, mode: ComplexArray, size: Array) -> bool:
    """True if a spatial symmetry of a system turns a mode, shape (n,), into its negative; ``size`` is of the states."""
    own = np.abs(mode / size).max()
    return any((np.abs(matrix @ mode + mode) / size).max() <= _LOOSE * own for matrix in spatial_symmetries(system))
