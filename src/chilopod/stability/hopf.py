"""Hopf points: an equilibrium changes stability by a pair of eigenvalues, and a cycle leaves it.

Equilibria are fixed points of the map x -> x + h phi(h A) f(x), phi(z) = (e^z - 1)/z, with A the derivative of f at x:
a step of the exponential Euler method (Hochbruck & Ostermann, Acta Numerica 19, 2010). Its derivative there is e^(h A),
so an eigenvalue on the imaginary axis is a multiplier on the unit circle, and the search for crossings of multipliers
applies to equilibria. Values, errors and coefficients are then computed from f.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError, ChilopodError
from chilopod.flows.arguments import UserCode, check_arguments, checked_interval
from chilopod.flows.carrying import numerical_balance
from chilopod.flows.deadline import Deadline, SpentError
from chilopod.frozen import Array, ComplexArray
from chilopod.stability.crossing_place import Course, place_error
from chilopod.stability.equilibria import ROUNDING, Equilibrium, autonomous, equilibrium_at, hopf_form, linear_part
from chilopod.stability.interface import Autonomous, Family, SystemLike, offers
from chilopod.stability.points import BifurcationPoint, Criticality, Kind
from chilopod.stability.search.locate import Found, Located, joined, located
from chilopod.stability.search.samples import Samples
from chilopod.stability.shown import bounded
from chilopod.stability.spectrum import EPSILON
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.system import PeriodicSystem
from chilopod.stability.unit_circle.crossings import BUDGET, Crossings, SearchStatus, find_crossings, first_values
from chilopod.stability.unit_circle.spectra import CircleEvent, Crossing

_LARGEST = 1e150  # growth within a guessed period: its square is a number still
_FASTEST = np.pi  # largest exponent of a growth or an oscillation in a step: half a turn
_REACH = 10.0  # largest exponent of the slowest decay in a step, as it may become a growth elsewhere
_POINTS = 2000  # budget of return maps beside a point: those of the map cost almost nothing
_BESIDE = 1e-5  # step of central differences for the rate of an eigenvalue, relative to the interval
_KNOWN = 1e-3  # largest error of a value for a coefficient, relative to the interval
_KEPT = 64  # cached systems
_WIDE, _SHORTER = 3.7, 0.25  # ratio of the ends of a piece, on no round number, and factor on its width after a failure
_NARROWEST = 1e-6  # width, relative to the interval, below which a piece is not made shorter
_LEAST = 50  # least budget of a piece
_WORDS = (  # for orbits and multipliers, and for equilibria and eigenvalues in their place
    ("a multiplier is +1", "an eigenvalue is 0"),
    ("a multiplier", "an eigenvalue"),
    ("multipliers come in pairs with product 1", "eigenvalues come in pairs with sum 0"),
    ("the unit circle", "the imaginary axis"),
    ("the circle", "the imaginary axis"),
    ("outside", "to the right of it"),
    ("multiplier", "eigenvalue"),
    ("an orbit", "an equilibrium"),
    ("orbits", "equilibria"),
    ("orbit", "equilibrium"),
)


def locate_hopf(
    family: Family, between: tuple[float, float], equilibrium: ArrayLike, budget: int = BUDGET, seconds: float = inf
) -> Located:
    """Find every Hopf point of an equilibrium in an interval of a parameter.

    Parameters
    ----------
    family
        ``family(value)`` is the system at a value of the parameter, which must not depend on time.
    between
        The interval, ``low < high``.
    equilibrium
        Guess of the equilibrium at ``low``, shape (n,), which is then followed; a fold ends that, with a remark.
    budget, seconds
        Limits as for :func:`chilopod.stability.locate`, with equilibria for orbits; so are the errors.

    Returns
    -------
    Hopf points by rising parameter, ``orbit`` the equilibrium, ``multiplier`` the eigenvalue i ``frequency``,
    ``coefficient`` the first Lyapunov coefficient along the unit ``mode``; other bifurcations of the equilibrium are
    remarks. :func:`chilopod.stability.switch` starts the cycles.
    """
    low, high = checked_interval(between)
    check_arguments(family=family, budget=budget)
    family, limit = functools.lru_cache(_KEPT)(family), Deadline(seconds)
    pieces: list[Located] = []
    at, state, left = low, equilibrium, budget
    while at < high and not (pieces and (left < _LEAST or limit.late)):
        end = min(high, _WIDE * at) if at > 0.0 else high
        try:
            found, samples = _piece(family, (at, end), state, left, limit)
            while found.ending and found.status is SearchStatus.INCOMPLETE and end - at > _NARROWEST * (high - low):
                left, end = left - found.evaluations, at + _SHORTER * (end - at)
                found, samples = _piece(family, (at, end), state, max(left, _LEAST), limit)
        except SpentError:
            if not pieces:
                raise
            break
        left, last = left - found.evaluations, samples.path[-1]
        pieces.append(found)
        if last.value < samples.high:  # a fold, or the search cannot go on
            break
        at, state = last.value, last.orbit
    found = joined(pieces)
    status, remarks = found.status, list(found.remarks)
    if last.value == at < high and not pieces[-1].ending:
        status = SearchStatus.BUDGET
        limited = "the time (`seconds`) was" if limit.late else "the equilibria (`budget`) were"
        remarks.append(f"{limited} spent before the orbit was followed beyond {at:.9g}")
    said, ending = tuple(dict.fromkeys(map(_of_equilibria, remarks))), _of_equilibria(found.ending)
    points = tuple(replace(each, between=(low, high)) for each in found)
    if any(each.rate is None and each.multiplicity <= 2 for each in points):
        status = status.worst(SearchStatus.INCOMPLETE)
    return replace(found, points=points, status=status, remarks=said, evaluations=budget - left, ending=ending)


def _piece(
    family: Family, between: tuple[float, float], equilibrium: ArrayLike, budget: int, limit: Deadline
) -> tuple[Located, Samples]:
    """Hopf points in the part of an interval in which rates do not outgrow those at its start, and its equilibria."""
    low = between[0]
    with Deadline(limit.remaining):
        system, start = equilibrium_at(family, low, equilibrium)
        duration = _duration(start, system.guess_period)
        high = _suited(family, between, start, duration)
    scale = _scale(system, start)
    samples = Samples(lambda v: _resting(family(v), duration, scale), start.state, low, high, budget, limit.remaining)

    def matrices(values: Array) -> tuple[Array, Array]:
        found = samples.at(values)
        errors = [_error(autonomous(family(each.value)), each.orbit, samples.size, duration) for each in found]
        return np.stack([each.image.jacobian for each in found]), np.array(errors)

    def crossings(start: float, end: float) -> list[tuple[Block | None, Crossings]]:
        known = samples.within(start, end)
        return [(None, find_crossings(matrices, start, end, budget=budget, affordable=samples.affordable, known=known))]

    def described(crossing: Crossing, _: Block | None) -> list[Found]:
        if crossing.event is CircleEvent.PLUS:
            _check_zero(family, between, crossing, samples)
            many = "an eigenvalue is" if crossing.multiplicity == 1 else f"{crossing.multiplicity} eigenvalues are"
            return [f"{many} zero at {crossing.value:.9g}: another equilibrium meets this one"]
        if crossing.collision:
            return [f"two pairs meet on the imaginary axis and leave it at {crossing.value:.9g}"]
        point = _of_map(samples, crossing, matrices, duration)
        reason = f"{point.multiplicity // 2} pairs are critical at once"
        if point.multiplicity <= 2:
            try:
                return [_of_f(family, between, point, duration)]
            except AnalysisError as error:
                reason = error.problem
        if not point.error_bound < samples.width:
            raise AnalysisError(f"its error bound of {point.error_bound:.1e} is too large", field="value")
        return [f"no coefficient at {point.value:.9g}: {reason}", replace(point, multiplier=1j * point.frequency)]

    def ended(fold: BifurcationPoint) -> str:
        where = bounded(fold.value, fold.error_bound)
        return f"the equilibrium ends in a fold at {where}: it meets another one there"

    return located(samples, crossings, described, ended, _POINTS), samples


def _check_zero(family: Family, between: tuple[float, float], crossing: Crossing, samples: Samples) -> None:
    """Refuse a crossing at zero if no eigenvalue of f is zero there, or if a complex pair passes."""
    (sample,) = samples.at(np.array([crossing.value]))
    try:
        beside = np.clip(crossing.value + _BESIDE * (between[1] - between[0]) * np.array([-1.0, 0.0, 1.0]), *between)
        found = [equilibrium_at(family, each, sample.orbit)[1] for each in beside.tolist()]
    except AnalysisError:  # the equilibrium ends there
        return
    clear = [float((np.abs(each.eigenvalues) - each.error_bounds).min()) for each in found]
    if clear[1] > 0.5 * max(clear):  # one that passes zero there is much smaller
        raise AnalysisError("the search resolves no eigenvalue there, and none of f is zero", field="family")
    turning = [(np.abs(each.eigenvalues.imag) > each.error_bounds)[np.abs(each.eigenvalues).argmin()] for each in found]
    if crossing.change and turning[0] and turning[2]:
        raise AnalysisError("a pair of eigenvalues passes zero, where no cycle has a frequency", field="family")


def _of_map(
    samples: Samples, crossing: Crossing, matrices: Callable[[Array], tuple[Array, Array]], duration: float
) -> BifurcationPoint:
    """A Hopf point from the map alone."""
    (sample,) = samples.at(np.array([crossing.value]))
    relative = float(matrices(np.array([crossing.value]))[1][0])
    units = numerical_balance(sample.image.jacobian)
    ratios = units / units[:, None]
    image = replace(sample.image, error=relative * float(np.abs(sample.image.jacobian * ratios).max()) / ratios)
    values, vectors = np.linalg.eig(image.jacobian)
    course = Course(samples.at, samples.low, samples.end, samples.width, _BESIDE * samples.width)
    frequency = abs(float(np.angle(crossing.multiplier))) / duration
    error = place_error(course, crossing, image) + 4.0 * EPSILON * abs(crossing.value)
    mode = vectors[:, np.abs(values - crossing.multiplier).argmin()].astype(np.complex128)
    at = BifurcationPoint(Kind.HOPF, crossing.value, error, sample.orbit, mode, crossing.multiplier, frequency)
    return replace(at, period=2.0 * np.pi / frequency, multiplicity=crossing.multiplicity)


def _error(system: Autonomous, x: Array, size: Array, duration: float) -> float:
    """Relative error of the derivative of the map, in units that balance the states: error of the exponential (by the
    norm of the exponent, as Higham, *Functions of Matrices*, chapter 10), and of the rounding of the state, magnified
    where the derivative of f is nearly singular."""
    velocity, matrix, wrong = linear_part(system, x)
    units = numerical_balance(matrix)
    ratios = units / units[:, None]
    rounding = (np.abs(velocity) + ROUNDING * (np.abs(matrix) @ np.abs(x))) / units
    _, values, rows = np.linalg.svd(matrix * ratios)
    most = float((size / units).max())
    reach, steepest = float(np.linalg.norm(rounding)), max(float(values[0]), 1e-300)
    # Where it is singular, terms of second or third order fix the state.
    off = np.minimum(reach / np.maximum(values, 1e-300), most * np.cbrt(reach / (steepest * most)))
    # Of two directions that are alike the derivative may change along one alone: two sums of all differ in these.
    beside = [linear_part(system, x + units * (signs * off @ rows))[1] for signs in (1.0, (-1.0) ** np.arange(x.size))]
    moved = float(np.linalg.norm((sum(np.abs(each - matrix) for each in beside) + wrong) * ratios))
    return 4.0 * EPSILON * (1.0 + duration * float(np.linalg.norm(matrix * ratios))) + duration * moved


def _duration(start: Equilibrium, guess_period: float) -> float:
    """The step h of the map: a radian of the fastest oscillation or growth, or about the time of the decays."""
    values = start.eigenvalues
    fastest = _fastest(values)
    if fastest > 0.0:
        return 1.0 / max(fastest, float(np.abs(values.real).min()) / _REACH)
    sizes = np.abs(values[values != 0.0])
    return float(np.exp(-np.log(sizes).mean())) if sizes.size else guess_period / (2.0 * np.pi)


def _suited(family: Family, between: tuple[float, float], start: Equilibrium, duration: float) -> float:
    """An end of an interval, as high as it may be, up to which the step suits the rates of an equilibrium."""
    low, end = between
    while True:
        reached, state = low, start.state
        try:
            for value in first_values(low, end)[1:].tolist():
                here = equilibrium_at(family, value, state)[1]
                if duration * _fastest(here.eigenvalues) > _FASTEST:
                    break
                reached, state = value, here.state
            else:
                return end
        except ChilopodError:  # the search finds out
            return end
        if reached > low or end - low <= _NARROWEST * (between[1] - low):
            return reached if reached > low else end
        end = low + _SHORTER * (end - low)


def _fastest(values: ComplexArray) -> float:
    """Rate of the fastest oscillation or growth."""
    return float(np.maximum(np.abs(values.imag), values.real).max())


def _scale(system: Autonomous, start: Equilibrium) -> Array | None:
    """Sizes of the states, shape (n,), for an equilibrium at zero: there the terms of second or third order of the
    right-hand side are as large as the linear ones along some directions."""
    given = getattr(system, "scale", None)
    if given is not None or start.state.any() or not offers(system, "velocity_series"):
        return given
    n = start.state.size
    units = numerical_balance(start.jacobian)
    curves = np.zeros((n, 4, n))
    curves[:, 1] = units * np.cos(np.outer(np.arange(1.0, n + 1.0), np.arange(n)))
    with np.errstate(all="ignore"):
        linear, *others = np.linalg.norm(system.velocity_series(curves) / units, axis=2).T[1:]
        reaches = np.array([(linear / other) ** (1.0 / order) for order, other in enumerate(others, 1)])
    reaches = reaches[np.isfinite(reaches) & (reaches > 0.0)]
    return units * float(reaches.min()) if reaches.size else None


def _resting(system: SystemLike, duration: float, scale: Array | None) -> PeriodicSystem:
    """The map whose fixed points are the equilibria of a system."""
    checked = autonomous(system)
    n = checked.dimension

    def flow_with_error(x: Array, t0: float, t1: float) -> tuple[Array, Array, Array]:
        velocity, matrix, _ = linear_part(checked, x)
        units = numerical_balance(matrix)
        scaled = (t1 - t0) * matrix * units / units[:, None]
        both = np.zeros((n + 1, n + 1))
        both[:n, :n], both[:n, n] = scaled, (t1 - t0) * velocity / units
        with np.errstate(all="ignore"):
            power = scipy.linalg.expm(both)
        if not np.abs(power).max() < _LARGEST:  # NaN too
            raise AnalysisError("a disturbance grows too much within the guessed period", field="equilibrium")
        # The norm of the exponent multiplies its relative error (Higham, Functions of Matrices, ch. 10).
        error = 16.0 * EPSILON * (1.0 + float(np.abs(scaled).sum(axis=1).max())) * float(np.abs(power[:n, :n]).max())
        ratios = units[:, None] / units
        return x + units * power[:n, n], power[:n, :n] * ratios, error * ratios

    return PeriodicSystem(
        n,
        duration,
        lambda x, t0, t1: flow_with_error(x, t0, t1)[:2],
        scale=scale,
        flow_with_error=flow_with_error,
        flow_events=lambda x, t0, t1: np.empty(0),
    )


def _of_f(family: Family, between: tuple[float, float], point: BifurcationPoint, duration: float) -> BifurcationPoint:
    """A Hopf point from that of the map, with value, error, rate and coefficient from f."""
    low, high = between
    value, state = point.value, point.orbit
    values = np.clip(value + _BESIDE * (high - low) * np.array([-1.0, 1.0]), low, high)
    beside = [equilibrium_at(family, each, state) for each in values.tolist()]
    rate, frequency = _rate(values, [here for _, here in beside], between, point, duration)
    for correcting in (True, True, False):  # the search gives almost the last digit
        system, here = equilibrium_at(family, value, state)
        index = int(np.abs(here.eigenvalues - 1j * frequency).argmin())
        state, frequency = here.state, float(here.eigenvalues[index].imag)
        off = float(here.eigenvalues[index].real)
        if correcting:
            value = min(max(value - off / rate.real, low), high)
    bound = (abs(off) + float(here.error_bounds[index])) / abs(rate.real) + 4.0 * EPSILON * abs(value)
    if not bound <= _KNOWN * (high - low):
        raise AnalysisError("the eigenvalues are not accurate enough", field="family", value=value)
    form = hopf_form(system, here.state, here.error, frequency)
    with UserCode("family", value):
        cubics = [hopf_form(there, each.state, each.error, frequency).cubic.real for there, each in beside]
    wrong = form.error + bound * abs(cubics[1] - cubics[0]) / float(values[1] - values[0])
    coefficient, error = form.cubic.real / frequency, wrong / frequency
    decided = Criticality.SUPERCRITICAL if coefficient < 0.0 else Criticality.SUBCRITICAL
    verdict = decided if abs(coefficient) > error else Criticality.UNDECIDED
    about: dict[str, Any] = {"criticality": verdict, "coefficient": coefficient, "coefficient_error": error}
    about |= {"mode": form.mode, "multiplier": 1j * frequency, "frequency": frequency, "rate": rate}
    about |= {"value": value, "error_bound": bound, "orbit": here.state, "period": 2.0 * np.pi / frequency}
    return replace(point, **about)


def _rate(
    values: Array, found: list[Equilibrium], between: tuple[float, float], point: BifurcationPoint, duration: float
) -> tuple[complex, float]:
    """Rate of the critical eigenvalue, left^H dA mode, also near others, and its imaginary part, from both sides."""
    matrices = [each.jacobian for each in found]
    matrix = 0.5 * (matrices[0] + matrices[1])
    units = numerical_balance(matrix)
    ratios = units / units[:, None]
    eigenvalues, lefts, rights = scipy.linalg.eig(matrix * ratios, left=True)
    upper = np.where(eigenvalues.imag > 0.0, np.abs(np.exp(duration * eigenvalues) - point.multiplier), np.inf)
    index = int(upper.argmin())
    frequency = float(eigenvalues[index].imag)
    sides = [float(each.eigenvalues[np.abs(each.eigenvalues - 1j * frequency).argmin()].real) for each in found]
    if between[0] < values[0] and values[1] < between[1] and sides[0] * sides[1] > 0.0:
        said = "the pair only touches the imaginary axis, or crosses it twice close together"
        raise AnalysisError(said, field="family", value=point.value)
    left, right = lefts[:, index].conj(), rights[:, index]
    change = left @ ((matrices[1] - matrices[0]) * ratios) @ right / (left @ right)
    return complex(change / (values[1] - values[0])), frequency


def _of_equilibria(remark: str) -> str:
    """A remark on orbits in words for equilibria."""
    for word, other in _WORDS:
        remark = remark.replace(word, other)
    return remark
