"""What the analyses need to know of a periodic system, and what more they use where a system has it.

Every capability is a protocol: a system has it by having its methods, and the analyses ask ``isinstance(system,
FlowsStates)``. A method that is None counts as missing, so a class may leave to its instances whether they have it
(:class:`chilopod.stability.PeriodicSystem` does), and so does an orbit or a symmetry that is None. Methods and
properties have to be the system's own, not made up by ``__getattr__``.

Throughout, n is the number of states; times are in the unit of the system's period, states in its own units; a
derivative has the derivative of state i with respect to state j at the start in row i, column j.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@runtime_checkable
class SystemLike(Protocol):
    """A T-periodic system dx/dt = f(t, x), f(t + T, x) = f(t, x), given by its flow: what every analysis needs."""

    @property
    def dimension(self) -> int:
        """Number of states n."""
        ...

    @property
    def period(self) -> float:
        """T."""
        ...

    @property
    def symmetry(self) -> Array | None:
        """A matrix S, shape (n, n), with S f(t, x) = f(t + T/2, S x), so that H = S flow(T/2) is a return map; or
        None."""
        ...

    def flow(self, x: Array, t0: float, t1: float, /) -> tuple[Array, Array]:
        """State at t1, shape (n,), and its derivative with respect to the state x at t0, shape (n, n)."""
        ...


@runtime_checkable
class KnowsOrbit(Protocol):
    """Knows its periodic orbit exactly, so that nobody has to guess and search."""

    @property
    def orbit(self) -> Array | None:
        """State on the orbit at time 0, shape (n,), fixed by the return map to round-off; or None."""
        ...


@runtime_checkable
class SpatiallySymmetric(Protocol):
    """Has a symmetry that holds at every instant, such as a reflection: a pitchfork is then known as one."""

    @property
    def spatial_symmetry(self) -> Array | None:
        """A matrix P, shape (n, n), with P f(t, x) = f(t, P x); or None."""
        ...


@runtime_checkable
class Switches(Protocol):
    """Its right-hand side jumps, or has kinks, at times that are known: its flows stop and start again there."""

    @property
    def switch_times(self) -> Array:
        """Instants in [0, T), rising, shape (switches,)."""
        ...


@runtime_checkable
class FlowsWithError(Protocol):
    """Bounds the error of its flow; of other systems the error is estimated by a second computation."""

    def flow_with_error(self, x: Array, t0: float, t1: float, /) -> tuple[Array, Array, float]:
        """As :meth:`SystemLike.flow`, and a bound on the absolute error of the largest entry of the derivative."""
        ...


@runtime_checkable
class FlowsStates(Protocol):
    """Carries many states at once; other systems are asked for one flow after another."""

    def flow_states(self, states: Array, t0: float, t1: float, /) -> Array:
        """States at t1 of those at t0, shape (states, n) both, without derivatives."""
        ...


@runtime_checkable
class FlowsEach(Protocol):
    """Carries every state by a system of its own: a derivative with respect to a parameter then costs next to
    nothing."""

    def flow_each(self, systems: Sequence[Self], states: Array, t0: float, t1: float, /) -> Array:
        """States at t1, each carried by the system in its place, shape (systems, n) as at t0, without derivatives."""
        ...


@runtime_checkable
class FlowsMany(KnowsOrbit, Protocol):
    """Computes the derivatives along the known orbits of many systems of its class at once: a sweep then uses all
    cores."""

    def can_flow_with(self, other: Self, /) -> bool:
        """Whether :meth:`flow_many` may take the other system along with this one."""
        ...

    def flow_many(self, systems: Sequence[Self], t0: float, t1: float, /) -> tuple[Array, Array]:
        """Derivatives of the flow on the known orbits, shape (systems, n, n), and bounds as in
        :class:`FlowsWithError`, shape (systems,)."""
        ...


def spatial_symmetry(system: SystemLike) -> Array | None:
    """The spatial symmetry of a system (see :class:`SpatiallySymmetric`), None if it has none."""
    return system.spatial_symmetry if isinstance(system, SpatiallySymmetric) else None
