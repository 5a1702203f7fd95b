"""Flows of taped right-hand sides by Taylor series, in compiled code that all tapes share.

A :class:`TaylorFlow` holds a tape (:func:`chilopod.flows.tracing.trace.trace`) and the limits of its steps; the
values of the parameters are an argument of every call, so one object serves a whole family. Every call cuts its
interval at the edges, lets :mod:`.stepping` carry the state and the derivative through each piece, and looks for the
cause in the right-hand side where that ends early.

Switches of the right-hand side (sign, abs, where, floor, %, ...) are found and crossed exactly, in time and state.
Event k happens where its guard g_k(t, x) passes zero, rising if its direction is 1, falling if -1, either way if 0; the
state jumps to r_k(t, x), and the derivative gets the saltation matrix. Events at the start are described in
:func:`chilopod.flows.taylor.switching.await_events`. Units do not matter: states, times or parameters multiplied by
powers of ten give the same digits.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from chilopod.errors import ParameterError
from chilopod.flows import deadline
from chilopod.flows.carrying import NOT_FINITE, REPEATED, RESOLUTION, SHORT, STALLED, ZERO_BY_ZERO, failure, pieces
from chilopod.flows.tracing.tape import COSH, EXP, LOG, POWER, QUOTIENT, SINH, SQRT, Tape
from chilopod.flows.tracing.trace import evaluate
from chilopod.frozen import Array

_MOST_WORK = 1e7
_FEWEST_STEPS = 5000
_MOST_CLOCKS = 8  # tables of 4096 rows, each for one set of parameters
_LEAST_TOLERANCE = 1.2e-16
_OTHER_ORDER = 4
_LEAST_ORDER = 12  # the step control of the other order sees terms up to the fourth: a cube may start with its third
_COMMON = 20.0  # factor on the usual difference of all entries, for those that agree by chance
_NOTHING_BESIDE = 1e-6  # negligible entry, relative to the geometric mean of the largest in its row and column
_SHAKE = 4.0 * 2.0**-53
_UNDERFLOW = 1e-290  # limit below which numbers lose precision
_NOTHING = np.empty((0, 0))
_OVERFLOWING = {EXP: "exp", SINH: "sinh", COSH: "cosh"}
_LARGE = 300.0  # argument beyond which the series of these may overflow
_ROOTS = {SQRT: "a root", POWER: "a power", LOG: "a logarithm"}
_BESIDE, _PASSES, _ALIKE = 1e-6, 1e-3, 0.1  # shift past a 0 / 0, divisor there, and rates beside it, relative to them
_SHORTEST = 1e-10  # step, relative to the interval, at which a 0 / 0 is looked for
_ZERO = 1e-9  # argument, relative to states and rates, at which the series of these may overflow


class Passage(NamedTuple):
    """Result of a flow over an interval."""

    state: Array  # at the end, shape (n,)
    derivative: Array  # with respect to the state at the start, shape (n, n)
    bound: Array  # bound on the error of each entry of `derivative`, shape (n, n); empty if not requested
    steps: int  # number of steps


class TaylorFlow:
    """The flow of a tape."""

    def __init__(
        self,
        tape: Tape,  # right-hand side with guards and resets
        *,
        edges: tuple[float, ...] = (),  # times from 0 to the period that no step may straddle
        period: float = math.inf,  # period T of an explicit dependence on time
        directions: tuple[float, ...] = (),  # directions of the events: 1, -1 or 0
        tolerance: float = _LEAST_TOLERANCE,  # truncation of a step relative to each state and entry of the derivative
        # Steps after which the flow ends if its budget will not suffice, as for a stiff motion; 0 for no such test.
        patience: int = 0,
    ) -> None:
        n = tape.dimension
        self.tape, self.edges, self.period, self.patience = tape, np.array(edges), period, patience
        self._epsilon = max(tolerance, _LEAST_TOLERANCE)
        self.order = max(_LEAST_ORDER, math.ceil(-0.65 * math.log(self._epsilon)))  # near the order of least work
        self._directions = np.array(directions, dtype=np.float64) if tape.switches.size else None
        self._shaken = 1.0 + _SHAKE * np.sign(np.cos(3.0 * np.arange(n) + 1.0))
        self._clock = functools.lru_cache(_MOST_CLOCKS)(self._clock_table)

    @functools.cached_property
    def most_steps(self) -> int:
        """Budget of steps of an integration: a few seconds."""
        return max(_FEWEST_STEPS, int(_MOST_WORK / (self.tape.program.shape[1] * (1 + self.tape.dimension))))

    def advance(self, x: Array, t0: float, t1: float, params: Array, *, bounded: bool = False) -> Passage:
        """Carry one state from t0 to t1 >= t0, with its derivative and, if ``bounded``, a bound on its error.

        The bound sums round-off and the last terms of each step, carried by the derivatives of the steps, scaled to
        many times the usual difference from a second computation (of another order with other steps, disturbed by
        several times round-off), and adds several times the own difference of each entry. Raises an AnalysisError if
        the motion does not reach t1: it diverges, slides, chatters, grazes, or takes too many steps.
        """
        n = self.tape.dimension
        derivative, bound = np.eye(n), np.zeros((n, n)) if bounded else _NOTHING
        state, steps, _ = self._run(x, (t0, t1), params, derivative, bound)
        if not bounded:
            return Passage(state, derivative, bound, steps)
        other = np.eye(n)
        self._run(x * self._shaken, (t0, t1), params, other, other=True)
        difference = np.abs(other - derivative)
        # An entry that is zero within round-off gives no information on the others' differences.
        beside = np.sqrt(bound.max(axis=1)[:, None]) * np.sqrt(bound.max(axis=0))
        known = (bound > _UNDERFLOW) & (bound > _NOTHING_BESIDE * beside)
        ratios = np.sort(difference[known] / bound[known])
        usual = float(ratios[ratios.size // 2]) if ratios.size else 0.0
        bound = bound * (1.0 + _COMMON * usual) + REPEATED * difference
        return Passage(state, derivative, bound, steps)

    def tangents(self, x: Array, directions: Array, t0: float, t1: float, params: Array) -> tuple[Array, Array]:
        """State at t1, and the derivative by ``x`` times ``directions``, shape (n, any number), without a matrix."""
        images = np.array(directions, dtype=np.float64, order="C")
        return self._run(x, (t0, t1), params, images, stepwise=False)[0], images

    def states(self, states: Array, t0: float, t1: float, params: Array) -> Array:
        """Carry many states, shape (states, n)."""
        return self._run(states, (t0, t1), params, np.empty((self.tape.dimension, 0)))[0]

    def events(self, x: Array, t0: float, t1: float, params: Array) -> Array:
        """Numbers of passages of the switches and events that depend on states, on the way of a state."""
        met = self._run(x, (t0, t1), params, np.empty((self.tape.dimension, 0)))[2]
        return np.asarray(met[self.tape.program[4, self.tape.switches[1]] != 0])

    def _run(
        self,
        x: Array,
        interval: tuple[float, float],
        params: Array,
        derivative: Array,
        bound: Array = _NOTHING,
        *,
        other: bool = False,
        stepwise: bool = True,
    ) -> tuple[Array, int, Array]:
        """States at the end, several without derivatives, by the second way if ``other``; steps and passages."""
        from chilopod.flows.taylor import stepping as kernels  # numba takes half a second to import

        n, stop = self.tape.dimension, deadline.stop()
        # Copies, because numba would compile again for read-only arrays.
        x, params = np.array(x, dtype=np.float64, order="C"), np.array(params, dtype=np.float64)
        several = x.ndim == 2 and derivative.shape == (n, 0)
        fits = x.shape[several:] == derivative.shape[:1] == (n,)
        if not (fits and params.shape == (self.tape.parameters,)):
            # Compiled code would read out of bounds.
            raise ParameterError(f"has the wrong shape {x.shape}", field="x", allowed=f"({n},)")
        order, shake = (self.order - _OTHER_ORDER, _SHAKE) if other else (self.order, 0.0)
        # A pulse in time makes steps short, too.
        shortest = _SHORTEST if self.patience and not self.tape.clocks.size else 0.0
        most_steps, patience, clock = self.most_steps, self.patience, self._clock(params.tobytes())
        control = kernels.Control(self._epsilon, order, most_steps, patience, shortest, shake, stepwise, stop)
        outcome, steps = kernels.Outcome(derivative, bound, np.zeros(self.tape.switches.shape[1])), 0
        carry = kernels.advance_each if several else kernels.advance
        for span in pieces(self.edges, self.period, float(interval[0]), float(interval[1])):
            begin = [(each, each.copy()) for each in (x, *outcome)]
            while True:
                status, taken, t = carry(self.tape, self._directions, clock, params, x, span, control, outcome)
                if not status:
                    break
                stuck = status in (NOT_FINITE, STALLED, SHORT)
                cause = self._cause(t, x.reshape(-1, n), params, span) if stuck else ""
                if status != SHORT or cause == ZERO_BY_ZERO:
                    raise failure(status, t, cause)
                control = control._replace(shortest=0.0)  # a motion that is merely fast, as a close encounter
                for each, first in begin:
                    each[...] = first
            steps += taken
        return x, steps, outcome.met

    def _cause(self, t: float, states: Array, params: Array, span: tuple[float, float]) -> str:
        """The function without a finite series in one of some states; empty if none stands out."""
        nodes = np.arange(self.tape.layout[4])
        for x in states[np.isfinite(states).all(axis=1)]:
            values = evaluate(self.tape, nodes, t, x, params)
            rates = np.nan_to_num(values[self.tape.slopes], posinf=0.0, neginf=0.0)
            if self._divides_zero(t, x, params, _BESIDE * np.maximum(np.abs(x), np.abs(rates) * (span[1] - span[0]))):
                return ZERO_BY_ZERO
            zero = _ZERO * float(np.abs([x, rates]).max())
            for code, operand, other in self.tape.program[:3, : nodes.size].T.tolist():
                if code == POWER and float(values[other]).is_integer():
                    continue
                if code in _OVERFLOWING and values[operand] > _LARGE:
                    return f"the right-hand side overflows: {_OVERFLOWING[code]} of {values[operand]:.6g}"
                if code in _ROOTS and values[operand] <= zero:
                    what = "smooth" if values[operand] >= -zero else "finite"
                    return f"the right-hand side is not {what}: {_ROOTS[code]} of {values[operand]:.6g}"
        return ""

    def _divides_zero(self, t: float, x: Array, params: Array, beside: Array) -> bool:
        """True if a divisor passes zero at a state where the right-hand side is about constant on either side."""
        program = self.tape.program[:, : self.tape.layout[4]]
        divisors = program[2, program[0] == QUOTIENT]
        around = x[:, None] + np.outer(beside * np.cos(3.0 * np.arange(x.size) + 1.0), [-1.0, -0.5, 0.0, 0.5, 1.0])
        below, zero, above = evaluate(self.tape, divisors, t, around, params)[:, 1:4].T
        rates = evaluate(self.tape, self.tape.slopes, t, around, params)[:, [0, 1, 3, 4]]
        with np.errstate(invalid="ignore"):  # infinite divisors
            passes = (np.abs(zero) <= _PASSES * np.abs(above - below)).any()
            return bool(passes and (np.ptp(rates, axis=1) <= _ALIKE * np.abs(rates).max(axis=1)).all())

    def _clock_table(self, params: bytes) -> tuple[Array, float]:
        """Functions of time on a grid over the period, each with its largest modulus last, and the period."""
        tape = self.tape
        if tape.clocks.size == 0:
            return np.zeros((0, 0)), 1.0
        times, anywhere = self.period * np.arange(RESOLUTION) / RESOLUTION, np.zeros((tape.dimension, 1))
        values = evaluate(tape, tape.clocks, times, anywhere, np.frombuffer(params))
        values = np.where(np.isfinite(values), values, 0.0)
        return np.ascontiguousarray(np.column_stack([values, np.abs(values).max(axis=1)])), self.period
