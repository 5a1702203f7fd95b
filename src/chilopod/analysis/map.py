"""Maps of the straight walk over two numbers of a robot: where it holds, bends or undulates, and the curves between.

:func:`map` reads both axes into a plane of robots (:mod:`chilopod.analysis.map_axes`). It fills an adaptive grid of
growth rates (:mod:`chilopod.analysis.map_grid`), which a file may keep, and searches the curves between its nodes
(:mod:`chilopod.analysis.map_curves`). The grid is refined along the curves, until no further one is found. Radii of the
curved walks come last. The result is a :class:`chilopod.analysis.map_result.StabilityMap`.
"""

from __future__ import annotations

import hashlib
import io
import time
from collections.abc import Callable, Collection
from dataclasses import replace as replace_fields
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.analysis.branch import NO_PAIR
from chilopod.analysis.growth import FATES, Fate, growth_rates
from chilopod.analysis.map_axes import DERIVED, Given, Plane
from chilopod.analysis.map_curves import Search
from chilopod.analysis.map_grid import FATE, GROWTH, Grid
from chilopod.analysis.map_result import StabilityMap
from chilopod.analysis.parameters import ALL, K1
from chilopod.analysis.quantities import TOO_BENT, Measured, Onset
from chilopod.errors import AnalysisError, ChilopodError, OutputError, ParameterError, known_names
from chilopod.frozen import Array
from chilopod.netcdf import UnsoundError, netcdf, sealed, unsealed
from chilopod.output import check_files, keep
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot
from chilopod.stability import Kind

_VERSION = 1  # of the file of growth rates, increased whenever their meaning or computation changes
_ALSO = ("folds", "radius")
_MOST_POINTS = 4097
_LONG = 600.0  # s: a map that takes longer is announced
_LONGEST = 4.0  # hours: one that takes longer is refused, unless its growth rates are kept
_CURVE_RATES = 5e3  # growth rates that take as long as a curve
_LATTICE = 24  # radii along an axis
_ALONE = 1e9  # distance of a value whose curved walk was not found without another one
_BRANCHES = 12  # that are followed from the onset, a few seconds each, before other radii are left out


def map(
    robot: Robot,
    x: Given,
    y: Given,
    *,
    points: int = 129,
    also: Collection[str] = (),
    kept: str | Path | None = None,
    replace: bool = False,
    remark: Callable[[str], None] = lambda sentence: None,
    progress: Progress = silent,
) -> StabilityMap:
    """Map the stability of the straight walk over two numbers of a robot.

    A coarse grid of growth rates is refined where neighbours differ in what becomes of a disturbance. Where they differ
    in the number of unstable multipliers, the bifurcation between them is located, and continued as a curve through the
    plane; cells on curves are refined, and the search repeats until every difference is on a curve. ParameterError if
    an axis is not one, its range is reversed, empty or fractional for modules, or both change one number; if the map
    would take too long.

    Parameters
    ----------
    x, y
        Path of a number, such as ``legs.forward_offset``, ``springs.stiffness[0]`` or, for a group,
        ``springs.stiffness[1:]``; or ``speed``, at the same stride and duty factor, or ``modules``, of the same length
        and mass each; then the lower and the upper end of the range, in SI units or as text with a unit.
    points
        Least number of values along an axis; of modules there are all whole numbers.
    also
        ``folds`` to follow the folds of the curved walks too, which takes a minute; ``radius`` to compute the radius of
        the curved walks on a lattice of 24 x 24 values, some 50 ms each.
    kept
        File that holds growth rates while they are computed; a map that was cut off goes on from it. If it cannot be
        written any more, a line in the log says so. Without it a map that would take more than four hours is refused.
    replace
        True if that file may be replaced although it is damaged or belongs to another map.
    remark
        Function that receives a sentence if the map will take long.
    """
    plane = Plane.over(robot, x, y)
    if not 2 <= points <= _MOST_POINTS:
        raise ParameterError("must be a number of values", field="points", value=points, allowed=f"2 to {_MOST_POINTS}")
    if also:
        known_names(also, _ALSO, "also", "must be a part of maps")
    file = None if kept is None else Path(kept)
    grid = Grid(plane, points, keep=lambda grid: _keep(grid, file) if file else None)
    if file:
        check_files([file], replace=True)
        _take(grid, file, replace)
    _announce(grid, remark, points, file is not None)
    wanted = np.zeros((grid.y.size - 1, grid.x.size - 1), dtype=bool)
    grid.refine(wanted, part(progress, 0.0, 0.5))
    rest = part(progress, 0.5, 1.0)
    search = Search(plane, grid, "folds" in also, rest)
    search.run()
    while (search.cells() & ~wanted).any():
        wanted |= search.cells()
        grid.refine(wanted, rest)
        search.run()
    radius, lost = _radii(grid, "radius" in also, rest)
    if search.lost:
        lost.append(f"the pitchfork is subcritical at {sum(search.lost)} points, but its folds were not found")
    if search.with_folds and any(curve.kind is Kind.TRANSCRITICAL for curve in search.curves):
        search.remarks.append("curved walks beside transcritical points are not followed to their folds")
    growth, frequency, error, unstable, fate = grid.values
    result = StabilityMap(
        robot, plane.x, plane.y, grid.x, grid.y, growth, frequency, error, unstable.astype(np.int16),
        fate.astype(np.int8), grid.computed, radius, curves=tuple(search.curves),
        remarks=(*dict.fromkeys(search.remarks), *_invalid(grid), *_failed(grid), *lost),
        folds_known=search.with_folds and not (search.lost or search.remarks),
    )  # fmt: skip
    unknown = int(np.isnan(result.folded).sum())
    if not (unknown and result.folds_known):
        return result
    said = f"beside {unknown} stable straight walks curved ones are not known: their pitchfork is not on the map"
    return replace_fields(result, remarks=(*result.remarks, said))


def _invalid(grid: Grid) -> list[str]:
    """A sentence about the values that have no robot, with the reasons at the first of every row and column."""
    rows, columns = np.nonzero(grid.values[FATE] == FATES.index(Fate.INVALID))
    first = np.unique([*np.unique(rows, return_index=True)[1], *np.unique(columns, return_index=True)[1]]).astype(int)
    found = grid.robots(grid.x[columns[first]].tolist(), grid.y[rows[first]].tolist())
    reasons = {(why.field, why.problem): str(why) for why in found if isinstance(why, ChilopodError)}
    return [f"at {rows.size} of the values there is no robot: {'; or '.join(reasons.values())}"] if reasons else []


def _failed(grid: Grid) -> list[str]:
    """A sentence about the values whose computation failed."""
    count = int((grid.values[FATE] == FATES.index(Fate.FAILED)).sum())
    why = "the motion is too fast to follow, or a multiplier near the unit circle has no error bound"
    return [f"at {count} of the values the computation failed: {why}"] * bool(count)


def _announce(grid: Grid, remark: Callable[[str], None], points: int, kept: bool) -> None:
    """Say how long a long map takes, by robots in the middles of nine parts; refuse many hours that are not kept."""
    y, x = (values[np.array([1, 3, 5]) * values.size // 6] for values in (grid.y, grid.x))
    places = grid.robots(np.tile(x, 3).tolist(), np.repeat(y, 3).tolist())
    robots = [robot for robot in places if isinstance(robot, Robot)]
    growth_rates([grid.plane.robot.with_value("body.modules", 2)], 1)  # compiles
    for _ in range(2):  # the first call prepares what all others share
        begun = time.perf_counter()
        growth_rates(robots, len(robots))
        each = (time.perf_counter() - begun) / max(len(robots), 1)
        if each > 1.0:
            break
    rows, columns = (size // step for size, step in zip(grid.computed.shape, grid.step, strict=True))
    curves = 0 if grid.plane.x.whole or grid.plane.y.whole else 2
    rates = rows * columns + 10 * sum(grid.computed.shape) + curves * _CURVE_RATES - grid.computed.sum()
    if each * rates > _LONG:
        hours = each * rates / 3600.0
        said = f"{hours:.2g} hours" if hours > 1.0 else f"{60.0 * hours:.2g} minutes"
        if hours > _LONGEST and not kept:
            allowed = f"{_LONGEST:g} hours, more if growth rates are kept (--out); fewer points or modules take less"
            raise ParameterError(f"the map would take about {said}", field="points", value=points, allowed=allowed)
        remark(f"the map takes about {said}: {each:.2g} s a growth rate; fewer points or modules take less")


def _bending(plane: Plane) -> list[Onset]:
    """Numbers by which a curved walk may be reached from the onset, the likeliest first: springs of the axes, the first
    spring, which may leave the map, and other numbers of the axes."""
    axes = {each.path: (each.low, each.high) for each in (plane.x, plane.y) if each.path not in DERIVED}
    springs = dict.fromkeys([*(path for path in axes if path.startswith(ALL)), K1])
    others = (Onset(*each) for each in axes.items() if each[0] not in {*springs, "body.modules"})
    return [*(Onset(path) for path in springs), *others]


def _radii(grid: Grid, wanted: bool, progress: Progress) -> tuple[Array, list[str]]:
    """Radius of the curved walk that leaves the straight one, m, shape (rows, columns), with sentences on how many are
    missing. NaN for these, off a coarse lattice, where the robot does not bend, and everywhere if none is wanted."""
    bends = grid.values[FATE] == FATES.index(Fate.BENDS)
    found = np.full(bends.shape, np.nan)
    if not wanted:
        return found, []

    def following() -> None:
        if not robots[at].gait.half_period_symmetric and any(NO_PAIR in each for each in reasons):
            raise AnalysisError(NO_PAIR, field="radius")  # found out once for all
        if sum(each.branches for each in tried) >= _BRANCHES:
            raise AnalysisError(f"{_BRANCHES} branches are followed", field="radius")

    tried = [Measured(number, following=following) for number in _bending(grid.plane)]
    rows, columns = (np.unique(np.linspace(0, size - 1, min(size, _LATTICE)).astype(int)) for size in bends.shape)
    places = np.argwhere(bends[np.ix_(rows, columns)])
    nodes = np.column_stack([rows[places[:, 0]], columns[places[:, 1]]])
    # From the onset on, each walk is corrected from the nearest known one; of other numbers of modules none is near.
    places *= np.where([grid.plane.y.whole, grid.plane.x.whole], 100, 1)
    apart, near = 1e6 + grid.values[GROWTH, *nodes.T], np.zeros(len(nodes), dtype=int)
    seeds: list[tuple[Array, Array] | None] = [None] * len(nodes)
    reasons: list[set[str]] = [set() for _ in nodes]
    robots = [grid.plane.at(float(grid.x[i]), float(grid.y[j])) for j, i in nodes]
    while (apart < _ALONE).any():
        done, at = int((apart >= _ALONE).sum()), int(apart.argmin())
        progress(done / len(nodes), f"{done} radii")
        (j, i), alone = nodes[at].tolist(), seeds[near[at]] is None
        for measured in tuple(tried):
            measured.near = seeds[near[at]]
            try:
                found[j, i] = measured.walked("radius", robots[at])
            except ChilopodError as error:
                reasons[at].add(error.problem)
            if measured.near is not seeds[near[at]]:
                tried.sort(key=lambda each: each is not measured)
                seeds[at] = measured.near
                away = np.abs(places - places[at]).sum(axis=1)
                near[away < apart], apart = at, np.where(apart < np.inf, np.minimum(apart, away), np.inf)
                break
        apart[at] = _ALONE if alone and seeds[at] is None else np.inf  # it is tried again beside a known one
    missing = np.flatnonzero(np.isnan(found[*nodes.T]))
    why = [next((each for each in (TOO_BENT, NO_PAIR) if each in reasons[at]), "") for at in missing]
    known = [each for each in (TOO_BENT, NO_PAIR) if each in why]
    said = [f"at {why.count(each)} of {len(nodes)} values {each}: no radius" for each in known]
    return found, [*said, *[f"{why.count('')} of {len(nodes)} radii are not found"] * ("" in why)]


def _key(plane: Plane) -> str:
    axes = [(axis.path, axis.low, axis.high) for axis in (plane.x, plane.y)]
    return hashlib.sha256(repr((_VERSION, plane.robot.to_toml(), axes)).encode()).hexdigest()


def _keep(grid: Grid, file: Path) -> None:
    rows, columns = np.nonzero(grid.computed)
    nodes = {"x": ("node", grid.x[columns]), "y": ("node", grid.y[rows])}
    values = {"values": (("row", "node"), grid.values[:, rows, columns])}
    content = sealed(netcdf(xr.Dataset(nodes | values, attrs={"key": _key(grid.plane)})))
    keep(file, content, "growth rates")


def _take(grid: Grid, file: Path, replace: bool) -> None:
    """Take growth rates from a file of this robot and these axes. Any other one may be replaced, or is refused."""
    try:
        data = xr.load_dataset(io.BytesIO(unsealed(file)), engine="h5netcdf")
        if data.attrs.get("key") != _key(grid.plane):
            raise UnsoundError("has the growth rates of another map")
    except FileNotFoundError:
        return
    except UnsoundError as error:
        if replace:
            return
        raise OutputError(f"{error} (--force replaces it)", source=str(file)) from None
    # The grid of the file has the same ends, but may have other nodes between them.
    x, y = data.x.values, data.y.values
    columns, rows = np.searchsorted(grid.x, x), np.searchsorted(grid.y, y)
    same = (grid.x[columns] == x) & (grid.y[rows] == y)
    columns, rows = columns[same], rows[same]
    grid.values[:, rows, columns] = data["values"].values[:, same]
    grid.computed[rows, columns] = True
