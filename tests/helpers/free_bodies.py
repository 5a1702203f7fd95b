"""The planar robot a second way: every module a free body, joints as constraints with Lagrange multipliers.

Positions in the plane, feet one by one, forces from where each foot is; nothing is shared with the package but the
robot's numbers. Joint forces follow from the joints differentiated twice (index-1 form), scipy integrates from switch
to switch, and after each piece positions and rates are put back onto the joints, so that nothing drifts in long runs.
"""

import numba
import numpy as np
from scipy.integrate import solve_ivp


@numba.njit(cache=True)
def joint_rows(heading, half):
    """Derivative of (rear end of module j) - (front end of module j+1) by (X, Y, heading) of all modules."""
    n = len(heading)
    rows = np.zeros((2 * (n - 1), 3 * n))
    for j in range(n - 1):
        for module, sign in ((j, 1.0), (j + 1, -1.0)):
            rows[2 * j, 3 * module] = sign
            rows[2 * j + 1, 3 * module + 1] = sign
            rows[2 * j, 3 * module + 2] = half * np.sin(heading[module])
            rows[2 * j + 1, 3 * module + 2] = -half * np.cos(heading[module])
    return rows


@numba.njit(cache=True)
def free_bodies_rhs(t, state, standing, touch_down, masses, stiffness, damping, numbers, drive):
    """Rates and accelerations of all modules; standing feet have been so since their ``touch_down``; ``drive`` is a
    torque at every joint beside its spring."""
    half, forward_offset, half_width, stride, speed, friction = numbers
    n = len(masses) // 3
    place, rate = state[: 3 * n], state[3 * n :]
    load = np.zeros(3 * n)
    for i in range(n):
        c, s, w = np.cos(place[3 * i + 2]), np.sin(place[3 * i + 2]), rate[3 * i + 2]
        for side in range(2):
            if standing[i, side]:
                ahead = forward_offset + stride / 2 - speed * (t - touch_down[i, side])
                left = half_width if side == 0 else -half_width
                arm_x, arm_y = ahead * c - left * s, ahead * s + left * c
                push_x = -friction * (rate[3 * i] - w * arm_y - speed * c)
                push_y = -friction * (rate[3 * i + 1] + w * arm_x - speed * s)
                load[3 * i] += push_x
                load[3 * i + 1] += push_y
                load[3 * i + 2] += arm_x * push_y - arm_y * push_x
    wanted = np.zeros(2 * (n - 1))  # rows @ acceleration: what the turning ends do by themselves
    for j in range(n - 1):
        a, b = 3 * j + 2, 3 * j + 5
        torque = drive[j] - stiffness[j] * (place[b] - place[a]) - damping[j] * (rate[b] - rate[a])
        load[b] += torque
        load[a] -= torque
        wanted[2 * j] = -half * (rate[a] ** 2 * np.cos(place[a]) + rate[b] ** 2 * np.cos(place[b]))
        wanted[2 * j + 1] = -half * (rate[a] ** 2 * np.sin(place[a]) + rate[b] ** 2 * np.sin(place[b]))
    rows = joint_rows(place[2::3], half)
    free = load / masses
    multipliers = np.linalg.solve((rows / masses) @ rows.T, wanted - rows @ free)
    out = np.empty(6 * n)
    out[: 3 * n] = rate
    out[3 * n :] = free + (rows.T @ multipliers) / masses
    return out


class FreeBodies:
    """A robot as free modules; state is (X, Y, heading) of every module, then their rates, shape (6N,)."""

    def __init__(self, robot):
        self.robot = robot
        self.n = robot.body.modules
        self.l = robot.body.length / self.n
        self.m = robot.body.mass / self.n
        self.inertia = self.m * self.l**2 / 12 if robot.body.yaw_inertia is None else robot.body.yaw_inertia
        turn = 2 * np.pi
        i = np.arange(self.n)
        self.phases = (
            np.stack([i * robot.gait.module_phase, i * robot.gait.module_phase + robot.gait.side_phase]).T / turn
        )
        legs, gait = robot.legs, robot.gait
        speed = gait.stride / gait.stance
        numbers = (self.l / 2, legs.forward_offset, legs.half_width, gait.stride, speed, robot.ground.friction)
        self.masses = np.tile([self.m, self.m, self.inertia], self.n)
        self.damping, self.numbers = np.array(robot.springs.damping), numbers
        self.parts = (self.masses, np.array(robot.springs.stiffness), self.damping, numbers, np.zeros(self.n - 1))

    def from_reduced(self, x, pose=(0.0, 0.0, 0.0)):
        """Place the robot in reduced state ``x`` at a pose of module 1."""
        n, half = self.n, self.l / 2
        heading = pose[2] + np.concatenate([[0.0], np.cumsum(x[3 : n + 2])])
        rate = x[2] + np.concatenate([[0.0], np.cumsum(x[n + 2 :])])
        e = np.stack([np.cos(heading), np.sin(heading)], -1)
        normal = np.stack([-e[:, 1], e[:, 0]], -1)
        place, speed = np.empty((n, 2)), np.empty((n, 2))
        place[0], speed[0] = pose[:2], x[0] * e[0] + x[1] * normal[0]
        for i in range(1, n):
            place[i] = place[i - 1] - half * e[i - 1] - half * e[i]
            speed[i] = speed[i - 1] - half * rate[i - 1] * normal[i - 1] - half * rate[i] * normal[i]
        return np.concatenate([np.column_stack([place, heading]).ravel(), np.column_stack([speed, rate]).ravel()])

    def to_reduced(self, state):
        """Reduced state, and pose of module 1."""
        place, speed = state.reshape(2, self.n, 3)
        c, s = np.cos(place[0, 2]), np.sin(place[0, 2])
        front = [c * speed[0, 0] + s * speed[0, 1], c * speed[0, 1] - s * speed[0, 0], speed[0, 2]]
        return np.concatenate([front, np.diff(place[:, 2]), np.diff(speed[:, 2])]), place[0]

    def gaps(self, state):
        """How far the joints are open: rear end of each module less front end of the next, shape (N-1, 2)."""
        place = state.reshape(2, self.n, 3)[0]
        end = self.l / 2 * np.stack([np.cos(place[:, 2]), np.sin(place[:, 2])], -1)
        return (place[:-1, :2] - end[:-1]) - (place[1:, :2] + end[1:])

    def closed(self, state):
        """Nearest state, by mass, with closed joints and rates that keep them so: one Newton step."""
        place, rate = state.reshape(2, -1)
        rows = joint_rows(place[2::3], self.l / 2)
        back = rows.T / self.masses[:, None] @ np.linalg.inv(rows / self.masses @ rows.T)
        place = place - back @ self.gaps(state).ravel()
        return np.concatenate([place, rate - back @ (rows @ rate)])

    def carry(self, state, t0, t1, rtol=1e-11):
        """State at t1."""
        for start, end, standing, touch_down in self.pieces(t0, t1):
            args = (standing, touch_down, *self.parts)
            solution = solve_ivp(free_bodies_rhs, (start, end), state, "DOP853", args=args, rtol=rtol, atol=1e-13)
            assert solution.success
            state = self.closed(solution.y[:, -1])
        return state

    def carry_driven(self, state, stiffness, t0, t1, reference, lag, drive, kinks=(), rtol=1e-11):
        """State and stiffness at t1, where springs follow a reference(t), lag k' = reference - k, joints driven.

        The stiffness is part of what is integrated; without a lag it is the reference. ``kinks`` are where the
        reference is not smooth.
        """
        n = 6 * self.n

        def rhs(t, whole, standing, touch_down, middle):
            wanted = reference(t, middle)
            k = whole[n:] if lag > 0.0 else wanted
            rates = free_bodies_rhs(
                t, whole[:n], standing, touch_down, self.masses, k, self.damping, self.numbers, drive
            )
            return np.concatenate([rates, (wanted - k) / lag if lag > 0.0 else 0.0 * k])

        whole = np.concatenate([state, stiffness])
        for start, end, *feet in self.pieces(t0, t1, kinks):
            args = (*feet, (start + end) / 2)
            solution = solve_ivp(rhs, (start, end), whole, "DOP853", args=args, rtol=rtol, atol=1e-13)
            assert solution.success
            whole = np.concatenate([self.closed(solution.y[:n, -1]), solution.y[n:, -1]])
            if not lag > 0.0:
                whole[n:] = reference(end, (start + end) / 2)
        return whole[:n], whole[n:]

    def pieces(self, t0, t1, kinks=()):
        """Times between which nothing switches, which feet stand there and when they would have touched down."""
        gait = self.robot.gait
        cycles = np.arange(np.floor(t0 / gait.period) - 1, np.ceil(t1 / gait.period) + 2)
        events = [(cycles[:, None, None] + event - self.phases % 1).ravel() for event in (0.0, gait.duty)]
        events = np.sort(np.concatenate([np.concatenate(events) * gait.period, kinks]))
        times = np.concatenate([[t0], events[(events > t0 + 1e-12) & (events < t1 - 1e-12)], [t1]])
        for start, end in zip(times[:-1], times[1:], strict=True):
            if end - start >= 1e-12:
                middle = (start + end) / 2
                phase = (middle / gait.period + self.phases) % 1.0
                yield start, end, phase < gait.duty, middle - phase * gait.period
