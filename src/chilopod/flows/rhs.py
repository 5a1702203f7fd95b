"""Flows of a right-hand side by a suitable method."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import ParameterError
from chilopod.flows.arguments import LARGEST, Slopes, check_shape, checked_count, finite_array, sampled
from chilopod.flows.called import CalledFlow
from chilopod.flows.carrying import TooManySteps
from chilopod.flows.events import Event, check_events, checked_events
from chilopod.flows.implicit.flow import ImplicitFlow, can_be_implicit
from chilopod.flows.jumps import fast_parts, warn_of_jumps
from chilopod.flows.taylor.flow import TaylorFlow
from chilopod.flows.tracing.trace import Trace, evaluate, evaluate_series, trace
from chilopod.flows.tracing.traced import Untraceable
from chilopod.frozen import Array

TOLERANCE, _COARSEST = 1e-14, 1e-3
_FLOOR = 0.01  # truncation of a Taylor step relative to the tolerance: a small one costs almost nothing
_ESTIMATED = 100.0
"""Error estimate of an implicit step relative to the tolerance: the estimate is far larger than the error."""
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
        method: object = self.method
        if not (isinstance(method, str) and method in get_args(Method)):
            raise ParameterError("is not known", field="method", value=self.method, allowed=", ".join(get_args(Method)))
        self.dimension = checked_count("dimension", self.dimension, LARGEST)
        if not 0.0 < finite_array(self.tolerance, (), "tolerance") <= _COARSEST:
            allowed = f"0 to {_COARSEST:g}"
            raise ParameterError("is out of range", field="tolerance", value=self.tolerance, allowed=allowed)
        self.tolerance = float(self.tolerance)
        self.events = checked_events(self.events)
        self.edges = _edges(self.switch_times, self.duration)
        self.times = self.edges[:-1] + 0.4142 * np.diff(self.edges)
        if self.autonomous and self.edges.size > 2:
            raise ParameterError("need a period", field="switch_times", value=self.switch_times, allowed="none")
        self.start = None if self.orbit is None else finite_array(self.orbit, (self.dimension,), "orbit")
        self.base = np.zeros(self.dimension) if self.start is None else self.start

    def flows(self, rhs: Callable[..., ArrayLike], args: tuple[Any, ...]) -> tuple[Slopes, Members]:
        """A right-hand side at many times and states, and its flows: traced if possible, else from calls."""
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
            warn_of_jumps(slopes, self.dimension, self.edges, self.start)
            fast = fast_parts(slopes, self.base, self.edges)
            called = CalledFlow(rhs, args, self.edges, fast, self.times, str(reason), self.tolerance)
            return slopes, {name: getattr(called, name) for name in _FLOWS}
        return self._traced(traced)

    def _refuse_calls(self, rhs: Callable[..., ArrayLike], args: tuple[Any, ...], reason: Untraceable) -> None:
        """Refuse a function of the wrong shape, and options that need a traced function."""
        check_shape(rhs, args, float(self.times[0]), self.base)
        if self.events:
            allowed = "arithmetic, elementary functions and numpy arrays, without branches on the state"
            raise ParameterError(
                f"need functions that can be traced: {reason}", field="events", allowed=allowed
            ) from None
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

        members: Members = {"concurrent": True}
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
            if taylor.patience:
                members = members | _either(members, implicit)
        if self.autonomous:
            members["velocity_series"] = lambda curves: evaluate_series(tape, curves, params)
        return slopes, members

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
    """Flows by Taylor series, or by the implicit method where these take too many steps. Every call decides anew."""
    latest: tuple[bytes, float, float] | None = None  # latest flow by Taylor series, to avoid a second computation

    def either(name: str) -> Callable[..., Any]:
        def flow(x: Array, t0: float, t1: float) -> Any:
            nonlocal latest
            try:
                found = taylor[name](x, t0, t1)
            except TooManySteps:
                return getattr(implicit(), name)(x, t0, t1)
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
        except TooManySteps:
            state, derivative = implicit().flow(x, t0, t1)
            images = derivative @ along
        return state, images

    own: Members = {name: either(name) for name in _FLOWS}
    return own | {
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
        raise ParameterError(
            "must be times within one period", field="switch_times", value=switch_times, allowed=f"[0, {period:g})"
        )
    return np.unique(np.concatenate([[0.0], switches, [period]]))
