"""Interfaces of a periodic system: required members (:class:`SystemLike`, :class:`Autonomous`) and others.

The optional members are those of :class:`Capabilities`. A missing one and one that is None are the same, so instances
of one class may differ (as those of :class:`chilopod.stability.PeriodicSystem`).

Throughout, n is the number of states; times are in the unit of the system's period, states in its own units; a
derivative has the derivative of state i with respect to state j at the start in row i, column j.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import itertools
from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any, Protocol, TypeGuard, TypeVar, cast, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ChilopodError, ParameterError, in_words
from chilopod.flows import deadline
from chilopod.flows.arguments import UserCode, UserError, numbers, shape_of
from chilopod.flows.carrying import numerical_balance
from chilopod.frozen import Array


@runtime_checkable
class SystemLike(Protocol):
    """A T-periodic system dx/dt = f(t, x), f(t + T, x) = f(t, x), given by its flow, which every analysis needs.

    A system that does not depend on time has no period of its own: see :class:`Autonomous`.
    """

    @property
    def dimension(self) -> int:
        """Number of states n."""

    @property
    def period(self) -> float | None:
        """Period T; None if the system does not depend on time and the period belongs to the orbit."""

    @property
    def symmetry(self) -> Array | None:
        """Matrix S, shape (n, n), of finite order k with S f(t + T/k, x) = f(t, S x), or None. H = S flow(T/k) is then
        a return map. The order is 2 unless the system has a ``symmetry_order``."""

    def flow(self, x: Array, t0: float, t1: float, /) -> tuple[Array, Array]:
        """State at t1, shape (n,), and its derivative with respect to the state x at t0, shape (n, n)."""


Family = Callable[[float], SystemLike]
"""The system at a value of a parameter."""

Search = TypeVar("Search", bound=Callable[..., Any])


@runtime_checkable
class Autonomous(SystemLike, Protocol):
    """Systems that do not depend on time: the period of an orbit is an unknown, and every instant may be time 0."""

    @property
    def guess_period(self) -> float:
        """Approximate period of an orbit."""

    def velocity(self, x: Array, /) -> Array:
        """dx/dt at state x, shape (n,)."""


class Capabilities(Autonomous, Protocol):
    """Every member that a system may have; the analyses use each one that is there."""

    @property
    def symmetry_order(self) -> int:
        """The smallest k > 1 with S^k = 1, for a symmetry such as the shift along a ring of oscillators; else 2."""

    @property
    def scale(self) -> Array | None:
        """Positive sizes of large changes of the states, shape (n,); else the orbit determines them."""

    @property
    def orbit(self) -> Array | None:
        """State on the orbit at time 0, in place of a guess. It is corrected if it does not return to round-off."""

    @property
    def spatial_symmetry(self) -> Array | None:
        """A matrix P, shape (n, n), with P f(t, x) = f(t, P x), or several that generate a finite group, shape
        (generators, n, n). Such symmetries, as a reflection, identify pitchforks, if all of a family have them."""

    def flow_with_error(self, x: Array, t0: float, t1: float, /) -> tuple[Array, Array, float | Array]:
        """As :meth:`SystemLike.flow`, and a bound on the absolute error of the derivative: of every entry, shape
        (n, n), or one number for all, which is wide where units differ. Else a second computation estimates it."""

    def flow_states(self, states: Array, t0: float, t1: float, /) -> Array:
        """States at t1 of those at t0, shape (states, n) both, without derivatives."""

    def flow_tangents(self, x: Array, directions: Array, t0: float, t1: float, /) -> tuple[Array, Array]:
        """State at t1, shape (n,), and its derivative times the directions, shape (n, any number) as they."""

    def flow_many(self, systems: Sequence[Any], t0: float, t1: float, /) -> tuple[Array, Array]:
        """Derivatives on known orbits of systems of this class, shape (systems, n, n), and bounds, shape (systems,)."""

    def can_flow_with(self, other: Any, /) -> bool:
        """True if :meth:`flow_many` may take another system of this class along with this one."""

    def is_stiff(self, x: Array, t0: float, t1: float, /) -> bool:
        """True if the derivative of the flow does not resolve a direction that vanishes within a step."""

    def flow_volume(self, x: Array, t0: float, t1: float, /) -> tuple[float, float]:
        """Logarithm of the growth of volume from state x at t0 to t1, and a bound on its error; for stiff systems."""

    def velocity_series(self, curves: Array, /) -> Array:
        """Taylor coefficients in s of f(x(s)), shape (curves, orders, n), along curves x(s) = c0 + c1 s + ... with
        these coefficients, of the same shape; else differences are used."""

    def flow_events(self, x: Array, t0: float, t1: float, /) -> Array:
        """Numbers of passages of all events and switches from state x at t0 to t1, none for a system
        without any; else no grazing is noticed."""


def offers(system: object, member: str) -> TypeGuard[Capabilities]:
    """True if a system has an optional member."""
    return getattr(system, member, None) is not None


def is_autonomous(system: SystemLike) -> TypeGuard[Autonomous]:
    """True if a system does not depend on time."""
    return system.period is None and offers(system, "velocity") and offers(system, "guess_period")


def is_stiff(system: SystemLike, x: Array, duration: float) -> TypeGuard[Capabilities]:
    """True if a return from state x at time 0 contracts some directions more than its derivative resolves."""
    return offers(system, "flow_volume") and offers(system, "is_stiff") and system.is_stiff(x, 0.0, duration)


def checked_flow(
    system: SystemLike, x: Array, t0: float, t1: float, with_error: bool = False, compared: bool | None = None
) -> Any:
    """The flow and its derivative, checked, with the bound on its error if wanted; a SpentError after a limit. The
    derivative of a return is ``compared`` with differences, by default the first in a call of an analysis."""
    deadline.check()
    name, n = "flow_with_error" if with_error else "flow", x.size
    function = getattr(system, name)
    with UserCode(name), np.errstate(all="ignore"):  # values that are not finite are refused
        found: Any = function(np.array(x), t0, t1)  # a system may write into its argument
    if not (isinstance(found, tuple | list) and len(found) == 2 + with_error):
        what = "(state, derivative, error)" if with_error else "(state, derivative)"
        raise ParameterError(f"must return {what}", field="flow", value=type(found).__name__)
    state, derivative = found[:2]
    usual = type(state) is type(derivative) is np.ndarray and state.dtype == derivative.dtype == np.float64
    if not (usual and state.shape == (n,) and derivative.shape == (n, n)):
        state, derivative = numbers(state, (n,), name), numbers(derivative, (n, n), name)
    else:  # the function may return the same arrays at every call
        state, derivative = state.copy(), derivative.copy()
    if compared is not False and _is_long(system, t1 - t0) and is_due(function, with_error or compared is True):
        scale = getattr(system, "scale", None)
        compare(lambda x: checked_flow(system, x, t0, t1, with_error, False)[0], x, state, derivative, name, scale)
    if not with_error:
        return state, derivative
    error = numbers(found[2], (n, n) if shape_of(found[2]) else (), name)
    return state, derivative, error if error.ndim else float(error)


def spatial_symmetries(system: SystemLike) -> tuple[Array, ...]:
    """Generators of the spatial symmetries; may be empty."""
    given = getattr(system, "spatial_symmetry", None)
    return () if given is None else (given,) if given.ndim == 2 else tuple(given)


def returns_per_period(system: SystemLike) -> int:
    """Number of returns in one period: the order of the symmetry, 1 without one."""
    return 1 if system.symmetry is None else int(getattr(system, "symmetry_order", None) or 2)


def _is_long(system: SystemLike, duration: float) -> bool:
    """True for half of a return or more, which has its events."""
    period = system.guess_period if is_autonomous(system) else system.period
    return period is not None and 2.0 * duration * returns_per_period(system) >= period


_SYSTEM = "a system from `from_rhs` or `from_map`, or a PeriodicSystem"


def check_system(system: object, field: str = "system", value: object = None) -> None:
    """Check that an argument is a system or, at a value of the parameter, that a family returned one."""
    if not all(hasattr(system, name) for name in ("dimension", "period", "symmetry", "flow")):
        said = "must be a system" if field == "system" else f"must return a system, not {type(system).__name__}"
        raise ParameterError(said, field=field, value=system if field == "system" else value, allowed=_SYSTEM)


def system_of(family: Callable[..., SystemLike], *values: float) -> SystemLike:
    """System of a family at values of its parameters; raises a ChilopodError if there is none."""
    value = values[0] if len(values) == 1 else values
    with UserCode("family", value):
        system = family(*values)
    check_system(system, "family", value)
    return system


_PART = 1.0 / 16.0  # part of a return
_TINY = 1e-12  # size, relative to the largest, that may be rounding
_ERRORS = 100.0  # factor on the error of a flow and its derivative below which they may be rounding
_SWEEPS = 3


def check_finite(*results: Array) -> None:
    """Refuse results of a flow that are not finite."""
    if not all(np.isfinite(each).all() for each in results):
        raise AnalysisError("the flow is not finite over one return", field="flow")


def sizes(system: SystemLike, x: Array, duration: float) -> Array:
    """Large size of every state, shape (n,): the system's own, or the larger of its value and its change within a part
    of the return when the others are disturbed by their own sizes.

    So the coupling gives the size of a state that passes through zero or rests there. (At the end of the return
    strongly damped states would not depend on the others.) Of an orbit that is zero throughout only ratios matter.
    """
    given = getattr(system, "scale", None)
    if given is not None:
        return given
    later, derivative = checked_flow(system, x, 0.0, _PART * duration)
    check_finite(later, derivative)
    size = np.maximum(np.abs(x), np.abs(later))
    if not size.any():
        if not (derivative - np.diag(np.diag(derivative))).any():  # a map has no parts
            derivative = checked_flow(system, x, 0.0, duration)[1]
            check_finite(derivative)
        return numerical_balance(derivative)
    size = _coupled(size, derivative)
    if size[size > 0.0].min() < _TINY * size.max() and offers(system, "flow_with_error"):
        # Of a state that rests at zero the flow may compute nothing but rounding.
        with UserCode("flow_with_error"):
            later, derivative, error = system.flow_with_error(x.copy(), 0.0, _PART * duration)
        error = _ERRORS * np.broadcast_to(error, derivative.shape)
        later = np.where(np.abs(later) > error @ np.abs(x), np.abs(later), 0.0)
        size = _coupled(np.maximum(np.abs(x), later), np.where(np.abs(derivative) > error, derivative, 0.0))
    return np.where(size > 0.0, size, size[size > 0.0].min())


def _coupled(size: Array, derivative: Array) -> Array:
    """Sizes of states, shape (n,), no smaller than their changes when the others change by their sizes."""
    coupling = np.abs(derivative)
    np.fill_diagonal(coupling, 0.0)
    for _ in range(_SWEEPS):
        size = np.maximum(size, (coupling * size).max(axis=1))
    return size


_ROUNDING = 8.0 * float(np.finfo(float).eps)
_STEPS = 1e-5, 1e-7, 1e-9  # steps of differences, relative to each state
_FARTHER = 10.0 ** np.arange(-3.0, 8.0, 2.0)  # those at which a state near zero is not lost in the rounding of terms
_CONTRADICTS = 1e-3  # least relative error of a derivative that is refused
_CURVED = 2.0  # largest error of a difference, relative to its change at a shorter step, that may be curvature
_ROUNDED = 1e-12  # error of an entry, relative to the largest, each in units of the states, that may be rounding
_OWN = __name__.partition(".")[0]


def _code(function: Any) -> object:
    """Code of a function, also of a partial one; the class of another callable object."""
    while isinstance(function, functools.partial):
        function = function.func
    return getattr(function, "__code__", type(function))


def is_due(function: Any, always: bool = False) -> bool:
    """True if a user's function must be compared: at the first use of its code within an analysis, or ``always``."""
    own = str(getattr(function, "__module__", "")).partition(".")[0] == _OWN
    return not own and (deadline.is_first(_code(function)) or always)


def compare(
    mapped: Callable[[Array], Array], x: Array, state: Array, derivative: Array, field: str, scale: ArrayLike | None
) -> None:
    """Compare a derivative with differences: along one direction and, if these contradict it, entry by entry.

    Those to both sides differ by curvature, noise or a kink: a smaller error is not refused. Nor is one that vanishes
    at longer steps: near zero the terms of a function may be far larger than the state, and round accordingly; nor one
    that vanishes with the step, as the cube of a state does.
    """
    largest = float(np.abs(x).max()) or 1.0
    steps, one = np.where(x != 0.0, np.abs(x), largest if scale is None else scale), np.eye(x.size)

    def compared(shift: Array) -> tuple[NDArray[np.bool_], Array]:
        with np.errstate(all="ignore"):
            up, down = mapped(x + shift), mapped(x - shift)
            change = 0.5 * (up - down)
            uncertain = 4.0 * np.abs(up - 2.0 * state + down) + _ROUNDING * x.size * (np.abs(up) + np.abs(down))
            terms = np.abs(derivative) @ np.abs(shift) + np.abs(change)
            uncertain += _CONTRADICTS * terms + _ROUNDED * terms.max()
            return np.abs(change - derivative @ shift) > uncertain, change

    def agrees(i: int, shift: Array) -> bool:
        with contextlib.suppress(ChilopodError):  # an edge of the function's domain
            change, given = compared(shift)[1][i], (derivative @ shift)[i]
            return bool(abs(change - given) <= _CONTRADICTS * abs(change))
        return False

    try:
        if not compared(_STEPS[0] * steps * np.cos(3.0 * np.arange(x.size) + 1.0))[0].any():
            return
        columns = [[compared(step * shift) for step in _STEPS] for shift in one * steps]
    except ChilopodError:  # an edge of the function's domain
        return
    for j, column in enumerate(columns):
        wrong = np.all([each for each, _ in column], axis=0)
        for i in np.flatnonzero(wrong).tolist():
            if any(agrees(i, step * one[j]) for step in (*_FARTHER * steps[j], *np.array(_STEPS) * largest)):
                continue
            given = derivative[i, j]
            slopes = [change[i] / (step * steps[j]) for (_, change), step in zip(column, _STEPS, strict=True)]
            curved = all(abs(a - given) <= _CURVED * abs(a - b) for a, b in itertools.pairwise(slopes))
            if curved and (x[j] != 0.0 or abs(slopes[0]) * steps[j] <= steps[i]):
                continue
            said = f"derivative entry ({i}, {j}) is {given:g}, but a difference gives {slopes[0]:g}"
            smaller = f"a smaller `scale` of the states, as a state of 0 is disturbed by {_STEPS[0] * steps[j]:g}"
            allowed = smaller if curved else "d state[i] / d x[j]"
            raise ParameterError(said, field=field, value=x.tolist(), allowed=allowed)


_KEPT = 64  # cached systems: those around a point are used repeatedly


class CheckedFamily:
    """The systems of a family, which must be of one kind."""

    def __init__(self, family: Family) -> None:
        self.dimension = 0  # 0 until a system is known
        self.timed = True  # they depend on time
        self._system = functools.lru_cache(_KEPT)(functools.partial(system_of, family))
        self._refused: dict[str, tuple[str, set[float]]] = {}

    def __call__(self, value: float) -> SystemLike:
        """The system at a value of the parameter."""
        with self.calling(value):
            system = self._system(value)
        kind = system.dimension, not is_autonomous(system)
        if self.dimension == 0:
            self.dimension, self.timed = kind
        if kind != (self.dimension, self.timed):
            what = "dimension" if system.dimension != self.dimension else "kind of period"
            self._refuse(value, what, f"the family changes its {what}")
            raise AnalysisError(f"changes its {what} at {value:g}", field="family", allowed="systems of one kind")
        return system

    @contextlib.contextmanager
    def calling(self, value: float) -> Iterator[None]:
        """Context of calls of the user's functions: an exception means that the system does not exist."""
        try:
            with UserCode("family", value):
                yield
        except (UserError, ParameterError) as error:
            if not self.dimension:
                raise
            cause = (isinstance(error, UserError) and error.__cause__) or error
            self._refuse(value, type(cause).__name__, f"the family raised {in_words(cause)}")
            raise UserError(error.problem, field=error.field, value=error.value, allowed=error.allowed) from cause

    @property
    def remarks(self) -> list[str]:
        """Remarks on values without a system, with the reason, a sentence each."""
        return [
            said + (f", and at {len(values) - 1} more values" if len(values) > 1 else "")
            for said, values in self._refused.values()
        ]

    def _refuse(self, value: float, kind: str, why: str) -> None:
        self._refused.setdefault(kind, (f"{why} at {value:.9g}", set()))[1].add(value)


class _Fewer(BaseException):
    """Signal that a system lacks a symmetry of those before it; no error, which might count as a missing orbit."""


class _Sharing:
    """The systems of a family with the symmetries that all so far have: that of one alone does not hold beside it."""

    _shared: tuple[int, tuple[Array, ...]] | None = None  # returns in a period, and generators in space

    def __init__(self, family: Callable[..., Any]) -> None:
        self._family = family

    def __call__(self, *values: float) -> Any:
        system = system_of(self._family, *values)
        returns, own = returns_per_period(system), spatial_symmetries(system)
        before, known = self._shared = self._shared or (returns, own)
        kept = tuple(each for each in known if any(np.array_equal(each, other) for other in own))
        if returns != before > 1 or len(kept) < len(known):
            self._shared = before if returns == before else 1, kept
            raise _Fewer(self)
        if returns == before and len(own) == len(kept):
            return system
        members = {name: getattr(system, name, None) for name in dir(Capabilities) if name[0] != "_"}
        members["symmetry"] = system.symmetry if before > 1 else None
        members |= {"spatial_symmetry": np.array(kept) if kept else None, "flow_many": None}  # for systems of one class
        return SimpleNamespace(**members)


def with_shared_symmetries(search: Search) -> Search:
    """A search along a family, its first argument, that starts anew without a symmetry where a system lacks it."""

    @functools.wraps(search)
    def sharing(*args: Any, **kwargs: Any) -> Any:
        given = inspect.signature(search).bind(*args, **kwargs)
        name, family = next(iter(given.arguments.items()))
        limit = deadline.Deadline(given.arguments.get("seconds", np.inf))
        given.arguments[name] = shared = _Sharing(family) if callable(family) else family
        while True:
            try:
                return search(*given.args, **given.kwargs)
            except _Fewer as signal:
                if signal.args[0] is not shared:  # but of an outer search
                    raise
            given.arguments["seconds"] = limit.remaining

    return cast(Search, sharing)
