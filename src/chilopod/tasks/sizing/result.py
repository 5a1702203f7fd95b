"""Result of a search for a robot that does what is wished."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.map_axes import Axis
from chilopod.analysis.quantities import Onset, unit_of
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.notebook import Summary, axes_for, finite
from chilopod.robot import Robot
from chilopod.stability.shown import bounded
from chilopod.tasks.radius_law import is_curved
from chilopod.tasks.sizing.search import Outcome, Wish

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Sizing(Summary, ReadOnlyArrays):
    """A robot that does what is wished, or comes nearest to it if one has every wished quantity.

    Attributes
    ----------
    robot, source
        The robot, with provenance that says what was computed and what was copied; name of that which it is made from.
    wishes, onset, values
        Wishes, the number that bends the robot, and the wished quantities, SI, shape (wishes,), NaN without one.
    free, numbers, bound
        Ranges of the free numbers, their values, SI, shape (numbers,), and the bound on the error of a root, or NaN.
    outcome, reasons
        Outcome; sentences about what stands in the way, and about the onset if a wish depends on it.
    front
        Pareto front of two conflicting wishes: free numbers, then quantities, SI, shape (points, numbers + wishes).
    walks
        Ends of a walk by the name of the engine, see :func:`chilopod.tasks.radius_law.end_of_walk`.
    evaluations
        Number of evaluations of robots; a branch of curved walks counts as 20.
    """

    robot: Robot
    source: str
    wishes: tuple[Wish, ...]
    onset: Onset
    values: Array
    free: tuple[Axis, ...]
    numbers: Array
    bound: float
    outcome: Outcome
    reasons: tuple[str, ...]
    front: Array
    walks: dict[str, xr.Dataset]
    evaluations: int

    @property
    def title(self) -> str:
        """Robot and outcome."""
        return f"{self.source}: {self.outcome.sentence}"

    def as_json(self) -> dict[str, Any]:
        """Plain numbers, SI; null for missing values."""
        paths, wished = [each.path for each in self.free], [each.quantity for each in self.wishes]
        front = [(row[: len(paths)], map(finite, row[len(paths) :])) for row in self.front.tolist()]
        return {
            "robot": self.source,
            "outcome": self.outcome.label,
            "numbers_si": dict(zip(paths, self.numbers.tolist(), strict=True)),
            "error_bound_si": finite(self.bound),
            "ranges_si": {each.path: [each.low, each.high] for each in self.free},
            "wishes": [
                {**asdict(wish), "found": finite(value), "walked": {k: self._walked(wish, k) for k in self.walks}}
                for wish, value in zip(self.wishes, self.values.tolist(), strict=True)
            ],
            "walks": {
                name: {key: str(end[key].item()) for key in ("status", "direction")}
                | {"settled": bool(end.settled) if is_curved(end) else None}
                for name, end in self.walks.items()
            },
            "reasons": list(self.reasons),
            "front_si": [
                {"numbers": dict(zip(paths, x, strict=True)), "values": dict(zip(wished, y, strict=True))}
                for x, y in front
            ],
            "evaluations": self.evaluations,
        }

    def _walked(self, wish: Wish, engine: str) -> float | None:
        name = {"radius": "axis_radius", "speed": "speed"}.get(wish.quantity)
        end = self.walks[engine]
        return finite(float(end[name])) if name and (name == "speed" or is_curved(end)) else None

    def _shown(self, wish: Wish, value: float | None) -> str:
        unit = unit_of(wish.quantity, self.robot, self.onset)
        return "-" if value is None or np.isnan(value) else units.format(value, unit, digits=5)

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        cells: list[Sequence[str]] = [("", "range or wish", "found", *(f"{name} walk" for name in self.walks))]
        for each, value in zip(self.free, self.numbers.tolist(), strict=True):
            low, high, found = (units.format(number, each.unit, digits=6) for number in (each.low, each.high, value))
            if np.isfinite(self.bound):
                shown, error = (units.from_si(number, each.unit) for number in (value, self.bound))
                found = f"{bounded(shown, error)} {each.unit}"
            cells.append((each.path, f"{low} to {high}", found, *[""] * len(self.walks)))
        for wish, value in zip(self.wishes, self.values.tolist(), strict=True):
            wished = {0: "", -1: "at most ", 1: "at least "}[wish.sense] + self._shown(wish, wish.value)
            walked = (self._shown(wish, self._walked(wish, name)) for name in self.walks)
            cells.append((wish.quantity, wished, self._shown(wish, value), *walked))
        below = [f"the {name} walk {_direction(end)}" for name, end in self.walks.items()]
        for row in self.front.tolist():
            numbers, values = row[: len(self.free)], row[len(self.free) :]
            met = (f"{w.quantity} {self._shown(w, v)}" for w, v in zip(self.wishes, values, strict=True))
            at = (units.format(v, a.unit, digits=4) for a, v in zip(self.free, numbers, strict=True))
            below.append(f"on the Pareto front: {', '.join(met)} at {', '.join(at)}")
        return [], cells, [*self.reasons, *below]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the free numbers within their ranges; where wishes conflict, their Pareto front."""
        axes = axes_for(axes)
        if len(self.front):
            values = self.front[:, len(self.free) :]
            pair = np.argsort(-np.ptp(values, axis=0))[:2]  # the two that conflict
            wishes = [self.wishes[i] for i in pair]
            shown = [unit_of(wish.quantity, self.robot, self.onset) for wish in wishes]
            points = [*values[:, pair].tolist(), [wish.value for wish in wishes]]
            x, y = np.array([list(map(units.from_si, point, shown)) for point in points]).T
            axes.plot(x[:-1], y[:-1], "o-")
            axes.plot(x[-1], y[-1], "x", color="C3", label="wish")
            labels = [f"{wish.quantity} ({unit})".removesuffix(" ()") for wish, unit in zip(wishes, shown, strict=True)]
            axes.set(xlabel=labels[0], ylabel=labels[1])
            axes.legend()
        else:
            low, high = (np.array([getattr(each, name) for each in self.free]) for name in ("low", "high"))
            axes.barh([each.path for each in self.free], (self.numbers - low) / (high - low))
            axes.set(xlim=(0.0, 1.0), xlabel="place in the range")
        axes.set_title(self.source)
        return axes


def _direction(end: xr.Dataset) -> str:
    direction = str(end.direction.item())
    if direction in ("", "straight"):
        return "goes straight" if direction else f"ends: {end.status.item()}"
    return f"turns {direction}{'' if end.settled else ', not settled yet'}"
