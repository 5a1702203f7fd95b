"""Required and optional interfaces of a periodic system.

Every capability is a protocol: a system implements it through its methods. The analyses test it by ``isinstance``, or
by the functions at the end of this module for protocols with one member. A member that is None counts as missing, so
instances of one class may differ (as those of :class:`chilopod.stability.PeriodicSystem`). Methods and properties must
exist on the system or its class: from Python 3.12 on, ``isinstance`` ignores the results of ``__getattr__``.

Throughout, n is the number of states; times are in the unit of the system's period, states in its own units; a
derivative has the derivative of state i with respect to state j at the start in row i, column j.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, Self, TypeGuard, runtime_checkable

import numpy as np

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows import deadline
from chilopod.flows.arguments import UserCode, numbers, shape_of
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
        """Matrix S, shape (n, n), of finite order k with S f(t, x) = f(t + T/k, S x), or None. H = S flow(T/k) is then
        a return map. The order is 2 unless the system is :class:`CyclicallySymmetric`."""

    def flow(self, x: Array, t0: float, t1: float, /) -> tuple[Array, Array]:
        """State at t1, shape (n,), and its derivative with respect to the state x at t0, shape (n, n)."""


Family = Callable[[float], SystemLike]
"""The system at a value of a parameter."""


@runtime_checkable
class Autonomous(SystemLike, Protocol):
    """Systems that do not depend on time: the period of an orbit is an unknown, and every instant may be time 0."""

    @property
    def guess_period(self) -> float:
        """Approximate period of an orbit."""

    def velocity(self, x: Array, /) -> Array:
        """dx/dt at state x, shape (n,)."""


@runtime_checkable
class ExpandsVelocity(Autonomous, Protocol):
    """Systems that know their right-hand side f with all derivatives; else differences are used."""

    def velocity_series(self, curves: Array, /) -> Array:
        """Taylor coefficients in s of f(x(s)), shape (curves, orders, n), along curves x(s) = c0 + c1 s + ... with
        these coefficients, of the same shape."""


@runtime_checkable
class CyclicallySymmetric(Protocol):
    """Systems with a symmetry of another order than 2, such as the shift along a ring of oscillators."""

    @property
    def symmetry_order(self) -> int:
        """The smallest k > 1 with S^k = 1."""


@runtime_checkable
class Scaled(Protocol):
    """Systems that define a large change of every state, in its own unit; else the orbit determines it."""

    @property
    def scale(self) -> Array | None:
        """Positive sizes of the states, shape (n,); or None."""


@runtime_checkable
class KnowsOrbit(Protocol):
    """Systems that know their periodic orbit, so that no guess is needed."""

    @property
    def orbit(self) -> Array | None:
        """State on the orbit at time 0, shape (n,); or None. It is corrected if it does not return to round-off."""


@runtime_checkable
class SpatiallySymmetric(Protocol):
    """Systems with symmetries that hold at every instant, such as a reflection, which identify pitchforks."""

    @property
    def spatial_symmetry(self) -> Array | None:
        """A matrix P, shape (n, n), with P f(t, x) = f(t, P x), or several that generate a finite group, shape
        (generators, n, n); or None."""


@runtime_checkable
class FlowsWithError(Protocol):
    """Systems that bound the error of their flow; else a second computation estimates it."""

    def flow_with_error(self, x: Array, t0: float, t1: float, /) -> tuple[Array, Array, float | Array]:
        """As :meth:`SystemLike.flow`, and a bound on the absolute error of the derivative: of every entry, shape
        (n, n), or one number for all of them, which is wide where states have different units."""


@runtime_checkable
class FlowsStates(Protocol):
    """Systems that carry many states together; else each flow is computed separately."""

    def flow_states(self, states: Array, t0: float, t1: float, /) -> Array:
        """States at t1 of those at t0, shape (states, n) both, without derivatives."""


@runtime_checkable
class FlowsTangents(SystemLike, Protocol):
    """Systems that carry some directions instead of the full derivative, which suffices for large systems."""

    def flow_tangents(self, x: Array, directions: Array, t0: float, t1: float, /) -> tuple[Array, Array]:
        """State at t1, shape (n,), and its derivative with respect to the state x at t0, times the directions, shape
        (n, any number) as they."""


@runtime_checkable
class FlowsMany(KnowsOrbit, Protocol):
    """Systems that compute derivatives along the known orbits of many systems of their class together, for sweeps."""

    def can_flow_with(self, other: Self, /) -> bool:
        """True if :meth:`flow_many` may take the other system along with this one."""

    def flow_many(self, systems: Sequence[Self], t0: float, t1: float, /) -> tuple[Array, Array]:
        """Derivatives of the flow on the known orbits, shape (systems, n, n), and bounds as in
        :class:`FlowsWithError`, shape (systems,)."""


@runtime_checkable
class FlowsVolumes(SystemLike, Protocol):
    """Systems that resolve the decay of volumes where a direction vanishes within a step of the integration."""

    def is_stiff(self, x: Array, t0: float, t1: float, /) -> bool:
        """True if the derivative of the flow from state x at t0 to t1 does not resolve such a direction."""

    def flow_volume(self, x: Array, t0: float, t1: float, /) -> tuple[float, float]:
        """Logarithm of the growth of volume from state x at t0 to t1, and a bound on its error."""


def is_autonomous(system: SystemLike) -> TypeGuard[Autonomous]:
    """True if a system does not depend on time."""
    # These functions equal ``isinstance`` and are twenty times as fast.
    members = getattr(system, "velocity", None), getattr(system, "guess_period", None)
    return system.period is None and None not in members


def flows_with_error(system: SystemLike) -> TypeGuard[FlowsWithError]:
    """True if a system bounds the error of its flow."""
    return getattr(system, "flow_with_error", None) is not None


def expands_velocity(system: SystemLike) -> TypeGuard[ExpandsVelocity]:
    """True if a system knows its right-hand side with all derivatives."""
    return getattr(system, "velocity_series", None) is not None


def is_stiff(system: SystemLike, x: Array, duration: float) -> TypeGuard[FlowsVolumes]:
    """True if a return from state x at time 0 contracts some directions more than its derivative resolves."""
    return getattr(system, "flow_volume", None) is not None and system.is_stiff(x, 0.0, duration)  # type: ignore[attr-defined]


def flows_states(system: SystemLike) -> TypeGuard[FlowsStates]:
    """True if a system carries many states together."""
    return getattr(system, "flow_states", None) is not None


def flows_tangents(system: SystemLike) -> TypeGuard[FlowsTangents]:
    """True if a system carries directions instead of the full derivative."""
    return getattr(system, "flow_tangents", None) is not None


def checked_flow(system: SystemLike | FlowsWithError, x: Array, t0: float, t1: float, with_error: bool = False) -> Any:
    """The flow and its derivative of the right shapes, with the system's own bound on its error if wanted; a SpentError
    after a time limit."""
    deadline.check()
    name, n = "flow_with_error" if with_error else "flow", x.size
    with UserCode(name):
        found: Any = getattr(system, name)(np.array(x), t0, t1)  # a system may write into its argument
    if not (isinstance(found, tuple | list) and len(found) == 2 + with_error):
        what = "(state, derivative, error)" if with_error else "(state, derivative)"
        raise ParameterError(f"must return {what}", field="flow", value=type(found).__name__)
    state, derivative = found[:2]
    usual = type(state) is type(derivative) is np.ndarray and state.dtype == derivative.dtype == np.float64
    if usual and not with_error and state.shape == (n,) and derivative.shape == (n, n):
        return found
    shapes = [shape_of(each) for each in found]
    if shapes[:2] != [(n,), (n, n)] or shapes[2:] not in ([], [()], [(n, n)]):
        said = f"gives shapes {' and '.join(map(str, shapes))}"
        raise AnalysisError(said, field="flow", allowed=f"({n},) and ({n}, {n})")
    parts = [numbers(each, np.shape(each), "flow") for each in found]
    return tuple(each if each.ndim else float(each) for each in parts)


def known_orbit(system: SystemLike) -> Array | None:
    """The system's own state on its orbit (see :class:`KnowsOrbit`), or None."""
    return getattr(system, "orbit", None)


def given_scale(system: SystemLike) -> Array | None:
    """The system's own sizes of its states (see :class:`Scaled`), or None."""
    return getattr(system, "scale", None)


def spatial_symmetries(system: SystemLike) -> tuple[Array, ...]:
    """Generators of the spatial symmetries of a system (see :class:`SpatiallySymmetric`); may be empty."""
    given = getattr(system, "spatial_symmetry", None)
    if given is None:
        return ()
    return (given,) if given.ndim == 2 else tuple(given)


def returns_per_period(system: SystemLike) -> int:
    """Number of returns in one period: the order of the symmetry, 1 without one."""
    if system.symmetry is None:
        return 1
    return int(getattr(system, "symmetry_order", 2))
