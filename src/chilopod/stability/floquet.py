"""Floquet multipliers, exponents and modes of a periodic orbit."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.cores import cores
from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.capabilities import FlowsFrames, SystemLike, is_autonomous
from chilopod.stability.factors import cut_return, split_stiff
from chilopod.stability.orbits import Orbit, find_orbit, from_known, known_state
from chilopod.stability.returns import ReturnMap, return_maps
from chilopod.stability.scales import numerical_balance, sizes
from chilopod.stability.splitting import split_product
from chilopod.stability.system import PeriodicSystem

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

RESOLVED = 1e-6
"""Multipliers of the return map below this modulus are too small for the error bound of an eigenvalue to mean
anything."""

_WORST_CONDITION = 1e6
_FEWEST_FACTORS, _MOST_FACTORS = 8, 4096
_MOST_BESIDE_FRAMES = 256  # where what decays faster is resolved in another way
_FIRST_ORDER = 1e-6  # of the largest multiplier: errors up to here are those of first-order perturbations
_DRAWS, _DRAWN = 8, 10.0  # changes of a matrix, and how much farther than by the worst of them eigenvalues may move
_COMPOSED = 1e-6  # by so much the parts of a flow may miss the whole
_SAME_ANGLE = 1e-12


@dataclass(frozen=True)
class Multipliers(ReadOnlyArrays):
    """Floquet multipliers of a periodic orbit.

    Attributes
    ----------
    values
        Multipliers of the full period, by falling modulus, shape (n,); n-1 of them where the system does not depend on
        time: the one along the motion, which is 1, is left out. Absolute accuracy is ``error_bound``: those smaller
        than it are only known to be small (:func:`exponents` resolves them).
    half_period
        Multipliers nu of the return map of a system with a symmetry in time, of order k: ``values = nu^k`` in the same
        order (k is 2 unless told, hence the name); None without one.
    error_bound
        Bound on the absolute error of every multiplier of modulus above 1e-6.
    orbit
        State on the orbit at time 0.
    period
        Of the orbit.
    """

    values: ComplexArray
    half_period: ComplexArray | None
    error_bound: float
    orbit: Array
    period: float

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle, by more than the error bound."""
        return bool((np.abs(self.values) < 1.0 - self.error_bound).all())


@dataclass(frozen=True)
class Exponents(ReadOnlyArrays):
    """Floquet exponents and modes.

    Attributes
    ----------
    values
        Exponents (1/s), by falling real part, shape (n,) or, as of the multipliers, (n-1,): the principal logarithm of
        the full-period multiplier over T, imaginary part in (-pi/T, pi/T]. Where the system has a symmetry in time of
        order k they come from ln(nu^k), which is the same number.
    modes
        Unit eigenvectors of the full-period map at time 0 as columns, the largest entry real and positive; of a system
        that does not depend on time, those of its Poincare map on the section across the motion.
    multipliers
        The multipliers of the same orbit.
    """

    values: ComplexArray
    modes: ComplexArray
    multipliers: Multipliers


@dataclass(frozen=True)
class Spectrum(ReadOnlyArrays):
    """Eigenvalues of the return map with left and right eigenvectors, what locating a bifurcation works on.

    Attributes
    ----------
    values
        nu, by falling modulus, shape (n,).
    right, left
        Columns: unit right eigenvectors, and left ones with left[:, i]^H right[:, i] = 1.
    error
        Bound on the error of each value, shape (n,): condition number times the error of the matrix, to first order.
    """

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray
    error: Array


def spectrum(image: ReturnMap) -> Spectrum:
    """Eigenvalues of a return map with their condition; without the zero that stands for the motion itself."""
    into, out_of = across(image)
    jacobian = out_of @ image.jacobian @ into
    # In units in which all entries are alike the errors of the eigenvalue solver are small against every one of them.
    units = numerical_balance(jacobian)
    values, right = np.linalg.eig(jacobian * units / units[:, None])
    # Moduli that differ by round-off are equal; the two of a pair stand together, positive frequency first.
    sizes = np.round(np.abs(values) / max(float(np.abs(values).max()), 1e-300), 12)
    order = np.lexsort((-values.imag, -np.round(np.abs(values.imag), 12), -sizes))
    values, right = values[order].astype(np.complex128), right[:, order].astype(np.complex128)
    try:
        left = np.linalg.inv(right).conj().T
    except np.linalg.LinAlgError:  # a defective matrix: no bound to be had from conditions
        left = np.full_like(right, np.nan)
    # The backward error of the eigenvalue solver.
    size = float(np.linalg.norm(jacobian * units / units[:, None]))
    error = 4.0 * np.finfo(float).eps * size * np.linalg.norm(left, axis=0) * np.linalg.norm(right, axis=0)
    right = into @ (units[:, None] * right)
    left = out_of.T @ (left / units[:, None])
    norms = np.linalg.norm(right, axis=0)
    right, left = right / norms, left * norms
    # d nu = left^H E right, of which a bound of every entry of E tells the most; with one number for all of them, that
    # err independently, |d nu| has the size e |left| |right|, and the factor 4 is for safety.
    if isinstance(image.error, np.ndarray):
        error += np.einsum("ik,ij,jk->k", np.abs(left), image.error, np.abs(right))
    else:
        error += 4.0 * image.error * np.linalg.norm(left, axis=0)
    error = np.where(np.isfinite(error), error, np.inf)
    if (error > _FIRST_ORDER * np.abs(values).max(initial=0.0)).any():
        scaled = np.abs(out_of) @ np.broadcast_to(image.error, image.jacobian.shape) @ np.abs(into)
        error = np.minimum(error, _moved(values, jacobian, scaled))
    return Spectrum(values, right, left, error)


def _moved(values: ComplexArray, matrix: Array, error: Array) -> Array:
    """How far eigenvalues move when a matrix changes by its error: where several nearly agree without eigenvectors of
    their own, by its square root, which no condition number tells."""
    random = np.random.default_rng(0)
    error = error + 4.0 * np.finfo(float).eps * np.abs(matrix)
    if not np.isfinite(error).all():
        return np.full(values.size, np.inf)
    moved = np.zeros(values.size)
    for _ in range(_DRAWS):
        others = np.linalg.eigvals(matrix + error * random.choice([-1.0, 1.0], matrix.shape))
        moved = np.maximum(moved, np.abs(values[:, None] - others).min(axis=1))
        moved = np.maximum(moved, np.abs(values[:, None] - others).min(axis=0).max())
    return _DRAWN * moved


def across(image: ReturnMap) -> tuple[Array, Array]:
    """Coordinates on the section of a return map: (n, n-1) from them, and (n-1, n) to them along the motion; two unit
    matrices where there is no section."""
    n = image.state.size
    if image.velocity is None or image.normal is None:
        return np.eye(n), np.eye(n)
    # Units in which the motion is across the section, so that its basis can be orthonormal.
    units = numerical_balance(image.jacobian)
    normal = image.normal * units
    basis = np.linalg.svd(normal[None])[2][1:].T
    into = units[:, None] * basis
    along = np.eye(n) - np.outer(image.velocity, image.normal) / float(image.normal @ image.velocity)
    return into, (basis.T / units) @ along


def phased(right: ComplexArray, left: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """The pair with the largest entry of the right vector real and positive, left^H right = 1 kept."""
    peak = right[np.abs(right).argmax()]
    turn = np.abs(peak) / peak
    return right * turn, left * turn


def counts_outside(values: ComplexArray) -> tuple[int, int, int]:
    """Number of multipliers beyond -1, beyond +1, and of complex pairs outside the unit circle."""
    real = np.abs(values.imag) < 1e-9 * np.maximum(1e-3, np.abs(values))
    outside = np.abs(values) > 1.0
    return (
        int((real & (values.real < -1.0)).sum()),
        int((real & (values.real > 1.0)).sum()),
        int((~real & outside & (values.imag > 0)).sum()),
    )


def _multipliers(orbit: Orbit) -> Multipliers:
    image = orbit.image
    spec = spectrum(image)
    nu, k = spec.values, image.returns
    resolved = np.abs(nu) > RESOLVED
    bound = float(spec.error[resolved].max()) if resolved.any() else float(spec.error.min())
    if k == 1:
        return Multipliers(nu, None, bound, orbit.state, image.period)
    # mu = nu^k: by the mean value theorem, d mu is at most k (|nu| + d nu)^(k-1) d nu.
    largest = max(float(np.abs(nu[0])), 0.5)
    return Multipliers(nu**k, nu, bound * k * (largest + bound) ** (k - 1), orbit.state, image.period)


def multipliers(system: SystemLike, orbit: ArrayLike | None = None) -> Multipliers:
    """Floquet multipliers of a periodic orbit.

    Parameters
    ----------
    system
        The periodic system.
    orbit
        A first guess of a state on the orbit at time 0; not needed where the system knows its orbit.
    """
    return _multipliers(find_orbit(system, orbit))


def sweep(systems: Sequence[SystemLike]) -> list[Multipliers]:
    """Multipliers of many systems at their known orbits, on all cores where the systems allow it."""
    if not systems:
        return []
    if all(isinstance(system, PeriodicSystem) and system.concurrent for system in systems):
        with ThreadPoolExecutor(cores()) as threads:
            return list(threads.map(multipliers, systems))
    if any(is_autonomous(system) for system in systems):
        return [multipliers(system) for system in systems]
    states = [known_state(system) for system in systems]
    images = return_maps(systems, states)
    return [
        _multipliers(from_known(system, state, image=image))
        for system, state, image in zip(systems, states, images, strict=True)
    ]


def exponents(system: SystemLike, orbit: ArrayLike | None = None) -> Exponents:
    """All Floquet exponents and modes, the strongly damped ones included.

    The period is cut into factors of moderate condition and the state space split along their product, so that a
    multiplier of 1e-60 is found with the same relative accuracy as one of 0.5; the eigenvalues of the product itself
    would be round-off there.
    """
    found = find_orbit(system, orbit)
    image = found.image
    log_nu, modes, units = _logarithms(system, found)
    # Principal logarithm of nu^k: the imaginary part back into (-pi, pi].
    angle = np.angle(np.exp(1j * image.returns * log_nu.imag))
    angle[np.abs(angle) < _SAME_ANGLE] = 0.0
    angle[np.abs(np.abs(angle) - np.pi) < _SAME_ANGLE] = np.pi
    values = (image.returns * log_nu.real + 1j * angle) / image.period
    # Conjugate pairs: positive frequency first.
    order = np.lexsort((-values.imag, -np.round(values.real * image.period, 9)))
    modes = units @ modes
    modes = modes / np.linalg.norm(modes, axis=0)
    peaks = modes[np.abs(modes).argmax(axis=0), range(modes.shape[1])]
    return Exponents(values[order], (modes * (np.abs(peaks) / peaks))[:, order], _multipliers(found))


def _logarithms(system: SystemLike, orbit: Orbit) -> tuple[ComplexArray, ComplexArray, Array]:
    """Logarithms of the eigenvalues of the return map, its eigenvectors in some basis, and this basis."""
    # The derivative on a section may be nothing but round-off; an orbit that moves has sizes of its own.
    image = orbit.image
    if is_autonomous(system):
        units = sizes(system, orbit.state, image.period / image.returns)
    else:
        units = numerical_balance(image.jacobian)
    most = _MOST_FACTORS
    if isinstance(system, FlowsFrames):
        most = 0 if system.is_stiff() else _MOST_BESIDE_FRAMES
    count = _FEWEST_FACTORS
    while count <= most:
        cut = cut_return(system, orbit, units, count)
        if count == _FEWEST_FACTORS and not is_autonomous(system) and not _composes(cut.factors, image, units):
            cut = replace(cut, factors=[image.jacobian * units / units[:, None]])  # a map, which has no parts
            return *split_product(cut.factors), cut.basis
        if max(float(np.linalg.cond(factor)) for factor in cut.factors) < _WORST_CONDITION:
            return *split_product(cut.factors), cut.basis
        count *= 2
    if isinstance(system, FlowsFrames):
        return split_stiff(system, orbit, units)
    raise AnalysisError("the flow contracts too strongly to be resolved", field="flow")


def _composes(factors: Sequence[Array], image: ReturnMap, units: Array) -> bool:
    whole = image.jacobian * units / units[:, None]
    off = np.abs(functools.reduce(lambda m, f: f @ m, factors) - whole).max()
    return bool(off <= _COMPOSED * np.abs(whole).max())
