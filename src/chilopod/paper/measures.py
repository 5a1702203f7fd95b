"""Series of walks with several springs, and the paper's measures on them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from chilopod import trials
from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.square_root import SquareRootFit, square_root_fit
from chilopod.engine import engine_named
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.output import write_atomic
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.sources import digest
from chilopod.statistics import Estimate, mean, propagated
from chilopod.tasks.radius_law import in_settled_curve, is_curved
from chilopod.trials import Trial

Folder = str | Path | None

SEEDS = 10_000
"""Distance of the seeds of neighbouring springs; more repeats then do not change the other trials."""

_RATE = 50.0  # Hz
_WITHOUT = ("cli", "gym", "live", "show")  # subpackages that do not affect results that are kept


def spring_walks(
    robot: Robot,
    springs: Sequence[float],
    duration: float | Sequence[float],
    *,
    repeats: int = 1,
    seeds: Sequence[int] | None = None,
    parameter: str = K1,
    folder: Folder = None,
    progress: Progress = silent,
    **walk: Any,
) -> list[xr.Dataset]:
    """Records of walks with some springs (N*mm/deg; a stiffness by its path), one spring after the other.

    ``duration`` (s) is one for all walks, or one for each spring. ``repeats`` is the number of walks with each spring,
    ``seeds`` are the seeds of the first of them (0 by default), from which the others count up. ``walk`` are other
    fields of :class:`chilopod.trials.Trial`.
    """
    durations = np.broadcast_to(duration, len(springs)).tolist()
    asked = [
        Trial(robot.with_value(parameter, stiffness(float(spring))), seconds, seed + repeat, **walk)
        for spring, seconds, seed in zip(springs, durations, seeds or [0] * len(springs), strict=True)
        for repeat in range(repeats)
    ]
    return trials.run(asked, folder, progress)


def kept(folder: Folder, robot: Robot, how: object, compute: Callable[[], list[Any]]) -> list[Any]:
    """Result of a computation on a robot that is no trial, plain numbers, from a file beside the folder of the trials
    if it is there; ``how`` is all else that determines it, but for the sources and the twin's engine."""
    if folder is None:
        return compute()
    code = digest(_WITHOUT), engine_named("twin").traits.version
    said = repr((code, how, robot.with_(name="robot", provenance={}).to_toml()))
    path = Path(folder).parent / "multipliers" / f"{hashlib.sha256(said.encode()).hexdigest()[:20]}.json"
    with suppress(OSError, ValueError):
        return list(json.loads(path.read_text()))
    found = compute()
    write_atomic(path, json.dumps(found))
    return found


def spring_seeds(springs: Sequence[float]) -> list[int]:
    """First seed of the walks with each spring."""
    return [int(SEEDS * spring) for spring in springs]


def by_spring(walks: Sequence[xr.Dataset], springs: Sequence[float]) -> xr.Dataset:
    """Measures of walks over spring (N*mm/deg) and repeat, from walks in this order."""
    repeats = len(walks) // len(springs)
    rows = [xr.concat(walks[i : i + repeats], "repeat") for i in range(0, len(walks), repeats)]
    return xr.concat(rows, "spring").assign_coords(spring=over_springs(springs), repeat=np.arange(repeats))


def over_springs(springs: Sequence[float]) -> tuple[str, Array, dict[str, str]]:
    """Coordinate of springs, N*mm/deg."""
    return "spring", np.asarray(springs, dtype=np.float64), {"units": PAPER_UNIT}


def example_walks(
    robot: Robot,
    springs: Sequence[float],
    duration: float,
    seeds: Sequence[int],
    engine: str = "planar",
    folder: Folder = None,
) -> xr.Dataset:
    """Joint angles of one walk with each of some springs, over (time, spring, joint): ``joint_angle`` (rad)."""
    records = spring_walks(robot, springs, duration, seeds=seeds, folder=folder, rate=_RATE, engine=engine)
    angles = [record.joint_angle.isel(robot=0, drop=True) for record in records]
    data = xr.concat(angles, dim="spring").transpose("time", "spring", "joint").to_dataset(name="joint_angle")
    data.attrs = {"robot": robot.name, "varied": K1, "about": "yaw joint angles over time"}
    return data.assign_coords(spring=over_springs(springs))


def shares(data: xr.Dataset) -> xr.Dataset:
    """Shares of the walks that are ``curved`` and ``straight``, over spring."""
    found = {"curved": is_curved(data), "straight": (data.direction == "straight").values}
    return xr.Dataset(
        {name: ("spring", here.mean(axis=1), {"units": "1"}) for name, here in found.items()},
        coords={"spring": data.spring},
    )


def counted(data: xr.Dataset, settled: bool = True) -> NDArray[np.bool_]:
    """Mask of the trials that curve, and have settled if ``settled``, at springs at which most curve; shape (springs,
    repeats)."""
    most = is_curved(data).mean(axis=1) > 0.5
    return (in_settled_curve(data) if settled else is_curved(data)) & most[:, None]


def fitted(inverse: ArrayLike, bends: ArrayLike) -> SquareRootFit | None:
    """Square-root law of bends over 1/k by :func:`square_root_fit`; None if they do not determine a point."""
    try:
        return square_root_fit(inverse, bends)
    except AnalysisError:
        return None


def point_of(fit: SquareRootFit | None) -> Estimate:
    """Point of a fit, N*mm/deg; NaN if there is none."""
    return fit.estimate if fit else Estimate()


def onset(data: xr.Dataset, joint: int = 1, settled: bool = True) -> SquareRootFit | None:
    """Onset of curved walks by the paper's method: the square-root fit to the trials that are :func:`counted`."""
    here = counted(data, settled)
    inverse = np.broadcast_to(1.0 / data.spring.values[:, None], here.shape)
    return fitted(inverse[here], data.mean_angle.sel(joint=joint).values[here])


def onset_point(data: xr.Dataset, settled: bool = True) -> Estimate:
    """Point of :func:`onset`, N*mm/deg; NaN if there is none."""
    return point_of(onset(data, settled=settled))


def radius_at(data: xr.Dataset, spring: float, settled: bool = True) -> Estimate:
    """Mean radius of the trials at a spring that curve and have settled (all without ``settled``), m; NaN if there are
    fewer than two."""
    at = data.sel(spring=spring)
    radii = at.axis_radius.values[in_settled_curve(at) if settled else is_curved(at)]
    return mean(radii) if len(radii) > 1 else Estimate()


def spring_for(data: xr.Dataset, radius: float) -> Estimate:
    """The paper's k1-hat: spring of a radius, interpolated between trials, N*mm/deg; NaN outside of them.

    The squared curvature is interpolated in 1/k1, in which it is linear by the square-root law.
    """
    here = counted(data)
    curved = here.any(axis=1)
    curvature = np.where(here, 1.0 / data.axis_radius.values, np.nan)[curved]
    inverse, wanted = 1.0 / data.spring.values[curved], radius**-2

    def found(curvature: Array) -> float:
        squared = np.nanmean(curvature, axis=1) ** 2
        order = np.argsort(squared)
        return 1.0 / float(np.interp(wanted, squared[order], inverse[order], left=np.nan, right=np.nan))

    return propagated(found, curvature, reciprocal=True)[0] if curved.any() else Estimate()
