"""Where a periodic orbit loses or gains stability as one parameter changes, what happens there, and how sure that
is."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Short
from chilopod.notebook import block, table, words
from chilopod.stability.asked import Asking
from chilopod.stability.branches.fold import Fold
from chilopod.stability.capabilities import Family
from chilopod.stability.course import Course, place_error
from chilopod.stability.described import Formed, described
from chilopod.stability.extent import Extent, extent
from chilopod.stability.normal_forms.normal_form import normal_form as normal_form_of
from chilopod.stability.orbits import Orbit, bounded, from_known
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.returns import ReturnMap, returned_states
from chilopod.stability.samples import Samples
from chilopod.stability.scales import numerical_balance, sizes
from chilopod.stability.singular import past_singular
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.symmetry.orbit_blocks import crossings_in, orbit_blocks
from chilopod.stability.unit_circle.crossings import Crossing, Crossings, Status, find_crossings
from chilopod.stability.unit_circle.spectra import Event, Matrices

Array = NDArray[np.float64]

BUDGET = 5000
"""Orbits that a search may compute, if not told otherwise."""

_DESCRIBING = 400  # return maps to solve for the orbits beside a point

GRAVITY = (Status.COMPLETE, Status.CONSERVATIVE, Status.INCOMPLETE, Status.BUDGET)
"""Ways in which a search ends, from the best to the worst."""

_FOLLOWED = 10.0  # factor on the error of the first orbit for that of those which are followed from it
_LEAST_ERROR = 1e-15
_BESIDE = 1e-6  # of the interval: how far beside a crossing rates of change are taken


@dataclass(frozen=True)
class Located(Short, Sequence[BifurcationPoint]):
    """The bifurcations that :func:`locate` found: a sequence of points by rising parameter, and how the search ended.

    Attributes
    ----------
    points
        By rising parameter.
    status
        How the search ended: ``status.sentence`` says it in words.
    remarks
        What else is to be said, a sentence each.
    evaluations
        Orbits that were computed.
    """

    points: tuple[BifurcationPoint, ...]
    status: Status
    remarks: tuple[str, ...]
    evaluations: int

    @property
    def complete(self) -> bool:
        """Whether the numbers of unstable multipliers at the ends and between all points add up."""
        return self.status in (Status.COMPLETE, Status.CONSERVATIVE)

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

    def _repr_html_(self) -> str:
        rows = [
            (
                point.kind.label,
                f"{point.value:.12g}",
                f"{point.error_bound:.1e}",
                point.criticality.label if point.criticality else "",
            )
            for point in self.points
        ]
        return block(
            f"{len(self.points)} bifurcation{'' if len(self.points) == 1 else 's'}: {self.status.sentence}",
            *(words(remark) for remark in self.remarks),
            table(("kind", "at", "±", ""), rows),
        )


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
        Whether to compute coefficients and verdicts as well.
    budget
        Orbits that may be computed to follow the first one through the interval, and once more for the search; either
        ends as well when twice as many return maps were evaluated, by Newton's method too and for orbits that are not
        there. What comes on top has bounds of its own: the first orbit, where the motion is given time to settle, and
        every point that is found, 400 return maps and its normal form.
    seconds
        Time after which the search ends with what it has, from the first orbit on, if that is before the budget is
        spent.

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
    here = extent(samples)
    remarks = [here.ending] if here.ending else []
    status = Status.BUDGET if samples.spent else Status.INCOMPLETE if here.ending else Status.COMPLETE
    points: list[BifurcationPoint] = []
    if here.start < here.end:
        searched, more = _searched(samples, here, budget)
        remarks += more
        for block, found in searched:
            status = max(status, found.status, key=GRAVITY.index)
            remarks += found.remarks
            for crossing in found.crossings:
                if crossing.event is Event.PLUS and here.explains(crossing.value):
                    continue
                samples.allow(_DESCRIBING)
                try:
                    with Asking("family", crossing.value):
                        points.append(_described(samples, crossing, block, normal_form))
                except AnalysisError as error:
                    status = max(status, Status.INCOMPLETE, key=GRAVITY.index)
                    remarks.append(f"what crosses at {crossing.value:.9g} could not be described: {error}")
    points += [_fold(samples, fold, normal_form) for fold in here.folds]
    if samples.remarks:
        status = max(status, Status.INCOMPLETE, key=GRAVITY.index)
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


def _described(samples: Samples, crossing: Crossing, block: Block | None, with_normal_form: bool) -> BifurcationPoint:
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
        value,
        bound,
        orbit,
        crossing,
        block,
        _formed(samples, value, orbit),
        kind=Kind.BRANCH_POINT if lost and trivial and crossing.event is Event.PLUS else None,
        with_normal_form=with_normal_form,
    )


def _fold(samples: Samples, fold: Fold, with_normal_form: bool) -> BifurcationPoint:
    """The fold that a followed orbit begins or ends in."""
    orbit = Orbit(fold.image.state, fold.image, np.zeros(fold.image.state.size))
    crossing = Crossing(fold.value, (fold.value, fold.value), Event.PLUS, 1, 1, 1.0 + 0.0j)
    formed = _formed(samples, fold.value, orbit)
    return described(
        fold.value, fold.error_bound, orbit, crossing, None, formed, kind=Kind.FOLD, with_normal_form=with_normal_form
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
