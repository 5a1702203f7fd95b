"""The planar robot as a periodic dynamical system in reduced coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.engine.actuators import FROM, GOAL
from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows import deadline
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays, read_only
from chilopod.integrate import COMPLEX_STEP
from chilopod.planar import linear, stretch
from chilopod.planar.contact import contact_moments
from chilopod.planar.drift import Drift
from chilopod.planar.dynamics import SCRATCH
from chilopod.planar.dynamics import rhs as compiled_rhs
from chilopod.planar.flow import advance, pieces

if TYPE_CHECKING:
    from chilopod.gait import Gait, Schedule
    from chilopod.robot import Robot


TOLERANCE = 1e-13
"""Default tolerance of the nonlinear flow, relative to max(1, |x|), per step."""

_SAME_INSTANT = 1e-12  # in periods
_SPREAD = 2.0  # factor on the error along one direction for that of any entry
_COARSER = 10.0  # tolerance of a second computation, whose error is several times as large
_ROWS_DIFFER = 2.0  # joint rates are differences of two rows
_FEW = 2  # robots whose linear flows take no longer than waking other threads
_MOST_STEPS = 2e5  # of the linear flow: ten seconds or so
MOST_WORK = 2e9  # steps times the cube of the states: likewise of many modules
_MOST_NUMBERS = 1e8  # of the matrices of a period


@dataclass(frozen=True, eq=False, repr=False)
class PlanarModel(ReadOnlyArrays):
    """The paper's planar model (eq. 1) of one robot, period by period.

    The state is ``[vx, vy, w0, theta_1 .., theta_1' ..]``, length 2N+1 (see :mod:`chilopod.planar.dynamics`). Of the
    capabilities in :mod:`chilopod.stability.interface` it has orbit, scale, symmetries, switch times, error
    bound, and flows of many states or many robots at once; :class:`chilopod.planar.along.FollowedModel` adds flows of
    each state with its own robot. It has no tangents or frames, because its full derivative is small. A model is
    immutable: another robot needs another model.

    Parameters
    ----------
    robot
        Description of the robot.
    tolerance
        Tolerance of the nonlinear flow, relative to max(1, |x|). The straight walk does not use it: its derivative
        comes from the linearised equations by Taylor series, to round-off.
    use_symmetry
        True to offer the half-period symmetry of the gait, where it has one, to the analyses.
    """

    robot: Robot
    tolerance: float = TOLERANCE
    use_symmetry: bool = True

    @property
    def modules(self) -> int:
        """Number of modules N."""
        return self.robot.body.modules

    @property
    def dimension(self) -> int:
        """Number of states, 2N+1."""
        return 2 * self.modules + 1

    @property
    def period(self) -> float:
        """Duration of a gait cycle, s."""
        return self.robot.gait.period

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness of the yaw joints, N*m/rad, shape (N-1,)."""
        return read_only(np.array(self.robot.springs.stiffness))

    @cached_property
    def damping(self) -> Array:
        """Damping of the yaw joints, N*m*s/rad, shape (N-1,)."""
        return read_only(np.array(self.robot.springs.damping))

    @cached_property
    def orbit(self) -> Array:
        """The straight walk, shape (2N+1,): stance feet rest on the floor, so the robot moves at stride/stance."""
        state = np.zeros(self.dimension)
        state[0] = self.robot.gait.speed
        return read_only(state)

    @cached_property
    def scale(self) -> Array:
        """Typical size of the states: a module's length and a radian in a period, and a radian."""
        rate, joints = 1.0 / self.period, self.modules - 1
        return read_only(np.repeat([self.robot.module_length * rate, rate, 1.0, rate], [2, 1, joints, joints]))

    @property
    def schedule(self) -> Schedule:
        """Contact pattern of one period."""
        return self.robot.gait.schedule(self.modules)

    @cached_property
    def reflection(self) -> Array:
        """Matrix that mirrors a state left to right, shape (2N+1, 2N+1)."""
        signs = -np.ones(self.dimension)
        signs[0] = 1.0
        return read_only(np.diag(signs))

    @cached_property
    def symmetry(self) -> Array | None:
        """Reflection, if the right legs repeat the motion of the left legs half a period later; else None."""
        return self.reflection if self.use_symmetry and self.robot.gait.half_period_symmetric else None

    @property
    def spatial_symmetry(self) -> Array | None:
        """The reflection if left and right legs move together, else None."""
        turns = self.robot.gait.side_phase / (2.0 * np.pi)
        return self.reflection if abs(turns - round(turns)) < _SAME_INSTANT else None

    def flow(self, x: ArrayLike, t0: float, t1: float) -> tuple[Array, Array]:
        """State at t1 of the robot that is in state x, shape (2N+1,), at t0, and its derivative with respect to x.

        Times are in s, ``t0 <= t1``; the gait is at phase 0 at time 0. AnalysisError if the motion diverges.
        """
        x = self._checked(x)
        if (x == self.orbit).all():
            return self.flow_with_error(x, t0, t1)[:2]
        return self._tangents(x, np.eye(self.dimension), t0, t1, self.tolerance)

    def flow_with_error(self, x: ArrayLike, t0: float, t1: float) -> tuple[Array, Array, float | Array]:
        """:meth:`flow`, and a bound on the error of the largest entry of the derivative, or of each entry."""
        x = self._checked(x)
        if (x == self.orbit).all():
            to_joint, from_joint = joint_rates(self.modules)
            matrix = from_joint.copy()
            error, _ = linear.propagate(*self._linear_pieces(t0, t1), matrix)
            return x, to_joint @ matrix, _ROWS_DIFFER * error
        state, derivative = self._tangents(x, np.eye(self.dimension), t0, t1, self.tolerance)
        sizes = self.scale
        units = sizes[:, None] / sizes
        # Against finer steps the global error stays within some tens of the tolerance per step, times the growth of the
        # motion; the derivative is that of a motion with this error, which adds the growth once more. Of a fast motion
        # of many steps the error is larger: less than the difference from a coarser computation in any direction.
        growth = max(1.0, float(np.abs(derivative / units).max()))
        along = sizes * np.cos(2.0 * np.arange(self.dimension) + 0.3)
        coarse = self._tangents(x, along[None], t0, t1, _COARSER * self.tolerance)[1][:, 0]
        off = _SPREAD * float((np.abs(coarse - derivative @ along) / sizes).max())
        return state, derivative, max(100.0 * self.tolerance * growth**2, off) * units

    def _tangents(self, x: Array, directions: Array, t0: float, t1: float, tolerance: float) -> tuple[Array, Array]:
        """State at t1 and its derivative along directions of the state at t0, shape (directions, 2N+1), as columns; by
        the nonlinear equations."""
        batch = x + 1j * COMPLEX_STEP * directions
        carry_tangents(self, batch, t0, t1, tolerance)
        return batch[0].real.copy(), batch.imag.T / COMPLEX_STEP

    def flow_states(self, states: ArrayLike, t0: float, t1: float) -> Array:
        """Carry many states, shape (states, 2N+1), on all cores, without derivatives."""
        batch = self._checked(states, "states", several=True)
        carry([self], batch, t0, t1, self.tolerance)
        return batch

    def rhs(self, t: float, x: ArrayLike) -> Array:
        """dx/dt at time t (s) in state x, shape (2N+1,)."""
        x = self._checked(x)
        starts, _, interval = self._pieces(t, t + self.period)
        out = np.empty_like(x)
        scratch = np.empty((self.modules, SCRATCH))
        *numbers, moments = _numbers(self, interval[:1])
        compiled_rhs(float(starts[0]), x, (*numbers, moments[0], scratch), out)
        return out

    def drift(self, x: ArrayLike) -> Drift:
        """Motion over the floor in one period that starts in state x at time 0."""
        batch = np.append(self._checked(x), np.zeros(3))[None]
        carry([self], batch, 0.0, self.period, self.tolerance)
        forward, left, turn = batch[0, -3:].tolist()
        return Drift(forward, left, turn, self.period)

    @cached_property
    def scalars(self) -> Array:
        """Numbers of a module for the compiled right-hand side: length (m), mass (kg), yaw inertia (kg*m^2) and
        the speed of its feet (m/s), shape (1, 4)."""
        robot = self.robot
        sizes = [[robot.module_length, robot.module_mass, robot.module_yaw_inertia, robot.gait.speed]]
        return read_only(np.array(sizes))

    def moments(self, interval: NDArray[np.intp]) -> Array:
        """Contact moments (see :mod:`chilopod.planar.contact`) at the start of intervals, shape (intervals, N, 8)."""
        legs = self.robot.legs
        moments = contact_moments(legs.forward_offset, legs.half_width, self.robot.ground.friction, self.schedule)
        return moments[interval]

    @property
    def contraction(self) -> float:
        """Upper bound on the decay of the fastest motion about the straight walk, in factors of e in a period."""
        return float(self._linearised[3] @ np.diff(self.schedule.times))

    @staticmethod
    def flow_many(models: Sequence[PlanarModel], t0: float, t1: float) -> tuple[Array, Array]:
        """Derivative of the flow on the straight walks of many robots with one gait and size, on all cores.

        Returns
        -------
        Derivatives, shape (robots, 2N+1, 2N+1), and the bounds on the error of their largest entries, shape (robots,).
        """
        if not models or not all(models[0].can_flow_with(model) for model in models[1:]):
            raise ParameterError("must have the same gait and number of modules", field="models")
        parts = [model._linear_pieces(t0, t1) for model in models]
        widths, *_, clock = parts[0]
        upper, decay, frequency = (np.stack([each[part] for each in parts]) for part in (1, 2, 3))
        to_joint, from_joint = joint_rates(models[0].modules)
        matrices = np.tile(from_joint, (len(models), 1, 1))
        errors = np.empty(len(models))
        if len(models) <= _FEW:
            for i, matrix in enumerate(matrices):
                errors[i], _ = linear.propagate(widths, upper[i], decay[i], frequency[i], clock, matrix)
        else:
            linear.propagate_batch(widths, upper, decay, frequency, clock, matrices, errors, deadline.stop())
            deadline.check()
        return to_joint @ matrices, _ROWS_DIFFER * errors

    def can_flow_with(self, other: PlanarModel) -> bool:
        """True if :meth:`flow_many` accepts both robots in one call: their gait and number of modules are the same."""
        here, there = self.robot, other.robot
        return self.modules == other.modules and (here.gait is there.gait or here.gait == there.gait)

    # -- inside
    # ---------------------------------------------------------------------------------------------------------------

    def _checked(self, given: ArrayLike, field: str = "x", several: bool = False) -> Array:
        """Copy of a state, or of several."""
        states = np.array(given, dtype=np.float64, order="C")
        if states.ndim != 1 + several or states.shape[-1] != self.dimension:
            allowed = f"(any number, {self.dimension})" if several else f"({self.dimension},)"
            raise ParameterError(f"has the wrong shape {states.shape}", field=field, allowed=allowed)
        if not np.isfinite(states).all():
            raise ParameterError("must be finite", field=field)
        return states

    def _pieces(self, t0: float, t1: float) -> tuple[Array, Array, NDArray[np.intp]]:
        return pieces(self.robot.gait, self.modules, t0, t1)

    @cached_property
    def _linearised(self) -> tuple[Array, Array, Array, Array, float]:
        """Linear equations of one period: the passive matrices, the contribution of springs and dampers to A0, the
        fastest decay in every interval, and the frequency of the springs."""
        robot = self.robot
        n, intervals = self.modules, len(self.schedule.times) - 1
        if 3 * intervals * (n + 2) * (2 * n + 1) > _MOST_NUMBERS:
            said = f"the periodic walk takes too many equations: a period has {intervals} intervals of constant contact"
            allowed = "fewer modules, or phases with which many legs touch down at once"
            raise AnalysisError(said, field="body.modules", value=n, allowed=allowed)
        feet = robot.legs.forward_offset, robot.legs.half_width, robot.ground.friction
        passive, joint, rates, decay = _passive_matrices(robot.gait, n, *self.scalars[0, :3].tolist(), *feet)
        compliance = rates @ joint
        return (
            passive,
            read_only(joint * self.stiffness),
            read_only(joint * self.damping @ rates),
            read_only(decay + linear.joint_bound(compliance, self.damping)),
            float(np.sqrt(linear.joint_bound(compliance, self.stiffness))),
        )

    def _linear_pieces(self, t0: float, t1: float) -> tuple[Array, Array, Array, float, float]:
        """Arguments of :func:`linear.propagate`: widths of the pieces, upper rows of A0, A1, A2 of every piece about
        its own start, its fastest decay, the frequency of the springs, and the largest time."""
        passive, springs, dampers, decay, frequency = self._linearised
        starts, widths, interval = self._pieces(t0, t1)
        upper = passive[interval]
        if starts.any():
            t = starts[:, None, None]
            upper[:, :, 0] += t * (upper[:, :, 1] + t * upper[:, :, 2])
            upper[:, :, 1] += 2.0 * t * upper[:, :, 2]
        n = self.modules
        upper[:, :, 0, n + 2 :] -= springs
        if self.damping.any():
            upper[:, :, 0, : n + 2] -= dampers
        decay = decay[interval]
        steps = linear.steps(widths, decay, frequency)
        if not steps < _MOST_STEPS or not steps * self.dimension**3 < MOST_WORK:
            walked = f"from {t0:g} s to {t1:g} s: about {steps:.0e} steps of {self.dimension} states"
            allowed = "less stiffness, damping or friction, or more mass, or fewer modules"
            raise AnalysisError(f"motion is too fast to follow {walked}", field="springs, ground", allowed=allowed)
        return widths, upper, decay, frequency, max(abs(t0), abs(t1), self.period)


def carry(
    models: Sequence[PlanarModel], states: Array, t0: float, t1: float, tolerance: float, nodes: ArrayLike = ()
) -> Array:
    """Carry states of robots of one gait and size, shape (states, 2N+1) or with poses behind (states, 2N+4), in place
    on all cores, one robot for all states or one each; AnalysisError if a motion diverges.

    Nodes are parts of every piece between two switches, rising, 0 to 1. Returns the reduced states there, shape
    (states, pieces, nodes, 2N+1).
    """
    first, (count, size) = models[0], states.shape
    n, parts = first.dimension, np.append(nodes, 1.0)
    if size not in (n, n + 3) or len(models) not in (1, count):
        allowed = f"({len(models)} or any number, {n} or {n + 3})"
        raise ParameterError(f"has the wrong shape {states.shape}", field="states", allowed=allowed)
    starts, widths, interval = first._pieces(t0, t1)
    ends = widths[:, None] * parts
    begins = np.hstack([np.zeros((widths.size, 1)), ends[:, :-1]])
    sample = np.full(ends.shape, -1)
    sample[:, :-1] = np.arange(widths.size * (parts.size - 1)).reshape(widths.size, parts.size - 1)
    record = np.empty((widths.size * (parts.size - 1), count, n + 3))
    if count and widths.size:
        whole = np.zeros((count, n + 3))
        whole[:, :size] = states
        times = (starts[:, None] + begins).ravel(), (ends - begins).ravel()
        if not walk(models, whole, (*times, np.repeat(interval, parts.size), sample.ravel()), tolerance, record):
            raise _diverged(t0, t1)
        states[:] = whole[:, :size]
    return np.moveaxis(record[..., :n].reshape(widths.size, parts.size - 1, count, n), 2, 0)


def carry_tangents(model: PlanarModel, states: ComplexArray, t0: float, t1: float, tolerance: float) -> None:
    """Carry states with a tangent each, shape (states, 2N+1), in place; AnalysisError if a motion diverges."""
    starts, widths, interval = model._pieces(t0, t1)
    if not advance(starts, widths, _numbers(model, interval), states, tolerance):
        raise _diverged(t0, t1)


def _diverged(t0: float, t1: float) -> AnalysisError:
    return AnalysisError(f"the motion must stay finite, but it diverges between {t0:g} s and {t1:g} s", field="x")


def _numbers(model: PlanarModel, interval: NDArray[np.intp]) -> tuple[Array, Array, Array, Array]:
    """Copies of the model's scalars, stiffness, damping and contact moments: numba compiles once more for read-only
    arrays."""
    return model.scalars[0].copy(), model.stiffness.copy(), model.damping.copy(), model.moments(interval)


def walk(
    models: Sequence[PlanarModel], states: Array, pieces: tuple[Any, Any, Any, Any], tolerance: float, record: Array
) -> bool:
    """Carry states with poses, of one robot or one each, through pieces of time without commands, in place; False if a
    motion diverges.

    Pieces have starts, widths, contact intervals and numbers of samples, and the record those, as for
    :func:`chilopod.planar.stretch.carry`.
    """
    count, schedule, robots = len(states), models[0].schedule, [model.robot for model in models]

    def each(values: Sequence[ArrayLike]) -> Array:
        return np.repeat(np.array(values), count // len(models), axis=0)

    feet = each([(robot.legs.forward_offset, robot.legs.half_width) for robot in robots])
    friction = each([np.full((models[0].modules, 2), robot.ground.friction) for robot in robots])
    damping = each([model.damping for model in models])
    profile = np.zeros((7, *damping.shape))
    profile[FROM] = profile[GOAL] = each([model.stiffness for model in models])
    none, scalars = np.zeros_like(damping), each([model.scalars[0] for model in models])
    alike = stretch.Robots(scalars, feet, damping, friction, profile, none, none, np.zeros((count, 2)), np.inf)
    when = stretch.Pieces(np.zeros(len(pieces[0])), *pieces, schedule.contact, schedule.stroke)
    step, status = np.zeros(count), np.full(count, stretch.WALKING)
    stretch.carry(np.arange(count), when, alike, tolerance, states, step, status, record)
    return bool((status == stretch.WALKING).all())


def states_at(models: Sequence[PlanarModel], states: Array, begin: float, times: Array, tolerance: float) -> Array:
    """States of walks without commands at rising times from their begin on (s), shape (times, walks, 2N+4), NaN after a
    walk fails. Models of one gait and size start in ``states`` with poses, shape (walks, 2N+4); the tolerance is that
    of a step, relative to max(1, |state|)."""
    starts, widths, interval = models[0]._pieces(begin, float(times[-1]))
    switches = begin + np.append(0.0, widths.cumsum()[:-1])
    cuts = np.union1d(switches, times)
    here, ends = cuts[:-1], cuts[1:]
    at, sample = np.searchsorted(switches, here, side="right") - 1, np.searchsorted(times, ends)
    sample[times[np.minimum(sample, times.size - 1)] != ends] = -1
    record = np.full((times.size, *states.shape), np.nan)
    record[times == begin] = states
    parts = starts[at] + here - switches[at], ends - here, interval[at], sample
    walk(models, states.copy(), parts, tolerance, record)
    return record


@lru_cache(maxsize=32)
def _passive_matrices(
    gait: Gait,
    modules: int,
    length: float,
    mass: float,
    inertia: float,
    offset: float,
    half_width: float,
    friction: float,
) -> tuple[Array, Array, Array, Array]:
    """:func:`linear.system_matrices` of one period; a sweep over springs computes them once."""
    schedule = gait.schedule(modules)
    moments, durations = contact_moments(offset, half_width, friction, schedule), np.diff(schedule.times)
    passive, joint, rates, decay = linear.system_matrices(length, mass, inertia, gait.speed, moments, durations)
    return read_only(passive), read_only(joint), read_only(rates), read_only(decay)


@lru_cache(maxsize=64)
def joint_rates(modules: int) -> tuple[Array, Array]:
    """Change of coordinates from (vx, vy, w_0 .. w_{N-1}, theta) to (vx, vy, w_0, theta, theta'), and back."""
    n = modules
    matrix, joints = np.zeros((2 * n + 1, 2 * n + 1)), np.arange(n - 1)
    matrix[:3, :3] = np.eye(3)
    matrix[3 + joints, n + 2 + joints] = 1.0
    matrix[n + 2 + joints, 3 + joints] = 1.0
    matrix[n + 2 + joints, 2 + joints] = -1.0
    return matrix, np.rint(np.linalg.inv(matrix))
