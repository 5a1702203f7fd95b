"""The curve of periodic orbits of a family: equations for the tracer.

The curve is H(x, p) = x, in units: x in the sizes of the states, p in a scale. For a system without a period of its
own, every step uses the section across the motion at its start.

The tracer calls ``step``, whose corrector calls ``residual``, ``off``, ``met`` and ``exact``, then ``arrived`` for the
anchor of the next step, and ``first_from`` and ``is_first`` where the curve may close. The other methods serve the
starts of branches and the search for events within a step.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.frozen import Array, ComplexArray
from chilopod.stability import returns
from chilopod.stability.branches.branch_points import (
    Anchor,
    BranchPoint,
    FamilyReturns,
    OnCurve,
    Returned,
    null_vector,
    symmetric_space,
    within_space,
)
from chilopod.stability.continuation.equations import Before, Corrected, Equations, Guess, OutsideBoxError, Plane, Step
from chilopod.stability.continuation.tolerances import RETRY, SETTLED, SHARPEST_TURN, SHORTEST
from chilopod.stability.equilibria import SHRINKS, SHRUNK, has_shrunk
from chilopod.stability.floquet import full_period
from chilopod.stability.interface import is_autonomous, offers, returns_per_period
from chilopod.stability.orbits.orbit import rounds_in
from chilopod.stability.orbits.shooting import FEW_ROUNDS, Free, Problem, node_count, nodes_along, shot
from chilopod.stability.returns import ReturnMap, Section
from chilopod.stability.spectrum import return_multipliers, spectrum

_CLEAR = 10.0  # factor on the difference of two computations for a residual that may be the flow's error
_BESIDE = 1e-10  # change of the parameter, relative to its scale, that shows its effect on a return
_SMALLEST = 1e-3  # size, in units, below which the precision of an orbit no longer rises
_FEWEST_NODES, _MANY_NODES = 3, 6  # numbers of nodes below which one suffices, and above which one fails
_SOONER, _LATER = 0.2, 0.5  # largest predicted change of the time of a return, relative to it
_NOT_SMALL = 0.5  # modulus of a multiplier that is not small
_LONGER = 1.4  # duration of a return, relative to the predicted one, above which it may be several rounds
_PARTS = 64  # parts of a period at which states on an orbit are sampled
_SAME_PERIOD = 1e-3  # relative difference of the periods of the same orbit


class Curve(FamilyReturns, Equations[Anchor, OnCurve, Returned]):
    """The curve H(x, p) = x of a family, to a precision relative to the sizes of the states."""

    first: BranchPoint  # first point of the curve
    long_steps = False  # True if no step shorter than the default one is wanted

    def matrix(self, jacobian: Array, derivative: Array, tangent: Array) -> Array:
        """Jacobian of [H - x; tangent . step] with respect to state and parameter, in units."""
        with np.errstate(over="ignore"):
            scaled = jacobian * self.sizes / self.sizes[:, None] - np.eye(len(jacobian))
        return np.block([[scaled, (derivative / self.sizes)[:, None]], [tangent[None]]])

    def matrix_at(
        self, x: Array, value: float, section: Section | None, row: Array, bounded: bool, mapped: Array | None = None
    ) -> tuple[ReturnMap, Array]:
        """The return map at a state, and :meth:`matrix` there with its last row; from H there if it is known."""
        image = self.image(x, value, section, bounded)
        return image, self.matrix(image.jacobian, self.by_parameter(x, value, section, mapped), row)

    def moved(self, start: BranchPoint, x: Array, value: float) -> Array:
        """Displacement of an orbit from a point, in units, shape (n+1,)."""
        return np.append(x - start.orbit, value - start.value) / self.units

    def reached(self, start: BranchPoint, moved: Array) -> tuple[Array, float]:
        """State and parameter at a displacement from a point; the inverse of :meth:`moved`."""
        total = self.units * moved
        return start.orbit + total[:-1], start.value + float(total[-1])

    def anchor(self, last: BranchPoint, before: BranchPoint | None = None, ahead: float = 0.0) -> Anchor:
        """The anchor of a point; at a branch point its matrix is computed ``ahead`` along the tangent, or less far."""
        section = self.section_at(last.orbit, last.value, last.period)
        if section is not None:  # that of the point may be another one, if its units were
            tangent = np.append(self._projection(section) @ last.tangent[:-1], last.tangent[-1])
            last = replace(last, tangent=tangent / np.linalg.norm(tangent))
        magnified = float(np.abs(last.multipliers).max(initial=0.0))
        self.steepness = max(1.0, magnified ** (1.0 / returns_per_period(self.system(last.value))))
        x = last.orbit + ahead * last.tangent[:-1] * self.sizes
        try:
            # With errors, to be equal to the end of a step, to the bit.
            matrix = self.matrix_at(x, last.value, section, last.tangent, True)[1]
        except AnalysisError:
            if ahead <= SHORTEST:
                raise
            return self.anchor(last, before, RETRY * ahead)
        # The matrix of a branch point was computed ahead, so it gives no prediction.
        earlier = None if before is None or before.special is not None else self.anchor(before)
        return self.anchored(last, matrix, section, earlier, ahead > 0.0)

    def anchored(
        self, last: BranchPoint, matrix: Array, section: Section | None, before: Anchor | None, leaving: bool = False
    ) -> Anchor:
        """The anchor of a point with its matrix, after the previous point with its matrix."""
        system, mode = self.system(last.value), last.tangent[:-1] if leaving else None
        space = symmetric_space(system, last.orbit, self.sizes, mode)
        if before is None:
            return Anchor(last, matrix, None, section, space, leaving)
        earlier, tangent, lengthening = before.last, np.array(before.tangent), 0.0
        back = self.moved(last, earlier.orbit, earlier.value)
        if section is not None and is_autonomous(system):
            assert last.period is not None
            assert earlier.period is not None
            lengthening = (last.period - earlier.period) / last.period / float(np.linalg.norm(back))
            along = self._projection(section)
            back[:-1], tangent[:-1] = along @ back[:-1], along @ tangent[:-1]
        return Anchor(last, matrix, Before(back, tangent, before.matrix), section, space, leaving, lengthening)

    def parameters(self, anchor: Anchor) -> tuple[slice, Array]:
        n = anchor.last.orbit.size
        return slice(n, n + 1), np.array([self.scale])

    def residual(self, anchor: Anchor, moved: Array, values: Array) -> tuple[Returned, Array]:
        sizes, space, value = self.sizes, anchor.space, float(values[0])
        x = anchor.last.orbit + sizes * moved[:-1]
        if space is not None:
            x = sizes * (space @ (x / sizes))
        mapped = self.mapped(x, value, anchor.section)
        residual = (mapped - x) / sizes
        return Returned(x, value, mapped), residual if space is None else space @ residual

    def off(self, found: Returned, residual: Array, move: Array) -> float:
        """Largest residual, relative to the orbit unless that is small."""
        return float(np.abs(residual).max()) / max(_SMALLEST, self._relative_size(found.x))

    def met(self, anchor: Anchor, found: Returned, off: float, stalled: int, singular: bool) -> bool:
        """True if the corrector has converged: a residual that no longer falls is the error of the flow."""
        if off <= self.precision:
            return True
        size = self._relative_size(found.x)
        residual = off * max(_SMALLEST, size)
        if singular or not stalled or residual > SETTLED * max(1.0, size):
            return False
        return residual <= _CLEAR * float(self.noise(found.x, found.value, anchor.section).max())

    def noise(self, x: Array, value: float, section: Section | None) -> Array:
        """Parts of a residual, shape (n,), in units, due to the error of a return: the difference of two computations,
        or the scatter of neighbouring returns, as a map has no parts."""
        image, system, sizes = self.image(x, value, section), self.system(value), self.sizes
        off = np.abs(returns.in_parts(system, x, image.duration) - image.state)
        return np.asarray((off if off.any() else returns.scatter(system, image, x, sizes, section)) / sizes)

    def size(self, step: Step[Anchor, OnCurve]) -> float:
        return float(np.linalg.norm(step.found.x / self.sizes))

    def stretches(self, step: Step[Anchor, OnCurve]) -> bool:
        """True unless short steps are wanted, or the system gives the sizes of its states."""
        return self.long_steps and not offers(self.system(step.found.value), "scale")

    def exact(self, anchor: Anchor, found: Returned, row: Array) -> Array | None:
        if not anchor.leaving:
            return None
        matrix = self.matrix_at(found.x, found.value, anchor.section, row, False, found.mapped)[1]
        return within_space(anchor.space, matrix)

    def step(self, anchor: Anchor, guess: Guess, plane: Plane, *, bounded: bool = False) -> Step[Anchor, OnCurve]:
        """The orbit near a guess, by multiple shooting where a return magnifies errors of the guess, or rounding, above
        the precision. ``bounded``: with a bound on the error of the multipliers at its end."""
        before = 0.0 if anchor.section is None else anchor.section.duration
        # The duration of a return is extrapolated from those of the last two points.
        longer = 1.0 + min(max(anchor.lengthening * float(np.linalg.norm(guess.moved)), -_SOONER), _LATER)
        step, expected = self._step(anchor, longer * before, guess, plane, bounded), min(1.0, longer) * before
        x, value, image, _ = step.found
        # The end of an orbit of two rounds may be a special point, but no ordinary one.
        suspect = bounded or image.duration > _LONGER * expected
        if suspect and (rounds := rounds_in(self.system(value), x, image.duration, self.sizes, expected)) > 1:
            again = self._step(anchor, image.duration / rounds, Guess(step.moved, guess.matrix), plane, bounded)
            return replace(again, missed=step.missed)
        return step

    def _step(self, anchor: Anchor, time: float, guess: Guess, plane: Plane, bounded: bool) -> Step[Anchor, OnCurve]:
        """A step, with the expected ``time`` of a return, if that belongs to the orbit."""
        timed = anchor if anchor.section is None else replace(anchor, section=replace(anchor.section, duration=time))
        last, n, space = anchor.last, anchor.last.orbit.size, anchor.space
        self.steepness = max(1.0, float(np.abs(anchor.matrix[:n, n]).max()))
        count = node_count(within_space(space, guess.matrix)[:n, :n] + np.eye(n), np.ones(n))
        off, weakest, corrections = np.full(2, self.precision), np.zeros(2), 0
        if count >= _MANY_NODES:
            moved, x, value, image, matrix = self._shot(anchor, plane, count)
            if bounded:
                with contextlib.suppress(AnalysisError):  # the flow may magnify too much over the whole return
                    image = replace(image, error=self.image(x, value, timed.section, with_error=True).error)
        else:
            timed, solved = self._solved(anchor, timed, guess, plane, count)
            (x, value, mapped), moved, corrections = solved.found, solved.moved, solved.corrections
            # The residual shows one direction. Second comes the parameter alone.
            inverse, correction = solved.inverse, solved.inverse @ solved.residual
            off = _CLEAR * np.array([np.linalg.norm(correction), abs(correction[-1])])
            weakest = np.array([np.linalg.svd(inverse, compute_uv=False)[0], np.linalg.norm(inverse[-1])])
            image, matrix = self.matrix_at(x, value, timed.section, last.tangent, bounded, mapped)
        tangent = null_vector(within_space(space, matrix))
        if not tangent @ last.tangent >= SHARPEST_TURN:
            raise AnalysisError("the curve turns too sharply", field="step")
        matrix[n] = tangent
        wrong = self._wrong(anchor, x, image, moved, matrix, off, weakest) if bounded else np.inf
        missed = float(np.linalg.norm(moved - guess.moved))
        return Step(anchor, moved, OnCurve(x, value, image, wrong), tangent, matrix, corrections, missed)

    def _solved(
        self, anchor: Anchor, timed: Anchor, guess: Guess, plane: Plane, count: int
    ) -> tuple[Anchor, Corrected[Returned]]:
        """The orbit near a guess, or else near the result of multiple shooting, and the anchor with its duration."""
        matrix = within_space(anchor.space, guess.matrix)
        try:
            return timed, self.corrected(timed, Guess(guess.moved, matrix), plane)
        except OutsideBoxError:
            raise
        except AnalysisError:
            if count < _FEWEST_NODES:
                raise
        moved, _, _, image, _ = self._shot(anchor, plane, count)
        if timed.section is not None:
            timed = replace(timed, section=replace(timed.section, duration=image.duration))
        return timed, self.corrected(timed, Guess(moved, matrix), plane)

    def _shot(self, anchor: Anchor, plane: Plane, count: int) -> tuple[Array, Array, float, ReturnMap, Array]:
        """Displacement in units, state, parameter, return map and :meth:`matrix`, by multiple shooting."""
        last, section, space = anchor.last, anchor.section, anchor.space
        system, units, shared = self.system(last.value), self.units, None
        if space is not None:
            shared = units[:-1, None] * np.linalg.eigh(space)[1][:, -round(float(np.trace(space))) :]
        duration = returns.return_duration(system) if section is None else section.duration
        start = np.append(last.orbit, last.value)
        self.budget.take(2 * FEW_ROUNDS)  # each in parts
        nodes = nodes_along(system, last.orbit, duration, count, last.value)
        if space is not None:  # no correction would remove what is left of asymmetry
            nodes = nodes._replace(states=nodes.states / units[:-1] @ space * units[:-1])
        free = Free(plane.row, plane.target, start, self.scale)
        problem = Problem(lambda value: self.system(self._inside(value)), free, shared)
        found = shot(problem, nodes, units[:-1], section)
        x, value = found.nodes.states[0], self._inside(found.nodes.value) if plane.edge is None else plane.edge[1]
        system = self.system(value)
        image = returns.on_section(system, section, x, found.jacobian, found.nodes.duration)
        matrix = self.matrix(image.jacobian, image.across @ found.by_value * self.scale, last.tangent)
        return (np.append(x, value) - start) / units, x, value, image, matrix

    def _inside(self, value: float) -> float:
        """A value of the parameter inside the interval; one within rounding of an end becomes that end."""
        inside = min(max(value, self.between[0]), self.between[1])
        if not abs(value - inside) <= self.precision * self.scale:
            raise OutsideBoxError(0, inside, value)
        return inside

    def _wrong(
        self, anchor: Anchor, x: Array, image: ReturnMap, moved: Array, matrix: Array, off: Array, weakest: Array
    ) -> float:
        """Error of the derivative due to that of the orbit: ``off``, and ``weakest`` times the error of the flow."""
        n, sizes = x.size, self.sizes
        # Units may be much larger than the orbit.
        reach = max(_SMALLEST, float(np.linalg.norm(moved[:n])), float(np.linalg.norm(x / sizes)))
        length = max(min(reach, float(np.linalg.norm(moved))), float(np.finfo(float).tiny))
        bend = float(np.linalg.norm(matrix[:n, :n] - anchor.matrix[:n, :n])) / length
        # The flow's error relative to its magnification is a bound already.
        error = np.broadcast_to(image.error, (n, n)) * sizes / sizes[:, None]
        flow = float(error.max()) / max(1.0, float(np.linalg.norm(matrix[:n, :n])))
        wrong = off + weakest * flow * max(1.0, self._relative_size(x))
        stays = abs(moved[n]) <= _CLEAR * wrong[1]
        by_parameter = self._bend_by_parameter(anchor, x, image, moved[n]) if stays else 0.0
        return float(np.array([bend, by_parameter]) @ wrong)

    def _bend_by_parameter(self, anchor: Anchor, x: Array, image: ReturnMap, moved: float) -> float:
        """Change of the return map's derivative with the parameter, in units, where that along the curve hides it."""
        section, value = anchor.section and replace(anchor.section, duration=image.duration), anchor.last.value
        step = max(_BESIDE, 8.0 * float(np.spacing(abs(value))) / self.scale)
        step = step if value + (moved + step) * self.scale <= self.between[1] else -step
        try:
            beside = self.image(x, value + (moved + step) * self.scale, section)
        except AnalysisError:
            return np.inf
        change = (beside.jacobian - image.jacobian) * self.sizes / self.sizes[:, None]
        return float(np.linalg.norm(change)) / abs(step)

    def arrived(self, step: Step[Anchor, OnCurve]) -> Step[Anchor, OnCurve]:
        """A step with the anchor at its end, on the section there."""
        anchor, (x, value, image, wrong) = step.start, step.found
        values, bound = self.multipliers(image, wrong)
        tangent, matrix, system, motion = step.tangent, step.matrix, self.system(value), 0.0
        section = returns.section_at(system, x, self.sizes, image.duration)
        if section is not None and anchor.section is not None and is_autonomous(system):
            motion = self._checked_motion(anchor, anchor.section, step.found)
            along = self._projection(section)
            tangent, matrix = np.array(tangent), np.array(matrix)
            tangent[:-1] = along @ tangent[:-1]
            tangent /= np.linalg.norm(tangent)
            matrix[:-1] = along @ matrix[:-1]
            # H - x on the new section: it maps the direction of the motion to zero.
            matrix[:-1, :-1] += along - np.eye(x.size)
            matrix[-1] = tangent
        point = BranchPoint(value, x, values, tangent, self.units, None, image.period, bound, periods=self.periods)
        before = None if anchor.leaving or anchor.last.special is not None else anchor
        return replace(step, end=replace(self.anchored(point, matrix, section, before), motion=motion))

    def _checked_motion(self, anchor: Anchor, section: Section, found: OnCurve) -> float:
        """Largest motion so far. Check that an orbit has not shrunk into an equilibrium, beyond which the same orbits
        come again half a period later. A fraction f of the largest motion lies at a distance f^2 in the parameter from
        the Hopf point, and the precision leaves that uncertain by an f-th part."""
        velocity = returns.velocity_at(self.system(found.value), found.x)
        motion = float(np.linalg.norm(velocity / self.sizes)) * found.image.period
        if float(section.normal @ velocity) > 0.0 and motion >= SHRUNK * np.cbrt(self.precision) * anchor.motion:
            return max(anchor.motion, motion)
        self.budget.take()
        if has_shrunk(self.system(found.value), found.x, self.sizes, motion, found.image):
            raise AnalysisError(f"{SHRINKS}: a Hopf point", field="orbit")
        raise AnalysisError("the motion nearly stops in the section, and the next step has no direction", field="orbit")

    def first_from(self, anchor: Anchor) -> tuple[Array, Array, slice]:
        moved = self.moved(anchor.last, self.first.orbit, self.first.value)
        return moved, self.first.tangent, slice(0 if anchor.section is None else moved.size - 1, None)

    def is_first(self, step: Step[Anchor, OnCurve]) -> bool:
        """True if a state of the first orbit is on the orbit at the end of a step, for any choice of time 0."""
        first, point = self.first, step.end.last
        if step.start.section is None:
            return True
        if first.period is None or abs(point.period - first.period) > _SAME_PERIOD * first.period:
            return False
        self.budget.take()
        states = nodes_along(self.system(point.value), point.orbit, point.period, _PARTS).states
        away = (np.vstack([states, point.orbit]) - first.orbit) / self.sizes
        chords = np.diff(away, axis=0)
        lengths = np.maximum((chords**2).sum(axis=1), 1e-300)
        share = np.clip(-(away[:-1] * chords).sum(axis=1) / lengths, 0.0, 1.0)
        distance = np.linalg.norm(away[:-1] + share[:, None] * chords, axis=1)
        # A chord lies inside the curve by an eighth of its squared length times the curvature.
        return bool(distance.min() <= np.abs(np.diff(away, n=2, axis=0)).max())

    def multipliers(self, image: ReturnMap, wrong: float = 0.0) -> tuple[ComplexArray, float]:
        """Multipliers of the full period, by falling modulus, and a bound on the errors of those that are not small,
        for an additional error of the derivative, in units; infinite without a bound."""
        if not (np.isfinite(wrong) and np.isfinite(image.error).all()):
            return return_multipliers(image) ** image.returns, np.inf
        spec = spectrum(replace(image, error=image.error + wrong * self.sizes[:, None] / self.sizes))
        found = full_period(spec.values, spec.error, image.returns, image.state, image.period)
        moduli = np.abs(spec.values)
        telling = found.error_bounds[moduli >= min(_NOT_SMALL, moduli.max(initial=0.0))]
        return found.values, float(telling.max(initial=0.0))

    def _relative_size(self, x: Array) -> float:
        return float(np.abs(x / self.sizes).max())

    def _projection(self, section: Section) -> Array:
        """Projection onto a section along the motion at its point, in units, in which both are at right angles."""
        normal = section.normal * self.sizes
        return np.eye(normal.size) - np.outer(normal, normal)
