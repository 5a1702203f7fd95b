"""Flow of the nonlinear planar model and its derivative, many robots at a time.

The compiled loop runs over robots; each is carried from switch to switch, so that the integrator only ever sees a
smooth right-hand side. A tangent is one more "robot" whose state has an imaginary part (see
:mod:`chilopod.integrate`).
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from chilopod.compiled import copy_into, parallel_njit
from chilopod.errors import ParameterError
from chilopod.integrate import integrator
from chilopod.planar.contact import MOMENTS
from chilopod.planar.dynamics import SCRATCH, rhs

_integrate = integrator(rhs)


def advance(
    starts: Any,
    widths: Any,
    scalars: Any,
    stiffness: Any,
    damping: Any,
    moments: Any,
    owner: Any,
    states: Any,
    tolerance: float,
    ok: Any,
) -> None:
    """Carry every row of ``states`` through all intervals, in place, on all cores.

    Parameters
    ----------
    starts, widths
        Start of each piece in its contact interval, and its duration, s, shape (pieces,).
    scalars, stiffness, damping
        Scalars, stiffness and damping of the robots, shapes (robots, 4), (robots, N-1), (robots, N-1).
    moments
        Contact moments at the start of the contact interval of every piece, shape (robots, pieces, N, 8).
    owner
        Number of the robot to which a state belongs, shape (states,).
    states
        Reduced states, shape (states, 2N+1), or with poses behind, (states, 2N+4); float64 or complex128.
    tolerance
        Tolerance of the integrator, relative to max(1, |x|).
    ok
        Set to False where a state could not be carried to the end, shape (states,).

    Raises
    ------
    ParameterError
        If their shapes do not go together: compiled code would read beyond them.
    """
    count, (robots, joints) = len(states), stiffness.shape
    fits = (
        starts.shape == widths.shape
        and scalars.shape == (robots, 4)
        and damping.shape == (robots, joints)
        and moments.shape == (robots, widths.size, joints + 1, MOMENTS)
        and states.shape[1:] in ((2 * joints + 3,), (2 * joints + 6,))
        and owner.shape == ok.shape == (count,)
        and (count == 0 or 0 <= owner.min() <= owner.max() < robots)
    )
    if not fits:
        allowed = f"(any number, {2 * joints + 3} or {2 * joints + 6})"
        raise ParameterError("has the wrong shape", field="states", value=states.shape, allowed=allowed)
    if count:
        _advance(starts, widths, scalars, stiffness, damping, moments, owner, states, tolerance, ok)


@parallel_njit
def _advance(
    starts: Any,
    widths: Any,
    scalars: Any,
    stiffness: Any,
    damping: Any,
    moments: Any,
    owner: Any,
    states: Any,
    tolerance: float,
    ok: Any,
) -> None:
    for r in numba.prange(states.shape[0]):
        p = owner[r]
        x = states[r].copy()
        work = np.empty((16, x.size), x.dtype)
        scratch = np.empty((moments.shape[2], SCRATCH), x.dtype)
        h = 0.0
        for s in range(widths.size):
            args = (scalars[p], stiffness[p], damping[p], moments[p, s], scratch)
            h, reached = _integrate(args, x, starts[s], starts[s] + widths[s], h, tolerance, work)
            if not reached:
                ok[r] = False
                break
        copy_into(states[r], x)
