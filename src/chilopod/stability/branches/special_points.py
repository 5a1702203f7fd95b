"""What is known of a special point on a branch: how sure its place is, and its normal form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.branches.branch_points import BranchPoint, Step
from chilopod.stability.branches.curve import Curve
from chilopod.stability.capabilities import SystemLike, spatial_symmetries
from chilopod.stability.floquet import Spectrum, phased, spectrum
from chilopod.stability.normal_forms.center_manifold import CriticalOrbit
from chilopod.stability.normal_forms.normal_form import NormalForm, normal_form
from chilopod.stability.orbits import find_orbit
from chilopod.stability.points import BifurcationPoint, Kind, kind_at_plus_one, with_coefficients
from chilopod.stability.returns import ReturnMap, Section, returned_states
from chilopod.stability.unit_circle.spectra import Event

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_CRITICAL = 1e-5  # distance from the circle within which a multiplier is the critical one of a located point
_SAFETY = 1.5
_SIDE = 1e-3  # of a step: half the difference that slopes are taken from
_AROUND = 0.05  # of a step: distance of the orbits that the one where branches meet is interpolated from
_SAME = 1e-6  # of a mode, and of the sizes of the states


@dataclass(frozen=True)
class Place:
    """Where something happens within a step: along its first tangent, what passes the circle, whether the curve turns
    back there, and whether another one meets it."""

    place: float
    event: Event
    fold: bool = False
    branching: bool = False


def described(
    curve: Curve, at: Callable[[float], Step], place: Place, between: tuple[float, float]
) -> BranchPoint | None:
    """The special point at a place within a step; None if no multiplier is critical there after all.

    Parameters
    ----------
    curve
        Of the step.
    at
        Parts of the step, by where they end.
    place
        What happens where.
    between
        Places within which the step may be cut.
    """
    if place.event is Event.PLUS and not place.fold:
        point, uncertain = _interpolated(curve, at, place.place, between)
    else:
        point, uncertain = at(place.place).end.last, 0.0
    system = curve.system(point.value)
    section = curve.section(point)
    image = _image(curve, system, point, section, place)
    spec = spectrum(image)
    index = _critical(spec, place.event)
    nu = complex(spec.values[index])
    distance = _distance(nu, place.event)
    if distance > _CRITICAL or (place.event is Event.PAIR and abs(nu.imag) <= _CRITICAL):
        return None
    if place.event is not Event.PLUS:
        uncertain += distance
    bound = _value_error(curve, at, place, between, nu, uncertain + float(spec.error[index]), image)
    return _point(curve, system, section, point, place, image, spec, index, bound)


def _distance(nu: complex, event: Event) -> float:
    target = {Event.PLUS: 1.0, Event.MINUS: -1.0}.get(event)
    return abs(abs(nu) - 1.0) if target is None else abs(nu - target)


def _critical(spec: Spectrum, event: Event) -> int:
    if event is Event.PAIR:
        # Of the complex ones, the pair nearest the circle; if there are none, the nearest of all.
        distance = np.abs(np.abs(spec.values) - 1.0) + np.where(np.abs(spec.values.imag) > _CRITICAL, 0.0, 1.0)
        return int(distance.argmin())
    return int(np.abs(spec.values - (1.0 if event is Event.PLUS else -1.0)).argmin())


def _image(curve: Curve, system: SystemLike, point: BranchPoint, section: Section | None, place: Place) -> ReturnMap:
    """The return map with its error, that of the orbit included where it is a simple solution."""
    if place.event is not Event.PLUS:
        try:
            orbit = find_orbit(system, point.orbit, section=section)
        except AnalysisError:
            orbit = None
        sizes = curve.units(point.orbit.size)[:-1]
        if orbit is not None and float((np.abs(orbit.state - point.orbit) / sizes).max()) <= _SAME:
            return orbit.image
    return curve.image(point.orbit, point.value, section, with_error=True)


def _nearest(step: Step, nu: complex) -> complex:
    """The multiplier at the end of a step that is nearest to one."""
    values = np.linalg.eigvals(step.image.jacobian)
    return complex(values[np.abs(values - nu).argmin()])


def _interpolated(
    curve: Curve, at: Callable[[float], Step], place: float, between: tuple[float, float]
) -> tuple[BranchPoint, float]:
    """The point where a multiplier is +1, from orbits around it: there the equations are singular where branches meet.

    With it comes how far the multiplier may be off, as polynomials of higher and lower degree tell.
    """
    low, high = between
    width = _AROUND * (high - low)
    center = min(max(place, low + 3.0 * width), high - 3.0 * width)
    offsets = center - place + width * np.arange(-3.0, 4.0)
    offsets = offsets[np.abs(offsets) >= 0.4 * width]
    parts = [at(place + offset) for offset in offsets.tolist()]
    nu = np.array([_nearest(part, 1.0).real - 1.0 for part in parts])
    if not (np.diff(nu) > 0.0).all() and not (np.diff(nu) < 0.0).all():
        return at(place).end.last, 0.0  # it only touches 1, or another one comes near
    moved = np.array([part.moved for part in parts])
    # As functions of the multiplier, which passes +1 at zero: no root is to be looked for.
    scaled = nu / np.abs(nu).max()
    finer, coarser = (_at_zero(scaled[keep], moved[keep]) for keep in (slice(None), slice(1, -1)))
    start = parts[0].start.last
    units = curve.units(start.orbit.size)
    total = units * finer
    nearest = at(place).end.last
    point = replace(
        nearest, value=start.value + float(total[-1]), orbit=start.orbit + total[:-1], tangent=nearest.tangent
    )
    slope = float(np.abs(nu[-1] - nu[0])) / float(np.linalg.norm(moved[-1] - moved[0]))
    return point, slope * float(np.linalg.norm(finer - coarser))


def _at_zero(places: Array, values: Array) -> Array:
    """Lagrange's polynomial at zero."""
    weights = np.array([np.prod(-np.delete(places, i) / (x - np.delete(places, i))) for i, x in enumerate(places)])
    result: Array = weights @ values
    return result


def _value_error(
    curve: Curve,
    at: Callable[[float], Step],
    place: Place,
    between: tuple[float, float],
    nu: complex,
    uncertain: float,
    image: ReturnMap,
) -> float:
    """Bound on the error of the parameter: that of the multiplier over its rate of change along the curve, times that
    of the parameter; at a fold, where the parameter rests, that of the orbit's equation."""
    low, high = between
    beside = _SIDE * (high - low)
    left, here, right = (at(min(max(place.place + s * beside, low), high)) for s in (-1.0, 0.0, 1.0))
    length = right.size - left.size
    turn = abs if place.event is Event.PAIR else np.real
    slope = abs(float(turn(_nearest(right, nu)) - turn(_nearest(left, nu)))) / length
    values = [curve.scale * part.moved[-1] for part in (left, here, right)]
    rate = abs(values[2] - values[0]) / length
    bend = abs(values[2] - 2.0 * values[1] + values[0]) / (0.5 * length) ** 2
    along = _SAFETY * uncertain / slope if slope > 0.0 else np.inf
    error = 0.5 * bend * along**2 if place.fold else rate * along + bend * along**2
    if place.fold:
        error += _fold_error(curve, here, image)
    return float(error + 4.0 * np.finfo(float).eps * abs(here.end.last.value))


def _fold_error(curve: Curve, here: Step, image: ReturnMap) -> float:
    """left . (H - x) = 0 fixes the parameter at a fold to first order; x itself enters in second order only."""
    x = here.end.last.orbit
    sizes = curve.units(x.size)[:-1]
    matrix = here.matrix[:-1]
    left = np.linalg.svd(matrix[:, :-1])[0][:, -1]
    wrong = image.error if isinstance(image.error, np.ndarray) else np.full((x.size, x.size), image.error)
    off = (np.abs(image.state - x) + wrong @ np.maximum(np.abs(x), sizes)) / sizes
    slope = abs(float(left @ matrix[:, -1]))
    return curve.scale * _SAFETY * float(np.abs(left) @ off) / slope if slope > 0.0 else np.inf


def _point(
    curve: Curve,
    system: SystemLike,
    section: Section | None,
    point: BranchPoint,
    place: Place,
    image: ReturnMap,
    spec: Spectrum,
    index: int,
    bound: float,
) -> BranchPoint:
    nu = complex(spec.values[index])
    mode, left = phased(spec.right[:, index], spec.left[:, index])
    if place.event is not Event.PAIR:
        mode, left = mode.real.astype(np.complex128), left.real.astype(np.complex128)
    frequency = 0.0
    multiplier = {Event.PLUS: 1.0 + 0j, Event.MINUS: -1.0 + 0j}.get(place.event, nu / abs(nu))
    if place.event is Event.PAIR:
        angle = float(np.angle(np.exp(1j * image.returns * np.angle(nu))))
        if angle < 0.0:  # of a conjugate pair, the mode that turns with positive frequency
            nu, multiplier, mode, left, angle = nu.conjugate(), multiplier.conjugate(), mode.conj(), left.conj(), -angle
        frequency = angle / image.period
    form = _form(curve, system, section, point, image, multiplier, mode, left)
    kind = _kind(system, image, place, mode.real, form)
    if kind is Kind.PERIOD_DOUBLING:
        frequency = np.pi / image.period
    found = BifurcationPoint(kind, point.value, bound, point.orbit, mode, nu, frequency, period=image.period)
    if form is not None:
        found = with_coefficients(found, form)
    return replace(point, special=kind, bifurcation=found)


def _kind(system: SystemLike, image: ReturnMap, place: Place, mode: Array, form: NormalForm | None) -> Kind:
    if place.event is Event.PAIR:
        return Kind.NEIMARK_SACKER
    if place.event is Event.MINUS:
        return Kind.PERIOD_DOUBLING if image.returns % 2 else Kind.PITCHFORK
    if place.fold:
        return Kind.FOLD
    if any(float(np.abs(matrix @ mode + mode).max()) < _SAME for matrix in spatial_symmetries(system)):
        return Kind.PITCHFORK
    return Kind.BRANCH_POINT if form is None else kind_at_plus_one(form)


def _form(
    curve: Curve,
    system: SystemLike,
    section: Section | None,
    point: BranchPoint,
    image: ReturnMap,
    multiplier: complex,
    mode: ComplexArray,
    left: ComplexArray,
) -> NormalForm | None:
    """The normal form; None where the map cannot be evaluated as it would take."""
    critical = CriticalOrbit(point.orbit, image.jacobian, multiplier, mode, left, image.returns)
    uncertainty = float(np.max(image.error)) / float(np.linalg.norm(image.jacobian))
    sizes = curve.units(point.orbit.size)[:-1]

    def mapped(states: Array) -> Array:
        curve.left -= len(states)
        if curve.left <= 0:
            raise AnalysisError("the budget is spent", field="budget")
        return returned_states(system, states, section)

    try:
        return normal_form(mapped, critical, uncertainty=uncertainty, scale=sizes)
    except (AnalysisError, ValueError, np.linalg.LinAlgError):
        return None
