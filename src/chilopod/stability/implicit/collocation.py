"""The solution of a stiff dx/dt = f(t, x), with its derivative, by collocation at the Radau points, in compiled code.

Radau IIA with s stages is of order 2s - 1 and L-stable, so steps may be as long as the solution is smooth, however fast
disturbances of it decay (Hairer and Wanner, *Solving Ordinary Differential Equations II*, 2nd ed., Springer 1996,
sections IV.5 and IV.8). A step solves

    Y_i = x + h sum_j a_ij f(t + c_j h, Y_j),        x(t + h) = Y_s,

by Newton's method with the jacobian of every stage, not that of the start for all of them: the matrix of its last
round, 1 - h a_ij J_j in block (i, j), is then the one in the derivative of these equations with respect to x,

    dY_i - h sum_j a_ij J_j dY_j = 1,

so one decomposition gives the exact derivative of the discrete map, all columns of it. The state and the columns of
the derivative since the start are under step control together. A disturbance that decays fast makes short steps at
the start, until it is gone, and long ones from there on.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.stability.implicit.stages import at, estimated, stages, turn
from chilopod.stability.taylor.series import LANES, load

DONE, NOT_FINITE, BUDGET, STALLED = range(4)
"""How an integration ends."""

_FASTEST_FALL, _FASTEST_GROWTH, _SAFETY = 0.1, 6.0, 0.9


@fused_njit(error_model="numpy", nogil=True)
def advance(
    tape: Any,
    coefficients: Any,
    params: Any,
    units: Any,
    near: Any,
    x: Any,
    t0: float,
    t1: float,
    longest: float,
    tolerance: float,
    most_steps: int,
    branches: Any,
    derivative: Any,
    largest: Any,
    extent: Any,
    frame: Any,
    stretch: Any,
    turned: Any,
    report: Any,
) -> int:
    """Carry a state from t0 to t1 > t0 in place.

    Parameters
    ----------
    tape
        program, terms, numbers, layout and slopes of the tape.
    coefficients
        nodes, matrix, start and filter of :class:`chilopod.stability.implicit.radau.Radau`.
    units
        Of the states, shape (n,), positive; ``x``, ``derivative``, ``largest`` and ``extent`` are in these units.
    near
        Shape (n, n): entries of the derivative that are under step control.
    longest
        Step.
    tolerance
        Estimated error of a step over the size of every state and entry of the derivative.
    branches
        Of the switches, held from t0 to t1, shape (switches,).
    derivative
        Shape (n, n), multiplied by the derivative; shape (0, 0) for none.
    largest, extent
        The largest moduli of the states and of the entries of the derivative up to t0, kept up to date.
    frame
        Shape (n, n), orthonormal, carried along (:func:`.stages.turn`); shape (0, 0) for none.
    stretch, turned
        Shape (n,): of each direction of the frame, the logarithm of its growth is added, and the cosine of the largest
        angle it turns by in a step kept.
    report
        Shape (2,): filled with the number of steps, and the time reached.
    """
    program, terms, numbers, layout, _ = tape
    nodes, weights, start, gamma = coefficients
    n = x.size
    s = nodes.size
    size = derivative.shape[0]
    lanes = (n + LANES - 1) // LANES * LANES
    values = np.zeros((layout[5], 1))
    tangents = np.zeros((layout[5], 1, lanes))
    for i in range(n):
        tangents[i, 0, i] = 1.0
    load(program, terms, numbers, layout, params, values)
    slope = np.empty(n)
    jacobian = np.empty((n, n))
    moved = np.zeros((s, n))
    last = np.zeros((s, n))
    slopes = np.empty((s, n))
    jacobians = np.empty((s, n, n))
    matrix = np.empty((s * n, s * n))
    order = np.empty(s * n, np.int64)
    columns = np.empty((s * n, n))
    reached = np.empty((s, n, n))
    t = t0
    h = 0.0
    h_last = 0.0
    steps = 0
    status = DONE
    fresh = True
    while t < t1:
        if fresh:
            if not at(tape, units, x, t, values, tangents, branches, slope, jacobian):
                status = NOT_FINITE
                break
            for i in range(n):
                largest[i] = max(largest[i], abs(x[i]))
            if h == 0.0:
                rate = 0.0
                for i in range(n):
                    total = 0.0
                    for j in range(n):
                        total += abs(jacobian[i, j])
                    rate = max(rate, total)
                h = min(t1 - t, 1.0 / rate) if rate > 0.0 else t1 - t
            fresh = False
        steps += 1
        if steps > most_steps:
            status = BUDGET
            break
        h = min(h, longest)
        ends = h >= (1.0 - 1e-10) * (t1 - t)
        if ends:
            h = t1 - t
        elif h > 0.5 * (t1 - t):
            h = 0.5 * (t1 - t)
        if t + nodes[0] * h <= t:
            status = STALLED
            break
        # The polynomial of the step before goes on for a while: Lagrange polynomials on 0 and its nodes.
        for i in range(s):
            for k in range(n):
                moved[i, k] = 0.0
            z = 1.0 + nodes[i] * h / h_last if h_last > 0.0 else 0.0
            if 0.0 < z <= 3.0:
                for j in range(s):
                    f = z / nodes[j]
                    for m in range(s):
                        if m != j:
                            f *= (z - nodes[m]) / (nodes[j] - nodes[m])
                    for k in range(n):
                        moved[i, k] += f * last[j, k]
                for k in range(n):
                    moved[i, k] -= last[s - 1, k]
        converged = stages(
            tape,
            (nodes, weights),
            units,
            x,
            t,
            h,
            largest,
            values,
            tangents,
            branches,
            moved,
            slopes,
            jacobians,
            matrix,
            order,
            columns,
        )
        if not converged:
            h *= 0.3
            h_last = 0.0
            continue
        off = estimated(
            x,
            h,
            (start, gamma),
            largest,
            near,
            moved,
            slopes,
            jacobians,
            columns,
            slope,
            jacobian,
            derivative,
            extent,
            reached,
        )
        factor = _FASTEST_GROWTH
        if off > 0.0:
            factor = min(factor, max(_FASTEST_FALL, _SAFETY * (tolerance / off) ** (1.0 / (s + 1))))
        if not off <= tolerance:
            h *= min(factor, 0.9) if off < math.inf else _FASTEST_FALL
            continue
        for i in range(n):
            for j in range(s):
                largest[i] = max(largest[i], abs(x[i] + moved[j, i]))
                last[j, i] = moved[j, i]
            x[i] += moved[s - 1, i]
        if size > 0:
            for j in range(s):
                for i in range(n):
                    for k in range(n):
                        extent[i, k] = max(extent[i, k], abs(reached[j, i, k]))
            derivative[:] = reached[s - 1]
        if frame.shape[0] > 0:
            turn(frame, columns, jacobians, weights[s - 1], h, stretch, turned)
        t = t1 if ends else t + h
        h_last = h
        h *= factor
        fresh = True
    report[0], report[1] = steps, t
    return status
