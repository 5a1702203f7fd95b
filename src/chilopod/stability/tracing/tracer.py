"""The tracer: one way along every curve, by steps of a length of its own, to where the curve ends.

A step is predicted, corrected at right angles to the tangent where it starts (Keller 1977; Kuznetsov, *Elements of
Applied Bifurcation Theory*, section 10.2), and cut off at an edge of the box or where the curve is closed.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.errors import AnalysisError, ChilopodError
from chilopod.stability.tracing import tolerances
from chilopod.stability.tracing.ending import Ending
from chilopod.stability.tracing.equations import Equations, OutsideBoxError, Plane, R
from chilopod.stability.tracing.step import A, Guess, S, Step, predicted

Array = NDArray[np.float64]
F = TypeVar("F")


def trace(
    equations: Equations[A, S, R],
    anchor: A,
    sizes: tuple[float, float],
    points: int | None,
    look: Callable[[Step[A, S], Ending | None], tuple[F, Ending | None]],
    keep: Callable[[F, int], None],
) -> tuple[Ending, str, float]:
    """Follow a curve.

    Parameters
    ----------
    equations, anchor
        The curve, and the point to start from.
    sizes
        First and longest step.
    points
        Number of steps at most; None for any number.
    look
        ``look(step, ending)`` finds what happens within a step, and why the curve ends with it, if it does; it raises a
        ChilopodError where a shorter step may succeed.
    keep
        ``keep(found, count)`` is told what was found within the step with number ``count``, which is taken.

    Returns
    -------
    Why it ends, what stood in the way if it was lost, and the step to go on with.
    """
    longest = sizes[1]
    size = min(sizes)
    if outward(equations.box, anchor.values, anchor.tangent[equations.parameters(anchor)[0]]):
        return Ending.LEFT_INTERVAL, "", size
    for count in itertools.count(1) if points is None else range(1, points + 1):
        shortened = False
        while True:
            if equations.budget.spent:
                return Ending.BUDGET, "", size
            try:
                step, ending = _taken(equations, anchor, size, count)
                found, ending = look(step, ending)
                break
            except (ChilopodError, ArithmeticError, ValueError) as error:
                # A parameter may step out of what the systems can have, whatever these then raise.
                shortened = True
                size *= tolerances.RETRY
                if size < tolerances.SHORTEST * longest and not equations.budget.spent:
                    return Ending.LOST, str(error), size
        if not shortened:  # or an edge of what the system can have would be met again at once
            few, many = step.corrections <= tolerances.FEW, step.corrections > tolerances.MANY
            size *= tolerances.GROWTH if few else tolerances.FALL if many else 1.0
        size = min(longest, size)
        keep(found, count)
        if ending is not None:
            return ending, "", size
        anchor = step.end
    return Ending.ENOUGH_POINTS, "", size


def outward(box: Array, values: Array, ahead: Array) -> bool:
    """True if a curve leaves the box where it is, its parameters heading a given way."""
    return bool((((values <= box[:, 0]) & (ahead < 0.0)) | ((values >= box[:, 1]) & (ahead > 0.0))).any())


class Parts(Generic[A, S, R]):
    """Parts of a step, each solved for once."""

    def __init__(self, equations: Equations[A, S, R], step: Step[A, S]) -> None:
        self.equations, self.step = equations, step
        self._known = {step.size: step}

    def at(self, place: float) -> Step[A, S]:
        """The part of the step up to a place along its first tangent."""
        if place not in self._known:
            plane = Plane(self.step.start.tangent, place)
            self._known[place] = self.equations.step(self.step.start, self.step.between(place), plane)
        return self._known[place]


def _taken(equations: Equations[A, S, R], anchor: A, size: float, count: int) -> tuple[Step[A, S], Ending | None]:
    """A step of a size, or a shorter one to an edge of the box or to the start of the curve."""
    guess, ahead = predicted(anchor, size), Plane(anchor.tangent, size)
    edge, step = _edge(equations, anchor, guess), None
    if edge is None:
        try:
            step = equations.step(anchor, guess, ahead, bounded=True)
        except OutsideBoxError as error:
            edge = error.edge
    ending = None
    if edge is not None:
        with contextlib.suppress(AnalysisError):  # it may turn back just before the edge, or in it
            step, ending = _to_edge(equations, anchor, size, edge), Ending.LEFT_INTERVAL
    step = equations.arrived(equations.step(anchor, guess, ahead, bounded=True) if step is None else step)
    length = float(np.linalg.norm(step.moved))
    if not step.size >= tolerances.STRAIGHT * length:
        raise AnalysisError("the step went astray", field="step")
    if step.missed > tolerances.SURPRISE * length:
        half = Parts(equations, step).at(0.5 * step.size)
        if not float(np.linalg.norm(half.moved - step.between(half.size).moved)) <= tolerances.AWAY * length:
            raise AnalysisError("the curve is not smooth within the step", field="step")
    closed = _closed(equations, step) if ending is None and count > 2 else None
    return (step, ending) if closed is None else (closed, Ending.CLOSED)


def _edge(equations: Equations[A, S, R], anchor: A, guess: Guess) -> tuple[int, float] | None:
    """The edge of the box that is crossed first on the way to a guess: the number of a parameter, and its value."""
    parameters, widths = equations.parameters(anchor)
    way = widths * guess.moved[parameters]
    ends = np.clip(anchor.values + way, *equations.box.T)
    outside = np.flatnonzero(ends != anchor.values + way)
    if not outside.size:
        return None
    j = min(outside.tolist(), key=lambda i: float((ends[i] - anchor.values[i]) / way[i]))
    return j, float(ends[j])


def _to_edge(equations: Equations[A, S, R], anchor: A, size: float, edge: tuple[int, float]) -> Step[A, S]:
    """A step that ends on an edge of the box, about as long as it was to be."""
    for _ in equations.box:
        try:
            step = _on_edge(equations, anchor, size, edge)
        except OutsideBoxError as error:  # of the other parameter, and before
            edge = error.edge
            continue
        if not 0.0 < step.size <= tolerances.OVER * size:
            break
        return step
    raise AnalysisError("the curve does not reach the end of the interval within the step", field="step")


def _on_edge(equations: Equations[A, S, R], anchor: A, size: float, edge: tuple[int, float]) -> Step[A, S]:
    """The point of the curve where it is predicted to reach an edge first."""
    parameters, widths = equations.parameters(anchor)
    j = parameters.start + edge[0]
    target = (edge[1] - anchor.values[edge[0]]) / widths[edge[0]]
    low, high = 0.0, size
    beyond = np.sign(predicted(anchor, size).moved[j] - target)
    for _ in range(30):
        middle = 0.5 * (low + high)
        past = (predicted(anchor, middle).moved[j] - target) * beyond > 0.0
        low, high = (low, middle) if past else (middle, high)
    guess = predicted(anchor, high)
    guess.moved[j] = target
    return equations.step(anchor, guess, Plane(np.eye(guess.moved.size)[j], target, edge), bounded=True)


def _closed(equations: Equations[A, S, R], step: Step[A, S]) -> Step[A, S] | None:
    """The part of a step up to where the curve passes its first point again; None if it does not."""
    first, ahead, seen = equations.first_from(step.start)
    row = np.zeros(step.moved.size)
    row[seen] = step.moved[seen]
    length = float(np.linalg.norm(row))
    row /= max(length, np.finfo(float).tiny)
    target = float(row @ first)
    if not 0.0 < target <= length:
        return None
    place = float(brentq(lambda place: row @ step.between(place).moved - target, 0.0, step.size, xtol=1e-15))
    guess = step.between(place)
    if not float(np.linalg.norm((guess.moved - first)[seen])) <= tolerances.NEAR * step.size:
        return None
    try:
        part = equations.arrived(equations.step(step.start, guess, Plane(row, target), bounded=True))
    except ChilopodError:
        return None
    near = float(np.abs(part.moved - first)[seen].max()) <= tolerances.SAME * step.size
    same = near and float(part.tangent[seen] @ ahead[seen]) > 0.0 and equations.is_first(part)
    return part if same else None
