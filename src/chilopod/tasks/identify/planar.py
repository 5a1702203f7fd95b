"""Identification of the planar model's constants from the pitchfork of the straight walk and its mode.

Foot friction, half-width and forward offset are fitted to the critical k1 and the mode of a robot. Every number is
weighted by its tolerance: a residual of 1 is equal to the tolerance (for printed numbers half their last digit). The
range of a constant is the projection of the set in which no residual exceeds 1. If the tolerances are standard errors
of normal scatter instead, the interval of a constant is its profile of chi-square, where the sum of the squared
residuals is at most 2.71 above the least. The profile over the forward offset shows the valley: at each offset the
other two make the largest residual as small as it can be.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize
from scipy.stats import chi2

from chilopod import units
from chilopod.analysis.parameters import ALL, PAPER_UNIT, stiffness
from chilopod.analysis.straight_walk import first_loss, pitchfork
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.notebook import Summary, axes_for
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify.critical import Critical, Pitchforks, searched
from chilopod.tasks.identify.data import CriticalMode

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
_BESIDE = 0.25  # of the range of the offset, by which the profile goes beyond it
_NO_PITCHFORK = 100.0
_UNITS = {  # of the profile, N*mm/deg where none is given
    "friction": "N*s/m",
    "half_width": "m",
    "largest_residual": "1",
    "uniform_frequency": "rad/s",
    "coefficient": "1/rad^2",
    "verdict": "",
}


@dataclass(frozen=True)
class Identification(Summary):
    """Result of an identification of the planar constants.

    Attributes
    ----------
    given, data, best
        The given robot, the data, and the robot with the best constants.
    residuals, preset_residuals
        Critical k1 and the components of the mode less the data, in units of their tolerance, shape (N,), at the best
        constants and for ``given``.
    starts
        Constants reached from every starting point, shape (starts, 3), SI.
    ranges
        Least and largest value of each constant for which every datum is met within its tolerance, shape (3, 2), SI;
        NaN if there is none.
    cut
        True where a bound of the search ends a range, shape (3, 2).
    intervals
        Least and largest value of each constant in its 90 % profile of chi-square, shape (3, 2), SI, if the tolerances
        are standard errors.
    valley
        Change of the constants, SI, for a metre of forward offset along the direction in which the residuals change
        least, shape (3,), and how many times less they change than in the next direction.
    profile
        Dataset over ``forward_offset``: the fitted constants, the largest residual, and the predictions of each point
        for numbers that were not fitted.
    """

    given: Robot
    data: CriticalMode
    best: Robot
    residuals: Array
    starts: Array
    preset_residuals: Array
    ranges: Array
    cut: NDArray[np.bool_]
    intervals: Array
    valley: tuple[Array, float]
    profile: xr.Dataset

    def allowed(self, path: str) -> tuple[float, float] | None:
        """Range of a constant of :data:`FREE` within which every datum is met, SI; None if there is none."""
        low, high = self.ranges[FREE.index(path)].tolist()
        return None if np.isnan(low) else (low, high)

    def groups(self) -> dict[str, tuple[float, float, float]]:
        """Groups without unit that the critical spring and its mode depend on: value of the best constants, least and
        greatest value that the data allow, NaN where they allow none."""
        robot, (friction, *lengths) = self.given, self.ranges
        unit, size = scale_of(robot, self.data)[:2] / (4.0, 1.0)
        best = [self.best.get(path) for path in FREE]
        return {
            "k1/(friction*speed*duty*module_length)": tuple((unit / [best[0], *friction[::-1]]).tolist()),
            "half_width/module_length": tuple((np.array([best[1], *lengths[0]]) / size).tolist()),
            "forward_offset/module_length": tuple((np.array([best[2], *lengths[1]]) / size).tolist()),
        }

    def as_json(self) -> dict[str, Any]:
        """Constants with what the tolerances allow, and the residuals, as plain numbers and text."""
        constants = {}
        for path, interval in zip(FREE, self.intervals, strict=True):
            unit, span = self.best.unit_of(path), self.allowed(path)
            confident = None if np.isnan(interval).any() else (float(interval[0]), float(interval[1]))
            constants[path] = {
                "value_si": self.best.get(path),
                "text": units.format(self.best.get(path), unit, digits=4),
                "allowed_si": span,
                "allowed_text": " to ".join(units.format(each, unit, digits=3) for each in span or ()) or "nothing",
                "cut_by_the_search": self.cut[FREE.index(path)].tolist(),
                "interval_si": confident,
                "interval_text": " to ".join(units.format(each, unit, digits=3) for each in confident or ())
                or "not found",
            }
        return {
            "constants": constants,
            "valley_si_for_a_metre_of_forward_offset": dict(zip(FREE, self.valley[0].tolist(), strict=True)),
            "valley_flatter_by": self.valley[1],
            "groups": {name: [None if np.isnan(x) else x for x in ends] for name, ends in self.groups().items()},
            "residuals": self.residuals.tolist(),
            "largest_residual": float(np.abs(self.residuals).max()),
            "constants_from_every_start_si": self.starts.tolist(),
        }

    @property
    def title(self) -> str:
        """Robot, and the largest residual of its constants."""
        largest = np.abs(self.residuals).max()
        return f"{self.given.name}: largest residual {largest:.2f}; 1 is what the tolerances of the data allow"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        constants = self.as_json()["constants"].items()
        rows = [(path, *(each[name] for name in ("text", "allowed_text", "interval_text"))) for path, each in constants]
        head = "constant", "best", "allowed by the data", f"{CONFIDENCE:.0%}, if tolerances are standard errors"
        cut = [path for path, each in constants if any(each["cut_by_the_search"])]
        said = [f"the search ends the range of {path}: the data may allow more" for path in cut]
        (friction, half_width, _), flatter = self.valley
        said.append(
            f"10 mm of forward offset with {1e-2 * friction:+.3g} N*s/m of friction and {10.0 * half_width:+.3g} mm of "
            f"half-width change the residuals least, {flatter:.1f} times less than any combination across it"
        )
        if np.isnan(self.ranges).any():
            names = ["k1", *(f"component {joint}" for joint in range(1, len(self.residuals)))]
            off = ", ".join(f"{name} {each:+.1f}" for name, each in zip(names, self.residuals, strict=True))
            said.append(f"no constants meet all data; the best are off by, in tolerances: {off}")
        return [], [head, *rows], said

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the largest residual over the forward offset, where the other constants are fitted again."""
        axes = axes_for(axes)
        axes.plot(1e3 * self.profile.forward_offset, self.profile.largest_residual)
        axes.axhline(1.0, linestyle=":", color="C7")
        axes.set(xlabel="forward offset (mm)", ylabel="largest residual", ylim=(0.0, None))
        return axes


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


def identify_planar(
    robot: Robot,
    data: CriticalMode,
    points: int = 25,
    variants: Mapping[str, Sequence[str]] = MappingProxyType({}),
    progress: Progress = silent,
) -> Identification:
    """Fit the free constants to the data and draw their ranges.

    Parameters
    ----------
    robot, data
        Robot, whose free constants serve only for comparison, and data to fit.
    points
        Points of the profile.
    variants
        Settings of the robot, by name, of which each point of the profile predicts the critical k1.
    progress
        Function that receives the progress.

    Raises
    ------
    AnalysisError
        If the robot has another number of modules than the data, or no pitchfork with any constants.
    """
    fits = fits_from_every_start(robot, data, progress)
    best = min(fits, key=lambda fit: float((fit[1] ** 2).sum()))
    ranges, cut = allowed_ranges(robot, data, best[0])
    progress(0.4, "ranges")
    return Identification(
        given=robot,
        data=data,
        best=with_constants(robot, best[0]),
        residuals=best[1],
        starts=np.array([fit[0] for fit in fits]),
        preset_residuals=residuals(robot, data),
        ranges=ranges,
        cut=cut,
        intervals=confidence_intervals(robot, data, best[0]),
        valley=_valley(robot, data, best[0]),
        profile=_profile(robot, data, best[0], ranges[2], points, variants, progress),
    )


def scale_of(robot: Robot, data: CriticalMode) -> Array:
    """Units of the constants, SI: only k/(c v duty L), half-width/L and offset/L enter the mode of a slow robot, with
    the critical spring k, speed v and module length L. The paper's robot has the friction 1.0 in them."""
    length, gait = robot.module_length, robot.gait
    return np.array([4.0 * data.k1 / (gait.speed * gait.duty * length), length, length])


class _Residuals:
    """Residuals, each computed once, and their derivatives over the constants in units of :func:`scale_of`; ``more``
    are residuals of other data, as functions of a robot."""

    def __init__(self, robot: Robot, data: CriticalMode, more: Sequence[Callable[[Robot], Array]] = ()) -> None:
        self._robot, self._data, self._scale, self._more = robot, data, scale_of(robot, data), more
        self._pitchfork = Pitchforks(data.between)
        self._values: dict[bytes, Array] = {}

    def __call__(self, scaled: Array) -> Array:
        key = scaled.tobytes()
        if key not in self._values:
            robot = with_constants(self._robot, scaled * self._scale)
            off = _off(self._pitchfork(robot), robot, self._data)
            self._values[key] = np.concatenate([off, *(each(robot) for each in self._more)])
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


def allowed_ranges(
    robot: Robot, data: CriticalMode, best: Array, more: Sequence[Callable[[Robot], Array]] = ()
) -> tuple[Array, NDArray[np.bool_]]:
    """Projections of the set {max |residual| <= 1}, shape (3, 2), SI, and where a bound of the search ends them.

    ``more`` are residuals of other data, as functions of a robot.

    Each end is a minimum of one constant within the set, by sequential quadratic programming from the best constants
    and from the ends that were found before: the set is a curved valley. The residuals at an end are searched.
    """
    off, scale = _Residuals(robot, data, more), scale_of(robot, data)
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


def _valley(robot: Robot, data: CriticalMode, best: Array) -> tuple[Array, float]:
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


def _fit(robot: Robot, data: CriticalMode, start: Array) -> tuple[Array, Array]:
    """Least squares over the constants; returns these and the residuals."""
    off, scale = _Residuals(robot, data), scale_of(robot, data)
    answer = least_squares(off, start / scale, off.jacobian, (_LEAST, _MOST), x_scale=0.1, xtol=1e-9)
    return answer.x * scale, np.asarray(answer.fun)


def _smallest(robot: Robot, data: CriticalMode, start: Array) -> Array:
    """Constants with the offset of ``start`` whose largest residual is smallest."""
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


def _profile(
    robot: Robot,
    data: CriticalMode,
    best: Array,
    span: Array,
    count: int,
    variants: Mapping[str, Sequence[str]],
    progress: Progress,
) -> xr.Dataset:
    """Fits at fixed forward offsets, outward from the best so that each starts next to its neighbour."""
    low, high = span if np.isfinite(span).all() else best[2] + 0.1 * robot.module_length * np.array([-1.0, 1.0])
    beside = _BESIDE * (high - low)
    offsets = np.linspace(low - beside, high + beside, count)
    rows: dict[int, dict[str, float | str]] = {}
    middle = int(np.abs(offsets - best[2]).argmin())
    done = 0
    for direction in (range(middle, count), range(middle - 1, -1, -1)):
        last = best
        for index in direction:
            constants = _smallest(robot, data, np.append(last[:2], offsets[index]))
            last, off = constants, residuals(with_constants(robot, constants), data)
            rows[index] = {
                "friction": constants[0],
                "half_width": constants[1],
                "largest_residual": float(np.abs(off).max()),
                **_predictions(with_constants(robot, constants), variants),
            }
            done += 1
            progress(0.4 + 0.6 * done / count, f"profile, forward offset {1e3 * offsets[index]:.0f} mm")
    columns = {name: np.array([rows[i][name] for i in range(count)]) for name in rows[0]}
    return xr.Dataset(
        {name: (("forward_offset",), each, {"units": _UNITS.get(name, PAPER_UNIT)}) for name, each in columns.items()},
        coords={"forward_offset": ("forward_offset", offsets, {"units": "m"})},
        attrs={"robot": robot.name, "about": "largest_residual <= 1: all data are met within their tolerance"},
    )


def _predictions(robot: Robot, variants: Mapping[str, Sequence[str]]) -> dict[str, float | str]:
    """Predictions of a set of constants for numbers that were not fitted."""

    found: dict[str, float | str] = dict.fromkeys(["critical_k1", *variants], np.nan)
    found |= {"uniform": np.nan, "uniform_frequency": np.nan, "coefficient": np.nan, "verdict": ""}
    for name, setting in {"critical_k1": (), **variants}.items():
        with suppress(AnalysisError):
            found[name] = pitchfork(robot.set_from_text(setting), normal_form=False).value
    with suppress(AnalysisError):
        point = first_loss(robot, ALL, (stiffness(2.0), stiffness(75.0)), Kind.NEIMARK_SACKER, normal_form=False)
        found["uniform"], found["uniform_frequency"] = point.value, point.point.frequency
    with suppress(AnalysisError):
        point = pitchfork(robot)
        found["coefficient"] = np.nan if point.coefficient is None else point.coefficient
        found["verdict"] = point.point.criticality.label if point.point.criticality.known else ""
    return found
