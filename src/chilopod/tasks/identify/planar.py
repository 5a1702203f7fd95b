"""Identification of the planar model's constants from the pitchfork of the straight walk and its mode.

Foot friction, half-width and forward offset are fitted to the critical k1 and the mode of a robot. Every number is
weighted by its tolerance: a residual of 1 is equal to the tolerance (for printed numbers half their last digit). The
range of a constant is the projection of the set in which no residual exceeds 1. If the tolerances are standard errors
of normal scatter instead, the interval of a constant is its profile of chi-square, where the sum of the squared
residuals is at most 2.71 above the least. The profile over the forward offset shows the valley: at each offset the
other two make the largest residual as small as it can be.
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

from chilopod import units
from chilopod.analysis.parameters import ALL, PAPER_UNIT, stiffness
from chilopod.analysis.straight_walk import first_loss, pitchfork
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.notebook import Summary, axes_for
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify.data import CriticalMode
from chilopod.tasks.identify.planar_fit import (
    CONFIDENCE,
    FREE,
    allowed_ranges,
    best_of,
    confidence_intervals,
    fits_from_every_start,
    least_largest,
    residuals,
    scale_of,
    valley,
    with_constants,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BESIDE = 0.25  # of the range of the offset, by which the profile goes beyond it
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
    best = best_of(fits)
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
        valley=valley(robot, data, best[0]),
        profile=_profile(robot, data, best[0], ranges[2], points, variants, progress),
    )


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
            constants = least_largest(robot, data, np.append(last[:2], offsets[index]))
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
