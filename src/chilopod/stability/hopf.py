"""Hopf points: where an equilibrium changes stability by a pair of eigenvalues, and a cycle leaves it.

Equilibria are fixed points of the map x -> x + h phi(h A) f(x), phi(z) = (e^z - 1)/z, with A the derivative of f at x:
a step of the exponential Euler method (Hochbruck & Ostermann, Acta Numerica 19, 2010). Its derivative there is e^(h A),
so an eigenvalue on the imaginary axis is a multiplier on the unit circle, and :func:`chilopod.stability.locate` finds
all of them. Values, errors and coefficients are then computed from f itself.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.asked import Asking
from chilopod.stability.capabilities import (
    Autonomous,
    Family,
    SystemLike,
    expands_velocity,
    given_scale,
    spatial_symmetries,
)
from chilopod.stability.equilibria import Equilibrium, autonomous, find_equilibrium, hopf_form, linear_part
from chilopod.stability.locate import BUDGET, Located, checked_interval, locate
from chilopod.stability.points import BifurcationPoint, Criticality, Kind
from chilopod.stability.scales import numerical_balance
from chilopod.stability.system import PeriodicSystem

Array = NDArray[np.float64]

_EPSILON = float(np.finfo(float).eps)
_BESIDE = 1e-5  # of the interval: where the rate of an eigenvalue is taken, by central differences
_KNOWN = 1e-3  # of the interval: how sure a value has to be for a coefficient
_WORDS = (
    ("a multiplier is +1", "an eigenvalue is 0"),
    ("multipliers come in pairs with product 1", "eigenvalues come in pairs with sum 0"),
    ("multiplier", "eigenvalue"),
    ("an orbit", "an equilibrium"),
    ("orbits", "equilibria"),
    ("orbit", "equilibrium"),
)


def locate_hopf(
    family: Family,
    between: tuple[float, float],
    equilibrium: ArrayLike,
    budget: int = BUDGET,
    seconds: float = math.inf,
) -> Located:
    """Find every Hopf point of an equilibrium in an interval of a parameter.

    Parameters
    ----------
    family
        ``family(value)`` is the system at a value of the parameter, which must not depend on time.
    between
        The interval, ``low < high``.
    equilibrium
        A guess of the equilibrium for ``low``, shape (n,); it is then followed through the interval. A fold ends the
        search, with a remark.
    budget, seconds
        As for :func:`chilopod.stability.locate`, of equilibria.

    Returns
    -------
    Hopf points by rising parameter, ``orbit`` the equilibrium, ``multiplier`` the eigenvalue i ``frequency``,
    ``coefficient`` the first Lyapunov coefficient along the unit ``mode``; other bifurcations of the equilibrium are
    remarks. :func:`chilopod.stability.switch` starts the cycles.

    Raises
    ------
    ParameterError
        If the interval or the guess is none, or the systems depend on time.
    AnalysisError
        If there is no equilibrium at the lower end of the interval, or ``family`` raises an exception there.
    """
    low, high = checked_interval(between)
    with Asking("family", low):
        system = autonomous(family(low))
        start = find_equilibrium(system, equilibrium)
    duration, scale = _duration(start, system.guess_period), _scale(system, start)
    found = locate(
        lambda value: _resting(family(value), duration, scale),
        (low, high),
        start.state,
        normal_form=False,
        budget=budget,
        seconds=seconds,
    )
    points, remarks = [], [_of_equilibria(remark) for remark in found.remarks]
    for point in found:
        if point.kind is not Kind.NEIMARK_SACKER:
            remarks.append(_remark(point))
        elif point.multiplicity > 2:
            remarks.append(f"{point.multiplicity // 2} pairs are critical at once at {point.value:.9g}: no coefficient")
            points.append(_plain(point, duration))
        else:
            try:
                points.append(_hopf_point(family, (low, high), point, duration))
            except AnalysisError as reason:
                remarks.append(f"no coefficient at {point.value:.9g}: {reason.problem}")
                points.append(_plain(point, duration))
    return Located(tuple(points), found.status, tuple(dict.fromkeys(remarks)), found.evaluations)


def _duration(start: Equilibrium, guess_period: float) -> float:
    """The step h of the map: a radian of the fastest oscillation or growth, so that no multiplier is lost, or about the
    time of the decays."""
    values = start.eigenvalues
    fastest = float(np.maximum(np.abs(values.imag), values.real).max())
    if fastest > 0.0:
        return 1.0 / fastest
    sizes = np.abs(values[values != 0.0])
    return float(np.exp(-np.log(sizes).mean())) if sizes.size else guess_period / (2.0 * np.pi)


def _scale(system: Autonomous, start: Equilibrium) -> Array | None:
    """Sizes of the states, shape (n,), where an equilibrium at zero does not tell them: those at which terms of second
    or third order of the right-hand side are as large as the linear ones along some directions."""
    given = given_scale(system)
    if given is not None or start.state.any() or not expands_velocity(system):
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
    """The map of which the equilibria of a system are the fixed points."""
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
        # A relative error of the exponent is one of its norm times as much (Higham, Functions of Matrices, ch. 10).
        error = 16.0 * _EPSILON * (1.0 + float(np.abs(scaled).sum(axis=1).max())) * float(np.abs(power[:n, :n]).max())
        ratios = units[:, None] / units
        return x + units * power[:n, n], power[:n, :n] * ratios, error * ratios

    symmetries = spatial_symmetries(checked)
    return PeriodicSystem(
        n,
        duration,
        lambda x, t0, t1: flow_with_error(x, t0, t1)[:2],
        spatial_symmetry=np.stack(symmetries) if symmetries else None,
        scale=scale,
        flow_with_error=flow_with_error,
    )


def _hopf_point(
    family: Family, between: tuple[float, float], point: BifurcationPoint, duration: float
) -> BifurcationPoint:
    """A Hopf point from that of the map: its value by f itself, its error, its rate and coefficient."""
    low, high = between
    value, state = point.value, point.orbit
    rate, frequency = _rate(family, between, point, duration)
    for correcting in (True, True, False):  # the search has found it almost to the last digit
        with Asking("family", value):
            system = autonomous(family(value))
            here = find_equilibrium(system, state)
        index = int(np.abs(here.eigenvalues - 1j * frequency).argmin())
        state, frequency = here.state, float(here.eigenvalues[index].imag)
        off = float(here.eigenvalues[index].real)
        if correcting:
            value = min(max(value - off / rate.real, low), high)
    bound = (abs(off) + float(here.error_bounds[index])) / abs(rate.real) + 4.0 * _EPSILON * abs(value)
    if not bound <= _KNOWN * (high - low):
        raise AnalysisError("its eigenvalues are not known well enough", field="family", value=value)
    form = hopf_form(system, here.state, here.error, frequency)
    wrong = form.error + bound * _change(family, between, value, form.eigenvalue, here.state)
    coefficient, error = form.cubic.real / frequency, wrong / frequency
    decided = Criticality.SUPERCRITICAL if coefficient < 0.0 else Criticality.SUBCRITICAL
    return BifurcationPoint(
        Kind.HOPF,
        value,
        bound,
        here.state,
        form.mode,
        1j * frequency,
        frequency,
        criticality=decided if abs(coefficient) > error else Criticality.UNDECIDED,
        coefficient=coefficient,
        coefficient_error=error,
        period=2.0 * np.pi / frequency,
        multiplicity=2,
        symmetry=point.symmetry,
        rate=rate,
    )


def _rate(
    family: Family, between: tuple[float, float], point: BifurcationPoint, duration: float
) -> tuple[complex, float]:
    """How fast the critical eigenvalue moves, left^H dA mode, which holds however near others are, and its imaginary
    part."""
    low, high = between
    beside = _BESIDE * (high - low)
    values = np.clip([point.value - beside, point.value + beside], low, high)
    found = []
    for each in values.tolist():
        with Asking("family", each):
            found.append(find_equilibrium(family(each), point.orbit))
    matrices = [each.jacobian for each in found]
    matrix = 0.5 * (matrices[0] + matrices[1])
    units = numerical_balance(matrix)
    ratios = units / units[:, None]
    eigenvalues, lefts, rights = scipy.linalg.eig(matrix * ratios, left=True)
    upper = np.where(eigenvalues.imag > 0.0, np.abs(np.exp(duration * eigenvalues) - point.multiplier), np.inf)
    index = int(upper.argmin())
    frequency = float(eigenvalues[index].imag)
    sides = [float(each.eigenvalues[np.abs(each.eigenvalues - 1j * frequency).argmin()].real) for each in found]
    if low < values[0] and values[1] < high and sides[0] * sides[1] > 0.0:
        raise AnalysisError("the pair only touches the imaginary axis", field="family", value=point.value)
    left, right = lefts[:, index].conj(), rights[:, index]
    change = left @ ((matrices[1] - matrices[0]) * ratios) @ right / (left @ right)
    return complex(change / (values[1] - values[0])), frequency


def _change(family: Family, between: tuple[float, float], value: float, eigenvalue: complex, state: Array) -> float:
    """How fast the real part of the cubic coefficient changes with the parameter."""
    values = np.clip(value + _BESIDE * (between[1] - between[0]) * np.array([-1.0, 1.0]), *between)
    found = []
    for each in values.tolist():
        with Asking("family", each):
            system = autonomous(family(each))
            here = find_equilibrium(system, state)
            found.append(hopf_form(system, here.state, here.error, eigenvalue.imag).cubic.real)
    return abs(found[1] - found[0]) / float(values[1] - values[0])


def _plain(point: BifurcationPoint, duration: float) -> BifurcationPoint:
    """A Hopf point of which no more is known than the map tells."""
    frequency = float(np.angle(point.multiplier)) / duration
    return replace(
        point, kind=Kind.HOPF, multiplier=1j * frequency, frequency=frequency, period=2.0 * np.pi / frequency
    )


def _remark(point: BifurcationPoint) -> str:
    """What happens to an equilibrium where it has no Hopf point."""
    if point.kind is Kind.FOLD:
        what = "the equilibrium ends in a fold: it meets another one and both vanish"
    elif point.kind is Kind.KREIN_COLLISION:
        what = "two pairs of eigenvalues meet on the imaginary axis and leave it"
    else:
        what = f"an eigenvalue is zero ({point.kind.label}): another equilibrium meets this one"
    return f"{what}, at {point.value:.9g} (± {point.error_bound:.1e})"


def _of_equilibria(remark: str) -> str:
    """A remark of a search for orbits, of equilibria."""
    for word, other in _WORDS:
        remark = remark.replace(word, other)
    return remark
