"""Derivatives of a robot's onset, growth, radius and coefficient with respect to every number of its file.

The return map H of the straight walk is computed exactly for any robot. With the left and right eigenvectors l, r of a
multiplier nu, l r = 1, its derivative by a number p is nu' = l H' r (first-order perturbation; Kato, *Perturbation
Theory for Linear Operators*, section II.2), where H' comes from extrapolated differences
(:mod:`chilopod.analysis.derivatives`). The growth rate is log |nu| / tau, with the duration tau of a return. It is zero
at the onset k, so dk/dp = -(growth by p) / (growth by k). The radius is that of the curved walk corrected at
neighbouring robots; the coefficient is that of their normal forms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod import units
from chilopod.analysis.derivatives import ROUND_OFF, derivative
from chilopod.analysis.parameters import numbers_read
from chilopod.analysis.quantities import QUANTITIES, UNEVEN, Leading, Measured, Mode, Onset, size_of, unit_of
from chilopod.errors import AnalysisError, ParameterError, known_names, nearest_name
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.notebook import Summary, finite, tornado
from chilopod.progress import Progress, silent
from chilopod.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEFAULT = ("onset", "growth", "frequency")
"""Quantities that take little time."""

_RELATIVE = "onset", "radius"  # shown in % per %; the others may be near zero


@dataclass(frozen=True, eq=False)
class Sensitivity(Summary, ReadOnlyArrays):
    """Derivatives of quantities with respect to the numbers of a robot.

    Attributes
    ----------
    robot, onset
        Robot at the value of the onset's number that is studied, and that number.
    paths, numbers
        Paths of the numbers, and their values, SI, shape (numbers,).
    quantities, values
        Some of :data:`chilopod.analysis.quantities.QUANTITIES`, and their values, SI, shape (quantities,).
    derivatives, errors
        Derivatives and estimates of their errors, SI, shape (quantities, numbers); NaN where neighbouring robots lack
        the quantity.
    """

    robot: Robot
    onset: Onset
    paths: tuple[str, ...]
    numbers: Array
    quantities: tuple[str, ...]
    values: Array
    derivatives: Array
    errors: Array

    def of(self, quantity: str) -> dict[str, float]:
        """Derivatives of one quantity by the path of the number, SI."""
        return dict(zip(self.paths, self.derivatives[self._row(quantity)].tolist(), strict=True))

    def percent(self, quantity: str) -> dict[str, float]:
        """Change of one quantity by 1 % of each number, by path: in % of onset and radius, else in its unit."""
        return dict(zip(self.paths, self._percent(self._row(quantity)).tolist(), strict=True))

    def _percent(self, row: int) -> Array:
        changes = self.derivatives[row] * self.numbers
        return changes / self.values[row] if self.quantities[row] in _RELATIVE else 0.01 * changes

    def _row(self, quantity: str) -> int:
        known_names([quantity], self.quantities, "quantity", "is not computed")
        return self.quantities.index(quantity)

    def as_json(self) -> dict[str, Any]:
        """Values, derivatives and errors as plain numbers, SI, and the changes by 1 % of every number."""
        numbers = dict(zip(self.paths, self.numbers.tolist(), strict=True))
        at = numbers.get(self.onset.parameter) if self.onset.at is None else self.onset.at
        found: dict[str, Any] = {"robot": self.robot.name, "parameter": self.onset.parameter, "at_si": at}
        found["numbers_si"] = numbers
        for row, name in enumerate(self.quantities):
            found[name] = {"value_si": (value := float(self.values[row]))}
            changes = "percent_per_percent" if name in _RELATIVE else "change_per_percent"
            errors = dict(zip(self.paths, self.errors[row].tolist(), strict=True))
            tables = {"derivatives_si": self.of(name), "errors_si": errors, changes: self.percent(name)}
            if name == "onset":
                found[name]["fate"] = self.onset.fate(self.robot, value).label
            found[name] |= {key: {path: finite(x) for path, x in table.items()} for key, table in tables.items()}
        return found

    @property
    def title(self) -> str:
        """Robot, and the values of the quantities."""
        shown = zip(self.quantities, self.values.tolist(), strict=True)
        said = (f"{name} {self.onset.in_words(self.robot, name, value, 5)}" for name, value in shown)
        return f"{self.robot.name}: {', '.join(said)}"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        known, missing = np.abs(self.derivatives) > self.errors, np.isnan(self.derivatives)
        rows = [row for row, sure in enumerate(known) if sure.any()]  # no frequency of a bend
        heads = [f"{name} ({f'{_changed(name)} per %'.strip()})" for name in (self.quantities[row] for row in rows)]
        cells: list[Sequence[str]] = [("number", "value", *heads)]
        percents = {row: self._percent(row) for row in rows}
        below, without, lacks = [], [], []
        largest = np.abs(np.nan_to_num(self.derivatives[rows[:1]]) * self.numbers).sum(axis=0)
        for at in np.argsort(-largest, kind="stable").tolist():
            path, unit = self.paths[at], self.robot.unit_of(self.paths[at])
            lacks += [f"{name} by {path}" for name, no in zip(self.quantities, missing[:, at], strict=True) if no]
            if not known[:, at].any():
                without += [path] * (not missing[:, at].any())
            elif self.numbers[at] == 0.0:
                below += [f"{path} is 0: {self._slope_in_words(row, at)}" for row in rows if known[row, at]]
            else:
                texts = {row: f"{percents[row][at]:+.4g}" if known[row, at] else "0" for row in rows}
                changes = ("" if missing[row, at] else text for row, text in texts.items())
                cells.append((path, units.format(self.robot.get(path), unit, digits=5), *changes))
        below += [f"no effect to first order: {', '.join(without)}"] * bool(without)
        below += [f"no derivative: {', '.join(lacks)}"] * bool(lacks)
        return [], cells, below

    def _slope_in_words(self, row: int, at: int) -> str:
        name, unit = self.quantities[row], self.robot.unit_of(self.paths[at])
        own = unit_of(name, self.robot, self.onset)
        slope = units.from_si(self.derivatives[row, at], own) / units.from_si(1.0, unit)
        return f"{name} changes by {f'{slope:+.4g} {own}'.strip()} for 1 {unit}"

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the changes of the first quantity by 1 % of each number, largest on top."""
        name = self.quantities[0]
        known = np.abs(self.derivatives[0] * self.numbers) > self.errors[0] * np.abs(self.numbers)
        changes = {path: each for (path, each), sure in zip(self.percent(name).items(), known, strict=True) if sure}
        said = f"change of the {name} by 1 % of a number" + f" ({_changed(name)})" * bool(_changed(name))
        return tornado(axes, changes, said, self.robot.name)


def _changed(name: str) -> str:
    """Unit in which the change of a quantity by one per cent of a number is shown."""
    return "%" if name in _RELATIVE else QUANTITIES[name]


def sensitivity(
    robot: Robot,
    onset: Onset = Onset(),  # noqa: B008 (frozen)
    quantities: Sequence[str] = DEFAULT,
    paths: Sequence[str] | None = None,
    progress: Progress = silent,
) -> Sensitivity:
    """Derivatives of quantities with respect to numbers of a robot. AnalysisError if a quantity does not exist, as the
    radius of a robot that walks straight; ParameterError if a quantity or a number is not known.

    Parameters
    ----------
    robot, onset
        Robot, and the number whose change bends it, with the value at which growth, frequency and radius are taken.
    quantities
        Some of :data:`chilopod.analysis.quantities.QUANTITIES`. The coefficient takes a hundred normal forms, the
        radius a branch of curved walks.
    paths
        Numbers, by default all that the planar model reads.
    """
    wanted = known_names(quantities, QUANTITIES, "quantities")
    robot = onset.there(robot)
    read = numbers_read(robot)
    for path in paths or ():
        if path not in read:
            near = nearest_name(path, read)
            said = "must be a number that the planar model reads"
            if path == "body.yaw_inertia":
                said = "follows from other numbers of this robot, which has none of its own"
            raise ParameterError(said, field="paths", value=path, allowed=", ".join(read), nearest=near)
    paths = tuple(dict.fromkeys(paths or read))
    found: dict[str, _Row] = {}
    for name in wanted:
        if name not in found:
            rows = _EXACT.get(name, partial(_differentiated, name))
            found |= rows(robot, onset, paths, progress)
    values, slopes, errors = (np.array([found[name][i] for name in wanted]) for i in range(3))
    numbers = np.array([robot.get(path) for path in paths])
    return Sensitivity(robot, onset, paths, numbers, wanted, values, slopes, errors)


_Row = tuple[float, list[float], list[float]]
"""Value of a quantity, its derivatives and their errors."""


def _by_each(
    what: str, paths: Sequence[str], show: Progress, slope: Callable[[str], tuple[Any, Any]]
) -> tuple[list[Any], list[Any]]:
    """Derivatives by every number, and their errors."""
    found = []
    for done, path in enumerate(paths):
        show(done / len(paths), f"{what} by {path}")
        found.append(slope(path))
    return [each for each, _ in found], [error for _, error in found]


def _onset(robot: Robot, onset: Onset, paths: Sequence[str], show: Progress) -> dict[str, _Row]:
    value = onset.first(robot).point.value
    of = Leading(robot.with_value(onset.parameter, value))
    return {"onset": (value, *_by_each("onset", paths, show, partial(of.onset, onset.parameter)))}


def _growth(robot: Robot, onset: Onset, paths: Sequence[str], show: Progress) -> dict[str, _Row]:
    of = Leading(robot)
    mode: Mode = of.mode(True)
    slopes, errors = _by_each("growth", paths, show, lambda path: of.slope(path, path != UNEVEN))
    turns = mode.frequency > 0.0
    turning = [turns * slope.imag for slope in slopes], [turns * error for error in errors]
    growth = mode.growth, [slope.real for slope in slopes], errors
    return {"growth": growth, "frequency": (mode.frequency, *turning)}


def _differentiated(name: str, robot: Robot, onset: Onset, paths: Sequence[str], show: Progress) -> dict[str, _Row]:
    measured = Measured(onset)
    function = partial(measured.walked, name)
    value = function(robot)
    round_off = measured.error(name, robot) / (abs(value) or 1.0) if name == "friction" else ROUND_OFF  # of differences

    def slope(path: str) -> tuple[Any, Any]:
        def at(number: float) -> Array:
            return np.array(function(robot.with_value(path, number)))

        try:
            return derivative(at, robot.get(path), size_of(robot, path), round_off)
        except AnalysisError:  # neighbours lack the quantity, as the coefficient without the symmetry of half a period
            return np.nan, np.nan

    return {name: (value, *_by_each(name, paths, show, slope))}


_EXACT = {"onset": _onset, "growth": _growth, "frequency": _growth}
