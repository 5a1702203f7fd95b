"""The tracer: pseudo-arclength continuation of any curve, with step control, to its end.

A step is predicted, corrected at right angles to the tangent at its start (Keller 1977; Kuznetsov, *Elements of
Applied Bifurcation Theory*, section 10.2), and cut at an edge of the box or where the curve closes.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from scipy.optimize import brentq

from chilopod.errors import AnalysisError, ChilopodError
from chilopod.frozen import Array
from chilopod.labels import Labelled
from chilopod.stability.continuation import tolerances
from chilopod.stability.continuation.equations import A, Equations, Guess, OutsideBoxError, Plane, R, S, Step, predicted


class Ending(Labelled):
    """Reason for the end of a curve; each member's ``sentence`` describes it in words."""

    START = "start", "the curve was followed from here, the other way only"
    LEFT_INTERVAL = "left the interval", "the parameter reached an end of the interval"
    CLOSED = "closed", "the curve came back to where it started"
    RESONANCE = "resonance", "the two multipliers of the pair meet: here the curve ends indeed"
    ENOUGH_POINTS = "enough points", "as many points as were asked for"
    BUDGET = "budget", "as many flows, or as much time, as were allowed were spent"
    LOST = "lost", "the step became too small: the curve could not be followed further"


_CHANGE = 0.3  # change of an orbit within a step, relative to its own size, that counts
_PART = 0.1  # part of a step below which that change hardly shows in the step
_LEAST = 1e3  # missed prediction of an orbit, relative to the precision, that counts

F = TypeVar("F")


def trace(
    equations: Equations[A, S, R],
    anchor: A,
    sizes: tuple[float, float],
    points: int | None,
    look: Callable[[Step[A, S], Ending | None], tuple[F, Ending | None]],
    keep: Callable[[F, int], None],
) -> tuple[Ending, str, float]:
    """Follow a curve from its first point; return the ending, the reason or spent limit, and the size of the next step.

    The ``sizes`` are the first and the longest step, ``points`` the largest number of steps, None for any.
    ``look(step, ending)`` finds the events within a step, and the ending if the curve ends there, or raises a
    ChilopodError if a shorter step may succeed; ``keep(found, count)`` receives the events of accepted step ``count``.
    """
    size, longest = sizes
    if outward(equations.box, anchor.values, anchor.tangent[equations.parameters(anchor)[0]]):
        return Ending.LEFT_INTERVAL, "", size
    for count in itertools.count(1) if points is None else range(1, points + 1):
        shortened, planned = False, size
        while True:
            if equations.budget.spent:  # a later run begins the step anew
                return Ending.BUDGET, equations.budget.spent, planned
            try:
                step, ending = _taken(equations, anchor, size)
                found, ending = look(step, ending)
                if not equations.budget.spent:  # else events may be missing
                    break
            except (ChilopodError, ArithmeticError, ValueError) as error:
                # A parameter may leave the domain of the systems, which then raise any exception.
                shortened = True
                size *= tolerances.RETRY
                if size < tolerances.SHORTEST * longest and not equations.budget.spent:
                    lost = "no orbit is found beside the last one: corrections leave the interval"
                    # A guess is nothing that a user gives along a curve.
                    said = str(error).partition("; allowed: a guess closer")[0]
                    return Ending.LOST, lost if isinstance(error, OutsideBoxError) else said, size
        if not shortened:  # else the edge of the systems' domain would be met again at once
            few, many = step.corrections <= tolerances.FEW, step.corrections > tolerances.MANY
            size *= tolerances.GROWTH if few else tolerances.FALL if many else 1.0
        size = min(_largest(equations, step, longest), size)
        keep(found, count)
        if ending is not None:
            return ending, "", size
        anchor = step.end
    return Ending.ENOUGH_POINTS, "", size


def _largest(equations: Equations[A, S, R], step: Step[A, S], longest: float) -> float:
    """Largest next step. Where the cubic through the last points predicts far more than the longest step, estimated
    units are too small for the curve, and only the change of the parameters is limited by that step."""
    if not equations.stretches(step):
        return longest
    along = float(np.linalg.norm(step.end.tangent[equations.parameters(step.end)[0]]))
    missed = step.missed / (tolerances.EASY * float(np.linalg.norm(step.moved)))
    straight = step.size * min(tolerances.GROWTH, max(missed, 1e-9) ** -0.25)
    return max(longest, min(longest / max(along, 1e-9), straight))


def outward(box: Array, values: Array, ahead: Array) -> bool:
    """True if a curve at this place leaves the box, for a direction of its parameters."""
    return bool((((values <= box[:, 0]) & (ahead < 0.0)) | ((values >= box[:, 1]) & (ahead > 0.0))).any())


class Parts(Generic[A, S, R]):
    """Parts of a step, each corrected once."""

    def __init__(self, equations: Equations[A, S, R], step: Step[A, S]) -> None:
        self.equations, self.step = equations, step
        self._known = {step.size: step}

    def at(self, place: float) -> Step[A, S]:
        """The part of the step up to a place along its first tangent."""
        if place not in self._known:
            plane = Plane(self.step.start.tangent, place)
            self._known[place] = self.equations.step(self.step.start, self.step.between(place), plane)
        return self._known[place]


def check_crossing(
    equations: Equations[A, S, R], step: Step[A, S], derivative: Callable[[R], Array], error: float
) -> None:
    """Check that a step over which the sign of the determinant changes crosses another curve, where the curve goes
    straight on, and has not jumped to one nearby. Beside a crossing the equations are nearly singular, and an ``error``
    of the points hides the way of the curve over a length that is its root."""
    start, ahead, low, high = step.start, step.start.tangent, 0.0, step.size
    before, after = (np.linalg.slogdet(each.matrix)[0] for each in (start, step.end))
    hidden = tolerances.HIDDEN * float(np.sqrt(error * step.size))

    def guess(place: float) -> Guess:
        moved, (parameters, widths) = step.between(place).moved, equations.parameters(start)
        values = np.clip(start.values + widths * moved[parameters], *equations.box.T)
        return Guess(moved, np.vstack([derivative(equations.residual(start, moved, values)[0]), ahead]))

    while before != after and high - low > hidden:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.linalg.slogdet(guess(middle).matrix)[0] == before else (low, middle)
    if before != after:
        places = max(low - hidden, 0.0), min(high + hidden, step.size)
        first, last = (equations.step(start, guess(place), Plane(ahead, place)).moved for place in places)
        if not ahead @ (last - first) >= tolerances.STRAIGHT * float(np.linalg.norm(last - first)):
            raise AnalysisError("another one is too near to be told apart", field="curve")


def _taken(equations: Equations[A, S, R], anchor: A, size: float) -> tuple[Step[A, S], Ending | None]:
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
    missed = step.moved - predicted(anchor, step.size).moved
    states = np.delete(np.arange(missed.size), equations.parameters(anchor)[0])
    # Units may be much larger than an orbit that passes a narrow resonance: its own change counts too.
    own = max(float(np.linalg.norm(each[states])) for each in (step.moved, step.size * anchor.tangent))
    of_orbit = _CHANGE * equations.size(step) < own < _PART * length
    of_orbit &= float(np.linalg.norm(missed[states])) > max(tolerances.SURPRISE * own, _LEAST * equations.precision)
    if of_orbit or step.missed > tolerances.SURPRISE * length:
        half = Parts(equations, step).at(0.5 * step.size)
        away = half.moved - step.between(half.size).moved
        smooth = not of_orbit or float(np.linalg.norm(away[states])) <= tolerances.AWAY * own
        if not (smooth and float(np.linalg.norm(away)) <= tolerances.AWAY * length):
            raise AnalysisError("the curve is not smooth within the step", field="step")
    closed = _closed(equations, step) if ending is None else None
    return (step, ending) if closed is None else (closed, Ending.CLOSED)


def _edge(equations: Equations[A, S, R], anchor: A, guess: Guess) -> tuple[int, float] | None:
    """The first edge of the box on the way to a guess: the number of a parameter, and its value."""
    parameters, widths = equations.parameters(anchor)
    way = widths * guess.moved[parameters]
    ends = np.clip(anchor.values + way, *equations.box.T)
    outside = np.flatnonzero(ends != anchor.values + way)
    if not outside.size:
        return None
    j = min(outside.tolist(), key=lambda i: float((ends[i] - anchor.values[i]) / way[i]))
    return j, float(ends[j])


def _to_edge(equations: Equations[A, S, R], anchor: A, size: float, edge: tuple[int, float]) -> Step[A, S]:
    """A step that ends on an edge of the box, of about its planned length."""
    for _ in equations.box:
        try:
            step = _on_edge(equations, anchor, size, edge)
        except OutsideBoxError as error:  # of the other parameter, and before
            edge = error.edge
        else:
            if 0.0 < step.size <= tolerances.OVER * size:
                return step
            break
    raise AnalysisError("the curve does not reach the end of the interval within the step", field="step")


def _on_edge(equations: Equations[A, S, R], anchor: A, size: float, edge: tuple[int, float]) -> Step[A, S]:
    """The point of the curve at its first predicted edge."""
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
    """The part of a step up to the first point of the curve; None if the step does not reach it."""
    first, ahead, seen = equations.first_from(step.start)
    row = np.zeros(step.moved.size)
    row[seen] = step.moved[seen]
    length = float(np.linalg.norm(row))
    row /= max(length, np.finfo(float).tiny)
    target = float(row @ first)
    # Along a family by energy the parameter is rounding, and shows nothing.
    if length <= tolerances.SAME * step.size or not 0.0 < target <= length:
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
    return part if near and float(part.tangent[seen] @ ahead[seen]) > 0.0 and equations.is_first(part) else None
