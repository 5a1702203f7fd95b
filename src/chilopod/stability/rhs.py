"""A periodic system from its right-hand side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.flows.arguments import check_symmetry, positive
from chilopod.flows.events import Event
from chilopod.flows.rhs import TOLERANCE, Method, RightHandSide
from chilopod.stability.problem.capabilities import spatial_symmetries
from chilopod.stability.problem.system import PeriodicSystem

_TIMES = np.array([0.01, 0.023])  # in periods: just after its start, as a pulse may be given for one period alone


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
    ``numba.njit``; a family over parameters (arguments, closures or globals that are floats) is traced once, or, if it
    branches on them, at every value. Jumps and kinks (``sign``, ``abs``, ``where``, ``%``, comparisons, ...) are found
    and crossed exactly, in time and in state. A pulse in time narrower than about T / 50 000 may be missed.

    A stiff system, whose fastest decay is much faster than its motion, is integrated by an implicit method, Radau IIA
    collocation with the exact derivative of its steps. A function that branches on its arguments (``if x[0] > 0``) or
    calls other libraries cannot be traced: scipy's DOP853 integrates it from calls, hundreds of times slower.

    Parameters
    ----------
    rhs
        Function ``rhs(t, x, *args)`` -> dx/dt, shape (n,); T-periodic in t.
        dimension, period
        Number of states n, and T; None if ``rhs`` does not depend on t and the period belongs to the orbit.
    args
        Parameters of the right-hand side.
    events
        Events at which the state jumps, or the right-hand side switches, on reaching a surface. They need functions
        that can be traced.
    switch_times
        Times in [0, T) at which ``rhs`` jumps or has a kink. A traced function needs none; others are evaluated
        strictly inside each interval, and undeclared jumps cost time and digits.
    jacobian
        Function ``jacobian(t, x, *args)`` -> (n, n), for functions that cannot be traced; without it the derivative
        then comes from a complex step or, if ``rhs`` does not accept complex states, from central differences, with
        about nine digits.
    symmetry, spatial_symmetry, orbit, scale, guess_period
        See :class:`PeriodicSystem`. Without a period ``guess_period`` must be given, and ``orbit`` may be a
        guess.
    method
        "taylor" or "implicit", for functions that can be traced; "automatic": Taylor series, and the implicit method
        after these take too many steps, a second or two for every system. The implicit method suits smooth functions of
        the state without events, and some tens of states.
    tolerance
        Local error per step, relative to the size of each state.

    Warns
    -----
    UndeclaredSwitch
        If a right-hand side that cannot be traced jumps at other times than ``switch_times``.
    NotAnalytic
        If the derivative of such a function needs differences.
    """
    autonomous = period is None
    length = positive("guess_period" if autonomous else "period", guess_period if autonomous else period)
    given = RightHandSide(
        rhs, dimension, length, autonomous, args, events, switch_times, jacobian, orbit, method, tolerance
    )
    slopes, members = given.flows()
    members |= {"scale": scale, "symmetry": symmetry, "spatial_symmetry": spatial_symmetry}
    system = PeriodicSystem(
        dimension=given.dimension,
        period=None if autonomous else length,
        velocity=(lambda x: slopes(np.zeros(1), x[:, None])[:, 0]) if autonomous else None,
        guess_period=length if autonomous else None,
        orbit=given.start,
        **members,
    )
    if not autonomous:
        check_symmetry("period", np.eye(given.dimension), length, slopes, _TIMES * length, given.base, np.inf)
    if not given.events:  # a symmetry would also have to hold for these
        if system.symmetry is not None:
            shift = 0.0 if autonomous else length / system.symmetry_order
            check_symmetry("symmetry", system.symmetry, shift, slopes, given.times, given.base, length)
        for matrix in spatial_symmetries(system):
            check_symmetry("spatial_symmetry", matrix, 0.0, slopes, given.times, given.base, length)
    return system
