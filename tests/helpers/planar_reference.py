"""The linearised straight walk once more, in 80-bit arithmetic and in small steps; the referee of the error bounds.

Written from the mechanics, foot by foot, and sharing nothing with the package but the robot's numbers. A disturbance is
z = (vx, vy, w_0 .. w_{N-1}, theta_1 .. theta_{N-1}) with absolute yaw rates; results are in the package's coordinates
(vx, vy, w_0, theta, theta').
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

LD = np.longdouble
PI = LD("3.14159265358979323846264338327950288")
EXTENDED = float(np.finfo(LD).eps) < 1e-18
"""Whether this machine's long double is finer than double."""

Array = Any


def solve(a: Array, b: Array) -> Array:
    """Gaussian elimination with partial pivoting, in the precision of its arguments."""
    n = len(a)
    work = np.hstack([a, b])
    for k in range(n):
        pivot = k + int(np.abs(work[k:, k]).argmax())
        work[[k, pivot]] = work[[pivot, k]]
        work[k] /= work[k, k]
        for i in range(n):
            if i != k:
                work[i] -= work[i, k] * work[k]
    return work[:, n:]


def coordinates(n: int) -> tuple[Array, Array]:
    """Matrix from absolute yaw rates to the package's coordinates, and back."""
    there = np.zeros((2 * n + 1, 2 * n + 1), LD)
    back = np.zeros_like(there)
    there[:3, :3] = back[:3, :3] = np.eye(3)
    for j in range(n - 1):
        there[3 + j, n + 2 + j] = 1
        there[n + 2 + j, 3 + j], there[n + 2 + j, 2 + j] = 1, -1
        back[n + 2 + j, 3 + j] = 1
        back[3 + j, 2] = 1
        back[3 + j, n + 2 : n + 3 + j] = 1
    return there, back


def turns(radians: float) -> Any:
    """The phase that is meant: a fraction of a turn of up to six digits where the angle is one to its last bit."""
    fraction = Fraction(radians / (2.0 * float(PI))).limit_denominator(10**6)
    meant = LD(fraction.numerator) / LD(fraction.denominator)
    return meant if abs(radians - 2 * PI * meant) < 1e-15 * max(1.0, abs(radians)) else radians / (2 * PI)


def legs(robot: Any) -> Array:
    """Phase of every leg at time 0, cycles, shape (N, 2)."""
    gait = robot.gait
    i, s = np.arange(robot.body.modules)[:, None], np.arange(2)[None]
    return i * turns(gait.module_phase) + s * turns(gait.side_phase)


def switches(robot: Any, t0: float, t1: float) -> Array:
    """t0, the instants in between at which a foot touches down or lifts off, and t1."""
    stance, period = LD(robot.gait.stance), LD(robot.gait.stance) + LD(robot.gait.swing)
    cycles = np.arange(np.floor(t0 / period) - 1, np.ceil(t1 / period) + 2)
    times = [(cycles[:, None, None] + (event - legs(robot)) % 1) * period for event in (LD(0), stance / period)]
    events = np.sort(np.concatenate([each.ravel() for each in times]))
    events = events[(events > t0) & (events < t1)]
    return np.concatenate([[LD(t0)], events, [LD(t1)]])


def segment(robot: Any, start: Any, end: Any) -> Array:
    """Upper rows of A0, A1, A2, shape (3, N+2, 2N+1); time counts from the start of the segment."""
    n, gait = robot.body.modules, robot.gait
    length, m = LD(robot.body.length) / n, LD(robot.body.mass) / n
    inertia = m * length**2 / 12 if robot.body.yaw_inertia is None else LD(robot.body.yaw_inertia)
    speed, period = LD(gait.stride) / LD(gait.stance), LD(gait.stance) + LD(gait.swing)
    yaw = np.zeros((n, n + 2), LD)
    yaw[:, 2:] = np.eye(n)
    lateral = np.zeros((n, n + 2), LD)
    lateral[:, 1] = 1
    for i in range(1, n):
        lateral[i] = lateral[i - 1] - length / 2 * (yaw[i - 1] + yaw[i])
    bend, sums = yaw[1:] - yaw[:-1], np.tril(np.ones((n, n - 1), LD), -1)
    mass = m * lateral.T @ lateral + inertia * yaw.T @ yaw
    mass[0, 0] = n * m

    phase = ((start + end) / (2 * period) + legs(robot)) % 1
    force = np.zeros((3, n + 2, 2 * n + 1), LD)
    force[0, :, : n + 2] -= m * speed * np.outer(lateral.sum(0), yaw[0])
    force[0, :, n + 2 :] -= bend.T * np.array([LD(k) for k in robot.springs.stiffness])
    force[0, :, : n + 2] -= (bend.T * np.array([LD(d) for d in robot.springs.damping])) @ bend
    c = LD(robot.ground.friction)
    for i in range(n):
        for s, side in ((0, 1), (1, -1)):
            since = phase[i, s] * period - (end - start) / 2  # touch-down, at the start of the segment
            if phase[i, s] * period >= LD(gait.stance):
                continue
            x = LD(robot.legs.forward_offset) + LD(gait.stride) / 2 - speed * since
            along = -side * LD(robot.legs.half_width) * yaw[i]
            along[0] += 1
            push = np.stack([lateral[i] + x * yaw[i], -speed * yaw[i]])  # coefficients of 1, t
            slip = np.zeros((2, 2 * n + 1), LD)
            slip[:, : n + 2] = push
            slip[0, n + 2 :] = -speed * sums[i]
            force[0, :, : n + 2] -= c * np.outer(along, along)
            force[0] -= c * np.outer(push[0], slip[0])
            force[1] -= c * (np.outer(push[0], slip[1]) + np.outer(push[1], slip[0]))
            force[2] -= c * np.outer(push[1], slip[1])
    return solve(mass, np.concatenate(list(force), axis=1)).reshape(n + 2, 3, 2 * n + 1).transpose(1, 0, 2)


def carry(upper: Array, duration: Any, x: Array, reach: float) -> Array:
    """Taylor steps through one segment; ``reach`` bounds step times the largest eigenvalue."""
    _, v, size = upper.shape
    full = np.zeros((size, size))
    full[:v] = upper[0]
    full[range(v, size), range(2, v - 1)] = -1
    full[range(v, size), range(3, v)] = 1
    radius = max(np.abs(np.linalg.eigvals(full)).max(), np.linalg.eigvals(full[:v, :v]).real.__abs__().max())
    steps = max(1, int(np.ceil(float(radius * duration) / reach)))
    h = duration / steps
    small = np.finfo(LD).eps / 16
    for step in range(steps):
        t = h * step
        a0, a1, a2 = upper
        block = np.concatenate([h * (a0 + t * (a1 + t * a2)), h * h * (a1 + 2 * t * a2), h * h * h * a2], axis=1)
        terms = np.concatenate([x, np.zeros((2 * size, x.shape[1]), LD)])
        total, k, quiet = x.copy(), 1, 0
        while quiet < 3:
            new = np.empty_like(x)
            new[:v] = block @ terms / k
            new[v:] = (terms[3:v] - terms[2 : v - 1]) * (h / k)
            terms = np.concatenate([new, terms[: 2 * size]])
            total += new
            k += 1
            quiet = quiet + 1 if np.abs(new).max() <= small * np.abs(total).max() else 0
        x = total
    return x


def fine_flow(robot: Any, t0: float, t1: float, columns: Any = None, reach: float = 2.0) -> Array:
    """Derivative of the flow on the straight walk, (2N+1, 2N+1) or some of its columns."""
    n = robot.body.modules
    there, back = coordinates(n)
    x = back if columns is None else back[:, columns]
    times = switches(robot, t0, t1)
    for start, end in zip(times[:-1], times[1:], strict=True):
        if end > start:
            x = carry(segment(robot, start, end), end - start, x, reach)
    return there @ x
