"""Fits of the planar model's constants to a critical spring and its mode, and what the data leave of them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize
from scipy.stats import chi2

from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.critical import Critical, Pitchforks, searched
from chilopod.tasks.identify.data import CriticalMode

FREE = ("ground.friction", "legs.half_width", "legs.forward_offset")
"""The constants that are fitted, SI."""

# Starting points of the fit, in the units of `scale_of`: far from the answer, so that agreement is meaningful.
_STARTS = ((0.6, 0.2, 0.15), (1.5, 0.45, 0.3), (0.8, 0.4, 0.1))
_LEAST, _MOST = np.array([0.05, 0.02, -0.6]), np.array([20.0, 3.0, 1.2])
"""Bounds of the search, in the same units."""
_STEP = 1e-6  # of differences, in the same units
_MOST_MOVES, _LONGEST_MOVE = 40, 0.1  # to the end of an interval, in the same units
_ROOM = 1e-3  # of chi-square
_OPEN = 1e-4  # singular value of an open combination, relative to all
_MET = 1.0 + 1e-6  # residual that counts as 1
CONFIDENCE = 0.9
"""Level of the intervals for tolerances that are standard errors."""
_NO_PITCHFORK = 100.0


def residuals(robot: Robot, data: CriticalMode) -> Array:
    """Computed numbers less the data, over their tolerance, shape (N,)."""
    count = robot.body.modules
    if len(data.components) != count - 1:
        problem = f"must be {count - 1} numbers, one for each joint of {robot.name}"
        raise AnalysisError(problem, field="data components", value=data.components)
    return _off(searched(robot, data.between), robot, data)


def with_constants(robot: Robot, constants: Array) -> Robot:
    """The robot with other values of :data:`FREE`."""
    for path, value in zip(FREE, constants, strict=True):
        robot = robot.with_value(path, float(value))
    return robot


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

    def __call__(self, scaled: Array) -> Array:
        key = scaled.tobytes()
        if key not in self._values:
            robot = with_constants(self._robot, scaled * self._scale)
            self._values[key] = _off(self._pitchfork(robot), robot, self._data)
        return self._values[key]

    def jacobian(self, scaled: Array) -> Array:
        """Forward differences, shape (residuals, 3)."""
        beside = np.array([self(step) for step in scaled + _STEP * np.eye(len(FREE))])
        return ((beside - self(scaled)) / _STEP).T


def _off(found: Critical | None, robot: Robot, data: CriticalMode) -> Array:
    """Spring and mode less the data, over their tolerances."""
    if found is None:
        return np.full(robot.body.modules, _NO_PITCHFORK)
    components = (found[1] - np.array(data.components)) / data.component_tolerance
    return np.append((found[0] - data.k1) / data.k1_tolerance, components)


def allowed_ranges(robot: Robot, data: CriticalMode, best: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Projections of the set {max |residual| <= 1}, shape (3, 2), SI, and where a bound of the search ends them.

    Each end is a minimum of one constant within the set, by sequential quadratic programming from the best constants
    and from the ends that were found before: the set is a curved valley. The residuals at an end are searched.
    """
    off, scale = _Residuals(robot, data), scale_of(robot, data)
    within = {
        "type": "ineq",
        "fun": lambda scaled: np.concatenate([1.0 - off(scaled), 1.0 + off(scaled)]),
        "jac": lambda scaled: np.kron([[-1.0], [1.0]], off.jacobian(scaled)),
    }
    bounds = list(zip(_LEAST, _MOST, strict=True))
    ends: dict[tuple[int, int], Array] = {}
    for constant in range(len(FREE)):
        for side, sign in enumerate((1.0, -1.0)):
            goal = sign * np.eye(len(FREE))[constant]
            for start in (best / scale, *ends.values()):
                found = minimize(
                    lambda scaled, goal=goal: goal @ scaled, start, jac=lambda scaled, goal=goal: goal,
                    method="SLSQP", bounds=bounds, constraints=[within], options={"maxiter": 60, "ftol": 1e-8},
                ).x  # fmt: skip
                known = ends.get((constant, side))
                if known is not None and goal @ found >= goal @ known:
                    continue
                searched_off = residuals(with_constants(robot, found * scale), data)
                if np.abs(np.append(searched_off, off(found))).max() <= _MET:
                    ends[constant, side] = found
    ranges, cut = np.full((len(FREE), 2), np.nan), np.zeros((len(FREE), 2), dtype=np.bool_)
    if len(ends) == ranges.size or np.abs(off(best / scale)).max() <= _MET:
        for constant, side in np.ndindex(ranges.shape):
            # Where no end was found, the data may allow more.
            found, limit = ends.get((constant, side), best / scale)[constant], (_LEAST, _MOST)[side][constant]
            ranges[constant, side] = found * scale[constant]
            cut[constant, side] = (constant, side) not in ends or abs(found - limit) <= _STEP * abs(limit)
    return ranges, cut


def confidence_intervals(robot: Robot, data: CriticalMode, best: Array) -> Array:
    """Least and largest value of each constant where chi-square is at most so much above its least value as the level
    :data:`CONFIDENCE` of one constant allows, shape (3, 2), SI; NaN where no such end is found, as where the data leave
    a combination of constants open.

    Each end is the fixed point of moves to the end of the ellipsoid that linear residuals would have.
    """
    off, scale = _Residuals(robot, data), scale_of(robot, data)
    most = float((off(best / scale) ** 2).sum() + chi2.ppf(CONFIDENCE, 1))
    intervals = np.full((len(FREE), 2), np.nan)
    if not determined(off.jacobian(best / scale)):
        return intervals
    limits = np.array([_LEAST, _MOST])
    for constant in range(len(FREE)):
        for side, sign in enumerate((-1.0, 1.0)):
            here = best / scale
            with suppress(np.linalg.LinAlgError):
                for _ in range(_MOST_MOVES):
                    found, slopes = off(here), off.jacobian(here)
                    spread = np.linalg.inv(slopes.T @ slopes)
                    middle = -spread @ slopes.T @ found
                    room = max(most - ((found + slopes @ middle) ** 2).sum(), 0.0)
                    move = middle + sign * spread[constant] * np.sqrt(room / spread[constant, constant])
                    move *= min(1.0, _LONGEST_MOVE / np.abs(move).max())
                    here, before = np.clip(here + move, *limits), here
                    if np.abs(here - before).max() < _STEP:
                        break
            more = most - (residuals(with_constants(robot, here * scale), data) ** 2).sum()
            if abs(more) <= _ROOM or (more > 0.0 and here[constant] in limits[:, constant]):
                intervals[constant, side] = here[constant] * scale[constant]
    return intervals


def jacobian(robot: Robot, data: CriticalMode, constants: Array) -> Array:
    """Derivatives of the residuals over the constants in units of :func:`scale_of`, shape (N, 3)."""
    return _Residuals(robot, data).jacobian(constants / scale_of(robot, data))


def determined(slopes: Array) -> bool:
    """True if residuals with these derivatives leave no combination of constants open."""
    return bool(np.linalg.matrix_rank(slopes, tol=_OPEN * np.linalg.norm(slopes)) == slopes.shape[1])


def valley(robot: Robot, data: CriticalMode, best: Array) -> tuple[Array, float]:
    """Direction in which the residuals change least, SI for a metre of forward offset, and how many times less than in
    the next direction, from the singular values of the derivative over the constants in units of :func:`scale_of`."""
    scale = scale_of(robot, data)
    _, values, directions = np.linalg.svd(jacobian(robot, data, best))
    along = directions[-1] * scale
    return along / along[2], float(values[-2] / values[-1])


def fits_from_every_start(robot: Robot, data: CriticalMode, progress: Progress = silent) -> list[tuple[Array, Array]]:
    """Constants by least squares, SI, and their residuals, from every starting point; AnalysisError if the robot has no
    pitchfork there."""
    fits = []
    for index, start in enumerate(_STARTS):
        fits.append(_fit(robot, data, np.array(start) * scale_of(robot, data)))
        progress(0.3 * (index + 1) / len(_STARTS), f"fit from start {index + 1}")
    if all((off == _NO_PITCHFORK).all() for _, off in fits):
        problem = "must have a pitchfork on its straight walk with some of the constants tried"
        raise AnalysisError(problem, field="robot", value=robot.name)
    return fits


def best_of(fits: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Fit with the least sum of squared residuals."""
    return min(fits, key=lambda fit: float((fit[1] ** 2).sum()))


def _fit(robot: Robot, data: CriticalMode, start: Array) -> tuple[Array, Array]:
    """Least squares over the constants; returns these and the residuals."""
    off, scale = _Residuals(robot, data), scale_of(robot, data)
    answer = least_squares(off, start / scale, off.jacobian, (_LEAST, _MOST), x_scale=0.1, xtol=1e-9)
    return answer.x * scale, np.asarray(answer.fun)


def least_largest(robot: Robot, data: CriticalMode, start: Array) -> Array:
    """Constants with the offset of ``start`` whose largest residual is smallest, SI, shape (3,)."""
    off, scale = _Residuals(robot, data), scale_of(robot, data)

    sides = np.array([[-1.0], [1.0]])
    within = {
        "type": "ineq",
        "fun": lambda free: free[3] + np.kron(sides, off(free[:3])[:, None])[:, 0],
        "jac": lambda free: np.insert(np.kron(sides, off.jacobian(free[:3])), 3, 1.0, axis=1),
    }
    bounds = [*zip(_LEAST[:2], _MOST[:2], strict=True), (start[2] / scale[2],) * 2, (0.0, None)]
    found = minimize(
        lambda free: free[3], np.append(start / scale, np.abs(off(start / scale)).max()), jac=lambda free: np.eye(4)[3],
        method="SLSQP", bounds=bounds, constraints=[within], options={"maxiter": 60, "ftol": 1e-8},
    ).x  # fmt: skip
    return found[:3] * scale
