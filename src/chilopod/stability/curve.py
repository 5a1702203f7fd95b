"""One step along a curve of periodic orbits, and what happens within it.

The curve is H(x, p) = x, parametrised by its arclength with p in units of a scale. A step is predicted from the last
two points and their tangents, and corrected at right angles to the last tangent (Keller 1977; Kuznetsov, *Elements of
Applied Bifurcation Theory*, section 10.2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays, read_only
from chilopod.stability.capabilities import FlowsEach, SystemLike
from chilopod.stability.floquet import counts_outside
from chilopod.stability.points import Kind
from chilopod.stability.returns import ReturnMap, return_map, returned_states, whole_period
from chilopod.stability.samples import Family

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_CLOSE_ENOUGH = 1e-10  # of the fixed point, relative to max(1, |x|)
_MOST_CORRECTIONS = 12
_PARAMETER_STEP = 1e-6  # of the difference, in units of the scale
_SHARPEST_TURN = 0.5  # cosine between two tangents: beyond it the step may have landed on another curve
_WITHIN = 1e-9  # of a step: how closely a special point is located
_BISECTIONS = 40
_CRITICAL = 1e-5  # distance from the circle within which a multiplier is the critical one of a located point


@dataclass(frozen=True)
class BranchPoint(ReadOnlyArrays):
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
        Unit tangent of the curve, shape (n+1,): state, then parameter over the scale of the branch.
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
class Anchor(ReadOnlyArrays):
    """Where a step starts.

    Attributes
    ----------
    last
        The point it starts from.
    matrix
        Jacobian of [H - x; tangent . step] there with respect to state and scaled parameter, shape (n+1, n+1).
    before
        The point before it with its matrix, if there is one.
    """

    last: BranchPoint
    matrix: Array
    before: tuple[BranchPoint, Array] | None = None


class Curve:
    """The curve H(x, p) = x of a family, with p in units of ``scale``.

    Where its systems flow each (see :class:`chilopod.stability.capabilities.FlowsEach`), the derivative with respect to
    the parameter costs next to nothing on two cores.
    """

    def __init__(self, family: Family, scale: float) -> None:
        self._family = family
        self.scale = scale

    def image(self, x: Array, value: float) -> ReturnMap:
        """The return map over the full period and its derivative, without an error bound."""
        return return_map(self._system(value), x, with_error=False)

    def parameter_derivative(self, x: Array, value: float) -> Array:
        """dH/dp at a state, per scale, shape (n,)."""
        mapped, beside = self._mapped(x, value)
        return ((self._beside(x, value) if beside is None else beside) - mapped) / _PARAMETER_STEP

    def matrix(self, jacobian: Array, derivative: Array, tangent: Array) -> Array:
        """Jacobian of [H - x; tangent . step] with respect to state and scaled parameter."""
        return np.block([[jacobian - np.eye(len(jacobian)), derivative[:, None]], [tangent[None]]])

    def anchor(self, last: BranchPoint, before: BranchPoint | None = None, ahead: float = 0.0) -> Anchor:
        """Where a step from a point starts, its matrix taken so far ``ahead`` along the tangent."""
        matrix = self._matrix_at(last, ahead)
        # The matrix of a pitchfork was not its own, so it tells nothing about the next one.
        if before is None or before.special is not None:
            return Anchor(last, matrix)
        return Anchor(last, matrix, (before, read_only(self._matrix_at(before))))

    def _matrix_at(self, point: BranchPoint, ahead: float = 0.0) -> Array:
        x = point.orbit + ahead * point.tangent[:-1]
        jacobian, derivative = self.image(x, point.value).jacobian, self.parameter_derivative(x, point.value)
        return self.matrix(jacobian, derivative, point.tangent)

    def step(self, anchor: Anchor, size: float) -> tuple[Anchor, int]:
        """The point so far along the tangent as the start of a next step, and how many corrections it took.

        Raises
        ------
        AnalysisError
            If the corrections do not converge, or end where the curve would have turned too sharply.
        """
        last = anchor.last
        n = last.orbit.size
        origin = self._scaled(last)
        y, matrix = self._predicted(anchor, size)
        try:
            inverse = np.linalg.inv(matrix)
        except np.linalg.LinAlgError:
            raise AnalysisError("the curve has no direction here", field="step") from None
        largest = np.inf
        move = residual_before = np.zeros(n + 1)
        for corrections in range(_MOST_CORRECTIONS + 1):
            x, value = y[:n].copy(), float(y[n] * self.scale)
            mapped, beside = self._mapped(x, value)
            residual = np.append(mapped - x, last.tangent @ (y - origin) - size)
            now = float(np.abs(residual).max())
            if not np.isfinite(now) or now > 10.0 * largest:
                raise AnalysisError("corrections diverge", field="step")
            if now <= _CLOSE_ENOUGH * max(1.0, float(np.abs(x).max())):
                break
            if corrections:
                # Broyden's update keeps the matrix of the last point good enough for the whole step.
                change = inverse @ (residual - residual_before)
                inverse = inverse + np.outer(move - change, move @ inverse) / (move @ change)
            move = -inverse @ residual
            residual_before, largest = residual, now
            y = y + move
        else:
            raise AnalysisError("corrections do not converge", field="step")
        image = self.image(x, value)
        beside = self._beside(x, value) if beside is None else beside
        bordered = self.matrix(image.jacobian, (beside - mapped) / _PARAMETER_STEP, last.tangent)
        # Exactly at a branch point the matrix is singular; of its solutions the shortest strays least.
        tangent = np.linalg.lstsq(bordered, np.append(np.zeros(n), 1.0))[0]
        tangent /= np.linalg.norm(tangent)
        if tangent @ last.tangent < _SHARPEST_TURN:
            raise AnalysisError("the curve turns too sharply", field="step")
        bordered[n] = tangent
        before = None if last.special is not None else (last, anchor.matrix)
        return Anchor(BranchPoint(value, x, sorted_multipliers(image), tangent), bordered, before), corrections

    def special_between(self, anchor: Anchor, new: BranchPoint, size: float) -> list[BranchPoint]:
        """Folds and bifurcations between the start of a step and its end, located along the curve, in order."""
        last = anchor.last
        if last.special is Kind.PITCHFORK:
            return []  # the branch has only just left it: its multiplier 1 moves off to either side
        turned = last.tangent[-1] * new.tangent[-1] < 0.0
        found = []
        if turned:
            place, point = self._located(anchor, new, size, lambda at: float(at.tangent[-1]), lambda at: 0)
            found.append((place, replace(point, special=Kind.FOLD)))
        for event, kind in enumerate((Kind.PERIOD_DOUBLING, Kind.BRANCH_POINT, Kind.NEIMARK_SACKER)):

            def count(at: BranchPoint, event: int = event) -> int:
                return counts_outside(at.multipliers)[event]

            if count(last) == count(new) or (kind is Kind.BRANCH_POINT and turned):
                continue
            place, point = self._located(anchor, new, size, _TESTS[kind], count)
            # Two real multipliers that meet outside the circle change the counts too, but nothing happens there.
            if _is_critical(point.multipliers, kind):
                found.append((place, replace(point, special=kind)))
        return [point for _, point in sorted(found, key=lambda pair: pair[0])]

    def _system(self, value: float) -> SystemLike:
        return whole_period(self._family(value))

    def _scaled(self, point: BranchPoint) -> Array:
        return np.append(point.orbit, point.value / self.scale)

    def _predicted(self, anchor: Anchor, size: float) -> tuple[Array, Array]:
        """Where a step should end, and the matrix there: by the cubic through the last two points along their tangents
        and by the straight line through their matrices; by the tangent and the matrix where there is but one point."""
        last = anchor.last
        here = self._scaled(last)
        if anchor.before is None:
            return here + size * last.tangent, anchor.matrix
        before, matrix_before = anchor.before
        back = here - self._scaled(before)
        length = float(np.linalg.norm(back))
        # Newton's form over the nodes 0, 0, -length, -length.
        slope = back / length
        second = (last.tangent - slope) / length
        third = (second - (slope - before.tangent) / length) / length
        matrix = anchor.matrix + (size / length) * (anchor.matrix - matrix_before)
        matrix[-1] = last.tangent
        return here + size * (last.tangent + size * (second + (size + length) * third)), matrix

    def _mapped(self, x: Array, value: float) -> tuple[Array, Array | None]:
        """H at a state, and at a neighbouring value of the parameter if that costs no time."""
        system = self._family(value)
        if isinstance(system, FlowsEach) and system.period is not None:
            beside = self._family(value + _PARAMETER_STEP * self.scale)
            if isinstance(beside, FlowsEach):
                mapped, moved = system.flow_each([system, beside], np.array([x, x]), 0.0, system.period)
                return (mapped, moved) if beside.period == system.period else (mapped, None)
        return returned_states(whole_period(system), x[None])[0], None

    def _beside(self, x: Array, value: float) -> Array:
        beside: Array = returned_states(self._system(value + _PARAMETER_STEP * self.scale), x[None])[0]
        return beside

    def _located(
        self,
        anchor: Anchor,
        new: BranchPoint,
        size: float,
        test: Callable[[BranchPoint], float],
        count: Callable[[BranchPoint], int],
    ) -> tuple[float, BranchPoint]:
        """Where a test function passes through zero within a step, or, if it does not, where a count changes."""
        at = {0.0: anchor.last, size: new}

        def point(place: float) -> BranchPoint:
            if place not in at:
                at[place] = self.step(anchor, place)[0].last
            return at[place]

        if test(anchor.last) * test(new) < 0.0:
            place = float(brentq(lambda place: test(point(place)), 0.0, size, xtol=_WITHIN * size))
            return place, point(place)
        low, high = 0.0, size
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if count(point(middle)) == count(anchor.last) else (low, middle)
            if high - low < _WITHIN * size:
                break
        return high, point(high)


def sorted_multipliers(image: ReturnMap) -> ComplexArray:
    """Eigenvalues of a return map by falling modulus."""
    values = np.linalg.eigvals(image.jacobian).astype(np.complex128)
    return values[np.lexsort((-values.imag, -np.abs(values)))]


def _pair_test(values: ComplexArray) -> float:
    first, second = np.triu_indices(values.size, 1)
    return float(np.prod(values[first] * values[second] - 1.0).real)


# Products of multipliers that are zero at an event and change sign there.
_TESTS: dict[Kind, Callable[[BranchPoint], float]] = {
    Kind.PERIOD_DOUBLING: lambda at: float(np.prod(at.multipliers + 1.0).real),
    Kind.BRANCH_POINT: lambda at: float(np.prod(at.multipliers - 1.0).real),
    Kind.NEIMARK_SACKER: lambda at: _pair_test(at.multipliers),
}


def _is_critical(values: ComplexArray, kind: Kind) -> bool:
    if kind is Kind.NEIMARK_SACKER:
        pairs = values[np.abs(values.imag) > _CRITICAL]
        return bool((np.abs(np.abs(pairs) - 1.0) < _CRITICAL).any())
    target = -1.0 if kind is Kind.PERIOD_DOUBLING else 1.0
    return bool((np.abs(values - target) < _CRITICAL).any())
