"""Critical springs of robots that differ little.

A search finds every point of an interval. A robot beside one whose critical spring is known has a critical spring
nearby: there the return map of the straight walk has the multiplier of a pitchfork, -1 over half a period if the gait
is mirrored after it, else 1 over a period. Newton's method takes a tenth of the time of a search, but knows nothing of
points farther away.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from chilopod.analysis.parameters import K1
from chilopod.analysis.straight_walk import bifurcations
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.planar import PlanarModel
from chilopod.robot import Robot
from chilopod.stability import Kind

_STEP = 1e-6  # of differences, relative
_MOST, _FOUND = 12, 1e-12  # steps of Newton's method, and the last one, relative
_FARTHEST = 0.3  # relative step, and distance of the multiplier, at which Newton's method gives up


Critical = tuple[float, Array]
"""Critical k1, N*m/rad, and joint angles of the mode, of unit norm and positive sum, shape (N-1,)."""


class Pitchforks:
    """Last pitchfork in k1 of robots that differ little: the first is searched ``between`` two springs, N*m/rad, and
    the others are found from one beside it."""

    def __init__(self, between: Sequence[float]) -> None:
        self._between, self._near = between, 0.0

    def __call__(self, robot: Robot) -> Critical | None:
        """Spring and mode of a robot; None if it has no pitchfork."""
        found = _beside(robot, self._near) if self._near else None
        if found is None and (other := searched(robot, self._between)) is not None:
            found = _beside(robot, other[0])
        self._near = self._near if found is None else found[0]
        return found


def searched(robot: Robot, between: Sequence[float]) -> Critical | None:
    """Spring and mode of the last pitchfork in k1 in an interval; None if there is none."""
    with suppress(AnalysisError):
        for each in reversed(bifurcations(robot, K1, (between[0], between[1]), normal_form=False)):
            if each.point.kind is Kind.PITCHFORK:
                components = each.joint_components.real
                return each.point.value, components * np.sign(components.sum())
    return None


def _beside(robot: Robot, near: float) -> Critical | None:
    """Spring near another, and mode; None if Newton's method finds none."""
    spring, target = near, 1.0 if PlanarModel(robot).symmetry is None else -1.0
    with suppress(AnalysisError, np.linalg.LinAlgError):
        for _ in range(_MOST):
            here, there = _maps([robot.with_value(K1, spring * (1.0 + step)) for step in (0.0, _STEP)])
            values, vectors = np.linalg.eig(here)
            at = int(np.abs(values - target).argmin())
            if abs(values[at] - target) > _FARTHEST or values[at].imag != 0.0:
                return None
            right, left = vectors[:, at].real, np.linalg.inv(vectors)[at].real
            slope = left @ (there - here) @ right / (_STEP * spring)
            step = float((target - values[at].real) / slope)
            if abs(step) <= _FOUND * spring:
                part = right[3 : robot.body.modules + 2]
                return spring, part / np.linalg.norm(part) * np.sign(part.sum())
            spring += min(max(step, -_FARTHEST * spring), _FARTHEST * spring)
    return None


def _maps(robots: list[Robot]) -> Array:
    """Return maps of the straight walks of robots with one gait, shape (robots, 2N+1, 2N+1)."""
    models = [PlanarModel(robot) for robot in robots]
    symmetry, period = models[0].symmetry, models[0].period
    if symmetry is None:
        return PlanarModel.flow_many(models, 0.0, period)[0]
    maps: Array = symmetry @ PlanarModel.flow_many(models, 0.0, 0.5 * period)[0]
    return maps
