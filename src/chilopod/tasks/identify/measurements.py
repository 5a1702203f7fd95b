"""Measurements that would tell most about the planar constants that an identification leaves open.

About the best constants each measurement is linear in them. What it would leave of the range of a constant is the
projection of the polytope in which all data, old and new, are within their tolerances, if the new ones come out as
predicted. What it would leave of the volume is that of the ellipsoid for tolerances that are standard errors, the
criterion of D-optimal design.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import linprog

from chilopod import stability, units
from chilopod.analysis.parameters import ALL, K1
from chilopod.analysis.quantities import Measured, Onset
from chilopod.analysis.straight_walk import first_loss
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.frozen import Array
from chilopod.notebook import Shown, aligned
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify.planar import Identification
from chilopod.tasks.identify.planar_fit import FREE, Pitchforks, determined, jacobian, scale_of, with_constants

_STEP, _AGREE = 1e-3, 0.05  # of differences, in units of `scale_of`, and how well they agree with those of its double
_CHANGES = {ALL: (0.5, 0.7, 1.5), "gait.stride": (0.6, 1.5), "gait.stance": (1.5,)}  # factors


@dataclass(frozen=True)
class Measurement:
    """A measurement that could be made: its name, its numbers, SI, of a robot, and their tolerance, relative or SI."""

    name: str
    of: Callable[[Robot], Array] = field(repr=False)
    tolerance: float
    relative: bool = True


@dataclass(frozen=True)
class NextMeasurements(Shown):
    """Measurements, that which would leave least of the volume of the free constants first, and measurements that could
    not be predicted, with the reason. ``rows`` have, of each ``measurement``, its ``tolerance``, its numbers and their
    tolerances (``predicted_si``, ``tolerances_si``), and what it would leave of the volume and of each range."""

    rows: list[dict[str, Any]]
    left_out: dict[str, str]

    def as_json(self) -> dict[str, Any]:
        """The fields, as plain numbers."""
        return {"measurements": self.rows, "left_out": self.left_out}

    def lines(self) -> list[str]:
        """The table, best first, and what was left out."""
        table: list[Sequence[str]] = []
        for row in self.rows:
            table = table or [("next measurement", "tolerance", "leaves of the volume", *row["range_left"])]
            parts = (f"{100.0 * part:.3g} %" for part in (row["volume_left"], *row["range_left"].values()))
            table.append((row["measurement"], row["tolerance"], *parts))
        return [*aligned(table), *(f"left out: {name}: {why}" for name, why in self.left_out.items())]

    _lines = lines


def next_measurements(
    found: Identification,
    candidates: Sequence[Measurement] | None = None,
    free: Sequence[str] = FREE,
    progress: Progress = silent,
) -> NextMeasurements:
    """Rank measurements, by default :func:`usual`, by what they would leave of the volume of the constants that are
    ``free``; the others are taken as they were found. AnalysisError if the data leave a combination open."""
    columns = [FREE.index(path) for path in free]
    known = jacobian(found.given, found.data, found.constants)[:, columns]
    if np.isnan(found.spread).any():
        raise AnalysisError("as standard errors the tolerances must explain the residuals")
    if not determined(known):
        raise AnalysisError("the data must bound all combinations of the constants; they leave one open")
    now, information = _widths(known, found.residuals), known.T @ known
    rows, left_out = [], {}
    given = list(usual(found)) if candidates is None else candidates
    for number, each in enumerate(given):
        progress(number / len(given), each.name)
        try:
            predicted, tolerances, slopes = _linear(each, found, columns)
        except ChilopodError as error:
            left_out[each.name] = str(error)
            continue
        left = np.linalg.det(information) / np.linalg.det(information + slopes.T @ slopes)
        ranges = _widths(np.vstack([known, slopes]), np.append(found.residuals, np.zeros(len(slopes)))) / now
        rows.append(
            {
                "measurement": each.name,
                "tolerance": f"{100.0 * each.tolerance:.2g} %" if each.relative else f"{each.tolerance:.2g}",
                "predicted_si": predicted.tolist(),
                "tolerances_si": tolerances.tolist(),
                "volume_left": float(np.sqrt(left)),
                "range_left": dict(zip(free, ranges.tolist(), strict=True)),
            }
        )
    return NextMeasurements(sorted(rows, key=lambda row: row["volume_left"]), left_out)


def _linear(measurement: Measurement, found: Identification, columns: Sequence[int]) -> tuple[Array, Array, Array]:
    """Predicted numbers, their tolerances, and their derivatives over constants in units of :func:`scale_of`, over the
    tolerances, by central differences with two steps that must agree."""
    best, scale = found.constants, scale_of(found.given, found.data)

    def at(move: Array) -> Array:
        numbers = np.asarray(measurement.of(with_constants(found.given, best + move * scale)))
        if not np.isfinite(numbers).all():
            raise AnalysisError("the numbers must be finite")
        return numbers

    predicted = at(np.zeros(len(FREE)))
    tolerances = measurement.tolerance * (np.abs(predicted) if measurement.relative else np.ones(predicted.shape))
    if not tolerances.all():
        raise AnalysisError("the tolerance must not be zero, as that of a number that is zero")
    moves = _STEP * np.eye(len(FREE))[columns]
    fine, coarse = (np.array([at(f * m) - at(-f * m) for m in moves]).T / (2.0 * f * _STEP) for f in (1.0, 2.0))
    fine, coarse = fine / tolerances[:, None], coarse / tolerances[:, None]
    if np.abs(fine - coarse).max() > _AGREE * max(np.abs(fine).max(), 1.0):
        raise AnalysisError("the numbers must be smooth in the constants")
    return predicted, tolerances, (4.0 * fine - coarse) / 3.0


def _widths(slopes: Array, residuals: Array) -> Array:
    """Widths of the projections of {max |residuals + slopes d| <= max(1, max |residuals|)}, shape (constants,)."""
    most = max(1.0, float(np.abs(residuals).max()))
    sides = np.vstack([slopes, -slopes]), np.concatenate([most - residuals, most + residuals])
    goals = np.eye(slopes.shape[1])
    return -np.array([sum(linprog(s * goal, *sides, bounds=(None, None)).fun for s in (1.0, -1.0)) for goal in goals])


def usual(found: Identification) -> Iterator[Measurement]:
    """Measurements that owners of such a robot could make: springs, rates, radii and lengths with the relative
    tolerance of the data's spring, modes with that of the data's mode."""
    robot, data = found.best, found.data
    rough, fine = data.k1_tolerance / data.k1, data.component_tolerance
    critical = data.k1 + float(found.residuals[0]) * data.k1_tolerance

    def said(path: str, value: float) -> str:
        name = {K1: "k1", ALL: "other springs"}.get(path, path)
        return f"{name} = {units.format(value, robot.unit_of(path), digits=3)}"

    changes = [("twice as exact", K1, critical, 0.5), ("module phase 180 deg", "gait.module_phase", np.pi, 1.0)]
    for path, factors in _CHANGES.items():
        present = robot.springs.stiffness[-1] if path == ALL else robot.get(path)
        changes += [(said(path, factor * present), path, factor * present, 1.0) for factor in factors]
    for words, path, value, part in changes:
        of = _critical(path, value, data.between)
        yield Measurement(f"critical k1, {words}", partial(_part, of, slice(1)), part * rough)
        yield Measurement(f"mode, {words}", partial(_part, of, slice(1, None)), part * fine, relative=False)
    for name, words in (("value", "critical spring"), ("frequency", "frequency of undulation")):
        yield Measurement(f"{words}, all springs alike", partial(_undulation, data.between, name), rough)
    for words, spring in (("decay", 4.0 * critical), ("decay", 2.0 * critical), ("growth", 0.8 * critical)):
        yield Measurement(f"{words} after a push, {said(K1, spring)}", partial(_rate, spring), rough)
    for spring in critical * np.array([0.95, 0.8, 0.6]):
        yield Measurement(f"radius, {said(K1, spring)}", _radius(spring, data.between[1]), rough)
    for path in FREE:
        yield Measurement(f"{path} itself", partial(_own, path), rough)


def _critical(path: str, value: float, between: Sequence[float]) -> Callable[[Robot], Array]:
    """Critical spring and mode of a robot with a changed value."""
    pitchforks = Pitchforks(between)

    def of(robot: Robot) -> Array:
        point = pitchforks(robot.with_value(path, value))
        if point is None:
            raise AnalysisError("there must be a pitchfork in the interval of the data")
        return np.append(*point)

    return of


def _part(of: Callable[[Robot], Array], part: slice, robot: Robot) -> Array:
    return of(robot)[part]


def _own(path: str, robot: Robot) -> Array:
    return np.array([robot.get(path)])


def _undulation(between: Sequence[float], name: str, robot: Robot) -> Array:
    point = first_loss(robot, ALL, (between[0], between[1]), Kind.NEIMARK_SACKER, normal_form=False).point
    return np.array([getattr(point, name)])


def _rate(spring: float, robot: Robot) -> Array:
    return np.array([stability.exponents(PlanarModel(robot.with_value(K1, spring))).values.real.max()])


def _radius(spring: float, above: float) -> Callable[[Robot], Array]:
    radius = Measured(Onset(K1, (spring, above), spring)).function("radius")
    return lambda robot: np.array([radius(robot)])
