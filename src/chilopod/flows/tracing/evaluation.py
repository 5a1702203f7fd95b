"""Values of a tape at many times and states at once, and its Taylor coefficients along curves: for checks and for
equilibria, not for integration."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.tape import Tape

Array = NDArray[np.float64]


def _loaded(tape: Tape, params: Array, orders: int, directions: int = 0) -> Any:
    """Series of all nodes with the values of the parameters, and compiled code for it."""
    from chilopod.flows.tracing import series  # numba takes half a second to import

    branches = np.zeros(tape.switches.shape[1])
    # A copy, because compiled code is compiled anew for arrays that are read-only.
    return series.loaded(tape, np.array(params, dtype=np.float64), orders, directions, branches), series


def evaluate(tape: Tape, t: Any, x: Any, params: Array) -> Array:
    """Values of all nodes but those of resets, shape (nodes, ...), at times of shape (...) and states of shape (n,
    ...)."""
    t, x = np.asarray(t, dtype=np.float64), np.asarray(x, dtype=np.float64)
    shape = np.broadcast_shapes(t.shape, x.shape[1:])
    times = np.array(np.broadcast_to(t, shape)).reshape(-1)
    states = np.array(np.broadcast_to(x.reshape(len(x), *x.shape[1:] or [1] * len(shape)), (len(x), *shape)))
    found = np.empty((tape.program.shape[1], times.size))
    loaded, kernels = _loaded(tape, params, 1)
    kernels.sample(tape, times, np.ascontiguousarray(states.reshape(len(x), -1).T), loaded, found)
    return found.reshape(-1, *shape)


def evaluate_jacobian(tape: Tape, t: float, x: Array, params: Array) -> tuple[Array, Array]:
    """dx/dt, shape (n,), and its derivative with respect to the state, shape (n, n)."""
    n = tape.dimension
    loaded, kernels = _loaded(tape, params, 1, n)
    loaded.tangents[:n, 0, :n] = np.eye(n)
    kernels.sample(tape, np.array([t], dtype=np.float64), np.array([x]), loaded, np.empty((tape.program.shape[1], 1)))
    kernels.differentiate(tape, loaded)
    return loaded.values[tape.slopes, 0], loaded.tangents[tape.slopes, 0, :n]


def evaluate_series(tape: Tape, curves: Array, params: Array) -> Array:
    """Taylor coefficients in s of f(x(s)) at time 0, shape (curves, orders, n), along the curves x(s) = c0 + c1 s + ...
    with these coefficients, of the same shape.

    Raises
    ------
    AnalysisError
        If a curve starts on a switching surface, where f has no series.
    """
    n, first, last = (int(tape.layout[i]) for i in (0, 3, 4))
    loaded, kernels = _loaded(tape, params, curves.shape[1])
    given = np.empty(0, dtype=np.int64)  # no states follow from f
    result = np.empty_like(curves)
    for curve, out in zip(curves, result, strict=True):
        if tape.switches.shape[1]:
            loaded.branches[:] = _branches(tape, curve[0], params)
        loaded.values[:n] = curve.T
        kernels.values_at(
            tape.program, tape.terms, given, first, last, curve.shape[0] - 1, 1.0, loaded.values, loaded.branches
        )
        out[:] = loaded.values[tape.slopes].T
    return result


def branches_at(tape: Tape, t: Any, x: Array, params: Array) -> tuple[Array, Array]:
    """Functions and branches of all switches, shapes (switches, ...), at times and states as of :func:`evaluate`."""
    kinds, nodes = tape.switches[:2]
    functions = evaluate(tape, t, x, params)[nodes]
    floors = (kinds == ops.FLOOR).reshape(-1, *[1] * (functions.ndim - 1))
    return functions, np.where(floors, np.floor(functions), np.where(functions >= 0.0, 1.0, -1.0))


def _branches(tape: Tape, x: Array, params: Array) -> Array:
    """The branch of every switch of f at a state."""
    kinds = tape.switches[0]
    functions, branches = branches_at(tape, 0.0, x, params)
    if ((functions == np.where(kinds == ops.FLOOR, branches, 0.0)) & (kinds != ops.GUARD)).any():
        raise AnalysisError(
            "has no derivatives in a state on a switching surface", field="rhs", allowed="an equilibrium away from it"
        )
    return branches
