"""A right-hand side as data: the list of the elementary operations that evaluate it.

A :class:`chilopod.flows.tracing.graph.Graph` collects operations while a function is traced, and
:func:`chilopod.flows.tracing.ordering.ordered` orders them into a :class:`Tape`. The operations are those whose
Taylor coefficients obey a recurrence (Griewank and Walther, *Evaluating Derivatives*, 2nd ed., SIAM 2008, sec. 13.2):

* ``LINEAR``: a sum of nodes with constant weights, ``PRODUCT``, ``SQUARE``, ``QUOTIENT``;
* functions c = phi(a) with c' = w a', where w is another node of the tape: sin, cos, exp, ... ; ``BERNOULLI`` is the
derivative of u / (exp(u) - 1) whose order is its second operand;
* ``STEP`` (the sign of its operand) and ``FLOOR``, constant along a step of the integration and the only operations
where a right-hand side or its derivatives may jump, and ``SELECT``, one of two nodes by a ``STEP``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import Array

Integers = NDArray[np.int64]

STATE, TIME, PARAMETER, NUMBER = 0, 1, 2, 3
LINEAR, PRODUCT, SQUARE, QUOTIENT = 4, 5, 6, 7
STEP, FLOOR, SELECT = 8, 9, 10
EXP, SIN, COS, TAN, SINH, COSH, TANH, LOG, SQRT, POWER, ATAN, ASIN, BERNOULLI = range(11, 24)

GUARD = 24  # kind of switch: the guard of an event

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
    # functions of time alone beyond polynomials in t, cos(a t), sin(a t): these may have pulses that a series misses
    clocks: Integers

    @property
    def dimension(self) -> int:
        """Number of states n."""
        return int(self.layout[0])

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return int(self.layout[1])
