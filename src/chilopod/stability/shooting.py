"""Multiple shooting: a periodic orbit as states at several instants, each carried to the next one.

Over a whole return a motion may magnify a deviation by thousands, and a correction that is as far off is none. Over a
part of it a deviation grows by a root of that. The linear equations are condensed to the first state, the time of a
return and the parameter (Ascher, Mattheij & Russell, *Numerical Solution of Boundary Value Problems*, section 4.3).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.arguments import finite_array
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.capabilities import SystemLike, is_autonomous, returns_per_period
from chilopod.stability.convergence import NODES
from chilopod.stability.returns import Section, carried, return_duration

Array = NDArray[np.float64]

_ROUNDS, FEW_ROUNDS = 40, 12  # where corrections are damped, and on a curve, whose points are near
_LONGEST = 3.0  # times the time of a return that was guessed
_SHORTEST = 2.0**-8  # of a correction
_DIFFERENCE = 1e-7  # of the parameter's scale
_QUICKEST = 0.3  # of the time of a return: its largest correction
_CUTOFF, _FAMILY = 1e-15, 1e-8  # singular values that count as zero, the largest being one; of families of orbits
_GROWTH = 4.0  # of a deviation from one node to the next, about
_MOST = 32
_OF_GUESS = 16  # nodes of an orbit that was given
_FEWEST_ROWS = 5
_SAME_PERIOD = 1e-6


@dataclass(frozen=True)
class Nodes(ReadOnlyArrays):
    """An orbit as states at instants that divide a return evenly.

    Attributes
    ----------
    states
        Shape (m, n), the first at time 0.
    duration
        Time of a return, s.
    value
        Parameter.
    """

    states: Array
    duration: float
    value: float = 0.0


@dataclass(frozen=True)
class Closed(ReadOnlyArrays):
    """An orbit that was solved for.

    Attributes
    ----------
    nodes
        Its states.
    jacobian
        Derivative of a return, without the change of its time, shape (n, n): the product of those between nodes, which
        no rounding of a whole return disturbs.
    by_value
        Derivative of a return with respect to the parameter, likewise, shape (n,); zeros where that is given.
    """

    nodes: Nodes
    jacobian: Array
    by_value: Array


@dataclass(frozen=True)
class Free:
    """The parameter as an unknown, with the equation that it takes.

    Attributes
    ----------
    row, target
        ``row . moved = target`` for the displacement of first state and parameter from ``start``, in units.
    start
        State and parameter, shape (n+1,).
    scale
        Unit of the parameter.
    """

    row: Array
    target: float
    start: Array
    scale: float


def node_count(jacobian: Array, sizes: Array) -> int:
    """Number of nodes over which deviations grow little, from the derivative of a return."""
    growth = float(np.linalg.norm(jacobian * sizes / sizes[:, None], 2))
    return int(np.clip(np.ceil(np.log(max(growth, 1.0)) / np.log(_GROWTH)), 1, _MOST))


def nodes_along(system: SystemLike, x: Array, duration: float, count: int, value: float = 0.0) -> Nodes:
    """Nodes on the motion from a state."""
    states, part = [x], duration / count
    for i in range(count - 1):
        states.append(carried(system, states[-1][None], i * part, (i + 1) * part)[0])
    return Nodes(np.array(states), duration, value)


def nodes_of(guess: Any, system: SystemLike) -> Nodes | None:
    """Nodes of a guess that is a whole orbit; None for one that is a single state.

    Parameters
    ----------
    guess
        States at even times over one period from time 0 on, shape (times, n), without the end; or times, shape
        (times,), and states there, as a tuple or as an ``xarray.DataArray`` over ``time``: from the first to the last
        one period passes.
    system
        Its period is that of the first form; of a system without one the guess of it.

    Raises
    ------
    ParameterError
        If it is no such array, not finite, too short, or the times do not rise or are of another period.
    """
    if hasattr(guess, "coords") and "time" in guess.coords:
        guess = guess.coords["time"].values, guess.values
    n, whole = system.dimension, return_duration(system) * returns_per_period(system)
    if isinstance(guess, tuple) and len(guess) == 2 and np.ndim(guess[1]) == 2:
        states = finite_array(guess[1], (len(guess[1]), n), "orbit")
        times = finite_array(guess[0], (len(states),), "orbit")
    elif np.ndim(guess) == 2:
        states = finite_array(guess, (np.shape(guess)[0], n), "orbit")
        states = np.vstack([states, states[:1]])
        times = np.linspace(0.0, whole, len(states))
    else:
        return None
    if len(states) < _FEWEST_ROWS:
        raise ParameterError("has too few states", field="orbit", value=len(states), allowed=f"{_FEWEST_ROWS} or more")
    if not (np.diff(times) > 0.0).all():
        raise ParameterError("has times that do not rise", field="orbit")
    lasts = float(times[-1] - times[0])
    if not is_autonomous(system) and not abs(lasts - whole) <= _SAME_PERIOD * whole:
        raise ParameterError("is not of one period", field="orbit", value=f"{lasts:g} s", allowed=f"{whole:g} s")
    duration = lasts / returns_per_period(system)
    return Nodes(CubicSpline(times - times[0], states)(np.arange(_OF_GUESS) * duration / _OF_GUESS), duration)


def shot(
    system_at: Callable[[float], SystemLike],
    start: Nodes,
    sizes: Array,
    section: Section | None,
    free: Free | None = None,
) -> Closed:
    """The orbit near some nodes, by Newton's method, damped while the parameter is given.

    Parameters
    ----------
    system_at
        The system at a value of the parameter.
    start
        Guess.
    sizes
        Sizes of the states, shape (n,).
    section
        Section that holds the first state, of a system without a period of its own; else None.
    free
        Equation for the parameter; None where it is given.

    Raises
    ------
    AnalysisError
        If it does not converge, or the motion does not get from a node to the next one.
    """
    linear = _Linear(system_at, start, sizes, section, free)
    best, before = np.inf, 1.0
    for _ in range(_ROUNDS if free is None else FEW_ROUNDS):
        off = linear.residual
        if NODES.met(off, best):
            return linear.closed()
        best = min(best, off)
        linear, before = _damped(linear, min(1.0, 2.0 * before)) if free is None else (linear.moved(1.0), 1.0)
        if not 1.0 / _LONGEST <= linear.nodes.duration / start.duration <= _LONGEST:
            break
    raise AnalysisError("corrections of the orbit's nodes do not converge", field="orbit")


def _damped(linear: _Linear, part: float) -> tuple[_Linear, float]:
    """As much of a correction as leaves less to correct by the same linear equations, and how much that is (Deuflhard,
    *Newton Methods for Nonlinear Problems*, section 3.3)."""
    while part >= _SHORTEST:
        with contextlib.suppress(AnalysisError):
            there = linear.moved(part)
            if linear.correction_left(there) <= max(
                (1.0 - 0.25 * part) * linear.correction_left(linear), NODES.settled
            ):
                return there, part
        part *= 0.5
    raise AnalysisError("corrections of the orbit's nodes do not converge", field="orbit")


class _Linear:
    """The equations at some nodes and their derivatives."""

    def __init__(
        self,
        system_at: Callable[[float], SystemLike],
        nodes: Nodes,
        sizes: Array,
        section: Section | None,
        free: Free | None,
    ) -> None:
        self._given = system_at, sizes, section, free
        self.nodes = nodes
        system = system_at(nodes.value)
        m, n = nodes.states.shape
        part, timed = nodes.duration / m, not is_autonomous(system)
        ends, self._factors = np.empty((m, n)), np.empty((m, n, n))
        # Derivatives by the time of a return and by the parameter.
        self._by_time, self._by_value = np.zeros((m, n)), np.zeros((m, n))
        step = 0.0 if free is None else _DIFFERENCE * free.scale
        beside = None
        if free is not None:
            try:
                beside = system_at(nodes.value + step)
            except AnalysisError:  # the end of what there is
                step = -step
                beside = system_at(nodes.value + step)
        for i, x in enumerate(nodes.states):
            a, b = (i * part, (i + 1) * part) if timed else (0.0, part)
            try:
                ends[i], self._factors[i] = system.flow(np.array(x), a, b)
                if beside is not None:
                    with np.errstate(all="ignore"):  # what is not finite is refused below
                        self._by_value[i] = (carried(beside, x[None], a, b)[0] - ends[i]) / step
            except AnalysisError as error:
                raise AnalysisError(f"node {i} of {m}: {error.problem}", field="orbit") from error
            if is_autonomous(system):
                self._by_time[i] = np.asarray(system.velocity(ends[i])) / m
        turn = np.eye(n) if system.symmetry is None else system.symmetry
        ends[-1], self._factors[-1] = turn @ ends[-1], turn @ self._factors[-1]
        self._by_time[-1], self._by_value[-1] = turn @ self._by_time[-1], turn @ self._by_value[-1]
        self._off = ends - np.roll(nodes.states, -1, axis=0)
        across = 0.0 if section is None else float(section.normal @ (nodes.states[0] - section.point))
        here = np.append(nodes.states[0], nodes.value)
        units = np.append(sizes, 1.0 if free is None else free.scale)
        missing = 0.0 if free is None else float(free.row @ ((here - free.start) / units) - free.target)
        self._extra = np.array([across, missing])
        self.residual = max(float(np.abs(self._off / sizes).max()), abs(missing))
        if not np.isfinite(self.residual):
            raise AnalysisError("the motion is not finite between two nodes", field="orbit")

    def _totals(self, off: Array) -> list[Array]:
        """Each later node as a linear function of first state, time, parameter, and 1, shape (n, n+3)."""
        n = off.shape[1]
        total = np.hstack([np.eye(n), np.zeros((n, 3))])
        totals = [total]
        for factor, by_time, by_value, each in zip(self._factors, self._by_time, self._by_value, off, strict=True):
            total = factor @ total
            total[:, n:] += np.stack([by_time, by_value, each], axis=1)
            totals.append(total)
        return totals

    def closed(self) -> Closed:
        """The nodes as a solution."""
        total, n = self._totals(self._off)[-1], self._off.shape[1]
        return Closed(self.nodes, total[:, :n], total[:, n + 1])

    def _solved(self, off: Array, extra: Array) -> tuple[Array, float, float]:
        """Corrections of the nodes, the time of a return and the parameter, by these linear equations."""
        _, sizes, section, free = self._given
        n, totals = off.shape[1], self._totals(off)
        units = np.append(sizes, [self.nodes.duration, 1.0 if free is None else free.scale])
        matrix, right = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
        matrix[:n] = (totals[-1][:, : n + 2] - np.eye(n, n + 2)) * units / sizes[:, None]
        right[:n] = -totals[-1][:, n + 2] / sizes
        # Without a section the time of a return is given, and without another equation the parameter.
        matrix[n, n] = matrix[n + 1, n + 1] = 1.0
        if section is not None:
            matrix[n, n], matrix[n, :n], right[n] = 0.0, section.normal * sizes, -extra[0]
        if free is not None:
            matrix[n + 1, :n], matrix[n + 1, n + 1], right[n + 1] = free.row[:n], free.row[n], -extra[1]
        try:
            move = units * np.linalg.lstsq(matrix, right, rcond=_FAMILY if free is None else _CUTOFF)[0]
        except np.linalg.LinAlgError:
            raise AnalysisError("the equations of the orbit's nodes have no solution", field="orbit") from None
        states = np.array([each @ np.append(move, 1.0) for each in totals[:-1]])
        return states, float(move[n]), float(move[n + 1])

    def moved(self, part: float) -> _Linear:
        """The equations after that part of a correction, or less of it where the time would change much."""
        states, duration, value = self._solved(self._off, self._extra)
        here = self.nodes
        part = min(part, _QUICKEST * here.duration / max(abs(duration), 1e-300))
        there = Nodes(here.states + part * states, here.duration + part * duration, here.value + part * value)
        system_at, sizes, section, free = self._given
        return _Linear(system_at, there, sizes, section, free)

    def correction_left(self, other: _Linear) -> float:
        """Size of the correction that these linear equations make of what is off at other nodes."""
        states, duration, _ = self._solved(other._off, other._extra)
        return max(float(np.abs(states / self._given[1]).max()), abs(duration) / self.nodes.duration)
