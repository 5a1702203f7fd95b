"""A periodic system from its right-hand side."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import ParameterError
from chilopod.stability.arguments import (
    Slopes,
    check_shape,
    check_symmetry,
    check_timeless,
    checked_arguments,
    checked_duration,
    finite_array,
    sampled,
)
from chilopod.stability.called import CalledFlow
from chilopod.stability.capabilities import spatial_symmetries
from chilopod.stability.events import Event, check_events, checked_events
from chilopod.stability.implicit.implicit import ImplicitFlow, can_be_implicit
from chilopod.stability.jumps import fast_parts, warn_of_jumps
from chilopod.stability.system import PeriodicSystem
from chilopod.stability.taylor.evaluation import evaluate, evaluate_jacobian, evaluate_series
from chilopod.stability.taylor.taylor import TaylorFlow, TooManySteps
from chilopod.stability.taylor.trace import Trace, trace
from chilopod.stability.taylor.traced import Untraceable

Array = NDArray[np.float64]

TOLERANCE = 1e-14
_SAME = 1e-6
_FLOOR = 0.01
"""Truncation of a Taylor step relative to the tolerance: it costs next to nothing."""
_ESTIMATED = 100.0
"""Of an implicit step likewise: its estimate is far larger than its error."""

_BOTH = ("flow", "flow_with_error", "flow_states")
"""What either method offers."""

Method = Literal["automatic", "taylor", "implicit"]


def from_rhs(
    rhs: Callable[..., ArrayLike],
    dimension: int,
    period: float | None,
    *,
    args: tuple[Any, ...] = (),
    events: Sequence[Event] = (),
    switch_times: Sequence[float] = (),
    jacobian: Callable[..., ArrayLike] | None = None,
    symmetry: ArrayLike | None = None,
    spatial_symmetry: ArrayLike | None = None,
    orbit: ArrayLike | None = None,
    guess_period: float | None = None,
    scale: ArrayLike | None = None,
    method: Method = "automatic",
    tolerance: float = TOLERANCE,
) -> PeriodicSystem:
    """Build a :class:`PeriodicSystem` from dx/dt = rhs(t, x, *args).

    The function is traced: called once with numbers that record what is done with them. From the recorded operations,
    compiled code integrates the state and its derivative by Taylor series to round-off, in any units. That takes
    arithmetic, the elementary functions of numpy and math, numpy arrays, loops, and functions compiled with
    ``numba.njit``; a family over parameters (arguments, closures or globals that are floats) is traced once. Jumps and
    kinks (``sign``, ``abs``, ``where``, ``%``, comparisons, ...) are found and crossed exactly, in time and in state.
    What depends on time alone is looked at on a grid of 4096 points over the period, so a pulse that is not seen there
    (narrower than about T / 50 000) is missed.

    Taylor series take steps as short as the fastest decay. Where that is much faster than the motion, the system is
    stiff, and an implicit method, Radau IIA collocation with the exact derivative of its steps, goes on in their place:
    tried when the series have used up their steps, or from the start with ``method="implicit"``.

    A function that branches on its arguments (``if x[0] > 0``) or calls other libraries cannot be traced. It is
    integrated by scipy's DOP853 from calls, hundreds of times slower.

    Parameters
    ----------
    rhs
        ``rhs(t, x, *args)`` -> dx/dt, shape (n,); T-periodic in t.
    dimension, period
        n and T; None where ``rhs`` does not depend on t and the period belongs to the orbit.
    args
        Parameters of the right-hand side.
    events
        Where the state jumps, or the right-hand side switches, on reaching a surface. Needs functions that can be
        traced.
    switch_times
        Times in [0, T) at which ``rhs`` jumps or has a kink. Integration stops and restarts there. A function that is
        traced needs none; of others, within an interval the function is only ever asked at times strictly inside it,
        and jumps that are not declared cost time and digits: those found on a fine grid are warned of.
    jacobian
        ``jacobian(t, x, *args)`` -> (n, n). Of use where the function cannot be traced; without it the derivative is
        then taken by a complex step, or where ``rhs`` does not accept complex states, by central differences, with
        about nine digits.
    symmetry, spatial_symmetry, orbit, scale, guess_period
        See :class:`PeriodicSystem`. Where the period is not known, ``guess_period`` has to be given; ``orbit`` may be a
        guess.
    method
        "taylor" or "implicit", of functions that can be traced; "automatic": Taylor series, and the implicit method
        from where these take too many steps on. That is found out anew for every system, in a second or two, so
        families that are known to be stiff are better told. The implicit method is for smooth functions of the
        state without events, and for some tens of states.
    tolerance
        Local error per step, relative to the size of each state.

    Warns
    -----
    UndeclaredSwitch
        If a right-hand side that cannot be traced jumps elsewhere than at ``switch_times``.
    NotAnalytic
        If the derivative of such a function has to be taken by differences.
    """
    if method not in get_args(Method):
        raise ParameterError("is not known", field="method", value=method, allowed=", ".join(get_args(Method)))
    dimension, args, tolerance = checked_arguments(rhs, dimension, args, tolerance)
    autonomous = period is None
    length = checked_duration("guess_period" if autonomous else "period", guess_period if autonomous else period)
    happening = checked_events(events)
    edges = _edges(switch_times, length)
    if autonomous and edges.size > 2:
        raise ParameterError("need a period", field="switch_times", value=switch_times, allowed="none")
    start = None if orbit is None else finite_array(orbit, (dimension,), "orbit")
    base = np.zeros(dimension) if start is None else start
    times = np.asarray(edges[:-1] + 0.4142 * np.diff(edges))  # one inside every interval
    flows: dict[str, Any]
    slopes: Slopes
    check_events(happening, args, times, start, dimension)
    try:
        pairs = [(event.guard, event.reset) for event in happening]
        traced = trace(rhs, dimension, args, times=(0.0, length), base=base, events=pairs)
    except Untraceable as reason:
        if happening:
            check_shape(rhs, args, times, base, (dimension,), "rhs")
            raise ParameterError(
                f"need functions that can be traced: {reason}",
                field="events",
                allowed="arithmetic, elementary functions and numpy arrays, without branches on the state",
            ) from None
        if method != "automatic":
            raise ParameterError(
                f"needs a function that can be traced: {reason}", field="method", value=method, allowed="automatic"
            ) from None
        check_shape(rhs, args, times, base, (dimension,), "rhs")
        if jacobian is not None:
            check_shape(jacobian, args, times, base, (dimension, dimension), "jacobian")
        slopes = sampled(rhs, args, dimension)
        warn_of_jumps(rhs, args, dimension, edges, start)
        called = CalledFlow(rhs, args, jacobian, edges, fast_parts(slopes, base, edges), times, str(reason), tolerance)
        flows = {
            "flow": called.flow,
            "flow_with_error": called.flow_with_error,
            "flow_states": called.flow_states,
        }
    else:
        if jacobian is not None:
            check_shape(jacobian, args, times, base, (dimension, dimension), "jacobian")
            _check_jacobian(jacobian, args, traced, times, base)

        def slopes(t: Array, x: Array) -> Array:
            return evaluate(traced.tape, t, x, traced.params)[traced.tape.slopes]

        flows = _traced_flows(traced, edges, tolerance, happening, method, lambda: fast_parts(slopes, base, edges))
        if autonomous:
            flows["velocity_series"] = lambda curves: evaluate_series(traced.tape, curves, traced.params)

    system = PeriodicSystem(
        dimension=dimension,
        period=None if autonomous else length,
        velocity=(lambda x: slopes(np.zeros(1), x[:, None])[:, 0]) if autonomous else None,
        guess_period=length if autonomous else None,
        scale=None if scale is None else np.asarray(scale, dtype=np.float64),
        symmetry=None if symmetry is None else np.asarray(symmetry, dtype=np.float64),
        spatial_symmetry=None if spatial_symmetry is None else np.asarray(spatial_symmetry, dtype=np.float64),
        orbit=start,
        **flows,
    )
    if autonomous:
        check_timeless(slopes, base, length)
    if not happening:  # which a symmetry would have to respect as well
        if system.symmetry is not None:
            shift = 0.0 if autonomous else length / system.symmetry_order
            check_symmetry("symmetry", system.symmetry, shift, slopes, times, base, length)
        for matrix in spatial_symmetries(system):
            check_symmetry("spatial_symmetry", matrix, 0.0, slopes, times, base, length)
    return system


def _traced_flows(
    traced: Trace,
    edges: Array,
    tolerance: float,
    events: tuple[Event, ...],
    method: Method,
    fast: Callable[[], Array],
) -> dict[str, Any]:
    """The flows of a traced right-hand side, as a :class:`PeriodicSystem` wants them."""

    @functools.cache
    def implicit() -> ImplicitFlow:
        parts = fast() if traced.tape.clocks.size else np.empty((0, 2))
        return ImplicitFlow(traced.tape, traced.params, edges, parts, _ESTIMATED * tolerance)

    if method == "implicit":
        own = {name: getattr(implicit(), name) for name in (*_BOTH, "flow_frame")}
        return {**own, "is_stiff": lambda: True, "concurrent": True}
    taylor = _taylor_flows(traced, edges, tolerance, events)
    if method == "taylor" or not can_be_implicit(traced.tape):
        return taylor
    stiff: list[bool] = []

    def either(name: str) -> Callable[..., Any]:
        def flow(*arguments: Any) -> Any:
            if not stiff:
                try:
                    return taylor[name](*arguments)
                except TooManySteps:
                    stiff.append(True)
            return getattr(implicit(), name)(*arguments)

        return flow

    return {
        **taylor,
        **{name: either(name) for name in _BOTH},
        "flow_frame": lambda *arguments: implicit().flow_frame(*arguments),
        "is_stiff": lambda: bool(stiff),
    }


def _taylor_flows(traced: Trace, edges: Array, tolerance: float, events: tuple[Event, ...]) -> dict[str, Any]:
    """The flows of a traced right-hand side, as a :class:`PeriodicSystem` wants them."""
    params = traced.params
    declared = tuple(edges.tolist()) if edges.size > 2 else ()
    taylor = TaylorFlow(
        traced.tape,
        edges=declared,
        period=float(edges[-1]),
        tolerance=_FLOOR * tolerance,
        directions=tuple(float(event.direction) for event in events),
    )

    def flow(x: Array, t0: float, t1: float) -> tuple[Array, Array]:
        passage = taylor.advance(x, t0, t1, params)
        return passage.state, passage.derivative

    def flow_with_error(x: Array, t0: float, t1: float) -> tuple[Array, Array, Array]:
        passage = taylor.advance(x, t0, t1, params, bounded=True)
        return passage.state, passage.derivative, passage.bound

    def flow_states(states: Array, t0: float, t1: float) -> Array:
        return taylor.states(states, t0, t1, params)

    def flow_tangents(x: Array, directions: Array, t0: float, t1: float) -> tuple[Array, Array]:
        return taylor.tangents(x, directions, t0, t1, params)

    return {
        "flow": flow,
        "flow_with_error": flow_with_error,
        "flow_states": flow_states,
        "flow_tangents": flow_tangents,
        "concurrent": True,
    }


def _check_jacobian(
    jacobian: Callable[..., ArrayLike], args: tuple[Any, ...], traced: Trace, times: Array, base: Array
) -> None:
    """A traced function needs no jacobian, but who hands over one that is wrong wants to know."""
    n = base.size
    for t in times.tolist():
        x = base + (float(np.abs(base).max()) or 1.0) * np.cos(3.0 * np.arange(n) + 1.0)
        _, right = evaluate_jacobian(traced.tape, t, x, traced.params)
        with np.errstate(all="ignore"):
            given = np.asarray(jacobian(t, x.copy(), *args), dtype=np.float64)
        off = np.abs((given - right) * x) > _SAME * (np.abs(right) @ np.abs(x))[:, None]
        if off.any() and np.isfinite(right).all():
            i, j = np.argwhere(off)[0]
            raise ParameterError(
                f"is not the derivative of rhs: entry ({i}, {j}) at t = {t:g} should be {right[i, j]:g}",
                field="jacobian",
                value=float(given[i, j]),
            )


def _edges(switch_times: Sequence[float], period: float) -> Array:
    if isinstance(switch_times, tuple) and not switch_times:
        return np.array([0.0, period])
    try:
        switches = np.unique(np.array(switch_times, dtype=np.float64))
        valid = np.ndim(switch_times) == 1 and bool(((switches >= 0) & (switches < period)).all())
    except (TypeError, ValueError):
        valid = False
    if not valid:
        raise ParameterError(
            "must be times within one period", field="switch_times", value=switch_times, allowed=f"[0, {period:g})"
        )
    return np.unique(np.concatenate([[0.0], switches, [period]]))
