"""States of walks at any times: a walk is cut at the switches of its contact pattern and at the samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from chilopod.frozen import Array
from chilopod.planar import stretch
from chilopod.planar.flow import pieces
from chilopod.planar.model import PlanarModel, without_commands


def states_at(models: Sequence[PlanarModel], states: Array, begin: float, times: Array, tolerance: float) -> Array:
    """States of walks without commands at rising times from their begin on (s), shape (times, walks, 2N+4), NaN after a
    walk fails. Models of one gait and size start in ``states`` with poses, shape (walks, 2N+4); the tolerance is that
    of a step, relative to max(1, |state|)."""
    count, schedule = len(states), models[0].schedule
    starts, widths, interval = pieces(models[0].robot.gait, models[0].modules, begin, float(times[-1]))
    switches = begin + np.append(0.0, widths.cumsum()[:-1])
    cuts = np.union1d(switches, times)
    here, ends = cuts[:-1], cuts[1:]
    at, sample = np.searchsorted(switches, here, side="right") - 1, np.searchsorted(times, ends)
    sample[times[np.minimum(sample, times.size - 1)] != ends] = -1
    parts = here - begin, starts[at] + here - switches[at], ends - here, interval[at], sample
    record, robots = np.full((times.size, *states.shape), np.nan), without_commands(models, count)
    record[times == begin] = states
    walked = stretch.Pieces(*parts, schedule.contact, schedule.stroke)
    step, status = np.zeros(count), np.full(count, stretch.WALKING)
    stretch.carry(np.arange(count), walked, robots, tolerance, states.copy(), step, status, record)
    return record
