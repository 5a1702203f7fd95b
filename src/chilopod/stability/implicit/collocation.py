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
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.special import roots_jacobi

from chilopod.compiled import fused_njit
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.taylor.series import LANES, load, tangents_at, values_at

Array = NDArray[np.float64]

DONE, NOT_FINITE, BUDGET, STALLED = range(4)
"""How an integration ends."""

_MOST_ROUNDS = 10
_CLOSE = 1e-7
"""A move of Newton's method after which the next one is round-off."""
_NOISE = 2.0**-51
"""Round-off, of the terms whose difference is the estimate of an error."""
_FASTEST_FALL, _FASTEST_GROWTH, _SAFETY = 0.1, 6.0, 0.9


@dataclass(frozen=True)
class Radau(ReadOnlyArrays):
    """Coefficients of Radau IIA.

    Attributes
    ----------
    nodes
        c, rising to 1, shape (s,).
    matrix
        a, shape (s, s); the last row has the weights.
    start
        Values at 0 of the Lagrange polynomials on the nodes, shape (s,): f there as the stages have it.
    filter
        gamma of the filter 1 / (1 - h gamma J) in the estimate of the error: the inverse of the real eigenvalue of the
        inverse of ``matrix`` (Hairer and Wanner, equation IV.8.18).
    """

    nodes: Array
    matrix: Array
    start: Array
    filter: float


def radau(stages: int) -> Radau:
    """The coefficients with an odd number of stages."""
    nodes = np.append(0.5 * (1.0 + roots_jacobi(stages - 1, 1.0, 0.0)[0]), 1.0)
    # In Legendre polynomials, whose integrals are known: Lagrange polynomial j is the sum over k of inverse[k, j] P_k.
    inverse = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, stages - 1))
    integrals = np.array([legendre.legval(2.0 * nodes - 1.0, legendre.legint(row, lbnd=-1)) for row in np.eye(stages)])
    matrix = 0.5 * integrals.T @ inverse
    values = np.linalg.eigvals(np.linalg.inv(matrix))
    real = values[np.abs(values.imag).argmin()].real
    return Radau(nodes, matrix, legendre.legvander(np.array([-1.0]), stages - 1)[0] @ inverse, float(1.0 / real))


@fused_njit(error_model="numpy")
def _decompose(matrix: Any, order: Any) -> bool:
    """LU decomposition in place with rows exchanged; False if the matrix is singular or not finite."""
    n = matrix.shape[0]
    for k in range(n):
        pivot = k
        largest = abs(matrix[k, k])
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > largest:
                pivot, largest = i, abs(matrix[i, k])
        if not 0.0 < largest < math.inf:
            return False
        order[k] = pivot
        if pivot != k:
            for j in range(n):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        for i in range(k + 1, n):
            if matrix[i, k] != 0.0:
                f = matrix[i, k] / matrix[k, k]
                matrix[i, k] = f
                for j in range(k + 1, n):
                    matrix[i, j] -= f * matrix[k, j]
    return True


@fused_njit(error_model="numpy")
def _substitute(matrix: Any, order: Any, columns: Any) -> None:
    """Solve with a decomposed matrix, in place, columns of shape (n, m)."""
    n, m = columns.shape
    for k in range(n):
        pivot = order[k]
        if pivot != k:
            for j in range(m):
                columns[k, j], columns[pivot, j] = columns[pivot, j], columns[k, j]
    for i in range(n):
        for k in range(i):
            f = matrix[i, k]
            for j in range(m):
                columns[i, j] -= f * columns[k, j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            f = matrix[i, k]
            for j in range(m):
                columns[i, j] -= f * columns[k, j]
        f = 1.0 / matrix[i, i]
        for j in range(m):
            columns[i, j] *= f


@fused_njit(error_model="numpy")
def _at(
    tape: Any, units: Any, x: Any, t: float, values: Any, tangents: Any, branches: Any, slope: Any, jacobian: Any
) -> bool:
    """f and its jacobian in a state, everything in units; False if they are not finite."""
    program, terms, _, layout, slopes = tape
    n = layout[0]
    for i in range(n):
        values[i, 0] = x[i] * units[i]
    values[n, 0] = t
    values_at(program, terms, layout[3], layout[4], 0, values, branches)
    tangents_at(program, terms, layout[3], layout[4], 0, values, tangents)
    s = 0.0
    for i in range(n):
        slope[i] = values[slopes[i], 0] / units[i]
        s += abs(slope[i])
        for j in range(n):
            jacobian[i, j] = tangents[slopes[i], 0, j] * (units[j] / units[i])
            s += abs(jacobian[i, j])
    return s < math.inf


@fused_njit(error_model="numpy")
def _stages(
    tape: Any,
    coefficients: Any,
    units: Any,
    x: Any,
    t: float,
    h: float,
    largest: Any,
    values: Any,
    tangents: Any,
    branches: Any,
    moved: Any,
    slopes: Any,
    jacobians: Any,
    matrix: Any,
    order: Any,
    columns: Any,
) -> bool:
    """Solve for the stages; ``moved`` is Y - x, a guess at first.

    In the end ``columns`` has the derivative of the stages with respect to x, shape (s n, n), and ``slopes`` and
    ``jacobians`` belong to the stages. False if it does not converge.
    """
    nodes, weights = coefficients
    s, n = moved.shape
    y = np.empty(n)
    residual = np.empty((s * n, 1))
    before = math.inf
    close = False
    for _ in range(_MOST_ROUNDS):
        for j in range(s):
            for i in range(n):
                y[i] = x[i] + moved[j, i]
            if not _at(tape, units, y, t + nodes[j] * h, values, tangents, branches, slopes[j], jacobians[j]):
                return False
        for i in range(s):
            for k in range(n):
                total = 0.0
                for j in range(s):
                    total += weights[i, j] * slopes[j, k]
                residual[i * n + k, 0] = h * total - moved[i, k]
            for j in range(s):
                f = h * weights[i, j]
                for k in range(n):
                    for m in range(n):
                        matrix[i * n + k, j * n + m] = -f * jacobians[j, k, m]
        for i in range(s * n):
            matrix[i, i] += 1.0
        if not _decompose(matrix, order):
            return False
        _substitute(matrix, order, residual)
        off = 0.0
        for k in range(n):
            size = largest[k]
            for i in range(s):
                size = max(size, abs(x[k] + moved[i, k]))
            for i in range(s):
                move = residual[i * n + k, 0]
                moved[i, k] += move
                if move != 0.0:
                    off = max(off, abs(move) / max(size, abs(move)))
        if close or off <= 1e-15:
            columns[:] = 0.0
            for i in range(s):
                for k in range(n):
                    columns[i * n + k, k] = 1.0
            _substitute(matrix, order, columns)
            return True
        if off > 2.0 * before:
            return False
        close = off <= _CLOSE or (off >= 0.5 * before and off <= 1e3 * _CLOSE)
        before = off
    return False


@fused_njit(error_model="numpy")
def _estimated(
    x: Any,
    h: float,
    coefficients: Any,
    largest: Any,
    near: Any,
    moved: Any,
    slopes: Any,
    jacobians: Any,
    columns: Any,
    slope: Any,
    jacobian: Any,
    derivative: Any,
    extent: Any,
    reached: Any,
) -> float:
    """The error of a step over what every state and entry of the derivative is large for.

    What f at the start differs by from the polynomial through its values in the stages, filtered by the inverse of
    1 - h gamma J. States are measured
    by the largest they have been, and by what the others make of them within the step; so are the entries of the
    derivative, ``extent``.
    """
    start, gamma = coefficients
    s, n = moved.shape
    size = derivative.shape[0]
    off = np.empty((n, 1 + size))
    terms = np.empty((n, 1 + size))
    filtering = np.empty((n, n))
    inverse = np.eye(n)
    order = np.empty(n, np.int64)
    end = columns[(s - 1) * n :]
    factor = np.zeros((n, n))
    for k in range(n):
        total = slope[k]
        for j in range(s):
            total -= start[j] * slopes[j, k]
        off[k, 0] = h * gamma * total
        for m in range(n):
            filtering[k, m] = (1.0 if k == m else 0.0) - h * gamma * jacobian[k, m]
    if size > 0:
        for k in range(n):
            for m in range(n):
                factor[k, m] = jacobian[k, m]
        for j in range(s):
            factor -= start[j] * (jacobians[j] @ columns[j * n : (j + 1) * n])
        off[:, 1:] = (h * gamma) * (factor @ derivative)
    for m in range(n):
        terms[m, 0] = abs(x[m])
        for j in range(size):
            terms[m, 1 + j] = abs(derivative[m, j])
    if not _decompose(filtering, order):
        return math.inf
    _substitute(filtering, order, inverse)
    off = inverse @ off
    # No shorter step takes away what is round-off in it.
    noise = (_NOISE * h * gamma) * (np.abs(inverse) @ (np.abs(jacobian) @ terms))
    worst = 0.0
    for k in range(n):
        scale = largest[k]
        for i in range(s):
            scale = max(scale, abs(x[k] + moved[i, k]))
        for m in range(n):
            scale = max(scale, abs(end[k, m]) * largest[m])
        if abs(off[k, 0]) > noise[k, 0]:
            worst = max(worst, abs(off[k, 0]) / scale)
    if size > 0:
        for i in range(s):
            reached[i] = columns[i * n : (i + 1) * n] @ derivative
        for k in range(n):
            for j in range(n):
                if not near[k, j] or abs(off[k, 1 + j]) <= noise[k, 1 + j]:
                    continue
                scale = extent[k, j]
                for i in range(s):
                    scale = max(scale, abs(reached[i, k, j]))
                for m in range(n):
                    scale = max(scale, abs(end[k, m]) * extent[m, j])
                worst = max(worst, abs(off[k, 1 + j]) / scale)
    return worst


@fused_njit(error_model="numpy")
def _turn(frame: Any, columns: Any, jacobians: Any, weights: Any, h: float, stretch: Any, turned: Any) -> None:
    """Carry an orthonormal frame over a step: in each stage its columns span, the first k for every k, what the
    derivative makes of those at the start, and grow at the rates on the diagonal of Q^T J Q.

    How fast a direction decays is seen from J, and its turning from the derivative; so both are right in directions of
    which the derivative itself retains nothing.
    """
    n = frame.shape[0]
    s = weights.size
    for j in range(s):
        new = columns[j * n : (j + 1) * n] @ frame
        for k in range(n):
            for _ in range(2):
                for m in range(k):
                    dot = 0.0
                    for i in range(n):
                        dot += new[i, m] * new[i, k]
                    for i in range(n):
                        new[i, k] -= dot * new[i, m]
                norm = math.sqrt((new[:, k] ** 2).sum())
                for i in range(n):
                    new[i, k] /= norm
        rates = new.T @ (jacobians[j] @ new)
        for k in range(n):
            stretch[k] += h * weights[j] * rates[k, k]
    for k in range(n):
        along = 0.0
        for i in range(n):
            along += new[i, k] * frame[i, k]
        sign = 1.0 if along >= 0.0 else -1.0
        turned[k] = min(turned[k], abs(along))
        for i in range(n):
            frame[i, k] = sign * new[i, k]


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
        nodes, matrix, start and filter of :class:`Radau`.
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
        Shape (n, n), orthonormal, carried along (:func:`_turn`); shape (0, 0) for none.
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
            if not _at(tape, units, x, t, values, tangents, branches, slope, jacobian):
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
        converged = _stages(
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
        off = _estimated(
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
            _turn(frame, columns, jacobians, weights[s - 1], h, stretch, turned)
        t = t1 if ends else t + h
        h_last = h
        h *= factor
        fresh = True
    report[0], report[1] = steps, t
    return status
