"""Points of a curve, steps, predictor, equations, and corrector: Broyden's method within the box of the parameters."""

from __future__ import annotations

import contextlib
import functools
import itertools
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.stability.continuation import tolerances


@dataclass(frozen=True, eq=False)
class Before(ReadOnlyArrays):
    """The previous point in coordinates of an anchor: displacement, unit tangent and, if useful, the matrix."""

    moved: Array
    tangent: Array
    matrix: Array | None


class Anchor(Protocol):
    """A point of a curve from which steps start, in coordinates of its own.

    With N equations, ``tangent`` is a unit vector of shape (N+1,), and ``matrix`` has the derivative of the equations
    in its first N rows, and in its last one the tangent.
    """

    @property
    def tangent(self) -> Array: ...
    @property
    def matrix(self) -> Array: ...
    @property
    def values(self) -> Array:
        """Values of the parameters."""

    @property
    def before(self) -> Before | None: ...


A = TypeVar("A", bound=Anchor)
S = TypeVar("S")


class Guess(NamedTuple):
    """A displacement, shape (N+1,), and the matrix there, whose last row has no meaning."""

    moved: Array
    matrix: Array


def predicted(anchor: Anchor, size: float) -> Guess:
    """Predicted end of a step: by the cubic and the line through the last two points, or by the tangent of one."""
    tangent, matrix, before = anchor.tangent, anchor.matrix, anchor.before
    if before is None:
        return Guess(size * tangent, matrix)
    length = float(np.linalg.norm(before.moved))
    # Newton's form over the nodes 0, 0, -length, -length.
    slope = -before.moved / length
    second = (tangent - slope) / length
    third = (second - (slope - before.tangent) / length) / length
    if before.matrix is not None:
        matrix = matrix + (size / length) * (matrix - before.matrix)
    return Guess(size * (tangent + size * (second + (size + length) * third)), matrix)


@dataclass(frozen=True)
class Step(Generic[A, S]):
    """A step, or a part of one: a solution of the equations in coordinates of an anchor."""

    start: A  # the anchor
    moved: Array  # displacement, shape (N+1,)
    found: S  # the solution
    tangent: Array  # tangent and matrix at the end, in the coordinates of the start
    matrix: Array
    corrections: int = 0  # number of corrections that were needed
    missed: float = 0.0  # distance from its predicted end
    end: Any = None  # the anchor at the end; None for a part of a step

    @functools.cached_property
    def size(self) -> float:
        """Length along the first tangent."""
        return float(self.start.tangent @ self.moved)

    def between(self, place: float) -> Guess:
        """Displacement at a place by the cubic through both ends and tangents, and the matrix, interpolated."""
        t, size, first = place / self.size, self.size, self.start.tangent
        last = self.tangent / float(first @ self.tangent)
        moved = size * t * (1.0 - t) ** 2 * first + t * t * (3.0 - 2.0 * t) * self.moved
        moved = moved - size * t * t * (1.0 - t) * last
        return Guess(moved, self.start.matrix + t * (self.matrix - self.start.matrix))


R = TypeVar("R")


class OutsideBoxError(AnalysisError):
    """A step needs a value outside the box: number of the parameter and end of its interval."""

    def __init__(self, parameter: int, end: float, value: float) -> None:
        super().__init__("leaves the interval", field="parameter", value=value)
        self.edge = parameter, end


class Plane(NamedTuple):
    """The equation that ends a step, ``row . moved = target``; on an edge of the box a parameter's number and value."""

    row: Array
    target: float
    edge: tuple[int, float] | None = None


@dataclass(frozen=True)
class Corrected(Generic[R]):
    """A solution, with the residual and the inverse of the matrix there."""

    moved: Array
    found: R
    residual: Array
    inverse: Array
    corrections: int


class Equations(ABC, Generic[A, S, R]):
    """N equations with N+1 unknowns, in coordinates of an anchor."""

    box: Array  # intervals of the parameters, shape (parameters, 2): all evaluations are inside
    budget: Budget
    precision: float  # residual, in units of the parameters, that counts as zero
    settled = tolerances.SETTLED  # error that may stop falling

    @abstractmethod
    def parameters(self, anchor: A) -> tuple[slice, Array]:
        """Indices of the parameters among the coordinates, and their units."""

    @abstractmethod
    def residual(self, anchor: A, moved: Array, values: Array) -> tuple[R, Array]:
        """The equations evaluated at a displacement with values of the parameters, and the residual, shape (N,)."""

    @abstractmethod
    def off(self, found: R, residual: Array, move: Array) -> float:
        """Error of a solution, from the residual and its correction."""

    @abstractmethod
    def met(self, anchor: A, found: R, off: float, stalled: int, singular: bool) -> bool:
        """True if corrections end at this error, which the last few did not halve, or cannot (``singular``)."""

    @abstractmethod
    def step(self, anchor: A, guess: Guess, plane: Plane, *, bounded: bool = False) -> Step[A, S]:
        """The solution near a guess, with tangent and matrix; ``bounded``: with the errors at its end. An
        OutsideBoxError if it lies outside the box, an AnalysisError if none is found near the guess."""

    @abstractmethod
    def arrived(self, step: Step[A, S]) -> Step[A, S]:
        """A step with the anchor at its end."""

    @abstractmethod
    def first_from(self, anchor: A) -> tuple[Array, Array, slice]:
        """Displacement of the curve's first point, its tangent, and the coordinates that identify it."""

    def is_first(self, step: Step[A, S]) -> bool:
        """True if a step to the first point, by these coordinates, ends at it."""
        return True

    def size(self, step: Step[A, S]) -> float:
        """Size of the orbit at the end of a step, in units; infinite if its own size does not count."""
        return np.inf

    def stretches(self, step: Step[A, S]) -> bool:
        """True if the units of a curve are estimates, so that steps along straight parts may be longer."""
        return False

    def exact(self, anchor: A, found: R, row: Array) -> Array | None:
        """A new matrix at a solution whose corrector had a weak one; else None."""
        return None

    def corrected(self, anchor: A, guess: Guess, plane: Plane) -> Corrected[R]:
        """Correct a guess to a solution, with Broyden's updates of the last point's matrix for the whole step."""
        parameters, widths = self.parameters(anchor)
        moved, matrix = np.array(guess.moved), np.array(guess.matrix)
        matrix[-1] = plane.row
        inverse, singular = inverted(matrix)
        move = last = np.zeros(moved.size)
        best, stalled, corrections, exact = np.inf, 0, 0, False
        for rounds in itertools.count():
            wanted = anchor.values + widths * moved[parameters]
            if plane.edge is not None:
                wanted[plane.edge[0]] = plane.edge[1]
            values = np.minimum(np.maximum(wanted, self.box[:, 0]), self.box[:, 1])
            # The corrector may leave the box on its way to a curve that turns back at an edge.
            strays = (wanted - values) / widths
            self._check_inside(strays, values, wanted, tolerances.STRAYS * float(np.linalg.norm(guess.moved)))
            found, equations = self.residual(anchor, moved, values)
            residual = np.append(equations + matrix[:-1, parameters] @ strays, plane.row @ moved - plane.target)
            updated = _updated(inverse, move, inverse @ (residual - last)) if rounds else inverse
            off = self.off(found, residual, updated @ residual)
            if not np.isfinite(off) or (off > tolerances.DIVERGING * best and off > self.settled):
                raise AnalysisError("corrections diverge", field="step")
            stalled = stalled + 1 if off > 0.5 * best else 0
            met = self.met(anchor, found, off, stalled, singular)
            again = None
            if met and not exact and np.linalg.norm(inverse @ residual) > tolerances.LOOSE * np.linalg.norm(moved):
                again = self.exact(anchor, found, plane.row)
            if met and again is None:
                break
            if rounds == tolerances.MOST_CORRECTIONS:
                raise AnalysisError("corrections do not converge", field="step")
            inverse = updated
            if again is not None:
                (inverse, singular), exact = inverted(again), True
            move = -inverse @ residual
            last, best, moved = residual, min(best, off), moved + move
            corrections += off > tolerances.COUNTED
        self._check_inside(strays, values, wanted, self.precision)
        return Corrected(moved, found, residual, inverse, corrections)

    @staticmethod
    def _check_inside(strays: Array, values: Array, wanted: Array, allowed: float) -> None:
        j = int(np.abs(strays).argmax())
        if abs(strays[j]) > allowed:
            raise OutsideBoxError(j, float(values[j]), float(wanted[j]))


def inverted(matrix: Array, singular: float = tolerances.SINGULAR) -> tuple[Array, bool]:
    """Inverse of the matrix of a curve, shape (N+1, N+1), or that for shortest solutions, and True for the latter.

    At a branch point rounding decides how nearly singular the matrix is, and a solution with its inverse may end on the
    other branch. The shortest solution leaves the residual unchanged in a singular direction of the matrix.
    """
    with contextlib.suppress(np.linalg.LinAlgError):
        found = np.linalg.inv(matrix)
        if np.abs(found).max() * np.abs(matrix).max() < 1.0 / singular:
            return np.asarray(found), False
    try:
        return np.asarray(np.linalg.pinv(matrix, rcond=singular)), True
    except np.linalg.LinAlgError:
        raise AnalysisError("the curve has no direction here", field="step") from None


def _updated(inverse: Array, move: Array, change: Array) -> Array:
    """Broyden's update of an inverse matrix, from a move and the inverse's product with the residual's change."""
    along = float(move @ change)
    return inverse + np.outer(move - change, move @ inverse) / along if along else inverse
