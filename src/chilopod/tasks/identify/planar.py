"""Identification of the planar model's constants from the pitchfork of the straight walk and its mode.

Foot friction, half-width and forward offset are fitted to the critical k1 and the mode of a robot. Every number is
weighted by its tolerance: a residual of 1 is equal to the tolerance (for printed numbers half their last digit). The
range of a constant is the projection of the set in which no residual exceeds 1. If the tolerances are standard errors
of normal scatter instead, the interval of a constant is its profile of chi-square, where the sum of the squared
residuals is at most 2.71 above the least. The profile over the forward offset shows the valley: at each offset the
other two make the largest residual as small as it can be.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.stats import chi2

from chilopod import units
from chilopod.analysis.parameters import ALL, PAPER_UNIT
from chilopod.analysis.straight_walk import first_loss, pitchfork
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.notebook import axes_for, finite
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify import planar_fit
from chilopod.tasks.identify.constants import Estimates, Identified
from chilopod.tasks.identify.data import CriticalMode
from chilopod.tasks.identify.planar_fit import FREE, residuals, with_constants

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LIKELY = 0.999  # part of data with standard errors that leave residuals which count as explained
_BESIDE = 0.25  # of the range of the offset, by which the profile goes beyond it
# Units of the profile, N*mm/deg where none is given.
_UNITS = {"friction": "N*s/m", "half_width": "m", "largest_residual": "1", "coefficient": "1/rad^2", "verdict": ""}


@dataclass(frozen=True)
class Identification(Identified):
    """Result of an identification of the planar constants.

    ``constants`` are the best, ``starts`` those reached from every starting point, shape (3,) and (starts, 3), SI.
    ``residuals`` are critical k1 and components of the mode less the data, in units of their tolerance, shape (N,), at
    the best constants, and ``preset_residuals`` those of the given robot. With ``ranges`` every datum is met within its
    tolerance; ``intervals`` are 90 % profiles of chi-square, if tolerances are standard errors: shape (3, 2), SI, NaN
    where there is none. ``cut`` says of their ends whether the bounds of the search, of any constant, cut them, shape
    (2, 3, 2). ``spread`` has squares of the halves of the intervals for linear residuals, and products between them,
    SI, shape (3, 3), NaN where standard errors do not explain the residuals. ``group`` has the ends of
    k/(c v duty L), with the critical spring k, where every datum is met, shape (2,), NaN where none is found.
    ``profile`` has, over ``forward_offset``,
    the fitted constants, the largest residual, and predictions of numbers that were not fitted.
    """

    given: Robot
    data: CriticalMode
    constants: Array
    residuals: Array
    starts: Array
    preset_residuals: Array
    ranges: Array
    intervals: Array
    cut: Array
    spread: Array
    group: Array
    profile: xr.Dataset

    def allowed(self, path: str) -> tuple[float, float] | None:
        """Range of a constant of :data:`FREE` within which every datum is met, SI; None if there is none."""
        low, high = self.ranges[FREE.index(path)].tolist()
        return None if np.isnan(low) else (low, high)

    def groups(self) -> dict[str, list[float | None]]:
        """Groups without unit that the critical spring and its mode depend on: value of the robot with the best
        constants, least and greatest value of robots that meet all data, None where none is found."""
        found = np.column_stack([self.constants, self.ranges]) / planar_fit.scale_of(self.given, self.data)[:, None]
        spring = 1.0 + self.residuals[0] * self.data.k1_tolerance / self.data.k1
        found[0] = 0.25 * spring / found[0, 0], *self.group
        names = "k1/(friction*speed*duty*module_length)", "half_width/module_length", "forward_offset/module_length"
        return {name: [*map(finite, row)] for name, row in zip(names, found.tolist(), strict=True)}

    @property
    def estimates(self) -> Estimates:
        """The constants with their intervals."""
        free = planar_fit.free_constants(self.given, self.data)
        remark = "; no constants meet all data" if np.isnan(self.ranges).any() else ""
        return Estimates(self.given, free, self.constants, self.intervals, self.spread, remark, self.cut[1])

    def as_json(self) -> dict[str, Any]:
        """Constants with what the tolerances allow, and the residuals, as plain numbers and text."""
        found = super().as_json()
        for path, text in zip(FREE, self._columns()["allowed by the data"], strict=True):
            found["constants"][path] |= {"allowed_si": self.allowed(path), "allowed_text": text}
        return {
            **found,
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

    def _columns(self) -> dict[str, list[str]]:
        ranges = enumerate(zip(self.ranges, self.cut[0], strict=True))
        texts = [self.estimates.between(at, ends, is_cut) or "nothing" for at, (ends, is_cut) in ranges]
        return {"allowed by the data": texts}

    def _remarks(self) -> list[str]:
        searched = []
        for each in planar_fit.free_constants(self.given, self.data).each:
            ends = (units.format(end, self.given.unit_of(each.path), 3) for end in (each.low, each.high))
            searched.append(f"{each.path} {' to '.join(ends)}")
        said = [f"ranges searched: {', '.join(searched)}"]
        said.append("tolerances are largest errors in what the data allow, and standard errors in the interval")
        if np.isnan(self.ranges).any():
            names = ["k1", *(f"component {joint}" for joint in range(1, len(self.residuals)))]
            off = ", ".join(f"{name} {each:+.1f}" for name, each in zip(names, self.residuals, strict=True))
            said.append(f"no constants meet all data; the best are off by, in tolerances: {off}")
        if np.isnan(self.spread).any():
            said.append("no intervals: as standard errors the tolerances do not explain these residuals")
        if (count := len(self.data.components)) < len(FREE):
            said.append(f"too few data for {len(FREE)} constants: {count} independent numbers, as the mode has norm 1")
        return said

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
    """Fit the constants of a robot to the data, with a profile of so many ``points``. Each predicts the critical k1 of
    ``variants``, settings of the robot by name. AnalysisError if the robot has another number of modules than the data,
    or no pitchfork with any constants."""
    fits = planar_fit.fits_from_every_start(robot, data, progress)
    best = planar_fit.best_of(fits)
    allowed, cut = planar_fit.allowed_ranges(robot, data, best[0], goals=len(FREE) + 1)
    progress(0.4, "ranges")
    explained = (best[1] ** 2).sum() <= chi2.ppf(_LIKELY, max(best[1].size - len(FREE), 1))
    intervals, also_cut = planar_fit.confidence_intervals(robot, data, best[0]) if explained else planar_fit.no_ends()
    return Identification(
        given=robot,
        data=data,
        constants=best[0],
        residuals=best[1],
        starts=np.array([fit[0] for fit in fits]),
        preset_residuals=residuals(robot, data),
        ranges=allowed[:-1],
        intervals=intervals,
        cut=np.array([cut[:-1], also_cut]),
        spread=(1.0 if explained else np.nan) * planar_fit.spread(robot, data, best[0]),
        group=allowed[-1],
        profile=_profile(robot, data, best[0], allowed[2], points, variants, progress),
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
    """Fits at fixed forward offsets, outward from the best so that each starts next to its neighbour; NaN beyond one
    without a pitchfork, where the next would start from nothing."""
    low, high = span if np.isfinite(span).all() else best[2] + 0.1 * robot.module_length * np.array([-1.0, 1.0])
    beside = _BESIDE * (high - low)
    offsets = np.linspace(low - beside, high + beside, count)
    rows: dict[int, dict[str, float | str]] = {}
    middle = int(np.abs(offsets - best[2]).argmin())
    for direction in (range(middle, count), range(middle - 1, -1, -1)):
        last, lost, largest = best, False, np.nan
        for index in direction:
            found, constants = _no_predictions(variants), np.full(len(FREE), np.nan)
            if not lost:
                last = constants = planar_fit.least_largest(robot, data, np.append(last[:2], offsets[index]))
                off = residuals(with_constants(robot, constants), data)
                lost, largest = np.array_equal(off, planar_fit.no_pitchfork(data)), float(np.abs(off).max())
            if not lost:
                found = _predictions(with_constants(robot, constants), variants)
            fitted = {"friction": constants[0], "half_width": constants[1], "largest_residual": largest}
            rows[index] = fitted | found
            progress(0.4 + 0.6 * len(rows) / count, f"profile, forward offset {1e3 * offsets[index]:.0f} mm")
    columns = {name: np.array([rows[i][name] for i in range(count)]) for name in rows[0]}
    return xr.Dataset(
        {name: (("forward_offset",), each, {"units": _UNITS.get(name, PAPER_UNIT)}) for name, each in columns.items()},
        coords={"forward_offset": ("forward_offset", offsets, {"units": "m"})},
        attrs={"robot": robot.name, "about": "largest_residual <= 1: all data are met within their tolerance"},
    )


def _no_predictions(variants: Iterable[str]) -> dict[str, float | str]:
    return dict.fromkeys(["critical_k1", *variants, "uniform", "coefficient"], np.nan) | {"verdict": ""}


def _predictions(robot: Robot, variants: Mapping[str, Sequence[str]]) -> dict[str, float | str]:
    """Predictions of a set of constants for numbers that were not fitted."""
    found = _no_predictions(variants)
    for name, setting in {"critical_k1": (), **variants}.items():
        with suppress(AnalysisError):
            found[name] = pitchfork(robot.set_from_text(setting), normal_form=False).value
    with suppress(AnalysisError):
        found["uniform"] = first_loss(robot, ALL, None, Kind.NEIMARK_SACKER, normal_form=False).value
    with suppress(AnalysisError):
        point = pitchfork(robot)
        found["coefficient"] = np.nan if point.coefficient is None else point.coefficient
        found["verdict"] = point.point.criticality.label if point.point.criticality.known else ""
    return found
