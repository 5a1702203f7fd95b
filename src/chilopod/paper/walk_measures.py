"""Measures of the paper on series of walks from straight on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.analysis.parameters import K1, PAPER_UNIT, stiffness
from chilopod.analysis.square_root import RESAMPLED, SquareRootFit, square_root_fit
from chilopod.errors import AnalysisError
from chilopod.paper.scatter import drawn_anew, mean_and_error
from chilopod.robot import Robot
from chilopod.tasks.radius_law import in_settled_curve, is_curved
from chilopod.trials import Trial, run

Array = NDArray[np.float64]

_RATE = 50.0  # Hz


def by_spring(walks: Sequence[xr.Dataset], springs: Sequence[float]) -> xr.Dataset:
    """Measures of walks, over spring (N*mm/deg) and repeat; of each spring as many, one after the other."""
    repeats = len(walks) // len(springs)
    rows = [xr.concat(walks[i : i + repeats], "repeat") for i in range(0, len(walks), repeats)]
    each = ("spring", np.asarray(springs, dtype=np.float64), {"units": PAPER_UNIT})
    return xr.concat(rows, "spring").assign_coords(spring=each, repeat=np.arange(repeats))


def example_walks(
    robot: Robot,
    springs: Sequence[float],
    duration: float,
    seeds: Sequence[int],
    engine: str = "planar",
    folder: str | Path | None = None,
) -> xr.Dataset:
    """Joint angles over time of one walk at each of some springs.

    Returns
    -------
    Dataset over (time, spring, joint): ``joint_angle`` (rad).
    """
    robots = [robot.with_value(K1, stiffness(spring)) for spring in springs]
    pairs = zip(robots, seeds, strict=True)
    records = run([Trial(each, duration, seed, rate=_RATE, engine=engine) for each, seed in pairs], folder)
    angles = [record.joint_angle.isel(robot=0, drop=True) for record in records]
    data = xr.concat(angles, dim="spring").transpose("time", "spring", "joint").to_dataset(name="joint_angle")
    data = data.assign_coords(spring=("spring", np.asarray(springs, dtype=np.float64), {"units": PAPER_UNIT}))
    data.attrs = {"robot": robot.name, "varied": K1, "about": "yaw joint angles over time"}
    return data


def shares(data: xr.Dataset) -> xr.Dataset:
    """How many of the walks are ``curved`` and ``straight``, over spring."""
    return xr.Dataset(
        {
            "curved": ("spring", is_curved(data).mean(axis=1), {"units": "1"}),
            "straight": ("spring", (data.direction == "straight").values.mean(axis=1), {"units": "1"}),
        },
        coords={"spring": data.spring},
    )


def counted(data: xr.Dataset, settled: bool = True) -> NDArray[np.bool_]:
    """Mask of the trials with an angle and a radius that count: curved ones that have settled (or not, as they say), at
    springs at which most curve; shape (springs, repeats)."""
    most = is_curved(data).mean(axis=1) > 0.5
    return (in_settled_curve(data) if settled else is_curved(data)) & most[:, None]


def onset(data: xr.Dataset, joint: int = 1, settled: bool = True) -> SquareRootFit | None:
    """Where curved walks set in by the paper's method: the square-root fit to the trials that are :func:`counted`.

    None if they do not determine a point.
    """
    here = counted(data, settled)
    inverse = np.broadcast_to(1.0 / data.spring.values[:, None], here.shape)
    try:
        return square_root_fit(inverse[here], data.mean_angle.sel(joint=joint).values[here])
    except AnalysisError:
        return None


def onset_with_error(data: xr.Dataset, settled: bool = True) -> tuple[float, float]:
    """:func:`onset` and its standard error by the bootstrap, N*mm/deg; NaN if there is none."""
    fit = onset(data, settled=settled)
    return (fit.critical, fit.bootstrap_error) if fit else (float("nan"), float("nan"))


def radius_at(data: xr.Dataset, spring: float, settled: bool = True) -> tuple[float, float]:
    """Mean radius of the trials at a spring that curve and have settled (or not, as they say), and its standard error,
    m; NaN if there are fewer than two."""
    at = data.sel(spring=spring)
    radii = at.axis_radius.values[in_settled_curve(at) if settled else is_curved(at)]
    return mean_and_error(radii) if len(radii) > 1 else (float("nan"), float("nan"))


def spring_for(data: xr.Dataset, radius: float) -> tuple[float, float]:
    """The paper's k1-hat: the spring whose walks have a radius, between trials, N*mm/deg; NaN outside of them.

    The squared curvature is interpolated in 1/k1, in which it is linear by the square-root law. With its standard error
    from drawing trials anew at every spring.
    """
    here = counted(data)
    curved = here.any(axis=1)
    curvature = np.where(here, 1.0 / data.axis_radius.values, np.nan)[curved]
    inverse, wanted = 1.0 / data.spring.values[curved], radius**-2

    def found(curvature: Array) -> float:
        squared = np.nanmean(curvature, axis=1) ** 2
        order = np.argsort(squared)
        return 1.0 / float(np.interp(wanted, squared[order], inverse[order], left=np.nan, right=np.nan))

    if not curved.any():
        return float("nan"), float("nan")
    rng = np.random.default_rng(0)
    again = [found(drawn_anew(curvature, rng)) for _ in range(RESAMPLED)]
    single = (np.isfinite(curvature).sum(axis=1) < 2).all()  # nobody knows how it scatters
    return found(curvature), float("nan") if single else float(np.std(again, ddof=1))
