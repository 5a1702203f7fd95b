"""Values of a tape at many times and states at once, without compiled code: for checks, not for integration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.stability.taylor import tape as ops
from chilopod.stability.taylor.tape import Tape

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
