"""Search for the points where a periodic orbit loses or gains stability as one parameter changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError
from chilopod.flows.arguments import UserCode, check_arguments, checked_interval
from chilopod.flows.carrying import numerical_balance
from chilopod.flows.deadline import SpentError
from chilopod.frozen import Array
from chilopod.stability.crossing_points.description import described
from chilopod.stability.crossing_points.place import Course, crossings_in, orbit_blocks, past_singular, place_error
from chilopod.stability.orbits.orbit import Orbit, bounded, from_known
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.capabilities import Family
from chilopod.stability.problem.returns import ReturnMap
from chilopod.stability.search.extent import extent
from chilopod.stability.search.samples import SPENT, Samples
from chilopod.stability.shown import Result, axes_for, columns, dataset, rows, said
from chilopod.stability.shown import bounded as bounded_text
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.crossings import BUDGET, Crossings, SearchStatus, find_crossings
from chilopod.stability.unit_circle.spectra import Crossing, Event, Matrices

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_DESCRIBING = 400  # budget of return maps for the orbits beside a point
_FOLLOWED = 10.0  # factor on the error of the first orbit for that of followed ones
_LEAST_ERROR = 1e-15
_GRACE = 0.7  # s, for the description of found points after the time limit
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
    searched, ending
        Interval in which the orbit was followed and searched, and the reason for an early end, also the first remark.
    """

    points: tuple[BifurcationPoint, ...]
    status: SearchStatus
    remarks: tuple[str, ...]
    evaluations: int
    searched: tuple[float, float]
    ending: str = ""

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
        return [first, f"searched: {low:.9g} to {high:.9g}, {self.evaluations} orbits", *table, *said(self.remarks)]

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
        searched = {"low": low, "high": high, "evaluations": self.evaluations}
        return dataset("point", columns(self.points, *names, *more), **about, **searched)


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
    samples = Samples(family, orbit, low, high, budget, seconds)
    return located(
        samples,
        lambda start, end: _crossings(samples, start, end, budget),
        lambda crossing, block: [_described(samples, crossing, block, normal_form)],
        lambda fold: fold if normal_form else replace(fold, normal_form=None),
        _DESCRIBING,
    )


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
            if crossing.event is Event.PLUS and here.explains(crossing.value):
                continue
            samples.allow(returns)
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
    return Located(tuple(points), status, tuple(dict.fromkeys(remarks)), samples.count, searched_part, here.ending)


def _crossings(samples: Samples, start: float, end: float, budget: int) -> list[tuple[Block | None, Crossings]]:
    """The crossings in every block of the return map."""
    try:
        blocks, remarks = orbit_blocks(samples.family(samples.low), samples.first)
        # The first orbit may contract strongly within a return, and followed ones less.
        uncertain = _FOLLOWED * _relative(samples.of_flow())
    except SpentError as error:
        return [(None, Crossings((), SearchStatus.BUDGET, (error.problem,), 0))]

    def whole(block: Block | None, values: Array) -> tuple[Array, Array]:
        found = samples.at(values)
        if samples.known:
            shape = found[0].image.jacobian.shape
            errors = np.stack([np.broadcast_to(each.image.error, shape) for each in found])
        elif block is None or block.trivial:
            errors = samples.errors(found, uncertain)
        else:  # a symmetry-breaking mode does not affect the orbit's accuracy
            errors = np.full(len(found), uncertain)
        return np.stack([each.image.jacobian for each in found]), errors

    def search(matrices: Matrices) -> Crossings:
        found = find_crossings(matrices, start, end, budget=budget, affordable=samples.affordable)
        return replace(found, remarks=(*remarks, *found.remarks))

    return [(block, crossings_in(block, partial(whole, block), search)) for block in blocks]


def _described(samples: Samples, crossing: Crossing, block: Block | None, with_normal_form: bool) -> Found:
    """Description of a crossing of a known or followed orbit."""
    # One multiplier, or one pair, touches the circle within the interval and goes back.
    touch = crossing.multiplicity <= (2 if crossing.event is Event.PAIR else 1) and crossing.change == 0
    touch = touch and not crossing.collision and samples.low < crossing.value < samples.high

    def bounded_at(value: float, state: Array, error: Array, duration: float) -> Orbit:
        return bounded(samples.family(value), state, duration, error)

    course = Course(samples.at, samples.low, samples.end, samples.width, _BESIDE * samples.width)
    # A symmetry-breaking mode is not part of the orbit, which is regular among symmetric states.
    trivial = block is None or block.trivial
    regular = past_singular(course, crossing, bounded_at) if trivial and not samples.known else None
    if regular is None:
        value, (sample,) = crossing.value, samples.at(np.array([crossing.value]))
        system, x, image = samples.family(value), sample.orbit, sample.image
        orbit = from_known(system, x, image=image) if samples.known else bounded(system, x, image.duration)
        bound = place_error(course, crossing, orbit.image)
    else:
        value, bound, orbit = regular.place, regular.error_bound, regular.orbit
    # Where an orbit is lost the point may be its fold.
    lost = samples.end < samples.high and value + bound >= samples.end
    kind = Kind.BRANCH_POINT if (touch or (lost and trivial)) and crossing.event is Event.PLUS else None
    system, asked = samples.family(value), with_normal_form and not touch
    point = described(system, (value, bound), orbit, crossing, block, kind=kind, with_normal_form=asked)
    if not point.error_bound < samples.width:
        raise AnalysisError(f"its error bound of {point.error_bound:.1e} is too large", field="value")
    if touch:
        value_text = bounded_text(point.value, point.error_bound)
        return f"at {value_text} a multiplier only touches the unit circle and goes back: nothing changes"
    return point


def _relative(image: ReturnMap) -> float:
    """Error of the derivative over its largest entry, or over one, in units that balance the states."""
    # An entry of round-off gives no information on the units.
    units = numerical_balance(np.abs(image.jacobian) + np.nan_to_num(image.error))
    largest = max(1.0, float(np.abs(image.jacobian * units / units[:, None]).max()))
    return max(_LEAST_ERROR, float(np.max(image.error * units / units[:, None])) / largest)
