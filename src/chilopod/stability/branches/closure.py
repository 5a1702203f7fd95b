"""Closing of a curve of periodic orbits where it comes back to its start."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import ChilopodError
from chilopod.stability.branches.branch_points import BranchPoint, Step
from chilopod.stability.branches.curve import Curve

Array = NDArray[np.float64]

_NEAR = 0.05  # of a step: the cubic passes so close by that the curve is solved for there
_SAME = 1e-5  # in units
_ALONG = 0.9  # cosine between the two tangents
_PARTS = 64  # of a period, in which the states on an orbit are compared with one
_SAME_PERIOD = 1e-3


def closes(curve: Curve, first: BranchPoint, step: Step) -> Step | None:
    """The part of a step up to where the curve passes its first point again; None if it does not."""
    last = step.start.last
    if step.start.section is not None:
        return _closes_on_orbit(curve, first, step)
    away = np.append(first.orbit - last.orbit, first.value - last.value) / curve.units(first.orbit.size)
    place = float(last.tangent @ away)
    if not 0.0 < place <= step.size:
        return None
    if not float(np.linalg.norm(step.between(place)[0] - away)) <= _NEAR * step.size:
        return None
    part = _part(curve, step, place)
    if part is None or not float(np.linalg.norm(part.moved - away)) <= _SAME:
        return None
    return part if float(part.tangent @ first.tangent) >= _ALONG else None


def _part(curve: Curve, step: Step, place: float) -> Step | None:
    if place == step.size:
        return step
    try:
        return curve.within(step, place, bounded=True)
    except ChilopodError:
        return None


def _closes_on_orbit(curve: Curve, first: BranchPoint, step: Step) -> Step | None:
    """The same where any state of the first orbit will do: the parameter passes its value in the same direction, and
    then its state is on the orbit."""
    target = (first.value - step.start.last.value) / curve.scale
    if not 0.0 < target * np.sign(step.moved[-1]) <= abs(step.moved[-1]):
        return None
    low, high = 0.0, step.size
    for _ in range(50):
        middle = 0.5 * (low + high)
        past = abs(step.between(middle)[0][-1]) > abs(target)
        low, high = (low, middle) if past else (middle, high)
    try:
        part = curve.to_value(step.start, first.value, *step.between(high))
    except ChilopodError:
        return None
    if float(part.tangent[-1] * first.tangent[-1]) <= 0.0:
        return None
    point = part.end.last
    assert point.period is not None
    if first.period is None or abs(point.period - first.period) > _SAME_PERIOD * first.period:
        return None
    system, sizes = curve.system(point.value), curve.units(point.orbit.size)[:-1]
    states = [point.orbit]
    curve.budget.take(_PARTS)
    for _ in range(_PARTS):
        states.append(system.flow(np.array(states[-1]), 0.0, point.period / _PARTS)[0])
    path = (np.array(states) - first.orbit) / sizes
    chords = np.diff(path, axis=0)
    lengths = np.maximum((chords**2).sum(axis=1), 1e-300)
    share = np.clip(-(path[:-1] * chords).sum(axis=1) / lengths, 0.0, 1.0)
    distance = np.linalg.norm(path[:-1] + share[:, None] * chords, axis=1)
    # Chords run inside the curve by an eighth of the square of the part, times its bend.
    within = float(np.abs(np.diff(path, n=2, axis=0)).max())
    return part if float(distance.min()) <= within else None
