"""Values of a tape at many times and states at once, and its Taylor coefficients along curves: for checks and for
equilibria, not for integration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.tape import Tape

Array = NDArray[np.float64]

_VALUES: dict[int, Callable[..., Any]] = {
    ops.PRODUCT: np.multiply,
    ops.SQUARE: np.square,
    ops.QUOTIENT: np.divide,
    ops.STEP: lambda a: np.where(a >= 0.0, 1.0, -1.0),
    ops.FLOOR: np.floor,
    ops.SELECT: lambda a, b, c: np.where(a > 0.0, b, c),
    ops.EXP: np.exp,
    ops.SIN: np.sin,
    ops.COS: np.cos,
    ops.TAN: np.tan,
    ops.SINH: np.sinh,
    ops.COSH: np.cosh,
    ops.TANH: np.tanh,
    ops.LOG: np.log,
    ops.SQRT: np.sqrt,
    ops.POWER: np.power,
    ops.ATAN: np.arctan,
    ops.ASIN: np.arcsin,
}
_OPERANDS = {ops.PRODUCT: 2, ops.QUOTIENT: 2, ops.POWER: 2, ops.SELECT: 3}


def evaluate(tape: Tape, t: Any, x: Any, params: Array) -> Array:
    """The values of all nodes, shape (nodes, ...), at times of shape (...) and states of shape (n, ...)."""
    n, parameters, first = (int(i) for i in tape.layout[:3])
    t, x = np.asarray(t, dtype=np.float64), np.asarray(x, dtype=np.float64)
    values = np.zeros((tape.program.shape[1], *np.broadcast_shapes(t.shape, x.shape[1:])))
    values[:n] = x if x.ndim == values.ndim else x.reshape(n, *([1] * (values.ndim - 1)))
    values[n] = t
    values[n + 1 : n + 1 + parameters] = params.reshape(-1, *([1] * (values.ndim - 1)))
    values[n + 1 + parameters : first] = tape.numbers.reshape(-1, *([1] * (values.ndim - 1)))
    program = tape.program
    with np.errstate(all="ignore"):
        for i in range(first, program.shape[1]):
            code = int(program[0, i])
            if code == ops.LINEAR:
                for weight, node in tape.terms[:, program[1, i] : program[2, i]].T:
                    values[i] += values[weight] * values[node]
            else:
                values[i] = _VALUES[code](*(values[program[1 + j, i]] for j in range(_OPERANDS.get(code, 1))))
    return values


def evaluate_jacobian(tape: Tape, t: float, x: Array, params: Array) -> tuple[Array, Array]:
    """dx/dt, shape (n,), and its derivative with respect to the state, shape (n, n)."""
    n = tape.dimension
    values = evaluate(tape, t, x, params)
    tangents = np.zeros((values.size, n))
    tangents[:n] = np.eye(n)
    with np.errstate(all="ignore"):
        for i in np.flatnonzero(tape.program[4] != 0):
            code, a, b, c = (int(part) for part in tape.program[:4, i])
            if code == ops.LINEAR:
                weights, nodes = tape.terms[:, a:b]
                tangents[i] = values[weights] @ tangents[nodes]
            elif code == ops.PRODUCT:
                tangents[i] = values[a] * tangents[b] + values[b] * tangents[a]
            elif code == ops.SQUARE:
                tangents[i] = 2.0 * values[a] * tangents[a]
            elif code == ops.QUOTIENT:
                tangents[i] = (tangents[a] - values[i] * tangents[b]) / values[b]
            elif code == ops.SELECT:
                tangents[i] = tangents[b] if values[a] > 0.0 else tangents[c]
            elif code != ops.STATE:
                tangents[i] = (-values[c] if code == ops.COS else values[c]) * tangents[a]
    return values[tape.slopes], tangents[tape.slopes]


def evaluate_series(tape: Tape, curves: Array, params: Array) -> Array:
    """Taylor coefficients in s of f(x(s)) at time 0, shape (curves, orders, n), along the curves x(s) = c0 + c1 s + ...
    with these coefficients, of the same shape.

    Raises
    ------
    AnalysisError
        If a curve starts on a switching surface, where f has no series.
    """
    from chilopod.flows.tracing import series  # numba takes half a second to import

    n, first, last = (int(tape.layout[i]) for i in (0, 3, 4))
    values = np.zeros((tape.program.shape[1], curves.shape[1]))
    coefficients = series.Series(values, np.empty((0, 0, 0)), np.zeros(tape.switches.shape[1]))
    result = np.empty_like(curves)
    with np.errstate(all="ignore"):
        # A copy, because compiled code is compiled anew for arrays that are read-only.
        series.load(tape, np.array(params, dtype=np.float64), coefficients)
        for curve, out in zip(curves, result, strict=True):
            if tape.switches.shape[1]:
                coefficients.branches[:] = _branches(tape, curve[0], params)
            values[:n] = curve.T
            for k in range(curves.shape[1]):
                series.values_at(tape.program, tape.terms, first, last, k, values, coefficients.branches)
            out[:] = values[tape.slopes].T
    return result


def _branches(tape: Tape, x: Array, params: Array) -> Array:
    """The branch of every switch of f at a state."""
    kinds, nodes = tape.switches[:2]
    functions = evaluate(tape, 0.0, x, params)[nodes]
    floors = kinds == ops.FLOOR
    branches = np.where(floors, np.floor(functions), np.where(functions >= 0.0, 1.0, -1.0))
    if ((functions == np.where(floors, branches, 0.0)) & (kinds != ops.GUARD)).any():
        raise AnalysisError(
            "has no derivatives in a state on a switching surface", field="rhs", allowed="an equilibrium away from it"
        )
    return np.asarray(branches)
