"""Results as tables, with shared words and marks."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from decimal import ROUND_CEILING, Context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod.errors import OutputError, ParameterError
from chilopod.labels import Labelled
from chilopod.notebook import Shown as Shown
from chilopod.notebook import aligned, picture
from chilopod.notebook import axes_for as axes_for
from chilopod.output import write_atomic

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_PARAMETER, _STATE, _TIME = "unit of the parameter", "units of the states", "unit of time"
_COLUMNS: dict[str, tuple[Any, ...]] = {
    "value": (float, "parameter", _PARAMETER),
    "values": (float, "both parameters", _PARAMETER, "parameter"),
    "error_bound": (float, "bound on the error of the parameter", _PARAMETER, "parameter"),
    "value_error_bound": (float, "bound on the error of the parameter at a special point", _PARAMETER),
    "multipliers_error_bound": (float, "bound on the error of the multipliers that are not small", "1"),
    "kind": (str, "what happens here", ""),
    "special": (str, "what happens at a special point", ""),
    "criticality": (str, "which way new orbits go", ""),
    "verdict": (str, "stability", ""),
    "coefficient": (float, "coefficient of the normal form", "1 / powers of the unit of the mode"),
    "coefficient_error": (float, "bound on the error of the coefficient", "1 / powers of the unit of the mode"),
    "frequency": (float, "angular frequency of the critical mode", f"rad / {_TIME}"),
    "period": (float, "period of the orbit", _TIME),
    "multiplicity": (int, "number of critical multipliers", "1"),
    "orbit": (float, "state at time 0", _STATE, "state"),
    "mode": (complex, "critical mode", _STATE, "state"),
    "multiplier": (complex, "critical multiplier of the return map; of a Hopf point the eigenvalue", "1"),
    "multipliers": (complex, "multipliers", "1", "multiplier"),
    "half_period": (complex, "multipliers of the return map", "1"),
    "modulus": (float, "modulus of the multipliers", "1"),
    "error_bounds": (float, "bound on the error of the multipliers", "1"),
}

_MOST = 6  # largest numbers of rows of a table, and of remarks
_MARKERS = "osD^vP*X"


class Result(Shown):
    """Base of results with a printed summary, a drawing and a table, which each class defines."""

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the result on axes of matplotlib, by default of a new figure, and return them."""
        raise NotImplementedError

    def to_dataset(self) -> xr.Dataset:
        """The table as a dataset, with long names and units."""
        raise NotImplementedError

    def to_csv(self, path: str | Path | None = None) -> str:
        """The dataset as a table in text.

        Parameters
        ----------
        path
            File to write to, if any, in an existing folder; an existing file is replaced.

        Returns
        -------
        Comma-separated values, a line for each point; state ``i`` of an orbit is the column ``orbit[i]``. Lines that
        begin with ``#`` above hold the attributes and explain the columns.
        """
        data = self.to_dataset()
        table: dict[str, list[Any]] = {}
        text = io.StringIO()
        text.writelines(f"# {name}: {' '.join(str(value).split())}\n" for name, value in data.attrs.items())
        for name, each in data.data_vars.items():
            text.write(f"# {name}: {', '.join(filter(None, (each.attrs['long_name'], each.attrs['units'])))}\n")
            if each.ndim == 1:
                table[str(name)] = each.values.tolist()
            else:
                table |= {f"{name}[{i}]": values for i, values in enumerate(each.values.T.tolist())}
        csv.writer(text, lineterminator="\n").writerows([list(table), *zip(*table.values(), strict=True)])
        if path is not None:
            if not isinstance(path, str | Path):
                raise ParameterError("must be a path", field="path", value=path, allowed="text or a pathlib.Path")
            if not Path(path).absolute().parent.is_dir():
                raise OutputError("has no folder", source=str(path), allowed="a file in an existing folder")
            write_atomic(path, text.getvalue())
        return text.getvalue()

    def _picture(self) -> str:
        return picture(self.plot, str(self).partition("\n")[0])


def number(value: complex, digits: int = 10) -> str:
    """A complex number in words, without an imaginary part that is zero."""
    return f"{value:.{digits}g}" if value.imag else f"{value.real:.{digits}g}"


def bounded(value: float, bound: float) -> str:
    """A value with the bound on its error, which holds for the digits that are shown."""
    for digits in range(12, 18):
        text = f"{value:.{digits}g}"
        rounding = abs(float(text) - value)
        if not rounding > 0.1 * bound:
            break
    if np.isfinite(rounding + bound):
        bound = float(Context(prec=2, rounding=ROUND_CEILING).create_decimal_from_float(bound + rounding))
    return f"{text} ± {bound:.1e}"


def rows(cells: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table with aligned columns; only the first of many rows."""
    return [f"  {line}" for line in aligned(cells, _MOST)]


def said(remarks: Sequence[str]) -> list[str]:
    """Lines of remarks."""
    more = [f"and {len(remarks) - _MOST} more remarks"] if len(remarks) > _MOST else []
    return [f"remark: {each}" for each in remarks[:_MOST]] + more


def mark(axes: Axes, points: Iterable[tuple[str, float, float]]) -> None:
    """Draw points, label, x and y, with a marker for each label, and a legend with every label on the axes once."""
    from matplotlib import rcParams

    places: dict[str, list[tuple[float, float]]] = {}
    for label, *place in points:
        places.setdefault(label, []).append((place[0], place[1]))
    known = {str(line.get_label()): line.get_marker() for line in axes.lines if line.get_linestyle() == "None"}
    ink: Any = {"color": rcParams["text.color"]}
    for label, found in places.items():
        marker = known.setdefault(label, _MARKERS[len(known) % len(_MARKERS)])
        axes.plot(*zip(*found, strict=True), linestyle="None", marker=marker, zorder=3, label=label, **ink)
    handles, labels = axes.get_legend_handles_labels()
    first = {label: handles[labels.index(label)] for label in labels}
    if first:
        axes.legend(first.values(), first.keys())


def columns(points: Iterable[object], *names: str) -> dict[str, list[Any]]:
    """Attributes of points as columns; None for missing ones."""
    points = list(points)
    return {name: [getattr(point, name, None) for point in points] for name in names}


def dataset(rows: str, values: dict[str, Any], **attributes: Any) -> xr.Dataset:
    """A dataset over some rows; complex columns become two, of their real and their imaginary parts."""
    import xarray as xr

    variables = {}
    for name, column in values.items():
        kind, long_name, units, *across = _COLUMNS[name]
        if kind is str:
            column = [each.label if isinstance(each, Labelled) else each or "" for each in column]
        array = np.array(column, dtype=kind)
        dimensions = (rows, *across)[: array.ndim]
        parts = {name: array}
        if kind is complex:
            parts = {f"{name}_real": array.real, f"{name}_imag": array.imag}
        for part, numbers in parts.items():
            variables[part] = (dimensions, numbers, {"long_name": long_name, "units": units})
    return xr.Dataset(variables, attrs=attributes)
