"""Branches of periodic orbits: pseudo-arclength continuation in one parameter, with their special points.

A branch is a curve of pairs (orbit, parameter) with H(x, p) = x. Its coordinate is the arclength, so folds are regular
points (see :mod:`.curve`). Every step is searched for events (see :mod:`.inspection`). A branch can be followed in
pieces: the next step depends only on its end.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import ChilopodError, ParameterError
from chilopod.flows.arguments import UserCode, check_arguments, checked_interval
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array
from chilopod.notebook import picture
from chilopod.stability.branches.branch_points import PRECISION, Anchor, BranchPoint, OnCurve, in_fold
from chilopod.stability.branches.branch_starts import Start, anchored, begin, branch_sizes, check_symmetric, switch
from chilopod.stability.branches.curve import Curve
from chilopod.stability.branches.inspection import Inspected, by_energy, inspect
from chilopod.stability.continuation.equations import Step
from chilopod.stability.continuation.tracer import Ending, outward, trace
from chilopod.stability.interface import Family, SystemLike, offers, sizes, with_shared_symmetries
from chilopod.stability.orbits.orbit import Orbit
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.returns import EVENT_AT_ZERO, MOVED, event_beside, return_duration, starts
from chilopod.stability.shown import Result, axes_for, columns, dataset, mark, rows, said
from chilopod.stability.spectrum import VERDICTS

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

__all__ = ["Branch", "BranchPoint", "Ending", "Start", "begin", "follow", "switch"]

LONGEST = 0.15  # default largest step along a curve, in units of the states' sizes and of the branch's scale
BUDGET = 200_000  # default budget of flows of a branch
_MEETING = 1e-6  # distance of a multiplier from +1 at a special point where branches meet
_STYLES = {True: "-", False: "--", None: ":"}  # line styles by stability
_IN_FOLD = "the branch starts in a fold"
_NARROWEST = 1e-9  # least width of an interval, relative to its values
_OUTGROWN = 1e3  # change of an orbit, in units, after which these are determined anew: they no longer suit all states

Progress = Callable[[int, BranchPoint], None]


@dataclass(frozen=True, eq=False)
class Branch(Result):
    """A followed branch.

    Attributes
    ----------
    points
        Points along the curve, special points included.
    ending, reason
        Reason for its end, and details if the curve was lost or a limit spent, else empty.
    step
        Next step along the curve.
    periods, symmetric
        Number of the systems' periods in one period of its orbits; True if these have the systems' symmetry in time.
    remarks
        Sentences on events that remained undecided.
    anchor
        State of the continuation beside the points; found anew if None.
    """

    points: tuple[BranchPoint, ...]
    ending: Ending
    step: float
    periods: int = 1
    symmetric: bool = False
    reason: str = ""
    remarks: tuple[str, ...] = ()
    anchor: Any = field(default=None, repr=False)  # an Anchor

    @property
    def units(self) -> Array:
        """Sizes of the states and scale of the parameter at the end of the curve, shape (n+1,)."""
        return self.points[-1].units

    @property
    def scale(self) -> float:
        """Scale of the parameter along the curve, the unit of tangents."""
        return float(self.units[-1])

    @property
    def special_points(self) -> tuple[BranchPoint, ...]:
        """Folds and secondary bifurcations."""
        return tuple(point for point in self.points if point.special is not None)

    def _stretches(self) -> list[tuple[bool | None, int, int]]:
        """Stable, unstable and undecided stretches, each with its first and last point; a fold ends a stretch."""
        folds = itertools.accumulate(point.special is Kind.FOLD for point in self.points)
        # At a special point a multiplier is critical, so the points beside it decide.
        beside = [{each.stable for each in pair if each.special is None} for pair in itertools.pairwise(self.points)]
        verdicts = [told.pop() if len(told) == 1 else None for told in beside]
        found, first = [], 0
        for (_, verdict), group in itertools.groupby(zip(folds, verdicts, strict=False)):
            last = first + len(list(group))
            found.append((verdict, first, last))
            first = last
        return found or [(self.points[0].stable, 0, 0)]

    def _lines(self) -> list[str]:
        values, named = [point.value for point in self.points], [(p, p.special.label) for p in self.points if p.special]
        head, tail = f"Branch: {len(values)} points", f", periods: {self.periods}"
        special = [p.bifurcation.row if p.bifurcation else (label, f"{p.value:.12g}", "") for p, label in named]
        if by_energy(values, self.scale):
            head, tail = f"Branch by energy: {len(values)} orbits with periods", ""
            special = [(label, f"{p.period:.9g}", "") for p, label in named]
            values = [float(point.period or 0.0) for point in self.points]
        return [
            f"{head} between {min(values):.9g} and {max(values):.9g}{tail}",
            f"ends: {self.ending.sentence}{f' ({self.reason})' if self.reason else ''}",
            *(["special points:", *rows(special)] if special else ["special points: none"]),
            "stability along it:",
            *rows((VERDICTS[v], _passed(values[a : b + 1])) for v, a, b in self._stretches()),
            *said(self.remarks),
        ]

    def _picture(self) -> str:
        # The state that changes most, relative to its size, distinguishes the branch from others.
        moved = np.ptp([point.orbit for point in self.points], axis=0) / self.units[:-1]
        return picture(lambda axes: self.plot(axes, int(moved.argmax())), "branch of periodic orbits")

    def plot(self, axes: Axes | None = None, state: int = 0) -> Axes:
        """Draw a state at time 0 over the parameter, or over the period along a family by energy: stable parts solid,
        unstable ones dashed, undecided ones dotted.

        Parameters
        ----------
        axes
            Axes of matplotlib; by default of a new figure.
        state
            Number of the state, from 0.
        """
        values, orbits = map(np.array, columns(self.points, "value", "orbit").values())
        if not (isinstance(state, Real) and state in range(orbits.shape[1])):
            raise ParameterError("must be a state", field="state", value=state, allowed=f"0 to {orbits.shape[1] - 1}")
        axes, color, state, across = axes_for(axes), None, int(state), "parameter"
        if by_energy(values.tolist(), self.scale):
            values, across = np.array([point.period for point in self.points]), "period"
        for verdict, first, last in self._stretches():
            part = slice(first, last + 1)
            shown = axes.plot(values[part], orbits[part, state], _STYLES[verdict], color=color, label=VERDICTS[verdict])
            color = shown[0].get_color()
        places = zip(self.points, values, strict=True)
        mark(axes, [(each.special.label, place, each.orbit[state]) for each, place in places if each.special])
        axes.set(xlabel=across, ylabel=f"state {state} at time 0")
        return axes

    def to_dataset(self) -> xr.Dataset:
        """Dataset over ``point``; ``special`` is empty at ordinary points. Multipliers are of the full period."""
        verdicts = [VERDICTS[None if point.special else point.stable] for point in self.points]
        values = columns(self.points, "value", "special", "period", "orbit", "multipliers")
        names = ("error_bound", "criticality", "coefficient", "coefficient_error")
        about = columns((each.bifurcation for each in self.points), *names)
        errors = {"multipliers_error_bound": [each.error_bound for each in self.points]}
        errors["value_error_bound"] = about.pop("error_bound")
        end = {"ending": self.ending.label, "reason": self.reason, "remarks": "; ".join(self.remarks)}
        return dataset("point", {**values, **errors, **about, "verdict": verdicts}, periods=self.periods, **end)


@with_shared_symmetries
def follow(
    family: Family,
    start: Start | Branch | BranchPoint | Orbit | ArrayLike,
    between: tuple[float, float],
    *,
    points: int | None = None,
    step: float = 0.02,
    longest: float = LONGEST,
    closely: bool = True,
    precision: float = PRECISION,
    symmetric: bool = False,
    budget: int = BUDGET,
    seconds: float = math.inf,
    progress: Progress = lambda count, point: None,
) -> Branch:
    """Follow a branch from a point along its tangent, or from its end; an AnalysisError if no orbit is found there.

    The points of a continued branch equal those of a single run to the bit; without its ``anchor``, as one that is read
    from a file of walks, to round-off. A closed branch cannot be continued.

    Parameters
    ----------
    family
        ``family(value)`` is the system.
    start
        Start from :func:`begin` or :func:`switch`, a point of another branch, with the units of its states, an orbit
        (or a guess) at the lower end of the interval, or a branch, continued in its units with its ``symmetric``.
    between
        Interval of the parameter, at whose ends the branch ends; its width becomes the scale of a new branch.
    points
        Number of new ordinary points after which the branch ends; by default any number.
    step, longest
        First and largest step along the curve, in units of the states' sizes and of the scale.
    closely
        True to compute multipliers at nine places within every step; else only if its ends show an event.
    precision
        Precision of orbits relative to the sizes of the states, limited by the accuracy of the flow.
    symmetric
        True to follow orbits with the systems' symmetry in time, which orbits of interest have usually lost.
    budget, seconds
        Number of flows, beside those of normal forms, and time in s, after which the branch ends; a SpentError if the
        time ends before the first orbit is found.
    progress
        Called with the number of points and the newest one.
    """
    low, high = checked_interval(between, _NARROWEST)
    check_arguments(family=family, points=points, step=step, longest=longest, closely=closely, precision=precision)
    check_arguments(symmetric=symmetric, budget=budget, progress=progress)
    if isinstance(start, BifurcationPoint):
        said = "is a bifurcation point"
        raise ParameterError(said, field="start", value=start.kind.label, allowed="a start from `switch`")
    allowed = Budget(budget, seconds)
    curve = Curve(family, high - low, between=between, symmetric=symmetric, precision=precision, budget=allowed)
    with allowed:
        if isinstance(start, Branch):
            branch, anchor = _reopened(curve, start, longest)
        else:
            if not isinstance(start, Start | BranchPoint):
                start = begin(family, low, start, symmetric=symmetric)
            branch, anchor = opened(curve, start, min(step, longest))
        return followed(curve, branch, anchor, longest, points, closely, progress)


def opened(curve: Curve, start: Start | BranchPoint, step: float) -> tuple[Branch, Anchor]:
    """The branch at its first point, and the anchor there; the curve gets the sizes of its states."""
    if not curve.between[0] <= start.value <= curve.between[1]:
        raise ParameterError("must contain the start", field="between", value=curve.between, allowed=f"{start.value}")
    curve.periods = start.periods
    check_symmetric(curve.system(start.value), curve.symmetric)
    curve.sizes = branch_sizes(curve, start) if isinstance(start, Start) else start.units[:-1]
    if isinstance(start, Start):
        inward = dict(zip(curve.between, (True, False), strict=True))
        anchor = anchored(curve, replace(start, rising=inward.get(start.value, start.rising)), step)
    else:
        meeting = start.special not in (None, Kind.FOLD) and float(np.abs(start.multipliers - 1.0).min()) <= _MEETING
        first = replace(_in_units(start, curve.units), special=start.special if meeting else None)
        anchor = curve.anchor(first, ahead=step if meeting else 0.0)
    remarks = (_IN_FOLD,) if anchor.last.special is None and in_fold(anchor.matrix, anchor.last.tangent) else ()
    return Branch((anchor.last,), Ending.ENOUGH_POINTS, step, curve.periods, curve.symmetric, remarks=remarks), anchor


def _in_units(point: BranchPoint, units: Array) -> BranchPoint:
    """A point with its tangent in other units."""
    tangent = point.tangent * point.units / units
    return replace(point, tangent=tangent / np.linalg.norm(tangent), units=units)


def _reopened(curve: Curve, branch: Branch, longest: float) -> tuple[Branch, Anchor]:
    """A branch to be continued with a longest step, and the anchor at its end; the curve gets its units."""
    if not branch.points or branch.ending is Ending.CLOSED:
        what = "is a closed branch, which does not go on" if branch.points else "is a branch without points"
        raise ParameterError(what, field="start", allowed="a start, an orbit, or a branch with an end")
    end, first, (low, high) = branch.points[-1], branch.points[0], curve.between
    if not low <= end.value <= high or outward(curve.box, np.array([end.value]), end.tangent[-1:]):
        said = "must extend beyond the branch's last point"
        raise ParameterError(said, field="between", value=curve.between, allowed=f"an interval around {end.value!r}")
    curve.scale, curve.sizes = branch.scale, branch.units[:-1]
    curve.periods, curve.symmetric = branch.periods, branch.symmetric
    n, allowed = curve.system(end.value).dimension, f"{end.orbit.size}"
    if n != end.orbit.size:
        raise ParameterError("must have the branch's dimension", field="family", value=n, allowed=allowed)
    step = min(branch.step, longest) if longest < LONGEST else branch.step  # those along straight parts are longer
    if branch.anchor is not None and branch.anchor.last is end:
        return replace(branch, step=step), branch.anchor
    last, *earlier = [point for point in reversed(branch.points) if point.special is None or point is first]
    # At a branch point the matrix is singular, so it is computed a step ahead.
    ahead = 0.0 if last.special is None else branch.step
    before = next((point for point in earlier[:1] if np.array_equal(point.units, last.units)), None)
    return replace(branch, step=step), curve.anchor(last, before, ahead)


def followed(
    curve: Curve,
    branch: Branch,
    anchor: Anchor,
    longest: float,
    points: int | None,
    closely: bool,
    progress: Progress = lambda count, point: None,
    until: Kind | None = None,
) -> Branch:
    """A branch with the points that follow an anchor; it also ends past a special point of the kind ``until``."""
    curve.first, curve.long_steps = _in_units(branch.points[0], curve.units), longest >= LONGEST
    found, remarks, done, reached = list(branch.points), list(branch.remarks), 0, False
    moved, size = anchor, branch.step

    def look(step: Step[Anchor, OnCurve], ending: Ending | None) -> tuple[tuple[Inspected, Anchor], Ending | None]:
        nonlocal reached
        within, end = inspect(curve, step, closely), step.end
        reached = until is not None and any(point.special is until for point in within.points)
        return (within, end), Ending.ENOUGH_POINTS if reached or _outgrown(curve, [*found, end.last]) else ending

    def keep(looked: tuple[Inspected, Anchor], _: int) -> None:
        nonlocal done, moved
        within, moved = looked
        found.extend([*within.points, moved.last])
        remarks.extend(within.remarks)
        done += 1
        with UserCode("progress"):
            progress(done, moved.last)

    while True:
        before, left = done, points and points - done
        ending, reason, size = trace(curve, moved, (size, longest), left, look, keep)
        last = found[-1]
        if ending is Ending.ENOUGH_POINTS and done > before and not reached and _outgrown(curve, found):
            moved = _renewed(curve, last)
            found[-1] = moved.last
            size *= float(np.linalg.norm(last.tangent * last.units / curve.units))  # the same length in other units
            size = size if curve.long_steps else min(longest, size)
            continue
        beside = None
        if ending is Ending.LOST:
            system = curve.system(last.value)
            duration = return_duration(system, last.period)
            reason = event_beside(system, last.orbit, duration, partial(_ahead, curve, last)) or reason
            beside = _elsewhere(curve, last) if reason == EVENT_AT_ZERO and done > before else None
        if beside is None:
            break
        moved, size = beside, branch.step
        remarks.append(MOVED.format(last.value))
    if by_energy([point.value for point in found], curve.scale):
        remarks = [remark for remark in remarks if remark != _IN_FOLD]
    said = tuple(dict.fromkeys([*remarks, *_unpaired_folds(found)]))
    return replace(branch, points=tuple(found), ending=ending, step=size, reason=reason, remarks=said, anchor=moved)


def _outgrown(curve: Curve, points: list[BranchPoint]) -> bool:
    """True if the orbit has changed by many of its units since these were determined, unless the system gives them."""
    end = points[-1]
    first = next(point for point in points if np.array_equal(point.units, end.units))
    grown = np.abs(end.orbit - first.orbit) > _OUTGROWN * end.units[:-1]
    return bool(grown.any()) and not offers(curve.system(end.value), "scale")


def _renewed(curve: Curve, last: BranchPoint) -> Anchor:
    """The anchor at a point, in units determined there; no state's unit exceeds its motion."""
    system = curve.system(last.value)
    motion = sizes(system, last.orbit, return_duration(system, last.period))
    curve.sizes = np.minimum(branch_sizes(curve, last), np.maximum(motion, last.units[:-1]))
    curve.first = _in_units(curve.first, curve.units)
    return curve.anchor(_in_units(last, curve.units))


def _unpaired_folds(points: list[BranchPoint]) -> list[str]:
    """Sentences for folds across which an even number of multipliers passes 1, and not the one of a fold alone."""
    remarks = []
    for before, fold, after in zip(points, points[1:], points[2:], strict=False):
        beyond = []
        for each in (before, after):
            nu, error = each.multipliers, each.error_bound
            if fold.special is Kind.FOLD and each.special is None and bool((np.abs(nu - 1.0) > error).all()):
                beyond.append(int(((nu.imag == 0.0) & (nu.real > 1.0)).sum()))
        if len(beyond) == 2 and (beyond[0] - beyond[1]) % 2 == 0:
            remarks.append(f"near {fold.value:.9g}: beside the fold is another bifurcation, too near to be told apart")
    return remarks


def _ahead(curve: Curve, last: BranchPoint, distance: float) -> tuple[SystemLike, Array]:
    """System and state at a distance from a point along its tangent."""
    x, value = curve.reached(last, distance * last.tangent)
    return curve.system(value), x


def _elsewhere(curve: Curve, last: BranchPoint) -> Anchor | None:
    """The anchor at another state of the orbit of a point; None if time 0 is fixed, or no state suits."""
    system = curve.system(last.value)
    with contextlib.suppress(ChilopodError):
        for x in starts(system, last.orbit, return_duration(system, last.period)):
            rising = bool(last.tangent[-1] > 0.0)
            return anchored(curve, Start(last.value, x, rising, periods=curve.periods, period=last.period), 0.0)
    return None


def _passed(values: list[float]) -> str:
    """Ends of a stretch, and where it turns back between them."""
    first, last = values[0], values[-1]
    turns = [each for each in (min(values), max(values)) if not min(first, last) <= each <= max(first, last)]
    by = "".join(f" to {each:.9g} and back" for each in turns)
    return f"{first:.9g}{by} to {last:.9g}"
