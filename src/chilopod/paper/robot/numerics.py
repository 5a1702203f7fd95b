"""Dependence of the twin's results on numerics: the base series with finer steps and a tighter solver."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.analysis.square_root import square_root_fit
from chilopod.errors import AnalysisError
from chilopod.paper.fit_data import base_series_data
from chilopod.paper.section import Context
from chilopod.paper.size import Size
from chilopod.paper.statements import NUMERICS
from chilopod.paper.table import OfTwin, Result, of_twin
from chilopod.progress import Progress, silent
from chilopod.tasks.identify.twin_series import DURATION, base_series
from chilopod.twin.walk import TOLERANCE

SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0)
"""k1 of the walks, N*mm/deg."""

CASES = {"2 ms": (2e-3, TOLERANCE), "1 ms": (1e-3, TOLERANCE), "0.5 ms": (5e-4, TOLERANCE), "tight": (2e-3, 1e-13)}
"""Step (s) and tolerance of the contact solver, the first what all studies have."""


def twin_numerics(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Onset, radii and speeds with finer steps and a tighter solver.

    Parameters
    ----------
    context, progress
        As for :func:`chilopod.paper.robot.walks.robot_walks`; if not full, the first two cases only.

    Returns
    -------
    Dataset over case and spring: ``axis_radius`` (m) and ``speed`` of module 1 (m/s); over case: ``onset`` by the
    paper's method (N*mm/deg).
    """
    robot, size = context.whole, context.size
    radii, speeds, onsets = [], [], []
    cases = CASES if size is Size.FULL else dict(list(CASES.items())[:2])
    springs, duration = size.cut((SPRINGS, DURATION), (SPRINGS[::2], 10.0))
    for index, (name, (step, tolerance)) in enumerate(cases.items()):
        progress(index / len(cases), name)
        finer = robot.with_value("twin.timestep", step)
        found = base_series(finer, base_series_data(), springs, tolerance=tolerance, duration=duration)
        angles = found.bends
        speeds.append(found.speeds)
        radii.append(robot.axis_radius(angles))
        try:
            onsets.append(square_root_fit(1.0 / np.array(springs), np.abs(angles[:, 0]), resampled=0).critical)
        except AnalysisError:
            onsets.append(np.nan)
    return xr.Dataset(
        {
            "axis_radius": (("case", "spring"), np.array(radii), {"units": "m"}),
            "speed": (("case", "spring"), np.array(speeds), {"units": "m/s"}),
            "onset": ("case", np.array(onsets), {"units": "N*mm/deg"}),
        },
        coords={"case": list(cases), "spring": ("spring", np.array(springs), {"units": "N*mm/deg"})},
        attrs={"robot": robot.name},
    )


def largest_move(data: xr.Dataset) -> float:
    """Largest relative change of the onset, a radius or a speed against the first case; NaN if a walk failed."""
    moves = [data[name].values / data[name].values[0] - 1.0 for name in ("axis_radius", "speed", "onset")]
    return float(max(np.abs(each).max() for each in moves))


def rows(data: xr.Dataset) -> list[OfTwin]:
    """The line of the robot's table."""
    moved = data.onset.values / data.onset.values[0] - 1.0
    at_21 = [data[name].sel(spring=21.0).values for name in ("axis_radius", "speed")]
    radii, speeds = (each / each[0] - 1.0 for each in at_21)
    said = "; ".join(
        f"{name}: onset {100.0 * onset:+.1f} %, radius at 21 {100.0 * radius:+.1f} %, speed {100.0 * speed:+.1f} %"
        for name, onset, radius, speed in zip(data.case.values[1:], moved[1:], radii[1:], speeds[1:], strict=True)
    )
    move = largest_move(data)
    words = f"{said}; largest move of onset, and radii and speeds at 15 to 28 N*mm/deg, {100.0 * move:.1f} %"
    return [of_twin(NUMERICS, Result(f"{words} (one walk each, without an error)", move, 0.0))]
