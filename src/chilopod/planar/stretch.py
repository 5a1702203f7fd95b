"""The compiled loop of a simulation: many robots through one stretch of time in which nobody interferes."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from chilopod.compiled import parallel_njit
from chilopod.integrate import integrator
from chilopod.planar.contact import MOMENTS, sum_moments
from chilopod.planar.dynamics import SCRATCH, rhs

WALKING, DIVERGED, OUT_OF_RANGE = range(3)
MOST_BENT = 0.5 * np.pi
"""Of a yaw joint, rad: beyond it modules run into each other."""

_integrate = integrator(rhs)


@parallel_njit
def walk(
    starts: Any,
    widths: Any,
    interval: Any,
    sample: Any,
    contact: Any,
    stroke: Any,
    scalars: Any,
    feet: Any,
    stiffness: Any,
    damping: Any,
    friction: Any,
    yaw: Any,
    tolerance: float,
    states: Any,
    step: Any,
    status: Any,
    record: Any,
) -> None:
    """Carry every robot through all pieces of time, in place, on all cores; each robot on its own, step by step.

    Parameters
    ----------
    starts, widths
        Where in its contact interval each piece starts and how long it lasts, s, shape (pieces,).
    interval
        The contact interval each piece belongs to, shape (pieces,).
    sample
        Where in ``record`` the state at the end of a piece goes, -1 for nowhere, shape (pieces,).
    contact, stroke
        By interval: whether each foot stands, and where it is at the start (m ahead of mid-stroke), shape
        (intervals, N, 2).
    scalars, feet
        Of the robots: see ``dynamics.py``, shape (robots, 4); forward offset and half-width, m, shape (robots, 2).
    stiffness, damping
        N*m/rad and N*m*s/rad, shape (robots, N-1).
    friction
        Of every foot, N*s/m, shape (robots, N, 2).
    yaw
        Of the legs of module 1, rad, shape (robots, 2).
    tolerance
        Of the integrator, relative to max(1, |x|).
    states
        Reduced states with poses behind, shape (robots, 2N+4).
    step
        To start with, s; 0 for a guess; the last one is left there, shape (robots,).
    status
        WALKING, DIVERGED or OUT_OF_RANGE; robots that no longer walk are left alone, shape (robots,).
    record
        States over (samples, robots, 2N+4); what no robot reached is left alone.
    """
    n = contact.shape[1]
    for r in numba.prange(states.shape[0]):
        if status[r] != WALKING:
            continue
        x = states[r].copy()
        work = np.empty((16, x.size))
        scratch = np.empty((n, SCRATCH))
        moments = np.empty((n, MOMENTS))
        args = (scalars[r], stiffness[r], damping[r], moments, scratch)
        current = -1
        h = step[r]
        for s in range(widths.size):
            if interval[s] != current:
                current = interval[s]
                sum_moments(contact[current], stroke[current], friction[r], feet[r, 0], feet[r, 1], yaw[r], moments)
            h, reached = _integrate(args, x, starts[s], starts[s] + widths[s], h, tolerance, work)
            if not reached:
                status[r] = DIVERGED
                break
            bent = 0.0
            for j in range(n - 1):
                bent = max(bent, abs(x[3 + j]))
            if bent > MOST_BENT:
                status[r] = OUT_OF_RANGE
                break
            if sample[s] >= 0:
                record[sample[s], r] = x
        states[r] = x
        step[r] = h
