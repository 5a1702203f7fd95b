"""Other tools computing the half- or whole-period map of the straight walk, each as well as we know how to use it.

Every peer takes (robot, periods, tolerance) and returns a function of the springs (N*m/rad, front to rear) that returns
the map as a matrix. All of them step from switch to switch, but for `scipy_naive`. What can be prepared beforehand
(compiling, segment matrices that do not depend on the springs) is done outside the returned function and not timed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from peer_model import Array, PeerRobot, constant_parts, feet_on_ground, segment, switch_times, transition

Map = Callable[[Sequence[float]], Array]


def _intervals(robot: PeerRobot, periods: float) -> list[tuple[float, float]]:
    end = periods * robot.period
    times = switch_times(robot)
    times = np.append(times[times < end * (1 - 1e-12)], end)
    return [(float(a), float(b)) for a, b in zip(times[:-1], times[1:], strict=True)]


def _spring_columns(robot: PeerRobot) -> Array:
    """d(A0)/d(stiffness of joint j), for each j: only the column of its own angle."""
    n = robot.modules
    _, _, joint_rates, _, inverse_mass = constant_parts(robot)
    return np.array([-inverse_mass @ joint_rates[j] for j in range(n - 1)])


def _matrices(robot: PeerRobot, periods: float) -> Callable[[Sequence[float]], list[tuple[float, Array]]]:
    """For given springs: duration and (A0, A1, A2) of each segment."""
    n = robot.modules
    columns = _spring_columns(robot)
    parts = [(t1 - t0, np.array(segment(robot, t0, t1))) for t0, t1 in _intervals(robot, periods)]

    def matrices(springs: Sequence[float]) -> list[tuple[float, Array]]:
        result = []
        for length, a in parts:
            b = a.copy()
            for j in range(n - 1):
                b[0, : n + 2, n + 2 + j] += (springs[j] - robot.stiffness[j]) * columns[j]
            result.append((length, b))
        return result

    return matrices


@numba.njit(cache=True)
def _polynomial_rhs(t: float, y: Array, a: Array) -> Array:
    n = a.shape[1]
    x = y.reshape(n, n)
    at = a[0] + t * (a[1] + t * a[2])
    return (at @ x).ravel()


def scipy_segments(method: str) -> Callable[[PeerRobot, float, float], Map]:
    """scipy's solve_ivp from switch to switch with a compiled right-hand side."""

    def prepare(robot: PeerRobot, periods: float, tolerance: float) -> Map:
        matrices, n = _matrices(robot, periods), 2 * robot.modules + 1

        def compute(springs: Sequence[float]) -> Array:
            x = np.eye(n)
            for length, a in matrices(springs):
                options = {"method": method, "rtol": tolerance, "atol": tolerance * 1e-2, "args": (a,)}
                x = solve_ivp(_polynomial_rhs, (0.0, length), x.ravel(), **options).y[:, -1].reshape(n, n)
            return x

        return compute

    return prepare


@numba.njit(cache=True)
def _naive_rhs(t: float, y: Array, first: Array, lateral: Array, sums: Array, inverse_mass: Array, p: Array) -> Array:
    period, stance, stride, offset, width, friction, module_phase, side_phase = p
    n, size = lateral.shape[0], first.shape[0]
    speed = stride / stance
    x = y.reshape(size, size)
    force = np.zeros((n + 2, size))
    for i in range(n):
        for s in range(2):
            phase = (t / period + i * module_phase + s * side_phase) % 1.0
            if phase * period < stance:
                ahead = offset + stride / 2 - speed * phase * period
                left = width - 2 * width * s
                for column in range(size):
                    along = x[0, column] - left * x[2 + i, column]
                    across = ahead * x[2 + i, column]
                    for k in range(n + 2):
                        across += lateral[i, k] * x[k, column]
                    for j in range(n - 1):
                        across -= speed * sums[i, j] * x[n + 2 + j, column]
                    force[0, column] -= friction * along
                    force[2 + i, column] -= friction * (ahead * across - left * along)
                    for k in range(n + 2):
                        force[k, column] -= friction * lateral[i, k] * across
    result = first @ x
    result[: n + 2] += inverse_mass @ force
    return result.ravel()


def scipy_naive(robot: PeerRobot, periods: float, tolerance: float) -> Map:
    """solve_ivp (DOP853) in one call, the contact pattern computed from t inside the compiled right-hand side."""
    n = robot.modules
    lateral, _, _, sums, inverse_mass = constant_parts(robot)
    names = ("period", "stance", "stride", "forward_offset", "half_width", "friction", "module_phase", "side_phase")
    p = np.array([getattr(robot, name) for name in names])
    columns = _spring_columns(robot)
    rest = PeerRobot(**{**vars(robot), "friction": 0.0, "stiffness": (0.0,) * (n - 1)})
    without_feet = segment(rest, 0.0, 1e-9)[0]

    def compute(springs: Sequence[float]) -> Array:
        first = without_feet.copy()
        for j in range(n - 1):
            first[: n + 2, n + 2 + j] += springs[j] * columns[j]
        end = periods * robot.period
        options: dict[str, Any] = {"method": "DOP853", "rtol": tolerance, "atol": tolerance * 1e-2}
        options["args"] = (first, lateral, sums, np.ascontiguousarray(inverse_mass), p)
        size = 2 * n + 1
        return solve_ivp(_naive_rhs, (0.0, end), np.eye(size).ravel(), **options).y[:, -1].reshape(size, size)

    return compute


def numpy_taylor(robot: PeerRobot, periods: float, tolerance: float) -> Map:
    """The plain Taylor series of peer_model, no compiler (always to double precision, whatever the tolerance)."""
    del tolerance
    matrices = _matrices(robot, periods)

    def compute(springs: Sequence[float]) -> Array:
        x = np.eye(2 * robot.modules + 1)
        for length, a in matrices(springs):
            x = transition(a[0], a[1], a[2], length, 4.0) @ x
        return x

    return compute


def heyoka_taylor(batch: int) -> Callable[[PeerRobot, float, float], Map]:
    """heyoka: Taylor integration of the linear equations from switch to switch, `batch` columns at once (SIMD).

    The contact pattern of a segment enters through parameters (per module: number of feet, sums of their Y, Y^2, X, X^2
    at the start of the segment), the springs too, so one compilation serves all segments and all springs.
    """
    import heyoka as hk

    def equations(robot: PeerRobot) -> list[tuple[Any, Any]]:
        n, v, c, m = robot.modules, robot.speed, robot.friction, robot.mass / robot.modules
        lateral, _, _, _, inverse_mass = constant_parts(robot)
        z = hk.make_vars(*[f"z{k}" for k in range(2 * n + 1)])
        velocity, yaw_rate, angle, t = z[: n + 2], z[2 : n + 2], z[n + 2 :], hk.time
        sideways, heading = [velocity[1]], [hk.expression(0.0)]
        for i in range(1, n):
            sideways.append(sideways[-1] - robot.length / (2 * n) * (yaw_rate[i - 1] + yaw_rate[i]))
            heading.append(heading[-1] + angle[i - 1])
        along, across, turning = [], [], []
        for i in range(n):
            feet, y, yy, x, xx = (hk.par[5 * i + k] for k in range(5))
            x_now = x - feet * v * t
            xx_now = xx - 2.0 * v * x * t + feet * v * v * t * t
            slip = sideways[i] - v * heading[i] if i else sideways[0]
            along.append(-c * (feet * velocity[0] - y * yaw_rate[i]))
            across.append(-c * (feet * slip + x_now * yaw_rate[i]) - m * v * yaw_rate[0])
            turning.append(-c * (x_now * slip + xx_now * yaw_rate[i]) - c * (yy * yaw_rate[i] - y * velocity[0]))
        torque = [
            hk.par[5 * n + j] * angle[j] + robot.damping[j] * (yaw_rate[j + 1] - yaw_rate[j]) for j in range(n - 1)
        ]
        force = [hk.sum(along), hk.sum(across)]
        for k in range(n):
            terms = [turning[k]] + [lateral[i, 2 + k] * across[i] for i in range(n) if lateral[i, 2 + k] != 0.0]
            terms += [-1.0 * torque[k - 1]] if k > 0 else []
            terms += [torque[k]] if k < n - 1 else []
            force.append(hk.sum(terms))
        scale = np.abs(inverse_mass).max() * 1e-15
        accelerations = [
            hk.sum([inverse_mass[a, b] * force[b] for b in range(n + 2) if abs(inverse_mass[a, b]) > scale])
            for a in range(n + 2)
        ]
        rates = [yaw_rate[j + 1] - yaw_rate[j] for j in range(n - 1)]
        return list(zip(z, accelerations + rates, strict=True))

    def contact(robot: PeerRobot, t0: float, t1: float) -> Array:
        sums = np.zeros((robot.modules, 5))
        for i, x, y in feet_on_ground(robot, (t0 + t1) / 2):
            at_start = x + robot.speed * (t1 - t0) / 2
            sums[i] += [1.0, y, y * y, at_start, at_start**2]
        return sums.ravel()

    def prepare(robot: PeerRobot, periods: float, tolerance: float) -> Map:
        size, joints = 2 * robot.modules + 1, robot.modules - 1
        blocks = ceil(size / batch)
        pars = np.zeros((5 * robot.modules + joints, batch))
        stepper = hk.taylor_adaptive_batch(equations(robot), np.zeros((size, batch)), pars=pars, tol=tolerance)
        patterns = [
            ([t1 - t0] * batch, np.repeat(contact(robot, t0, t1)[:, None], batch, 1))
            for t0, t1 in _intervals(robot, periods)
        ]

        def compute(springs: Sequence[float]) -> Array:
            x = np.eye(size, blocks * batch)
            stepper.pars[-joints:] = np.asarray(springs)[:, None]
            for block in range(blocks):
                columns = slice(block * batch, (block + 1) * batch)
                stepper.state[:] = x[:, columns]
                for lengths, pattern in patterns:
                    stepper.pars[:-joints] = pattern
                    stepper.set_time(0.0)
                    stepper.propagate_until(lengths)
                x[:, columns] = stepper.state
            return x[:, :size]

        return compute

    return prepare


def numbalsoda_segments(solver: str) -> Callable[[PeerRobot, float, float], Map]:
    """numbalsoda (LSODA or DOP853) from switch to switch with a compiled right-hand side."""
    import numbalsoda

    def prepare(robot: PeerRobot, periods: float, tolerance: float) -> Map:
        n = 2 * robot.modules + 1
        matrices, solve = _matrices(robot, periods), getattr(numbalsoda, solver)

        @numba.cfunc(numbalsoda.lsoda_sig)
        def rhs(t: float, y: Any, dy: Any, data: Any) -> None:
            x, dx, a = numba.carray(y, (n, n)), numba.carray(dy, (n, n)), numba.carray(data, (3, n, n))
            at = a[0] + t * (a[1] + t * a[2])
            dx[:] = at @ x

        def compute(springs: Sequence[float]) -> Array:
            x = np.eye(n)
            for length, a in matrices(springs):
                ends = np.array([0.0, length])
                x = solve(rhs.address, x.ravel(), ends, data=a, rtol=tolerance, atol=tolerance * 1e-2)[0][-1].reshape(
                    n, n
                )
            return x

        return compute

    return prepare


def available() -> dict[str, Callable[[PeerRobot, float, float], Map]]:
    """Every peer that is installed, by the name that the table shows."""
    peers: dict[str, Callable[[PeerRobot, float, float], Map]] = {}
    try:
        peers |= {f"heyoka, Taylor, {size} columns at once": heyoka_taylor(size) for size in (4, 8, 16)}
    except ImportError:
        print("heyoka is not installed here: left out")
    try:
        peers |= {f"numbalsoda, {name}": numbalsoda_segments(name) for name in ("lsoda", "dop853")}
    except ImportError:
        print("numbalsoda is not installed here (building it takes cmake and a Fortran compiler): left out")
    peers |= {f"scipy on segments, {name}": scipy_segments(name) for name in ("DOP853", "LSODA")}
    peers["scipy naive, DOP853"] = scipy_naive
    peers["plain numpy Taylor series (peer_model.py)"] = numpy_taylor
    return peers
