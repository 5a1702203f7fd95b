"""States of walks at any times, exactly there: a walk is cut at the switches of its contact pattern and at samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.planar import stretch
from chilopod.planar.flow import pieces
from chilopod.planar.model import PlanarModel, without_commands


def states_at(models: Sequence[PlanarModel], states: Array, begin: float, times: Array, tolerance: float) -> Array:
    """States with poses of walks without commands, shape (times, walks, 2N+4); NaN after a walk fails.

    The walks start in ``states``, shape (walks, 2N+4), at ``begin`` (s), and are recorded at ``times``, s, which rise
    and are later. Models have one gait and size, one for all walks or one each; the tolerance is that of a step,
    relative to max(1, |state|). ParameterError if the times do not rise.
    """
    if not (np.diff(times, prepend=begin) > 0.0).all():
        raise ParameterError("must rise from the begin of the walk on", field="times")
    model = models[0]
    starts, widths, interval = pieces(model.robot.gait, model.modules, begin, float(times[-1]))
    switches = begin + np.append(0.0, widths.cumsum()[:-1])
    cuts = np.union1d(switches, times)
    here, ends = cuts[:-1], cuts[1:]
    at = np.searchsorted(switches, here, side="right") - 1
    sample = np.searchsorted(times, ends)
    sample[times[np.minimum(sample, times.size - 1)] != ends] = -1
    parts = here - begin, starts[at] + here - switches[at], ends - here, interval[at], sample
    every, count = model.schedule, len(states)
    record = np.full((times.size, *states.shape), np.nan)
    step, status, carried = np.zeros(count), np.full(count, stretch.WALKING), np.array(states)
    stretch.carry(
        np.arange(count), stretch.Pieces(*parts, every.contact, every.stroke), without_commands(models, count),
        tolerance, carried, step, status, record,
    )  # fmt: skip
    return record
