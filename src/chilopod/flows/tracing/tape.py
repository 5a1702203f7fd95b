"""A right-hand side as data: the list of the elementary operations that evaluate it.

A :class:`chilopod.flows.tracing.graph.Graph` collects operations while a function is traced, and
:func:`chilopod.flows.tracing.ordering.ordered` orders them into a :class:`Tape`. The operations are those whose
Taylor coefficients obey a recurrence (Griewank and Walther, *Evaluating Derivatives*, 2nd ed., SIAM 2008, sec. 13.2):

* ``LINEAR``: a sum of nodes with constant weights, ``PRODUCT``, ``SQUARE``, ``QUOTIENT``;
* functions c = phi(a) with c' = w a', where w is another node of the tape: sin, cos, exp, ... ;
* ``STEP`` (the sign of its operand) and ``FLOOR``, constant along a step of the integration and the only operations
where a right-hand side or its derivatives may jump, and ``SELECT``, one of two nodes by a ``STEP``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import Array

Integers = NDArray[np.int64]

STATE, TIME, PARAMETER, NUMBER = 0, 1, 2, 3
LINEAR, PRODUCT, SQUARE, QUOTIENT = 4, 5, 6, 7
STEP, FLOOR, SELECT = 8, 9, 10
EXP, SIN, COS, TAN, SINH, COSH, TANH, LOG, SQRT, POWER, ATAN, ASIN = range(11, 23)

GUARD = 23  # kind of switch: the guard of an event

CONSTANT, TIMED, MOVING = 0, 1, 2  # dependence of a node: on parameters only, on time too, or on the state


class Tape(NamedTuple):
    """The operations that evaluate dx/dt = f(t, x), the guards g_k(t, x) and resets r_k(t, x) of its events.

    Compiled code uses it directly; its arrays are read-only.

    Nodes are numbered: n states, time, parameters, numbers, then operations, each after its operands: those that depend
    on the parameters only, those of f and the guards, those of the resets.
    """

    # shape (6, nodes): operation, its three operands (of `LINEAR` the first and past-last of its terms; of `STEP` and
    # `FLOOR` the second is the number of the switch, -1 of one that parameters or a state at an event settle; of
    # functions the third is w), whether tangents of the node are needed, and whether it is linear in time
    program: Integers
    terms: Integers  # shape (2, terms): weight and node of each term of the `LINEAR` operations
    numbers: Array  # values of the number nodes
    # n, number of parameters, first operation, first that is not constant, first of the resets, number of nodes
    layout: Integers
    slopes: Integers  # nodes of f, shape (n,)
    # shape (3, switches): kind (`STEP` or `FLOOR` in the order of their nodes, then `GUARD`), node of the switching
    # function, and for guards the number of the event, else the node of the switch
    switches: Integers
    resets: Integers  # nodes of the resets, shape (events, n)
    # functions of time alone beyond polynomials in t, cos(a t), sin(a t): these may have pulses that a Taylor series
    # misses
    clocks: Integers

    @property
    def dimension(self) -> int:
        """Number of states n."""
        return int(self.layout[0])

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return int(self.layout[1])


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
            there = (functions == np.where(kinds == FLOOR, branches, 0.0)) & (kinds != GUARD)
            if smooth and there.any():
                said = "has no derivatives in a state on a switching surface"
                raise AnalysisError(said, field="rhs", allowed="an equilibrium away from it")
        series.compose(tape, np.array(params, dtype=np.float64), float(t), curve, branches, out)
    return result


def branches_of(tape: Tape, functions: Array) -> Array:
    """Branches of the switches by the values of their functions, shapes (switches, ...)."""
    floors = (tape.switches[0] == FLOOR).reshape(-1, *[1] * (functions.ndim - 1))
    return np.where(floors, np.floor(functions), np.where(functions >= 0.0, 1.0, -1.0))
