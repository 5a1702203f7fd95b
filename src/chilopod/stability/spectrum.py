"""Eigenvalues of a return map, whole or in parts, with eigenvectors, bounds on their errors and on those of results.

:func:`spectrum` takes the return map as one matrix. Where first-order bounds do not hold, the matrix is changed at
random within the errors of its entries, and the error of a result is ``SAFETY`` times its largest observed change. This
holds for simple and for defective eigenvalues, for which a condition number gives no error. A draw moves a result along
its gradient in a random direction, which in one case of twelve is less than a tenth of the root mean square over all
directions (Kenney and Laub, *SIAM J. Sci. Comput.* 15, 36, 1994); all of ``DRAWS`` are so small in one case of 600
million.

:func:`split_return` takes the return as a product of many matrices, of which only the slow directions survive
round-off. Subspace iteration forward through the factors gives the nested spaces of the slowest directions, iteration
backward through their transposes the complements of those of the fastest, and the intersections split the space into
groups of like size (the Oseledets splitting of a periodic cocycle). The product restricted to a group is small and well
scaled. Factors may be nearly singular, as a reset of a state to about a constant.

The derivative of a stiff flow does not resolve a direction that decays by e^-1000 within a step of an implicit method,
and the multipliers do not need it. Its exponent is that of the volume, the integral of the divergence of f (Liouville's
formula), less those of the other directions.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.linalg.lapack import dgeqrf, dorgqr

from chilopod.errors import AnalysisError
from chilopod.flows.carrying import numerical_balance
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.interface import Capabilities, SystemLike, checked_flow, is_autonomous, is_stiff, offers, sizes
from chilopod.stability.returns import ReturnMap, flow_with_error, velocity_at

EPSILON = float(np.finfo(float).eps)
SAFETY, DRAWS = 10.0, 8  # factor on the largest change of a result under random changes, and their number
_DEPENDENT = 1e12  # size of left eigenvectors of right ones that nearly coincide
_PAIRED = 1e-6  # product of a left and a right unit eigenvector below which their eigenvalue is defective
FIRST_ORDER = 1e-6  # error, relative to the largest eigenvalue, up to which first-order bounds hold
VERDICTS = {True: "stable", False: "unstable", None: "undecided"}  # words for the results of stable_within


def stable_within(values: ComplexArray, bound: Array | float, bounds: Array | float | None = None) -> bool | None:
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
    error = error + 4.0 * EPSILON * np.abs(matrix)
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
    1; these are infinite for a defective eigenvalue, whose condition gives no bound."""
    values, right = np.linalg.eig(matrix)
    order = falling(values)
    values, right = values[order].astype(np.complex128), right[:, order].astype(np.complex128)
    with contextlib.suppress(np.linalg.LinAlgError):
        inverse = np.linalg.inv(right)
        if np.abs(inverse).max(initial=0.0) < _DEPENDENT:
            return values, right, inverse.conj().T
    # Right vectors of a defective eigenvalue coincide and leave the other left ones undetermined; the solver's are not.
    others, left, _ = scipy.linalg.eig(matrix, left=True)
    left = left[:, falling(others)].astype(np.complex128)
    left = left @ np.linalg.pinv(right.conj().T @ left, rcond=_PAIRED)
    left[:, np.abs((left.conj() * right).sum(axis=0) - 1.0) > _PAIRED] = np.inf
    return values, right, left


def falling(values: ComplexArray) -> NDArray[np.intp]:
    """Order by falling modulus; the two of a pair stay together, positive frequency first, as the solver has them."""
    relative = np.round(np.abs(values) / np.abs(values).max(initial=1e-300), 12)
    return np.lexsort((-np.round(np.abs(values.imag), 12), -relative))


def spectrum(image: ReturnMap) -> Spectrum:
    """Eigenvalues of a return map with their condition, without the zero of the direction of motion."""
    into, out_of = _across(image)
    jacobian = out_of @ image.jacobian @ into
    # In units that make all entries similar, the errors of the eigenvalue solver are small relative to each.
    units = numerical_balance(jacobian)
    scaled = jacobian * units / units[:, None]
    values, right, left = eigensystem(scaled)
    # The backward error of the eigenvalue solver, whose eigenvectors have length 1.
    with np.errstate(all="ignore"):  # left ones of a defective multiplier are infinite, and so is its error
        error = 4.0 * EPSILON * float(np.linalg.norm(scaled)) * np.linalg.norm(left, axis=0)
        right, left = into @ (units[:, None] * right), out_of.T @ (left / units[:, None])
    # Squares of tiny entries vanish; a power of 2 as a unit is exact.
    size = np.exp2(np.floor(np.log2(np.abs(right).max(axis=0))))
    norms = size * np.linalg.norm(right / size, axis=0)
    right, left = right / norms, left * norms
    # d nu = left^H E right, bounded from every entry of E.
    wrong = np.broadcast_to(image.error, image.jacobian.shape)
    error += (np.abs(left) * (wrong @ np.abs(right))).sum(axis=0)
    error = np.where(np.isfinite(error), error, np.inf)
    if (error > FIRST_ORDER * np.abs(values[:1])).any():
        error = np.minimum(error, eigenvalue_errors(values, jacobian, np.abs(out_of) @ wrong @ np.abs(into)))
    return Spectrum(values, right, left, error)


def return_multipliers(image: ReturnMap) -> ComplexArray:
    """Eigenvalues of a return map by falling modulus, without the zero of the direction of motion."""
    into, out_of = _across(image)
    values = np.linalg.eigvals(out_of @ image.jacobian @ into).astype(np.complex128)
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


class ContractionError(AnalysisError):
    """The flow contracts some directions too strongly for their growth to be resolved."""


_TOO_STRONG = "the flow contracts too strongly to be resolved"
_WORST_CONDITION = 1e6
_FEWEST, _MOST, _MOST_STIFF = 8, 32768, 4096  # numbers of parts of moderate condition; steps of a stiff flow are costly
_COMPOSED = 1e-6  # error of the product of parts, relative to the whole, above which they are not its parts


class Cut(NamedTuple):
    """A return in parts, between planes across the motion if a system does not depend on time."""

    units: Array  # sizes of the states, shape (n,)
    section: Array  # orthonormal basis of the first plane, or of the space, in units
    factors: Sequence[Array]  # derivatives of the flow over the parts, the last one with the symmetry in time
    errors: Sequence[Array]  # bounds on the errors of their entries


class _Part(NamedTuple):
    """The derivative of the flow over a part of the return, with the bound on its error, in units; and its end."""

    start: float
    end: float
    state: Array
    factor: Array
    error: Array


def moderate_cut(system: SystemLike, x: Array, image: ReturnMap, unresolved: int = 0) -> Cut:
    """A return from a state on the orbit in parts of moderate condition, apart from the ``unresolved`` fastest
    directions and from events; AnalysisError if there are none. A return without parts, as of a map, stays whole."""
    # The derivative on a section may be only round-off; an orbit that moves gives the sizes. A decayed entry of the
    # diagonal says nothing of its state's size.
    autonomous, duration, one = is_autonomous(system), image.duration, np.eye(x.size)
    balanced = np.where(one > 0.0, np.abs(image.jacobian.diagonal()).max(), image.jacobian)
    units = sizes(system, x, duration) if autonomous else numerical_balance(balanced)
    parts: list[_Part] = []
    for start, end in itertools.pairwise(np.linspace(0.0, duration, _FEWEST + 1).tolist()):
        parts.append(_part(system, parts[-1].state if parts else x, start, end, units))
    ratios = units / units[:, None]
    symmetry = one if system.symmetry is None else system.symmetry * units / units[:, None]
    if not unresolved:
        whole, error = image.jacobian * ratios, np.nan_to_num(np.broadcast_to(image.error, one.shape) * ratios)
        across = image.across * ratios
        product = np.linalg.multi_dot([across, symmetry, *(part.factor for part in reversed(parts))])
        if not _equal(system, product, whole, error):
            section = section_basis(system, x, units)
            return Cut(units, section, [section.T @ whole @ section], [np.abs(section.T) @ error @ np.abs(section)])
    parts = _moderate_parts(system, x, parts, units, unresolved)
    sections = [section_basis(system, state, units) for state in (x, *(part.state for part in parts[:-1]))]
    turns = [one] * (len(parts) - 1) + [symmetry]
    factors, errors = [], []
    for part, turn, (before, after) in zip(parts, turns, itertools.pairwise([*sections, sections[0]]), strict=True):
        factors.append(after.T @ turn @ part.factor @ before)
        errors.append(np.abs(after.T) @ np.abs(turn) @ part.error @ np.abs(before))
    return Cut(units, sections[0], factors, errors)


def section_basis(system: SystemLike, state: Array, units: Array) -> Array:
    """Orthonormal basis of the plane across the motion, in units, shape (n, n-1), or of the whole space."""
    return normal_basis(velocity_at(system, state) / units) if is_autonomous(system) else np.eye(units.size)


def _equal(system: SystemLike, product: Array, whole: Array, error: Array) -> bool:
    """True if a product of parts is the whole, which it is not where an event falls on a border and is lost."""
    own = error * offers(system, "flow_with_error")  # another bound may stem from such parts
    return bool((np.abs(product - whole) <= _COMPOSED * np.abs(whole).max() + own).all())


def _part(system: SystemLike, x: Array, start: float, end: float, units: Array) -> _Part:
    state, derivative, error = flow_with_error(system, x.copy(), start, end)
    factor = derivative * units / units[:, None]
    return _Part(start, end, state, factor, np.broadcast_to(error, factor.shape) * units / units[:, None])


def _moderate_parts(system: SystemLike, x: Array, parts: list[_Part], units: Array, unresolved: int) -> list[_Part]:
    """Parts of a return; those that contract too strongly are halved repeatedly, down to an event if there is one."""
    done: list[_Part] = []
    left, asked, most = parts[::-1], len(parts), _MOST_STIFF if unresolved else _MOST
    while left:
        part = left.pop()
        stretches = np.linalg.svd(part.factor, compute_uv=False)
        # The errors of a stiff flow are relative to the states at the start.
        largest, kept = max(stretches[0], float(unresolved)), stretches[: stretches.size - unresolved]
        if not kept.size or largest < _WORST_CONDITION * kept[-1]:
            done.append(part)
            continue
        middle = 0.5 * (part.start + part.end)
        asked += 2
        first = _part(system, done[-1].state if done else x, part.start, middle, units)
        second = _part(system, first.state, middle, part.end, units)
        apart = unresolved or _equal(system, second.factor @ first.factor, part.factor, part.error)
        apart = apart and part.start < middle < part.end
        if asked > most or not (apart or kept[-1] > 0.0):
            raise ContractionError(_TOO_STRONG, field="flow")
        if apart:
            left += [second, first]
        else:
            done.append(part)
    return done


_GAP = 1.0  # least gap of ln|eigenvalue| between groups
_PASSES = 40  # through the product: a gap of 1 leaves exp(-40) of the neighbouring group
_AVERAGED = 20  # number of last passes over which the growth is averaged
_AT_REST = 1e-8  # motion of a basis in a pass that has converged
_DRAWS_OF_STIFF = 3  # each costs as much as the result
_SHORTENINGS = 40
_TELLING = 0.1  # relative error of a multiplier whose exponent is reported alone
_LEFT, _APART = 1e-12, 1e-4  # stretches over a short time above round-off, and that separate directions


def split_product(factors: Sequence[Array], errors: Sequence[Array] = ()) -> tuple[ComplexArray, ComplexArray, Array]:
    """Logarithms ln|eigenvalue| + i angle of the eigenvalues of ``factors[-1] @ ... @ factors[0]`` by falling modulus,
    shape (n,), its unit eigenvectors as columns, and bounds on the change of the logarithms when the entries of the
    factors change by their errors, to first order between groups.

    A ContractionError if a direction that a factor contracts too strongly may vanish in it, by its error.
    """
    n = factors[0].shape[0]
    slow, stretches, slow_motion = _iterate(factors, n)
    wrong = [np.linalg.norm(error) for error in errors or np.zeros(len(factors))]
    norms = np.linalg.norm(factors, axis=(1, 2))
    least = np.minimum(np.array(wrong) + 4.0 * EPSILON * norms, np.maximum(1.0, norms) / _WORST_CONDITION)
    if not (stretches > np.tile(least, _AVERAGED)[:, None]).all():
        raise ContractionError(_TOO_STRONG, field="flow")
    growth = np.log(stretches).sum(axis=0) / _AVERAGED
    left, _, left_motion = _iterate([factor.T for factor in reversed(factors)], n)
    # Backward iteration meets the nodes in reverse: its node 0 is the same instant, its node 1 the last factor's start.
    left = [left[0], *reversed(left[1:])]
    # Eigenvalues of one modulus in slanted directions can show a false gap for a while; their spaces do not converge.
    settled = np.maximum(slow_motion, left_motion) < _AT_REST
    borders = [0, *(1 + np.flatnonzero((growth[:-1] - growth[1:] > _GAP) & settled)).tolist(), n]
    both = list(zip(slow, left, strict=True))
    groups = [  # bases of the intersections
        [one[:, :b] @ np.linalg.svd(one[:, :b].T @ other[:, a:])[0][:, : b - a] for one, other in both]
        for a, b in itertools.pairwise(borders)
    ]
    # A fast direction carried along would be lost in the round-off of the slow ones.
    found = [_eigen(_restricted(factors, bases)) for bases in groups]
    logarithms = np.concatenate([values for values, _ in found])
    vectors = np.hstack([bases[0] @ columns for bases, (_, columns) in zip(groups, found, strict=True)])
    if not np.isfinite(logarithms).all():  # directions that could not be separated
        raise ContractionError(_TOO_STRONG, field="flow")
    moved = _moved(np.array(factors), np.array(errors or np.zeros(1)), groups, [values for values, _ in found])
    order = np.argsort(-logarithms.real, kind="stable")
    return logarithms[order], vectors[:, order], moved[order]


def split_leading(factors: Sequence[Array], count: int) -> tuple[ComplexArray, ComplexArray]:
    """The same for the ``count`` directions that grow most, separated by a gap from the others."""
    bases = [basis[:, :count] for basis in _iterate(factors, factors[0].shape[0])[0]]
    logarithms, vectors, _ = split_product(_restricted(factors, bases))
    return logarithms, bases[0] @ vectors


def _restricted(factors: Sequence[Array], bases: Sequence[Array]) -> list[Array]:
    """The factors from each basis to the next."""
    return [after.T @ f @ base for f, base, after in zip(factors, bases, [*bases[1:], bases[0]], strict=True)]


def _iterate(factors: Sequence[Array] | Array, n: int) -> tuple[list[Array], Array, Array]:
    """Bases whose first j columns span the j directions that grow most, one before every factor; the stretch of each
    column by every factor of the last passes, shape (k, n), zero where a factor maps it to zero; and the change of the
    space of the first j in a pass."""
    basis = np.linalg.qr(np.random.default_rng(0).standard_normal((n, n)))[0]
    stretches: list[Array] = []
    for _ in range(_PASSES):
        bases: list[Array] = []
        for factor in factors:
            bases.append(basis)
            packed, reflections, _, _ = dgeqrf(factor @ basis)  # a fifth of the time of numpy's qr if small
            stretches.append(np.abs(packed.diagonal()))
            basis = dorgqr(packed, reflections)[0]
    turned = bases[0].T @ basis
    motion = np.array([np.linalg.norm(turned[j:, :j]) for j in range(1, n)])
    return bases, np.array(stretches[-_AVERAGED * len(factors) :]), motion


def _eigen(factors: Sequence[Array]) -> tuple[ComplexArray, ComplexArray]:
    """Eigenvalues (as logarithms) and eigenvectors of a product of factors of like scale."""
    product, scale = np.eye(factors[0].shape[1]), 0.0
    for factor in factors:
        product = factor @ product
        size = float(np.abs(product).max()) or 1.0
        product /= size
        scale += float(np.log(size))
    values, columns = np.linalg.eig(product)
    with np.errstate(divide="ignore"):  # what has vanished beside the others
        return np.log(np.abs(values)) + scale + 1j * np.angle(values), columns


def _moved(factors: Array, errors: Array, groups: Sequence[Sequence[Array]], known: Sequence[ComplexArray]) -> Array:
    """Largest change of the logarithms when factors change by their errors with random signs, with a safety factor."""
    nodes = np.array([np.hstack(bases) for bases in zip(*groups, strict=True)])
    sizes = np.cumsum([0, *(len(values) for values in known)])
    try:
        ends = np.roll(np.linalg.inv(nodes), -1, axis=0)
    except np.linalg.LinAlgError:
        return np.full(sizes[-1], np.inf)
    random, moved = np.random.default_rng(0), np.zeros(sizes[-1])
    for _ in range(DRAWS):
        others = ends @ (factors + errors * random.choice([-1.0, 1.0], factors.shape)) @ nodes
        for values, (a, b) in zip(known, itertools.pairwise(sizes), strict=True):
            apart = values[:, None] - _eigen([other[a:b, a:b] for other in others])[0]
            apart = np.abs(apart.real + 1j * np.angle(np.exp(1j * apart.imag)))
            moved[a:b] = np.maximum(moved[a:b], apart.min(axis=1))
    return SAFETY * moved


def split_return(
    system: SystemLike, x: Array, image: ReturnMap, resolved: bool = False
) -> tuple[ComplexArray, ComplexArray, Array]:
    """As :func:`split_product` for a return, with round-off in the bounds. Where it contracts too strongly an
    AnalysisError, or those of the multipliers that are ``resolved`` without a cut."""
    try:
        values, vectors, moved = _split(system, x, image)
    except ContractionError as refused:
        spec = spectrum(image)
        kept = spec.error < _TELLING * np.abs(spec.values)
        if not resolved or not kept.any():
            refused.allowed = "resolved=True, for those of the larger multipliers" if kept.any() else refused.allowed
            raise
        values, vectors = np.log(spec.values[kept]), spec.right[:, kept]
        moved = SAFETY * (spec.error[kept] / np.abs(spec.values[kept]))
    return values, vectors, moved + 4.0 * EPSILON * np.abs(values)


def _split(system: SystemLike, x: Array, image: ReturnMap) -> tuple[ComplexArray, ComplexArray, Array]:
    if x.size == 1 and is_autonomous(system):  # nothing is left beside the motion
        return np.empty(0, np.complex128), np.empty((1, 0), np.complex128), np.empty(0)
    if is_stiff(system, x, image.duration):
        return _split_stiff(system, x, image)
    cut = moderate_cut(system, x, image)
    values, vectors, moved = split_product(cut.factors, cut.errors)
    return values, (cut.units[:, None] * cut.section) @ vectors, moved


def _split_stiff(system: Capabilities, x: Array, image: ReturnMap) -> tuple[ComplexArray, ComplexArray, Array]:
    """The same for a stiff system, with one direction at most that decays too fast."""
    cut = moderate_cut(system, x, image, unresolved=1)
    slow = cut.section.shape[1] - 1
    values, modes, errors = np.empty(0, np.complex128), np.empty((slow + 1, 0), np.complex128), np.zeros(slow)
    if slow:
        values, modes = split_leading(cut.factors, slow)
        for drawn in disturbed(np.array(cut.factors), np.array(cut.errors), _DRAWS_OF_STIFF):
            others = np.abs(values[:, None] - split_leading(list(drawn), slow)[0])
            errors = np.maximum(errors, SAFETY * others.min(axis=1))
    growth, error = system.flow_volume(x, 0.0, image.duration)
    turned = system.symmetry is not None and np.linalg.det(system.symmetry) < 0.0
    fastest = complex(growth, np.pi if turned else 0.0) - values.sum()
    modes = (cut.units[:, None] * cut.section) @ np.hstack([modes, _fastest(system, x, cut, image.duration)])
    return np.append(values, fastest), modes, np.append(errors, error + errors.sum())


def _fastest(system: SystemLike, x: Array, cut: Cut, duration: float) -> Array:
    """The direction on the section that the flow contracts most, over a time that leaves it above round-off."""
    slow = cut.section.shape[1] - 1
    if slow == 0:
        return np.eye(1)
    short, long = 0.0, np.inf
    for _ in range(_SHORTENINGS):
        state, derivative = checked_flow(system, x, 0.0, duration)
        derivative = derivative * cut.units / cut.units[:, None]
        stretch, right = np.linalg.svd(section_basis(system, state, cut.units).T @ derivative @ cut.section)[1:]
        largest = max(1.0, float(stretch[0]))
        if _LEFT * largest <= stretch[slow] <= _APART * stretch[slow - 1]:
            return np.asarray(right[slow:].T)
        # Over a long time the least stretch is round-off, over a short one it has not fallen yet.
        short, long = (duration, long) if stretch[slow] > _APART * largest else (short, duration)
        duration = 0.5 * (short + long)
        if np.isinf(long):
            break
    raise ContractionError(_TOO_STRONG, field="flow", allowed="another state on the orbit")
