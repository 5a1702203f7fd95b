"""Flow of the nonlinear planar model and its derivative, many robots at a time.

The compiled loop runs over robots; each is integrated from switch to switch of its contact pattern, so that the
right-hand side is always smooth. A tangent is one more "robot" whose state has an imaginary part (see
:mod:`chilopod.integrate`).
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from chilopod.compiled import copy_into, parallel_njit
from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.integrate import integrator
from chilopod.planar.contact import MOMENTS
from chilopod.planar.dynamics import SCRATCH, rhs

if TYPE_CHECKING:
    from chilopod.gait import Gait


_integrate = integrator(rhs)


class Chains(NamedTuple):
    """Numbers of robots of one gait and size: scalars (see :mod:`chilopod.planar.dynamics`), shape (robots, 4);
    stiffness and damping of the joints, N*m/rad and N*m*s/rad, shape (robots, N-1); contact moments at the start of the
    contact interval of every piece, shape (robots, pieces, N, 8)."""

    scalars: Any
    stiffness: Any
    damping: Any
    moments: Any


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
    starts: Array, widths: Array, robots: Chains, states: Any, tolerance: float, nodes: Array | None = None
) -> Any:
    """Carry every row of ``states`` through all pieces of time, in place, on all cores.

    Pieces have start times in their contact intervals and durations, s, shape (pieces,). One robot serves all states,
    or each state has its own; states have shape (states, 2N+1), or with poses behind (states, 2N+4), float64 or
    complex128. The tolerance is relative to max(1, |x|). Nodes are parts of every piece, rising, 0 to 1.

    Returns reduced states at the nodes, shape (states, pieces, nodes, 2N+1), None if a motion diverges. ParameterError
    for inconsistent shapes, because compiled code would read beyond the arrays.
    """
    count, (several, joints) = len(states), robots.stiffness.shape
    fits = (
        starts.shape == widths.shape
        and robots.scalars.shape == (several, 4)
        and robots.damping.shape == (several, joints)
        and robots.moments.shape == (several, widths.size, joints + 1, MOMENTS)
        and states.shape[1:] in ((2 * joints + 3,), (2 * joints + 6,))
        and several in (1, count)
    )
    if not fits:
        allowed = f"(any number, {2 * joints + 3} or {2 * joints + 6})"
        raise ParameterError("has the wrong shape", field="states", value=states.shape, allowed=allowed)
    nodes = np.empty(0) if nodes is None else nodes
    recorded = np.empty((count, widths.size, nodes.size, 2 * joints + 3), states.dtype)
    ok = np.ones(count, dtype=np.bool_)
    if count:
        _advance(starts, widths, robots, states, tolerance, nodes, recorded, ok)
    return recorded if ok.all() else None


@parallel_njit
def _advance(
    starts: Any, widths: Any, robots: Any, states: Any, tolerance: float, nodes: Any, recorded: Any, ok: Any
) -> None:
    for r in numba.prange(states.shape[0]):
        p = min(np.intp(r), robots.scalars.shape[0] - 1)
        x = states[r].copy()
        work = np.empty((16, x.size), x.dtype)
        scratch = np.empty((robots.moments.shape[2], SCRATCH), x.dtype)
        h = 0.0
        for s in range(widths.size):
            args = (robots.scalars[p], robots.stiffness[p], robots.damping[p], robots.moments[p, s], scratch)
            t = starts[s]
            for node in range(nodes.size + 1):
                end = starts[s] + (widths[s] * nodes[node] if node < nodes.size else widths[s])
                h, ok[r] = _integrate(args, x, t, end, h, tolerance, work)
                if not ok[r]:
                    break
                t = end
                if node < nodes.size:
                    copy_into(recorded[r, s, node], x)
            if not ok[r]:
                break
        copy_into(states[r], x)
