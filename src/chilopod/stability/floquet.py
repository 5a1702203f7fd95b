"""Floquet multipliers, exponents and modes of a periodic orbit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from chilopod.cores import cores
from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.arguments import checked_count
from chilopod.flows.deadline import Deadline
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.interface import SystemLike, check_system, is_autonomous, offers
from chilopod.stability.krylov import LARGE, leading_multipliers, whole_pairs
from chilopod.stability.orbits.orbit import Orbit, find_large_orbit, find_orbit, known_orbits
from chilopod.stability.shown import Result, Shown, axes_for, dataset, number, rows, said
from chilopod.stability.spectrum import VERDICTS, ContractionError, phased, spectrum, split_return, stable_within
from chilopod.stability.system import PeriodicSystem

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


_RESOLVED = 1e-6  # modulus of a multiplier below which the error bound of an eigenvalue is invalid
_SAME_ANGLE = 1e-12


@dataclass(frozen=True, eq=False)
class Multipliers(Result, ReadOnlyArrays):
    """Floquet multipliers of a periodic orbit.

    Attributes
    ----------
    values
        Multipliers of the full period, by falling modulus, shape (n,), or (n-1,) without the one along the motion if
        the system does not depend on time, or fewer if only leading ones were requested. Values below ``error_bound``
        are only known to be small (:func:`exponents` resolves them).
    half_period
        Multipliers nu of the return map with a symmetry in time of order k (usually 2), ``values = nu^k``; else None.
    error_bound
        Bound on the absolute error of every multiplier of modulus above 1e-6.
    error_bounds
        Bounds on the absolute errors of all, in the shape of ``values``; invalid for those below 1e-6.
    orbit, period
        State on the orbit at time 0, and its period.
    remarks
        Remarks, a sentence each, such as a note on leading multipliers.
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
        """True if all multipliers lie in the unit circle by more than bounds, False if one lies outside, or None."""
        return stable_within(self.values, self.error_bound, self.error_bounds)

    def _lines(self) -> list[str]:
        pairs = zip(self.values, self.error_bounds, strict=True)
        table = rows((number(value), f"± {bound:.1e}", f"modulus {abs(value):.10g}") for value, bound in pairs)
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
        """Dataset over ``multiplier``: those of the full period, and ``half_period`` with a symmetry in time."""
        half = {} if self.half_period is None else {"half_period": self.half_period}
        values = {"multipliers": self.values, "modulus": np.abs(self.values), "error_bounds": self.error_bounds}
        about = {"period": self.period, "verdict": VERDICTS[self.stable], "remarks": "; ".join(self.remarks)}
        return dataset("multiplier", {**values, **half}, **about)


@dataclass(frozen=True, eq=False)
class Exponents(Shown, ReadOnlyArrays):
    """Floquet exponents and modes.

    Attributes
    ----------
    values
        Exponents (1/s), by falling real part, shape (n,) or, like the multipliers, (n-1,): principal logarithm of the
        full-period multiplier over T, imaginary part in (-pi/T, pi/T].
    modes
        Unit eigenvectors of the full-period map at time 0 as columns, the largest entry real and positive; for a system
        that does not depend on time, of its Poincare map on the section across the motion.
    multipliers
        Multipliers of the same orbit.
    error_bound
        Bound on the absolute error (1/s) of each of ``values``.
    """

    values: ComplexArray
    modes: ComplexArray
    multipliers: Multipliers
    error_bound: Array

    def _lines(self) -> list[str]:
        pairs = zip(self.values, self.error_bound, strict=True)
        table = rows((number(value), f"± {bound:.1e} / unit of time") for value, bound in pairs)
        period, stable = self.multipliers.period, self.multipliers.stable
        less = self.multipliers.values.size - self.values.size
        remarks = [f"of {less} more the multipliers are zero, or too small to be resolved"] if less else []
        heading = f"Exponents: {self.values.size} of an orbit of period {period:.10g}, {VERDICTS[stable]}"
        return [heading, *table, *said(remarks)]


def _multipliers(orbit: Orbit) -> Multipliers:
    spec = spectrum(orbit.image)
    return full_period(spec.values, spec.error, orbit.image.returns, orbit.state, orbit.period)


def full_period(nu: ComplexArray, error: Array, k: int, state: Array, period: float) -> Multipliers:
    """The multipliers mu = nu^k of the full period from those of the return map, with their errors."""
    modulus = np.abs(nu)
    resolved = modulus > _RESOLVED
    bound = float((error[resolved] if resolved.any() else error).max(initial=0.0))
    if k == 1:
        return Multipliers(nu, None, bound, error, state, period)
    # By the mean value theorem, d mu is at most k (|nu| + d nu)^(k-1) d nu.
    largest = float(modulus.max(initial=0.5))
    errors = error * k * (modulus + error) ** (k - 1)
    return Multipliers(nu**k, nu, bound * k * (largest + bound) ** (k - 1), errors, state, period)


def multipliers(
    system: SystemLike, orbit: ArrayLike | None = None, leading: int | None = None, *, seconds: float = math.inf
) -> Multipliers:
    """Floquet multipliers of a periodic orbit.

    Parameters
    ----------
    system
        The periodic system.
    orbit
        First guess of a state on the orbit at time 0, or an AnalysisError; by default the system's known orbit.
    leading
        Number of largest multipliers, counted with multiplicity, or one more to complete a pair; all by default. For
        100 states or more, a system with ``flow_tangents``, as any traced one, is not asked for the whole matrix.
    seconds
        Time, s, after which the search for the orbit, or for leading multipliers, ends.
    """
    with Deadline(seconds):
        if leading is None:
            return _multipliers(find_orbit(system, orbit))
        check_system(system)
        count = checked_count("leading", leading, max(1, system.dimension - (system.period is None)))
        result = None
        if offers(system, "flow_tangents") and system.dimension >= LARGE:
            image, size = find_large_orbit(system, orbit)
            with suppress(ContractionError):
                found, error, following = leading_multipliers(image, size, count)
                result = full_period(found, error, image.returns, image.point, image.returns * image.duration)
                next_one = following**image.returns
        if result is None:
            result = _multipliers(find_orbit(system, orbit))
            half, moduli = result.half_period, np.abs(result.values)
            count = whole_pairs(result.values if half is None else half, count)
            next_one = float(moduli[count]) if count < moduli.size else 0.0
            half = None if half is None else half[:count]
            bounds = result.error_bounds[:count]
            result = replace(result, values=result.values[:count], half_period=half, error_bounds=bounds)
    if result.values.size == system.dimension - (system.period is None):
        return result
    several = result.values.size > 1
    which = f"{result.values.size} multipliers of largest modulus were" if several else "largest multiplier was"
    deciding = "they decide" if several else "it decides"
    decide = "" if result.stable is None else f"{deciding} whether the orbit is stable; "
    least = float(result.error_bounds.max())
    modulus = f"of about {next_one:.3g}" if next_one > least else f"below about {least:.1g}"
    return replace(result, remarks=(f"only the {which} computed; {decide}the next one has a modulus {modulus}",))


def sweep(systems: Sequence[SystemLike], *, seconds: float = math.inf) -> list[Multipliers]:
    """Multipliers of many systems at their known orbits, on all cores if possible; a SpentError after ``seconds``."""
    if not isinstance(systems, Sequence):
        raise ParameterError("must be a list", field="systems", value=systems, allowed="a list of systems")
    for system in systems:
        check_system(system)
    with Deadline(seconds):
        if all(isinstance(system, PeriodicSystem) and system.concurrent for system in systems):
            with ThreadPoolExecutor(cores()) as threads:  # which share the time limit
                jobs = [threads.submit(copy_context().run, _at, i, each) for i, each in enumerate(systems)]
                return [job.result() for job in jobs]
        if any(is_autonomous(system) or not offers(system, "flow_many") for system in systems):
            return [_at(*each) for each in enumerate(systems)]
        return [_multipliers(orbit) for orbit in known_orbits(systems)]


def _at(index: int, system: SystemLike) -> Multipliers:
    """Multipliers of one of several systems, whose index an error names."""
    try:
        return multipliers(system)
    except (AnalysisError, ParameterError) as error:
        error.field = ".".join(filter(None, (f"systems[{index}]", error.field)))
        raise


def exponents(
    system: SystemLike, orbit: ArrayLike | None = None, *, resolved: bool = False, seconds: float = math.inf
) -> Exponents:
    """All Floquet exponents and modes, including strongly damped ones; other arguments as for :func:`multipliers`.

    The state space is split along factors of the period: a multiplier of 1e-60 is relatively as accurate as one of 0.5.
    Where a flow contracts too strongly for that, as with a reset of a state to a constant, whose multiplier is zero, an
    AnalysisError says so; with ``resolved`` the exponents of the multipliers that are resolved without it are returned,
    those of largest modulus.
    """
    with Deadline(seconds):
        found = find_orbit(system, orbit)
        image = found.image
        log_nu, modes, error = split_return(system, found.state, image, resolved)
    bound = image.returns * error / image.period
    # Principal logarithm of nu^k, with the imaginary part in (-pi, pi].
    angle = np.angle(np.exp(1j * image.returns * log_nu.imag))
    angle[np.abs(angle) < _SAME_ANGLE] = 0.0
    angle[np.abs(np.abs(angle) - np.pi) < _SAME_ANGLE] = np.pi
    values = (image.returns * log_nu.real + 1j * angle) / image.period
    # Conjugate pairs: positive frequency first.
    order = np.lexsort((-values.imag, -np.round(values.real * image.period, 9)))
    modes = phased(modes / np.linalg.norm(modes, axis=0))
    return Exponents(values[order], modes[:, order], _multipliers(found), bound[order])
