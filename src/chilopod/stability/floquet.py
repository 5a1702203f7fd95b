"""Floquet multipliers, exponents and modes of a periodic orbit."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.cores import cores
from chilopod.errors import AnalysisError
from chilopod.flows.arguments import checked_count
from chilopod.flows.balance import numerical_balance
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.capabilities import SystemLike, flows_tangents, is_autonomous, is_stiff
from chilopod.stability.krylov.closing import LARGE
from chilopod.stability.krylov.leading import leading_multipliers, whole_pairs
from chilopod.stability.matrix_errors import DRAWN, FIRST_ORDER, VERDICTS, eigenvalues_moved, stable_within
from chilopod.stability.orbits import Orbit, find_large_orbit, find_orbit, from_known, known_state
from chilopod.stability.returns import ReturnMap, flow_with_error, return_maps
from chilopod.stability.scales import sizes
from chilopod.stability.shown import Result, Shown, axes_for, dataset, number, rows, said
from chilopod.stability.splitting import split_product
from chilopod.stability.stiff import split_stiff
from chilopod.stability.system import PeriodicSystem

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

RESOLVED = 1e-6
"""Multipliers of the return map below this modulus are too small for the error bound of an eigenvalue to mean
anything."""

_WORST_CONDITION = 1e6
_FEWEST_FACTORS, _MOST_FACTORS = 8, 32768
_COMPOSED = 1e-6  # by so much the parts of a flow may miss the whole
_SAME_ANGLE = 1e-12
_EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Multipliers(Result, ReadOnlyArrays):
    """Floquet multipliers of a periodic orbit.

    Attributes
    ----------
    values
        Multipliers of the full period, by falling modulus, shape (n,); n-1 of them where the system does not depend on
        time: the one along the motion, which is 1, is left out. Absolute accuracy is ``error_bound``: those smaller
        than it are only known to be small (:func:`exponents` resolves them). Fewer where only the leading ones were
        asked for.
    half_period
        Multipliers nu of the return map of a system with a symmetry in time, of order k: ``values = nu^k`` in the same
        order (k is 2 unless told, hence the name); None without one.
    error_bound
        Bound on the absolute error of every multiplier of modulus above 1e-6.
    error_bounds
        Bounds on the absolute errors of all, shape as of ``values``; of no meaning for those below 1e-6.
    orbit
        State on the orbit at time 0.
    period
        Period of the orbit.
    remarks
        Sentences on what else is to be said: that these are only the leading ones.
    """

    values: ComplexArray
    half_period: ComplexArray | None
    error_bound: float
    error_bounds: Array
    orbit: Array
    period: float
    remarks: tuple[str, ...] = ()

    @property
    def stable(self) -> bool | None:
        """Whether all multipliers lie inside the unit circle: True or False by more than the error bounds, None where
        these leave it undecided."""
        return stable_within(self.values, self.error_bound, self.error_bounds)

    def _lines(self) -> list[str]:
        table = rows(
            (number(value), f"± {bound:.1e}", f"modulus {abs(value):.10g}")
            for value, bound in zip(self.values, self.error_bounds, strict=True)
        )
        heading = f"Multipliers: {self.values.size} of an orbit of period {self.period:.10g}, {VERDICTS[self.stable]}"
        return [heading, *table, *said(self.remarks)]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the multipliers of the full period beside the unit circle, on axes of matplotlib or on new ones."""
        axes, outside = axes_for(axes), np.abs(self.values) > 1.0
        around = np.linspace(0.0, 2.0 * np.pi, 361)
        axes.plot(np.cos(around), np.sin(around), color="grey", linewidth=1.0)
        for style, chosen in (("C0o", ~outside), ("C3X", outside)):
            axes.plot(self.values.real[chosen], self.values.imag[chosen], style)
        title = f"{VERDICTS[self.stable]}: {outside.sum()} of {outside.size} outside"
        axes.set(xlabel="real part", ylabel="imaginary part", aspect="equal", title=title)
        return axes

    def to_dataset(self) -> xr.Dataset:
        """The multipliers of the full period, and of the return map as ``half_period``, as a dataset over
        ``multiplier``."""
        half = self.values if self.half_period is None else self.half_period
        values = {"multipliers": self.values, "modulus": np.abs(self.values), "error_bounds": self.error_bounds}
        about = {"period": self.period, "verdict": VERDICTS[self.stable], "remarks": "; ".join(self.remarks)}
        return dataset("multiplier", {**values, "half_period": half}, **about)


@dataclass(frozen=True)
class Exponents(Shown, ReadOnlyArrays):
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
    error_bound
        Bound on the absolute error (1/s) of each of ``values``, of the same shape: how far they move when the flows
        between parts of the period change by their errors.
    """

    values: ComplexArray
    modes: ComplexArray
    multipliers: Multipliers
    error_bound: Array

    def _lines(self) -> list[str]:
        pairs = zip(self.values, self.error_bound, strict=True)
        table = rows((number(value), f"± {bound:.1e} / unit of time") for value, bound in pairs)
        period, stable = self.multipliers.period, self.multipliers.stable
        return [f"Exponents: {self.values.size} of an orbit of period {period:.10g}, {VERDICTS[stable]}", *table]


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
    section = None if image.normal is None else across(image)
    jacobian = image.jacobian if section is None else section[1] @ image.jacobian @ section[0]
    # In units in which all entries are alike the errors of the eigenvalue solver are small against every one of them.
    units = numerical_balance(jacobian)
    scaled = jacobian * units / units[:, None]
    values, right = np.linalg.eig(scaled)
    # Moduli that differ by round-off are equal; the two of a pair stand together, positive frequency first.
    modulus = np.abs(values)
    largest = float(modulus.max())
    sizes = np.round(modulus / max(largest, 1e-300), 12)
    order = np.lexsort((-values.imag, -np.round(np.abs(values.imag), 12), -sizes))
    values, right = values[order].astype(np.complex128), right[:, order].astype(np.complex128)
    try:
        left = np.linalg.inv(right).conj().T
    except np.linalg.LinAlgError:  # a defective matrix: no bound to be had from conditions
        left = np.full_like(right, np.nan)
    # The backward error of the eigenvalue solver, whose eigenvectors have length 1.
    error = 4.0 * _EPSILON * float(np.linalg.norm(scaled)) * np.linalg.norm(left, axis=0)
    right, left = units[:, None] * right, left / units[:, None]
    if section is not None:
        right, left = section[0] @ right, section[1].T @ left
    norms = np.linalg.norm(right, axis=0)
    right, left = right / norms, left * norms
    # d nu = left^H E right, of which a bound of every entry of E tells the most; with one number for all of them, that
    # err independently, |d nu| has the size e |left| |right|, and the factor 4 is for safety.
    if isinstance(image.error, np.ndarray):
        error += (np.abs(left) * (image.error @ np.abs(right))).sum(axis=0)
    else:
        error += 4.0 * image.error * np.linalg.norm(left, axis=0)
    error = np.where(np.isfinite(error), error, np.inf)
    if (error > FIRST_ORDER * largest).any():
        off = np.broadcast_to(image.error, image.jacobian.shape)
        off = off if section is None else np.abs(section[1]) @ off @ np.abs(section[0])
        error = np.minimum(error, eigenvalues_moved(values, jacobian, off))
    return Spectrum(values, right, left, error)


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


def return_multipliers(image: ReturnMap) -> ComplexArray:
    """Eigenvalues of a return map by falling modulus, without the zero that stands for the motion itself."""
    jacobian = image.jacobian
    if image.normal is not None:
        into, out_of = across(image)
        jacobian = out_of @ jacobian @ into
    values = np.linalg.eigvals(jacobian).astype(np.complex128)
    return values[np.lexsort((-values.imag, -np.abs(values)))]


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
    return full_period(spec.values, spec.error, image.returns, orbit.state, image.period)


def full_period(nu: ComplexArray, error: Array, k: int, state: Array, period: float) -> Multipliers:
    """The multipliers mu = nu^k of the full period from those of the return map, with their errors."""
    modulus = np.abs(nu)
    resolved = modulus > RESOLVED
    bound = float(error[resolved].max()) if resolved.any() else float(error.min())
    if k == 1:
        return Multipliers(nu, None, bound, error, state, period)
    # By the mean value theorem, d mu is at most k (|nu| + d nu)^(k-1) d nu.
    largest = max(float(modulus[0]), 0.5)
    errors = error * k * (modulus + error) ** (k - 1)
    return Multipliers(nu**k, nu, bound * k * (largest + bound) ** (k - 1), errors, state, period)


def multipliers(system: SystemLike, orbit: ArrayLike | None = None, leading: int | None = None) -> Multipliers:
    """Floquet multipliers of a periodic orbit.

    Parameters
    ----------
    system
        The periodic system.
    orbit
        A first guess of a state on the orbit at time 0; not needed where the system knows its orbit.
    leading
        Number of the largest multipliers that are wanted, with their multiplicity, or one more where that would part a
        pair; all by default. Of a system of 100 states or more that has ``flow_tangents`` (any right-hand side that can
        be traced) they are computed in a block Krylov subspace, without the derivative of the flow as a matrix.

    Raises
    ------
    AnalysisError
        If no orbit is found.
    """
    if leading is None:
        return _multipliers(find_orbit(system, orbit))
    count = checked_count("leading", leading, system.dimension - (system.period is None))
    if flows_tangents(system) and system.dimension >= LARGE:
        image, size = find_large_orbit(system, orbit)
        found = leading_multipliers(image, size, count)
        result = full_period(found.values, found.error, image.returns, image.point, image.returns * image.duration)
        of_period = found.following**image.returns
    else:
        result, of_period = _leading_of(_multipliers(find_orbit(system, orbit)), count)
    if result.values.size == system.dimension - (system.period is None):
        return result
    remark = (
        f"only the {result.values.size} multipliers of largest modulus were asked for, and decide whether the orbit "
        f"is stable; the next one has a modulus of about {of_period:.3g}"
    )
    return replace(result, remarks=(remark,))


def _leading_of(every: Multipliers, count: int) -> tuple[Multipliers, float]:
    """The largest of all multipliers, and the modulus of the next one."""
    count = whole_pairs(every.values if every.half_period is None else every.half_period, count)
    half = None if every.half_period is None else every.half_period[:count]
    following = float(np.abs(every.values[count])) if count < every.values.size else 0.0
    chosen = replace(every, values=every.values[:count], half_period=half, error_bounds=every.error_bounds[:count])
    return chosen, following


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
    if is_stiff(system, found.state, image.period / image.returns):
        log_nu, modes, units, moved = split_stiff(system, found)
        moved = DRAWN * moved
    else:
        factors, errors, units = _factors(system, found)
        log_nu, modes, moved = split_product(factors, errors)
    bound = image.returns * (moved + 4.0 * np.finfo(float).eps * np.abs(log_nu)) / image.period
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
    return Exponents(values[order], (modes * (np.abs(peaks) / peaks))[:, order], _multipliers(found), bound[order])


@dataclass(frozen=True)
class _Part:
    """The derivative of the flow over a part of the return, with the bound on its error, in units; and its end."""

    start: float
    end: float
    state: Array
    factor: Array
    error: Array


def _factors(system: SystemLike, orbit: Orbit) -> tuple[list[Array], list[Array], Array]:
    """Derivatives of the flow over parts of the return, each of moderate condition, in units in which the entries of
    their product are alike, with bounds on their errors; and these units as a matrix.

    The parts that contract too strongly are halved, and only these: of a relaxation oscillation a few short ones. Of a
    system that does not depend on time, the derivatives are those between sections across the motion.
    """
    x, image = orbit.state, orbit.image
    duration = image.period / image.returns
    # The derivative on a section may be nothing but round-off; an orbit that moves has sizes of its own.
    units = sizes(system, x, duration) if is_autonomous(system) else numerical_balance(image.jacobian)
    times = np.linspace(0.0, duration, _FEWEST_FACTORS + 1).tolist()
    parts: list[_Part] = []
    for t0, t1 in itertools.pairwise(times):
        parts.append(_part(system, parts[-1].state if parts else x, t0, t1, units))
    turn = np.eye(x.size) if system.symmetry is None else system.symmetry * units / units[:, None]
    if not is_autonomous(system):
        whole = image.jacobian * units / units[:, None]
        product = turn @ functools.reduce(lambda m, part: part.factor @ m, parts, np.eye(x.size))
        if np.abs(product - whole).max() > _COMPOSED * np.abs(whole).max():  # a map, which has no parts
            wrong = np.broadcast_to(image.error, whole.shape) * units / units[:, None]
            return [whole], [np.nan_to_num(wrong)], np.diag(units)
    parts = _of_moderate_condition(system, x, parts, units)
    factors, errors = [part.factor for part in parts], [part.error for part in parts]
    factors[-1], errors[-1] = turn @ factors[-1], np.abs(turn) @ errors[-1]
    basis = np.diag(units)
    if is_autonomous(system):
        states = [x, *(part.state for part in parts[:-1])]
        sections = [_normal_basis(system.velocity(at) / units) for at in states]
        ends = [*sections[1:], sections[0]]
        factors = [after.T @ f @ before for f, before, after in zip(factors, sections, ends, strict=True)]
        errors = [np.abs(after.T) @ e @ np.abs(before) for e, before, after in zip(errors, sections, ends, strict=True)]
        basis = basis @ sections[0]
    return factors, errors, basis


def _part(system: SystemLike, x: Array, start: float, end: float, units: Array) -> _Part:
    state, derivative, error = flow_with_error(system, x.copy(), start, end)
    factor = derivative * units / units[:, None]
    return _Part(start, end, state, factor, np.broadcast_to(error, factor.shape) * units / units[:, None])


def _of_moderate_condition(system: SystemLike, x: Array, parts: list[_Part], units: Array) -> list[_Part]:
    """Parts of a return, those that contract too strongly cut in halves until they do not."""
    done: list[_Part] = []
    left, asked = parts[::-1], len(parts)
    while left:
        part = left.pop()
        if float(np.linalg.cond(part.factor)) < _WORST_CONDITION:
            done.append(part)
            continue
        middle = 0.5 * (part.start + part.end)
        asked += 2
        if asked > _MOST_FACTORS or not part.start < middle < part.end:
            raise AnalysisError("the flow contracts too strongly to be resolved", field="flow")
        first = _part(system, done[-1].state if done else x, part.start, middle, units)
        left += [_part(system, first.state, middle, part.end, units), first]
    return done


def _normal_basis(direction: Array) -> Array:
    """Orthonormal basis of the plane across a direction, shape (n, n-1)."""
    return np.linalg.svd(direction[None])[2][1:].T
