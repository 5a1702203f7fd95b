"""Where a periodic orbit loses or gains stability as one parameter changes, what happens there, and how sure that
is."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.balance import numerical_balance
from chilopod.stability.branches.fold import Fold
from chilopod.stability.budget import UserCode
from chilopod.stability.capabilities import Family
from chilopod.stability.course import Course, place_error
from chilopod.stability.described import Formed, described
from chilopod.stability.extent import Extent, extent
from chilopod.stability.normal_forms.normal_form import normal_form as normal_form_of
from chilopod.stability.orbit_blocks import crossings_in, orbit_blocks
from chilopod.stability.orbits import Orbit, bounded, from_known
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.returns import ReturnMap, returned_states
from chilopod.stability.samples import Samples
from chilopod.stability.scales import sizes
from chilopod.stability.shown import Result, axes_for, columns, dataset, rows, said
from chilopod.stability.shown import bounded as bounded_text
from chilopod.stability.singular import past_singular
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.crossings import Crossing, Crossings, SearchStatus, find_crossings
from chilopod.stability.unit_circle.spectra import Event, Matrices

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

BUDGET = 5000
"""Orbits that a search may compute, if not told otherwise."""

_TOUCH = "at {value} a multiplier only touches the unit circle and goes back: nothing changes"
_GRACE = 0.7  # s, to describe what was found when the time is over
_DESCRIBING = 400  # return maps to solve for the orbits beside a point

GRAVITY = (SearchStatus.COMPLETE, SearchStatus.CONSERVATIVE, SearchStatus.INCOMPLETE, SearchStatus.BUDGET)
"""Ways in which a search ends, from the best to the worst."""

_FOLLOWED = 10.0  # factor on the error of the first orbit for that of those which are followed from it
_LEAST_ERROR = 1e-15
_BESIDE = 1e-6  # of the interval: how far beside a crossing rates of change are taken


@dataclass(frozen=True)
class Located(Result, Sequence[BifurcationPoint]):
    """The bifurcations that :func:`locate` found: a sequence of points by rising parameter, and how the search ended.

    Attributes
    ----------
    points
        By rising parameter.
    status
        Status of the search: ``status.sentence`` says it in words.
    remarks
        Sentences on what else is to be said.
    evaluations
        Orbits that were computed.
    """

    points: tuple[BifurcationPoint, ...]
    status: SearchStatus
    remarks: tuple[str, ...]
    evaluations: int

    @property
    def complete(self) -> bool:
        """Whether the numbers of unstable multipliers at the ends and between all points add up."""
        return self.status in (SearchStatus.COMPLETE, SearchStatus.CONSERVATIVE)

    @overload
    def __getitem__(self, index: int) -> BifurcationPoint: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[BifurcationPoint, ...]: ...
    def __getitem__(self, index: int | slice) -> BifurcationPoint | tuple[BifurcationPoint, ...]:
        return self.points[index]

    def __len__(self) -> int:
        return len(self.points)

    def __iter__(self) -> Iterator[BifurcationPoint]:
        return iter(self.points)

    def _lines(self) -> list[str]:
        many = f"{len(self)} bifurcation{'' if len(self) == 1 else 's'}"
        table = rows(point.row for point in self.points)
        return [f"Located: {many}, {self.status.label}: {self.status.sentence}", *table, *said(self.remarks)]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw which kind of bifurcation is where, over the parameter, on axes of matplotlib or on new ones."""
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
        """The points as a dataset over ``point``. The multiplier is the critical one of the return map."""
        names = ("value", "error_bound", "kind", "criticality", "coefficient", "coefficient_error")
        more = ("multiplier", "multiplicity", "frequency", "period", "orbit", "mode")
        said, status = "; ".join(self.remarks), self.status.label
        return dataset("point", columns(self.points, *names, *more), status=status, remarks=said)


def locate(
    family: Family,
    between: tuple[float, float],
    orbit: ArrayLike | None = None,
    normal_form: bool = True,
    budget: int = BUDGET,
    seconds: float = math.inf,
) -> Located:
    """Find every bifurcation of a periodic orbit in an interval of a parameter.

    Spatial symmetries that leave the orbit as it is split the return map into blocks, each of which is searched by
    itself.

    Parameters
    ----------
    family
        ``family(value)`` is the system at a value of the parameter.
    between
        The interval, ``low < high``.
    orbit
        A guess of a state on the orbit at time 0 for ``low``, shape (n,); the orbit is then followed through the
        interval. Not needed where the systems know their orbit.
    normal_form
        True to compute coefficients and verdicts as well.
    budget
        Orbits that may be computed to follow the first one through the interval, and once more for the search; either
        ends as well when twice as many return maps were evaluated, by Newton's method too and for orbits that are not
        there. What comes on top has bounds of its own: the first orbit, where the motion is given time to settle, and
        every point that is found, 400 return maps and its normal form.
    seconds
        Time, s, after which the search ends with what it has. The first orbit and a flow that is under way are within
        it, compiling is not; what has been found is described within 0.7 s more.

    Returns
    -------
    Points by rising parameter, with the status of the search.

    Raises
    ------
    ParameterError
        If the interval is empty, reversed or not finite.
    AnalysisError
        If there is no orbit at the lower end of the interval, or ``family`` raises an exception there. At any other
        value that is as if there were no orbit, and a remark.
    """
    low, high = checked_interval(between)
    samples = Samples(family, orbit, low, high, budget, seconds)
    with samples.budget:
        here = extent(samples)
    remarks = [here.ending] if here.ending else []
    status = SearchStatus.BUDGET if samples.spent else SearchStatus.INCOMPLETE if here.ending else SearchStatus.COMPLETE
    points: list[BifurcationPoint] = []
    if here.start < here.end:
        with samples.budget:
            searched, more = _searched(samples, here, budget)
        remarks += more
        samples.budget.prolong(_GRACE)  # for what has been found
        with samples.budget:
            for block, found in searched:
                status = max(status, found.status, key=GRAVITY.index)
                remarks += found.remarks
                for crossing in found.crossings:
                    if crossing.event is Event.PLUS and here.explains(crossing.value):
                        continue
                    samples.allow(_DESCRIBING)
                    try:
                        with UserCode("family", crossing.value):
                            touch = _touches(samples, crossing)
                            point = _described(samples, crossing, block, normal_form and not touch, touch)
                        if not point.error_bound < samples.width:
                            raise AnalysisError(
                                f"its error bound of {point.error_bound:.1e} tells nothing", field="value"
                            )
                        if touch:
                            remarks.append(_TOUCH.format(value=bounded_text(point.value, point.error_bound)))
                        else:
                            points.append(point)
                    except AnalysisError as error:
                        status = max(status, SearchStatus.INCOMPLETE, key=GRAVITY.index)
                        remarks.append(f"what crosses at {crossing.value:.9g} could not be described: {error}")
    points += [_fold(samples, fold, normal_form) for fold in here.folds]
    if samples.remarks:
        status = max(status, SearchStatus.INCOMPLETE, key=GRAVITY.index)
    ordered = tuple(sorted(points, key=lambda point: point.value))
    return Located(ordered, status, tuple(dict.fromkeys([*remarks, *samples.remarks])), samples.count)


def checked_interval(between: tuple[float, float]) -> tuple[float, float]:
    """An interval as two finite numbers, the second of which is larger."""
    try:
        low, high = (float(value) for value in between)
    except (TypeError, ValueError):
        low, high = np.nan, np.nan
    if not (np.isfinite(low) and np.isfinite(high) and low < high and np.isfinite(high - low)):
        raise ParameterError("must be two finite values", field="between", value=between, allowed="(lower, higher)")
    return low, high


def _searched(samples: Samples, here: Extent, budget: int) -> tuple[list[tuple[Block | None, Crossings]], list[str]]:
    """The crossings in every block of the return map, and what is to be said of the blocks."""
    blocks, remarks = orbit_blocks(samples.family(samples.low), samples.first)
    # Of the first orbit hardly a trace may be left after a return; of those that are followed from it there is more.
    uncertain = _FOLLOWED * _relative(samples.of_flow(), at_least=1.0)

    def whole(values: Array) -> tuple[Array, Array]:
        found = samples.at(values)
        if samples.known:
            shape = found[0].image.jacobian.shape
            errors = np.stack([np.broadcast_to(each.image.error, shape) for each in found])
        elif blocks == (None,):
            errors = np.array([samples.error(each, uncertain) for each in found])
        else:  # a mode that breaks a symmetry leaves the orbit as sure as it is
            errors = np.full(len(found), uncertain)
        return np.stack([each.image.jacobian for each in found]), errors

    def search(matrices: Matrices) -> Crossings:
        return find_crossings(matrices, here.start, here.end, budget=budget, affordable=samples.affordable)

    return [(block, crossings_in(block, whole, search)) for block in blocks], list(remarks)


def _touches(samples: Samples, crossing: Crossing) -> bool:
    """Whether one multiplier, or one pair, comes to the circle within the interval and goes back."""
    simple = crossing.multiplicity <= (2 if crossing.event is Event.PAIR else 1)
    return simple and crossing.change == 0 and not crossing.collision and samples.low < crossing.value < samples.high


def _described(
    samples: Samples, crossing: Crossing, block: Block | None, with_normal_form: bool, touch: bool
) -> BifurcationPoint:
    """What happens at a crossing of an orbit that is known, or followed."""

    def bounded_at(value: float, state: Array, error: Array, image: ReturnMap) -> Orbit:
        return bounded(samples.family(value), state, image, error=error)

    course = Course(samples.at, samples.low, samples.end, samples.width, _BESIDE * samples.width)
    # A mode that breaks a symmetry is no part of the orbit, which is regular among those that have it.
    trivial = block is None or block.trivial
    regular = past_singular(course, crossing, bounded_at) if trivial and not samples.known else None
    if regular is None:
        value, orbit = crossing.value, _orbit(samples, crossing.value)
        bound = place_error(course, crossing, orbit.image)
    else:
        value, bound, orbit = regular.place, regular.error_bound, regular.orbit
    # Where an orbit is lost the point may be the fold that it ends in.
    lost = samples.end < samples.high and value + bound >= samples.end
    return described(
        samples.family(value),
        (value, bound),
        orbit,
        crossing,
        block,
        _formed(samples, value, orbit),
        kind=Kind.BRANCH_POINT if (touch or (lost and trivial)) and crossing.event is Event.PLUS else None,
        with_normal_form=with_normal_form,
    )


def _fold(samples: Samples, fold: Fold, with_normal_form: bool) -> BifurcationPoint:
    """The fold that a followed orbit begins or ends in."""
    orbit = Orbit(fold.image.state, fold.image, np.zeros(fold.image.state.size))
    crossing = Crossing(fold.value, (fold.value, fold.value), Event.PLUS, 1, 1, 1.0 + 0.0j)
    formed = _formed(samples, fold.value, orbit)
    return described(
        samples.family(fold.value),
        (fold.value, fold.error_bound),
        orbit,
        crossing,
        None,
        formed,
        kind=Kind.FOLD,
        with_normal_form=with_normal_form,
    )


def _orbit(samples: Samples, value: float) -> Orbit:
    """The orbit at a value, with error bounds."""
    sample = samples.at(np.array([value]))[0]
    system = samples.family(value)
    return from_known(system, sample.orbit) if samples.known else bounded(system, sample.orbit, sample.image)


def _formed(samples: Samples, value: float, orbit: Orbit) -> Formed:
    system = samples.family(value)
    scale = sizes(system, orbit.state, orbit.period / orbit.image.returns)

    def mapped(states: Array) -> Array:
        return returned_states(system, states, orbit.section)

    return lambda critical, uncertainty: normal_form_of(mapped, critical, uncertainty=uncertainty, scale=scale)


def _relative(image: ReturnMap, at_least: float = 0.0) -> float:
    """Error of the derivative, of its largest entry or of what that is at least, the states being in units that balance
    it."""
    # An entry that is nothing but round-off says nothing of the units.
    units = numerical_balance(np.abs(image.jacobian) + np.nan_to_num(image.error))
    largest = max(at_least, float(np.abs(image.jacobian * units / units[:, None]).max()))
    if not largest > 0.0:
        return _LEAST_ERROR
    return max(_LEAST_ERROR, float(np.max(image.error * units / units[:, None])) / largest)
