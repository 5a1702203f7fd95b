"""Starts of branches: at a known orbit, or at a bifurcation point of another branch.

A ``Start`` is a place and a direction. ``begin`` makes one at an orbit, ``switch`` those of the branches that leave a
point. To follow one, ``branch_sizes`` gives the units of the states and ``anchored`` the first point with its tangent:
along the curve through the orbit (``_along``), along a critical mode, or, where the mode does not suffice, along the
second of two curves that cross (``_other``).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError, ChilopodError, ParameterError
from chilopod.flows.arguments import UserCode, check_arguments, finite_array
from chilopod.flows.deadline import Deadline
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.stability.branches.branch_points import IN_FOLD, Anchor, BranchPoint, symmetric_space, within_space
from chilopod.stability.branches.curve import Curve
from chilopod.stability.equilibria import find_equilibrium, hopf_cycle
from chilopod.stability.interface import (
    Family,
    SystemLike,
    checked_flow,
    is_autonomous,
    offers,
    returns_per_period,
    sizes,
    system_of,
)
from chilopod.stability.orbits.orbit import Orbit, known_state, past_event, searched_orbit, with_bounds
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.returns import Section, carried, return_duration, returned_states, whole_period

_CLOSES = 1e-6  # distance, relative to the sizes, at which an orbit closes
_CLOSING = "a point of a branch, or a system with its `spatial_symmetry`"
_ROUNDING = 1e-9  # size of a state, relative to that along the old branch, that is rounding
_RESTS = 0.01  # distance, relative to each state, within which a failed guess counts as an equilibrium
_BESIDE = 1e-3  # step of second differences, in units
_SINGULAR = 1e-9  # singular value, relative to the largest, below which another curve crosses
_BENT = 0.3  # relative departure of a map from its linear part that defines the size of a state
_BOUNDED = 0.03  # such a departure that no longer grows: half of it defines the size
_PARTS = 2.0**-8, 2.0**-4  # fractions of a return
_DECADES, _HALVINGS = 12, 12  # range and halvings of the search for the logarithm of a size

_LEFT_BY_NONE = {  # kinds of points without a branch to switch to, with the reason
    Kind.FOLD: "is a fold: `follow` passes it along the same branch",
    Kind.NEIMARK_SACKER: "is a Neimark-Sacker point: a torus leaves it, which cannot be followed",
    Kind.KREIN_COLLISION: "is a Krein collision: no periodic orbits leave it",
}


@dataclass(frozen=True, eq=False)
class Start(ReadOnlyArrays):
    """Start of a branch, with its direction.

    Attributes
    ----------
    value, orbit
        Value of the parameter, and state on the orbit at time 0, shape (n,).
    rising
        True if the parameter rises at first, along the curve through the orbit.
    mode
        Direction of the state, shape (n,), in which the branch leaves; ``rising`` is then unused. May be None.
    crossing
        True if the leaving branch also has a component along the parameter (transcritical).
    old
        Tangent of the old branch, shape (n+1,), in the states' and the parameter's own units, if known.
    periods, period
        Number of the systems' periods in one period of its orbits, and period of the old orbit of one without its own.
    bifurcation
        Bifurcation point of the start, if any.
    outward
        Direction of the state, shape (n,), from the bifurcation point to a start beside it. May be None.
    sizes
        Sizes of the states along the old branch, shape (n,), if known.
    """

    value: float
    orbit: Array
    rising: bool = True
    mode: Array | None = None
    crossing: bool = False
    old: Array | None = None
    periods: int = 1
    period: float | None = None
    bifurcation: BifurcationPoint | None = None
    outward: Array | None = None
    sizes: Array | None = None


def begin(
    family: Family,
    value: float,
    orbit: ArrayLike | None = None,
    rising: bool = True,
    *,
    periods: int = 1,
    symmetric: bool = False,
    seconds: float = math.inf,
) -> Start:
    """The start of a branch at an orbit, towards a rising or falling parameter.

    Parameters
    ----------
    family, value
        The system is ``family(value)``.
    orbit
        State on the orbit or near it, shape (n,), or an AnalysisError; by default the system's known orbit.
    rising
        True to start towards rising parameters. At an end of its interval :func:`follow` starts inwards.
    periods, symmetric
        Number of the systems' periods in one period of the orbit, and True for one with the systems' symmetry in time.
    seconds
        Time, s, after which the search for the orbit ends.
    """
    check_arguments(family=family, rising=rising, periods=periods, symmetric=symmetric)
    value = float(finite_array(value, (), "value"))
    with Deadline(seconds), UserCode("family", value):
        system = system_of(family, value)
        check_symmetric(system, symmetric)
        guess = known_state(system) if orbit is None else orbit
        studied = system if symmetric else whole_period(system, periods)
        try:
            found = searched_orbit(studied, guess, with_error=False, shortest=periods == 1)
            found = past_event(studied, found.state, found.image.duration) or found
        except AnalysisError as error:
            _check_moving(system, guess)
            if error.field == "orbit":
                error.problem = f"at {value:.9g} {error.problem}"
            raise
        _check_periods(studied, found, periods)
    return Start(value, found.state, rising, periods=periods, period=found.period if is_autonomous(system) else None)


def check_symmetric(system: SystemLike, symmetric: bool) -> None:
    """Check that a system has a symmetry in time if its orbits are to have it."""
    if symmetric and system.symmetry is None:
        said = "must be False for systems without a symmetry in time"
        raise ParameterError(said, field="symmetric", value=True, allowed="systems with `symmetry`")


def _check_periods(system: SystemLike, found: Orbit, periods: int) -> None:
    """Check that an orbit over several periods does not close after fewer."""
    x, size = found.state, sizes(system, found.state, found.period)
    for count in (each for each in range(1, periods) if periods % each == 0):
        back = carried(system, x[None], 0.0, found.period * count / periods)[0]
        if (np.abs(back - x) <= _CLOSES * size).all():
            raise ParameterError("are more than the orbit has", field="periods", value=periods, allowed=f"{count}")


def _check_moving(system: SystemLike, guess: ArrayLike) -> None:
    """Check that a guess of an orbit is not an equilibrium, a frequent mistake."""
    if not is_autonomous(system):
        return
    try:
        x = finite_array(guess, (system.dimension,), "orbit")
        rest = find_equilibrium(system, x).state
    except ChilopodError:
        return
    if (np.abs(x - rest) <= _RESTS * np.maximum(np.abs(x), np.abs(rest))).all():
        said = "is an equilibrium, not an orbit"
        allowed = "a state on an orbit; locate_hopf, then switch, find the cycles of an equilibrium"
        raise AnalysisError(said, field="orbit", allowed=allowed)


def switch(
    family: Family, point: BifurcationPoint | BranchPoint, *, periods: int | None = None, seconds: float = math.inf
) -> tuple[Start, ...]:
    """The starts of the branches that leave a bifurcation point; a ParameterError if none that can be followed does.

    Parameters
    ----------
    family
        Family given to :func:`chilopod.stability.locate` or :func:`chilopod.stability.follow`.
    point
        Located point, special point on a branch, or Hopf point from :func:`chilopod.stability.locate_hopf`.
    periods
        Number of the systems' periods in one period of the old branch's orbits, if the point does not tell.
    seconds
        Time, s, after which the search for an orbit ends.

    Returns
    -------
    A pitchfork has two: along the critical mode and against it. A transcritical point and a branch point have two: the
    directions of the other branch. A period doubling has one: its two sides are the same orbits, a period apart. A Hopf
    point has one, at a small cycle on the side where cycles exist, towards larger ones. With several critical modes,
    due to a symmetry, these numbers hold for each of ``point.modes``. A collision at -1 is a period doubling,
    one at +1 a branch point. Several modes without axial branches do not determine directions and are refused, as those
    of a collision whose multipliers have an eigenvector each.
    """
    check_arguments(family=family, periods=1 if periods is None else periods)
    old, known, along = None, None, None
    if isinstance(point, BranchPoint):
        if point.bifurcation is None:
            raise ParameterError("must be a special point", field="point", value=point.value)
        # At the start of a branch of doubled period the point belongs to the orbits that it leaves.
        halved = point.period is not None and point.bifurcation.period < 0.75 * point.period
        old, known, along = point.tangent * point.units, point.periods // (2 if halved else 1), point.units[:-1]
        point = point.bifurcation
    if not isinstance(point, BifurcationPoint):
        raise ParameterError("must be a located point", field="point", value=point, allowed="a point from `locate`")
    if point.kind in _LEFT_BY_NONE:
        raise ParameterError(_LEFT_BY_NONE[point.kind], field="point", value=point.value)
    if point.kind is Kind.HOPF:
        with Deadline(seconds):
            value, cycle, outward = hopf_cycle(family, point)
        return (Start(value, cycle.state, value > point.value, period=cycle.period, outward=outward),)
    period = None
    with Deadline(seconds), UserCode("family", point.value):
        system = system_of(family, point.value)
        finite_array(point.orbit, (system.dimension,), "point")
        own = np.nan if system.period is None else point.period / system.period
        known = known or (max(1, round(own)) if np.isfinite(own) else 1)
        periods = known if periods is None else int(periods)
        if is_autonomous(system):
            # The point knows its period; a search may find another orbit of a family by energy.
            period = point.period * periods / known
    at = Start(point.value, point.orbit, old=old, periods=periods, period=period, bifurcation=point, sizes=along)
    return _along_modes(at, point, returns_per_period(system))


def _along_modes(at: Start, point: BifurcationPoint, returns: int) -> tuple[Start, ...]:
    """The starts at a point along its critical modes, for a number of returns in a period."""
    kind, axes = point.kind, 0 if point.symmetry is None else len(point.symmetry.branches)
    modes = point.mode.real[None] if point.modes is None else point.modes.real.T
    if len(modes) > max(axes, 1):
        said = f"has {len(modes)} critical modes, which do not determine the directions of new orbits"
        raise ParameterError(said, field="point", value=point.value, allowed="a state on a new orbit, with `begin`")
    if kind is Kind.COLLISION and point.multiplier.real < 0.0:
        kind = Kind.PERIOD_DOUBLING if returns % 2 else Kind.PITCHFORK
    if kind is Kind.PERIOD_DOUBLING:
        at = replace(at, old=None, periods=2 * at.periods, period=at.period and 2.0 * at.period)
        return tuple(replace(at, mode=mode) for mode in modes)
    crossing = kind is not Kind.PITCHFORK
    return tuple(replace(at, mode=sign * mode, crossing=crossing) for mode in modes for sign in (1.0, -1.0))


def branch_sizes(curve: Curve, start: Start | BranchPoint) -> Array:
    """Sizes of the states along a branch, shape (n,): the system's own, or the distance from the orbit at which its
    return map becomes nonlinear, or the orbit's change over the interval, with ratios from the orbit."""
    x, value = start.orbit, start.value
    system = curve.system(value)
    given = getattr(system, "scale", None)
    if given is not None:
        return given
    period, old = start.period, start.sizes if isinstance(start, Start) else start.units[:-1]
    base = sizes(system, x, return_duration(system, period))
    if old is not None and (base < _ROUNDING * old).any():  # a state that rests at zero is rounding there
        base = old
    found = _linear_within(curve, x, value, base, period)
    if not isinstance(start, Start) or start.outward is None:
        return found
    # A small cycle does not determine the sizes of later ones, which grow as the root of the parameter.
    grown = np.abs(start.outward) * math.sqrt(curve.scale)
    return found * max(1.0, float((grown / found).max()))


def _linear_within(curve: Curve, x: Array, value: float, base: Array, period: float | None) -> Array:
    """Sizes of the states, with the ratios of ``base``, shape (n,), up to which returns near an orbit are linear."""
    system, curve.sizes = curve.system(value), base
    section = curve.section_at(x, value, period)
    image = curve.image(x, value, section)
    direction = np.cos(1.0 + 3.0 * np.arange(x.size))
    direction = image.across @ (base * direction / np.abs(direction).max())
    returned = image.state, image.jacobian @ direction
    flown = []
    for part in _PARTS:
        time = part * image.duration
        state, derivative = checked_flow(system, x, 0.0, time)
        flown.append((time, (state, derivative @ direction)))

    def off(state: Array, linear: tuple[Array, Array], r: float) -> float:
        reach = r * max(float(np.abs(linear[1] / base).max()), 1.0)
        return float(np.nan_to_num(np.abs((state - linear[0] - r * linear[1]) / base).max() / reach, nan=np.inf))

    @functools.cache
    def departure(r: float) -> float:
        try:
            with np.errstate(all="ignore"):
                there = x + r * direction
                found = off(returned_states(system, there[None], section)[0], returned, r)
                for time, linear in flown if found <= _BENT else ():
                    # A strongly contracting map forgets its argument: the motion is then nonlinear, not its end.
                    found = max(found, off(checked_flow(system, there, 0.0, time)[0], linear, r))
                return found
        except (AnalysisError, ArithmeticError, ValueError):
            return np.inf

    limit, far = _BENT, [departure(1.0)]
    while far[-1] <= limit and len(far) <= _DECADES:
        far.append(departure(10.0 ** len(far)))
        if _BOUNDED < far[-1] <= min(limit, 2.0 * far[-2]):  # as of a pendulum, which rotates freely far away
            limit = 0.5 * far[-1]
    step = 0.1 if far[0] > limit else 10.0
    low = high = 1.0
    for _ in range(_DECADES):
        low, high = high, high * step
        if (departure(high) > limit) is (step > 1.0):
            break
    else:  # linear: the orbit's change over the interval
        n = x.size
        derivative = curve.by_parameter(x, value, section)
        slope = np.linalg.lstsq(np.eye(n) - image.jacobian * base / base[:, None], derivative / base)[0]
        return base * max(1.0, float(np.abs(slope).max()))
    for _ in range(_HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if (departure(middle) > limit) is not (step > 1.0) else (low, middle)
    return base * float(np.sqrt(low * high))


def anchored(curve: Curve, start: Start, ahead: float) -> Anchor:
    """Anchor of the first step of a branch; its matrix is computed ``ahead`` by a distance where branches meet."""
    section = curve.section_at(start.orbit, start.value, start.period)
    units = curve.units
    image, matrix = curve.matrix_at(start.orbit, start.value, section, np.zeros(units.size), True)
    matrix = matrix[:-1]
    if not np.isfinite(matrix).all():
        said = "the flow is not finite at neighbouring values of the parameter"
        raise AnalysisError(said, field="start", allowed="another value")
    reach = np.maximum(units[:-1], np.abs(start.orbit))
    if not (np.abs(image.state - start.orbit) <= _CLOSES * (reach + np.abs(image.jacobian) @ reach)).all():
        raise AnalysisError("the orbit does not close here", field="start", allowed=_CLOSING)
    if start.mode is None:
        tangent = _along(matrix, start.rising)
        if start.outward is not None and float(tangent[:-1] @ (start.outward / units[:-1])) < 0.0:
            tangent = -tangent
    elif start.crossing:
        # With several critical modes by symmetry, two branches cross among the orbits with the mode's symmetry.
        space = symmetric_space(curve.system(start.value), start.orbit, units[:-1], start.mode / units[:-1])
        tangent = _other(curve, start, section, within_space(space, matrix))
    else:
        tangent = np.append(start.mode / units[:-1], 0.0)
        tangent /= np.linalg.norm(tangent)
    leaving = start.mode is not None
    known = image if leaving else with_bounds(curve.system(start.value), start.orbit, image.duration).image
    values, bound = curve.multipliers(known)
    left = start.bifurcation
    about = None if left is None else left.kind, image.period, bound, left, curve.periods
    point = BranchPoint(start.value, start.orbit, values, tangent, units, *about)
    return curve.anchor(point, ahead=ahead if leaving else 0.0)


def _along(matrix: Array, rising: bool) -> Array:
    """Unit null vector of a matrix, shape (n, n+1)."""
    _, values, rows = np.linalg.svd(matrix)
    if values[-1] <= _SINGULAR * max(1.0, float(values[0])):
        said = "branches meet here: the orbit alone does not determine one"
        other = "another value; switch from a located point; for families by energy a term l * grad H, l the parameter"
        raise AnalysisError(said, field="start", allowed=other)
    tangent: Array = rows[-1]
    # At a fold the parameter does not rise: the largest part of the state gives the direction.
    along = tangent[-1] if abs(tangent[-1]) > IN_FOLD else tangent[np.abs(tangent).argmax()]
    return tangent if bool(along > 0.0) is rising else -tangent


def _other(curve: Curve, start: Start, section: Section | None, matrix: Array) -> Array:
    """Tangent of the second of two crossing curves, by the algebraic branching equation (Keller 1977; Kuznetsov,
    *Elements of Applied Bifurcation Theory*, section 10.2.3), with second differences of H."""
    n, units = start.orbit.size, curve.units
    left, _, rows = np.linalg.svd(matrix)
    w, basis = left[:, -1], rows[-2:]

    def residual(z: Array) -> float:
        x, value = start.orbit + units[:n] * z[:n], start.value + curve.scale * float(z[n])
        return float(w @ ((returned_states(curve.system(value), x[None], section)[0] - x) / units[:n]))

    here = residual(np.zeros(n + 1))

    def second(direction: Array) -> float:
        return (residual(_BESIDE * direction) - 2.0 * here + residual(-_BESIDE * direction)) / _BESIDE**2

    a, c = second(basis[0]), second(basis[1])
    b = 0.5 * (second(basis[0] + basis[1]) - a - c)
    discriminant = b * b - a * c
    if not discriminant > 0.0:
        raise AnalysisError("no other branch crosses here", field="start", value=start.value)
    # a s^2 + 2 b s t + c t^2 = 0, written without cancellation
    q = b + np.copysign(np.sqrt(discriminant), b)
    found = [s * basis[0] + t * basis[1] for s, t in ((-q, a), (c, -q))]
    found = [each / np.linalg.norm(each) for each in found]
    old = _old_tangent(curve, start, units)
    other = min(found, key=lambda each: abs(float(each @ old)))
    assert start.mode is not None
    return other if float(other[:-1] @ (start.mode / units[:-1])) >= 0.0 else -other


def _old_tangent(curve: Curve, start: Start, units: Array) -> Array:
    """Unit tangent of the old branch, in units; along the parameter if unknown."""
    if start.old is not None:
        old = start.old / units
    elif offers(curve.system(start.value), "orbit"):
        beside = np.clip(start.value + _BESIDE * curve.scale * np.array([-1.0, 1.0]), *curve.between).tolist()
        low, high = (np.append(known_state(curve.system(value)), value) / units for value in beside)
        old = high - low
    else:
        old = np.eye(units.size)[-1]
    return np.asarray(old / np.linalg.norm(old))
