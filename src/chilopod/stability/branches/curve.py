"""One step along a curve of periodic orbits.

The curve is H(x, p) = x, parametrised by its arclength in units: x in the sizes of the states, p in a scale. A step is
predicted from the last two points and their tangents, and corrected at right angles to the last tangent (Keller 1977;
Kuznetsov, *Elements of Applied Bifurcation Theory*, section 10.2). Of a system without a period of its own, every step
has the section across the motion where it starts.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import read_only
from chilopod.stability.branches.bordered_matrices import inverted, null_vector, symmetric_space, within_space
from chilopod.stability.branches.branch_points import Anchor, BranchPoint, Step
from chilopod.stability.branches.family_returns import FamilyReturns
from chilopod.stability.convergence import CURVE
from chilopod.stability.floquet import full_period
from chilopod.stability.orbits.shooting import FEW_ROUNDS, Free, node_count, nodes_along, shot
from chilopod.stability.problem.budget import SpentError, UserCode
from chilopod.stability.problem.capabilities import (
    Family,
    is_autonomous,
    returns_per_period,
)
from chilopod.stability.problem.returns import (
    ReturnMap,
    Section,
    return_duration,
    section_at,
)
from chilopod.stability.spectrum.eigenvalues import return_multipliers, spectrum

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

PRECISION = 1e-12
"""How closely orbits are solved for by default, of the sizes of the states; where the flow is not as good, as it is."""

_COUNTED = 1e-10  # residuals above it count as corrections, by which steps grow or shrink
_CLEAR = 10.0  # times the difference of two computations: a residual that may be the flow's error
_SMALLEST = 1e-3  # of the units: an orbit that is smaller is solved for no more closely
_LOOSE = 1e-6  # of a step: an orbit that may be so far off is corrected with a matrix of its own
_MOST_CORRECTIONS = 12
_FEWEST_NODES, _MANY_NODES = 3, 6  # a return that magnifies less is as good in one; that magnifies more is none
_STRAYS = 0.1  # of a step: so far beyond the interval a curve is sought that ends within it
_SOONER, _LATER = 0.2, 0.5  # of a return: the time of the next one is foreseen to differ by so much at most
_SHARPEST_TURN = 0.5  # cosine between two tangents: beyond it the step may have landed on another curve
_SHRUNK = 10.0  # cube roots of the precision, of the largest motion so far
_PARTS = 32  # of a return, in which the extent of an orbit is taken
_NOT_SMALL = 0.5  # modulus of a multiplier


class Curve(FamilyReturns):
    """The curve H(x, p) = x of a family.

    Parameters
    ----------
    family, scale, sizes, returns
        See :class:`FamilyReturns`.
    precision
        Precision to which orbits are solved for, relative to the sizes of the states.
    """

    def __init__(
        self, family: Family, scale: float, sizes: Array | None = None, *, precision: float = PRECISION, **returns: Any
    ) -> None:
        super().__init__(family, scale, sizes, **returns)
        self.precision = precision
        self._motion = 0.0  # the largest within a period so far

    def matrix(self, jacobian: Array, derivative: Array, tangent: Array) -> Array:
        """Jacobian of [H - x; tangent . step] with respect to state and parameter, in units."""
        sizes = self.units(len(jacobian))[:-1]
        scaled = jacobian * sizes / sizes[:, None] - np.eye(len(jacobian))
        return np.block([[scaled, (derivative / sizes)[:, None]], [tangent[None]]])

    def anchor(
        self, last: BranchPoint, before: BranchPoint | None = None, ahead: float = 0.0, leaving: bool = False
    ) -> Anchor:
        """Where a step from a point starts, its matrix taken so far ``ahead`` along the tangent."""
        section = self.section(last)
        matrix = self._matrix_at(last, ahead, section)
        # The matrix of a point where branches meet was not its own, so it tells nothing about the next one.
        if before is None or before.special is not None:
            return Anchor(last, matrix, None, section, leaving)
        return Anchor(last, matrix, (before, read_only(self._matrix_at(before, 0.0, section))), section)

    def section(self, point: BranchPoint) -> Section | None:
        """Across the motion in a point, where returns need one."""
        return self.section_at(point.orbit, point.value, point.period)

    def _matrix_at(self, point: BranchPoint, ahead: float, section: Section | None) -> Array:
        x = point.orbit + ahead * point.tangent[:-1] * self.units(point.orbit.size)[:-1]
        # As at the end of a step, to the bit.
        jacobian = self.image(x, point.value, section, with_error=True).jacobian
        derivative = self.parameter_derivative(x, point.value, section)
        return self.matrix(jacobian, derivative, point.tangent)

    def step(self, anchor: Anchor, size: float) -> Step:
        """A step so far along the tangent.

        Raises
        ------
        AnalysisError
            If the corrections do not converge, or end where the curve would have turned too sharply.
        """
        moved, matrix = self.predicted(anchor, size)
        return self._stepped(anchor, moved, matrix, anchor.last.tangent, size, bounded=True)

    def within(self, step: Step, place: float, *, bounded: bool = False) -> Step:
        """As much of a step as leads to a place within it; ``bounded``: with a bound on its multipliers."""
        moved, matrix = step.between(place)
        return self._stepped(step.start, moved, matrix, step.start.last.tangent, place, bounded=bounded)

    def to_value(self, anchor: Anchor, value: float, guess: Array, matrix: Array) -> Step:
        """A step that ends at a value of the parameter exactly, from a guess of the displacement."""
        row = np.zeros(guess.size)
        row[-1] = 1.0
        target = (value - anchor.last.value) / self.scale
        return self._stepped(anchor, guess, matrix, row, target, value, bounded=True)

    def predicted(self, anchor: Anchor, size: float) -> tuple[Array, Array]:
        """Displacement at which a step should end, in units, and the matrix there: by the cubic through the last two
        points along their tangents and by the straight line through their matrices; by the tangent and the matrix where
        there is but one point."""
        last = anchor.last
        if anchor.before is None:
            return size * last.tangent, np.array(anchor.matrix)
        before, matrix_before = anchor.before
        units = self.units(last.orbit.size)
        back = np.append(last.orbit - before.orbit, last.value - before.value) / units
        earlier = np.array(before.tangent)
        if anchor.section is not None:
            along = self._onto(anchor)
            back[:-1], earlier[:-1] = along @ back[:-1], along @ earlier[:-1]
        length = float(np.linalg.norm(back))
        # Newton's form over the nodes 0, 0, -length, -length.
        slope = back / length
        second = (last.tangent - slope) / length
        third = (second - (slope - earlier) / length) / length
        matrix = anchor.matrix + (size / length) * (anchor.matrix - matrix_before)
        matrix[-1] = last.tangent
        return size * (last.tangent + size * (second + (size + length) * third)), matrix

    def _onto(self, anchor: Anchor) -> Array:
        """Projection along the motion onto the section of a step, in units, shape (n, n)."""
        assert anchor.section is not None
        system = self.system(anchor.last.value)
        assert is_autonomous(system)
        return self._projection(np.asarray(system.velocity(anchor.section.point)), anchor.section)

    def _projection(self, velocity: Array, section: Section) -> Array:
        sizes = self.units(velocity.size)[:-1]
        normal = section.normal * sizes
        return np.eye(velocity.size) - np.outer(velocity / sizes, normal) / float(section.normal @ velocity)

    def _stepped(
        self,
        anchor: Anchor,
        guess: Array,
        matrix: Array,
        row: Array,
        target: float,
        value: float | None = None,
        *,
        bounded: bool = False,
    ) -> Step:
        """Correct a guess to H = x and row . moved = target; by multiple shooting where a return magnifies so much that
        the guess is none, or that rounding is magnified to more than an orbit is solved for. ``bounded``: with a bound
        on the error of the multipliers at its end."""
        last, n = anchor.last, anchor.last.orbit.size
        self.steepness = max(1.0, float(np.abs(anchor.matrix[:n, n]).max()))
        section = self._timed(anchor, float(np.linalg.norm(guess)))
        mode = last.tangent[:n] if anchor.leaving else None
        fixed = symmetric_space(self.system(last.value), last.orbit, self.units(n)[:n], mode)
        where = _Where(anchor, section, fixed, row, target, value)
        count = node_count(matrix[:n, :n] + np.eye(n), np.ones(n)) if fixed is None else 0
        rounds, off, weakest = 0, self.precision, 0.0
        if count >= _MANY_NODES:
            moved, x, here, image, derivative = self._shot(where, count)
            if bounded:
                with contextlib.suppress(AnalysisError):  # over the whole return the flow may magnify too much
                    image = replace(image, error=self.image(x, here, section, with_error=True).error)
        else:
            try:
                found = self._corrected(where, guess, matrix)
            except (OutsideIntervalError, SpentError):
                raise
            except AnalysisError:
                if count < _FEWEST_NODES:
                    raise
                there = self._shot(where, count)
                if section is not None:
                    duration = there[3].period / there[3].returns
                    where = replace(where, section=replace(section, duration=duration))
                found = self._corrected(where, there[0], matrix)
            moved, x, here, rounds = found.moved, found.x, found.value, found.rounds
            off, weakest = found.off, found.weakest
            image = self.image(x, here, where.section, bounded)
            derivative = self.difference(x, here, where.section, found.mapped, found.beside)
        bordered = self.matrix(image.jacobian, derivative, last.tangent)
        tangent = null_vector(within_space(fixed, bordered))
        if not tangent @ last.tangent >= _SHARPEST_TURN:
            raise AnalysisError("the curve turns too sharply", field="step")
        bordered[n] = tangent
        # The derivative is that of a state so far off; units may be much larger than the orbit.
        reach = max(_SMALLEST, float(np.linalg.norm(moved[:n])), float(np.linalg.norm(x / self.units(n)[:n])))
        length = max(min(reach, float(np.linalg.norm(moved))), float(np.finfo(float).tiny))
        bend = float(np.linalg.norm(bordered[:n] - anchor.matrix[:n])) / length
        # The flow's error, relative to what it may magnify, is a bound already.
        flow = float(self._scaled(image.error, n).max()) / max(1.0, float(np.linalg.norm(bordered[:n, :n])))
        off += weakest * flow * max(1.0, float(np.abs(x / self.units(n)[:n]).max()))
        end = self._end(anchor, x, here, image, tangent, bordered, bend * off if bounded else np.inf)
        missed = float(np.linalg.norm(moved - guess))
        return Step(anchor, end, float(last.tangent @ moved), moved, tangent, bordered, image, rounds, missed)

    def _shot(self, where: _Where, count: int) -> tuple[Array, Array, float, ReturnMap, Array]:
        """Displacement in units, state, parameter, return map and its derivative by the parameter, per scale, by
        multiple shooting from the last point."""
        last, section = where.anchor.last, where.section
        system, units = self.system(last.value), self.units(last.orbit.size)
        duration = return_duration(system) if where.anchor.section is None else where.anchor.section.duration
        start = np.append(last.orbit, last.value)
        self.budget.take(2 * FEW_ROUNDS)  # each in parts
        with UserCode("flow", last.value):
            nodes = nodes_along(system, last.orbit, duration, count, last.value)
            free = Free(where.row, where.target, start, self.scale)
            found = shot(lambda value: self.system(self._inside(value)), nodes, units[:-1], where.anchor.section, free)
        x, value = found.nodes.states[0], self._inside(found.nodes.value) if where.value is None else where.value
        system = self.system(value)
        count, velocity, across = returns_per_period(system), None, np.eye(x.size)
        if section is not None and is_autonomous(system):
            velocity = np.asarray(system.velocity(x))
            across -= np.outer(velocity, section.normal) / float(section.normal @ velocity)
        image = ReturnMap(
            x,
            across @ found.jacobian,
            np.nan,
            count,
            count * found.nodes.duration,
            velocity,
            None if section is None else section.normal,
        )
        return (np.append(x, value) - start) / units, x, value, image, across @ found.by_value * self.scale

    def _inside(self, value: float) -> float:
        """A value of the parameter that the family may be asked for; on the interval's end but for rounding, that."""
        inside = min(max(value, self.between[0]), self.between[1])
        if not abs(value - inside) <= self.precision * self.scale:
            raise OutsideIntervalError("leaves the interval", field="parameter", value=value)
        return inside

    def _corrected(self, where: _Where, guess: Array, matrix: Array) -> _Corrected:
        """Correct a guess by Broyden's method."""
        anchor, section, fixed, row = where.anchor, where.section, where.fixed, where.row
        last, n = anchor.last, anchor.last.orbit.size
        units = self.units(n)
        moved, matrix = np.array(guess), np.array(matrix)
        matrix[-1] = row
        matrix = within_space(fixed, matrix)
        by_parameter = matrix[:n, n]
        inverse, singular = inverted(matrix)
        largest = np.inf
        move = residual_before = np.zeros(n + 1)
        rounds = corrections = 0
        exact = False
        while True:
            x = last.orbit + units[:n] * moved[:n]
            if fixed is not None:
                x = units[:n] * (fixed @ (x / units[:n]))
            wanted = last.value + self.scale * float(moved[n]) if where.value is None else where.value
            here = min(max(wanted, self.between[0]), self.between[1])
            # A curve that turns back at the end of the interval is sought beyond it on the way there.
            strays = (wanted - here) / self.scale
            if abs(strays) > _STRAYS * float(np.linalg.norm(guess)):
                raise OutsideIntervalError("leaves the interval", field="parameter", value=wanted)
            mapped, beside = self.mapped(x, here, section)
            off = (mapped - x) / units[:n]
            if fixed is not None:
                off = fixed @ off
            residual = np.append(off + strays * by_parameter, row @ moved - where.target)
            now = float(np.abs(residual).max())
            if not np.isfinite(now) or (now > 10.0 * largest and now > CURVE.settled):
                raise AnalysisError("corrections diverge", field="step")
            size = max(_SMALLEST, float(np.abs(x / units[:n]).max()))
            closed = now <= self.precision * size
            # A residual that no longer falls is what the flow is good to, if the matrix can make it fall.
            settled = not closed and CURVE.stays(now / max(1.0, size), largest / max(1.0, size)) and not singular
            settled = settled and now <= _CLEAR * self.noise(x, here, section)
            if closed or settled:
                # Where it leaves another curve the matrix is so weak that a small residual is far from an orbit.
                far = float(np.linalg.norm(inverse @ residual)) > _LOOSE * float(np.linalg.norm(moved))
                if exact or not (anchor.leaving and far):
                    break
            if rounds == _MOST_CORRECTIONS:
                raise AnalysisError("corrections do not converge", field="step")
            if closed or settled:
                jacobian, exact = self.image(x, here, section).jacobian, True
                here_matrix = self.matrix(jacobian, self.difference(x, here, section, mapped, beside), row)
                inverse, singular = inverted(within_space(fixed, here_matrix))
            elif rounds:
                # Broyden's update keeps the matrix of the last point good enough for the whole step.
                inverse = _updated(inverse, move, inverse @ (residual - residual_before))
            move = -inverse @ residual
            residual_before, largest = residual, now
            moved = moved + move
            rounds += 1
            corrections += now > _COUNTED * size
        if abs(strays) > self.precision:
            raise OutsideIntervalError("leaves the interval", field="parameter", value=wanted)
        # The residual shows one direction.
        left, weakest = float(np.linalg.norm(inverse @ residual)), float(np.linalg.norm(inverse, 2))
        return _Corrected(x, here, moved, mapped, beside, corrections, _CLEAR * left, weakest)

    def _end(
        self, anchor: Anchor, x: Array, value: float, image: ReturnMap, tangent: Array, matrix: Array, wrong: float
    ) -> Anchor:
        """Where the next step starts; the derivative is ``wrong`` by so much, in units, beside its own error."""
        values, bound = self.multipliers(image, wrong)
        before = None if anchor.leaving or anchor.last.special is not None else (anchor.last, anchor.matrix)
        section = None
        if anchor.section is not None:
            system = self.system(value)
            section = section_at(system, x, self.sizes, image.period / image.returns)
            assert section is not None
            assert is_autonomous(system)
            velocity = np.asarray(system.velocity(x))
            motion = float(np.linalg.norm(velocity / self.units(x.size)[:-1])) * image.period
            self._motion = max(self._motion, motion)
            # Past an equilibrium come the same orbits again, half a period later. Before it, a part f of the largest
            # motion is a parameter f^2 away from the Hopf point, which the precision leaves uncertain by its f-th part.
            passed = not float(anchor.section.normal @ velocity) > 0.0
            if passed or motion < _SHRUNK * np.cbrt(self.precision) * self._motion:
                raise AnalysisError(
                    "the orbit shrinks into an equilibrium: a Hopf point"
                    if self._extent(x, value, image) <= motion
                    else "the orbit nearly rests in its section, and the next step has no direction",
                    field="orbit",
                )
            along = self._projection(velocity, section)
            tangent, matrix = np.array(tangent), np.array(matrix)
            tangent[:-1] = along @ tangent[:-1]
            tangent /= np.linalg.norm(tangent)
            matrix[:-1] = along @ matrix[:-1]
            # H - x on the new section: the motion itself is mapped to zero, not to its negative shadow.
            matrix[:-1, :-1] += along - np.eye(x.size)
            matrix[-1] = tangent
        point = BranchPoint(value, x, values, tangent, units=self.units(x.size), period=image.period, error_bound=bound)
        return Anchor(point, matrix, before, section)

    def _extent(self, x: Array, value: float, image: ReturnMap) -> float:
        """Largest distance of an orbit from a state on it, in units; a small cycle is smaller than its velocity in any
        state times its period."""
        system, states = self.system(value), [x]
        self.budget.take()
        with UserCode("flow", value):
            for _ in range(_PARTS):
                states.append(system.flow(np.array(states[-1]), 0.0, image.period / image.returns / _PARTS)[0])
        return float(np.linalg.norm((np.array(states) - x) / self.units(x.size)[:-1], axis=1).max())

    def multipliers(self, image: ReturnMap, wrong: float = 0.0) -> tuple[ComplexArray, float]:
        """Multipliers of the full period, by falling modulus, and a bound on the errors of those that are not small.

        Parameters
        ----------
        image
            Return map on the orbit.
        wrong
            Error of its derivative beside its own, in units; infinite if no bound is wanted.
        """
        if not (np.isfinite(wrong) and np.isfinite(image.error).all()):
            return return_multipliers(image) ** image.returns, np.inf
        sizes = self.units(image.state.size)[:-1]
        spec = spectrum(replace(image, error=image.error + wrong * sizes[:, None] / sizes))
        found = full_period(spec.values, spec.error, image.returns, image.state, image.period)
        moduli = np.abs(spec.values)
        return found.values, float(found.error_bounds[moduli >= min(_NOT_SMALL, float(moduli.max()))].max())

    def _scaled(self, matrix: Array | float, n: int) -> Array:
        """A derivative of the return map, or the bound of its error, in units, shape (n, n)."""
        sizes = self.units(n)[:-1]
        return np.asarray(np.broadcast_to(matrix, (n, n)) * sizes / sizes[:, None])

    def _timed(self, anchor: Anchor, ahead: float) -> Section | None:
        """The section of a step, with the time of a return so far ahead by those of the last two points."""
        section = anchor.section
        if section is None or anchor.before is None:
            return section
        last, (before, _) = anchor.last, anchor.before
        assert last.period is not None
        assert before.period is not None
        away = np.append(last.orbit - before.orbit, last.value - before.value) / self.units(last.orbit.size)
        change = (last.period - before.period) / last.period * ahead / float(np.linalg.norm(away))
        return replace(section, duration=section.duration * (1.0 + min(max(change, -_SOONER), _LATER)))


@dataclass(frozen=True)
class _Where:
    """Equations of a step: where it starts, the section that returns end in, the projection onto states with the
    symmetries (or None), ``row . moved = target``, and the parameter's value where that is given."""

    anchor: Anchor
    section: Section | None
    fixed: Array | None
    row: Array
    target: float
    value: float | None


@dataclass(frozen=True)
class _Corrected:
    """A solution: state, parameter, displacement in units, return of the state, that beside it, corrections needed, how
    far off it may be by the residual that is left, in units, and how much more by any other one."""

    x: Array
    value: float
    moved: Array
    mapped: Array
    beside: Array | None
    rounds: int
    off: float
    weakest: float


def _updated(inverse: Array, move: Array, change: Array) -> Array:
    """Broyden's update of an inverse matrix, from a move and what the inverse makes of the residual's change."""
    along = float(move @ change)
    if along == 0.0:
        raise AnalysisError("corrections do not converge", field="step")
    return inverse + np.outer(move - change, move @ inverse) / along


class OutsideIntervalError(AnalysisError):
    """A step asked for a value of the parameter outside the interval."""
