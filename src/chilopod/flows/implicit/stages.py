"""One step of collocation: stages, error estimate, and the frame carried by it (:mod:`.collocation`)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.flows.tracing.series import slope_at

_MOST_ROUNDS = 10
_CLOSE = 1e-7  # Newton correction after which the next one is round-off
_NOISE = 2.0**-51  # round-off relative to the terms whose difference is the error estimate


@fused_njit(error_model="numpy")
def decompose(matrix: Any, order: Any) -> bool:
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
def substitute(matrix: Any, order: Any, columns: Any) -> None:
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


class Problem(NamedTuple):
    """A right-hand side on an interval, in units of the states."""

    tape: Any  # its operations
    units: Any  # units of the states, shape (n,), positive; everything else here is in these units
    # values and tangents of the tape, with the states' own tangents 1, and the branches of its switches on the interval
    series: Any
    largest: Any  # largest moduli of the states so far, shape (n,)


class Method(NamedTuple):
    """Coefficients of Radau IIA."""

    nodes: Any  # c, rising to 1, shape (s,)
    weights: Any  # a, shape (s, s); the last row has the weights
    start: Any  # values at 0 of the Lagrange polynomials on the nodes, shape (s,): f there as the stages have it
    # of the filter 1 / (1 - h gamma J) in the estimate of the error: the inverse of the real eigenvalue of the inverse
    # of `weights` (Hairer and Wanner, equation IV.8.18)
    gamma: float


class Step(NamedTuple):
    """A step with s stages."""

    # f and its jacobian at the start, shapes (n,) and (n, n)
    slope: Any
    jacobian: Any
    moved: Any  # states of the stages less the state at the start, shape (s, n)
    # f and its jacobian in the stages, shapes (s, n) and (s, n, n)
    slopes: Any
    jacobians: Any
    # decomposed matrix of Newton's method, shape (s n, s n), and the exchanges of its rows
    matrix: Any
    order: Any
    columns: Any  # derivative of the stages with respect to the state at the start, shape (s n, n)
    reached: Any  # derivative of the stages with respect to the start of the interval, shape (s, n, n)


@fused_njit(error_model="numpy")
def _newton_matrix(weights: Any, h: float, jacobians: Any, matrix: Any) -> None:
    """Matrix of Newton's method for the stages."""
    s, n = jacobians.shape[:2]
    for i in range(s):
        for j in range(s):
            f = h * weights[i, j]
            for k in range(n):
                for m in range(n):
                    matrix[i * n + k, j * n + m] = -f * jacobians[j, k, m]
    for i in range(s * n):
        matrix[i, i] += 1.0


@fused_njit(error_model="numpy")
def _stage_columns(step: Any) -> None:
    """Derivative of the stages with respect to the state at the start."""
    s, n = step.moved.shape
    step.columns[:] = 0.0
    for i in range(s):
        for k in range(n):
            step.columns[i * n + k, k] = 1.0
    substitute(step.matrix, step.order, step.columns)


@fused_njit(error_model="numpy")
def stages(problem: Any, method: Any, x: Any, t: float, h: float, step: Any) -> bool:
    """Solve for the stages from the guess in ``moved``.

    At the end ``columns`` has the derivative of the stages with respect to x, and ``slopes`` and ``jacobians`` belong
    to the stages. False without convergence.
    """
    nodes, weights, largest = method.nodes, method.weights, problem.largest
    moved, slopes = step.moved, step.slopes
    s, n = moved.shape
    y = np.empty(n)
    residual = np.empty((s * n, 1))
    before = math.inf
    close = False
    for _ in range(_MOST_ROUNDS):
        for j in range(s):
            for i in range(n):
                y[i] = x[i] + moved[j, i]
            if not slope_at(
                problem.tape, problem.series, problem.units, t + nodes[j] * h, y, slopes[j], step.jacobians[j]
            ):
                return False
        for i in range(s):
            for k in range(n):
                total = 0.0
                for j in range(s):
                    total += weights[i, j] * slopes[j, k]
                residual[i * n + k, 0] = h * total - moved[i, k]
        _newton_matrix(weights, h, step.jacobians, step.matrix)
        if not decompose(step.matrix, step.order):
            return False
        substitute(step.matrix, step.order, residual)
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
            _stage_columns(step)
            return True
        if off > 2.0 * before:
            return False
        close = off <= _CLOSE or (off >= 0.5 * before and off <= 1e3 * _CLOSE)
        before = off
    return False


@fused_njit(error_model="numpy")
def _defects(x: Any, h: float, method: Any, step: Any, derivative: Any) -> tuple[Any, Any]:
    """Defect of f at the start from the polynomial through its values in the stages, filtered by the inverse of
    1 - h gamma J, of the state and of the columns of the derivative, shape (n, 1 + columns); and the round-off in it.
    """
    start, gamma = method.start, method.gamma
    s, n = step.moved.shape
    size = derivative.shape[0]
    off, terms = np.empty((n, 1 + size)), np.empty((n, 1 + size))
    filtering, inverse, order = np.empty((n, n)), np.eye(n), np.empty(n, np.int64)
    for k in range(n):
        total = step.slope[k]
        for j in range(s):
            total -= start[j] * step.slopes[j, k]
        off[k, 0] = h * gamma * total
        terms[k, 0] = abs(x[k])
        for m in range(n):
            filtering[k, m] = (1.0 if k == m else 0.0) - h * gamma * step.jacobian[k, m]
    if size > 0:
        factor = step.jacobian.copy()
        for j in range(s):
            factor -= start[j] * (step.jacobians[j] @ step.columns[j * n : (j + 1) * n])
        entries = (h * gamma) * (factor @ derivative)
        for k in range(n):
            for m in range(n):
                off[k, 1 + m] = entries[k, m]
                terms[k, 1 + m] = abs(derivative[k, m])
    if not decompose(filtering, order):
        off[:] = math.inf
        return off, np.zeros(off.shape)
    substitute(filtering, order, inverse)
    # No shorter step removes its round-off.
    noise = (_NOISE * h * gamma) * (np.abs(inverse) @ (np.abs(step.jacobian) @ terms))
    return inverse @ off, noise


@fused_njit(error_model="numpy")
def estimated(problem: Any, method: Any, x: Any, h: float, step: Any, near: Any, derivative: Any, extent: Any) -> float:
    """The error of a step relative to the size of every state and entry of the derivative.

    The size of a state is its largest value so far, or the effect of the others on it within the step; likewise for the
    entries of the derivative, ``extent``.
    """
    largest, reached = problem.largest, step.reached
    s, n = step.moved.shape
    off, noise = _defects(x, h, method, step, derivative)
    end = step.columns[(s - 1) * n :]
    worst = 0.0
    for k in range(n):
        scale = largest[k]
        for i in range(s):
            scale = max(scale, abs(x[k] + step.moved[i, k]))
        for m in range(n):
            scale = max(scale, abs(end[k, m]) * largest[m])
        if abs(off[k, 0]) > noise[k, 0]:
            worst = max(worst, abs(off[k, 0]) / scale)
    if derivative.shape[0] > 0:
        for i in range(s):
            reached[i] = step.columns[i * n : (i + 1) * n] @ derivative
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
def turn(frame: Any, columns: Any, jacobians: Any, weights: Any, h: float, stretch: Any, turned: Any) -> None:
    """Carry an orthonormal frame over a step: in each stage the first k columns, for every k, span the image of those
    at the start under the derivative, and grow at the rates on the diagonal of Q^T J Q.

    J gives the decay of a direction and the derivative its turn, so both are correct also for directions that the
    derivative itself does not resolve.
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
