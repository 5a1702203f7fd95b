"""Periodic systems of a user, from a flow, a right-hand side or a map."""

from __future__ import annotations

import functools
import math
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import ParameterError
from chilopod.flows.arguments import LARGEST, Claim, UserCode, checked_count, finite_array, numbers, positive
from chilopod.flows.carrying import REPEATED, numerical_balance
from chilopod.flows.rhs import TOLERANCE, Event, Method, RightHandSide
from chilopod.flows.tracing.trace import Opaque, describe
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.stability.interface import compare, is_due, spatial_symmetries

Flow = Callable[[Array, float, float], tuple[Array, Array]]
"""``flow(x, t0, t1) -> (state at t1, its derivative with respect to x)``, shapes (n,) and (n, n)."""

_MORE = "velocity", "flow_with_error", "flow_states", "flow_tangents", "flow_volume", "is_stiff", "velocity_series"
_HIGHEST_ORDER = 1000
_SAME = 1e-8  # difference of equal matrices, relative to their size
_ROUND_OFF = 1e-7  # relative to the largest entry, in units that balance the matrix: with the above, some last digits


@dataclass(frozen=True, eq=False)
class PeriodicSystem(ReadOnlyArrays):
    """A periodic system defined by its flow.

    To start from a right-hand side, see :func:`chilopod.stability.from_rhs`.

    Parameters
    ----------
    dimension, period
        Number of states n, and period T > 0; None if the system does not depend on time and the period belongs to the
        orbit: ``velocity`` and ``guess_period`` are then needed.
    flow
        Function ``flow(x, t0, t1) -> (x1, dx1/dx)``.
    symmetry
        Optional S, shape (n, n), of finite order k (S applied k times is 1), with S f(t + T/k, x) = f(t, S x): then the
        orbits with S x(T/k) = x(0) are fixed points of the return map H = S flow(T/k), whose multipliers nu give those
        of the full period as nu^k.
    spatial_symmetry
        Optional P, shape (n, n), of finite order, with P f(t, x) = f(t, P x), or several, which generate a group.
    orbit
        State at time 0 on the periodic orbit, if known. It is corrected if it does not return exactly.
    scale
        Size of a large change of every state, shape (n,), instead of the orbit's.
    velocity
        Function ``velocity(x)`` -> dx/dt, shape (n,), for a system that does not depend on time.
    guess_period
        Approximate period of such a system's orbits, or a multiple of it below 100; one from a state gets its
        shortest period, one from a whole orbit that of the guess.
    flow_with_error, flow_states, flow_tangents, flow_volume, is_stiff, velocity_series, flow_events
        See :mod:`chilopod.stability.interface`.
    concurrent
        True if flows may run in several threads at once, which :func:`chilopod.stability.sweep` then does.
    """

    dimension: int
    period: float | None
    flow: Flow
    symmetry: Array | None = None
    spatial_symmetry: Array | None = None
    orbit: Array | None = None
    scale: Array | None = None
    velocity: Callable[[Array], Array] | None = None
    guess_period: float | None = None
    flow_with_error: Callable[[Array, float, float], tuple[Array, Array, float | Array]] | None = field(
        default=None, repr=False
    )
    flow_states: Callable[[Array, float, float], Array] | None = field(default=None, repr=False)
    flow_tangents: Callable[[Array, Array, float, float], tuple[Array, Array]] | None = field(default=None, repr=False)
    flow_volume: Callable[[Array, float, float], tuple[float, float]] | None = field(default=None, repr=False)
    is_stiff: Callable[[Array, float, float], bool] | None = field(default=None, repr=False)
    velocity_series: Callable[[Array], Array] | None = field(default=None, repr=False)
    flow_events: Callable[[Array, float, float], Array] | None = field(default=None, repr=False)
    concurrent: bool = field(default=False, repr=False)
    symmetry_order: int = field(init=False, default=1, repr=False)

    def __post_init__(self) -> None:
        own = self.__dict__  # the way around the dataclass's own lock
        own["dimension"] = checked_count("dimension", self.dimension, LARGEST)
        for name in ("flow", "flow_events", *_MORE):
            function = getattr(self, name)
            if not (callable(function) or (function is None and name != "flow")):
                raise ParameterError("must be a function", field=name, value=function)
        if self.period is None:
            if self.velocity is None:
                raise ParameterError("must be given", field="period", allowed="a number, or None and a velocity")
            own["guess_period"] = positive("guess_period", self.guess_period)
        else:
            own["period"] = positive("period", self.period)
        if self.symmetry is not None:
            own["symmetry"] = symmetry = self._of_finite_order("symmetry", self.symmetry)[0]
            own["symmetry_order"] = max(2, _order(symmetry.tobytes(), len(symmetry)))
        if self.spatial_symmetry is not None:
            own["spatial_symmetry"] = self._of_finite_order("spatial_symmetry", self.spatial_symmetry)
        if self.orbit is not None:
            own["orbit"] = finite_array(self.orbit, (self.dimension,), "orbit")
        if self.scale is not None:
            scale = finite_array(self.scale, (self.dimension,), "scale")
            if not (scale > 0.0).all():
                raise ParameterError("must be positive", field="scale", value=self.scale)
            own["scale"] = scale
        super().__post_init__()

    def _of_finite_order(self, name: str, given: ArrayLike) -> Array:
        matrices, n = finite_array(given, None, name), self.dimension
        if matrices.shape[-2:] != (n, n) or matrices.ndim > (2 if name == "symmetry" else 3):
            raise ParameterError(f"has the wrong shape {matrices.shape}", field=name, allowed=f"({n}, {n})")
        matrices = matrices.reshape(-1, n, n)
        for matrix in matrices:
            if _order(matrix.tobytes(), n) == 0:
                said = "must have a finite order: a power that is the identity"
                raise ParameterError(said, field=name, allowed=f"an order up to {_HIGHEST_ORDER}")
        return matrices


@functools.lru_cache(maxsize=256)  # families use the same matrix at every value
def _order(entries: bytes, n: int) -> int:
    """The smallest k > 0 with matrix^k = 1; 0 for infinite order."""
    matrix = np.frombuffer(entries).reshape(n, n)
    one = np.eye(len(matrix))
    # Entries between states of different units are large and small in pairs, so the bound is entry by entry; those
    # that are round-off of the others (the cosine of a right angle) count as zero.
    sizes = np.abs(matrix)
    units = numerical_balance(matrix)
    balanced = float((sizes * units / units[:, None]).max())
    sizes = np.maximum(sizes, _ROUND_OFF * balanced * units[:, None] / units)
    power, reach = matrix, sizes
    for k in range(1, _HIGHEST_ORDER + 1):
        if (np.abs(power - one) <= _SAME * np.maximum(reach, one)).all():
            return k
        power, reach = power @ matrix, np.abs(power) @ sizes
        if not np.abs(np.linalg.norm(np.diag(power))) <= 1e3 * len(matrix):
            return 0
    return 0


_MOST_STATED = 16
_STATED: dict[Any, _Stated] = {}
# In periods: just after its start, as a pulse may be given for one period alone, where no fast harmonic is zero.
_TIMES = math.sqrt(2.0) * np.array([0.007, 0.016])


def from_rhs(
    rhs: Callable[..., ArrayLike],
    dimension: int,
    period: float | None,
    *,
    args: tuple[Any, ...] = (),
    events: Sequence[Event] = (),
    switch_times: Sequence[float] = (),
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
    and crossed exactly, in time and in state. A pulse in time narrower than T / 4096 may be missed.

    A stiff system, whose fastest decay is much faster than its motion, is integrated by an implicit method, Radau IIA
    collocation with the exact derivative of its steps. A function that branches on its arguments (``if x[0] > 0``) or
    calls other libraries cannot be traced: scipy's DOP853 integrates it from calls, hundreds of times slower, with a
    derivative from a complex step or, if ``rhs`` does not accept complex states, from differences with nine digits. It
    reads objects from outside, as a map does, at every call; a traced function has them as when the system was made.

    Parameters
    ----------
    rhs
        Function ``rhs(t, x, *args)`` -> dx/dt, shape (n,); T-periodic in t.
    dimension, period
        Number of states n, and T; None if nothing depends on t and the period belongs to the orbit.
    args
        Parameters of the right-hand side.
    events
        Events at which the state jumps, or ``rhs`` switches, on reaching a surface, of T-periodic functions that can be
        traced.
    switch_times
        Times in [0, T) at which ``rhs`` jumps or has a kink. A traced function needs none; others are evaluated
        strictly inside each interval, and undeclared jumps cost time and digits.
    symmetry, spatial_symmetry, orbit, scale, guess_period
        See :class:`PeriodicSystem`. Without a period ``guess_period`` is needed; ``orbit`` may be a guess.
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
    about: dict[str, Any] = {"switch_times": switch_times, "orbit": orbit, "method": method, "tolerance": tolerance}
    more: dict[str, Any] = {"symmetry": symmetry, "spatial_symmetry": spatial_symmetry, "scale": scale}
    key = () if events else _key((dimension, period, guess_period, *about.values(), *more.values()))
    stated = _STATED.get(key) or _Stated(dimension, period, guess_period, about | {"events": events}, more)
    if key:
        if len(_STATED) >= _MOST_STATED:
            _STATED.clear()
        _STATED[key] = stated
    slopes, members = stated.given.flows(rhs, args, stated.claims[0])
    if period is None:
        members.setdefault("velocity", lambda x: slopes(np.zeros(1), np.asarray(x)[:, None])[:, 0])
    found, first = slopes(stated.times, stated.states), 0
    try:
        for claim in stated.claims:
            claim.check(found[:, first : first + claim.times.size])
            first += claim.times.size
    except ParameterError:
        if not np.array_equal(found, slopes(stated.times, stated.states), equal_nan=True):
            raise ParameterError("gives other values at the same time and state", field="rhs") from None
        raise
    system = object.__new__(PeriodicSystem)  # all but its functions is checked
    system.__dict__.update(stated.system.__dict__, **members)
    return system


class _Stated:
    """Checked properties of right-hand sides, the same throughout most families, whose members differ in ``args``."""

    def __init__(
        self, dimension: int, period: float | None, guess: float | None, about: dict[str, Any], more: dict[str, Any]
    ) -> None:
        autonomous = period is None
        if autonomous and guess is None:
            raise ParameterError("must be given where the period is None", field="guess_period", value=None)
        length = positive("guess_period" if autonomous else "period", guess if autonomous else period)
        given = RightHandSide(dimension, length, autonomous, **about)
        own: dict[str, Any] = {"velocity": _unknown, "guess_period": length} if autonomous else {}
        timed = None if autonomous else length
        system = PeriodicSystem(given.dimension, timed, _unknown, orbit=given.start, **more, **own)
        one, base = np.eye(given.dimension), given.base
        part, shift = (0.1234, 0.4444) if autonomous else (_TIMES, 1.0)
        field = "timeless" if autonomous else "period"
        claims = [Claim(field, one, shift * length, np.atleast_1d(part * length), base, np.inf)]
        if not given.events:  # a symmetry would also have to hold for these
            if system.symmetry is not None:
                later = 0.0 if autonomous else length - length / system.symmetry_order  # T/k before
                claims.append(Claim("symmetry", system.symmetry, later, given.times, base, length))
            for matrix in spatial_symmetries(system):
                claims.append(Claim("spatial_symmetry", matrix, 0.0, given.times, base, length))
        self.given, self.system, self.claims = given, system, claims
        self.times = np.concatenate([claim.times for claim in claims])
        self.states = np.concatenate([claim.states for claim in claims], axis=1)


def _unknown(*_: Any) -> Any:
    """Stand-in for a function that a right-hand side gives."""


def _key(options: tuple[Any, ...]) -> tuple[Any, ...]:
    """Options as a key; empty if there is none."""
    floats: list[float] = []
    try:
        return describe(options, floats, {}), array("d", floats).tobytes()
    except (Opaque, TypeError, ValueError):  # not hashable, an empty cell
        return ()


_SHAKE = 2.0**-52
_ROUNDING = 8.0 * float(np.finfo(float).eps)


def from_map(
    image: Callable[[Array], tuple[ArrayLike, ArrayLike]],
    dimension: int,
    *,
    orbit: ArrayLike | None = None,
    spatial_symmetry: ArrayLike | None = None,
    scale: ArrayLike | None = None,
) -> PeriodicSystem:
    """Build a :class:`PeriodicSystem` of period 1 from a map, which is applied at every whole time.

    Parameters
    ----------
    image
        Function ``image(x)`` -> state after one iteration, shape (n,), and its derivative by x, shape (n, n); refused
        if that contradicts differences of the states at the first point or at one with error bounds.
    dimension
        Number of states n.
    orbit, spatial_symmetry, scale
        See :class:`PeriodicSystem`.
    """
    if not callable(image):
        raise ParameterError("must be a function", field="image", value=image, allowed="image(x)")
    n = checked_count("dimension", dimension, LARGEST)

    def applied(x: Array) -> tuple[Array, Array]:
        with UserCode("image"):
            pair: Any = image(x.copy())
        if not (isinstance(pair, tuple | list) and len(pair) == 2):
            said = "must return a pair"
            raise ParameterError(said, field="image", value=type(pair).__name__, allowed="(state, derivative)")
        return numbers(pair[0], (n,), "image"), numbers(pair[1], (n, n), "image")

    def iterated(x: Array, t0: float, t1: float, compared: bool = False) -> tuple[Array, Array, Array]:
        x, derivative, reach = np.asarray(x, dtype=np.float64), np.eye(n), np.eye(n)
        for _ in range(math.ceil(t1) - math.ceil(t0)):
            start, (x, factor) = x, applied(x)
            if is_due(image, compared):
                compare(lambda x: applied(x)[0], start, x, factor, "image", scale)
            with np.errstate(all="ignore"):  # derivatives that are not finite are refused later
                derivative, reach = factor @ derivative, np.abs(factor) @ reach
        return x, derivative, reach

    def flow_with_error(x: Array, t0: float, t1: float) -> tuple[Array, Array, Array]:
        state, derivative, reach = iterated(x, t0, t1, compared=True)
        shaken = np.asarray(x) * (1.0 + _SHAKE * np.sign(np.cos(3.0 * np.arange(n) + 1.0)))
        other = iterated(shaken, t0, t1)[1]
        rounding = _ROUNDING * n * max(1, math.ceil(t1) - math.ceil(t0)) * reach
        return state, derivative, REPEATED * np.abs(other - derivative) + rounding

    more: dict[str, Any] = {"orbit": orbit, "spatial_symmetry": spatial_symmetry, "scale": scale}  # converted there
    return PeriodicSystem(n, 1.0, lambda x, t0, t1: iterated(x, t0, t1)[:2], flow_with_error=flow_with_error, **more)
