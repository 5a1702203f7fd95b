"""Fits of the planar model's constants to a critical spring and its mode, and what the data leave of them.

A search finds every critical spring of an interval. A robot beside one whose critical spring is known has one nearby:
there the return map of the straight walk has the multiplier of a pitchfork, -1 over half a period if the gait is
mirrored after it, else 1 over a period. Newton's method takes a tenth of the time of a search, but knows nothing of
points farther away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize
from scipy.stats import chi2

from chilopod import units
from chilopod.analysis.parameters import K1, PAPER_UNIT
from chilopod.analysis.straight_walk import bifurcations
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify.constants import CONFIDENCE, Constant, FreeConstants, with_values
from chilopod.tasks.identify.data import CriticalMode

FREE = ("ground.friction", "legs.half_width", "legs.forward_offset")
"""The constants that are fitted, SI."""

# Starting points of the fit, in the units of `scale_of`: far from the answer, so that agreement is meaningful.
_STARTS = ((0.6, 0.2, 0.15), (1.5, 0.45, 0.3), (0.8, 0.4, 0.1))
_BOUNDS = ((0.05, 20.0), (0.02, 3.0), (-0.6, 1.2))
"""Bounds of the search, in the same units."""
_STEP = 1e-6  # of differences, in the same units, and of springs, relative
_OPEN = 1e-4  # singular value of an open combination, relative to all
_FIRST_REACH, _LAST_REACH = 0.1, 1e-7  # half widths of boxes in which an end is searched, in the same units
_ROOM, _EDGE = 1e-6, 1e-3  # residual or chi-square beyond a limit that counts as met, and below it that is at its edge
_RISE = float(chi2.ppf(CONFIDENCE, 1))  # of chi-square at the end of an interval
_MOST, _FOUND = 12, 1e-12  # steps of Newton's method for a critical spring, and the last one, relative
_FARTHEST = 0.3  # relative step, and distance of the multiplier, at which it gives up
_MOST_LOST = 20  # robots without a pitchfork, in one search for an end


Ends = tuple[Array, NDArray[np.bool_]]
"""Least and largest value of each constant in a set of constants, SI, and whether the bounds of the search, of this or
another constant, cut the set there, shape (3, 2) each. A fourth row is that of a fourth goal."""

Aim = Callable[[Array], tuple[float, Array]]
"""Number that is to be least, of constants in units of :func:`scale_of`, and its derivatives."""

_Room = Callable[..., Any]


def no_ends(goals: int = len(FREE)) -> Ends:
    """Ends of nothing, in so many rows."""
    return np.full((goals, 2), np.nan), np.zeros((goals, 2), dtype=bool)


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
    return np.asarray(symmetry @ PlanarModel.flow_many(models, 0.0, 0.5 * period)[0])


class _LostError(Exception):
    """Too many robots without a pitchfork."""


def residuals(robot: Robot, data: CriticalMode) -> Array:
    """Computed numbers less the data, over their tolerance, shape (N,)."""
    _check(robot, data)
    return _off(searched(robot, data.between), robot, data)


def no_pitchfork(data: CriticalMode) -> Array:
    """Residuals that stand for a robot without a pitchfork, shape (N,): twice the data, above those of other robots."""
    return np.array([2.0 * data.k1 / data.k1_tolerance, *[2.0 / data.component_tolerance] * len(data.components)])


def _check(robot: Robot, data: CriticalMode) -> None:
    joints = robot.body.modules - 1
    if len(data.components) != joints:
        problem = f"must be {joints} numbers, one for each joint of {robot.name}"
        raise AnalysisError(problem, field="data components", value=data.components)


def with_constants(robot: Robot, constants: Array) -> Robot:
    """The robot with other values of :data:`FREE`."""
    return with_values(robot, FREE, constants)


def free_constants(robot: Robot, data: CriticalMode) -> FreeConstants:
    """The constants with the bounds of the search as ranges."""
    ends = (np.array(_BOUNDS) * scale_of(robot, data)[:, None]).tolist()
    return FreeConstants(tuple(Constant(path, *each) for path, each in zip(FREE, ends, strict=True)))


def scale_of(robot: Robot, data: CriticalMode) -> Array:
    """Units of the constants, SI: only k/(c v duty L), half-width/L and offset/L enter the mode of a slow robot, with
    the critical spring k, speed v and module length L. The paper's robot has the friction 1.0 in them."""
    length, gait = robot.module_length, robot.gait
    return np.array([4.0 * data.k1 / (gait.speed * gait.duty * length), length, length])


class _Residuals:
    """Residuals, each computed once, and their derivatives over the constants in units of :func:`scale_of`."""

    def __init__(self, robot: Robot, data: CriticalMode) -> None:
        self._robot, self._data, self._scale = robot, data, scale_of(robot, data)
        self._pitchfork = Pitchforks(data.between)
        self._values: dict[bytes, Array] = {}
        self.lost = 0  # robots without a pitchfork

    def __call__(self, scaled: Array) -> Array:
        key = scaled.tobytes()
        if key not in self._values:
            robot = with_constants(self._robot, scaled * self._scale)
            found = self._pitchfork(robot)
            self.lost += found is None
            self._values[key] = _off(found, robot, self._data)
        return self._values[key]

    def watched(self, scaled: Array) -> Array:
        """Residuals, for searches that end among robots without a pitchfork."""
        if self.lost > _MOST_LOST:
            raise _LostError
        return self(scaled)

    def jacobian(self, scaled: Array) -> Array:
        """Forward differences, shape (residuals, 3)."""
        beside = np.array([self(step) for step in scaled + _STEP * np.eye(len(FREE))])
        return ((beside - self(scaled)) / _STEP).T

    def norm(self, scaled: Array) -> tuple[float, Array]:
        """Root of chi-square, and its derivatives."""
        size = float(np.linalg.norm(self(scaled)))
        return size, self(scaled) @ self.jacobian(scaled) / max(size, _ROOM)

    def goal(self, index: int, sign: float, scaled: Array) -> tuple[float, Array]:
        """A constant or, after them, 4 k/(c v duty L) with the critical spring k, times a sign, and derivatives."""
        if index < len(FREE):
            return sign * float(scaled[index]), sign * np.eye(len(FREE))[index]
        part, friction = self._data.k1_tolerance / self._data.k1, float(scaled[0])
        group = (1.0 + part * float(self(scaled)[0])) / friction
        return sign * group, sign * (part * self.jacobian(scaled)[0] - group * np.eye(len(FREE))[0]) / friction


def _off(found: Critical | None, robot: Robot, data: CriticalMode) -> Array:
    """Spring and mode less the data, over their tolerances."""
    if found is None:
        return no_pitchfork(data)
    components = (found[1] - np.array(data.components)) / data.component_tolerance
    return np.append((found[0] - data.k1) / data.k1_tolerance, components)


def allowed_ranges(robot: Robot, data: CriticalMode, best: Array, goals: int = len(FREE)) -> Ends:
    """Projections of the set {max |residual| <= 1}; NaN if it is empty, ends of the search where none is found. With
    four ``goals`` also the ends of k/(c v duty L) with the critical spring k, NaN where none is found."""

    def largest(constants: Array) -> float:
        return float(np.abs(residuals(with_constants(robot, constants), data)).max())

    start = min(best, least_largest(robot, data, best, fixed=()), key=largest)
    if largest(start) > 1.0 + _ROOM:
        return no_ends(goals)
    found, cut = _ends(robot, data, start, lambda off: 1.0 - _both_signs(off), lambda _, by: -_both_signs(by), goals)
    limits = np.array([*(np.array(_BOUNDS) * scale_of(robot, data)[:, None]), [np.nan] * 2])[:goals]
    return np.where(np.isnan(found), limits, found), cut


def confidence_intervals(robot: Robot, data: CriticalMode, best: Array) -> Ends:
    """Ends of the set where chi-square is at most so much above its least value as the level :data:`CONFIDENCE` of one
    constant allows; NaN where no such end is found, as where the data leave a combination of constants open."""
    off = _Residuals(robot, data)
    here = best / scale_of(robot, data)
    if not determined(off.jacobian(here)):
        return no_ends()
    most = float((off(here) ** 2).sum() + _RISE)
    return _ends(robot, data, best, lambda off: most - np.sum(off**2), lambda off, slopes: -2.0 * off @ slopes)


def _ends(robot: Robot, data: CriticalMode, start: Array, room: _Room, slope: _Room, goals: int = len(FREE)) -> Ends:
    """Ends of a set that contains some constants, of three or four ``goals``; NaN where none is found. In the set no
    component of ``room(residuals)`` is negative; ``slope(residuals, their derivatives)`` is its derivative. The set is
    a curved valley, so each end is searched from that of the ends before which is nearest to it too. The residuals at
    an end are searched anew. It lies on the edge of the set, or where the search ends every constant of the goal."""
    off, scale, limits = _Residuals(robot, data), scale_of(robot, data), np.array(_BOUNDS)
    within = {"fun": lambda x: room(off.watched(x)), "jac": lambda x: slope(off(x), off.jacobian(x))}
    ends, values = np.full((goals, 2, len(FREE)), np.nan), np.full((goals, 2), np.nan)
    for (index, side), sign in zip(np.ndindex(goals, 2), (1.0, -1.0) * goals, strict=True):
        aim = partial(off.goal, index, sign)
        known = sorted(ends[np.isfinite(ends).all(axis=2)], key=lambda end: aim(end)[0])
        for begin in (start / scale, *known[:1]):
            found = _farthest(aim, begin, within, off)
            value, slopes = aim(found)
            if value >= sign * values[index, side]:
                continue
            both = off(found), residuals(with_constants(robot, found * scale), data)
            left = min(float(np.min(room(each))) for each in both)
            at_limit = np.abs(found[:, None] - limits).min(axis=1) <= _STEP  # to rounding
            if left >= -_ROOM and (left <= _EDGE or at_limit[slopes != 0.0].all()):
                ends[index, side], values[index, side] = found, sign * value
    cut = (np.abs(ends[..., None] - limits) <= _STEP).any(axis=(2, 3))
    return values * np.append(scale, 0.25)[:goals, None], cut


def _both_signs(off: Array) -> Array:
    return np.concatenate([off, -off])


def _farthest(aim: Aim, start: Array, within: dict[str, Any], off: _Residuals) -> Array:
    """Place where a number is least within the bounds and a constraint, by sequential quadratic programming in boxes
    about the last place, which grow while it succeeds: far away the linear constraint misleads, or robots have no
    pitchfork."""
    here, reach, off.lost = start, _FIRST_REACH, 0
    with suppress(_LostError):
        while reach > _LAST_REACH:
            box = np.clip(here[:, None] + reach * np.array([-1.0, 1.0]), *np.split(np.array(_BOUNDS), 2, axis=1))
            there = _least(aim, here, box, within)
            if np.min(within["fun"](there)) < -_ROOM or aim(there)[0] >= aim(here)[0]:
                reach *= 0.25
                continue
            inside = bool((np.abs(there - here) < (1.0 - _ROOM) * reach).all())
            here, reach = there, 0.0 if inside else 2.0 * reach
    return here


def _least(aim: Aim, start: Array, bounds: Any, within: dict[str, Any]) -> Array:
    """Place where a number is least within bounds and a constraint."""
    found = minimize(
        aim, start, jac=True, method="SLSQP", bounds=bounds,
        constraints={"type": "ineq", **within}, options={"maxiter": 60, "ftol": 1e-8},
    )  # fmt: skip
    return np.asarray(found.x)


def jacobian(robot: Robot, data: CriticalMode, constants: Array) -> Array:
    """Derivatives of the residuals over the constants in units of :func:`scale_of`, shape (N, 3)."""
    return _Residuals(robot, data).jacobian(constants / scale_of(robot, data))


def determined(slopes: Array) -> bool:
    """True if residuals with these derivatives leave no combination of constants open."""
    return bool(np.linalg.matrix_rank(slopes, tol=_OPEN * np.linalg.norm(slopes)) == slopes.shape[1])


def spread(robot: Robot, data: CriticalMode, best: Array) -> Array:
    """Square of half of the 90 % interval of each constant, SI, and products between them, shape (3, 3), for linear
    residuals; as large as the search where the data leave a combination open."""
    slopes, scale = jacobian(robot, data, best), scale_of(robot, data)
    return _RISE * np.linalg.inv(slopes.T @ slopes + np.diag(np.ptp(_BOUNDS, axis=1) ** -2.0)) * np.outer(scale, scale)


def fits_from_every_start(robot: Robot, data: CriticalMode, progress: Progress = silent) -> list[tuple[Array, Array]]:
    """Constants by least squares, SI, and residuals, from every start; AnalysisError if none has a pitchfork."""
    _check(robot, data)
    fits = []
    for index, start in enumerate(_STARTS):
        fits.append(_fit(robot, data, np.array(start) * scale_of(robot, data)))
        progress(0.3 * (index + 1) / len(_STARTS), f"fit from start {index + 1}")
    if all(np.array_equal(off, no_pitchfork(data)) for _, off in fits):
        low, high = (units.format(end, PAPER_UNIT, digits=4) for end in data.between)
        problem = f"must have a pitchfork between k1 = {low} and {high} with some of the constants tried"
        raise AnalysisError(problem, field="robot", value=robot.name)
    return fits


def best_of(fits: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Fit with the least sum of squared residuals."""
    return min(fits, key=lambda fit: float((fit[1] ** 2).sum()))


def _fit(robot: Robot, data: CriticalMode, start: Array) -> tuple[Array, Array]:
    """Least squares over the constants; returns these and the residuals, searched anew. Newton's method may leave the
    interval of the data where these contradict each other: such a fit is made once more, within the interval."""
    off, scale = _Residuals(robot, data), scale_of(robot, data)
    found = least_squares(off, start / scale, off.jacobian, np.transpose(_BOUNDS), x_scale=0.1, xtol=1e-9).x
    if searched(with_constants(robot, found * scale), data.between) is None:
        off, signs = _Residuals(robot, data), np.array([1.0, -1.0])
        ends = (np.array(data.between) - data.k1) / data.k1_tolerance + _ROOM * signs
        fun, slopes = lambda x: signs * (off.watched(x)[0] - ends), lambda x: np.outer(signs, off.jacobian(x)[0])
        with suppress(_LostError):
            found = _least(off.norm, start / scale, _BOUNDS, {"fun": fun, "jac": slopes})
    return found * scale, residuals(with_constants(robot, found * scale), data)


def least_largest(robot: Robot, data: CriticalMode, start: Array, fixed: Sequence[int] = (2,)) -> Array:
    """Constants with the offset, or other ``fixed`` ones, of ``start`` whose largest residual is smallest, SI, shape
    (3,); ``start`` if the search ends among robots without a pitchfork."""
    off, place = _Residuals(robot, data), start / scale_of(robot, data)
    within = {
        "fun": lambda x: x[3] - _both_signs(off.watched(x[:3])),
        "jac": lambda x: np.insert(-_both_signs(off.jacobian(x[:3])), 3, 1.0, axis=1),
    }
    bounds = [*((place[i],) * 2 if i in fixed else each for i, each in enumerate(_BOUNDS)), (0.0, None)]
    with suppress(_LostError):
        found = _least(lambda x: (x[3], np.eye(4)[3]), np.append(place, np.abs(off(place)).max()), bounds, within)
        return found[:3] * scale_of(robot, data)
    return start
