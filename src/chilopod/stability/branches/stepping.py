"""Steps along a curve of periodic orbits that stay on it and within the interval of the parameter."""

from __future__ import annotations

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.stability.branches.branch_points import Anchor, Step
from chilopod.stability.branches.curve import Curve, OutsideIntervalError

_STRAIGHT = 0.7  # cosine between a step and the tangent where it starts
_SURPRISE = 0.3  # of a step: predicted worse than that, it is held against half of it
_AWAY = 0.1  # of a step
_OVER = 2.0  # of a step that has to end on the interval's end: as long as that at most


def taken(curve: Curve, anchor: Anchor, size: float) -> tuple[Step, bool]:
    """A step of a size, or a shorter one to the end of the interval, and whether it is that.

    Raises
    ------
    AnalysisError
        If no step of that size stays on the curve.
    """
    last = anchor.last
    guess = curve.predicted(anchor, size)[0]
    low, high = ((end - last.value) / curve.scale for end in curve.between)
    left = not low <= guess[-1] <= high
    step: Step | None = None
    if not left:
        try:
            step = curve.step(anchor, size)
        except OutsideIntervalError:
            left = True
    if step is None:
        end = curve.between[0] if abs(guess[-1] - low) < abs(guess[-1] - high) else curve.between[1]
        try:
            step = _to_end(curve, anchor, size, end)
        except AnalysisError:
            # It may turn back just before the end, or in it.
            step, left = curve.step(anchor, size), False
    length = float(np.linalg.norm(step.moved))
    if not step.size >= _STRAIGHT * length:
        raise AnalysisError("the step went astray", field="step")
    if step.missed > _SURPRISE * length:
        half = curve.within(step, 0.5 * step.size)
        if not float(np.linalg.norm(half.moved - step.between(half.size)[0])) <= _AWAY * length:
            raise AnalysisError("the curve is not smooth within the step", field="step")
    return step, left


def _to_end(curve: Curve, anchor: Anchor, size: float, end: float) -> Step:
    """A step that ends on the interval's end, about as long as it was to be."""
    target = (end - anchor.last.value) / curve.scale
    place = _reaches(curve, anchor, size, target)
    guess, matrix = curve.predicted(anchor, place)
    guess[-1] = target
    step = curve.to_value(anchor, end, guess, matrix)
    if not 0.0 < step.size <= _OVER * size:
        raise AnalysisError("the curve does not reach the end of the interval so soon", field="step")
    return step


def _reaches(curve: Curve, anchor: Anchor, size: float, target: float) -> float:
    """At which part of a step the parameter is predicted to reach an end of the interval, first."""
    low, high = 0.0, size
    beyond = np.sign(curve.predicted(anchor, size)[0][-1] - target)
    for _ in range(30):
        middle = 0.5 * (low + high)
        past = (curve.predicted(anchor, middle)[0][-1] - target) * beyond > 0.0
        low, high = (low, middle) if past else (middle, high)
    return high
