"""Values of a tape at many times and states, and its Taylor coefficients along curves, for checks and equilibria
(not for integration)."""

from __future__ import annotations

from typing import Any

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.tape import Integers, Tape
from chilopod.frozen import Array


def evaluate(tape: Tape, nodes: Integers, t: Any, x: Any, params: Array) -> Array:
    """Values of some nodes, shape (nodes, ...), at times and states of shapes (...) and (n, ...), or one of either.

    Nodes of resets have no values.
    """
    from chilopod.flows.tracing import series  # numba takes half a second to import

    # Copies, because numba would compile again for read-only arrays.
    times, states = np.array(t, dtype=np.float64, ndmin=1), np.array(x, dtype=np.float64).reshape(len(x), -1)
    found = np.empty((nodes.size, max(times.size, states.shape[1])))
    series.sample(tape, np.array(params, dtype=np.float64), times, states, nodes, found)
    return found.reshape(-1, *(np.shape(t) or np.shape(x)[1:]))


def evaluate_jacobian(tape: Tape, t: float, x: Array, params: Array) -> tuple[Array, Array]:
    """dx/dt, shape (n,), and its derivative with respect to the state, shape (n, n)."""
    found = evaluate_series(tape, np.stack([np.tile(x, (x.size, 1)), np.eye(x.size)], axis=1), params, t, False)
    return found[0, 0], found[:, 1].T.copy()


def evaluate_series(tape: Tape, curves: Array, params: Array, t: float = 0.0, smooth: bool = True) -> Array:
    """Taylor coefficients in s of f(t, x(s)), shape (curves, orders, n), along the curves x(s) = c0 + c1 s + ... with
    these coefficients, of the same shape; AnalysisError if one starts on a switching surface, where f is not smooth."""
    from chilopod.flows.tracing import series

    kinds, surfaces = tape.switches[:2]
    result, branches = np.empty(curves.shape), np.zeros(kinds.size)
    for curve, out in zip(np.array(curves, dtype=np.float64), result, strict=True):
        if kinds.size:
            functions = evaluate(tape, surfaces, t, curve[0], params)
            branches = branches_of(tape, functions)
            there = (functions == np.where(kinds == ops.FLOOR, branches, 0.0)) & (kinds != ops.GUARD)
            if smooth and there.any():
                said = "has no derivatives in a state on a switching surface"
                raise AnalysisError(said, field="rhs", allowed="an equilibrium away from it")
        series.compose(tape, np.array(params, dtype=np.float64), float(t), curve, branches, out)
    return result


def branches_of(tape: Tape, functions: Array) -> Array:
    """Branches of the switches by the values of their functions, shapes (switches, ...)."""
    floors = (tape.switches[0] == ops.FLOOR).reshape(-1, *[1] * (functions.ndim - 1))
    return np.where(floors, np.floor(functions), np.where(functions >= 0.0, 1.0, -1.0))
