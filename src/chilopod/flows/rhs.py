"""Flows of a right-hand side by a suitable method, with the events of hybrid systems."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError, ParameterError, known_names
from chilopod.flows.arguments import (
    LARGEST,
    SIZES,
    Claim,
    Slopes,
    check_shape,
    checked_count,
    finite_array,
    numbers,
    sampled,
)
from chilopod.flows.called import CalledFlow, warn_of_jumps
from chilopod.flows.carrying import ZERO_BY_ZERO, TooManySteps, fast_parts
from chilopod.flows.implicit.flow import ImplicitFlow, can_be_implicit
from chilopod.flows.taylor.flow import TaylorFlow
from chilopod.flows.tracing.tape import GUARD
from chilopod.flows.tracing.trace import Trace, evaluate, evaluate_series, trace
from chilopod.flows.tracing.traced import Untraceable
from chilopod.frozen import Array


@dataclass(frozen=True)
class Event:
    """An event of a hybrid system, such as an impact or the touchdown of a foot.

    Parameters
    ----------
    guard
        Function ``guard(t, x, *args)`` -> a number that passes zero at the event. Of several events at one instant
        only the first of the list happens, the others only if their guards pass zero again.
    reset
        Function ``reset(t, x, *args)`` -> state after the event, shape (n,); None for an unchanged state.
    direction
        Sign of the guard's passage through zero: +1 rising, -1 falling, 0 either.
    """

    guard: Callable[..., Any]
    reset: Callable[..., ArrayLike] | None = None
    direction: int = 0

    def __post_init__(self) -> None:
        for name, value in (("guard", self.guard), ("reset", self.guard if self.reset is None else self.reset)):
            if not callable(value):
                raise ParameterError("must be a function", field=name, value=value, allowed=f"{name}(t, x, *args)")
        if not (isinstance(self.direction, Real) and self.direction in (-1, 0, 1)):
            raise ParameterError("must be -1, 0 or 1", field="direction", value=self.direction)


def checked_events(events: object) -> tuple[Event, ...]:
    """Check that events are a list of events."""
    if isinstance(events, Event):
        return (events,)
    if not isinstance(events, Sequence) or not all(isinstance(event, Event) for event in events):
        allowed = "[Event(guard, reset), ...]"
        raise ParameterError("must be a list of events", field="events", value=events, allowed=allowed)
    return tuple(events)


def check_events(events: Sequence[Event], args: tuple[Any, ...], times: Array, orbit: Array | None, n: int) -> None:
    """Check that guards give numbers that may pass zero, and resets states, around the orbit at some times."""
    if not events:
        return
    base = np.zeros(n) if orbit is None else orbit
    wave = np.cos(3.0 * np.arange(n) + 1.0)
    places = [(t, base + size * wave) for t in times.tolist() for size in (0.0, *SIZES)]
    known: dict[int, Array] = {}
    for i, event in enumerate(events):
        name = f"events[{i}].guard"
        asked = [_value(event.guard, t, x, args, (), name) for t, x in places]
        values = np.array([np.nan if value is None else value for value in asked])
        if event.reset is not None:
            _value(event.reset, *places[0], args, (n,), f"events[{i}].reset")
        if asked[0] is None:
            continue  # tracing reports it
        if orbit is not None and not np.isfinite(values[0]):
            raise ParameterError("is not finite on the orbit", field=name, value=float(values[0]))
        if not np.isfinite(values).any():
            raise ParameterError("must be finite, but was not at any state that was tried", field=name)
        if not np.nan_to_num(values).any():
            raise ParameterError("is zero at all states", field=name, allowed="a function that passes zero")
        for j, other in known.items():
            if np.array_equal(values, other, equal_nan=True) and event.direction * events[j].direction != -1:
                said = f"must differ from that of events[{j}]: of events at one instant only the first happens"
                raise ParameterError(said, field=name, allowed="one event with a reset that does both")
        known[i] = values


def _value(
    function: Callable[..., Any], t: float, x: Array, args: tuple[Any, ...], shape: tuple[int, ...], name: str
) -> Array | None:
    """Value of a guard or a reset; None where it raises an exception."""
    try:
        with np.errstate(all="ignore"):
            result = function(t, x.copy(), *args)
    except Exception:
        return None
    if not shape:
        if isinstance(result, bool | np.bool_):
            raise ParameterError("must return a number, not true or false", field=name, allowed="zero at the event")
        if isinstance(result, list | tuple | np.ndarray) and np.size(result) == 1:
            result = np.ravel(result)[0]
    return numbers(result, shape, name)


TOLERANCE, _COARSEST = 1e-14, 1e-3
_FLOOR = 0.01  # truncation of a Taylor step relative to the tolerance: a small one costs almost nothing
_ESTIMATED = 100.0
"""Error estimate of an implicit step relative to the tolerance: the estimate is far larger than the error."""
_AT_ONCE = 1e-13  # time, relative to the duration, within which a switch counts as passed
_PATIENCE = 256  # taylor steps after which the implicit method takes over a motion that would exceed the budget

Method = Literal["automatic", "taylor", "implicit"]


Members = dict[str, Any]
"""Members of a system, as in :class:`chilopod.stability.Capabilities`, without hidden state."""

_FLOWS = "flow", "flow_with_error", "flow_states"


@dataclass
class RightHandSide:
    """Properties of right-hand sides f(t, x, *args), checked: arguments of :func:`chilopod.stability.from_rhs`.

    The ``duration`` is the period of the explicit dependence on time, or about that of a motion; ``base`` is a state to
    test f at, ``edges`` are the times from 0 to the period at which f switches, ``times`` one inside each interval.
    """

    dimension: int
    duration: float
    autonomous: bool
    events: Sequence[Event] = ()
    switch_times: Sequence[float] = ()
    orbit: ArrayLike | None = None
    method: Method = "automatic"
    tolerance: float = TOLERANCE

    def __post_init__(self) -> None:
        known_names([str(self.method)], get_args(Method), "method")
        self.dimension = checked_count("dimension", self.dimension, LARGEST)
        if not 0.0 < finite_array(self.tolerance, (), "tolerance") <= _COARSEST:
            allowed = f"above 0 to {_COARSEST:g}"
            raise ParameterError("is out of range", field="tolerance", value=self.tolerance, allowed=allowed)
        self.tolerance = float(self.tolerance)
        self.events = checked_events(self.events)
        self.edges = _edges(self.switch_times, self.duration)
        self.times = self.edges[:-1] + 0.4142 * np.diff(self.edges)
        if self.autonomous and self.edges.size > 2:
            raise ParameterError("need a period", field="switch_times", value=self.switch_times, allowed="none")
        self.start = None if self.orbit is None else finite_array(self.orbit, (self.dimension,), "orbit")
        self.base = np.zeros(self.dimension) if self.start is None else self.start

    def flows(self, rhs: Callable[..., ArrayLike], args: tuple[Any, ...], claim: Claim) -> tuple[Slopes, Members]:
        """A right-hand side at many times and states, and its flows: traced if possible, else from calls. The claim of
        its period is checked for the events."""
        if not callable(rhs):
            raise ParameterError("must be a function", field="rhs", value=rhs, allowed="rhs(t, x, *args)")
        if not isinstance(args, tuple):
            raise ParameterError("must be a tuple", field="args", value=args, allowed="such as (0.5,)")
        check_events(self.events, args, self.times, self.start, self.dimension)
        pairs = [(event.guard, event.reset) for event in self.events]
        try:
            traced = trace(rhs, self.dimension, args, times=(0.0, self.duration), base=self.base, events=pairs)
        except Untraceable as reason:
            self._refuse_calls(rhs, args, reason)
            slopes = sampled(rhs, args, self.dimension)
            warn_of_jumps(slopes, self.base, self.edges)
            fast = fast_parts(slopes, self.base, self.edges)
            called = CalledFlow(rhs, args, self.edges, fast, self.times, str(reason), self.tolerance)
            return slopes, {name: getattr(called, name) for name in _FLOWS}
        tape = traced.tape
        for kind, node, i in tape.switches.T.tolist():
            if kind == GUARD:
                event, nodes = self.events[i], np.append(node, tape.resets[i])
                values = evaluate(tape, nodes, claim.times, claim.states, traced.params)
                reset = None if event.reset is None else values[1:]
                claim.check_event(f"events[{i}]", values[:1], event.direction, reset)
        return self._traced(traced)

    def _refuse_calls(self, rhs: Callable[..., ArrayLike], args: tuple[Any, ...], reason: Untraceable) -> None:
        """Refuse a function of the wrong shape, and options that need a traced function."""
        check_shape(rhs, args, float(self.times[0]), self.base)
        if self.events:
            allowed = "arithmetic, elementary functions and numpy arrays, without branches on the state"
            said = f"need functions that can be traced: {reason}"
            raise ParameterError(said, field="events", allowed=allowed) from None
        if self.method != "automatic":
            said = f"needs a function that can be traced: {reason}"
            raise ParameterError(said, field="method", value=self.method, allowed="automatic") from None

    def _traced(self, traced: Trace) -> tuple[Slopes, Members]:
        tape, params = traced.tape, traced.params

        def slopes(t: Array, x: Array) -> Array:
            return evaluate(tape, tape.slopes, t, x, params)

        @functools.cache  # made at first use, as it samples the whole period
        def implicit() -> ImplicitFlow:
            fast = fast_parts(slopes, self.base, self.edges) if tape.clocks.size else np.empty((0, 2))
            return ImplicitFlow(tape, params, self.edges, fast, _ESTIMATED * self.tolerance)

        members: Members = {"concurrent": True, "flow_events": lambda x, t0, t1: np.empty(0)}
        if self.method == "implicit":
            members |= {name: getattr(implicit(), name) for name in (*_FLOWS, "flow_volume")}
            members["is_stiff"] = lambda x, t0, t1: True
        else:
            taylor = self._taylor(traced)
            members |= {
                "flow": lambda x, t0, t1: taylor.advance(x, t0, t1, params)[:2],
                "flow_with_error": lambda x, t0, t1: taylor.advance(x, t0, t1, params, bounded=True)[:3],
                "flow_states": lambda states, t0, t1: taylor.states(states, t0, t1, params),
                "flow_tangents": lambda x, along, t0, t1: taylor.tangents(x, along, t0, t1, params),
            }
            if not can_be_implicit(tape):
                members["flow_events"] = lambda x, t0, t1: taylor.events(x, t0, t1, params)
            if taylor.patience:
                members = members | _either(members, implicit)
        if self.autonomous:
            if (tape.switches[0] != GUARD).any():
                members["velocity"] = lambda x: self._velocity(traced, x)
            members["velocity_series"] = lambda curves: evaluate_series(tape, curves, params)
        return slopes, members

    def _velocity(self, traced: Trace, x: Array) -> Array:
        """dx/dt at a state; on a switching surface that with which the motion goes on."""
        from chilopod.flows.taylor.switching import departure  # numba takes half a second to import

        params, state = np.array(traced.params), np.array(x, dtype=np.float64)  # compiled code takes no read-only ones
        return np.asarray(departure(traced.tape, params, state, _AT_ONCE * self.duration))

    def _taylor(self, traced: Trace) -> TaylorFlow:
        """The flow by Taylor series, one for all values of the parameters."""
        edges = tuple(self.edges.tolist()) if self.edges.size > 2 else ()
        key = edges, self.duration, self.tolerance, self.method, tuple(event.direction for event in self.events)
        found = traced.derived.get(key)
        if found is None:
            other = self.method == "automatic" and can_be_implicit(traced.tape)
            found = traced.derived[key] = TaylorFlow(
                traced.tape,
                edges=edges,
                period=self.duration,
                tolerance=_FLOOR * self.tolerance,
                directions=tuple(float(event.direction) for event in self.events),
                patience=_PATIENCE if other else 0,
            )
        return found


def _either(taylor: Members, implicit: Callable[[], ImplicitFlow]) -> Members:
    """Flows by Taylor series, or by the implicit method where these take too many steps or meet 0 / 0, at each call."""
    latest: tuple[bytes, float, float] | None = None  # latest flow by Taylor series, to avoid a second computation

    def instead(first: TooManySteps, name: str, x: Array, t0: float, t1: float) -> Any:
        try:
            return getattr(implicit(), name)(x, t0, t1)
        except AnalysisError as second:
            raise (first if ZERO_BY_ZERO in first.problem else second) from None

    def either(name: str) -> Callable[..., Any]:
        def flow(x: Array, t0: float, t1: float) -> Any:  # of this module: its derivative needs no comparison
            nonlocal latest
            x = np.asarray(x, dtype=np.float64)
            try:
                found = taylor[name](x, t0, t1)
            except TooManySteps as first:
                return instead(first, name, x, t0, t1)
            latest = x.tobytes(), t0, t1
            return found

        return flow

    def is_stiff(x: Array, t0: float, t1: float) -> bool:
        if latest != (x.tobytes(), t0, t1):
            try:
                taylor["flow"](x, t0, t1)
            except TooManySteps:
                return True
        return False

    def flow_tangents(x: Array, along: Array, t0: float, t1: float) -> tuple[Array, Array]:
        try:
            state, images = taylor["flow_tangents"](x, along, t0, t1)
        except TooManySteps as first:
            state, derivative = instead(first, "flow", x, t0, t1)
            images = derivative @ along
        return state, images

    return {name: either(name) for name in _FLOWS} | {
        "flow_tangents": flow_tangents,
        "flow_volume": lambda *args: implicit().flow_volume(*args),
        "is_stiff": is_stiff,
    }


def _edges(switch_times: Sequence[float], period: float) -> Array:
    try:
        switches = np.unique(np.array(switch_times, dtype=np.float64))
        valid = np.ndim(switch_times) == 1 and bool(((switches >= 0) & (switches < period)).all())
    except (TypeError, ValueError, OverflowError):
        valid = False
    if not valid:
        said, allowed = "must be times within one period", f"[0, {period:g})"
        raise ParameterError(said, field="switch_times", value=switch_times, allowed=allowed)
    return np.unique(np.concatenate([[0.0], switches, [period]]))
