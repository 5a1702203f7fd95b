"""Branches of periodic orbits: pseudo-arclength continuation in one parameter, with what happens along the way.

A branch is a curve of pairs (orbit, parameter) with H(x, p) = x. It is followed by its arclength, so that folds are
ordinary points of it: from a point and a tangent a step is predicted, and Newton's method brings it back onto the
curve at right angles (Keller 1977; Kuznetsov, *Elements of Applied Bifurcation Theory*, section 10.2). Between two
points the multipliers tell whether stability changed; where it did, the point is located along the curve.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability.floquet import counts_outside
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.samples import Family
from chilopod.stability.system import ReturnMap, SystemLike, return_map, returned_states, whole_period

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_CLOSE_ENOUGH = 1e-10  # of the fixed point, relative to max(1, |x|)
_MOST_CORRECTIONS = 12
_PARAMETER_STEP = 1e-6  # of differences, relative to the interval
_BISECTIONS = 40


class Ending(enum.Enum):
    """Why a branch ends where it does; each member's ``sentence`` says it in words."""

    LEFT_INTERVAL = "left the interval", "the parameter reached an end of the interval"
    ENOUGH_POINTS = "enough points", "as many points as were asked for"
    LOST = "lost", "the step became too small: the curve could not be followed further"

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


@dataclass(frozen=True)
class BranchPoint:
    """A periodic orbit on a branch.

    Attributes
    ----------
    value
        Of the parameter.
    orbit
        State at time 0, shape (n,).
    multipliers
        Of the full period, by falling modulus, shape (n,).
    tangent
        Unit tangent of the curve, shape (n+1,): state, then parameter over the width of the interval.
    special
        What happens here, if anything; ordinary points have None.
    """

    value: float
    orbit: Array
    multipliers: ComplexArray
    tangent: Array
    special: Kind | None = None

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle."""
        return bool((np.abs(self.multipliers) < 1.0).all())


@dataclass(frozen=True)
class Branch:
    """A followed branch.

    Attributes
    ----------
    points
        Along the curve, special points among them.
    ending
        Why it ends.
    """

    points: tuple[BranchPoint, ...]
    ending: Ending

    @property
    def special_points(self) -> tuple[BranchPoint, ...]:
        """Folds and secondary bifurcations."""
        return tuple(point for point in self.points if point.special is not None)


def follow(
    family: Family,
    start: BranchPoint,
    between: tuple[float, float],
    *,
    points: int = 100,
    step: float = 0.02,
    longest: float = 0.15,
    progress: Callable[[int, BranchPoint], None] = lambda count, point: None,
) -> Branch:
    """Follow a branch from a point along its tangent.

    Parameters
    ----------
    family
        ``family(value)`` is the system; the full period is used even where it has a half-period symmetry, for the
        orbits of interest have lost it.
    start
        From :func:`leave_pitchfork`, :func:`begin`, or the end of another branch (that is how one is continued).
    between
        Interval of the parameter; the branch ends where it leaves it.
    points
        At most so many ordinary points.
    step, longest
        First and largest step along the curve, in units of the state and of the interval's width.
    progress
        Called with the number of points and the newest one.

    Raises
    ------
    ParameterError
        If the interval is no interval, or ``points`` or a step is not positive.
    """
    low, high = between
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ParameterError("must rise from a lower to a higher finite value", field="between", value=between)
    for name, value in (("points", points), ("step", step), ("longest", longest)):
        if not value > 0:
            raise ParameterError("must be positive", field=name, value=value)
    curve = _Curve(family, high - low)
    found = [start]
    ordinary, size = 0, step
    # A step ahead: at a pitchfork itself the curve has two tangents, and the matrix is singular.
    n = start.orbit.size
    ahead = replace(start, orbit=start.orbit + size * start.tangent[:n])
    matrix = curve.matrix(curve.image(ahead.orbit, ahead.value), ahead)
    while ordinary < points:
        last = found[-1]
        try:
            new, matrix_new, corrections = curve.step(last, size, matrix)
        except AnalysisError:
            size *= 0.5
            if size < 1e-4 * step:
                return Branch(tuple(found), Ending.LOST)
            continue
        # Special points lie between the last ordinary point and the new one.
        found += curve.special_between(last, new, size, matrix)
        found.append(new)
        matrix = matrix_new
        ordinary += 1
        progress(ordinary, new)
        if not low <= new.value <= high:
            return Branch(tuple(found), Ending.LEFT_INTERVAL)
        size = min(longest, size * (1.5 if corrections <= 4 else 1.0 if corrections <= 7 else 0.6))
    return Branch(tuple(found), Ending.ENOUGH_POINTS)


def leave_pitchfork(family: Family, point: BifurcationPoint, side: int = 1) -> BranchPoint:
    """The start of one of the two branches that meet at a pitchfork.

    Parameters
    ----------
    family
        As it was given to :func:`chilopod.stability.locate`.
    point
        The located pitchfork.
    side
        +1 along the critical mode, -1 against it.
    """
    if point.kind is not Kind.PITCHFORK:
        raise ParameterError("is not a pitchfork", field="point", value=point.kind.label)
    image = return_map(whole_period(family(point.value)), point.orbit, with_error=False)
    tangent = np.append(np.sign(side) * point.mode.real, 0.0)
    return BranchPoint(point.value, point.orbit, _sorted(image), tangent / np.linalg.norm(tangent), Kind.PITCHFORK)


def begin(family: Family, value: float, orbit: ArrayLike, rising: bool, width: float) -> BranchPoint:
    """The start of a branch at an orbit that is known, towards a rising or falling parameter.

    Parameters
    ----------
    family
        ``family(value)`` is the system.
    value, orbit
        Parameter and orbit, shape (n,).
    rising
        The direction to start in.
    width
        Width of the interval that the branch will be followed through.
    """
    x = np.asarray(orbit, dtype=np.float64)
    curve = _Curve(family, width)
    image = curve.image(x, value)
    slope = np.linalg.solve(np.eye(x.size) - image.jacobian, curve.parameter_derivative(x, value))
    tangent = np.append(slope, 1.0) * (1.0 if rising else -1.0)
    return BranchPoint(value, x, _sorted(image), tangent / np.linalg.norm(tangent))


class _Curve:
    """The curve H(x, p) = x, with p in units of ``width``."""

    def __init__(self, family: Family, width: float) -> None:
        self._family = family
        self.width = width

    def family(self, value: float) -> SystemLike:
        return whole_period(self._family(value))

    def image(self, x: Array, value: float) -> ReturnMap:
        return return_map(self.family(value), x, with_error=False)

    def parameter_derivative(self, x: Array, value: float) -> Array:
        h = _PARAMETER_STEP * self.width
        up, down = (returned_states(self.family(value + d), x[None])[0] for d in (h, -h))
        derivative: Array = (up - down) / (2.0 * _PARAMETER_STEP)
        return derivative

    def matrix(self, image: ReturnMap, point: BranchPoint) -> Array:
        """Jacobian of [H - x; tangent . step] with respect to state and scaled parameter."""
        n = point.orbit.size
        derivative = self.parameter_derivative(point.orbit, point.value)
        return np.block([[image.jacobian - np.eye(n), derivative[:, None]], [point.tangent[None]]])

    def step(self, last: BranchPoint, size: float, matrix: Array) -> tuple[BranchPoint, Array, int]:
        """The point a step further; its matrix; and how many corrections it took."""
        n = last.orbit.size
        y = np.append(last.orbit, last.value / self.width) + size * last.tangent
        anchor = y.copy()
        inverse = np.linalg.inv(matrix)
        before = np.inf
        move = residual_before = np.zeros(n + 1)
        for corrections in range(_MOST_CORRECTIONS + 1):
            x, value = y[:n], float(y[n] * self.width)
            mapped = returned_states(self.family(value), x[None])[0]
            residual = np.append(mapped - x, last.tangent @ (y - anchor))
            now = float(np.abs(residual).max())
            if not np.isfinite(now) or now > 10.0 * before:
                raise AnalysisError("corrections diverge", field="step")
            if now <= _CLOSE_ENOUGH * max(1.0, float(np.abs(x).max())):
                break
            if corrections:
                # Broyden's update keeps the matrix of the last point good enough for the whole step.
                change = inverse @ (residual - residual_before)
                inverse = inverse + np.outer(move - change, move @ inverse) / (move @ change)
            move = -inverse @ residual
            residual_before, before = residual, now
            y = y + move
        else:
            raise AnalysisError("corrections do not converge", field="step")
        image = self.image(x, value)
        bordered = self.matrix(image, replace(last, orbit=x, value=value))
        tangent = np.linalg.solve(bordered, np.append(np.zeros(n), 1.0))
        tangent /= np.linalg.norm(tangent)
        point = BranchPoint(value, x.copy(), _sorted(image), tangent)
        bordered[n] = tangent
        return point, bordered, corrections

    def special_between(self, last: BranchPoint, new: BranchPoint, size: float, matrix: Array) -> list[BranchPoint]:
        """Folds and bifurcations between two points, located along the curve by bisection, in order."""
        if last.special is Kind.PITCHFORK:
            return []  # the branch has only just left it: its multiplier 1 moves off to either side
        turned = last.tangent[-1] * new.tangent[-1] < 0.0
        changed = [
            a != b for a, b in zip(counts_outside(last.multipliers), counts_outside(new.multipliers), strict=True)
        ]
        found: list[tuple[float, BranchPoint]] = []
        if turned:
            found.append(
                self._bisect(
                    last, size, matrix, lambda point: bool(point.tangent[-1] * last.tangent[-1] < 0.0), Kind.FOLD
                )
            )
        for event, kind in enumerate((Kind.PERIOD_DOUBLING, Kind.BRANCH_POINT, Kind.NEIMARK_SACKER)):
            if not changed[event] or (event == 1 and turned):
                continue
            reference = counts_outside(last.multipliers)[event]

            def beyond(point: BranchPoint, event: int = event, reference: int = reference) -> bool:
                return counts_outside(point.multipliers)[event] != reference

            found.append(self._bisect(last, size, matrix, beyond, kind))
        return [point for _, point in sorted(found, key=lambda pair: pair[0])]

    def _bisect(
        self, last: BranchPoint, size: float, matrix: Array, beyond: Callable[[BranchPoint], bool], kind: Kind
    ) -> tuple[float, BranchPoint]:
        low, high = 0.0, size
        point = last
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            candidate = self.step(last, middle, matrix)[0]
            if beyond(candidate):
                high, point = middle, candidate
            else:
                low = middle
            if high - low < 1e-9 * size:
                break
        return high, replace(point, special=kind)


def _sorted(image: ReturnMap) -> ComplexArray:
    values = np.linalg.eigvals(image.jacobian).astype(np.complex128)
    return values[np.lexsort((-values.imag, -np.abs(values)))]
