"""Search for the points where a periodic orbit loses or gains stability as one parameter changes.

``locate`` samples the orbit (``Samples``), finds where multipliers cross the unit circle between its ends, block by
block (``_crossings``), looks closely where one only touches it (``_resolved``), and describes each crossing
(``_described``). ``located`` puts these parts together, also for Hopf points. Where time 0 must be moved away from an
event, a second search goes on from there.
"""

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

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.arguments import UserCode, check_arguments, checked_interval
from chilopod.flows.deadline import Deadline, SpentError
from chilopod.frozen import Array
from chilopod.stability.crossing_place import Course, crossings_in, orbit_blocks, past_singular, place_error
from chilopod.stability.interface import Family, with_shared_symmetries
from chilopod.stability.orbits.orbit import Orbit, from_known, with_bounds
from chilopod.stability.points import BifurcationPoint, Kind, described
from chilopod.stability.returns import MOVED
from chilopod.stability.search.accuracy import Accuracy
from chilopod.stability.search.extent import extent
from chilopod.stability.search.samples import SPENT, Samples
from chilopod.stability.shown import Result, axes_for, bounded, columns, dataset, rows, said
from chilopod.stability.spectrum import spectrum
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.crossings import BUDGET, Crossings, SearchStatus, find_crossings
from chilopod.stability.unit_circle.spectra import CircleEvent, Crossing, Matrices

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


_ROUND_TOUCH = 9  # places in the surroundings of a touch
_DESCRIBING = 400  # budget of return maps for the orbits beside a point
_GRACE = 0.7  # s, for the description of found points after the time limit
_SAME = 1e-9  # distance of values of one point on the border of two pieces, relative to the interval
_BESIDE = 1e-6  # distance from a crossing at which rates of change are computed, relative to the interval
_RESOLVED = 256.0  # least such distance, relative to that of two floating-point numbers at the ends of the interval

Found = BifurcationPoint | str  # a point, or a remark


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
        reason for an early end: a fold, or the first remark. Between two orbits the multipliers are interpolated: what
        they do within less than the spacing alone may be missed.
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
        first = f"Located: {many}, {self.status.label}: {self.status.sentence}"
        low, high = self.searched
        where = f"{low:.9g} to {high:.9g}, at {self.evaluations} values, at most {self.spacing:.2g} apart"
        return [first, f"searched: {where}", *rows(point.row for point in self.points), *said(self.remarks)]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the kinds of bifurcations over the searched interval, on axes of matplotlib or on new ones."""
        axes = axes_for(axes)
        for point in self.points:
            axes.plot([point.value], [point.kind.label], "o", color="C0", clip_on=False)
            text = f"{point.value:.6g}\n{point.row[2]}".strip()
            axes.annotate(text, (point.value, point.kind.label), (0, 6), ha="center", textcoords="offset points")
        axes.margins(y=0.5)
        ends = [*self.searched, *(point.value for point in self)]  # a fold lies just past the searched part
        if min(ends) < max(ends):
            axes.set_xlim(min(ends), max(ends))
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
    except (SpentError, AnalysisError, ParameterError) as error:
        ending = f"{error.problem} before the orbit was followed beyond {at:.9g}"
        status = SearchStatus.BUDGET if isinstance(error, SpentError) else SearchStatus.INCOMPLETE
        rest = replace(found, points=(), status=status, evaluations=0, ending=ending, remarks=(ending,))
    return joined([found, replace(rest, remarks=(MOVED.format(at), *rest.remarks))])


def joined(pieces: Sequence[Located]) -> Located:
    """The result of searches of neighbouring intervals, with the end of the last."""
    searched, points = (pieces[0].searched[0], pieces[-1].searched[1]), list[BifurcationPoint]()
    near = _SAME * (searched[1] - searched[0])
    for each in pieces:  # a point on the border of two is found in both
        apart = [[b.value - a.value > min(near, a.error_bound + b.error_bound) for a in points] for b in each]
        points += itertools.compress(each, map(all, apart))
    status = SearchStatus.COMPLETE.worst(*(each.status for each in pieces))
    last = [remark for remark in pieces[-1].remarks if remark == pieces[-1].ending]
    remarks = last + [remark for each in pieces for remark in each.remarks]
    about = searched, max(each.spacing for each in pieces), pieces[-1].ending, pieces[-1].dimension
    shown, evaluations = tuple(dict.fromkeys(remarks)), sum(each.evaluations for each in pieces)
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
    if samples.family.remarks or samples.jumps:
        status = status.worst(SearchStatus.INCOMPLETE)
    points = sorted((each for each in results if isinstance(each, BifurcationPoint)), key=lambda point: point.value)
    remarks += [each for each in results if isinstance(each, str)] + samples.family.remarks + samples.jumps
    searched_part = here.start, max(here.start, here.end)
    spacing = float(np.diff([here.start, *samples.within(*searched_part), searched_part[1]]).max())
    ending = here.ending
    if not ending and here.folds and here.folds[-1].value >= here.end:
        ending = f"the orbit ends in a fold at {here.folds[-1].value:.9g}"
    about = searched_part, spacing, ending, samples.family.dimension
    return Located(tuple(points), status, tuple(dict.fromkeys(remarks)), samples.count, *about)


def _crossings(samples: Samples, start: float, end: float, budget: int) -> list[tuple[Block | None, Crossings]]:
    """The crossings in every block of the return map."""
    try:
        blocks, remarks = orbit_blocks(samples.family(samples.low), samples.first)
        accuracy = Accuracy(samples)
    except SpentError as error:
        return [(None, Crossings((), SearchStatus.BUDGET, (error.problem,), 0))]

    def whole(block: Block | None, values: Array) -> tuple[Array, Array]:
        found = samples.at(values)
        if samples.known:
            errors = np.stack([np.broadcast_to(each.image.error, each.image.jacobian.shape) for each in found])
        elif block is None or block.trivial:
            errors = accuracy.errors(found)
        else:  # a symmetry-breaking mode does not affect the orbit's accuracy
            errors = np.full(len(found), accuracy.of_flow)
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

    resolved = _RESOLVED * float(np.spacing(max(abs(samples.low), abs(samples.high))))
    course = Course(samples.at, samples.low, samples.end, samples.width, max(_BESIDE * samples.width, resolved))
    # A symmetry-breaking mode is not part of the orbit, which is regular among symmetric states.
    trivial = block is None or block.trivial
    regular = past_singular(course, crossing, bounded_at) if trivial and not samples.known else None
    if regular is None or crossing.multiplicity > 1:
        value, (sample,) = crossing.value, samples.at(np.array([crossing.value]))
        system, x, image = samples.family(value), sample.orbit, sample.image
        orbit = from_known(system, x, image=image) if samples.known else with_bounds(system, x, image.duration)
        bound = place_error(course, crossing, orbit.image)
    if regular is not None and (crossing.multiplicity == 1 or regular.error_bound < bound):
        value, bound, orbit = regular.place, regular.error_bound, regular.orbit
    # Where an orbit is lost the point may be its fold.
    lost = samples.end < samples.high and value + bound >= samples.end
    kind = Kind.BRANCH_POINT if (touch or (lost and trivial)) and crossing.event is CircleEvent.PLUS else None
    system, asked = samples.family(value), with_normal_form and not touch
    point = described(system, (value, bound), orbit, crossing, block, kind=kind, with_normal_form=asked)
    if not point.error_bound < samples.width:
        raise AnalysisError(f"its error bound of {point.error_bound:.1e} is too large", field="value")
    if touch:
        said = "only touches the unit circle, within its error, and goes back: nothing changes beside it"
        return f"at {bounded(point.value, point.error_bound)} a multiplier {said}"
    return point
