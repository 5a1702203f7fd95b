"""The straight walk's linearised model a second time, written plainly and sharing nothing with chilopod.

Benchmarks give it to other tools, tests use it as an independent computation. Everything is SI.

The robot walks straight along x at the speed v = stride/stance of its stance feet. A small disturbance is
z = (vx, vy, w_0 .. w_{N-1}, theta_1 .. theta_{N-1}): the front module's velocity in its own frame, the absolute yaw
rates of all modules (front to rear) and the joint angles, 2N + 1 numbers. Between two contact switches

    dz/dt = A(t) z,   A(t) = A0 + A1 t + A2 t^2   (t counted from the start of the segment)

holds exactly, because a stance foot moves at constant speed along its module and enters A(t) at most squared.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

N_MM_PER_DEG = 1e-3 * 180.0 / pi  # one N*mm/deg in N*m/rad


@dataclass(frozen=True)
class PeerRobot:
    """The planar robot of Aoi et al. (2022): its springs are 41 N*mm/deg, front to rear, unless told otherwise."""

    modules: int = 6
    length: float = 1.35
    mass: float = 8.5
    stiffness: tuple[float, ...] = field(default=(41.0 * N_MM_PER_DEG,) * 5)
    damping: tuple[float, ...] = field(default=(0.0,) * 5)
    forward_offset: float = 0.0493
    half_width: float = 0.0732
    stride: float = 0.03
    stance: float = 0.31
    swing: float = 0.29
    module_phase: float = 1.0 / 3.0  # of a period
    side_phase: float = 0.5
    friction: float = 246.5

    @property
    def period(self) -> float:
        return self.stance + self.swing

    @property
    def speed(self) -> float:
        return self.stride / self.stance


def with_springs(first: float, others: float | None = None, modules: int = 6) -> PeerRobot:
    """Springs in N*mm/deg: the first joint's, and those of all others (default: the same)."""
    rest = first if others is None else others
    joints = modules - 1
    springs = (first * N_MM_PER_DEG, *(rest * N_MM_PER_DEG for _ in range(joints - 1)))
    length, mass = 1.35 * modules / 6, 8.5 * modules / 6
    return PeerRobot(modules=modules, length=length, mass=mass, stiffness=springs, damping=(0.0,) * joints)


def switch_times(robot: PeerRobot) -> Array:
    """Every touch-down and lift-off in one period, with both of its ends, rising and without repeats."""
    times = [0.0, robot.period]
    for i in range(robot.modules):
        for s in (0, 1):
            lead = i * robot.module_phase + s * robot.side_phase
            times += [(event - lead) % 1.0 * robot.period for event in (0.0, robot.stance / robot.period)]
    rising = np.sort(times)
    return rising[np.concatenate([[True], np.diff(rising) > 1e-12 * robot.period])]


def feet_on_ground(robot: PeerRobot, t: float) -> list[tuple[int, float, float]]:
    """Stance feet at time t: (module, x ahead of the module's centre, y to its left)."""
    feet = []
    for i in range(robot.modules):
        for s, y in ((0, robot.half_width), (1, -robot.half_width)):
            phase = (t / robot.period + i * robot.module_phase + s * robot.side_phase) % 1.0
            if phase * robot.period < robot.stance:
                x = robot.forward_offset + robot.stride / 2 - robot.speed * phase * robot.period
                feet.append((i, x, y))
    return feet


def constant_parts(robot: PeerRobot, dtype: Any = np.float64) -> tuple[Array, Array, Array, Array, Array]:
    """Rows of lateral velocity and of yaw rate (module x velocity), joint rates, angle sums, inverse mass matrix."""
    n = robot.modules
    half = dtype(robot.length) / (2 * n)
    m = dtype(robot.mass) / n
    yaw_inertia = m * (2 * half) ** 2 / 12
    rates = np.zeros((n, n + 2), dtype)
    rates[:, 2:] = np.eye(n, dtype=dtype)
    lateral = np.zeros((n, n + 2), dtype)
    lateral[:, 1] = 1
    for i in range(1, n):
        lateral[i] = lateral[i - 1] - half * (rates[i - 1] + rates[i])
    joint_rates = rates[1:] - rates[:-1]
    angle_sums = np.tril(np.ones((n, n - 1), dtype), -1)  # heading of each module relative to the first
    mass = m * lateral.T @ lateral + yaw_inertia * rates.T @ rates
    mass[0, 0] = n * m
    return lateral, rates, joint_rates, angle_sums, inverse(mass)


def inverse(a: Array) -> Array:
    """Gauss-Jordan inverse of a positive definite matrix in its own precision (numpy.linalg stops at double)."""
    n = len(a)
    work = np.hstack([a, np.eye(n, dtype=a.dtype)])
    for k in range(n):
        work[k] /= work[k, k]
        for i in range(n):
            if i != k:
                work[i] -= work[i, k] * work[k]
    return work[:, n:]


def segment(robot: PeerRobot, t0: float, t1: float, dtype: Any = np.float64) -> tuple[Array, Array, Array]:
    """A0, A1, A2 of the segment from t0 to t1, between which no foot is lifted or set down."""
    n = robot.modules
    lateral, rates, joint_rates, angle_sums, inverse_mass = constant_parts(robot, dtype)
    speed = dtype(robot.stride) / dtype(robot.stance)
    middle = (t0 + t1) / 2
    force = np.zeros((3, n + 2, 2 * n + 1), dtype)  # generalised force = (F0 + F1 t + F2 t^2) z
    m = dtype(robot.mass) / n
    force[0, :, : n + 2] -= m * speed * np.outer(lateral.sum(0), rates[0])
    for j in range(n - 1):
        force[0, :, n + 2 + j] -= dtype(robot.stiffness[j]) * joint_rates[j]
        force[0, :, : n + 2] -= dtype(robot.damping[j]) * np.outer(joint_rates[j], joint_rates[j])
    forward = np.zeros(n + 2, dtype)
    forward[0] = 1
    c = dtype(robot.friction)
    for i, x, y in feet_on_ground(robot, middle):
        at_start = dtype(x) + speed * dtype(middle - t0)
        along = forward - dtype(y) * rates[i]
        across = (lateral[i] + at_start * rates[i], -speed * rates[i])  # a(t) = across[0] + across[1] t
        slip = np.zeros((2, 2 * n + 1), dtype)  # velocity of the foot across its module, as a row acting on z
        slip[0, : n + 2], slip[1, : n + 2] = across
        slip[0, n + 2 :] = -speed * angle_sums[i]
        force[0, :, : n + 2] -= c * np.outer(along, along)
        force[0] -= c * np.outer(across[0], slip[0])
        force[1] -= c * (np.outer(across[0], slip[1]) + np.outer(across[1], slip[0]))
        force[2] -= c * np.outer(across[1], slip[1])
    a = np.zeros((3, 2 * n + 1, 2 * n + 1), dtype)
    for k in range(3):
        a[k, : n + 2] = inverse_mass @ force[k]
    a[0, n + 2 :, : n + 2] = joint_rates
    return a[0], a[1], a[2]


def transition(a0: Array, a1: Array, a2: Array, duration: Any, reach: float = 0.5) -> Array:
    """Solution at t = duration of dX/dt = (A0 + A1 t + A2 t^2) X from the identity: Taylor series, step after step.

    The terms obey (k+1) X_{k+1} = A0 X_k + A1 X_{k-1} + A2 X_{k-2}. `reach` bounds step times norm of A.
    """
    dtype = a0.dtype.type
    norm = max(np.abs(a0).sum(1).max(), np.abs(a0 + duration * (a1 + duration * a2)).sum(1).max())
    steps = int(np.ceil(float(norm * duration) / reach))
    h = dtype(duration) / steps
    x = np.eye(len(a0), dtype=dtype)
    small = np.finfo(dtype).eps / 8
    for step in range(steps):
        t = h * step
        b0, b1, b2 = (a0 + t * (a1 + t * a2)) * h, (a1 + 2 * t * a2) * h * h, a2 * h * h * h
        older, old, term = np.zeros_like(x), np.zeros_like(x), x
        total, k, quiet = x.copy(), 0, 0
        while quiet < 3:
            older, old, term = old, term, (b0 @ term + b1 @ old + b2 @ older) / (k + 1)
            total += term
            k += 1
            quiet = quiet + 1 if np.abs(term).max() <= small * np.abs(total).max() else 0
        x = total
    return x


def flow(robot: PeerRobot, periods: float = 1.0, dtype: Any = np.float64, reach: float = 0.5) -> Array:
    """Derivative of the flow from t = 0 over a whole or half period (1.0 or 0.5)."""
    end = periods * robot.period
    times = switch_times(robot)
    times = np.append(times[times < end * (1 - 1e-12)], end)
    x = np.eye(2 * robot.modules + 1, dtype=dtype)
    for t0, t1 in zip(times[:-1], times[1:], strict=True):
        x = transition(*segment(robot, t0, t1, dtype), dtype(t1) - dtype(t0), reach) @ x
    return x


def mirror(robot: PeerRobot) -> Array:
    """Left and right exchanged: only the forward velocity keeps its sign."""
    signs = -np.ones(2 * robot.modules + 1)
    signs[0] = 1.0
    return np.diag(signs)


def half_period_map(robot: PeerRobot, dtype: Any = np.float64) -> Array:
    """mirror * flow(T/2); its square is the whole period's map. Holds for side phase one half only."""
    return mirror(robot).astype(dtype) @ flow(robot, 0.5, dtype)


def multipliers(robot: PeerRobot) -> Array:
    """Multipliers of the whole period, largest first."""
    nu = np.linalg.eigvals(half_period_map(robot)) ** 2 if robot.side_phase == 0.5 else np.linalg.eigvals(flow(robot))
    return nu[np.argsort(-np.abs(nu))]
