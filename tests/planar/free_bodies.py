"""The planar robot a second way: every module a free body, joints as constraints with Lagrange multipliers.

Positions in the plane, feet one by one, forces from where each foot is; nothing is shared with the package but the
robot's numbers. Accelerations and joint forces come from one linear system (index-1 form); scipy integrates from switch
to switch.
"""

import numpy as np
from scipy.integrate import solve_ivp


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

    def rhs(self, t, state, standing, touch_down):
        robot, n, half = self.robot, self.n, self.l / 2
        place, speed = state.reshape(2, n, 3)
        heading, rate = place[:, 2], speed[:, 2]
        e = np.stack([np.cos(heading), np.sin(heading)], -1)
        normal = np.stack([-e[:, 1], e[:, 0]], -1)
        load = np.zeros((n, 3))
        gait = robot.gait
        for i, side in zip(*np.nonzero(standing), strict=True):
            since = t - touch_down[i, side]
            ahead = robot.legs.forward_offset + gait.stride / 2 - gait.stride * since / gait.stance
            arm = ahead * e[i] + (1 - 2 * side) * robot.legs.half_width * normal[i]
            slip = speed[i, :2] + rate[i] * np.array([-arm[1], arm[0]]) - gait.stride / gait.stance * e[i]
            push = -robot.ground.friction * slip
            load[i, :2] += push
            load[i, 2] += arm[0] * push[1] - arm[1] * push[0]
        bend, bending = np.diff(heading), np.diff(rate)
        torque = -np.array(robot.springs.stiffness) * bend - np.array(robot.springs.damping) * bending
        load[1:, 2] += torque
        load[:-1, 2] -= torque
        # Rear end of i = front end of i+1, differentiated twice: G a = -g.
        joints = n - 1
        system = np.zeros((3 * n + 2 * joints, 3 * n + 2 * joints))
        system[range(3 * n), range(3 * n)] = np.tile([self.m, self.m, self.inertia], n)
        right = np.zeros(len(system))
        right[: 3 * n] = load.ravel()
        for j in range(joints):
            row, a, b = 3 * n + 2 * j, 3 * j, 3 * (j + 1)
            g = np.zeros((2, 3 * n))
            g[:, a : a + 2], g[:, a + 2] = np.eye(2), -half * normal[j]
            g[:, b : b + 2], g[:, b + 2] = -np.eye(2), -half * normal[j + 1]
            system[row : row + 2, : 3 * n] = g
            system[: 3 * n, row : row + 2] = g.T
            right[row : row + 2] = -half * (rate[j] ** 2 * e[j] + rate[j + 1] ** 2 * e[j + 1])
        acceleration = np.linalg.solve(system, right)[: 3 * n]
        return np.concatenate([state[3 * n :], acceleration])

    def carry(self, state, t0, t1, rtol=1e-11):
        """State at t1."""
        gait = self.robot.gait
        cycles = np.arange(np.floor(t0 / gait.period) - 1, np.ceil(t1 / gait.period) + 2)
        events = np.concatenate(
            [(cycles[:, None, None] + event - self.phases % 1).ravel() for event in (0.0, gait.duty)]
        )
        events = np.sort(events * gait.period)
        times = np.concatenate([[t0], events[(events > t0 + 1e-12) & (events < t1 - 1e-12)], [t1]])
        for start, end in zip(times[:-1], times[1:], strict=True):
            if end - start < 1e-13:
                continue
            middle = (start + end) / 2
            phase = (middle / gait.period + self.phases) % 1.0
            feet = (phase < gait.duty, middle - phase * gait.period)
            solution = solve_ivp(self.rhs, (start, end), state, "DOP853", args=feet, rtol=rtol, atol=1e-13)
            assert solution.success
            state = solution.y[:, -1]
        return state
