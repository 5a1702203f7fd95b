"""The equations of a periodic orbit: states at instants that divide a return evenly, each carried to the next one.

One node is single shooting. Over a whole return a motion may magnify a deviation by thousands, which makes corrections
useless; over a part of it a deviation grows only by a root of that. The linear equations are condensed to the
first state, the time of a return and the parameter (Ascher, Mattheij & Russell, *Numerical Solution of Boundary Value
Problems*, section 4.3), the time to that at which the return ends on the section.

``shot`` is Newton's method. In every round ``_Equations`` carries the nodes, gives the residual and a correction, and
the equations after part of it. With a given parameter parts are halved until one comes nearer; with the parameter as an
unknown the start is near, and every correction is taken whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.linalg.lapack import dgesv

from chilopod.errors import AnalysisError
from chilopod.flows.deadline import Budget
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.stability.interface import SystemLike, checked_flow, is_autonomous
from chilopod.stability.returns import NODES, RETURN, Section, carried, crossing, section_at

_EVALUATIONS, FEW_ROUNDS = 60, 12  # largest numbers of damped corrections, and of those on a curve, with near points
_LONGEST = 4.0  # longest return, relative to the guess
_STRAYS = 20  # largest number of evaluations while the motion does not return to the section
_SHORTEST = 2.0**-6  # smallest fraction of a correction
_DIFFERENCE = 1e-7  # step of differences, relative to the parameter's scale
_QUICKEST = 0.3  # largest correction of the time of a return, relative to it
_FARTHEST, _FARTHER = 10.0, 2.0  # largest correction, relative to the sizes of the states, and its growth per round
_NEAR = 1e-2  # residual, relative to the sizes of the states, below which a motion returns to a section
_CAREFUL = 0.3  # largest correction, relative to the sizes of the states, without a return to the section
_CUTOFF, _SINGULAR, _FAMILY = 1e-15, 1e-13, 1e-8  # singular values, relative to the largest, that count as zero
_MAGNIFIED = 1e9  # correction over residual beyond which the equations may be singular
_NOTHING = 1e-13  # state, relative to its size, that may be zero
_GROWTH = 4.0  # approximate growth of a deviation from one node to the next
_MOST = 32


class Nodes(NamedTuple):
    """States at even times of a return, shape (m, n), the first at 0, its time, and the parameter; or their changes."""

    states: Array
    duration: float
    value: float = 0.0


@dataclass(frozen=True, eq=False)
class Closed(ReadOnlyArrays):
    """Corrected orbit: nodes, sizes of the states, shape (n,), and return of the last node.

    The derivatives of a return, with respect to the state, shape (n, n), and to the parameter, shape (n,), exclude the
    change of its time. They are products of the derivatives between nodes, which avoids the rounding of a whole return.
    """

    nodes: Nodes
    sizes: Array
    end: Array
    jacobian: Array
    by_value: Array


@dataclass(frozen=True)
class Free:
    """The parameter as an unknown, in units of ``scale``, with its equation ``row . moved = target`` for the
    displacement of first state and parameter from ``start``, shape (n+1,), in units."""

    row: Array
    target: float
    start: Array
    scale: float


def node_count(jacobian: Array, sizes: Array) -> int:
    """Number of nodes with little growth of deviations in between, from the derivative of a return."""
    with np.errstate(over="ignore"):
        matrix = jacobian * sizes / sizes[:, None]
    growth = float(np.linalg.svd(matrix, compute_uv=False)[0]) if np.isfinite(matrix).all() else np.inf
    return int(np.clip(np.ceil(np.log(max(growth, 1.0)) / np.log(_GROWTH)), 1, _MOST))


def nodes_along(system: SystemLike, x: Array, duration: float, count: int, value: float = 0.0) -> Nodes:
    """Nodes on the motion from a state."""
    states, part = [x], duration / count
    for i in range(count - 1):
        states.append(carried(system, states[-1][None], i * part, (i + 1) * part)[0])
    return Nodes(np.array(states), duration, value)


@dataclass(frozen=True)
class Problem:
    """Problem of :func:`shot`: the systems by the parameter, with its equation ``free``, None for a given one.

    ``shared`` is a basis of the space of symmetric states, shape (n, k), None for all. Every evaluation takes a return
    of the budget. With ``careful`` steps are short, the return time is free and the section not needed until it nearly
    closes.
    """

    system_at: Callable[[float], SystemLike]
    free: Free | None = None
    shared: Array | None = None
    budget: Budget | None = None
    careful: bool = False


def shot(problem: Problem, start: Nodes, sizes: Array, section: Section | None) -> Closed:
    """The orbit near some nodes, by Newton's method, damped while the parameter is given.

    ``sizes`` of the states, shape (n,), grow with these while the parameter is given. The first state has a ``section``
    if the system has no period of its own.
    """
    with np.errstate(all="ignore"):  # values that are not finite are refused
        equations, best = _Equations(problem, start, _Frame(sizes, sizes, section, problem.careful)), np.inf
        if problem.free is None:
            return _damped(equations, start)
        for _ in range(FEW_ROUNDS):
            if NODES.met(equations.residual, best):
                return equations.closed()
            if not 1.0 / _LONGEST <= equations.nodes.duration / start.duration <= _LONGEST:
                break
            best = min(best, equations.residual)
            equations = equations.after(equations.correction(equations, _CUTOFF), 1.0)
    raise _not_found(best)


def _damped(equations: _Equations, start: Nodes) -> Closed:
    """The orbit near some nodes at a given parameter."""
    correction: Nodes | None = None  # correction at ``equations``, until part of it is taken
    part, whole = 1.0, True  # part of it that is tried next, and if the last one was taken whole
    best, strays, obstacle = np.inf, 0, ""
    cutoff = _SINGULAR if len(start.states) == 1 else _FAMILY
    for _ in range(_EVALUATIONS):
        if correction is None:
            # Halved steps may approach a jump of the motion, and the residual falls with them.
            if RETURN.met(equations.residual, best if whole else np.inf):
                return equations.cleared().closed()
            longer, strays = equations.nodes.duration / start.duration, strays + equations.frame.astray
            if strays > _STRAYS or not 1.0 / _LONGEST <= longer <= _LONGEST:
                break
            best = min(best, equations.residual)
            correction = equations.correction(equations, cutoff)
        try:
            there = equations.after(correction, part)
        except AnalysisError as error:
            there, obstacle = None, f": {error.problem}"
        if there is not None and equations.is_nearer(there, correction, part, cutoff, best):
            equations, part, correction, whole, obstacle = there, min(1.0, 2.0 * part), None, part == 1.0, ""
        elif part > _SHORTEST:
            part *= 0.5
        elif cutoff == _SINGULAR:
            # The steps followed round-off along a family of orbits: without that direction they converge.
            cutoff, part = _FAMILY, 1.0
            correction = equations.correction(equations, cutoff)
        else:
            break
    if best <= RETURN.settled:  # no step comes nearer: an equilibrium, or the equations' accuracy
        return equations.closed()
    raise _not_found(best, obstacle)


def _not_found(best: float, obstacle: str = "") -> AnalysisError:
    said = f"no periodic orbit found near the guess (it misses itself by {best:.1e} of its size){obstacle}"
    return AnalysisError(said, field="orbit", allowed="a guess closer to the orbit")


class _Frame(NamedTuple):
    """Sizes of the states before and after a correction, the first one's section, and if the motion misses it."""

    sizes: Array
    reach: Array
    section: Section | None
    astray: bool = False


class _Equations:
    """The equations at some nodes and their derivatives.

    For nodes x_i, the time T of a return and the parameter p they are F_i = phi(x_i; T/m, p) - x_{i+1} = 0. ``_ends``
    has the phi, ``_off`` the F. Row i of ``_linear`` is [dF_i/dx_i | dF_i/dT | dF_i/dp | room for F_i]; products of
    these rows make every node a linear function of x_0, T, p and 1.
    """

    def __init__(self, problem: Problem, nodes: Nodes, frame: _Frame) -> None:
        if problem.budget is not None:
            problem.budget.take()
        self._problem, self.nodes, free = problem, nodes, problem.free
        system = problem.system_at(nodes.value)
        m, n = nodes.states.shape
        self._ends, self._linear = np.empty((m, n)), np.zeros((m, n, n + 3))
        self._returned = False  # True if the time is that of the return to the section
        if free is None and m == 1 and frame.section is not None:
            frame = self._to_section(system, frame)
        else:
            self._to_nodes(system)
        if is_autonomous(system):
            self._linear[:, :, n] = [system.velocity(np.array(end)) for end in self._ends]
            self._linear[:, :, n] /= m
        if system.symmetry is not None:
            self._ends[-1], self._linear[-1] = system.symmetry @ self._ends[-1], system.symmetry @ self._linear[-1]
        sizes, x = frame.sizes, nodes.states[0]
        self._ends = self._shared(self._ends, sizes)
        self._off = self._ends - np.concatenate([nodes.states[1:], nodes.states[:1]])
        if free is None and x.any():
            sizes = np.maximum(sizes, np.maximum(np.abs(nodes.states), np.abs(self._ends)).max(axis=0))
        self._across = 0.0 if frame.section is None else float(frame.section.normal @ (x - frame.section.point))
        self._missing = 0.0
        if free is not None:
            moved = (np.append(x, nodes.value) - free.start) / np.append(sizes, free.scale)
            self._missing = float(free.row @ moved - free.target)
        self.residual = max(float(np.abs(self._off / sizes).max()), abs(self._missing))
        self.frame = frame._replace(sizes=sizes, reach=np.minimum(sizes, frame.reach))
        if not math.isfinite(self.residual):
            lost = np.flatnonzero(~np.isfinite(self._ends).all(axis=1))
            where = f"node {lost[0]} of {m}: " if lost.size else ""
            raise AnalysisError(f"{where}the motion is not finite between two nodes", field="orbit")

    def _shared(self, states: Array, sizes: Array) -> Array:
        """States without the asymmetry that rounding leaves, which grows from one node to the next."""
        if self._problem.shared is None:
            return states
        basis = np.linalg.qr(self._problem.shared / sizes[:, None])[0]
        return np.asarray(states / sizes @ basis @ basis.T * sizes)

    def _to_nodes(self, system: SystemLike) -> None:
        """Carry every node to the next one, and beside it by a neighbouring system if the parameter is unknown."""
        (m, n), part = self.nodes.states.shape, self.nodes.duration / len(self.nodes.states)
        beside, free = None, self._problem.free
        if free is not None:
            step = _DIFFERENCE * free.scale
            try:
                beside = self._problem.system_at(self.nodes.value + step)
            except AnalysisError:  # the family ends here
                step = -step
                beside = self._problem.system_at(self.nodes.value + step)
        for i, x in enumerate(self.nodes.states):
            a, b = (0.0, part) if is_autonomous(system) else (i * part, (i + 1) * part)
            try:
                self._ends[i], self._linear[i, :, :n] = checked_flow(system, x, a, b)
                if beside is not None:
                    self._linear[i, :, n + 1] = (carried(beside, x[None], a, b)[0] - self._ends[i]) / step
            except AnalysisError as error:
                if m == 1:
                    raise
                raise AnalysisError(f"node {i} of {m}: {error.problem}", field="orbit") from error

    def _to_section(self, system: SystemLike, frame: _Frame) -> _Frame:
        """Carry a single node until its motion returns to the section, or over the time, to a new section."""
        x, duration = self.nodes.states[0], self.nodes.duration
        if not frame.astray and frame.section is not None:
            try:
                start, rest, before, first = crossing(system, x, replace(frame.section, duration=duration))
                self._ends[0], second = checked_flow(system, before, 0.0, rest)
                self._linear[0, :, : x.size] = second @ first
                self.nodes, self._returned = self.nodes._replace(duration=start + rest), True
                return frame
            except AnalysisError:
                if not self._problem.careful:
                    raise
        self._ends[0], self._linear[0, :, : x.size] = checked_flow(system, x, 0.0, duration)
        return frame._replace(section=section_at(system, x, frame.sizes, duration), astray=True)

    def _totals(self, off: Array) -> list[Array]:
        """The node after each, with the residuals ``off``, by first state, time, parameter, and 1: shape (n, n+3)."""
        rows, n = self._linear.copy(), off.shape[1]
        rows[:, :, -1] = off
        totals = [rows[0]]
        for each in rows[1:]:
            total = each[:, :n] @ totals[-1]
            total[:, n:] += each[:, n:]
            totals.append(total)
        return totals

    def closed(self) -> Closed:
        total, n = self._totals(self._off)[-1], self._off.shape[1]
        return Closed(self.nodes, self.frame.sizes, self._ends[-1], total[:, :n], total[:, n + 1])

    def correction(self, other: _Equations, cutoff: float) -> Nodes:
        """Correction by these linear equations for the residual here or at other nodes."""
        section, free, sizes = self.frame.section, self._problem.free, self.frame.sizes
        n, totals = sizes.size, self._totals(other._off)
        last, time = totals[-1], None
        if section is not None:  # the time of the return to it
            speed = float(section.normal @ last[:, n])
            if speed == 0.0:
                raise AnalysisError("the motion does not cross the section", field="orbit")
            time = -(section.normal @ last) / speed
            time[n] = 0.0
            time[n + 2] -= other._across / speed
            last = last + np.outer(last[:, n], time)
        matrix, right = last[:, :n] * sizes / sizes[:, None], -last[:, n + 2] / sizes
        matrix.flat[:: n + 1] -= 1.0
        if free is not None:
            matrix = np.block([[matrix, (last[:, n + 1] * free.scale / sizes)[:, None]], [free.row[None]]])
            right = np.append(right, -other._missing)
        move = _solution(matrix, right, cutoff, self._problem.shared, sizes)
        every = np.zeros(n + 3)
        every[:n], every[-1] = sizes * move[:n], 1.0
        if free is not None:
            every[n + 1] = move[n] * free.scale
        if time is not None and not self._returned:  # else the next node determines it
            every[n] = time @ every
        states = np.array([every[:n], *(total @ every for total in totals[:-1])])
        return Nodes(self._shared(states, sizes), float(every[n]), float(every[n + 1]))

    def after(self, correction: Nodes, part: float) -> _Equations:
        """The equations after part of a correction, or less."""
        here, frame, farthest = self.nodes, self.frame, _FARTHEST
        part = min(part, _QUICKEST * here.duration / max(abs(correction.duration), 1e-300))
        if frame.astray:
            motion = self._linear[0, :, -3] * here.duration / frame.sizes
            farthest = _CAREFUL * min(1.0, float(np.linalg.norm(motion)))
        if self._problem.free is None:
            part = min(part, farthest / max(float(np.abs(correction.states / frame.reach).max()), 1e-300))
        states, time, value = correction
        there = Nodes(here.states + part * states, here.duration + part * time, here.value + part * value)
        # The states may just be growing.
        astray, reach = frame.astray and self.residual > _NEAR, frame.reach * (1.0 if frame.astray else _FARTHER)
        return _Equations(self._problem, there, frame._replace(reach=reach, astray=astray))

    def is_nearer(self, there: _Equations, correction: Nodes, part: float, cutoff: float, best: float) -> bool:
        """True if other equations, after part of a correction, have half the residual, or a smaller correction by the
        linear equations here (Deuflhard, *Newton Methods for Nonlinear Problems*, section 3.3); without a return, where
        steps are short, if their residual is not much larger than the best."""
        if self.frame.astray:
            return there.residual <= 2.0 * best
        if float(np.abs(there._off / self.frame.sizes).max()) <= 0.5 * self.residual:
            return True
        before, left = self._length(correction), self._length(self.correction(there, cutoff))
        return left <= max((1.0 - 0.25 * part) * before, NODES.settled)

    def _length(self, correction: Nodes) -> float:
        states = float(np.abs(correction.states / self.frame.sizes).max())
        return max(states, abs(correction.duration) / self.nodes.duration)

    def cleared(self) -> _Equations:
        """The orbit with its negligible states, remainders of the guess, set to zero, if it remains an orbit."""
        x = self.nodes.states[0]
        small = (x != 0.0) & (np.abs(x) <= _NOTHING * self.frame.sizes)
        if not small.any():
            return self
        states = np.vstack([np.where(small, 0.0, x), self.nodes.states[1:]])
        there = _Equations(self._problem, self.nodes._replace(states=states), self.frame)
        return there if there.residual <= max(RETURN.round_off, 2.0 * self.residual) else self


def _solution(matrix: Array, right: Array, cutoff: float, shared: Array | None, sizes: Array) -> Array:
    """Solution of linear equations in units, within ``shared`` states if given; the shortest for families."""
    if shared is not None:
        basis = np.linalg.qr(shared / sizes[:, None])[0]
        if len(matrix) > len(basis):
            basis = block_diag(basis, 1.0)  # the parameter
        return np.asarray(basis @ _solution(basis.T @ matrix @ basis, basis.T @ right, cutoff, None, sizes))
    if not np.isfinite(matrix).all():
        raise AnalysisError("deviations grow beyond double precision within a return", field="orbit")
    try:
        if cutoff == _SINGULAR:
            _, _, regular, singular = dgesv(matrix, right)
            if not singular and np.abs(regular).max() <= _MAGNIFIED * np.abs(right).max():
                return np.asarray(regular)
        # In few shared states H - 1 may be small altogether; LAPACK takes no cutoff of 1.
        largest = float(np.linalg.norm(matrix, 2))
        if largest <= cutoff:
            return np.zeros_like(right)
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=cutoff / min(1.0, largest))[0])
    except np.linalg.LinAlgError:
        raise AnalysisError("the equations of the orbit's nodes have no solution", field="orbit") from None
