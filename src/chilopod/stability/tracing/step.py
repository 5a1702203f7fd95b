"""Anchors of steps along a curve, steps between them, and the predictor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from chilopod.frozen import Array


class Before(NamedTuple):
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

    @property
    def size(self) -> float:
        """Length along the first tangent."""
        return float(self.start.tangent @ self.moved)

    def between(self, place: float) -> Guess:
        """Displacement at a place (along the first tangent), by the cubic through both ends along their tangents, and
        the matrix there by linear interpolation."""
        t, size, first = place / self.size, self.size, self.start.tangent
        last = self.tangent / float(first @ self.tangent)
        moved = (
            size * t * (1.0 - t) ** 2 * first + t * t * (3.0 - 2.0 * t) * self.moved - size * t * t * (1.0 - t) * last
        )
        return Guess(moved, self.start.matrix + t * (self.matrix - self.start.matrix))
