"""Time cut where the contact pattern changes, so that no step ever straddles a switch."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import ParameterError
from chilopod.gait import Gait

Array = NDArray[np.float64]


@lru_cache(maxsize=256)
def pieces(gait: Gait, modules: int, t0: float, t1: float) -> tuple[Array, Array, NDArray[np.intp]]:
    """Cut [t0, t1] at the switches.

    Returns
    -------
    Where in its contact interval each piece starts (s), how long it lasts (s), and which interval of the period it
    belongs to.
    """
    if not (np.isfinite(t0) and np.isfinite(t1) and t0 <= t1):
        raise ParameterError("times must be finite and in order", field="t0, t1", value=(t0, t1), allowed="t0 <= t1")
    period = gait.period
    times = gait.schedule(modules).times
    first, last = int(np.floor(t0 / period)), int(np.ceil(t1 / period))
    switches = (period * np.arange(first, last)[:, None] + times[:-1]).ravel()
    interval = np.tile(np.arange(len(times) - 1), max(0, last - first))
    begins = np.maximum(switches, t0)
    ends = np.minimum(np.append(switches[1:], last * period), t1)
    # However short, a piece counts: the fastest motion is over in little more than round-off.
    used = ends > begins
    starts = (begins - switches)[used]
    return starts, (ends - begins)[used], interval[used]
