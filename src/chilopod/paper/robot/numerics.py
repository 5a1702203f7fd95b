"""Dependence of the twin's results on numerics: the base series with finer steps and a tighter solver."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import PAPER_UNIT, stiffness
from chilopod.paper.fit_data import base_series_data
from chilopod.paper.measures import fitted, over_springs, point_of
from chilopod.paper.section import Context, Size
from chilopod.paper.statements import NUMERICS
from chilopod.paper.table import OfTwin, Result, of_twin
from chilopod.progress import Progress, silent
from chilopod.tasks.identify.twin_series import DURATION, base_series
from chilopod.twin.walk import TOLERANCE

SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0)
"""k1 of the walks, N*mm/deg."""

CASES = {"2 ms": (2e-3, TOLERANCE), "1 ms": (1e-3, TOLERANCE), "0.5 ms": (5e-4, TOLERANCE), "tight": (2e-3, 1e-13)}
"""Step (s) and tolerance of the contact solver; all studies use the first."""


def twin_numerics(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Onset, radii and speeds with finer steps and a tighter solver; if not full, the first two cases only.

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
        found = base_series(
            finer, base_series_data(), [*map(stiffness, springs)], tolerance=tolerance, duration=duration
        )
        speeds.append(found.speeds)
        radii.append(robot.axis_radius(found.bends))
        onsets.append(point_of(fitted(1.0 / np.array(springs), np.abs(found.bends[:, 0]))).value)
    return xr.Dataset(
        {
            "axis_radius": (("case", "spring"), np.array(radii), {"units": "m"}),
            "speed": (("case", "spring"), np.array(speeds), {"units": "m/s"}),
            "onset": ("case", np.array(onsets), {"units": PAPER_UNIT}),
        },
        coords={"case": list(cases), "spring": over_springs(springs)},
        attrs={"robot": robot.name},
    )


def rows(data: xr.Dataset) -> list[OfTwin]:
    """The line of the robot's table."""
    moves = data[["onset", "axis_radius", "speed"]] / data.isel(case=0, drop=True) - 1.0
    at_21 = 100.0 * moves.sel(spring=21.0)
    said = "; ".join(
        f"{name}: onset {float(at.onset):+.1f} %, radius at 21 {float(at.axis_radius):+.1f} %, "
        f"speed {float(at.speed):+.1f} %"
        for name, at in ((str(name), at_21.sel(case=name)) for name in data.case.values[1:])
    )
    # NaN if a walk failed.
    move = float(max(np.abs(each.values).max() for each in moves.data_vars.values()))
    words = f"{said}; largest move of onset, and radii and speeds at 15 to 28 N*mm/deg, {100.0 * move:.1f} %"
    return [of_twin(NUMERICS, Result(f"{words} (one walk each, without an error)", move, 0.0))]
