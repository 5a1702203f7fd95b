"""Measurements that would tell most about the planar constants that an identification leaves open.

About the best constants each measurement is linear in the constants. What it would leave of the range of a constant is
the projection of the polytope in which all data, old and new, are met within their tolerances, if the new ones come out
as the best constants predict. What it would leave of the volume is that of the ellipsoid for tolerances that are
standard errors, the criterion of D-optimal design. Measurements are ranked by that, and so are those that are made
together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import linprog

from chilopod import stability, units
from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import ALL, K1
from chilopod.analysis.straight_walk import first_loss
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.frozen import Array
from chilopod.notebook import Shown, aligned
from chilopod.planar import PlanarModel
from chilopod.planar.along import FollowedModel, walk_means
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify.critical import Pitchforks
from chilopod.tasks.identify.planar import FREE, Identification, jacobian, scale_of, with_constants

_STEP = 1e-3  # of differences, in the units of `scale_of`
_AGREE = 0.05  # relative, of differences with this step and its double
_BEYOND = 2.0  # factor by which critical springs of changed robots may leave the interval of the data
_ORBIT = 1e-10  # tolerance of the flow of curved walks
_TOGETHER = 3  # measurements


@dataclass(frozen=True)
class Measurement:
    """A measurement that could be made: its name, the numbers as a function of a robot with certain constants, SI, and
    their tolerance, absolute or relative to the number."""

    name: str
    of: Callable[[Robot], Array] = field(repr=False)
    tolerance: float
    relative: bool = True

    def tolerances(self, numbers: Array) -> Array:
        """Tolerance of each of the numbers."""
        return np.abs(numbers) * self.tolerance if self.relative else np.full(numbers.shape, self.tolerance)


@dataclass(frozen=True)
class Prospect:
    """What a measurement would leave open, relative to the present state.

    Attributes
    ----------
    measurement, predicted
        The measurement, and the numbers at the best constants, SI.
    slopes
        Their derivatives over the free constants in units of :func:`scale_of`, over their tolerances, shape (numbers,
        constants).
    volume, ranges
        Parts that it would leave of the volume of the constants, and of the range of each, shape (constants,).
    """

    measurement: Measurement
    predicted: Array
    slopes: Array
    volume: float
    ranges: Array


@dataclass(frozen=True)
class NextMeasurements(Shown):
    """Measurements ranked by what they would leave open.

    Attributes
    ----------
    prospects, free
        The measurements, best first, and the constants that are free.
    together
        Names of three measurements of which each is the best beside those before it, and the part of the volume that
        they leave.
    left_out
        Measurements that could not be predicted, with the reason.
    """

    prospects: list[Prospect]
    free: tuple[str, ...]
    together: dict[str, float]
    left_out: dict[str, str]

    def as_json(self) -> dict[str, Any]:
        """Prospects as plain numbers."""
        rows = [
            {
                "measurement": each.measurement.name,
                "predicted_si": each.predicted.tolist(),
                "tolerances_si": each.measurement.tolerances(each.predicted).tolist(),
                "volume_left": each.volume,
                "range_left": dict(zip(self.free, each.ranges.tolist(), strict=True)),
            }
            for each in self.prospects
        ]
        return {"measurements": rows, "together": self.together, "left_out": self.left_out}

    def lines(self) -> list[str]:
        """The table, best first, and what was left out."""
        rows: list[Sequence[str]] = [("next measurement", "tolerance", "leaves of the volume", *self.free)]
        for each in self.prospects:
            made = each.measurement
            tolerance = f"{100.0 * made.tolerance:.2g} %" if made.relative else f"{made.tolerance:.2g}"
            rows.append((made.name, tolerance, *(f"{100.0 * part:.3g} %" for part in (each.volume, *each.ranges))))
        parts = (f"{name} (with those before it {100.0 * part:.2g} %)" for name, part in self.together.items())
        said = [f"best together: {'; '.join(parts)}"] if self.together else []
        return [*aligned(rows), *said, *(f"left out: {name}: {why}" for name, why in self.left_out.items())]

    def _lines(self) -> list[str]:
        return self.lines()


def next_measurements(
    found: Identification,
    candidates: Sequence[Measurement] | None = None,
    free: Sequence[str] = (),
    progress: Progress = silent,
) -> NextMeasurements:
    """Rank measurements by what they would leave of the volume of the constants.

    Parameters
    ----------
    found
        Identification of the constants.
    candidates
        Measurements; by default those of :func:`usual`.
    free
        Constants that are not known, all of :data:`FREE` by default; the others are taken as they were found.
    progress
        Function that receives the progress.
    """
    robot, data = found.best, found.data
    free = tuple(free or FREE)
    columns = [FREE.index(path) for path in free]
    best, scale = np.array([robot.get(path) for path in FREE]), scale_of(robot, data)
    known = jacobian(robot, data, best)[:, columns]
    now, prospects, left_out = _widths(known, found.residuals), [], {}
    given = list(usual(found)) if candidates is None else list(candidates)
    for number, each in enumerate(given):
        progress(number / len(given), each.name)
        try:
            predicted, slopes = _derivative(each, robot, best, scale, columns)
        except ChilopodError as error:
            left_out[each.name] = str(error)
            continue
        tolerances = each.tolerances(predicted)
        if not tolerances.all():
            left_out[each.name] = "the number is zero, and so is a tolerance relative to it"
            continue
        slopes = slopes / tolerances[:, None]
        expected = np.append(found.residuals, np.zeros(len(slopes)))
        ranges = _widths(np.vstack([known, slopes]), expected) / now
        prospects.append(Prospect(each, predicted, slopes, _volume(known, slopes), ranges))
    prospects.sort(key=lambda each: each.volume)
    return NextMeasurements(prospects, free, _together(known, prospects), left_out)


def _volume(known: Array, slopes: Array) -> float:
    """Part of the volume of the constants that more residuals leave, from derivatives of the old and the new."""
    before, after = known.T @ known, known.T @ known + slopes.T @ slopes
    return float(np.sqrt(np.linalg.det(before) / np.linalg.det(after)))


def _together(known: Array, prospects: Sequence[Prospect]) -> dict[str, float]:
    chosen: dict[str, float] = {}
    made = np.zeros((0, known.shape[1]))
    while len(chosen) < min(_TOGETHER, len(prospects)):
        rest = [each for each in prospects if each.measurement.name not in chosen]
        best = min(rest, key=lambda each: _volume(known, np.vstack([made, each.slopes])))
        made = np.vstack([made, best.slopes])
        chosen[best.measurement.name] = _volume(known, made)
    return chosen


def _derivative(
    measurement: Measurement, robot: Robot, best: Array, scale: Array, columns: Sequence[int]
) -> tuple[Array, Array]:
    """Predicted numbers and their central differences over free constants in units of :func:`scale_of`, extrapolated
    from two steps that must agree."""
    predicted = np.asarray(measurement.of(with_constants(robot, best)))
    slopes = []
    for direction in np.eye(len(FREE))[list(columns)]:
        moves = [step * _STEP * direction * scale for step in (1.0, -1.0, 2.0, -2.0)]
        near, back, far, far_back = (np.asarray(measurement.of(with_constants(robot, best + move))) for move in moves)
        fine, coarse = (near - back) / (2.0 * _STEP), (far - far_back) / (4.0 * _STEP)
        if np.abs(fine - coarse).max() > _AGREE * max(np.abs(fine).max(), 1e-6 * np.abs(predicted).max()):
            raise AnalysisError("must be smooth in the constants", field=measurement.name)
        slopes.append((4.0 * fine - coarse) / 3.0)
    return predicted, np.array(slopes).T


def _widths(slopes: Array, residuals: Array) -> Array:
    """Widths of the projections of {max |residuals + slopes d| <= max(1, max |residuals|)}, shape (constants,)."""
    most = max(1.0, float(np.abs(residuals).max()))
    sides = np.vstack([slopes, -slopes]), np.concatenate([most - residuals, most + residuals])
    goals = np.vstack([np.eye(slopes.shape[1]), -np.eye(slopes.shape[1])])
    least = np.array([linprog(goal, *sides, bounds=(None, None)).fun for goal in goals])
    return -least[: slopes.shape[1]] - least[slopes.shape[1] :]


def usual(found: Identification) -> Iterator[Measurement]:
    """Measurements that owners of such a robot could make. Springs, rates, radii and lengths have the relative
    tolerance of the data's spring, modes that of the data's mode."""
    robot, data = found.best, found.data
    rough, fine = data.k1_tolerance / data.k1, data.component_tolerance
    between = data.between[0] / _BEYOND, data.between[1] * _BEYOND
    yield Measurement("critical k1, twice as exact", _critical({}, data.between, slice(1)), 0.5 * rough)
    yield Measurement("mode, twice as exact", _critical({}, data.between, slice(1, None)), 0.5 * fine, relative=False)
    for words, change in _changes(robot).items():
        yield Measurement(f"critical k1, {words}", _critical(change, between, slice(1)), rough)
        yield Measurement(f"mode, {words}", _critical(change, between, slice(1, None)), fine, relative=False)
    yield Measurement("critical spring, all springs alike", _undulation(between, 0), rough)
    yield Measurement("frequency of undulation there", _undulation(between, 1), rough)
    critical = data.k1 + float(found.residuals[0]) * data.k1_tolerance
    for factor in (4.0, 2.0, 0.8):
        what = "decay" if factor > 1.0 else "growth"
        yield Measurement(
            f"{what} after a push, {_said(robot, K1, factor * critical)}", _rate(factor * critical), rough
        )
    for factor in (0.95, 0.8, 0.6):
        of = _radius(factor * critical, 1.1 * critical)
        yield Measurement(f"radius of the curve, {_said(robot, K1, factor * critical)}", of, rough)
    for path in FREE:
        yield Measurement(f"{path} itself", _own(path), rough)


def _changes(robot: Robot) -> dict[str, dict[str, float]]:
    """Changed values of a robot by what is said of them."""
    changes = {}
    for path, factors in {ALL: (0.5, 0.7, 1.5), "gait.stride": (0.6, 1.5), "gait.stance": (1.5,)}.items():
        present = robot.springs.stiffness[-1] if path == ALL else robot.get(path)
        for factor in factors:
            changes[_said(robot, path, factor * present)] = {path: factor * present}
    return {**changes, "gait.module_phase = 180 deg": {"gait.module_phase": np.pi}}


def _said(robot: Robot, path: str, value: float) -> str:
    name = {K1: "k1", ALL: "other springs"}.get(path, path)
    return f"{name} = {units.format(value, robot.unit_of(path), digits=3)}"


def _critical(change: dict[str, float], between: Sequence[float], part: slice) -> Callable[[Robot], Array]:
    pitchforks = Pitchforks(between)

    def of(robot: Robot) -> Array:
        for path, value in change.items():
            robot = robot.with_value(path, value)
        point = pitchforks(robot)
        if point is None:
            raise AnalysisError("no pitchfork in the interval of the data or beside it", field=K1)
        return np.append(point.spring, point.mode)[part]

    return of


def _undulation(between: tuple[float, float], part: int) -> Callable[[Robot], Array]:
    def of(robot: Robot) -> Array:
        point = first_loss(robot, ALL, between, Kind.NEIMARK_SACKER, normal_form=False).point
        return np.array([(point.value, point.frequency)[part]])

    return of


def _own(path: str) -> Callable[[Robot], Array]:
    return lambda robot: np.array([robot.get(path)])


def _rate(spring: float) -> Callable[[Robot], Array]:
    def of(robot: Robot) -> Array:
        values = stability.exponents(PlanarModel(robot.with_value(K1, spring))).values
        return np.array([values.real.max()])

    return of


def _radius(spring: float, above: float) -> Callable[[Robot], Array]:
    orbits: list[Array] = []

    def of(robot: Robot) -> Array:
        if not orbits:
            orbits.append(curved_walks(robot, K1, (spring, above)).orbit.values[-1])
        model = FollowedModel(robot.with_value(K1, spring), _ORBIT, use_symmetry=False)
        orbit = np.asarray(stability.find_orbit(model, orbits[0], with_error=False, settle=False))
        radius = float(robot.axis_radius(walk_means([model], [orbit]).mean_angle)[0])
        if not radius < 1e3 * robot.body.length:
            raise AnalysisError("the robot must curve", field=K1)
        return np.array([radius])

    return of
