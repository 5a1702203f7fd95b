"""Identification of the planar model's constants from the pitchfork of the straight walk and its mode.

Foot friction, half-width and forward offset are fitted to the critical k1 and the mode of a robot. Every number is
weighted by its tolerance: a residual of 1 is equal to the tolerance (for printed numbers half their last digit). The
range of a constant is the projection of the set in which no residual exceeds 1. The profile over the forward offset
shows the valley: at each offset the other two make the largest residual as small as it can be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from chilopod import units
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.straight_walk import bifurcations, first_loss, pitchfork
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.notebook import Summary, axes_for
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify.data import CriticalMode

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FREE = ("ground.friction", "legs.half_width", "legs.forward_offset")
"""The constants that are fitted, SI."""

# Starting points of the fit, in the units of `_scale`: far from the answer, so that agreement is meaningful.
_STARTS = ((0.6, 0.2, 0.15), (1.5, 0.45, 0.3), (0.8, 0.4, 0.1))
_LEAST, _MOST = np.array([0.05, 0.02, -0.6]), np.array([20.0, 3.0, 1.2])
"""Bounds of the search, in the same units."""
_STEP = 1e-6  # of differences, in the same units
_MET = 1.0 + 1e-6  # residual that counts as 1
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
        unit, size = _scale(robot, self.data)[:2] / (4.0, 1.0)
        best = [self.best.get(path) for path in FREE]
        return {
            "k1/(friction*speed*duty*module_length)": tuple((unit / [best[0], *friction[::-1]]).tolist()),
            "half_width/module_length": tuple((np.array([best[1], *lengths[0]]) / size).tolist()),
            "forward_offset/module_length": tuple((np.array([best[2], *lengths[1]]) / size).tolist()),
        }

    def as_json(self) -> dict[str, Any]:
        """Constants with what the tolerances allow, and the residuals, as plain numbers and text."""
        constants = {}
        for path in FREE:
            unit, span = self.best.unit_of(path), self.allowed(path)
            edges = [units.format(edge, unit, digits=3) for edge in span or ()]
            constants[path] = {
                "value_si": self.best.get(path),
                "text": units.format(self.best.get(path), unit, digits=4),
                "allowed_si": span,
                "allowed_text": " to ".join(edges) or "nothing",
                "cut_by_the_search": self.cut[FREE.index(path)].tolist(),
            }
        return {
            "constants": constants,
            "valley_si_for_a_metre_of_forward_offset": dict(zip(FREE, self.valley[0].tolist(), strict=True)),
            "valley_flatter_by": self.valley[1],
            "groups": self.groups(),
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
        rows = [(path, each["text"], each["allowed_text"]) for path, each in constants]
        cut = [path for path, each in constants if any(each["cut_by_the_search"])]
        said = [f"a bound of the search ends the range of {path}: the data allow more" for path in cut]
        (friction, half_width, _), flatter = self.valley
        said.append(
            f"10 mm of forward offset with {1e-2 * friction:+.3g} N*s/m of friction and {10.0 * half_width:+.3g} mm of "
            f"half-width change the residuals least, {flatter:.1f} times less than any combination across it"
        )
        if np.isnan(self.ranges).any():
            names = ["k1", *(f"component {joint}" for joint in range(1, len(self.residuals)))]
            off = ", ".join(f"{name} {each:+.1f}" for name, each in zip(names, self.residuals, strict=True))
            said.append(f"no constants meet all data; the best are off by, in tolerances: {off}")
        return [], [("constant", "best", "allowed by the data"), *rows], said

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the largest residual over the forward offset, where the other constants are fitted again."""
        axes = axes_for(axes)
        axes.plot(1e3 * self.profile.forward_offset, self.profile.largest_residual)
        axes.axhline(1.0, linestyle=":", color="C7")
        axes.set(xlabel="forward offset (mm)", ylabel="largest residual", ylim=(0.0, None))
        return axes


def residuals(robot: Robot, data: CriticalMode, between: tuple[float, float] | None = None) -> Array:
    """Computed numbers less the data, over their tolerance, shape (N,), of a pitchfork ``between`` two k1, N*m/rad."""
    count = robot.body.modules
    if len(data.components) != count - 1:
        problem = f"must be {count - 1} numbers, one for each joint of {robot.name}"
        raise AnalysisError(problem, field="data components", value=data.components)
    try:
        points = bifurcations(robot, K1, between or (data.between[0], data.between[1]), normal_form=False)
    except AnalysisError:
        points = []
    points = [each for each in points if each.point.kind is Kind.PITCHFORK]
    if not points:
        return np.full(count, _NO_PITCHFORK)
    components = points[-1].joint_components.real
    components = components * np.sign(components.sum())
    off = (components - np.array(data.components)) / data.component_tolerance
    return np.concatenate([[(points[-1].point.value - data.k1) / data.k1_tolerance], off])


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
    scale, fits = _scale(robot, data), []
    for index, start in enumerate(_STARTS):
        fits.append(_fit(robot, data, np.array(start) * scale))
        progress(0.3 * (index + 1) / len(_STARTS), f"fit from start {index + 1}")
    best = min(fits, key=lambda fit: float((fit[1] ** 2).sum()))
    if (best[1] == _NO_PITCHFORK).all():
        problem = "must have a pitchfork on its straight walk with some of the constants tried"
        raise AnalysisError(problem, field="robot", value=robot.name)
    ranges, cut = _ranges(robot, data, best[0])
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
        valley=_valley(robot, data, best[0]),
        profile=_profile(robot, data, best[0], ranges[2], points, variants, progress),
    )


def _scale(robot: Robot, data: CriticalMode) -> Array:
    """Units of the constants, SI: only k/(c v duty L), half-width/L and offset/L enter the mode of a slow robot, with
    the critical spring k, speed v and module length L. The paper's robot has the friction 1.0 in them."""
    length, gait = robot.module_length, robot.gait
    return np.array([4.0 * data.k1 / (gait.speed * gait.duty * length), length, length])


class _Residuals:
    """Residuals, each computed once, and their derivatives over the constants in units of :func:`_scale`."""

    def __init__(self, robot: Robot, data: CriticalMode) -> None:
        self._robot, self._data, self._scale = robot, data, _scale(robot, data)
        self._values: dict[bytes, Array] = {}

    def __call__(self, scaled: Array) -> Array:
        key = scaled.tobytes()
        if key not in self._values:
            self._values[key] = residuals(with_constants(self._robot, scaled * self._scale), self._data)
        return self._values[key]

    def jacobian(self, scaled: Array) -> Array:
        """Forward differences, shape (N, 3), of the same pitchfork, which takes a third of the time of a search."""
        here, steps = self(scaled), scaled + _STEP * np.eye(len(FREE))
        k1 = self._data.k1 + here[0] * self._data.k1_tolerance
        robots = [with_constants(self._robot, step * self._scale) for step in steps]
        beside = np.array([residuals(robot, self._data, (0.99 * k1, 1.01 * k1)) for robot in robots])
        return ((beside - here) / _STEP).T


def _ranges(robot: Robot, data: CriticalMode, best: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Projections of the set {max |residual| <= 1}, shape (3, 2), SI, and where a bound of the search ends them.

    Each end is a minimum of one constant within the set, by sequential quadratic programming from the best constants
    and from the ends that were found before: the set is a curved valley.
    """
    off, scale = _Residuals(robot, data), _scale(robot, data)
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
                if np.abs(off(found)).max() <= _MET and (known is None or goal @ found < goal @ known):
                    ends[constant, side] = found
    ranges, cut = np.full((len(FREE), 2), np.nan), np.zeros((len(FREE), 2), dtype=np.bool_)
    if len(ends) == ranges.size:
        for (constant, side), found in ends.items():
            ranges[constant, side] = found[constant] * scale[constant]
            limit = (_LEAST, _MOST)[side][constant]
            cut[constant, side] = abs(found[constant] - limit) <= _STEP * abs(limit)
    return ranges, cut


def _valley(robot: Robot, data: CriticalMode, best: Array) -> tuple[Array, float]:
    """Direction in which the residuals change least, SI for a metre of forward offset, and how many times less than in
    the next direction, from the singular values of the derivative over the constants in units of :func:`_scale`."""
    scale = _scale(robot, data)
    _, values, directions = np.linalg.svd(_Residuals(robot, data).jacobian(best / scale))
    along = directions[-1] * scale
    return along / along[2], float(values[-2] / values[-1])


def _fit(robot: Robot, data: CriticalMode, start: Array) -> tuple[Array, Array]:
    """Least squares over the constants; returns these and the residuals."""
    off, scale = _Residuals(robot, data), _scale(robot, data)
    answer = least_squares(off, start / scale, off.jacobian, (_LEAST, _MOST), x_scale=0.1, xtol=1e-9)
    return answer.x * scale, np.asarray(answer.fun)


def _smallest(robot: Robot, data: CriticalMode, start: Array) -> Array:
    """Constants with the offset of ``start`` whose largest residual is smallest, near the fit by least squares."""
    off, scale = _Residuals(robot, data), _scale(robot, data)

    def all_of(free: Array) -> Array:
        return np.append(free[:2], start[2] / scale[2])

    def within(free: Array) -> Array:
        found = off(all_of(free))
        return np.concatenate([free[2] - found, free[2] + found])

    def slopes(free: Array) -> Array:
        found = off.jacobian(all_of(free))[:, :2]
        return np.hstack([np.concatenate([-found, found]), np.ones((2 * len(found), 1))])

    near = least_squares(
        lambda free: off(all_of(free)), start[:2] / scale[:2], lambda free: off.jacobian(all_of(free))[:, :2],
        (_LEAST[:2], _MOST[:2]), x_scale=0.1,
    ).x  # fmt: skip
    last = np.array([0.0, 0.0, 1.0])
    found = minimize(
        lambda free: free[2], np.append(near, np.abs(off(all_of(near))).max()), jac=lambda free: last,
        method="SLSQP", bounds=[*zip(_LEAST[:2], _MOST[:2], strict=True), (0.0, None)],
        constraints=[{"type": "ineq", "fun": within, "jac": slopes}], options={"maxiter": 60, "ftol": 1e-8},
    ).x  # fmt: skip
    best = min((all_of(found), all_of(near)), key=lambda scaled: float(np.abs(off(scaled)).max()))
    return best * scale


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
