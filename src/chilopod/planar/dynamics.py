"""The nonlinear equations of motion of the planar chain (paper eq. 1), compiled, for real and complex-step states.

State of one robot in reduced coordinates, length 2N+1::

    x = [vx, vy, w0,  theta_1 .. theta_{N-1},  theta_1' .. theta_{N-1}']

``(vx, vy, w0)`` is the velocity of module 1's centre and its yaw rate in module 1's own frame (x forward, y left);
``theta_j`` is the heading of module j+1 less that of module j. Position and heading of the robot do not enter: the
floor is the same everywhere. Three more entries, if present, are the pose (x, y, heading) of module 1 and are
integrated along.

Accelerations come from the articulated-body recursion (Featherstone, *Rigid Body Dynamics Algorithms*, 2008, ch. 7)
specialised to a planar chain: one sweep from the tail to the head condenses everything behind a joint into a 3x3
inertia and a bias force at that joint, one sweep back hands the accelerations out. Cost grows linearly with the number
of modules.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from chilopod.compiled import fused_njit
from chilopod.dual import cos_sin, reciprocal
from chilopod.lanes import absolute, any_less, exponential
from chilopod.planar.contact import C_EX, C_EY, C_PD, C_PP, C_PXE, C_SUM, C_X, C_Y

# Rows of ``args[0]``, the scalars of a robot.
LENGTH, MASS, INERTIA, SPEED = range(4)

SCRATCH = 10
"""Scratch numbers of the right-hand side for each module."""

_COS, _SIN, _RATE, _VX, _VY, _HX, _HY, _INVERSE, _BIAS, _JOINT = range(SCRATCH)

SPRING = 6
ORIGIN, LEVEL, SLOPE, BEHIND, DECAY, TORQUE = range(SPRING)
"""Columns that describe a changing spring and the torque at its joint."""


def _spring_torque(springs: Any, joint: int, angle: Any, t: Any) -> Any:
    """Torque of a spring, and of a motor beside it, on the rear module at an angle (rad) and time t, N*m.

    ``springs`` is the stiffness of each, shape (N-1,); or, where they change, a description in lanes, shape (N-1, 6):
    TORQUE, and k = LEVEL + SLOPE s + BEHIND e^(-DECAY s), where s = t - ORIGIN.
    """
    raise NotImplementedError


@overload(_spring_torque, inline="always")
def _spring_torque_of(springs: Any, joint: int, angle: Any, t: Any) -> Any:
    if springs.ndim == 1:

        def constant(springs: Any, joint: int, angle: Any, t: Any) -> Any:
            return -springs[joint] * angle

        return constant

    def changing(springs: Any, joint: int, angle: Any, t: Any) -> Any:
        since = t - springs[joint, ORIGIN]
        stiffness = springs[joint, LEVEL] + springs[joint, SLOPE] * since
        if any_less(0.0, absolute(springs[joint, BEHIND])):
            stiffness += springs[joint, BEHIND] * exponential(-springs[joint, DECAY] * since)
        return springs[joint, TORQUE] - stiffness * angle

    return changing


@fused_njit
def rhs(t: float, x: Any, args: Any, out: Any) -> None:
    """Write dx/dt of one robot into ``out``.

    Parameters
    ----------
    t
        Time since the contact pattern last changed, s; within it every foot moves back at constant speed.
    x
        Reduced state, shape (2N+1,), real or complex; or with the pose behind it, shape (2N+4,).
    args
        ``(scalars, springs, damping, moments, scratch)``: scalars (4,); stiffness of the springs, N*m/rad, shape
        (N-1,), or a description of springs that change, see :func:`_spring_torque`; N*m*s/rad, shape (N-1,); contact
        moments at t = 0, shape (N, 8); scratch (N, SCRATCH), the dtype of ``x``.
    out
        The shape of ``x``.
    """
    scalars, springs, damping, moments, work = args
    n = moments.shape[0]
    half = 0.5 * scalars[LENGTH]
    m = scalars[MASS]
    inertia = scalars[INERTIA]
    speed = scalars[SPEED]
    travel = speed * t

    # Directions (relative to module 1), rates and velocities, head to tail, all in module 1's frame.
    rate = x[2]
    vx = x[0]
    vy = x[1]
    s = x[0] * 0.0
    c = s + 1.0
    for i in range(n):
        if i > 0:
            vx += half * rate * s  # to the rear joint of the module in front: v + w x (-half e)
            vy -= half * rate * c
            rate += x[n + 1 + i]
            bend_c, bend_s = cos_sin(x[2 + i])
            c, s = c * bend_c - s * bend_s, s * bend_c + c * bend_s
            vx += half * rate * s
            vy -= half * rate * c
            # Torque of spring and damper on this module; minus that on the module in front.
            work[i, _JOINT] = _spring_torque(springs, i - 1, x[2 + i], t) - damping[i - 1] * x[n + 1 + i]
        work[i, _COS] = c
        work[i, _SIN] = s
        work[i, _RATE] = rate
        work[i, _VX] = vx
        work[i, _VY] = vy

    # Tail to head. (pxx, pxy, pyy) and (fx, fy): inertia and bias force with which everything behind acts on the rear
    # joint.
    pxx = x[0] * 0.0
    pxy = pxx
    pyy = pxx
    fx = pxx
    fy = pxx
    torque_behind = pxx
    for i in range(n - 1, -1, -1):
        c = work[i, _COS]
        s = work[i, _SIN]
        rate = work[i, _RATE]
        # Viscous feet, where they are by now: p - travel d, with d = (1, 0) + e.
        c_sum = moments[i, C_SUM]
        c_ex = moments[i, C_EX]
        c_ey = moments[i, C_EY]
        c_x = moments[i, C_X] - travel * (c_sum + c_ex)
        c_y = moments[i, C_Y] - travel * c_ey
        c_pp = moments[i, C_PP] - travel * (2.0 * moments[i, C_PD] - travel * c_sum)
        c_pxe = moments[i, C_PXE] - travel * c_ey
        # Velocity of the centre along the module, less that of the straight walk, and across.
        u = c * work[i, _VX] + s * work[i, _VY] - speed
        w = c * work[i, _VY] - s * work[i, _VX]
        along = c_y * rate - c_sum * u + speed * c_ex
        across = speed * c_ey - c_sum * w - c_x * rate
        turning = c_y * u - c_x * w - c_pp * rate + speed * c_pxe
        ground_x = c * along - s * across
        ground_y = s * along + c * across
        # Distance vector from the module's reference point to its centre, and to its rear joint. The reference point
        # is the front joint, but the centre for module 1.
        reach = half if i > 0 else 0.0
        dx = -reach * c
        dy = -reach * s
        rx = -(reach + half) * c
        ry = -(reach + half) * s
        rr = rate * rate
        # Own inertia about the reference point: force = m (a + alpha x d - rate^2 d) - ground.
        axx = m + pxx
        axy = pxy
        ayy = m + pyy
        bx = -m * rr * dx - ground_x
        by = -m * rr * dy - ground_y
        hx = -m * dy  # column of the angular acceleration
        hy = m * dx
        j = inertia + m * (dx * dx + dy * dy)
        bt = -turning - (dx * ground_y - dy * ground_x) + torque_behind  # m d x d vanishes
        if i < n - 1:
            # The rest of the chain hangs at the rear joint, whose acceleration is a + alpha x r - rate^2 r.
            gx = fx - rr * (pxx * rx + pxy * ry)
            gy = fy - rr * (pxy * rx + pyy * ry)
            qx = -pxx * ry + pxy * rx
            qy = -pxy * ry + pyy * rx
            hx += qx
            hy += qy
            j += -ry * qx + rx * qy
            bx += gx
            by += gy
            bt += rx * gy - ry * gx
        work[i, _HX] = hx
        work[i, _HY] = hy
        work[i, _BIAS] = bt
        if i > 0:
            torque = work[i, _JOINT]
            torque_behind = torque
            inverse = reciprocal(j)
            work[i, _INVERSE] = inverse
            pxx = axx - hx * hx * inverse
            pxy = axy - hx * hy * inverse
            pyy = ayy - hy * hy * inverse
            fx = bx + hx * (torque - bt) * inverse
            fy = by + hy * (torque - bt) * inverse
        else:
            # Free base: [axx axy hx; axy ayy hy; hx hy j] [ax; ay; alpha] = -[bx; by; bt], by elimination of alpha.
            inverse = reciprocal(j)
            sxx = axx - hx * hx * inverse
            sxy = axy - hx * hy * inverse
            syy = ayy - hy * hy * inverse
            gx = -bx + hx * bt * inverse
            gy = -by + hy * bt * inverse
            determinant = reciprocal(sxx * syy - sxy * sxy)
            ax = (syy * gx - sxy * gy) * determinant
            ay = (sxx * gy - sxy * gx) * determinant
            alpha = -(bt + hx * ax + hy * ay) * inverse
            # dv/dt in the turning frame of module 1.
            out[0] = ax + x[2] * x[1]
            out[1] = ay - x[2] * x[0]
            out[2] = alpha

    # Head to tail: angular accelerations.
    ax = out[0] - x[2] * x[1]
    ay = out[1] + x[2] * x[0]
    alpha = out[2]
    for i in range(1, n):
        c = work[i - 1, _COS]
        s = work[i - 1, _SIN]
        rate = work[i - 1, _RATE]
        reach = half if i > 1 else 0.0
        rx = -(reach + half) * c
        ry = -(reach + half) * s
        ax += -alpha * ry - rate * rate * rx
        ay += alpha * rx - rate * rate * ry
        new = (work[i, _JOINT] - work[i, _BIAS] - work[i, _HX] * ax - work[i, _HY] * ay) * work[i, _INVERSE]
        out[2 + i] = x[n + 1 + i]
        out[n + 1 + i] = new - alpha
        alpha = new

    if x.size > 2 * n + 1:
        c, s = cos_sin(x[2 * n + 3])
        out[2 * n + 1] = c * x[0] - s * x[1]
        out[2 * n + 2] = s * x[0] + c * x[1]
        out[2 * n + 3] = x[2]
