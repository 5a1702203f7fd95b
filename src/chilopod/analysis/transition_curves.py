"""Curves of bifurcations of the straight walk in the plane of two parameters, in their units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import check_parameter
from chilopod.analysis.straight_walk import bifurcations
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array
from chilopod.notebook import Summary, axes_for
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Curve2, Kind, follow2
from chilopod.stability.shown import bounded, mark

if TYPE_CHECKING:
    from matplotlib.axes import Axes


Box = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class TransitionCurve(Summary):
    """A curve of bifurcations of the straight walk in the plane of two parameters, in SI units, with the dotted paths
    of the parameters and the units that they are shown in."""

    curve: Curve2
    parameters: tuple[str, str]
    units: tuple[str, str]

    @property
    def values(self) -> Array:
        """Both parameters at all points, in ``units``, shape (points, 2)."""
        return np.array([self.shown(point.values) for point in self.curve.points])

    def shown(self, values: Array) -> Array:
        """SI values of both parameters, or errors of them, in ``units``."""
        return np.array([units.from_si(float(value), unit) for value, unit in zip(values, self.units, strict=True)])

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the curve in ``units``, points of codimension two marked, on axes of matplotlib or on new ones."""
        axes = axes_for(axes)
        axes.plot(*self.values.T, label=self.curve.kind.label)
        mark(axes, [(point.kind.label, *self.shown(point.values)) for point in self.curve.special])
        axes.set(xlabel=self._names[0], ylabel=self._names[1])
        return axes

    @property
    def _names(self) -> list[str]:
        pairs = zip(self.parameters, self.units, strict=True)
        return [f"{path} ({unit.replace('*', '·')})" for path, unit in pairs]

    @property
    def title(self) -> str:
        """Kind and number of points in words."""
        return f"{self.curve.kind.label} in two parameters: {len(self.curve.points)} points"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        rows = [
            (each.kind.label, *map(bounded, self.shown(each.values), np.abs(self.shown(each.error_bound))))
            for each in self.curve.special
        ]
        return [], [("on it", *self._names), *rows] if rows else [], []


def family2(robot: Robot, parameters: tuple[str, str]) -> Callable[[float, float], PlanarModel]:
    """The planar model as a function of two parameters in SI units.

    Raises
    ------
    ParameterError
        If one does not vary continuously or the planar model does not read it, or both are the same.
    """
    if parameters[0] == parameters[1]:
        raise ParameterError("must be two parameters", field="parameters", value=parameters)
    for parameter in parameters:
        check_parameter(robot, parameter)
    symmetric = "gait.side_phase" not in parameters
    first, second = parameters
    return lambda p, q: PlanarModel(robot.with_value(first, p).with_value(second, q), use_symmetry=symmetric)


def transition_curve(
    robot: Robot,
    parameters: tuple[str, str],
    between: Box,
    kind: Kind,
    *,
    second: float,
    points: int = 100,
    longest: float = 0.05,
    progress: Progress = silent,
) -> TransitionCurve:
    """Follow the curve of bifurcations through the topmost such point at one value of the second parameter.

    Parameters
    ----------
    robot, parameters
        Robot, and dotted paths of two parameters, such as ``springs.stiffness[0]`` and ``legs.forward_offset``.
    between
        Both intervals in SI units: the first is searched for a point to start from, and the curve is followed in both.
    kind, second
        Kind of the bifurcation; value of the second parameter (SI) at which the first is searched.
    points, longest
        Largest number of points in each direction; largest step, in units of ``between``.
    progress
        Function that receives the number of points so far.

    Raises
    ------
    AnalysisError
        If there is no such bifurcation at the start.
    """
    family = family2(robot, parameters)
    there = robot.with_value(parameters[1], second)
    found = [each.point for each in bifurcations(there, parameters[0], between[0], normal_form=False)]
    starts = [point for point in found if point.kind is kind]
    if not starts:
        others = ", ".join(point.kind.label for point in found)
        raise AnalysisError(f"no {kind.label} in the interval", field=parameters[0], allowed=others)

    def told(count: int, point: object) -> None:
        progress(min(1.0, count / points), f"{count} points")

    curve = follow2(family, starts[-1], between, second=second, points=points, longest=longest, progress=told)
    return TransitionCurve(curve, parameters, (robot.unit_of(parameters[0]), robot.unit_of(parameters[1])))
