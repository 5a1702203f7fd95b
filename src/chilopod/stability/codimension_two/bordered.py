"""The equations of a curve of critical periodic orbits in two parameters.

Unknowns are the state x, both parameters and, for a critical pair of multipliers, its cosine kappa = cos theta: a
:class:`Place`. The equations are H(x) = x for the return map H and, for a multiplier nu = +1 or -1, g = 0 with g from

    [[H' - nu, b], [c^T, 0]] (v, g) = (0, 1),

which vanishes with det(H' - nu) but is as smooth as H' and well scaled (Govaerts, *Numerical Methods for Bifurcations
of Dynamical Equilibria*, SIAM 2000, ch. 4). For a pair, H'^2 - 2 kappa H' + 1 is bordered twice and G = 0 is a matrix
of shape (2, 2) (ch. 5; Kuznetsov, *Elements of Applied Bifurcation Theory*, section 10.3). On the critical plane
H'^2 - 2 kappa H' + 1 = (trace - 2 kappa) H' + (1 - det), so G has only two independent entries, and these two factors
are the equations: regular also where the pair meets at +1 or -1. If the systems know their orbit, x is not an unknown;
if the orbit has a spatial symmetry, x varies among the states with it, and H - 1 is regular also at a pitchfork.

A :class:`Frame` has the units of the unknowns and the borders b and c, which change little from point to point. A
:class:`CriticalCurve` evaluates the equations in a frame (:class:`Evaluated`), and makes points of the curve, each with
a frame of its own and a tangent (:class:`Spot`), from which the tracer takes its steps.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.stability.continuation.equations import Before, Equations, Guess, OutsideBoxError, Plane, Step, inverted
from chilopod.stability.continuation.tolerances import ROUND_OFF, SETTLED, SHARPEST_TURN_UNSEEN
from chilopod.stability.continuation.tracer import check_crossing
from chilopod.stability.equilibria import SHRINKS, SHRUNK, has_shrunk
from chilopod.stability.interface import SystemLike, offers, sizes, system_of
from chilopod.stability.orbits.orbit import closings, from_known, known_state
from chilopod.stability.returns import ReturnMap, Section, return_duration, return_map, section_at, velocity_at
from chilopod.stability.symmetry.groups import symmetric_states

Family2 = Callable[[float, float], SystemLike]  # ``family2(p, q)`` is the system at values of two parameters
_AT_ZERO = 1e6  # change over the box, relative to the sizes of the states, of an orbit at zero
_STEP = 1e-6  # step of differences, in units of the frame: it affects only the speed of Newton's method
_RESOLVED, _LONGEST = 1e-8, 0.1  # least such step of a parameter, relative to its values, and the longest
_APART = 0.3  # overlap of v and w above which v and w are the borders b and c
_DOUBLE = 1e-13  # singular value, relative to the largest, of a bordered matrix that is singular: G errs as much
_MEETING = 1e-4  # smallest singular value of the equations, in units, where curves of orbits meet
_STALLED = 3  # corrections that did not halve a small residual, as Broyden's method may stall that long


@dataclass(frozen=True, eq=False)
class Place(ReadOnlyArrays):
    """Unknowns: ``state``, shape (n,), ``values`` of both parameters, shape (2,), and the cosine of a pair (else 0)."""

    state: Array
    values: Array
    cosine: float


@dataclass(frozen=True, eq=False)
class Frame(ReadOnlyArrays):
    """Units and borders of the equations, for m directions of the orbit (0 if known) and k critical multipliers."""

    size: Array  # size of the states, shape (n,)
    widths: Array  # widths of the parameters' intervals, shape (2,)
    basis: Array  # orthonormal directions, in units of ``size``, shape (n, m)
    column: Array  # borders b and c, shape (n, k)
    row: Array
    mixture: Array  # combines the entries of G to the k equations, shape (k, k * k)
    section: Section | None  # section of returns, for a system that does not depend on time

    def between(self, start: Place, end: Place) -> Array:
        """Coordinates of one place relative to another: state, parameters and, for a pair, cosine."""
        moved = self.basis.T @ ((end.state - start.state) / self.size)
        turned = [end.cosine - start.cosine] * (self.column.shape[1] - 1)
        return np.concatenate([moved, (end.values - start.values) / self.widths, turned])

    def moved(self, start: Place, step: Array) -> Place:
        """The place at a displacement from another; the inverse of :meth:`between`."""
        m = self.basis.shape[1]
        state = start.state + self.size * (self.basis @ step[:m])
        return Place(state, start.values + self.widths * step[m : m + 2], start.cosine + float(step[m + 2 :].sum()))

    def carried(self, direction: Array, other: Frame) -> Array:
        """A direction in the coordinates of this frame, from those in another frame of the same curve."""
        m = other.basis.shape[1]
        state = other.size * (other.basis @ direction[:m]) / self.size
        return np.concatenate([self.basis.T @ state, direction[m:]])

    @property
    def parameters(self) -> slice:
        """Indices of the parameters among the coordinates."""
        m = self.basis.shape[1]
        return slice(m, m + 2)


@dataclass(frozen=True, eq=False)
class Evaluated(ReadOnlyArrays):
    """The equations at a place."""

    place: Place  # place, and the return map there
    image: ReturnMap
    frame: Frame
    jacobian: Array  # Jacobian of the return map in units of the frame, shape (n, n)
    error: Array  # bounds on the errors of its entries
    residual: Array  # left sides of the equations, shape (m + k,)
    right: Array  # v and w, shape (n, k), which are null vectors where the residual is zero; in units of the frame
    left: Array
    reach: float  # norm of the inverse of the bordered matrix


@dataclass(frozen=True, eq=False)
class Spot(Evaluated):
    """Point of a curve, in its frame: an :class:`~chilopod.stability.continuation.equations.Anchor` of steps."""

    matrix: Array  # derivative of the equations, with the tangent below, shape (m + k + 1, m + k + 1)
    tangent: Array  # unit tangent, shape (m + k + 1,)
    uncertainty: Array  # bounds on the errors of the left sides of the equations, shape (m + k,)
    before: Before | None = None  # previous point in coordinates of this one

    @property
    def values(self) -> Array:
        return self.place.values

    @property
    def shift(self) -> Array:
        """Bounds on the errors of the coordinates, at right angles to the curve, shape (m + k + 1,)."""
        return np.asarray(np.abs(np.linalg.pinv(self.matrix[:-1])) @ self.uncertainty)

    def towards(self, sign: float) -> Spot:
        tangent = sign * self.tangent
        return replace(self, tangent=tangent, matrix=np.vstack([self.matrix[:-1], tangent]))


class CriticalCurve(Equations[Spot, Evaluated, Evaluated]):
    """The curve along which a multiplier ``target``, +1 or -1, or a pair (0) is critical; ``known`` orbits are not
    unknowns. Widths of the box are the parameters' units."""

    first: Spot  # first point of the curve
    shrinks = SHRINKS  # reason for its end where its cycles do
    copies = 1  # number of equal pairs
    single: Array | None = None  # projection that leaves one of several
    _motion = 0.0  # largest motion within a period so far

    def __init__(self, family2: Family2, target: int, known: bool, box: Array, budget: Budget) -> None:
        self._family2, self.target, self.known = family2, target, known
        self.box, self.widths, self.budget = box, box[:, 1] - box[:, 0], budget
        # In units of a narrow interval the rounding of the values is coarser.
        values = np.abs(box).max(axis=1) / self.widths
        self._steps = np.clip(_RESOLVED * values, _STEP, _LONGEST)
        self.narrowness = max(1.0, np.finfo(float).eps / ROUND_OFF * float(values.max()))
        self.precision, self.settled = self.narrowness * ROUND_OFF, self.narrowness * SETTLED

    def system(self, values: Array) -> SystemLike:
        return system_of(self._family2, *values.tolist())

    def begin(self, place: Place, period: float) -> Spot:
        """The point of the curve nearest to a place beside it, with about the full period there, NaN if unknown."""
        system = self.system(place.values)
        duration = return_duration(system, period) if np.isfinite(period) else None
        section = None if self.known else section_at(system, place.state, duration=duration)
        place, image = self._mapped(place, section, False)
        frame = self._framed(system, place, image, self._size(system, place, image, section), None)
        anchor = self.spot(place, frame, None)
        try:
            found = self._nearest(anchor)
        except AnalysisError as error:
            if error.field != "step":
                raise
            allowed = "a point located in this family at `second`"
            raise AnalysisError("the curve was not found", field="start", allowed=allowed) from error
        return self.spot(found.place, anchor.frame, None)

    def _nearest(self, anchor: Spot) -> Evaluated:
        """The equations at the point of the curve nearest to a spot beside it, or on an edge of the box before it; on
        its own edge for a spot on one, as the rounding of a point beside it would hide the way there."""
        for j, k in np.argwhere(anchor.values[:, None] == self.box).tolist():
            with suppress(AnalysisError):
                return self._on_edge(anchor, (j, float(self.box[j, k])))
        try:
            return self.along(anchor, 0.0)
        except OutsideBoxError as error:
            return self._on_edge(anchor, error.edge)

    def _on_edge(self, anchor: Spot, edge: tuple[int, float]) -> Evaluated:
        """The equations at the point of the curve on an edge of the box beside a spot."""
        j, end = edge
        row = np.eye(anchor.tangent.size)[anchor.frame.parameters.start + j]
        plane = Plane(row, float((end - anchor.values[j]) / self.widths[j]), edge)
        return self.step(anchor, Guess(plane.target * row, anchor.matrix), plane).found

    def spot(self, place: Place, frame: Frame, before: Array | None) -> Spot:
        """A point on the curve, in a frame adapted to it, with its tangent along the one ``before``."""
        system = self.system(place.values)
        section = frame.section and section_at(system, place.state, frame.size, frame.section.duration)
        place, image = self._mapped(place, section, True)
        if closings(system, place.state, image.duration, frame.size) > 1:  # a later passage of the section
            raise AnalysisError("the motion closes before the period is over", field="step")
        own = self._framed(system, place, image, np.maximum(frame.size, np.abs(place.state)), frame)
        at = self._equations(place, image, own)
        matrix = self._derivative(at)
        tangent = np.linalg.svd(matrix)[2][-1]
        if before is not None:
            tangent = tangent * np.sign(tangent @ own.carried(before, frame))
        return Spot(**vars(at), matrix=np.vstack([matrix, tangent]), tangent=tangent, uncertainty=self._uncertainty(at))

    def parameters(self, anchor: Spot) -> tuple[slice, Array]:
        return anchor.frame.parameters, anchor.frame.widths

    def residual(self, anchor: Spot, moved: Array, values: Array) -> tuple[Evaluated, Array]:
        at = self.evaluated(replace(anchor.frame.moved(anchor.place, moved), values=values), anchor.frame)
        return at, at.residual

    def off(self, found: Evaluated, residual: Array, move: Array) -> float:
        return float(np.abs(move).max())

    def met(self, anchor: Spot, found: Evaluated, off: float, stalled: int, singular: bool) -> bool:
        """True if the residual is round-off, or small and within its error, or no longer falls."""
        within = (np.abs(found.residual) <= anchor.uncertainty - np.abs(anchor.residual)).all()
        return bool(off <= self.precision or (off <= self.settled and (within or stalled >= _STALLED)))

    def step(self, anchor: Spot, guess: Guess, plane: Plane, *, bounded: bool = False) -> Step[Spot, Evaluated]:
        solved = self.corrected(anchor, guess, plane)
        missed = float(np.linalg.norm(solved.moved - guess.moved))
        return Step(anchor, solved.moved, solved.found, anchor.tangent, anchor.matrix, solved.corrections, missed)

    def along(self, spot: Spot, size: float) -> Evaluated:
        """The equations at the point of the curve at a distance along the tangent of a near one."""
        return self.step(spot, Guess(size * spot.tangent, spot.matrix), Plane(spot.tangent, size)).found

    def arrived(self, step: Step[Spot, Evaluated]) -> Step[Spot, Evaluated]:
        """A step with the point at its end, in a frame adapted to it."""
        start, frame = step.start, step.start.frame
        self._check_moving(step.found)
        end = self.spot(step.found.place, frame, start.tangent)
        ahead = frame.carried(end.tangent, end.frame)
        ahead /= np.linalg.norm(ahead)
        if not ahead @ start.tangent >= SHARPEST_TURN_UNSEEN:
            raise AnalysisError("the curve turns too sharply", field="step")
        error = np.nan_to_num([start.shift, end.shift], nan=SETTLED, posinf=SETTLED)
        check_crossing(self, replace(step, tangent=ahead, end=end), self._derivative, float(error.max()))
        back, tangent = end.frame.between(end.place, start.place), end.frame.carried(start.tangent, frame)
        before = Before(self._onto(end, back), self._onto(end, tangent), None)
        return replace(step, tangent=ahead, end=replace(end, before=before))

    def _check_moving(self, found: Evaluated) -> None:
        """Check that a cycle has not shrunk into an equilibrium. The fold of small cycles r (m + b r^2 - r^4) = 0 is at
        b = 2 r^2, and an error of these equations, which is divided by r^3, leaves that uncertain by an r^5-th part."""
        section, x, size = found.frame.section, found.place.state, found.frame.size
        if section is None:
            return
        system = self.system(found.place.values)
        velocity = velocity_at(system, x)
        motion = float(np.linalg.norm(velocity / size)) * found.image.period
        self._motion = max(self._motion, motion)
        if float(section.normal @ velocity) > 0.0 and motion >= SHRUNK * self.precision**0.2 * self._motion:
            return
        self.budget.take()
        if has_shrunk(system, x, size, motion, found.image):
            raise AnalysisError(self.shrinks, field="orbit")

    def _onto(self, spot: Spot, direction: Array) -> Array:
        """A direction with its state projected along the motion onto the section of a spot, if it has one."""
        frame, m = spot.frame, spot.frame.basis.shape[1]
        if frame.section is None:
            return direction
        state = spot.image.across @ (frame.size * (frame.basis @ direction[:m]))
        return np.concatenate([frame.basis.T @ (state / frame.size), direction[m:]])

    def meets(self, spot: Spot) -> bool:
        """True if the equations are singular, as where curves of orbits meet."""
        return bool(np.linalg.svd(spot.matrix[:-1], compute_uv=False)[-1] <= _MEETING / self.narrowness)

    def first_from(self, anchor: Spot) -> tuple[Array, Array, slice]:
        frame, first = anchor.frame, self.first
        seen = slice(0 if frame.section is None else frame.parameters.start, None)
        return frame.between(anchor.place, first.place), frame.carried(first.tangent, first.frame), seen

    def evaluated(self, place: Place, frame: Frame) -> Evaluated:
        """The equations at a place, without error bounds."""
        return self._equations(*self._mapped(place, frame.section, False), frame)

    def _mapped(self, place: Place, section: Section | None, with_error: bool) -> tuple[Place, ReturnMap]:
        self.budget.take()
        system = self.system(place.values)
        if self.known:
            orbit = from_known(system, known_state(system), with_error)
            return replace(place, state=orbit.state), orbit.image
        return place, return_map(system, place.state, with_error, section)

    def _size(self, system: SystemLike, place: Place, image: ReturnMap, section: Section | None) -> Array:
        size = sizes(system, place.state, image.duration)
        if self.known or offers(system, "scale"):
            return size
        # The parameters set the size of an orbit that rests at zero, but for round-off.
        reach = 0.0
        for j in range(2):
            values = place.values.copy()
            values[j] += self._inward(place, j) * self.widths[j]
            moved = self._mapped(replace(place, values=values), section, False)[1].state - image.state
            reach = max(reach, float((np.abs(moved) / size).max()) / self._steps[j])
        return size * reach if reach > (_AT_ZERO if place.state.any() else 0.0) else size

    def _inward(self, place: Place, j: int) -> float:
        """A step of one parameter, in units of its interval, that stays within it."""
        step = float(self._steps[j])
        return step if place.values[j] + step * self.widths[j] <= self.box[j, 1] else -step

    def _framed(self, system: SystemLike, place: Place, image: ReturnMap, size: Array, before: Frame | None) -> Frame:
        """The frame at a place; its borders come from the previous frame, so that they change continuously."""
        n, k = size.size, 1 if self.target else 2
        basis = np.zeros((n, 0)) if self.known else symmetric_states(system, place.state, size)
        section = None if image.normal is None else Section(place.state, image.normal, image.duration)
        jacobian = self._scaled(image, size)
        critical = self._critical(jacobian, place.cosine)
        if before is None:
            left, _, right = np.linalg.svd(critical)
            column, row = left[:, n - k :], right[n - k :].T
        else:
            units = size[:, None] / before.size[:, None]
            row, column, _ = _bordered(critical, before.column / units, before.row * units)
        column, row = _orthonormal(column), _orthonormal(row)
        mixture: Array = np.eye(1)
        if k == 2:
            right, left, _ = _bordered(critical, column, row)
            shapes = np.stack([-(left.T @ jacobian @ right).ravel(), -(left.T @ right).ravel()], axis=1)
            mixture = np.asarray(np.linalg.pinv(shapes), dtype=np.float64)
        # g then stays smooth where another multiplier becomes critical; w and v are regular at a double one.
        elif abs(overlap := float((column.T @ row).item())) > _APART:
            column, row = row * np.sign(overlap), column * np.sign(overlap)
        return Frame(size, self.widths, basis, column, row, mixture, section)

    def _scaled(self, image: ReturnMap, size: Array) -> Array:
        """The derivative of the return map in units, with one of equal pairs."""
        jacobian = image.jacobian if self.single is None else image.jacobian @ self.single
        return jacobian * size / size[:, None]

    def _critical(self, jacobian: Array, cosine: float) -> Array:
        one = np.eye(len(jacobian))
        if self.target:
            return jacobian - self.target * one
        return np.asarray(jacobian @ jacobian - 2.0 * cosine * jacobian + one)

    def _equations(self, place: Place, image: ReturnMap, frame: Frame) -> Evaluated:
        jacobian = self._scaled(image, frame.size)
        error = np.broadcast_to(image.error, jacobian.shape) * frame.size / frame.size[:, None]
        right, left, inverse = _bordered(self._critical(jacobian, place.cosine), frame.column, frame.row)
        k = right.shape[1]
        orbit = frame.basis.T @ ((image.state - place.state) / frame.size)
        residual = np.concatenate([orbit, frame.mixture @ inverse[-k:, -k:].ravel()])
        return Evaluated(place, image, frame, jacobian, error, residual, right, left, float(np.linalg.norm(inverse, 2)))

    def _derivative(self, at: Evaluated) -> Array:
        """Derivative of the equations with respect to the coordinates, exact or by differences."""
        frame, m, k = at.frame, at.frame.basis.shape[1], at.right.shape[1]
        columns = []
        for j in range(m + 2):
            step = np.zeros(m + k + 1)
            step[j] = self._inward(at.place, j - m) if j >= m else _STEP
            columns.append((self.evaluated(frame.moved(at.place, step), frame).residual - at.residual) / step[j])
        if k == 2:
            columns.append(np.append(np.zeros(m), 2.0 * frame.mixture @ (at.left.T @ at.jacobian @ at.right).ravel()))
        matrix = np.array(columns).T
        matrix[:m, :m] = frame.basis.T @ (at.jacobian @ frame.basis - frame.basis)
        return matrix

    def _uncertainty(self, at: Evaluated) -> Array:
        frame, error, wrong, power = at.frame, at.error, at.error, 1
        if not self.target:
            own = np.abs(at.jacobian)
            wrong, power = error @ own + own @ error + 2.0 * abs(at.place.cosine) * error, 2
        rounding = 4.0 * np.finfo(float).eps
        # The error of the derivative determines that of the returned state.
        returned = error.sum(axis=1) + rounding * np.abs(at.place.state) / frame.size
        critical = np.abs(frame.mixture) @ (np.abs(at.left.T) @ wrong @ np.abs(at.right)).ravel()
        norms = np.linalg.norm(at.left) * np.linalg.norm(at.right) * np.linalg.norm(frame.mixture, 2)
        critical = critical + rounding * float(norms * np.linalg.norm(at.jacobian) ** power)
        return np.abs(at.residual) + np.concatenate([np.abs(frame.basis.T) @ returned, critical])


def _bordered(matrix: Array, column: Array, row: Array) -> tuple[Array, Array, Array]:
    """v and w of the bordered matrix, shape (n, k) each, and its inverse, with G in its last corner."""
    n, k = column.shape
    whole = np.block([[matrix, column], [row.T, np.zeros((k, k))]])
    inverse, _ = inverted(whole, _DOUBLE)  # where another multiplier is critical, v and w of the shortest solution
    return inverse[:n, n:], inverse[n:, :n].T, inverse


def _orthonormal(columns: Array) -> Array:
    """Orthonormal columns of the same span; a single one keeps its direction."""
    if columns.shape[1] == 1:
        return columns / np.linalg.norm(columns)
    return np.asarray(np.linalg.qr(columns)[0])
