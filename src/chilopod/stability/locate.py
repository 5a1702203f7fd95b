"""Where a periodic orbit loses or gains stability as one parameter changes, what happens there, and how sure that
is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from chilopod.errors import ParameterError
from chilopod.stability.capabilities import SystemLike, spatial_symmetries
from chilopod.stability.center_manifold import CriticalOrbit
from chilopod.stability.floquet import Spectrum, spectrum
from chilopod.stability.fold import Fold
from chilopod.stability.normal_form import NormalForm
from chilopod.stability.normal_form import normal_form as normal_form_of
from chilopod.stability.points import BifurcationPoint, Kind, criticality, kind_at_plus_one
from chilopod.stability.returns import ReturnMap, Section, return_map, returned_states
from chilopod.stability.samples import Family, Sample, Samples
from chilopod.stability.zeros import brackets

Array = NDArray[np.float64]

_SAFETY = 1.5
_DECADES = 4.0
_CRITICAL = 1e-6  # distance from the circle within which a zero of a test function is a multiplier's
_SLOPE_STEP = 1e-6  # of the interval

# What a multiplier of the return map may pass through.
_MINUS, _PLUS, _PAIR = -1, 1, 0


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
    low, high = _interval(between)
    samples = Samples(family, orbit, low, high)
    points = []
    if low < samples.end:
        # Over decades a parameter acts by its logarithm.
        inward, outward = (np.log, np.exp) if low > 0.0 and samples.end > _DECADES * low else (_same, _same)
        tests = _Tests(samples)
        for event in (_MINUS, _PLUS, _PAIR):

            def test(places: Array, event: int = event) -> Array:
                return tests.at(np.clip(outward(places), low, samples.end), event)

            for a, b in brackets(test, float(inward(low)), float(inward(samples.end))):
                if event == _PAIR and not _pair_near(samples, float(outward(a)), float(outward(b))):
                    continue
                root = min(max(float(outward(a if a == b else _root(test, a, b))), low), samples.end)
                point = _describe(samples, root, event, high - low, normal_form)
                points += [point] if point else []
    if samples.fold is not None:
        points.append(_fold_point(samples.fold, samples.family(samples.fold.value), normal_form))
    return sorted(points, key=lambda point: point.value)


def _same(values: Any) -> Any:
    return values


def _interval(between: tuple[float, float]) -> tuple[float, float]:
    try:
        low, high = (float(value) for value in between)
    except (TypeError, ValueError):
        low, high = np.nan, np.nan
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ParameterError("must be two finite values", field="between", value=between, allowed="(lower, higher)")
    return low, high


def _root(test: Callable[[Array], Array], a: float, b: float) -> float:
    return float(brentq(lambda v: test(np.array([v]))[0], a, b, xtol=1e-300, rtol=4 * np.finfo(float).eps, maxiter=200))


def _pair_near(samples: Samples, a: float, b: float) -> bool:
    """Whether a complex pair may be on the circle between two values of the parameter that are close together.

    The bialternate product also vanishes where two real multipliers have product 1.
    """
    one, other = (np.linalg.eigvals(sample.image.jacobian) for sample in samples.at(np.array([a, b])))
    moved = np.abs(one[:, None] - other).min(axis=1)
    distance = np.abs(np.abs(one) - 1.0)
    return bool((distance <= _CRITICAL + 4.0 * moved)[(np.abs(one.imag) > 0.0) | (moved > 1e-3)].any())


class _Tests:
    """Functions of the parameter that are analytic, of moderate size, and change sign at an event.

    det(H' + 1), det(H' - 1), and the bialternate product (a pair on the circle has product 1; over all pairs), over a
    power of det(1 + H'^T H') that keeps them bounded however much H' stretches.
    """

    def __init__(self, samples: Samples) -> None:
        self._samples = samples
        self._known: dict[float, dict[int, float]] = {}

    def at(self, values: Array, event: int) -> Array:
        """The function of an event at some values of the parameter."""
        missing = np.unique([value for value in values.tolist() if value not in self._known])
        if missing.size:
            self._compute(missing)
        return np.array([self._known[value][event] for value in values.tolist()])

    def _compute(self, values: Array) -> None:
        jacobians = np.stack([sample.image.jacobian for sample in self._samples.at(values)])
        n = jacobians.shape[-1]
        nu = np.linalg.eigvals(jacobians).astype(np.complex128)
        stretch = 0.5 * np.linalg.slogdet(np.eye(n) + np.swapaxes(jacobians, 1, 2) @ jacobians)[1]
        first, second = _pairs(n)
        found = {
            _MINUS: _bounded(nu + 1.0, stretch),
            _PLUS: _bounded(nu - 1.0, stretch),
            _PAIR: _bounded(nu[:, first] * nu[:, second] - 1.0, (n - 1) * stretch),
        }
        for index, value in enumerate(values.tolist()):
            self._known[value] = {event: float(results[index]) for event, results in found.items()}


def _bounded(factors: NDArray[np.complex128], log_size: Array) -> Array:
    """Products of the rows of ``factors``, which are real, over exp(log_size)."""
    sizes = np.abs(factors)
    with np.errstate(divide="ignore"):
        magnitude = np.exp(np.log(sizes).sum(axis=1) - log_size)
    signs = np.prod(factors / np.where(sizes == 0.0, 1.0, sizes), axis=1).real
    result: Array = np.sign(signs) * magnitude
    return result


@cache
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    first, second = np.triu_indices(count, 1)
    return first, second


def _describe(
    samples: Samples, value: float, event: int, width: float, with_normal_form: bool
) -> BifurcationPoint | None:
    """What happens at a zero of a test function; None if no multiplier is critical there after all."""
    at = samples.at(np.array([value]))[0]
    system = samples.family(value)
    image = return_map(system, at.orbit)  # once more, with its error
    spec = spectrum(image)
    critical = _critical(spec, event)
    nu = complex(spec.values[critical])
    if event == _PAIR and abs(nu.imag) < 1e-9:
        return None  # two real multipliers with product 1
    distance = abs(nu - event) if event != _PAIR else abs(abs(nu) - 1.0)
    if distance > _CRITICAL:
        return None
    # d nu = left^H dH' right, which holds however close another multiplier is.
    step = _SLOPE_STEP * width * (1.0 if value + _SLOPE_STEP * width < samples.end else -1.0)
    beside = samples.at(np.array([value + step]))[0]
    moved = spec.left[:, critical].conj() @ (beside.image.jacobian - at.image.jacobian) @ spec.right[:, critical]
    slope = abs(moved.real if event != _PAIR else (np.conj(nu) * moved).real / abs(nu)) / abs(step)
    uncertainty = float(spec.error[critical]) + distance
    bound = _SAFETY * uncertainty / slope if slope > 0.0 else np.inf
    bound = float(bound + 4 * np.finfo(float).eps * abs(value))
    mode, left = _phased(spec.right[:, critical], spec.left[:, critical])
    if event == _PAIR:
        angle = float(np.angle(np.exp(1j * image.returns * np.angle(nu))))
        # Of a conjugate pair, the mode that turns with positive frequency.
        if angle < 0:
            nu, mode, left, angle = nu.conjugate(), mode.conj(), left.conj(), -angle
        form = _form(system, at.orbit, image, nu / abs(nu), mode, left) if with_normal_form else None
        return _point(Kind.NEIMARK_SACKER, at, bound, mode, nu, angle / image.period, form)
    form = None
    if with_normal_form or (event == _PLUS and not _antisymmetric(system, mode)):
        form = _form(system, at.orbit, image, complex(event), mode, left)
    kind = _kind(system, image.returns, event, mode.real, form)
    frequency = np.pi / image.period if kind is Kind.PERIOD_DOUBLING else 0.0
    return _point(kind, at, bound, mode, nu, frequency, form)


def _kind(system: SystemLike, returns: int, event: int, mode: Array, form: NormalForm | None) -> Kind:
    if event == _MINUS:
        return Kind.PITCHFORK if returns == 2 else Kind.PERIOD_DOUBLING
    if _antisymmetric(system, mode):
        return Kind.PITCHFORK
    # The orbit was sampled on both sides, so it does not end in a fold here.
    assert form is not None
    return kind_at_plus_one(form)


def _fold_point(fold: Fold, system: SystemLike, with_normal_form: bool) -> BifurcationPoint:
    spec = spectrum(fold.image)
    critical = _critical(spec, _PLUS)
    mode, left = _phased(spec.right[:, critical], spec.left[:, critical])
    form = _form(system, fold.image.state, fold.image, 1.0 + 0.0j, mode, left) if with_normal_form else None
    return BifurcationPoint(
        Kind.FOLD,
        fold.value,
        fold.error_bound,
        fold.image.state,
        mode,
        complex(spec.values[critical]),
        0.0,
        normal_form=form,
    )


def _form(
    system: SystemLike,
    orbit: Array,
    image: ReturnMap,
    multiplier: complex,
    mode: NDArray[np.complex128],
    left: NDArray[np.complex128],
) -> NormalForm:
    if multiplier.imag == 0.0:
        mode, left = mode.real.astype(np.complex128), left.real.astype(np.complex128)
    critical_orbit = CriticalOrbit(orbit, image.jacobian, multiplier, mode, left, image.returns)
    uncertainty = float(np.max(image.error)) / float(np.linalg.norm(image.jacobian))
    section = None if image.normal is None else Section(orbit, image.normal, image.period / image.returns)
    return normal_form_of(
        lambda states: returned_states(system, states, section), critical_orbit, uncertainty=uncertainty
    )


def _point(
    kind: Kind,
    at: Sample,
    bound: float,
    mode: NDArray[np.complex128],
    nu: complex,
    frequency: float,
    form: NormalForm | None,
) -> BifurcationPoint:
    point = BifurcationPoint(kind, at.value, bound, at.orbit, mode, nu, frequency, normal_form=form)
    if form is None or kind in (Kind.FOLD, Kind.TRANSCRITICAL, Kind.BRANCH_POINT):
        return point
    point = replace(point, criticality=criticality(form), coefficient=form.cubic, coefficient_error=form.cubic_error)
    if kind is Kind.NEIMARK_SACKER:
        point = replace(point, rotation=form.rotation, rotation_error=form.rotation_error)
    return point


def _antisymmetric(system: SystemLike, mode: NDArray[np.inexact]) -> bool:
    return any(bool(np.abs(matrix @ mode + mode).max() < 1e-6) for matrix in spatial_symmetries(system))


def _phased(
    right: NDArray[np.complex128], left: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """The pair with the largest entry of the right vector real and positive, left^H right = 1 kept."""
    peak = right[np.abs(right).argmax()]
    turn = np.abs(peak) / peak
    return right * turn, left * turn


def _critical(spec: Spectrum, event: int) -> int:
    if event == _PAIR:
        # Of the complex ones, the pair nearest the circle; if there are none, the nearest of all.
        distance = np.abs(np.abs(spec.values) - 1.0) + np.where(np.abs(spec.values.imag) > 1e-9, 0.0, 1.0)
        return int(distance.argmin())
    return int(np.abs(spec.values - event).argmin())
