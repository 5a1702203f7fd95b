"""Sizing: values of free numbers at which a robot does what is wished, checked in walks.

:func:`size` reads wishes and ranges, lets a :class:`chilopod.tasks.sizing.search.Search` find the nearest robot, and
asks it what stands in the way. The robot then walks from a bent start. A walk that does something else than what was
computed changes the outcome. The result is a :class:`Sizing`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.map_axes import Axis, Given, axis
from chilopod.analysis.quantities import QUANTITIES, Measured, Onset, leading_mode, unit_of
from chilopod.errors import ChilopodError, ParameterError, concerning, known_names
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.notebook import Summary, axes_for, finite
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability.shown import bounded
from chilopod.tasks.radius_law import CYCLES, PERIOD, bent, end_of_walk, is_curved
from chilopod.tasks.sizing.search import Outcome, Search, Wish
from chilopod.trials import run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AS_COMPUTED = 0.02  # largest deviation of radius and speed: of a planar walk from those computed, a twin's from a wish
_OF_WALK = {"radius": "axis_radius", "speed": "speed"}  # names of wished quantities in the end of a walk
_SETTLED = 15.0  # settling times of a walk
_MOST = 1500.0  # gait cycles of a walk, 15 minutes of the paper's robot
_OF_ONSET = {"onset", "margin", "friction", "work", "coefficient"}


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
        """Robot and outcome; after a walk of the twin also the model that meets the wishes, and what it misses."""
        said = f"{self.source}: {self.outcome.sentence}"
        if self.outcome is not Outcome.MET or "twin" not in self.walks:
            return said
        walked = {wish: self._walked(wish, "twin") for wish in self.wishes if self._meets(wish, "twin") is False}
        otherwise = f"walk {_direction(self.walks['twin'])}"
        missed = [otherwise if v is None else f"{w.quantity} is {self._shown(w, v)}" for w, v in walked.items()]
        return "; the twin's ".join([f"{said} in the planar model", *missed])

    def as_json(self) -> dict[str, Any]:
        """Plain numbers, SI; null for missing values."""
        paths, wished = [each.path for each in self.free], [each.quantity for each in self.wishes]
        front = [(row[: len(paths)], map(finite, row[len(paths) :])) for row in self.front.tolist()]
        return {
            "robot": self.source,
            "outcome": self.outcome.label,
            "model": "planar",
            "numbers_si": dict(zip(paths, self.numbers.tolist(), strict=True)),
            "error_bound_si": finite(self.bound),
            "ranges_si": {each.path: [each.low, each.high] for each in self.free},
            "wishes": [
                {**asdict(wish), "found": finite(value)}
                | {"walked": {k: self._walked(wish, k) for k in self.walks}}
                | {"met_by_walk": {k: self._meets(wish, k) for k in self.walks}}
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
        name, end = _OF_WALK.get(wish.quantity), self.walks[engine]
        return finite(float(end[name])) if name and (name == "speed" or is_curved(end)) else None

    def _meets(self, wish: Wish, engine: str) -> bool | None:
        """True if a walk meets a wish, within the tolerance of a planar one; None for what no walk shows."""
        walked = self._walked(wish, engine)
        meets = walked is not None and abs(wish.deviation(walked)) <= _AS_COMPUTED
        return meets if wish.quantity in _OF_WALK else None

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
        axes, title = axes_for(axes), self.source
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
            heads, *rows = self._content()[1]
            names = ["\n".join(row[:3]) for row in rows[: len(low)]]
            axes.barh(names, (self.numbers - low) / (high - low))
            axes.set(xlim=(0.0, 1.0), xlabel="place in the range")
            for name, wished, *found in rows[len(low) :]:
                title += f"\n{name} {wished}: " + ", ".join(map(" ".join, zip(heads[2:], found, strict=True)))
        axes.set_title(title, fontsize="medium")
        return axes


def _direction(end: xr.Dataset) -> str:
    direction = str(end.direction.item())
    if direction in ("", "straight"):
        return "goes straight" if direction else f"ends: {end.status.item()}"
    return f"turns {direction}{'' if end.settled else ', not settled yet'}"


def size(
    robot: Robot,
    wishes: Mapping[str, float | str],
    free: Sequence[Given],
    onset: Onset = Onset(),  # noqa: B008 (frozen)
    *,
    twin: bool = False,
    budget: int = 1200,
    seed: int = 0,
    progress: Progress = silent,
) -> Sizing:
    """Find the values of free numbers at which a robot does what is wished, and let it walk.

    ParameterError if a wish or a range is not one, or two of the ranges change the same number; AnalysisError if a
    curved walk is wished, and none leaves the straight one with this gait.

    Parameters
    ----------
    robot, onset
        Robot whose other numbers stay, and the number that bends it.
    wishes
        Value of each wished quantity, SI or text with a unit; text that begins with ``<`` or ``>`` is a limit.
        Quantities are those of :data:`chilopod.analysis.quantities.QUANTITIES`.
    free
        Paths and ranges of the free numbers, as the axes of :func:`chilopod.analysis.map`, but without modules.
    twin
        True to let the robot walk in three dimensions too.
    budget, seed
        Most evaluations of robots, some 20 ms each, one half in the search and one to say what stands in the way; a
        branch of curved walks counts as 20. Seed of the scattered starts.
    """
    names = known_names([*wishes], QUANTITIES, "wishes")
    given = tuple(parsed_wish(robot, onset, name, wishes[name]) for name in names)
    axes = _axes(robot, free)
    if twin and robot.twin is None:
        raise ParameterError("needs a table [twin], which this robot lacks", field="twin", value=robot.name)
    if budget < 1:
        raise ParameterError("must be positive", field="budget", value=budget)
    search = Search(robot, given, axes, onset, budget, seed, progress)
    search.check()
    outcome = search.run()
    reasons, front = search.reasons(outcome)
    found, again = search.at(search.best), search.again
    if _OF_ONSET & {*names}:
        with suppress(ChilopodError):
            value = onset.in_words(found, "onset", again.onset(found), 6)
            reasons = [*reasons, f"the onset of {onset.parameter} is {value}"]
    values = np.array([wish.of(again, found) for wish in given])
    bound = search.bound() if outcome is Outcome.MET and search.is_root else np.nan
    progress(1.0, "walks")
    engines = ("planar", "twin")[: 1 + twin]
    cycles = _cycles(found, again)
    records = {name: run([bent(found, name, cycles)])[0] for name in engines}
    # A walk that has settled bends alike in its whole second half.
    walks = {name: end_of_walk(record, found, 0.5 * cycles * PERIOD) for name, record in records.items()}
    if outcome is Outcome.MET and not _as_computed(walks["planar"], found, again):
        outcome = Outcome.SLOW if cycles == _MOST else Outcome.OTHERWISE
    rows = np.array([[*search.numbers(u), *(wish.of(again, search.at(u)) for wish in given)] for u in front])
    return Sizing(
        _documented(robot, found, given, axes, onset, outcome), robot.name, given, onset, values, axes,
        search.numbers(search.best), bound, outcome, tuple(reasons), rows.reshape(-1, len(axes) + len(given)), walks,
        search.evaluations,
    )  # fmt: skip


def parsed_wish(robot: Robot, onset: Onset, name: str, given: float | str) -> Wish:
    """A wish from its value, SI or text; ParameterError names the fault."""
    with concerning(name):
        sense = {"<": -1, ">": 1}.get(given[:1], 0) if isinstance(given, str) else 0
        unit = robot.si_unit_of(onset.parameter) if name == "onset" else QUANTITIES[name]
        value = units.parse(given[abs(sense) :].removeprefix("="), unit) if isinstance(given, str) else float(given)
        if not np.isfinite(value) or (name in ("radius", "speed", "settling") and value <= 0.0):
            raise ParameterError("must be finite, and positive for a radius, a speed or a time", value=given)
    return Wish(name, value, sense)


def _axes(robot: Robot, free: Sequence[Given]) -> tuple[Axis, ...]:
    axes = tuple(axis(robot, each, "free") for each in free)
    taken: set[str] = set()
    for each in axes:
        if each.whole:
            raise ParameterError("must be a continuous number, not a count", field=f"free {each.path}")
        both = taken & each.numbers(robot)
        if both:
            said = f"must not change a number that another range changes: {', '.join(sorted(both))}"
            raise ParameterError(said, field=f"free {each.path}", value=each.path)
        taken |= each.numbers(robot)
        for end in (each.low, each.high):
            with concerning(f"free {each.path}"):
                each.change(robot, end)
    if not axes:
        raise ParameterError("must name a number with its range", field="free", value="nothing")
    return axes


def _cycles(robot: Robot, measured: Measured) -> float:
    """Gait cycles of a walk that starts bent, until it has settled."""
    try:
        return float(np.clip(_SETTLED * measured.settling(robot) / robot.gait.period, CYCLES, _MOST))
    except ChilopodError:
        return CYCLES


def _as_computed(end: xr.Dataset, robot: Robot, measured: Measured) -> bool:
    """True if a walk has the radius and the speed that are computed, or is straight where that is stable."""
    if leading_mode(robot).growth <= 0.0:
        return end.direction.item() == "straight"
    try:
        pairs = (end.axis_radius, measured.radius(robot)), (end.speed, measured.speed(robot))
    except ChilopodError:
        return not np.isfinite(end.axis_radius.item())
    near = all(abs(float(walked) / computed - 1.0) <= _AS_COMPUTED for walked, computed in pairs)
    return bool(is_curved(end)) and near


def _documented(
    robot: Robot, found: Robot, wishes: Sequence[Wish], axes: Sequence[Axis], onset: Onset, outcome: Outcome
) -> Robot:
    """The robot with provenance: what was computed for which wishes, and what was copied."""
    said = []
    for wish in wishes:
        shown = units.format(wish.value, unit_of(wish.quantity, robot, onset), digits=6)
        said.append(f"{wish.quantity} {'<>'[(wish.sense + 1) // 2] if wish.sense else ''}{shown}")
    texts = dict(robot.copied().provenance)
    for each in axes:
        low, high = (units.format(end, each.unit, digits=6) for end in (each.low, each.high))
        origin = f"computed: chilopod size, {', '.join(said)}, {each.path} within {low} to {high}; {outcome.label}"
        texts |= dict.fromkeys(sorted(each.numbers(robot)), origin)
    return found.with_(name="sized", provenance=texts)
