"""Where a periodic orbit loses or gains stability as one parameter changes, what happens there, and how sure that
is."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability.floquet import Spectrum, spectrum
from chilopod.stability.normal_form import NormalForm, complex_normal_form, real_normal_form
from chilopod.stability.system import ReturnMap, SystemLike, find_orbit, optional, return_map, return_maps

Array = NDArray[np.float64]
Family = Callable[[float], SystemLike]

AMPLITUDE = 0.2
"""Largest amplitude along the unit critical mode at which the return map is sampled for the normal form."""

_FIRST_GRID = 9
_FINEST = 2.0**-12
_SAFETY = 1.5


class Kind(enum.Enum):
    """What happens at a bifurcation point; each member's ``sentence`` says it in words."""

    PITCHFORK = "pitchfork", "a symmetric orbit changes stability and a pair of mirrored orbits branches off"
    FOLD = "fold", "two orbits meet and vanish"
    TRANSCRITICAL = "transcritical", "the orbit crosses another one and they exchange stability"
    PERIOD_DOUBLING = "period doubling", "an orbit of twice the period branches off"
    NEIMARK_SACKER = "Neimark-Sacker", "an oscillation at a second frequency branches off: an invariant torus"
    BRANCH_POINT = "branch point", "another orbit branches off; the coefficients do not tell how"

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


class Criticality(enum.Enum):
    """Which way the new orbits go."""

    SUPERCRITICAL = "supercritical", "the new orbits are stable and grow from zero: the change is gentle"
    SUBCRITICAL = "subcritical", "the new orbits are unstable and lie where the old one is stable: the change is a jump"
    UNDECIDED = "undecided", "the coefficient is zero within its error"

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


@dataclass(frozen=True)
class BifurcationPoint:
    """A located bifurcation.

    Attributes
    ----------
    kind
        What it is.
    value
        Of the parameter.
    error_bound
        Bound on the error of ``value``: that of the critical multiplier over its rate of change, and the root finder's.
    orbit
        State on the critical orbit at time 0, shape (n,).
    mode
        Unit critical eigenvector, shape (n,), complex for Neimark-Sacker.
    multiplier
        Critical multiplier of the return map (of the half period where that symmetry exists).
    frequency
        Angular frequency (1/s) of the critical mode: 0 for a real multiplier +1 of the period; the principal value
        otherwise.
    criticality, coefficient, coefficient_error
        Verdict and cubic coefficient a -> a + coefficient a^3 of the full-period map, a the amplitude along the unit
        ``mode`` (Neimark-Sacker: state = 2 Re(a mode)); None where it has no meaning (fold, transcritical, branch
        point).
    """

    kind: Kind
    value: float
    error_bound: float
    orbit: Array
    mode: NDArray[np.complex128]
    multiplier: complex
    frequency: float
    criticality: Criticality | None = None
    coefficient: float | None = None
    coefficient_error: float | None = None


@dataclass(frozen=True)
class _Sample:
    value: float
    orbit: Array
    image: ReturnMap
    spectrum: Spectrum

    @property
    def counts(self) -> tuple[int, int, int]:
        """Number of multipliers beyond -1, beyond +1, and of complex pairs outside the unit circle."""
        nu = self.spectrum.values
        real = np.abs(nu.imag) < 1e-9 * np.maximum(1e-3, np.abs(nu))
        outside = np.abs(nu) > 1.0
        return (
            int((real & (nu.real < -1.0)).sum()),
            int((real & (nu.real > 1.0)).sum()),
            int((~real & outside & (nu.imag > 0)).sum()),
        )


def locate(
    family: Family, between: tuple[float, float], orbit: ArrayLike | None = None, normal_form: bool = True
) -> list[BifurcationPoint]:
    """Find every bifurcation of a periodic orbit in an interval of a parameter.

    Parameters
    ----------
    family
        ``family(value)`` is the system at a value of the parameter.
    between
        The interval, ``low < high``.
    orbit
        A guess of a state on the orbit at time 0 for ``low``, shape (n,); the orbit is then followed through the
        interval. Not needed where the systems know their orbit.
    normal_form
        Whether to compute coefficients and verdicts as well.

    Returns
    -------
    Points by rising parameter; an empty list if stability does not change.

    Raises
    ------
    ParameterError
        If the interval is empty, reversed or not finite.
    AnalysisError
        If the orbit cannot be followed through the interval.
    """
    low, high = float(between[0]), float(between[1])
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ParameterError("must rise from a lower to a higher finite value", field="between", value=(low, high))
    search = _Search(family, None if orbit is None else np.asarray(orbit, dtype=np.float64))
    points = [search.refine(a, b, event) for a, b, event in search.brackets(low, high)]
    points.sort(key=lambda sample: sample[0].value)
    return [search.describe(sample, event, slope, residual, normal_form) for sample, event, slope, residual in points]


_MINUS, _PLUS, _PAIR = 0, 1, 2


class _Search:
    """Samples of the family along the parameter, and what is done with them."""

    def __init__(self, family: Family, guess: Array | None) -> None:
        self.family = family
        self.guess = guess

    def sample(self, value: float, near: Array | None) -> _Sample:
        orbit, image = find_orbit(self.family(value), near, with_error=False)
        return _Sample(value, orbit, image, spectrum(image))

    def first_grid(self, low: float, high: float) -> list[_Sample]:
        values = np.linspace(low, high, _FIRST_GRID)
        if self.guess is None:
            images = return_maps([self.family(float(value)) for value in values])
            return [
                _Sample(float(value), image.state, image, spectrum(image))
                for value, image in zip(values, images, strict=True)
            ]
        samples = [self.sample(low, self.guess)]
        for value in values[1:]:
            samples.append(self._follow(samples, float(value)))
        return samples

    def _follow(self, behind: list[_Sample], value: float) -> _Sample:
        """The orbit at ``value`` from those at the samples behind, by smaller steps where Newton does not carry that
        far."""
        behind = behind[-2:]
        target = value
        for _ in range(60):
            last = behind[-1]
            guess = last.orbit
            if len(behind) > 1:
                slope = (last.orbit - behind[-2].orbit) / (last.value - behind[-2].value)
                guess = guess + (target - last.value) * slope
            try:
                found = self.sample(target, guess)
            except AnalysisError:
                target = 0.5 * (last.value + target)
                if abs(target - last.value) < 1e-9 * abs(value - last.value):
                    break
                continue
            if target == value:
                return found
            behind, target = [last, found], value
        raise AnalysisError(
            "the orbit cannot be followed further",
            field="parameter",
            value=behind[-1].value,
            allowed="an interval in which it exists",
        )

    def between(self, a: _Sample, b: _Sample, value: float) -> _Sample:
        if self.guess is None:
            return self.sample(value, None)
        t = (value - a.value) / (b.value - a.value)
        try:
            return self.sample(value, (1 - t) * a.orbit + t * b.orbit)
        except AnalysisError:
            return self._follow([a], value)

    def brackets(self, low: float, high: float) -> list[tuple[_Sample, _Sample, int]]:
        """Intervals that hold exactly one event each."""
        samples = self.first_grid(low, high)
        finest = _FINEST * (high - low)
        found: list[tuple[_Sample, _Sample, int]] = []
        stack = list(zip(samples, samples[1:], strict=False))
        while stack:
            a, b = stack.pop()
            changes = [abs(x - y) for x, y in zip(a.counts, b.counts, strict=True)]
            if sum(changes) == 1 and not _suspicious(a.spectrum, b.spectrum, changes.index(1)):
                found.append((a, b, changes.index(1)))
            elif b.value - a.value < finest:
                # Events closer than the finest grid: each kind that changed is refined on its own.
                found.extend((a, b, event) for event, change in enumerate(changes) if change % 2 == 1)
            elif sum(changes) > 0 or _suspicious(a.spectrum, b.spectrum, None):
                middle = self.between(a, b, 0.5 * (a.value + b.value))
                stack += [(a, middle), (middle, b)]
        return found

    def refine(self, a: _Sample, b: _Sample, event: int) -> tuple[_Sample, int, float, float]:
        """Close in on the event; returns the sample there, the slope of its test function and the residual."""
        seen = {a.value: a, b.value: b}

        def test(value: float) -> float:
            if value not in seen:
                seen[value] = self.between(a, b, value)
            return _test(seen[value].spectrum, event)

        # The test functions are analytic in the parameter, and known to the accuracy of the multipliers only.
        root = float(brentq(test, a.value, b.value, xtol=1e-300, rtol=4 * np.finfo(float).eps, maxiter=100))
        at = seen[root] if root in seen else self.between(a, b, root)
        delta = 1e-5 * (b.value - a.value)
        side = root + delta if root + delta < b.value else root - delta
        critical = _critical(at.spectrum, event)
        beside = self.between(a, b, side)
        moved = beside.spectrum.values[np.abs(beside.spectrum.values - at.spectrum.values[critical]).argmin()]
        target = _target(at.spectrum.values[critical], event)
        slope = (_distance(moved, event) - _distance(at.spectrum.values[critical], event)) / (side - root)
        return at, event, float(slope), float(abs(at.spectrum.values[critical] - target))

    def describe(self, at: _Sample, event: int, slope: float, residual: float, normal_form: bool) -> BifurcationPoint:
        system = self.family(at.value)
        spec = spectrum(return_map(system, at.orbit))  # once more, with its error
        critical = _critical(spec, event)
        nu = complex(spec.values[critical])
        uncertainty = float(spec.error[critical]) + (residual if event != _PAIR else abs(abs(nu) - 1.0))
        bound = _SAFETY * uncertainty / abs(slope) if slope != 0.0 else np.inf
        bound += 4 * np.finfo(float).eps * abs(at.value)
        period = system.period
        mode, left = _phased(spec.right[:, critical], spec.left[:, critical])
        if event == _PAIR:
            angle = float(np.angle(np.exp(1j * at.image.halves * np.angle(nu))))
            # Of a conjugate pair, the mode that turns with positive frequency.
            if angle < 0:
                nu, mode, left, angle = nu.conjugate(), mode.conj(), left.conj(), -angle
            form = None
            if normal_form:
                form = _where_it_exists(
                    lambda size: complex_normal_form(system, at.image, nu / abs(nu), mode, left, size)
                )
            return _point(Kind.NEIMARK_SACKER, at, bound, mode, nu, angle / period, form)
        form = None
        if normal_form or (event == _PLUS and not _antisymmetric(system, mode)):
            target = 1.0 if event == _PLUS else -1.0
            form = _where_it_exists(lambda size: real_normal_form(system, at.image, target, mode.real, left.real, size))
        kind = self._kind(system, at, event, mode.real, left.real, form)
        if kind in (Kind.FOLD, Kind.TRANSCRITICAL, Kind.BRANCH_POINT):
            form = None
        frequency = np.pi / period if kind is Kind.PERIOD_DOUBLING else 0.0
        return _point(kind, at, bound, mode, nu, frequency, form)

    def _kind(
        self, system: SystemLike, at: _Sample, event: int, mode: Array, left: Array, form: NormalForm | None
    ) -> Kind:
        if event == _MINUS:
            return Kind.PITCHFORK if at.image.halves == 2 else Kind.PERIOD_DOUBLING
        if _antisymmetric(system, mode):
            return Kind.PITCHFORK
        # At +1 an orbit that is only known numerically folds unless it exists on both sides, as this one did when it
        # was sampled.
        assert form is not None
        if abs(form.quadratic) > 10.0 * form.quadratic_error:
            return Kind.TRANSCRITICAL
        if abs(form.cubic) > 10.0 * form.cubic_error:
            return Kind.PITCHFORK
        return Kind.BRANCH_POINT


def _point(
    kind: Kind,
    at: _Sample,
    bound: float,
    mode: NDArray[np.complex128],
    nu: complex,
    frequency: float,
    form: NormalForm | None,
) -> BifurcationPoint:
    if form is None:
        return BifurcationPoint(kind, at.value, bound, at.orbit, mode, nu, frequency)
    if abs(form.cubic) <= form.cubic_error:
        verdict = Criticality.UNDECIDED
    else:
        verdict = Criticality.SUPERCRITICAL if form.cubic < 0 else Criticality.SUBCRITICAL
    return BifurcationPoint(kind, at.value, bound, at.orbit, mode, nu, frequency, verdict, form.cubic, form.cubic_error)


def _where_it_exists(form: Callable[[float], NormalForm]) -> NormalForm:
    """The normal form from samples at the largest amplitude, of a falling sequence, at which the motion does not
    diverge."""
    for halving in range(6):
        try:
            return form(AMPLITUDE * 0.25**halving)
        except AnalysisError:
            if halving == 5:
                raise
    raise AssertionError  # unreachable


def _antisymmetric(system: SystemLike, mode: NDArray[np.inexact]) -> bool:
    reflection = optional(system, "spatial_symmetry")
    return reflection is not None and bool(np.abs(reflection @ mode + mode).max() < 1e-6)


def _phased(
    right: NDArray[np.complex128], left: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """The pair with the largest entry of the right vector real and positive, left^H right = 1 kept."""
    peak = right[np.abs(right).argmax()]
    turn = np.abs(peak) / peak
    return right * turn, left * turn


def _target(nu: complex, event: int) -> complex:
    return {_MINUS: -1.0, _PLUS: 1.0}.get(event, nu / abs(nu) if nu else 1.0)


def _distance(nu: complex, event: int) -> float:
    """Signed distance of a multiplier from where the event happens."""
    return {_MINUS: nu.real + 1.0, _PLUS: nu.real - 1.0}.get(event, abs(nu) - 1.0)


def _critical(spec: Spectrum, event: int) -> int:
    if event == _PAIR:
        # Of the complex ones, the pair nearest the circle; if they have just met on the real axis, the nearest of all.
        distance = np.abs(np.abs(spec.values) - 1.0) + np.where(np.abs(spec.values.imag) > 1e-9, 0.0, 1.0)
        return int(distance.argmin())
    return int(np.abs(spec.values - _target(0.0, event)).argmin())


def _test(spec: Spectrum, event: int) -> float:
    """A function that is analytic in the parameter and changes sign at the event."""
    nu = spec.values
    if event == _MINUS:
        return float(np.prod(nu + 1.0).real)
    if event == _PLUS:
        return float(np.prod(nu - 1.0).real)
    return float(abs(nu[_critical(spec, event)]) - 1.0)


def _suspicious(one: Spectrum, other: Spectrum, expected: int | None) -> bool:
    """Whether a multiplier may have crossed the unit circle and returned between two samples that do not show it.

    Multipliers are paired nearest to nearest; one that lies nearer to the circle than it moved in between is looked at
    more closely, unless it is the one whose crossing is seen anyway.
    """
    moved = other.values[np.abs(one.values[:, None] - other.values[None]).argmin(axis=1)]
    travel = np.abs(moved - one.values)
    distance = np.minimum(np.abs(np.abs(one.values) - 1.0), np.abs(np.abs(moved) - 1.0))
    crossed = (np.abs(one.values) > 1.0) != (np.abs(moved) > 1.0)
    risky = (distance < 0.5 * travel) & ~crossed
    return bool(risky.any()) or (expected is None and bool(crossed.any()))
