"""A periodic system of one's own, the return map of any system, and its fixed points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.arguments import finite_array
from chilopod.stability.capabilities import (
    FlowsMany,
    FlowsStates,
    FlowsWithError,
    KnowsOrbit,
    SystemLike,
    spatial_symmetry,
)

Array = NDArray[np.float64]

_RETURNS = 1e-6
"""How far from its start a known orbit may come back, relative to its size and to how errors grow."""

Flow = Callable[[Array, float, float], tuple[Array, Array]]
"""``flow(x, t0, t1) -> (state at t1, its derivative with respect to x)``, shapes (n,) and (n, n)."""


@dataclass(frozen=True)
class PeriodicSystem(ReadOnlyArrays):
    """A periodic system of one's own, from anything that has a flow.

    To start from a right-hand side, see :func:`chilopod.stability.from_rhs`.

    Parameters
    ----------
    dimension
        Number of states n.
    period
        T, positive.
    flow
        ``flow(x, t0, t1) -> (x1, dx1/dx)``.
    symmetry
        Optional S, shape (n, n), with S f(t, x) = f(t + T/2, S x): then the orbits with S x(T/2) = x(0) are fixed
        points of the half-period map H = S flow(T/2), whose multipliers nu square to those of the full period.
    spatial_symmetry
        Optional P, shape (n, n), with P f(t, x) = f(t, P x), such as a reflection.
    orbit
        A state at time 0 on the periodic orbit, if it is known exactly.
    """

    dimension: int
    period: float
    flow: Flow
    symmetry: Array | None = None
    spatial_symmetry: Array | None = None
    orbit: Array | None = None
    flow_with_error: Callable[[Array, float, float], tuple[Array, Array, float]] | None = field(
        default=None, repr=False
    )
    flow_states: Callable[[Array, float, float], Array] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.dimension < 1:
            raise ParameterError("must be at least 1", field="dimension", value=self.dimension)
        if not (np.isfinite(self.period) and self.period > 0):
            raise ParameterError("must be positive and finite", field="period", value=self.period)
        object.__setattr__(self, "symmetry", self._involution("symmetry", self.symmetry))
        object.__setattr__(self, "spatial_symmetry", self._involution("spatial_symmetry", self.spatial_symmetry))
        if self.orbit is not None:
            object.__setattr__(self, "orbit", np.asarray(self.orbit, dtype=np.float64))
        super().__post_init__()

    def _involution(self, name: str, matrix: ArrayLike | None) -> Array | None:
        if matrix is None:
            return None
        matrix = np.array(matrix, dtype=np.float64)
        if matrix.shape != (self.dimension, self.dimension):
            raise ParameterError(
                "has the wrong shape", field=name, value=matrix.shape, allowed=f"({self.dimension}, {self.dimension})"
            )
        if not np.allclose(matrix @ matrix, np.eye(self.dimension)):
            raise ParameterError("must be its own inverse: applied twice it gives every state back", field=name)
        return matrix


@dataclass(frozen=True)
class ReturnMap(ReadOnlyArrays):
    """One evaluation of the return map at a state.

    Attributes
    ----------
    state
        H(x), shape (n,).
    jacobian
        dH/dx, shape (n, n).
    error
        Bound on the error of the largest entry of ``jacobian``; NaN if it was not asked for.
    halves
        2 if H = S flow(T/2), 1 if H = flow(T): the full period is H applied so many times.
    """

    state: Array
    jacobian: Array
    error: float
    halves: int


def halves(system: SystemLike) -> int:
    """How many applications of the return map make one period: 2 with the half-period symmetry, else 1."""
    return 1 if system.symmetry is None else 2


class _WholePeriod:
    """A system as it is, but without its half-period symmetry and its known orbit."""

    symmetry = None

    def __init__(self, system: SystemLike) -> None:
        self.dimension = system.dimension
        self.period = system.period
        self.flow = system.flow
        self.spatial_symmetry = spatial_symmetry(system)
        self.flow_with_error = system.flow_with_error if isinstance(system, FlowsWithError) else None
        self.flow_states = system.flow_states if isinstance(system, FlowsStates) else None


def whole_period(system: SystemLike) -> SystemLike:
    """The same system for the analysis of orbits that do not have its half-period symmetry."""
    return _WholePeriod(system)


def flow_with_error(system: SystemLike, x: Array, t0: float, t1: float) -> tuple[Array, Array, float]:
    """The flow with an error bound; where the system gives none, one is estimated by taking the interval in parts.

    A step-controlled integrator makes independent errors in the two computations, so ten times their difference is a
    sound bound; a flow of fixed steps that ignores how it is called cannot be seen through this way and should bring
    its own.
    """
    if isinstance(system, FlowsWithError):
        state, derivative, error = system.flow_with_error(x, t0, t1)
        return state, derivative, float(error)
    state, derivative = system.flow(x, t0, t1)
    _check_shapes(state, derivative, x.size)
    # Cut near the start as well, or the steps up to the cut would be the same, errors included.
    times = [t0 + part * (t1 - t0) for part in (0.0, 0.0477, 0.382)] + [t1]
    passing, product = x, np.eye(x.size)
    for a, b in zip(times, times[1:], strict=False):
        passing, factor = system.flow(passing, a, b)
        product = factor @ product
    size = _size(derivative)
    return state, derivative, 10.0 * float(np.abs(product - derivative).max()) + 1e-15 * size


def _check_shapes(state: Array, derivative: Array, n: int) -> None:
    if np.shape(state) != (n,) or np.shape(derivative) != (n, n):
        raise AnalysisError(
            f"gives shapes {np.shape(state)} and {np.shape(derivative)}", field="flow", allowed=f"({n},) and ({n}, {n})"
        )


def return_map(system: SystemLike, x: ArrayLike, with_error: bool = True) -> ReturnMap:
    """Evaluate the return map H and its derivative at a state.

    Parameters
    ----------
    system, x
        The system and a state at time 0, shape (n,).
    with_error
        Whether to bound the error as well, which may cost a second computation; without, ``error`` is NaN.

    Raises
    ------
    AnalysisError
        If the flow gives anything that is not finite.
    """
    x = np.array(x, dtype=np.float64)  # a system may write into what it is given
    n = system.dimension
    if x.shape != (n,):
        raise ParameterError("has the wrong shape", field="orbit", value=x.shape, allowed=f"({n},)")
    count = halves(system)
    error = np.nan
    if with_error:
        state, jacobian, error = flow_with_error(system, x, 0.0, system.period / count)
    else:
        state, jacobian = system.flow(x, 0.0, system.period / count)
    _check_shapes(state, jacobian, n)
    if system.symmetry is not None:
        state, jacobian = system.symmetry @ state, system.symmetry @ jacobian
    if not (np.isfinite(state).all() and np.isfinite(jacobian).all()):
        raise AnalysisError("the flow is not finite over one return", field="flow")
    return ReturnMap(state, jacobian, error, count)


def return_maps(systems: Sequence[SystemLike]) -> list[ReturnMap]:
    """The return maps of many systems at their known orbits, together where they can."""
    first = systems[0]
    if len(systems) == 1 or not isinstance(first, FlowsMany):
        return [_known_return(system)[1] for system in systems]
    alike = [system for system in systems if isinstance(system, type(first)) and first.can_flow_with(system)]
    if len(alike) < len(systems):
        return [_known_return(system)[1] for system in systems]
    count = halves(first)
    jacobians, errors = first.flow_many(alike, 0.0, first.period / count)
    symmetry = np.eye(first.dimension) if first.symmetry is None else first.symmetry
    return [
        ReturnMap(_given(system.orbit), symmetry @ jacobian, float(error), count)
        for system, jacobian, error in zip(alike, jacobians, errors, strict=True)
    ]


def returned_states(system: SystemLike, states: Array) -> Array:
    """H of many states at once, shape (states, n)."""
    duration = system.period / halves(system)
    states = np.array(states)  # a system may write into what it is given
    if isinstance(system, FlowsStates):
        result = np.asarray(system.flow_states(states, 0.0, duration))
    else:
        result = np.array([system.flow(x, 0.0, duration)[0] for x in states])
    if system.symmetry is not None:
        result = result @ system.symmetry.T
    return result


def known_orbit(system: SystemLike) -> Array:
    """The orbit a system knows of itself.

    Raises
    ------
    AnalysisError
        If it knows none.
    """
    return _given(system.orbit if isinstance(system, KnowsOrbit) else None)


def _given(orbit: Array | None) -> Array:
    if orbit is None:
        raise AnalysisError(
            "this system does not know its periodic orbit", field="orbit", allowed="a first guess of it"
        )
    return np.asarray(orbit, dtype=np.float64)


def _known_return(system: SystemLike, with_error: bool = True) -> tuple[Array, ReturnMap]:
    """The orbit a system knows of itself and the return map there, once it is seen to return."""
    x = known_orbit(system)
    image = return_map(system, x, with_error)
    off = float(np.abs(image.state - x).max())
    if not (off <= _RETURNS or off <= _RETURNS * _size(x) * _size(image.jacobian)):
        raise AnalysisError(
            f"is no periodic orbit: one return later the state is {off:.1e} away",
            field="orbit",
            allowed="a state on the orbit at time 0, or as a first guess, which is then improved",
        )
    return x, image


def _size(array: Array) -> float:
    return max(1.0, float(np.abs(array).max()))


def find_orbit(system: SystemLike, guess: ArrayLike | None = None, with_error: bool = True) -> tuple[Array, ReturnMap]:
    """A periodic orbit: a fixed point of the return map, by Newton's method.

    Parameters
    ----------
    system
        The system; one that knows its orbit needs no guess.
    guess
        A state at time 0 near the orbit, shape (n,).
    with_error
        As for :func:`return_map`.

    Returns
    -------
    The state at time 0, and the return map there.

    Raises
    ------
    AnalysisError
        If Newton's method does not converge in 15 steps.
    """
    if guess is None:
        return _known_return(system, with_error)
    x = finite_array(guess, (system.dimension,), "orbit")
    best = np.inf
    for step in range(15):
        image = return_map(system, x, with_error=False)
        residual = image.state - x
        size = float(np.abs(residual).max())
        scale = _size(x)
        # Converged once the residual is at the accuracy of the flow, or has stopped falling close to it.
        if size <= 4e-16 * scale or (size <= 1e-10 * scale and size >= 0.5 * best):
            return x, return_map(system, x) if with_error else image
        if step > 2 and size > 10.0 * best:
            break
        best = min(best, size)
        try:
            x = x - np.linalg.solve(image.jacobian - np.eye(x.size), residual)
        except np.linalg.LinAlgError:
            break
        if not np.isfinite(x).all():
            break
    raise AnalysisError(
        f"no periodic orbit found near the guess (residual {best:.1e})",
        field="orbit",
        allowed="a guess closer to the orbit",
    )
