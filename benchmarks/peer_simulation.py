"""Other tools walking the nonlinear planar robot for a while, each as well as we know how to use it.

The equations of motion are written a second time in :func:`plain_rhs` (mass matrix, absolute headings, positions in the
plane), for numpy, JAX and heyoka alike; MuJoCo has its own. scipy is given chilopod's compiled right-hand side, so that
it competes as an integrator. All of them step from switch to switch.

Every peer is a function of (walk, setting) that returns a call without arguments, which returns the final pose
(x, y, heading of module 1). Compiling and what else can be prepared is done beforehand and not timed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from scipy.integrate import odeint, solve_ivp

from chilopod.planar.contact import contact_moments
from chilopod.planar.dynamics import SCRATCH, rhs
from chilopod.robot import Robot

from peer_model import Array, PeerRobot, feet_on_ground, switch_times

Call = Callable[[], Array]
Peer = Callable[["Walk", float], Call]


@dataclass(frozen=True)
class Walk:
    """Periods of walking from a reduced state (vx, vy, w, joint angles, joint rates) at time 0 and the pose (0, 0, 0).

    The robot is described twice: `file` for chilopod, `robot` for the peers.
    """

    file: Robot
    robot: PeerRobot
    start: Array
    periods: int

    @property
    def plain_start(self) -> Array:
        """(x, y, headings of all modules) of the start, then their rates."""
        n = self.robot.modules
        headings, rates = np.append(0.0, self.start[3 : n + 2]), np.append(self.start[2], self.start[n + 2 :])
        return np.concatenate([[0.0, 0.0], headings.cumsum(), self.start[:2], rates.cumsum()])


# ---- the equations of motion, written plainly ---------------------------------------------------------------------


def segments(robot: PeerRobot) -> tuple[Array, Array]:
    """Durations of a period's segments, shape (S,), and sums over the stance feet of each module at their starts.

    The sums are c, c X, c Y and c (X^2 + Y^2), shape (S, 4, N), for a foot X ahead of the centre and Y to its left.
    """
    times = switch_times(robot)
    widths = np.diff(times)
    sums = np.zeros((len(widths), 4, robot.modules))
    for s, (t, width) in enumerate(zip(times, widths, strict=False)):
        for i, x_half_way, y in feet_on_ground(robot, t + width / 2):
            x = x_half_way + robot.speed * width / 2
            sums[s, :, i] += robot.friction * np.array([1.0, x, y, x * x + y * y])
    return widths, sums


def plain_rhs(xp: Any, t: Any, z: Any, robot: PeerRobot, sums: Any) -> Any:
    """dz/dt for z as in :attr:`Walk.plain_start`; t from the start of the segment. `xp`: numpy, or like it."""
    n, m, length, speed = robot.modules, robot.mass / robot.modules, robot.length / robot.modules, robot.speed
    # Centre of module i = centre of module 1 - sum over j of reach[i, j] e_j.
    reach = length * np.tril(np.ones((n, n)))
    reach[:, 0] = length / 2
    reach[np.arange(n), np.arange(n)] = length / 2
    reach[0] = 0.0
    heading, w = z[2 : n + 2], z[n + 4 :]
    c, s = xp.cos(heading), xp.sin(heading)
    vx, vy = z[n + 2] + reach @ (w * s), z[n + 3] - reach @ (w * c)
    travel = speed * t
    f, fx, fy = sums[0], sums[1] - travel * sums[0], sums[2]
    fxx = sums[3] - 2.0 * travel * sums[1] + travel * travel * sums[0]
    slip, lateral = c * vx + s * vy - speed, c * vy - s * vx
    along, across = fy * w - f * slip, -f * lateral - fx * w
    turning = fy * slip - fx * lateral - fxx * w
    bend = np.diff(np.eye(n), axis=0)
    torque = bend @ heading * np.array(robot.stiffness) + bend @ w * np.array(robot.damping)
    turning = turning - bend.T @ torque
    # Forces less what the turning of the modules in front takes; then Lagrange's equations.
    net_x = c * along - s * across - m * (reach @ (w * w * c))
    net_y = s * along + c * across - m * (reach @ (w * w * s))
    ones = np.ones(n)
    force = xp.concatenate([xp.stack([ones @ net_x, ones @ net_y]), turning + s * (reach.T @ net_x)])
    force = xp.concatenate([force[:2], force[2:] - c * (reach.T @ net_y)])
    column = m * (ones @ reach)
    turn = m * (reach.T @ reach) * (c[:, None] * c[None, :] + s[:, None] * s[None, :])
    turn = turn + m * length**2 / 12 * np.eye(n)
    mixed = xp.stack([column * s, -column * c])
    mass = xp.concatenate(
        [xp.concatenate([n * m * np.eye(2), mixed], 1), xp.concatenate([mixed.T, turn], 1)]  # symmetric
    )
    return xp.concatenate([z[n + 2 :], xp.solve(mass, force)])


def reference(walk: Walk) -> Array:
    """Final pose by the plain equations in numpy and scipy's DOP853 at 1e-11."""
    widths, sums = segments(walk.robot)
    xp = SimpleNamespace(cos=np.cos, sin=np.sin, stack=np.stack, concatenate=np.concatenate, solve=np.linalg.solve)
    z = walk.plain_start
    for _ in range(walk.periods):
        for width, each in zip(widths, sums, strict=True):
            f = partial(lambda t, y, each: plain_rhs(xp, t, y, walk.robot, each), each=each)
            z = solve_ivp(f, (0.0, width), z, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return z[:3]


# ---- scipy with chilopod's right-hand side ------------------------------------------------------------------------


@numba.njit(cache=True)
def _rhs_txa(t, x, scalars, stiffness, damping, moments, scratch):
    out = np.empty_like(x)
    rhs(t, x, (scalars, stiffness, damping, moments, scratch), out)
    return out


def compiled_segments(file: Robot) -> list[tuple[float, tuple[Array, ...]]]:
    """Duration of each segment of a period, and what chilopod's right-hand side takes as `args` in it."""
    n, legs, springs = file.body.modules, file.legs, file.springs
    schedule = file.gait.schedule(n)
    scalars = np.array([file.module_length, file.module_mass, file.module_yaw_inertia, file.gait.speed])
    moments = contact_moments(legs.forward_offset, legs.half_width, file.ground.friction, schedule)
    parts = (scalars, np.array(springs.stiffness), np.array(springs.damping))
    scratch = np.empty((n, SCRATCH))
    return [(float(w), (*parts, each, scratch)) for w, each in zip(np.diff(schedule.times), moments, strict=True)]


def _by_segments(walk: Walk, step: Callable[[Array, float, tuple[Array, ...]], Array]) -> Call:
    parts = compiled_segments(walk.file)

    def compute() -> Array:
        x = np.append(walk.start, np.zeros(3))
        for _ in range(walk.periods):
            for width, args in parts:
                x = step(x, width, args)
        return x[-3:]

    return compute


def scipy_solve_ivp(method: str) -> Peer:
    def prepare(walk: Walk, tolerance: float) -> Call:
        options = {"method": method, "rtol": tolerance, "atol": tolerance}
        return _by_segments(walk, lambda x, w, args: solve_ivp(_rhs_txa, (0.0, w), x, args=args, **options).y[:, -1])

    return prepare


def scipy_odeint(walk: Walk, tolerance: float) -> Call:
    options = {"rtol": tolerance, "atol": tolerance, "tfirst": True}
    return _by_segments(walk, lambda x, w, args: odeint(_rhs_txa, x, (0.0, w), args=args, **options)[-1])


# ---- diffrax ------------------------------------------------------------------------------------------------------


def diffrax_peer(method: str) -> Peer:
    """One jitted scan over the segments of all periods."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)

    def prepare(walk: Walk, tolerance: float) -> Call:
        widths, sums = (jnp.asarray(a) for a in segments(walk.robot))
        xp = SimpleNamespace(
            cos=jnp.cos,
            sin=jnp.sin,
            stack=jnp.stack,
            concatenate=jnp.concatenate,
            solve=partial(jax.scipy.linalg.solve, assume_a="pos"),
        )
        term = diffrax.ODETerm(lambda t, z, each: plain_rhs(xp, t, z, walk.robot, each))
        solver = getattr(diffrax, method)()
        controller = diffrax.PIDController(rtol=tolerance, atol=tolerance)

        def segment(z: Any, part: Any) -> tuple[Any, None]:
            width, each = part
            options = {"stepsize_controller": controller, "max_steps": 4096}
            found = diffrax.diffeqsolve(term, solver, 0.0, width, width / 6, z, each, **options)
            return found.ys[-1], None

        def period(z: Any, _: None) -> tuple[Any, None]:
            return jax.lax.scan(segment, z, (widths, sums))

        whole = jax.jit(lambda z: jax.lax.scan(period, z, None, length=walk.periods)[0][:3])
        start = jnp.asarray(walk.plain_start)
        whole(start).block_until_ready()  # compiles
        return lambda: np.asarray(whole(start))

    return prepare


# ---- heyoka -------------------------------------------------------------------------------------------------------


def _solve_symbolic(a: Array, b: Array) -> Array:
    """Symmetric elimination without pivots, on expressions."""
    a, b, n = a.copy(), b.copy(), len(b)
    for k in range(n):
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[k, i] * inverse
            for j in range(i, n):
                a[i, j] = a[i, j] - factor * a[k, j]
            b[i] = b[i] - factor * b[k]
        a[k, k] = inverse
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] = b[k] - a[k, j] * b[j]
        b[k] = b[k] * a[k, k]
    return b


def heyoka_taylor() -> Peer:
    import heyoka as hy

    def prepare(walk: Walk, tolerance: float) -> Call:
        n = walk.robot.modules
        z = np.array(hy.make_vars(*[f"z{i}" for i in range(2 * n + 4)]), dtype=object)
        par = np.array([hy.par[i] for i in range(4 * n)], dtype=object).reshape(4, n)
        xp = SimpleNamespace(
            cos=lambda a: np.array([hy.cos(e) for e in a], dtype=object),
            sin=lambda a: np.array([hy.sin(e) for e in a], dtype=object),
            stack=np.stack,
            concatenate=np.concatenate,
            solve=_solve_symbolic,
        )
        slopes = plain_rhs(xp, hy.time, z, walk.robot, par)
        system = [(v, hy.expression(e) if isinstance(e, float) else e) for v, e in zip(z, slopes, strict=True)]
        ta = hy.taylor_adaptive(system, walk.plain_start, tol=tolerance, pars=[0.0] * (4 * n))
        widths, sums = segments(walk.robot)
        parts = [(float(width), each.ravel()) for width, each in zip(widths, sums, strict=True)]

        def compute() -> Array:
            ta.state[:] = walk.plain_start
            for _ in range(walk.periods):
                for width, each in parts:
                    ta.time = 0.0
                    ta.pars[:] = each
                    ta.propagate_until(width)
            return ta.state[:3].copy()

        return compute

    return prepare


# ---- MuJoCo -------------------------------------------------------------------------------------------------------


@numba.njit(cache=True)
def _feet(t, q, v, length, speed, sums, out):
    """Generalised force of the viscous feet; q = (x, y, heading of module 1, joint angles)."""
    n = sums.shape[1]
    heading, rate, vx, vy = 0.0, 0.0, v[0], v[1]
    c, s, half = 1.0, 0.0, 0.0
    out[:] = 0.0
    forces = np.empty((n, 5))
    for i in range(n):
        vx, vy = vx + half * rate * s, vy - half * rate * c
        heading, rate = heading + q[2 + i], rate + v[2 + i]
        c, s = np.cos(heading), np.sin(heading)
        if i > 0:
            vx, vy = vx + half * rate * s, vy - half * rate * c
        half = length / 2
        x = sums[1, i] - speed * t * sums[0, i]
        xx = sums[3, i] - 2.0 * speed * t * sums[1, i] + (speed * t) ** 2 * sums[0, i]
        slip, lateral = c * vx + s * vy - speed, c * vy - s * vx
        along, across = sums[2, i] * rate - sums[0, i] * slip, -sums[0, i] * lateral - x * rate
        forces[i, 0], forces[i, 1] = c * along - s * across, s * along + c * across
        forces[i, 2] = sums[2, i] * slip - x * lateral - xx * rate
        forces[i, 3], forces[i, 4] = c, s
    force_x, force_y, torque = 0.0, 0.0, 0.0  # of module i and all behind it, about its front joint
    for i in range(n - 1, -1, -1):
        c, s = half * forces[i, 3], half * forces[i, 4]
        at_centre = torque - c * force_y + s * force_x + forces[i, 2]  # what hangs at the rear joint, and the feet
        force_x += forces[i, 0]
        force_y += forces[i, 1]
        torque = at_centre - c * force_y + s * force_x
        out[2 + i] = torque if i > 0 else at_centre
    out[0], out[1] = force_x, force_y


def _mujoco_model(robot: PeerRobot) -> Any:
    import mujoco

    n, half = robot.modules, robot.length / robot.modules / 2
    m, inertia = robot.mass / n, robot.mass / n * (2 * half) ** 2 / 12
    tail = ""
    for i in range(n - 1, -1, -1):
        if i == 0:
            joints = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0"))
            place, centre, joints = "0 0 0", 0.0, joints + '<joint type="hinge" axis="0 0 1"/>'
        else:
            place, centre = f"{-half if i == 1 else -2 * half} 0 0", -half
            springs = f'stiffness="{robot.stiffness[i - 1]}" damping="{robot.damping[i - 1]}"'
            joints = f'<joint type="hinge" axis="0 0 1" {springs}/>'
        inertial = f'<inertial pos="{centre} 0 0" mass="{m}" diaginertia="{inertia} {inertia} {inertia}"/>'
        ends = f"{centre - half} 0 0 {centre + half} 0 0"
        capsule = f'<geom type="capsule" size="0.02" fromto="{ends}" contype="0" conaffinity="0"/>'
        tail = f'<body pos="{place}">{joints}{inertial}{capsule}{tail}</body>'
    flags = "".join(f'{flag}="disable" ' for flag in ("constraint", "contact", "gravity", "warmstart"))
    option = f"<option><flag {flags}/></option>"
    return mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{tail}</worldbody></mujoco>")


def mujoco_peer(integrator: str) -> Peer:
    """`setting` is the longest step, s. Foot forces are applied once a step, or for RK4 at each of its stages."""
    import mujoco

    def prepare(walk: Walk, setting: float) -> Call:
        robot, n = walk.robot, walk.robot.modules
        model = _mujoco_model(robot)
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        data = mujoco.MjData(model)
        q, v, applied = data.qpos, data.qvel, data.qfrc_applied
        length, speed = robot.length / n, robot.speed
        now: list[Any] = [0.0, None]  # start of the segment, and its feet
        parts = list(zip(*segments(robot), strict=True))

        def feet(model: Any, data: Any) -> None:
            _feet(data.time - now[0], q, v, length, speed, now[1], applied)

        def compute() -> Array:
            mujoco.mj_resetData(model, data)
            q[3:], v[:] = walk.start[3 : n + 2], [*walk.start[:3], *walk.start[n + 2 :]]
            mujoco.set_mjcb_control(feet if integrator == "RK4" else None)
            try:
                for _ in range(walk.periods):
                    for width, each in parts:
                        now[:] = data.time, each
                        steps = ceil(width / setting * (1 - 1e-9))
                        model.opt.timestep = width / steps
                        if integrator == "RK4":
                            mujoco.mj_step(model, data, nstep=steps)
                        else:
                            for _ in range(steps):
                                feet(model, data)
                                mujoco.mj_step(model, data)
            finally:
                mujoco.set_mjcb_control(None)
            return q[:3].copy()

        return compute

    return prepare


def available() -> dict[str, tuple[Peer, list[float]]]:
    """Every peer that is installed, by the name that the table shows, with the settings to try, coarse to fine."""
    tolerances = [10.0**-k for k in range(3, 10)]
    wanted: dict[str, tuple[Callable[[], Peer], list[float]]] = {
        "scipy solve_ivp, DOP853": (lambda: scipy_solve_ivp("DOP853"), tolerances),
        "scipy solve_ivp, LSODA": (lambda: scipy_solve_ivp("LSODA"), tolerances),
        "scipy odeint (LSODA)": (lambda: scipy_odeint, tolerances),
        "heyoka, Taylor": (heyoka_taylor, tolerances),
        "diffrax, Dopri8": (lambda: diffrax_peer("Dopri8"), tolerances),
        "diffrax, Kvaerno5": (lambda: diffrax_peer("Kvaerno5"), [1e-5]),
        "MuJoCo, RK4": (lambda: mujoco_peer("RK4"), [5e-3, 4e-3, 3e-3, 2e-3, 1e-3]),
        "MuJoCo, Euler": (lambda: mujoco_peer("Euler"), [1e-3, 2.5e-4, 1e-4, 5e-5]),
    }
    peers = {}
    for name, (make, settings) in wanted.items():
        try:
            peers[name] = (make(), settings)
        except ImportError:
            print(f"{name} is not installed here: left out")
    return peers
