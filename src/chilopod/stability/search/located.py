"""Result of a search for bifurcations, and the search from orbits along a parameter to points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

from chilopod.errors import AnalysisError
from chilopod.stability.points import BifurcationPoint
from chilopod.stability.problem.budget import UserCode
from chilopod.stability.search.extent import Fold, extent
from chilopod.stability.search.samples import Samples
from chilopod.stability.shown import Result, axes_for, columns, dataset, rows, said
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.critical import Crossing
from chilopod.stability.unit_circle.crossings import Crossings, SearchStatus
from chilopod.stability.unit_circle.spectra import Event

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

Found = BifurcationPoint | str
"""A point, or a remark."""

_GRACE = 0.7  # s, for the description of found points after the time limit


@dataclass(frozen=True)
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
    searched
        Interval in which the orbit was followed and searched: less than that asked for if it ended early.
    ending
        Reason for an early end, which is also the first remark; empty if the whole interval was searched.
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

    def __iter__(self) -> Iterator[BifurcationPoint]:
        return iter(self.points)

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


def located(
    samples: Samples,
    crossings: Callable[[float, float], list[tuple[Block | None, Crossings]]],
    described: Callable[[Crossing, Block | None], list[Found]],
    fold: Callable[[Fold], Found],
    returns: int,
) -> Located:
    """Find and describe the bifurcations along the samples of a family.

    ``crossings(start, end)`` searches every block of the return map; ``described(crossing, block)`` gives the point,
    remarks, or both, within a number of return maps; ``fold(fold)`` a point or a remark for a fold at an end of the
    orbit.
    """
    with samples.budget:
        here = extent(samples)
        searched = crossings(here.start, here.end) if here.start < here.end else []
    status, remarks = SearchStatus.COMPLETE, [here.ending] if here.ending else []
    if here.ending:
        status = SearchStatus.BUDGET if samples.spent else SearchStatus.INCOMPLETE
    results: list[Found] = []
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
            except AnalysisError as error:
                status = status.worst(SearchStatus.INCOMPLETE)
                results.append(f"the crossing at {crossing.value:.9g} could not be described: {error}")
    results += [fold(each) for each in here.folds]
    if samples.family.remarks:
        status = status.worst(SearchStatus.INCOMPLETE)
    points = sorted((each for each in results if isinstance(each, BifurcationPoint)), key=lambda point: point.value)
    remarks += [each for each in results if isinstance(each, str)] + samples.family.remarks
    searched_part = here.start, max(here.start, here.end)
    return Located(tuple(points), status, tuple(dict.fromkeys(remarks)), samples.count, searched_part, here.ending)
