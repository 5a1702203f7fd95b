"""Search for the points where a periodic orbit loses or gains stability as one parameter changes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError
from chilopod.flows.arguments import UserCode, check_arguments, checked_interval
from chilopod.flows.deadline import Budget, Deadline, SpentError
from chilopod.frozen import Array
from chilopod.stability.branches.branch import find_fold
from chilopod.stability.crossing_place import Course, Sample, crossings_in, orbit_blocks, past_singular, place_error
from chilopod.stability.equilibria import has_centre
from chilopod.stability.interface import Family, checked_flow, returns_per_period, with_shared_symmetries
from chilopod.stability.orbits.orbit import Orbit, from_known, with_bounds
from chilopod.stability.points import BifurcationPoint, Kind, described
from chilopod.stability.returns import MOVED
from chilopod.stability.search.samples import NEAR_FOLD, SPENT, Samples
from chilopod.stability.shown import Result, axes_for, bounded, columns, dataset, rows, said
from chilopod.stability.spectrum import spectrum
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.crossings import BUDGET, Crossings, SearchStatus, find_crossings
from chilopod.stability.unit_circle.spectra import CircleEvent, Crossing, Matrices

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


_BEFORE = 1e-6  # distance from a fold at which the search for crossings ends, relative to the interval
_JUST_PAST = 0.125  # farthest fold past the end of an orbit that was followed, relative to the interval
_TRIES = 2  # starts of curves round a fold
_FLOWS = 2  # flows of each, for every orbit of the budget
_CLEAR_OF_FOLD = 1e-3  # distance of a multiplier from +1 from which a curve that starts there passes the fold
_COMES, _FARTHER = 1e-5, 100.0  # distance from a fold, relative to the interval, and factor of a second one
_MERGING = 1e-4  # distance from a meeting of orbits, relative to the interval, at which multipliers are uncertain
_ROUND_TOUCH = 9  # places in the surroundings of a touch
_BETWEEN_POWERS = 0.75  # mean of the powers one half and one
_AT_REST = 0.03  # motion, relative to the first orbit's, that counts as rest
_PARTS = 5  # parts of a return at which the extent of the motion is sampled


@dataclass(frozen=True)
class Extent:
    """Part of the interval in which an orbit exists, apart from others."""

    start: float
    end: float
    folds: tuple[BifurcationPoint, ...] = ()  # folds at the ends of the orbit
    ending: str = ""  # sentence on another end before that of the interval
    shrinks: bool = False  # it ends in an equilibrium
    beside: float = 0.0  # distance of a fold from start and end

    def explains(self, value: float) -> bool:
        """True if a value is so near an end of the orbit that a multiplier +1 belongs to that end."""
        ends = [fold.value for fold in self.folds] + [self.end] * self.shrinks
        return any(abs(value - end) <= 2.0 * self.beside for end in ends)


def extent(samples: Samples) -> Extent:
    """Extent of the orbit through some samples."""
    path, high = samples.path, samples.high
    if samples.known:
        return Extent(samples.low, high)
    first, last, beside = path[0], path[-1], _BEFORE * samples.width
    if samples.spent:
        ending = f"{samples.spent} before the orbit was followed beyond {last.value:.9g}"
        return Extent(first.value, last.value, ending=ending)
    folds: tuple[BifurcationPoint, ...] = ()
    start = first.value
    if first.off_plus_one <= NEAR_FOLD:
        fold = _fold_beside(samples, first, path[1:], rising=False)
        if fold is not None and fold.value + beside >= start:
            start = min(start + beside, last.value)
            folds = (fold,) if fold.value >= first.value - fold.error_bound else ()
    if last.value == high and last.off_plus_one > NEAR_FOLD:
        return Extent(start, high, folds, beside=beside)
    fold = _fold_beside(samples, last, path[-2::-1], rising=True)
    here = (last.value, last.orbit, last.image.period) if fold is None else (fold.value, fold.orbit, fold.period)
    if last.value != high and _at_rest(samples, *here):
        ending = f"the orbit shrinks into an equilibrium near {here[0]:.9g}: a Hopf point"
        return Extent(start, last.value, folds, ending, shrinks=True, beside=beside)
    if fold is None:
        ending = "" if last.value == high else f"the orbit cannot be followed beyond {last.value:.9g}"
        end = last.value
        if samples.merges:
            lost = "a multiplier comes to +1 and the corrector loses the orbit"
            ending = f"near {end:.9g} {lost}: it touches +1 there, or another orbit meets it"
            end = max(start, end - _MERGING * samples.width)
        return Extent(start, end, folds, ending, beside=beside)
    # Near the fold multipliers move as a root of the distance, which a search cannot resolve.
    end = max(first.value, min(last.value, fold.value - beside))
    return Extent(start, end, folds + (fold,) * (fold.value <= high + fold.error_bound), beside=beside)


def _fold_beside(samples: Samples, sample: Sample, others: list[Sample], rising: bool) -> BifurcationPoint | None:
    """The fold next to a sample, from the nearest of the others that is clear of it."""
    off = np.array([each.off_plus_one for each in [sample, *others]])
    clear = np.flatnonzero(off > min(_CLEAR_OF_FOLD, off.max() / 2.0))
    for each in [[sample, *others][i] for i in clear[:_TRIES]]:
        budget = Budget(_FLOWS * samples.orbits, samples.budget.remaining)
        fold = find_fold(samples.family, each.value, each.orbit, samples.width, rising, budget)
        # Close to it a step may land on another curve with another fold.
        if fold is not None and _next_to(samples, sample, fold, rising) and _as_a_root(samples, sample, fold, rising):
            return fold
    return None


def _next_to(samples: Samples, sample: Sample, fold: BifurcationPoint, rising: bool) -> bool:
    """True if a fold is just past a sample at either end, on the same orbit."""
    further = fold.value - sample.value if rising else sample.value - fold.value
    return (
        bool(np.isfinite(fold.error_bound))
        # In a fold Newton's method may converge to states that are not orbits.
        and -max(fold.error_bound, _BEFORE * samples.width) <= further <= _JUST_PAST * samples.width
        and not samples.jumped(fold.orbit, sample.orbit)
    )


def _as_a_root(samples: Samples, sample: Sample, fold: BifurcationPoint, rising: bool) -> bool:
    """True if the multiplier approaches +1 as a root, as in a fold; at a crossing branch it does so linearly."""
    near = max(_COMES * samples.width, abs(fold.value - sample.value))
    away = np.array([near, min(_FARTHER * near, 0.5 * samples.width)])
    try:
        beside = samples.at(fold.value + (-away if rising else away))
    except (AnalysisError, SpentError):
        return True  # no evidence against it
    off = [each.off_plus_one for each in beside]
    return off[1] < off[0] * (away[1] / away[0]) ** _BETWEEN_POWERS


def _at_rest(samples: Samples, value: float, state: Array, period: float) -> bool:
    """True if the motion nearly vanishes at the end of an orbit, around an equilibrium, as spikes may lie between the
    samples of a motion: past a fold there the same orbit comes again."""

    def moved(value: float, state: Array, period: float) -> float:
        """Extent of the motion within a return, relative to the sizes of the states."""
        system, path = samples.family(value), [state]
        for _ in range(_PARTS - 1):
            path.append(checked_flow(system, path[-1], 0.0, period / returns_per_period(system) / _PARTS)[0])
        return float((np.ptp(np.array(path), axis=0) / samples.size).max())

    first = samples.low, samples.first.state, samples.first.period
    small = not samples.family.timed and moved(value, state, period) < _AT_REST * moved(*first)
    return small and has_centre(samples.family(value), state, period)


_DESCRIBING = 400  # budget of return maps for the orbits beside a point
_GRACE = 0.7  # s, for the description of found points after the time limit
_SAME = 1e-9  # distance of values of one point on the border of two pieces, relative to the interval
_BESIDE = 1e-6  # distance from a crossing at which rates of change are computed, relative to the interval


Found = BifurcationPoint | str
"""A point, or a remark."""


@dataclass(frozen=True, eq=False)
class Located(Result, Sequence[BifurcationPoint]):
    """Bifurcations as a sequence of points by rising parameter, with the status of the search.

    Attributes
    ----------
    points
        Points by rising parameter.
    status
        End of the search: ``status.sentence`` says it in words.
    remarks
        Remarks, a sentence each.
    evaluations
        Number of orbits computed.
    searched, spacing, ending
        Interval in which the orbit was followed and searched, largest distance of neighbouring orbits in it, and the
        reason for an early end, also the first remark. Between two orbits the multipliers are interpolated: what they
        do within less than the spacing alone may be missed.
    dimension
        Number of states.
    """

    points: tuple[BifurcationPoint, ...]
    status: SearchStatus
    remarks: tuple[str, ...]
    evaluations: int
    searched: tuple[float, float]
    spacing: float
    ending: str = ""
    dimension: int = 0

    @property
    def complete(self) -> bool:
        """True if the numbers of unstable multipliers at the ends and between all points add up."""
        return self.status in (SearchStatus.COMPLETE, SearchStatus.CONSERVATIVE)

    @overload
    def __getitem__(self, index: int) -> BifurcationPoint: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[BifurcationPoint, ...]: ...
    def __getitem__(self, index: int | slice) -> BifurcationPoint | tuple[BifurcationPoint, ...]:
        return self.points[index]

    def __len__(self) -> int:
        return len(self.points)

    def _lines(self) -> list[str]:
        many = f"{len(self)} bifurcation{'' if len(self) == 1 else 's'}"
        table = rows(point.row for point in self.points)
        first = f"Located: {many}, {self.status.label}: {self.status.sentence}"
        low, high = self.searched
        orbits = f"{self.evaluations} orbits, at most {self.spacing:.2g} apart"
        return [first, f"searched: {low:.9g} to {high:.9g}, {orbits}", *table, *said(self.remarks)]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the kinds of bifurcations over the parameter, on axes of matplotlib or on new ones."""
        axes = axes_for(axes)
        for point in self.points:
            axes.plot([point.value], [point.kind.label], "o", color="C0")
            text = f"{point.value:.6g}\n{point.row[2]}".strip()
            at = point.value, point.kind.label
            axes.annotate(text, at, (0, 6), ha="center", textcoords="offset points")
        axes.margins(x=0.2, y=0.5)
        axes.set(xlabel="parameter")
        return axes

    def to_dataset(self) -> xr.Dataset:
        """Dataset of the points over ``point``. The multiplier is the critical one of the return map."""
        names = ("value", "error_bound", "kind", "criticality", "coefficient", "coefficient_error")
        more = ("multiplier", "multiplicity", "frequency", "period", "orbit", "mode")
        about = {"status": self.status.label, "remarks": "; ".join(self.remarks), "ending": self.ending}
        low, high = self.searched
        searched = {"low": low, "high": high, "evaluations": self.evaluations, "spacing": self.spacing}
        table: dict[str, Any] = columns(self.points, *names, *more)
        if not self.points:  # a table of nothing has the same columns
            table |= dict.fromkeys(("orbit", "mode"), np.empty((0, self.dimension)))
        return dataset("point", table, **about, **searched)


@with_shared_symmetries
def locate(
    family: Family,
    between: tuple[float, float],
    orbit: ArrayLike | None = None,
    normal_form: bool = True,
    budget: int = BUDGET,
    seconds: float = math.inf,
) -> Located:
    """Find every bifurcation of a periodic orbit in an interval of a parameter.

    Spatial symmetries of the orbit split the return map into blocks, which are searched separately.

    Parameters
    ----------
    family
        ``family(value)`` is the system at a value of the parameter.
    between
        Interval ``low < high``.
    orbit
        Guess of a state on the orbit at time 0 for ``low``, shape (n,); by default what the system there gives. The
        orbit is followed through the interval, unless systems that depend on time give it at every value.
    normal_form
        True to compute coefficients and verdicts as well.
    budget
        Number of orbits to follow the first one through the interval, and again for the search; twice as many return
        maps also end either, including those of Newton's method and of failed attempts. Separate limits hold for the
        first orbit, whose motion may settle, and for every point found: 400 return maps and its normal form.
    seconds
        Time, s, after which the search ends with its results so far. It includes the first orbit and running flows,
        but not compilation; the description of found points may take 0.7 s more.

    An AnalysisError says that there is no orbit at the lower end of the interval, or ``family`` raises an exception
    there. A SpentError says that ``seconds`` ended before the first orbit was found. At any other value an exception
    counts as a missing orbit and gives a remark.
    """
    low, high = checked_interval(between)
    check_arguments(family=family, normal_form=normal_form, budget=budget)
    limit, samples = Deadline(seconds), Samples(family, orbit, low, high, budget, seconds)
    found = located(
        samples,
        lambda start, end: _crossings(samples, start, end, budget),
        lambda each, block: [_described(samples, one, block, normal_form) for one in _resolved(samples, each)],
        lambda fold: fold if normal_form else replace(fold, normal_form=None),
        _DESCRIBING,
    )
    if samples.onward is None:
        return found
    at, left = samples.high, max(budget - found.evaluations, 1)
    try:
        rest = locate(family, (at, high), samples.onward, normal_form, left, limit.remaining)
    except (SpentError, AnalysisError) as error:
        ending = f"{error.problem} before the orbit was followed beyond {at:.9g}"
        status = SearchStatus.BUDGET if isinstance(error, SpentError) else SearchStatus.INCOMPLETE
        rest = replace(found, points=(), status=status, evaluations=0, ending=ending)
    return joined([found, replace(rest, remarks=(MOVED.format(at), *rest.remarks))])


def joined(pieces: Sequence[Located]) -> Located:
    """The result of searches of neighbouring intervals, with the end of the last."""
    searched, points = (pieces[0].searched[0], pieces[-1].searched[1]), list[BifurcationPoint]()
    near = _SAME * (searched[1] - searched[0])
    for each in pieces:  # a point on the border of two is found in both
        apart = [[b.value - a.value > min(near, a.error_bound + b.error_bound) for a in points] for b in each]
        points += itertools.compress(each, map(all, apart))
    status = SearchStatus.COMPLETE.worst(*(each.status for each in pieces))
    remarks = [pieces[-1].ending] + [remark for each in pieces for remark in each.remarks]
    about = searched, max(each.spacing for each in pieces), pieces[-1].ending, pieces[-1].dimension
    shown, evaluations = tuple(dict.fromkeys(filter(None, remarks))), sum(each.evaluations for each in pieces)
    return Located(tuple(points), status, shown, evaluations, *about)


def located(
    samples: Samples,
    crossings: Callable[[float, float], list[tuple[Block | None, Crossings]]],
    described: Callable[[Crossing, Block | None], list[Found]],
    fold: Callable[[BifurcationPoint], Found],
    returns: int,
) -> Located:
    """Find and describe the bifurcations along the samples of a family.

    ``crossings(start, end)`` searches every block of the return map; ``described(crossing, block)`` gives the point,
    remarks, or both, within a number of return maps; ``fold(fold)`` a point or a remark for a fold at an end.
    """
    with samples.budget:
        here = extent(samples)
        searched = crossings(here.start, here.end) if here.start < here.end else []
    status, remarks = SearchStatus.COMPLETE, [here.ending] if here.ending else []
    if here.ending:
        status = SearchStatus.BUDGET if samples.spent else SearchStatus.INCOMPLETE
    results: list[Found] = []
    spent = samples.budget.spent or SPENT
    samples.budget.prolong(_GRACE)
    for block, found in searched:
        status = status.worst(found.status)
        results += found.remarks
        for crossing in found.crossings:
            if crossing.event is CircleEvent.PLUS and here.explains(crossing.value):
                continue
            samples.budget.left = returns
            try:
                with samples.budget, UserCode("family", crossing.value):
                    results += described(crossing, block)
            except (AnalysisError, SpentError) as error:
                status = status.worst(SearchStatus.INCOMPLETE)
                results.append(f"the crossing at {crossing.value:.9g} could not be described: {error}")
    results += [fold(each) for each in here.folds]
    if status is SearchStatus.BUDGET and not here.ending:
        remarks.append(spent)
    if samples.family.remarks:
        status = status.worst(SearchStatus.INCOMPLETE)
    points = sorted((each for each in results if isinstance(each, BifurcationPoint)), key=lambda point: point.value)
    remarks += [each for each in results if isinstance(each, str)] + samples.family.remarks
    searched_part = here.start, max(here.start, here.end)
    spacing = float(np.diff([here.start, *samples.within(*searched_part), searched_part[1]]).max())
    about = searched_part, spacing, here.ending, samples.family.dimension
    return Located(tuple(points), status, tuple(dict.fromkeys(remarks)), samples.count, *about)


def _crossings(samples: Samples, start: float, end: float, budget: int) -> list[tuple[Block | None, Crossings]]:
    """The crossings in every block of the return map."""
    try:
        blocks, remarks = orbit_blocks(samples.family(samples.low), samples.first)
        uncertain = samples.of_flow
    except SpentError as error:
        return [(None, Crossings((), SearchStatus.BUDGET, (error.problem,), 0))]

    def whole(block: Block | None, values: Array) -> tuple[Array, Array]:
        found = samples.at(values)
        if samples.known:
            shape = found[0].image.jacobian.shape
            errors = np.stack([np.broadcast_to(each.image.error, shape) for each in found])
        elif block is None or block.trivial:
            errors = samples.errors(found)
        else:  # a symmetry-breaking mode does not affect the orbit's accuracy
            errors = np.full(len(found), uncertain)
        return np.stack([each.image.jacobian for each in found]), errors

    def search(matrices: Matrices) -> Crossings:
        known = samples.within(start, end)
        found = find_crossings(matrices, start, end, budget=budget, affordable=samples.affordable, known=known)
        return replace(found, remarks=(*remarks, *found.remarks))

    return [(block, crossings_in(block, partial(whole, block), search)) for block in blocks]


def _touches(samples: Samples, crossing: Crossing) -> bool:
    """True if one multiplier, or one pair, touches the circle within the interval and goes back."""
    alone = crossing.multiplicity <= (2 if crossing.event is CircleEvent.PAIR else 1) and crossing.change == 0
    return alone and not crossing.collision and samples.low < crossing.value < samples.high


def _resolved(samples: Samples, crossing: Crossing) -> list[Crossing]:
    """The crossing; for a touch by a followed orbit, whose multipliers are uncertain near +1, the crossings that orbits
    with error bounds show in its surroundings."""
    if samples.known or not _touches(samples, crossing):
        return [crossing]

    def margin(place: float) -> tuple[float, float]:
        (sample,) = samples.at(np.array([place]))
        spec = spectrum(with_bounds(samples.family(place), sample.orbit, sample.image.duration).image)
        index = spec.nearest(crossing.multiplier)
        return float(abs(spec.values[index])) - 1.0, float(spec.error[index])

    places = np.linspace(*crossing.bracket, _ROUND_TOUCH)
    known = {place: margin(place) for place in places.tolist()}
    shape = Chebyshev.fit(places, [known[place][0] for place in places.tolist()], _ROUND_TOUCH // 2)
    turns = np.asarray(shape.deriv().roots(), dtype=np.complex128)
    for place in turns[np.abs(turns.imag) < np.ptp(places)].real.tolist():
        if places[0] < place < places[-1]:
            known[place] = margin(place)
    sides = [(place, away > 0.0) for place, (away, error) in sorted(known.items()) if abs(away) > error]
    number = crossing.multiplicity
    found = [
        replace(crossing, value=0.5 * (a + b), bracket=(a, b), change=number if after else -number)
        for (a, before), (b, after) in itertools.pairwise(sides)
        if before != after
    ]
    if not found:
        a, b = crossing.bracket
        said = f"touches the unit circle and goes back, or crosses it twice between {a:.9g} and {b:.9g}: errors hide it"
        raise AnalysisError(said, field="multiplier")
    return found


def _described(samples: Samples, crossing: Crossing, block: Block | None, with_normal_form: bool) -> Found:
    """Description of a crossing of a known or followed orbit."""
    touch = _touches(samples, crossing)

    def bounded_at(value: float, state: Array, error: Array, duration: float) -> Orbit:
        return with_bounds(samples.family(value), state, duration, error)

    course = Course(samples.at, samples.low, samples.end, samples.width, _BESIDE * samples.width)
    # A symmetry-breaking mode is not part of the orbit, which is regular among symmetric states.
    trivial = block is None or block.trivial
    regular = past_singular(course, crossing, bounded_at) if trivial and not samples.known else None
    if regular is None:
        value, (sample,) = crossing.value, samples.at(np.array([crossing.value]))
        system, x, image = samples.family(value), sample.orbit, sample.image
        orbit = from_known(system, x, image=image) if samples.known else with_bounds(system, x, image.duration)
        bound = place_error(course, crossing, orbit.image)
    else:
        value, bound, orbit = regular.place, regular.error_bound, regular.orbit
    # Where an orbit is lost the point may be its fold.
    lost = samples.end < samples.high and value + bound >= samples.end
    kind = Kind.BRANCH_POINT if (touch or (lost and trivial)) and crossing.event is CircleEvent.PLUS else None
    system, asked = samples.family(value), with_normal_form and not touch
    point = described(system, (value, bound), orbit, crossing, block, kind=kind, with_normal_form=asked)
    if not point.error_bound < samples.width:
        raise AnalysisError(f"its error bound of {point.error_bound:.1e} is too large", field="value")
    if touch:
        value_text = bounded(point.value, point.error_bound)
        return f"at {value_text} a multiplier only touches the unit circle and goes back: nothing changes"
    return point
