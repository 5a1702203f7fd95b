"""Pieces of time between switches of the contact pattern, and the nonlinear flow of tangents through them.

Every tangent is carried together with its state, as the imaginary part of that (see :mod:`chilopod.integrate`), from
switch to switch, so that the right-hand side is always smooth. States alone go through :mod:`chilopod.planar.stretch`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
from numpy.typing import NDArray

from chilopod.compiled import copy_into, parallel_njit
from chilopod.errors import ParameterError
from chilopod.flows import deadline
from chilopod.frozen import Array, ComplexArray
from chilopod.integrate import integrator
from chilopod.planar.dynamics import SCRATCH, rhs

if TYPE_CHECKING:
    from chilopod.gait import Gait


_integrate = integrator(rhs)
_AT_ONCE = 32  # most tangents without a look at the time: one of forty modules takes a second


@lru_cache(maxsize=256)
def pieces(gait: Gait, modules: int, t0: float, t1: float) -> tuple[Array, Array, NDArray[np.intp]]:
    """Pieces of [t0, t1] between switches: starts in their contact intervals, s, durations, s, and numbers of the
    intervals in the period."""
    if not (np.isfinite(t0) and np.isfinite(t1) and t0 <= t1):
        raise ParameterError("must be finite and ascending", field="t0, t1", value=(t0, t1), allowed="t0 <= t1")
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


def advance(
    starts: Array, widths: Array, robot: tuple[Array, Array, Array, Array], states: ComplexArray, tolerance: float
) -> bool:
    """Carry every row of ``states``, shape (states, 2N+1), through all pieces of time, in place, on all cores.

    Pieces have start times in their contact intervals and durations, s, shape (pieces,). The robot is given by scalars,
    stiffness and damping as the right-hand side takes them (see :mod:`chilopod.planar.dynamics`), and by the contact
    moments at the start of the contact interval of every piece, shape (pieces, N, 8). The tolerance is relative to
    max(1, |x|). Returns False if a motion diverges; a SpentError says that the time of an analysis ended.
    """
    ok = np.ones(len(states), dtype=np.bool_)
    number = numba.get_num_threads() if len(states) > _AT_ONCE else _AT_ONCE
    for first in range(0, len(states), number):
        deadline.check()
        _advance(starts, widths, robot, states[first:][:number], tolerance, ok[first:][:number])
    return bool(ok.all())


@parallel_njit
def _advance(starts: Any, widths: Any, robot: Any, states: Any, tolerance: float, ok: Any) -> None:
    scalars, stiffness, damping, moments = robot
    for r in numba.prange(states.shape[0]):
        x = states[r].copy()
        work = np.empty((16, x.size), x.dtype)
        scratch = np.empty((moments.shape[1], SCRATCH), x.dtype)
        h = 0.0
        for s in range(widths.size):
            args = (scalars, stiffness, damping, moments[s], scratch)
            h, ok[r] = _integrate(args, x, starts[s], starts[s] + widths[s], h, tolerance, work)
            if not ok[r]:
                break
        copy_into(states[r], x)
