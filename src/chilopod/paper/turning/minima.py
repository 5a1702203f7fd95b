"""Where the paper's criteria of turning tasks are smallest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod.paper.printed import Band
from chilopod.paper.scatter import SURE, Answer
from chilopod.paper.turning.trials import CRITERIA

Array = NDArray[np.float64]

SCALES = {"distance": (1.0, "m"), "angle": (180.0 / math.pi, "deg"), "effort": (1.0, "rad²·s")}
"""Units in which the criteria are shown: factor and unit."""


def minima(criteria: xr.Dataset, instant: int = 0) -> xr.Dataset:
    """Where each criterion is smallest, in means over repeats.

    Parameters
    ----------
    criteria
        Criteria of a :class:`TurningTask`.
    instant
        0: the earliest arrival, 1: the paper's 23 s.

    Returns
    -------
    Dataset over criterion: the ``spring`` of the smallest mean, ``at``, where a parabola in 1/k1 through it and its
    neighbours has its vertex (the spring itself at an end of the grid), ``softest`` and ``stiffest``, between which lie
    the springs that are no worse by more than two standard errors of the difference (seed by seed), all in N*mm/deg;
    ``mean`` and ``error`` of the smallest.
    """
    at_instant = criteria.isel(instant=instant)
    springs = criteria.spring.values
    rows: dict[str, list[Any]] = {name: [] for name in ("spring", "at", "softest", "stiffest", "mean", "error")}
    for name in CRITERIA:
        mean, each = at_instant[f"{name}_mean"].values, at_instant[name].values
        if np.isnan(mean).all():
            for column in rows.values():
                column.append(np.nan)
            continue
        lowest = int(np.nanargmin(mean))
        apart = each - each[lowest]
        spread = apart.std(1, ddof=1) / np.sqrt(apart.shape[1]) if apart.shape[1] > 1 else np.zeros(len(apart))
        alike = springs[apart.mean(1) <= SURE * spread + 1e-15]
        rows["spring"].append(springs[lowest])
        rows["at"].append(_vertex(springs, mean, lowest))
        rows["softest"].append(alike.min())
        rows["stiffest"].append(alike.max())
        rows["mean"].append(mean[lowest])
        rows["error"].append(at_instant[f"{name}_error"].values[lowest])
    return xr.Dataset(
        {name: ("criterion", np.array(column, float)) for name, column in rows.items()},
        coords={"criterion": list(CRITERIA)},
        attrs={"seconds": float(at_instant.seconds)},
    )


def around(low: xr.Dataset, said: Band) -> Answer:
    """True if a criterion is smallest where it is said to be: undecided if springs that are no worse lie within as well
    as without.

    Parameters
    ----------
    low
        One criterion of :func:`minima`.
    said
        Between which springs, N*mm/deg.
    """
    low_end, high_end = min(float(low.softest), float(low["at"])), max(float(low.stiffest), float(low["at"]))
    if said.low <= low_end and high_end <= said.high:
        return True
    return None if low_end <= said.high and said.low <= high_end else False


def _vertex(springs: Array, mean: Array, lowest: int) -> float:
    """Vertex of the parabola in 1/k through three points, in k."""
    order = slice(lowest - 1, lowest + 2)
    if lowest in (0, len(springs) - 1) or np.isnan(mean[order]).any():
        return float(springs[lowest])
    curve = np.polynomial.Polynomial.fit(1.0 / springs[order], mean[order], 2)
    if curve.deriv(2)(0.0) <= 0.0:  # three equal values
        return float(springs[lowest])
    return float(1.0 / curve.deriv().roots()[0].real)
