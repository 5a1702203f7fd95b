"""Floquet multipliers, exponents and modes of a periodic orbit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.capabilities import SystemLike
from chilopod.stability.splitting import split_product
from chilopod.stability.system import ReturnMap, find_orbit, halves, return_maps

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

RESOLVED = 1e-6
"""Multipliers of the return map below this modulus are too small for the error bound of an eigenvalue to mean
anything."""

_WORST_CONDITION = 1e6
_MOST_FACTORS = 4096
_SAME_ANGLE = 1e-12


@dataclass(frozen=True)
class Multipliers(ReadOnlyArrays):
    """Floquet multipliers of a periodic orbit.

    Attributes
    ----------
    values
        Multipliers of the full period, by falling modulus, shape (n,). Absolute accuracy is ``error_bound``: those
        smaller than it are only known to be small (:func:`exponents` resolves them).
    half_period
        Multipliers nu of the half-period map, ``values = nu^2`` in the same order; None where the system has no such
        symmetry.
    error_bound
        Bound on the absolute error of every multiplier of modulus above 1e-6.
    orbit
        State on the orbit at time 0.
    """

    values: ComplexArray
    half_period: ComplexArray | None
    error_bound: float
    orbit: Array

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
        Exponents (1/s), by falling real part, shape (n,): the principal logarithm of the full-period multiplier over
        T, imaginary part in (-pi/T, pi/T]. Where the half-period map exists they come from ln(nu^2), which is the same
        number.
    modes
        Unit eigenvectors of the full-period map at time 0 as columns, shape (n, n), the largest entry real and
        positive.
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
    """Eigenvalues of a return map with their condition."""
    values, right = np.linalg.eig(image.jacobian)
    # Moduli that differ by round-off are equal; the two of a pair stand together, positive frequency first.
    sizes = np.round(np.abs(values) / max(float(np.abs(values).max()), 1e-300), 12)
    order = np.lexsort((-values.imag, -np.round(np.abs(values.imag), 12), -sizes))
    values, right = values[order].astype(np.complex128), right[:, order].astype(np.complex128)
    try:
        left = np.linalg.inv(right).conj().T
    except np.linalg.LinAlgError:  # a defective matrix: no bound to be had from conditions
        left = np.full_like(right, np.nan)
    # d nu = left^H E right: with entries of E that err independently by up to e, |d nu| has the size e |left| |right|;
    # the factor 4 is for safety. The second part is the backward error of the eigenvalue solver.
    matrix_error = 4.0 * image.error + 4.0 * np.finfo(float).eps * np.linalg.norm(image.jacobian)
    condition = np.linalg.norm(left, axis=0)
    return Spectrum(values, right, left, np.where(np.isfinite(condition), condition, np.inf) * matrix_error)


def counts_outside(values: ComplexArray) -> tuple[int, int, int]:
    """Number of multipliers beyond -1, beyond +1, and of complex pairs outside the unit circle."""
    real = np.abs(values.imag) < 1e-9 * np.maximum(1e-3, np.abs(values))
    outside = np.abs(values) > 1.0
    return (
        int((real & (values.real < -1.0)).sum()),
        int((real & (values.real > 1.0)).sum()),
        int((~real & outside & (values.imag > 0)).sum()),
    )


def _multipliers(image: ReturnMap, orbit: Array) -> Multipliers:
    spec = spectrum(image)
    nu = spec.values
    resolved = np.abs(nu) > RESOLVED
    bound = float(spec.error[resolved].max()) if resolved.any() else float(spec.error.min())
    if image.halves == 1:
        return Multipliers(nu, None, bound, orbit)
    # mu = nu^2, so d mu = 2 |nu| d nu + (d nu)^2.
    largest = float(np.abs(nu[0]))
    return Multipliers(nu**2, nu, bound * (2.0 * max(largest, 0.5) + bound), orbit)


def multipliers(system: SystemLike, orbit: ArrayLike | None = None) -> Multipliers:
    """Floquet multipliers of a periodic orbit.

    Parameters
    ----------
    system
        The periodic system.
    orbit
        A first guess of a state on the orbit at time 0; not needed where the system knows its orbit.
    """
    x, image = find_orbit(system, orbit)
    return _multipliers(image, x)


def sweep(systems: Sequence[SystemLike]) -> list[Multipliers]:
    """Multipliers of many systems at their known orbits, on all cores where the systems allow it."""
    if not systems:
        return []
    return [_multipliers(image, image.state) for image in return_maps(systems)]


def exponents(system: SystemLike, orbit: ArrayLike | None = None) -> Exponents:
    """All Floquet exponents and modes, the strongly damped ones included.

    The period is cut into factors of moderate condition and the state space split along their product, so that a
    multiplier of 1e-60 is found with the same relative accuracy as one of 0.5; the eigenvalues of the product itself
    would be round-off there.
    """
    x, image = find_orbit(system, orbit)
    factors = _factors(system, x)
    log_nu, modes = split_product(factors)
    # Principal logarithm of nu^halves: the imaginary part back into (-pi, pi].
    angle = np.angle(np.exp(1j * image.halves * log_nu.imag))
    angle[np.abs(angle) < _SAME_ANGLE] = 0.0
    angle[np.abs(np.abs(angle) - np.pi) < _SAME_ANGLE] = np.pi
    values = (image.halves * log_nu.real + 1j * angle) / system.period
    # Conjugate pairs: positive frequency first.
    order = np.lexsort((-values.imag, -np.round(values.real * system.period, 9)))
    return Exponents(values[order], modes[:, order], _multipliers(image, x))


def _factors(system: SystemLike, x: Array) -> list[Array]:
    """Derivatives of the flow over equal parts of the return, each of moderate condition; their product is that of the
    return."""
    duration = system.period / halves(system)
    count = 8
    while True:
        times = np.linspace(0.0, duration, count + 1)
        state, factors = x.copy(), []
        for t0, t1 in zip(times, times[1:], strict=False):
            state, factor = system.flow(state, float(t0), float(t1))
            factors.append(factor)
        if max(float(np.linalg.cond(factor)) for factor in factors) < _WORST_CONDITION:
            break
        count *= 2
        if count > _MOST_FACTORS:
            raise AnalysisError("the flow contracts too strongly to be resolved", field="flow")
    if system.symmetry is not None:
        factors[-1] = system.symmetry @ factors[-1]
    return factors
