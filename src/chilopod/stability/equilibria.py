"""Equilibria of systems that do not depend on time: state, stability, and the cycle that leaves one at a Hopf point.

Derivatives of the right-hand side f are exact if a system provides the Taylor coefficients of f along curves (as those
of :func:`chilopod.stability.from_rhs` do); else from Chebyshev series of samples along the same curves, with errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.arguments import UserCode, finite_array, numbers
from chilopod.flows.carrying import numerical_balance
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.interface import Autonomous, Family, SystemLike, check_system, is_autonomous, offers, system_of
from chilopod.stability.normal_forms.manifold import RADII, series
from chilopod.stability.orbits.orbit import Orbit, near_orbit
from chilopod.stability.orbits.shooting import Nodes, nodes_along
from chilopod.stability.points import BifurcationPoint, Criticality
from chilopod.stability.returns import ReturnMap, section_at
from chilopod.stability.spectrum import EPSILON, SAFETY, disturbed, eigenvalue_errors, phased

SHRINKS = "the orbit shrinks into an equilibrium"  # reason for the end of a curve of cycles
SHRUNK = 10.0  # motion of a shrunk cycle, relative to the largest along its curve, in roots of the precision
ROUNDING = 16.0 * EPSILON  # rounding error of a right-hand side, relative to its terms: a few roundings in each
_ROUNDS = 80  # enough for a triple root, where each leaves two thirds
_HALVINGS = 12  # halvings of a step of Newton's method
_SETTLED = 1e-9  # step, relative to the sizes of the states, that may stop falling
_NOTHING = 1e-13  # state, relative to its sizes during the iteration, that may be zero
_SINGULAR = 1e-13  # singular value, relative to the largest, that counts as zero, in units that balance the matrix
_ANGLES = 8  # angles on a circle, which separate harmonics up to the third
_SPANS = 10.0 ** -np.arange(0.0, 4.5, 0.5)  # spans of samples of f for differences, relative to the sizes of the states
_SMALL = 0.01  # amplitude of the first cycle, relative to that where higher terms matter, and distance, to the room
_RESTS = 1e-6  # velocity at an equilibrium, relative to the terms of its linear part
_TURNS = 0.1  # largest difference of turns within the period of a small cycle from one
_PARTS = 64  # parts of a return at which a small cycle is sampled
_MISSED = 0.3  # largest error of the predicted first cycle, relative to its amplitude


@dataclass(frozen=True, eq=False)
class Equilibrium(ReadOnlyArrays):
    """An equilibrium of a system that does not depend on time.

    Attributes
    ----------
    state, error
        State, and bound on its error, which is infinite where the derivative is singular, shape (n,) both.
    jacobian
        Derivative of the right-hand side there, shape (n, n).
    eigenvalues, error_bounds
        Eigenvalues of the derivative, by falling real part, in 1/s, and bounds on their errors, shape (n,) both.
    """

    state: Array
    error: Array
    jacobian: Array
    eigenvalues: ComplexArray
    error_bounds: Array
    _verdicts = ("stable",)

    @property
    def stable(self) -> bool | None:
        """True if all eigenvalues lie left of zero by more than their errors, False if one lies right, else None."""
        if (self.eigenvalues.real < -self.error_bounds).all():
            return True
        return False if (self.eigenvalues.real > self.error_bounds).any() else None


@dataclass(frozen=True)
class HopfForm:
    """The motion on the centre manifold of a Hopf point, z' = lambda z + cubic z |z|^2, and that manifold, the state
    x + 2 Re(z mode + z^2 second) + mean |z|^2 (Kuznetsov, *Elements of Applied Bifurcation Theory*, section 8.7)."""

    mode: ComplexArray  # unit eigenvector to lambda, shape (n,)
    second: ComplexArray  # coefficients of the manifold, shape (n,)
    mean: Array
    cubic: complex  # coefficient, and a bound on the error of its real part
    error: float


def find_equilibrium(system: SystemLike, guess: ArrayLike) -> Equilibrium:
    """An equilibrium, by damped Newton's method from a guess.

    A step is shortened until the next one, by the same derivative, would be shorter (Deuflhard, section 3.3).

    Parameters
    ----------
    system
        A system that does not depend on time.
    guess
        A state near the equilibrium, shape (n,); an AnalysisError if none is found there.
    """
    checked = autonomous(system)
    x = finite_array(guess, (checked.dimension,), "guess")
    x, velocity, matrix = _newton(checked, x)
    rounding = np.abs(velocity) + ROUNDING * (np.abs(matrix) @ np.abs(x))
    units = numerical_balance(matrix)
    scaled = matrix * units / units[:, None]
    singular = np.linalg.cond(scaled) > 1.0 / _SINGULAR
    error = np.full(x.size, np.inf) if singular else units * (np.abs(np.linalg.inv(scaled)) @ (rounding / units))
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    values = values[np.lexsort((-values.imag, -values.real))]
    off = np.inf if singular else matrix_error(checked, x, matrix, error)
    return Equilibrium(x, error, matrix, values, eigenvalue_errors(values, matrix, np.zeros_like(matrix) + off))


def has_shrunk(system: SystemLike, x: Array, units: Array, motion: float, image: ReturnMap) -> bool:
    """True if a cycle with a ``motion``, the velocity in units of the states times the period, has shrunk into an
    equilibrium, which then oscillates with its period."""
    # A small cycle is smaller than its velocity in any state times its period.
    away = (nodes_along(system, x, image.duration, _PARTS).states - x) / units
    return float(np.linalg.norm(away, axis=1).max()) <= motion and has_centre(system, x, image.period)


def has_centre(system: SystemLike, state: Array, period: float) -> bool:
    """True if an equilibrium near a state oscillates with a period, as where small cycles surround it."""
    try:
        turns = find_equilibrium(system, state).eigenvalues.imag * period / (2.0 * np.pi)
    except AnalysisError:
        return False
    return bool((np.abs(turns - 1.0) <= _TURNS).any())


def equilibrium_at(family: Family, value: float, guess: ArrayLike) -> tuple[Autonomous, Equilibrium]:
    """The system of a family at a value of the parameter, and its equilibrium near a guess."""
    system = autonomous(system_of(family, value))
    with UserCode("family", value):
        return system, find_equilibrium(system, guess)


def autonomous(system: SystemLike) -> Autonomous:
    """Check that a system does not depend on time."""
    check_system(system)
    if not is_autonomous(system):
        allowed = "period=None, and no t in the function; a map has no equilibria: use `find_orbit` or `locate`"
        raise ParameterError("must be a flow that does not depend on time", field="system", allowed=allowed)
    return system


def _newton(system: Autonomous, x: Array) -> tuple[Array, Array, Array]:
    """An equilibrium with velocity and derivative there."""
    largest, terms = np.abs(x), np.zeros_like(x)
    for _ in range(_ROUNDS):
        small = np.where(np.abs(x) <= _NOTHING * largest, 0.0, x)
        for each in (small, x) if (small != x).any() else (x,):
            velocity, matrix, _ = linear_part(system, each)
            # The state solves equations with rounded terms (Oettli & Prager, Numer. Math. 6, 1964).
            if (np.abs(velocity) <= ROUNDING * (np.abs(matrix) @ np.abs(each))).all():
                return each, velocity, matrix
        terms = np.maximum(terms, np.abs(matrix) @ np.abs(x))
        units = numerical_balance(matrix)
        scaled = matrix * units / units[:, None]
        inverse = np.linalg.pinv(scaled, rcond=_SINGULAR) * units[:, None] / units
        step = -inverse @ velocity
        coupled = units * float((largest / units).max()) if largest.any() else units
        size = np.where(largest > 0.0, largest, coupled)
        # A degenerate equilibrium is approached, along its singular direction, while rounding allows it.
        still = (np.abs(step) <= _NOTHING * size).all() and (np.abs(velocity) <= ROUNDING * terms).all()
        if still and np.linalg.cond(scaled) > 1.0 / _SINGULAR:
            return x, velocity, matrix
        share = _damped(system, x, step, inverse, size)
        if share is None:
            if (np.abs(step) <= _SETTLED * size).all():
                return x, velocity, matrix
            break
        x = x + share * step
        largest = np.maximum(largest, np.abs(x))
    raise AnalysisError("no equilibrium found near the guess", field="guess", allowed="a guess closer to it")


def _damped(system: Autonomous, x: Array, step: Array, inverse: Array, size: Array) -> float | None:
    """The largest power of one half of a step that approaches the equilibrium; None if none does."""
    length = float(np.linalg.norm(step / size))
    for share in 0.5 ** np.arange(_HALVINGS):
        velocity = _velocity(system, x + share * step)
        if np.isfinite(velocity).all():
            following = float(np.linalg.norm(inverse @ velocity / size))
            if following <= (1.0 - 0.25 * share) * length:
                return float(share)
    return None


def _velocity(system: Autonomous, x: Array) -> Array:
    with np.errstate(all="ignore"):
        return numbers(system.velocity(np.array(x)), x.shape, "velocity")


def linear_part(system: Autonomous, x: Array) -> tuple[Array, Array, Array]:
    """dx/dt at a state, shape (n,), its derivative, shape (n, n), and bounds on the latter's errors by differences."""
    size = getattr(system, "scale", None)
    if size is None:
        size = np.where(x == 0.0, float(np.abs(x).max()) or 1.0, np.abs(x))
    found, wrong = _expanded(system, np.stack([np.broadcast_to(x, (x.size, x.size)), np.diag(size)], axis=1))
    with np.errstate(all="ignore"):
        velocity, matrix = found[0, 0], found[:, 1].T / size
    if not (np.isfinite(velocity).all() and np.isfinite(matrix).all()):
        raise AnalysisError("the right-hand side is not finite", field="rhs", allowed="another guess")
    return velocity, matrix, wrong[:, 1].T / size


def matrix_error(system: Autonomous, x: Array, matrix: Array, error: Array) -> Array:
    """Error of the derivative, shape (n, n), due to the error and rounding of the state. Where terms of f cancel, an
    entry may be round-off of entries as large as the others, in units that balance."""
    states = disturbed(x, error + 4.0 * EPSILON * np.abs(x), draws=4)
    others = [linear_part(system, other)[1:] for other in states]
    moved = np.max([np.abs(other - matrix) + wrong for other, wrong in others], axis=0)
    units = numerical_balance(matrix)
    ratios = units / units[:, None]
    return np.asarray(moved + 4.0 * EPSILON * float(np.abs(matrix * ratios).max()) / ratios)


def _expanded(system: Autonomous, curves: Array) -> tuple[Array, Array]:
    """Taylor coefficients of f(x(s)) along x(s) = c0 + c1 s + ..., shape (curves, orders, n), and bounds of errors."""
    if offers(system, "velocity_series"):
        found = np.array(system.velocity_series(curves))  # it may return the same array at every call
        return found, np.zeros_like(found)
    orders = curves.shape[1]
    best, error = np.full(curves.shape, np.nan), np.full(curves.shape, np.inf)
    for curve, value, bound in zip(curves, best, error, strict=True):
        value[0], bound[0] = _velocity(system, curve[0]), 0.0
        for span in _SPANS:
            powers = (span * np.concatenate([RADII, -RADII]))[:, None] ** np.arange(orders)
            samples = np.array([_velocity(system, x) for x in powers @ curve])
            ahead, back = np.split(samples, 2)
            for order in range(1, orders) if np.isfinite(samples).all() else ():
                part = 0.5 * (ahead + (-1.0) ** order * back)
                noise = EPSILON * np.abs(samples).max(axis=0)
                term, wrong = series(part.astype(np.complex128), order % 2).taylor(order, noise)
                wrong = wrong / span**order
                value[order] = np.where(wrong < bound[order], term.real / span**order, value[order])
                bound[order] = np.minimum(wrong, bound[order])
    return best, error


def hopf_form(system: Autonomous, x: Array, error: Array, frequency: float) -> HopfForm:
    """The normal form of a pair near a frequency, with its error due to those of the equilibrium and derivative."""
    matrix = linear_part(system, x)[1]
    off = matrix_error(system, x, matrix, error) + 4.0 * EPSILON * np.abs(matrix)
    random = np.random.default_rng(1)
    form = _hopf_form(system, x, matrix, frequency)
    scatter = [
        _hopf_form(system, other, matrix + off * random.choice([-1.0, 1.0], off.shape), frequency, draws=0).cubic
        for other in disturbed(x, error + 4.0 * EPSILON * np.abs(x))
    ]
    return replace(form, error=form.error + SAFETY * float(np.abs(np.array(scatter).real - form.cubic.real).max()))


def _hopf_form(system: Autonomous, x: Array, matrix: Array, frequency: float, draws: int = 2) -> HopfForm:
    """The normal form with a given derivative, with errors of rounding and, by random draws, of differences."""
    units = numerical_balance(matrix)
    values, lefts, rights = scipy.linalg.eig(matrix * units / units[:, None], left=True)
    index = int(np.abs(values - 1j * frequency).argmin())
    mode, left = phased(rights[:, index] * units), lefts[:, index] / units
    mode = mode / np.linalg.norm(mode)
    left = left / np.conj(left.conj() @ mode)
    turns = np.exp(2j * np.pi * np.arange(_ANGLES) / _ANGLES)[:, None]
    # Along the mode at the size of the states, where differences are needed.
    size = np.where(x == 0.0, units * float((np.abs(x) / units).max() or 1.0), np.abs(x))
    reach = 0.1 * float((size / np.maximum(np.abs(mode), EPSILON * np.abs(mode).max())).min())
    along = 2.0 * (reach * mode * turns).real
    still, none = np.broadcast_to(x, along.shape), np.zeros_like(along)
    quadratic, wrong = _expanded(system, np.stack([still, along, none], axis=1))
    ratios, one = units / units[:, None], np.eye(x.size)

    def bent(terms: Array) -> tuple[ComplexArray, Array, complex, Array]:
        """The manifold for the terms of second order on the circle, the cubic term on it, and its errors."""
        harmonics: ComplexArray = np.fft.fft(terms, axis=0) / _ANGLES / units
        second: ComplexArray = units * np.linalg.solve((2j * frequency * one - matrix) * ratios, harmonics[2])
        mean: Array = units * np.linalg.solve(-matrix * ratios, harmonics[0].real)
        curves = np.stack([still, along, mean + 2.0 * (second * turns**2).real, none], axis=1)
        found, off = _expanded(system, curves)
        third = np.fft.fft(found[:, 3], axis=0)[1] / _ANGLES
        off = off[:, 3].max(axis=0) + ROUNDING * np.abs(found[:, 3]).max(axis=0)
        return second, mean, complex(left.conj() @ third), off

    second, mean, cubic, off = bent(quadratic[:, 2])
    error = float(np.abs(left) @ off)
    if draws and wrong.any():
        others = [bent(each)[2] for each in disturbed(quadratic[:, 2], wrong[:, 2], draws)]
        error += SAFETY * float(np.abs(np.array(others) - cubic).max())
    return HopfForm(mode, second / reach**2, mean / reach**2, cubic / reach**3, error / reach**3)


def hopf_cycle(family: Family, point: BifurcationPoint) -> tuple[float, Orbit, Array]:
    """A small cycle beside a Hopf point, with its parameter, and its displacement over the root of the parameter's."""
    rate = point.rate
    if point.multiplicity > 2:
        said = f"is a Hopf point with {point.multiplicity // 2} pairs critical at once"
        raise ParameterError(said, field="point", value=point.value, allowed="a state on a cycle, with `begin`")
    if rate is None or point.criticality is Criticality.UNDECIDED:
        said = "is a Hopf point whose coefficients leave the side of its cycles undecided"
        raise ParameterError(said, field="point", value=point.value)
    here, rest = equilibrium_at(family, point.value, point.orbit)
    velocity, matrix, _ = linear_part(here, point.orbit)
    still = (np.abs(velocity) <= _RESTS * (np.abs(matrix) @ np.abs(point.orbit))).all()
    if not (still and has_centre(here, point.orbit, point.period)):
        raise ParameterError("must be a Hopf point of this family", field="point", value=point.value)
    form = hopf_form(here, point.orbit, np.zeros(point.orbit.size), point.frequency)
    units = numerical_balance(matrix)
    side = -form.cubic.real / rate.real
    room = point.between[1] - point.value if side > 0.0 else point.value - point.between[0]
    if not room > point.error_bound:
        said = "is a Hopf point at an end of the searched interval, beyond which its cycles lie"
        raise ParameterError(said, field="point", value=point.value, allowed="a point from a search beyond it")
    mode, *bends = (float(np.linalg.norm(each / units)) for each in (form.mode, form.second, form.mean))
    # A cubic term like another eigenvalue may change the stability of cycles; growth that is too slow is not resolved.
    slowest = float(np.sort(np.abs(rest.eigenvalues.real))[2:].min(initial=np.inf))
    growth = max(min(slowest, _SMALL * point.frequency), _SMALL**2 * point.frequency)
    square = _SMALL * min(growth / abs(form.cubic), room / abs(side))
    square = min(square, (_SMALL * mode / max(bends)) ** 2) if max(bends) > 0.0 else square
    for factor in (1.0, _SMALL, _SMALL**2):
        try:
            return _cycle(family, point, rate, form, units, factor * square)
        except AnalysisError as error:
            reason = error.problem
    raise AnalysisError(f"no cycle was found beside the Hopf point: {reason}", field="point", value=point.value)


def _cycle(
    family: Family, point: BifurcationPoint, rate: complex, form: HopfForm, units: Array, square: float
) -> tuple[float, Orbit, Array]:
    """The cycle of a squared amplitude by the normal form."""
    shift = -form.cubic.real / rate.real * square
    value = point.value + shift
    duration = 2.0 * np.pi / (point.frequency + form.cubic.imag * square + rate.imag * shift)
    system, at_rest = equilibrium_at(family, value, point.orbit)
    rest = at_rest.state
    with UserCode("family", value):
        moved = 2.0 * (np.sqrt(square) * form.mode + square * form.second).real + square * form.mean
        size = np.maximum(np.abs(rest + moved), np.sqrt(square) * float(np.linalg.norm(form.mode / units)) * units)
        section = section_at(system, rest + moved, size, duration)
        found = near_orbit(system, Nodes((rest + moved)[None], duration), False, None, section)
    missed = float(np.linalg.norm((found.state - rest - moved) / units))
    if not missed <= _MISSED * float(np.linalg.norm(moved / units)):
        raise AnalysisError("the corrector found another orbit", field="orbit")
    return value, found, (found.state - rest) / np.sqrt(abs(shift))
