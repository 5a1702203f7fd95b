"""Result of a map of the straight walk over two numbers of a robot: a grid of growth rates, and curves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.ndimage import label

from chilopod.analysis.growth import FATES, NEAR, Fate
from chilopod.analysis.map_axes import Axis
from chilopod.analysis.map_curves import MapCurve, MapPoint
from chilopod.frozen import Array, ReadOnlyArrays, read_only
from chilopod.notebook import Summary, finite
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.stability.shown import bounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BEYOND = 1e-6  # part of its last piece by which a curve goes on
_SAME = 3.0  # bounds within which two points of codimension two are one


@dataclass(frozen=True, eq=False)
class StabilityMap(Summary, ReadOnlyArrays):
    """Stability of the straight walk over two numbers of a robot.

    Attributes
    ----------
    robot, x, y
        Robot and both axes.
    x_values, y_values
        Values in SI units, shape (columns,) and (rows,).
    growth, frequency, error, unstable, fate
        Growth rate of the leading disturbance (1/s), its angular frequency (rad/s), the bound on the error of a growth
        rate near zero (1/s, else NaN), the number of unstable multipliers, and what becomes of the disturbance, as of
        :class:`chilopod.analysis.growth.Growth`, shape (rows, columns).
    computed
        True where they were computed, shape (rows, columns); elsewhere growth and frequency are interpolated.
    radius
        Radius of the curved walks, m, shape (rows, columns), NaN where there is none or it was not computed.
    curves, remarks, folds_known
        Curves of bifurcations; sentences about what may be missing or is invalid; True if all folds were followed.
    """

    robot: Robot
    x: Axis
    y: Axis
    x_values: Array
    y_values: Array
    growth: Array
    frequency: Array
    error: Array
    unstable: NDArray[np.int16]
    fate: NDArray[np.int8]
    computed: NDArray[np.bool_]
    radius: Array
    curves: tuple[MapCurve, ...]
    remarks: tuple[str, ...]
    folds_known: bool

    @property
    def special(self) -> tuple[MapPoint, ...]:
        """Points of codimension two, each once where two curves meet."""
        found: list[MapPoint] = []
        for point in (each for curve in self.curves for each in curve.special):
            for other in found:
                apart = np.abs(point.values - other.values)
                if point.kind is other.kind and (apart <= _SAME * (point.error_bound + other.error_bound)).all():
                    break
            else:
                found.append(point)
        return tuple(found)

    @cached_property
    def folded(self) -> Array:
        """1 where curved walks exist beside a stable straight one, else 0, shape (rows, columns). NaN where it is not
        known: for 0 if not all folds are known, and in parts that no pitchfork and no fold bounds. Folds cut the values
        with a stable straight walk into parts. Curved walks exist in one from a subcritical pitchfork to a fold."""
        straight = self.fate == FATES.index(Fate.STRAIGHT)
        joined = np.zeros([2 * count - 1 for count in straight.shape], dtype=bool)  # values, and links between them
        joined[::2, ::2] = straight
        index, begins = np.arange(straight.size).reshape(straight.shape), np.zeros(straight.shape)
        cuts = [np.empty((2, 0), dtype=int)]
        axes = (self.x, self.x_values), (self.y, self.y_values)
        for at, (axis, values) in enumerate(axes):
            if axis.whole:
                continue
            own, links, places, senses = (each.swapaxes(0, at) for each in (straight, joined, index, begins))
            cut, sense = _between(self.curves, at, values, axes[1 - at][1])
            links[::2, 1::2] = own[:, 1:] & own[:, :-1] & ~cut
            senses[:, 1:] += sense
            senses[:, :-1] += sense
            cuts.append(np.stack([places[:, :-1][cut], places[:, 1:][cut]]))
        part = label(joined)[0][::2, ::2]
        begun = np.bincount(part.ravel(), (begins * straight).ravel())
        pairs = part.ravel()[np.hstack(cuts)]
        one, other = np.hstack([pairs, pairs[::-1]])
        ends = (begun[one] > 0.0) & (begun[other] <= 0.0)
        found = np.where(begun < 0.0, 0.0, np.nan)
        found[0] = 0.0  # the straight walk is unstable
        found[other[ends]], found[one[ends]] = 0.0, 1.0
        return read_only(np.where(self.folds_known | (found > 0.0), found, np.nan)[part])

    @property
    def shares(self) -> dict[Fate, float]:
        """Share of the nodes with each fate that occurs."""
        counts = np.bincount(self.fate.ravel(), minlength=len(FATES)) / self.fate.size
        return {fate: float(count) for fate, count in zip(FATES, counts, strict=True) if count}

    @property
    def title(self) -> str:
        """Robot and axes in words."""
        return f"{self.robot.name}: straight walk over {self.x.path} and {self.y.path}"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        shares = ", ".join(f"{fate.label} {100.0 * share:.3g} %" for fate, share in self.shares.items())
        rows, columns = self.fate.shape
        above = [f"{shares} of {columns} x {rows} values, {self.computed.sum()} of which were computed"]
        if (share := self.folded.mean()) > 0.0:
            above.append(f"beside curved walks, straight ones hold at {100.0 * share:.3g} % of the values")
        kinds = Counter(curve.kind.label for curve in self.curves)
        above.append(f"curves: {', '.join(f'{count} of {kind}' for kind, count in kinds.items()) or 'none'}")
        table: list[Sequence[str]] = [("on them", self.x.label, self.y.label)]
        for point in self.special:
            numbers = zip((self.x, self.y), np.column_stack([point.values, point.error_bound]), strict=True)
            pairs = (axis.shown(both).tolist() for axis, both in numbers)
            table.append((point.kind.label, *(bounded(value, abs(error)) for value, error in pairs)))
        return above, table if self.special else [], list(self.remarks)

    def plot(self, axes: Axes | None = None, show: str = "kind") -> Axes:
        """Draw the map on axes of matplotlib or on new ones, and ``show`` in colours the ``kind``, what becomes of a
        disturbance, its ``growth`` rate, the ``frequency`` of undulations, the ``radius`` of the curved walks, or the
        ``criticality``, the coefficient of the normal form along the curves."""
        from chilopod.analysis.map_picture import draw, keys

        axes = draw(self, axes, show)
        axes.legend(handles=keys(self, axes), loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
        return axes

    def as_json(self) -> dict[str, Any]:
        """Curves, special points and shares as plain numbers, in SI units; the grid is that of :meth:`to_dataset`."""

        def plain(found: MapCurve | MapPoint) -> dict[str, Any]:
            errors = found.error_bound.tolist()
            return {"kind": found.kind.label, "values_si": found.values.tolist(), "error_bounds_si": errors}

        return {
            "robot": self.robot.name,
            "x": asdict(self.x),
            "y": asdict(self.y),
            "values": [self.x_values.size, self.y_values.size],
            "computed": int(self.computed.sum()),
            "shares": {fate.label: share for fate, share in self.shares.items()},
            "folded_share": finite(self.folded.mean()),
            "curves": [
                {**plain(curve), "coefficients": [*map(finite, curve.coefficient.tolist())], "line": curve.line}
                for curve in self.curves
            ],
            "special": [plain(point) for point in self.special],
            "remarks": list(self.remarks),
        }

    def to_dataset(self) -> xr.Dataset:
        """Dataset of the grid over (y, x), in the units of axes and attributes, and of the curves over ``point``."""
        grid = ("y", "x")
        meanings = ", ".join(f"{index}: {fate.label}" for index, fate in enumerate(FATES))
        found: dict[str, Any] = {
            "growth": (grid, self.growth, {"units": "1/s"}),
            "frequency": (grid, self.frequency, {"units": "rad/s"}),
            "growth_error": (grid, self.error, {"units": "1/s", "meaning": NEAR}),
            "unstable": (grid, self.unstable),
            "fate": (grid, self.fate, {"meaning": meanings}),
            "computed": (grid, self.computed),
            "folded": (grid, self.folded, {"meaning": "1: curved walks exist beside a stable straight one; 0: none"}),
            "radius": (grid, self.radius, {"units": "m"}),
        }
        none = np.empty((0, 2))
        values = np.concatenate([none, *(curve.values for curve in self.curves)])
        errors = np.concatenate([none, *(curve.error_bound for curve in self.curves)])
        coords = {}
        for column, (name, axis, own) in enumerate((("x", self.x, self.x_values), ("y", self.y, self.y_values))):
            unit = {"units": axis.unit}
            coords[name] = (name, axis.shown(own), {**unit, "long_name": axis.path})
            found[f"curve_{name}"] = ("point", axis.shown(values[:, column]), unit)
            found[f"curve_{name}_error"] = ("point", np.abs(axis.shown(errors[:, column])), unit)
        sizes = [len(curve.values) for curve in self.curves]
        kinds = np.array([curve.kind.label for curve in self.curves], dtype=object)
        coefficients = np.concatenate([none[:, 0], *(curve.coefficient for curve in self.curves)])
        found["curve_coefficient"] = ("point", coefficients, {"units": "1/rad^2"})
        found["curve"] = ("point", np.repeat(np.arange(len(sizes)), sizes))
        found["curve_kind"] = ("point", np.repeat(kinds, sizes))
        varied = f"{self.x.path}, {self.y.path}"
        attrs = {"robot": self.robot.name, "varied": varied, "robot_toml": self.robot.to_toml()}
        return xr.Dataset(found, coords, attrs)


def _between(curves: Sequence[MapCurve], axis: int, values: Array, others: Array) -> tuple[NDArray[np.bool_], Array]:
    """Folds between neighbours along an axis, True for one, and the sense of pitchforks there: above 0 if a part with
    curved walks begins, below 0 if one without; shape (others, values - 1) each."""
    cut, sense = np.zeros((others.size, values.size - 1), dtype=bool), np.zeros((others.size, values.size - 1))
    for row, other in enumerate(others.tolist()):
        cut[row] = np.histogram(_crossed(curves, Kind.FOLD, axis, other)[0], values)[0] % 2 == 1
        forks, coefficients = _crossed(curves, Kind.PITCHFORK, axis, other)
        sense[row] = np.histogram(forks, values, weights=np.sign(coefficients))[0]
    return cut, np.where(cut, -np.abs(sense), sense)  # a stable straight walk there lies beyond the fold


def _crossed(curves: Sequence[MapCurve], kind: Kind, axis: int, value: float) -> tuple[Array, Array]:
    """Places along an axis where curves of a kind have a value of the other number, SI; coefficients, 0 if unknown."""
    places, coefficients = [np.empty(0)], [np.empty(0)]
    for curve in curves:
        if curve.kind is kind:
            columns = np.column_stack([curve.values[:, [axis, 1 - axis]], np.nan_to_num(curve.coefficient)])
            if curve.line and len(columns) > 1:
                # Its ends lie on the edges of the map but for rounding.
                beyond = columns[[0, -1]] + _BEYOND * (columns[[0, -1]] - columns[[1, -2]])
                columns = np.vstack([beyond[:1], columns, beyond[1:]])
                meets = np.flatnonzero(np.diff(columns[:, 1] <= value))
                part = (value - columns[meets, 1]) / (columns[meets + 1, 1] - columns[meets, 1])
                columns = columns[meets] + part[:, None] * (columns[meets + 1] - columns[meets])
            else:  # points at numbers of modules
                columns = columns[columns[:, 1] == value]
            places.append(columns[:, 0])
            coefficients.append(columns[:, 2])
    return np.concatenate(places), np.concatenate(coefficients)
