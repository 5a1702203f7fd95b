"""Finding the planar model's constants that are hard to measure, from where the straight walk bends and how.

Three constants are free: foot friction, half-width and forward offset. They are fitted to the critical k1 and the mode
of a robot, every number weighted by its tolerance, so that a residual of 1 is exactly what that allows (of printed
numbers, half their last digit). The profile over the forward offset shows how far the data determine them: at each
offset the other two are fitted again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import least_squares

from chilopod import units
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.straight_walk import bifurcations, first_loss, pitchfork
from chilopod.errors import AnalysisError
from chilopod.notebook import Summary, axes_for
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify.data import CriticalMode

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

FREE = ("ground.friction", "legs.half_width", "legs.forward_offset")
"""The constants that are fitted, SI."""

# Sizes of the steps of the optimiser, and rough starting points from which it is run: far from the answer on purpose.
_SCALE = np.array([200.0, 0.07, 0.05])
_STARTS = ((150.0, 0.05, 0.03), (350.0, 0.10, 0.07), (200.0, 0.09, 0.02))
_NO_PITCHFORK = 100.0


@dataclass(frozen=True)
class Identification(Summary):
    """Result of an identification of the planar constants.

    Attributes
    ----------
    given
        The robot as it was given.
    best
        The robot with the best constants.
    residuals
        At the best constants: critical k1 and the components of the mode, in units of their tolerance, shape (N,).
    starts
        Constants reached from every starting point, shape (starts, 3), SI.
    preset_residuals
        The same residuals for ``given``.
    profile
        Dataset over ``forward_offset``: the fitted constants, the largest residual, and what each point predicts for
        the numbers that were not fitted.
    """

    given: Robot
    best: Robot
    residuals: Array
    starts: Array
    preset_residuals: Array
    profile: xr.Dataset

    def allowed(self, name: str) -> tuple[float, float] | None:
        """Range of a constant along the profile within which every datum is met, SI; None if nowhere."""
        values = self.profile[name].values[self.profile.largest_residual.values <= 1.0]
        return (float(values.min()), float(values.max())) if values.size else None

    def as_json(self) -> dict[str, Any]:
        """Constants with what the tolerances allow, and the residuals, as plain numbers and text."""
        constants = {}
        for path in FREE:
            unit, span = self.best.unit_of(path), self.allowed(path.partition(".")[2])
            constants[path] = {
                "value_si": self.best.get(path),
                "text": units.format(self.best.get(path), unit, digits=4),
                "allowed_si": span,
                "allowed_text": "nothing"
                if span is None
                else " to ".join(units.format(edge, unit, digits=3) for edge in span),
            }
        return {
            "constants": constants,
            "residuals": self.residuals.tolist(),
            "largest_residual": float(np.abs(self.residuals).max()),
            "constants_from_every_start_si": self.starts.tolist(),
        }

    @property
    def title(self) -> str:
        """Robot, and how well its constants meet the data."""
        largest = np.abs(self.residuals).max()
        return f"{self.given.name}: largest residual {largest:.2f}; 1 is what the tolerances of the data allow"

    def _told(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        constants = self.as_json()["constants"].items()
        rows = [(path, each["text"], each["allowed_text"]) for path, each in constants]
        return [], [("constant", "best", "allowed by the data"), *rows], []

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the largest residual over the forward offset, where the other constants are fitted again."""
        axes = axes_for(axes)
        axes.plot(1e3 * self.profile.forward_offset, self.profile.largest_residual)
        axes.axhline(1.0, linestyle=":", color="C7")
        axes.set(xlabel="forward offset (mm)", ylabel="largest residual", ylim=(0.0, None))
        return axes


def residuals(robot: Robot, data: CriticalMode) -> Array:
    """Computed numbers less the data, over their tolerance, shape (N,)."""
    count = len(data.components) + 1
    if robot.body.modules != count:
        raise AnalysisError(
            f"the mode of the data is that of {count} modules", field="body.modules", value=robot.body.modules
        )
    low, high = data.between
    try:
        points = bifurcations(robot, K1, (stiffness(low), stiffness(high)), normal_form=False)
    except AnalysisError:
        points = []
    points = [each for each in points if each.point.kind is Kind.PITCHFORK]
    if not points:
        return np.full(count, _NO_PITCHFORK)
    components = points[-1].joint_components.real
    components = components * np.sign(components.sum())
    off = (components - np.array(data.components)) / data.component_tolerance
    return np.concatenate([[(points[-1].value - data.k1) / data.k1_tolerance], off])


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
    """Fit the free constants to the data and draw how well these determine them.

    Parameters
    ----------
    robot
        Everything but the free constants; their values are only looked at for comparison.
    data
        Data that are fitted.
    points
        Points of the profile.
    variants
        Settings of the robot, by name, of which each point of the profile predicts the critical k1.
    progress
        Called as the work goes on.

    Raises
    ------
    AnalysisError
        If the robot has another number of modules than the data, or no pitchfork with any constants.
    """
    fits = []
    for index, start in enumerate(_STARTS):
        fits.append(_fit(robot, data, np.array(start), fixed=0))
        progress(0.3 * (index + 1) / len(_STARTS), f"fit from start {index + 1}")
    best = min(fits, key=lambda fit: float((fit[1] ** 2).sum()))
    if (best[1] == _NO_PITCHFORK).all():
        raise AnalysisError(
            "its straight walk has no pitchfork with any constants that were tried, so nothing can be fitted",
            field="robot",
            value=robot.name,
        )
    return Identification(
        given=robot,
        best=with_constants(robot, best[0]),
        residuals=best[1],
        starts=np.array([fit[0] for fit in fits]),
        preset_residuals=residuals(robot, data),
        profile=_profile(robot, data, best[0], points, variants, progress),
    )


def _fit(robot: Robot, data: CriticalMode, start: Array, fixed: int) -> tuple[Array, Array]:
    """Least squares over the constants but the last ``fixed``; returns constants and residuals."""
    free = len(start) - fixed

    def cost(scaled: Array) -> Array:
        return residuals(with_constants(robot, np.concatenate([scaled * _SCALE[:free], start[free:]])), data)

    answer = least_squares(
        cost,
        start[:free] / _SCALE[:free],
        bounds=(0.05, 10.0) if fixed else ([0.05, 0.05, -2.0], [10.0, 10.0, 4.0]),
        x_scale=0.1,
        diff_step=1e-5,
        xtol=1e-9,
    )
    return np.concatenate([answer.x * _SCALE[:free], start[free:]]), np.asarray(answer.fun)


def _profile(
    robot: Robot, data: CriticalMode, best: Array, count: int, variants: Mapping[str, Sequence[str]], progress: Progress
) -> xr.Dataset:
    """Fits at fixed forward offsets, outward from the best so that each starts next to its neighbour."""
    offsets = np.linspace(0.030, 0.070, count)
    rows: dict[int, dict[str, float | str]] = {}
    middle = int(np.abs(offsets - best[2]).argmin())
    done = 0
    for direction in (range(middle, count), range(middle - 1, -1, -1)):
        last = best
        for index in direction:
            constants, off = _fit(robot, data, np.append(last[:2], offsets[index]), fixed=1)
            last = constants
            rows[index] = {
                "friction": constants[0],
                "half_width": constants[1],
                "largest_residual": float(np.abs(off).max()),
                **_predictions(with_constants(robot, constants), variants),
            }
            done += 1
            progress(0.3 + 0.7 * done / count, f"profile, forward offset {1e3 * offsets[index]:.0f} mm")
    unit_of = {
        "friction": "N*s/m",
        "half_width": "m",
        "largest_residual": "1",
        "uniform_frequency": "rad/s",
        "coefficient": "1/rad^2",
        "verdict": "",
    }
    return xr.Dataset(
        {
            name: (
                ("forward_offset",),
                np.array([rows[i][name] for i in range(count)]),
                {"units": unit_of.get(name, PAPER_UNIT)},
            )
            for name in rows[0]
        },
        coords={"forward_offset": ("forward_offset", offsets, {"units": "m"})},
        attrs={"robot": robot.name, "about": "largest_residual <= 1: all data are met within their tolerance"},
    )


def _predictions(robot: Robot, variants: Mapping[str, Sequence[str]]) -> dict[str, float | str]:
    """Predictions of a set of constants for numbers that were not fitted."""

    def critical(setting: Sequence[str]) -> float:
        try:
            return pitchfork(robot.set_from_text(setting), normal_form=False).value
        except AnalysisError:
            return float("nan")

    found: dict[str, float | str] = {"critical_k1": critical([])}
    for name, setting in variants.items():
        found[name] = critical(setting)
    try:
        point = first_loss(robot, ALL, (stiffness(2.0), stiffness(75.0)), Kind.NEIMARK_SACKER, normal_form=False)
        found["uniform"], found["uniform_frequency"] = point.value, point.point.frequency
    except AnalysisError:
        found["uniform"], found["uniform_frequency"] = float("nan"), float("nan")
    try:
        point = pitchfork(robot)
        found["coefficient"] = point.coefficient if point.coefficient is not None else float("nan")
        found["verdict"] = point.point.criticality.label if point.point.criticality.known else ""
    except AnalysisError:
        found["coefficient"], found["verdict"] = float("nan"), ""
    return found
