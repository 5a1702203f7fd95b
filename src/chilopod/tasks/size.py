"""Sizing: values of free numbers at which a robot does what is wished, checked in walks.

One wish on one free number is a root, bracketed on a scan of the range and solved by Brent's method. More are a problem
of least squares within the ranges (scipy's trust region), from the robot itself and from scattered starts. Where wishes
conflict, weighted sums of the squares of two of them give points of their Pareto front. A radius enters as its squared
curvature, which falls to zero at the onset in proportion to the growth rate, and goes on with that where the robot
walks straight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.linalg import norm
from scipy.optimize import brentq, least_squares
from scipy.stats.qmc import Sobol

from chilopod import units
from chilopod.analysis.map_axes import Axis, Given, axis
from chilopod.analysis.quantities import QUANTITIES, Measured, Onset, known_names, leading_mode, unit_of
from chilopod.errors import ChilopodError, ParameterError
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.notebook import Summary, axes_for, finite
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import find_orbit
from chilopod.stability.shown import bounded
from chilopod.tasks.radius_law import DURATION, bent, end_of_walk, is_curved
from chilopod.trials import run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WALKED = 0.02
"""Largest relative deviation of the radius and the speed of a planar walk from those computed."""

_MET = 1e-6  # largest relative deviation from a wish that is met
_SCANNED = 12  # intervals of a range in which a root is looked for
_STARTS = 8  # a power of two
_SETTLED = 15.0  # settling times of a walk
_LONGEST = 900.0  # s, of a walk
_BRANCH = 30  # evaluations that take as long as a branch of curved walks
_UNCHANGED = 1e-9  # range of deviations that are the same
_AT_END = 1e-3  # distance from the end of a range, relative to it
_FAILED = 10.0  # deviation of a robot without the quantity
_SHARES = 0.1, 0.3, 0.5, 0.7, 0.9  # of the second of two conflicting wishes in the sum of squares
_FAR = 100.0  # relative deviation of a point that is left out of a front
_OTHERS = 10.0  # weight of wishes beside those two
_ROUNDS = 40  # evaluations of least squares for each free number


class Outcome(Labelled):
    """Outcome of a search for a robot; each member's ``sentence`` describes it in words."""

    MET = "met", "every wish is met"
    OTHERWISE = "walks otherwise", "the wishes are met in theory, but a walk that starts bent does something else"
    SLOW = "not settled", "the wishes are met in theory; a walk of 15 minutes that starts bent has not settled"
    UNMET = "unmet", "no robot that was tried meets every wish; this one comes nearest"
    BUDGET = "budget", "the evaluations were spent before every wish was met; this robot came nearest"


@dataclass(frozen=True)
class Wish:
    """A quantity, see :data:`chilopod.analysis.quantities.QUANTITIES`, and its value, SI, to be met (``sense`` 0), not
    to be exceeded (-1), or at least to be reached (1)."""

    quantity: str
    value: float
    sense: int = 0

    def deviation(self, value: float) -> float:
        """Relative deviation of a value from the wish, zero if it is met; absolute for a wish of 0."""
        if self.quantity in ("speed", "settling"):  # which spread over decades
            return self._one_sided(float(np.log(value / self.value)))
        return self._one_sided((value - self.value) / (abs(self.value) or 1.0))

    def searched(self, measured: Measured, robot: Robot) -> float:
        """Smooth measure of that deviation of a robot, zero and signed alike; :data:`_FAILED` without the quantity."""
        try:
            if self.quantity != "radius":
                return self.deviation(getattr(measured, self.quantity)(robot))
            growth = leading_mode(robot).growth
            curvature = self.value / measured.radius(robot) if growth > 0.0 else 0.0
            return self._one_sided(1.0 - curvature**2 - min(growth, 0.0))
        except ChilopodError:
            return _FAILED

    def missed(self, searched: float) -> float:
        """Size of the deviation that :meth:`searched` measures; infinite for the radius of a robot that walks
        straight."""
        if self.quantity != "radius":
            return abs(searched)
        return abs(1.0 / np.sqrt(1.0 - searched) - 1.0) if searched < 1.0 else np.inf

    def _one_sided(self, deviation: float) -> float:
        return max(0.0, deviation * -self.sense) * -self.sense if self.sense else deviation


@dataclass(frozen=True, eq=False)
class Sizing(Summary, ReadOnlyArrays):
    """A robot that does what is wished, or comes nearest to it.

    Attributes
    ----------
    robot, source
        The robot, with provenance that says what was computed and what was copied; name of that which it is made from.
    wishes, onset, values
        Wishes, the number that bends the robot, and the values of the wished quantities, SI, shape (wishes,); NaN
        without one.
    free, numbers, bound
        Free numbers with their ranges, their values, SI, shape (numbers,), and the bound on the error of a root, NaN
        for more than one number.
    outcome, reasons
        Outcome, and sentences about what stands in the way.
    front
        Points of the Pareto front of two conflicting wishes: free numbers and then quantities, SI, shape (points,
        numbers + wishes).
    walks
        Ends of a walk by the name of the engine, see :func:`chilopod.tasks.radius_law.end_of_walk`.
    evaluations
        Number of robots that were evaluated; a branch of curved walks counts as 30.
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
                name: {"status": str(end.status.item()), "direction": str(end.direction.item())}
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
        none = [""] * len(self.walks)
        for each, value in zip(self.free, self.numbers.tolist(), strict=True):
            low, high = (units.format(end, each.unit, digits=6) for end in (each.low, each.high))
            found, error = units.format(value, each.unit, digits=6), units.from_si(self.bound, each.unit)
            found = f"{bounded(units.from_si(value, each.unit), error)} {each.unit}" if np.isfinite(error) else found
            cells.append((each.path, f"{low} to {high}", found, *none))
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
            pair = [len(self.free) + i for i in np.argsort(-np.ptp(self.front[:, len(self.free) :], axis=0))[:2]]
            shown = [self.wishes[i - len(self.free)] for i in pair]
            axes.plot(*self.front[:, pair].T, "o-")
            axes.plot(*(wish.value for wish in shown), "x", color="C3", label="wish")
            labels = [f"{w.quantity} ({QUANTITIES[w.quantity] or 'SI'})" for w in shown]
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


def size(
    robot: Robot,
    wishes: Mapping[str, float | str],
    free: Sequence[Given],
    onset: Onset = Onset(),  # noqa: B008 (frozen)
    *,
    twin: bool = False,
    budget: int = 600,
    seed: int = 0,
    progress: Progress = silent,
) -> Sizing:
    """Find the values of free numbers at which a robot does what is wished, and let it walk.

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
        Most evaluations of a robot, some 30 ms each, and as many again to say what stands in the way; seed of the
        scattered starts.
    progress
        Function of the fraction done (0 to 1) and a few words.

    Raises
    ------
    ParameterError
        If a wish or a range is not one, or two of the ranges change the same number.
    """
    given = tuple(_wish(robot, onset, name, wishes[name]) for name in known_names([*wishes], QUANTITIES, "wishes"))
    axes = _axes(robot, free)
    if twin and robot.twin is None:
        raise ParameterError("needs a table [twin], which this robot lacks", field="twin", value=robot.name)
    if budget < 1:
        raise ParameterError("must be positive", field="budget", value=budget)
    search = _Search(robot, given, axes, onset, budget, seed, progress)
    outcome = search.run()
    reasons, front = search.reasons() if outcome in (Outcome.UNMET, Outcome.BUDGET) else ((), [])
    found = search.at(search.best)
    again = Measured(onset)
    values = np.array([search.quantity(again, wish, found) for wish in given])
    single = len(axes) == len(given) == 1 and not given[0].sense
    bound = search.bound(again) if outcome is Outcome.MET and single else np.nan
    search.progress(1.0, "walks")
    engines = ("planar", "twin")[: 1 + twin]
    records = {name: run([bent(found, name, _duration(found, again))])[0] for name in engines}
    walks = {name: end_of_walk(record, found) for name, record in records.items()}
    if outcome is Outcome.MET and not _as_computed(walks["planar"], found, again):
        outcome = Outcome.SLOW if _duration(found, again) == _LONGEST else Outcome.OTHERWISE
    rows = np.array([[*search.numbers(u), *(search.quantity(again, w, search.at(u)) for w in given)] for u in front])
    return Sizing(
        _documented(robot, found, given, axes, onset, outcome), robot.name, given, onset, values, axes,
        search.numbers(search.best), bound, outcome, tuple(reasons), rows.reshape(-1, len(axes) + len(given)), walks,
        search.evaluations,
    )  # fmt: skip


def _wish(robot: Robot, onset: Onset, name: str, given: float | str) -> Wish:
    try:
        sense = {"<": -1, ">": 1}.get(given[:1], 0) if isinstance(given, str) else 0
        unit = robot.si_unit_of(onset.parameter) if name == "onset" else QUANTITIES[name]
        value = units.parse(given[abs(sense) :].removeprefix("="), unit) if isinstance(given, str) else float(given)
        if not np.isfinite(value) or (name in ("radius", "speed", "settling") and value <= 0.0):
            raise ParameterError("must be finite, and positive for a radius, a speed or a time", value=given)
    except ChilopodError as error:
        error.field = name
        raise
    return Wish(name, value, sense)


def _axes(robot: Robot, free: Sequence[Given]) -> tuple[Axis, ...]:
    axes = tuple(axis(robot, each, "free") for each in free)
    taken: set[str] = set()
    for each in axes:
        if each.whole:
            raise ParameterError("must be a continuous number", field=f"free {each.path}", value=each.path)
        both = taken & each.numbers(robot)
        if both:
            said = f"must not change a number that another range changes: {', '.join(sorted(both))}"
            raise ParameterError(said, field=f"free {each.path}", value=each.path)
        taken |= each.numbers(robot)
        for end in (each.low, each.high):
            try:
                each.change(robot, end)
            except ChilopodError as error:
                error.field = f"free {each.path}"
                raise
    if not axes:
        raise ParameterError("must name a number with its range", field="free", value="nothing")
    return axes


def _duration(robot: Robot, measured: Measured) -> float:
    """Duration of a walk that starts bent, until it has settled, s."""
    try:
        return float(np.clip(_SETTLED * measured.settling(robot), DURATION, _LONGEST))
    except ChilopodError:
        return DURATION


def _as_computed(end: xr.Dataset, robot: Robot, measured: Measured) -> bool:
    """True if a walk has the radius and the speed that are computed, or is straight where that is stable."""
    if leading_mode(robot).growth <= 0.0:
        return end.direction.item() == "straight"
    try:
        pairs = (end.axis_radius, measured.radius(robot)), (end.speed, measured.speed(robot))
    except ChilopodError:
        return not np.isfinite(end.axis_radius.item())
    near = all(abs(float(walked) / computed - 1.0) <= WALKED for walked, computed in pairs)
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
        texts |= dict.fromkeys(each.numbers(robot), origin)
    return found.with_(name="sized", provenance=texts)


class _SpentError(Exception):
    """The evaluations of a search are spent."""


class _Search:
    """Search for the robot in the unit cube of its free numbers."""

    def __init__(
        self, robot: Robot, wishes: tuple[Wish, ...], axes: tuple[Axis, ...], onset: Onset, budget: int, seed: int,
        progress: Progress,
    ) -> None:  # fmt: skip
        self.robot, self.wishes, self.axes, self.progress = robot, wishes, axes, progress
        self._measured, self._budget, self._limit, self._robots = Measured(onset), budget, budget, 0
        scattered = Sobol(len(axes), rng=np.random.default_rng(seed)).random(_STARTS)
        own = [self._place(each) for each in axes]
        # The robot itself is the first start, so that of many answers one near it is found.
        self._starts = [np.clip(own, 0.01, 0.99), *scattered]
        self.best: Array = self._starts[0]
        self._least = np.full(len(wishes), np.inf)
        self._seen: list[Array] = []

    @property
    def evaluations(self) -> int:
        """Evaluations so far."""
        return self._robots + _BRANCH * self._measured.branches

    def numbers(self, place: Array) -> Array:
        """Free numbers at a place in the unit cube, SI, evenly by their logarithm where they are positive."""
        parts = zip(self.axes, np.round(place, 15).tolist(), strict=True)
        return np.array(
            [a.low * (a.high / a.low) ** p if a.low > 0.0 else a.low + (a.high - a.low) * p for a, p in parts]
        )

    def at(self, place: Array) -> Robot:
        """Robot at a place in the unit cube."""
        robot = self.robot
        for each, value in zip(self.axes, self.numbers(place).tolist(), strict=True):
            robot = each.change(robot, float(np.clip(value, each.low, each.high)))
        return robot

    def _place(self, each: Axis) -> float:
        own = self.robot.gait.speed if each.path == "speed" else self.robot.get(sorted(each.numbers(self.robot))[0])
        if each.low > 0.0:
            return float(np.log(max(own, each.low) / each.low) / np.log(each.high / each.low))
        return (own - each.low) / (each.high - each.low)

    def quantity(self, measured: Measured, wish: Wish, robot: Robot) -> float:
        """A wished quantity of a robot; NaN without it."""
        try:
            return float(getattr(measured, wish.quantity)(robot))
        except ChilopodError:
            return np.nan

    def deviations(self, place: Array) -> Array:
        """Deviations of a robot from all wishes, see :meth:`Wish.searched`; keeps the best place."""
        if self.evaluations >= self._limit:
            raise _SpentError
        self._robots += 1
        self.progress(min(0.99, 0.5 * self.evaluations / self._budget), f"{self._robots} robots")
        try:
            robot = self.at(place)
            found = np.array([wish.searched(self._measured, robot) for wish in self.wishes])
        except ChilopodError:
            found = np.full(len(self.wishes), _FAILED)
        self._seen.append(found)
        # Far from all wishes, a robot that has every quantity is nearer than one that has not.
        sizes = [(norm(self._missed(each)), norm(each)) for each in (found, self._least)]
        if sizes[0] < sizes[1]:
            self.best, self._least = place, found
        return found

    def _missed(self, deviations: Array) -> Array:
        return np.array([w.missed(d) for w, d in zip(self.wishes, deviations.tolist(), strict=True)])

    def run(self) -> Outcome:
        """Find the best place."""
        try:
            if len(self.axes) == len(self.wishes) == 1 and not self.wishes[0].sense:
                self._root()
            for start in self._starts:
                if not self._met(self._least):
                    self._fit(start)
        except _SpentError:
            return Outcome.MET if self._met(self._least) else Outcome.BUDGET
        return Outcome.MET if self._met(self._least) else Outcome.UNMET

    @staticmethod
    def _met(deviations: Array) -> bool:
        return bool(np.abs(deviations).max(initial=0.0) <= _MET)

    def _root(self) -> None:
        """Root of one deviation over one number, that which is nearest to the robot's own value."""
        grid = np.linspace(0.0, 1.0, _SCANNED + 1)
        values = np.array([self.deviations(np.array([each]))[0] for each in grid.tolist()])
        values[values == _FAILED] = np.nan
        own = float(self._starts[0][0])
        brackets = [i for i in range(_SCANNED) if values[i] * values[i + 1] <= 0.0]
        for i in sorted(brackets, key=lambda i: abs(grid[i : i + 2].mean() - own)):
            brentq(lambda x: self.deviations(np.array([x]))[0], grid[i], grid[i + 1], xtol=1e-15, rtol=1e-15)
            if self._met(self._least):
                return
        self._starts.insert(0, np.clip(self.best, _AT_END, 1.0 - _AT_END))

    def _fit(self, start: Array, weights: Array | float = 1.0) -> tuple[Array, Array]:
        """Place and deviations of least squares of weighted deviations from a start."""
        shift = 1.0 + start  # numbers of the order of one, whose relative steps are even
        bounds = np.ones(start.size), np.full(start.size, 2.0)
        found = least_squares(
            lambda x: weights * self.deviations(x - 1.0), shift, bounds=bounds, diff_step=1e-6, xtol=1e-12, ftol=1e-12,
            gtol=1e-12, max_nfev=_ROUNDS,
        )  # fmt: skip
        place = found.x - 1.0
        return place, self.deviations(place)

    def bound(self, again: Measured) -> float:
        """Bound on the error of a root, SI: by its deviation in another computation, and the slope there."""
        (wish,), step, robot = self.wishes, 1e-5, self.at(self.best)
        ends = [np.clip(self.best + side * step, 0.0, 1.0) for side in (-1.0, 1.0)]
        rise = np.ptp([wish.searched(again, self.at(end)) for end in ends]) / (ends[1] - ends[0])[0]
        off = abs(wish.searched(Measured(again.number), robot)) + 1e-13
        if wish.quantity == "radius":
            orbit = find_orbit(PlanarModel(robot, use_symmetry=False), again.state(robot))
            joints = slice(3, robot.body.modules + 2)
            off += 2.0 * float(np.sum(orbit.error[joints]) / np.sum(np.abs(orbit.state[joints])))
        wide = np.ptp([self.numbers(end)[0] for end in ends]) / (ends[1] - ends[0])[0]
        return float(2.0 * off / max(rise, 1e-300) * wide)

    def reasons(self) -> tuple[list[str], list[Array]]:
        """Sentences about what stands in the way, and places on the Pareto front of two wishes that conflict."""
        self._limit = self.evaluations + self._budget
        said, best, least = [], self.best, self._least
        for each, part, value in zip(self.axes, best.tolist(), self.numbers(best).tolist(), strict=True):
            if min(part, 1.0 - part) < _AT_END:
                end = "lower" if part < 0.5 else "upper"
                said.append(f"{each.path} is at the {end} end of its range, {units.format(value, each.unit, digits=6)}")
        seen = np.array([found for found in self._seen if _FAILED not in found]).reshape(-1, len(self.wishes))
        for wish, values in zip(self.wishes, seen.T, strict=True):
            if values.size and np.ptp(values) <= _UNCHANGED and abs(values[0]) > _MET:
                said.append(f"no free number changes the {wish.quantity}")
        front: list[Array] = []
        try:
            if len(self.wishes) > 1:
                left_out = [self._left_out(i, best) for i in range(len(self.wishes))]
                alone = [i for i, (_, found) in enumerate(left_out) if self._met(np.delete(found, i))]
                said += [f"without the wish for {self.wishes[i].quantity} the others are met" for i in alone]
                ranked = np.argsort(-self._missed(least), kind="stable").tolist()
                front = self._front([*dict.fromkeys([*alone, *ranked])][:2], left_out, best)
        except _SpentError:
            said.append("the evaluations were spent before it was known which wishes conflict")
        self.best, self._least = best, least
        return said or ["no end of a range and no other wish stands in the way: the search saw none nearer"], front

    def _left_out(self, wish: int, start: Array) -> tuple[Array, Array]:
        """Place that meets all wishes but one best, and the deviations there."""
        weights = np.array([float(i != wish) for i in range(len(self.wishes))])
        tried = [self._fit(each, weights) for each in (start, self._starts[0])]
        return min(tried, key=lambda found: float(norm(weights * found[1])))

    def _front(self, pair: Sequence[int], ends: Sequence[tuple[Array, Array]], start: Array) -> list[Array]:
        """Places that no other found one surpasses in both wishes of a pair: with either left out, and between."""
        found = [ends[i] for i in pair]
        # Each deviation counts relative to that where its own wish is left out.
        largest = [max(abs(ends[i][1][i]), _MET) for i in pair]
        for share in _SHARES:
            weights = np.full(len(self.wishes), _OTHERS)
            weights[pair] = np.sqrt([1.0 - share, share]) / largest
            found.append(self._fit(np.clip(start, _AT_END, 1.0 - _AT_END), weights))
        missed = [self._missed(deviations) for _, deviations in found]
        kept = [
            place
            for (place, _), own in zip(found, missed, strict=True)
            if (own < _FAR).all() and not any((other[pair] < own[pair] - _MET).all() for other in missed)
        ]
        ordered = sorted(kept, key=lambda place: tuple(place.tolist()))
        pairs = zip([None, *ordered], ordered, strict=False)
        return [place for last, place in pairs if last is None or np.abs(place - last).max() > _AT_END]
