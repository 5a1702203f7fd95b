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

import numpy as np

from chilopod.compiled import njit

# Rows of ``args[0]``, the scalars of a robot.
LENGTH, MASS, INERTIA, SPEED = range(4)

# Columns of the contact moments, see ``contact.py``.
C_SUM, C_X, C_Y, C_XX = range(4)


@njit
def rhs(t: float, x: Any, args: Any, out: Any) -> None:
    """Write dx/dt of one robot into ``out``.

    Parameters
    ----------
    t
        Time since the contact pattern last changed, s; within it every foot moves back at constant speed.
    x
        Reduced state, shape (2N+1,), real or complex; or with the pose behind it, shape (2N+4,).
    args
        ``(scalars, stiffness, damping, moments, scratch)``: scalars (4,); N*m/rad and N*m*s/rad, shape (N-1,);
        contact moments at t = 0, shape (N, 4); scratch (N, 10), the dtype of ``x``.
    out
        The shape of ``x``.
    """
    scalars, stiffness, damping, moments, work = args
    n = moments.shape[0]
    half = 0.5 * scalars[LENGTH]
    m = scalars[MASS]
    inertia = scalars[INERTIA]
    speed = scalars[SPEED]
    travel = speed * t

    # Headings (relative to module 1), rates and velocities, head to tail, all in module 1's frame.
    # Columns of work: cos, sin, rate, vx, vy | hx, hy, j, bias torque, joint torque.
    angle = x[0] * 0.0
    rate = x[2]
    vx = x[0]
    vy = x[1]
    c = angle + 1.0
    s = angle
    for i in range(n):
        if i > 0:
            vx += half * rate * s  # to the rear joint of the module in front: v + w x (-half e)
            vy -= half * rate * c
            angle += x[2 + i]
            rate += x[n + 1 + i]
            c = np.cos(angle)
            s = np.sin(angle)
            vx += half * rate * s
            vy -= half * rate * c
        work[i, 0] = c
        work[i, 1] = s
        work[i, 2] = rate
        work[i, 3] = vx
        work[i, 4] = vy

    # Tail to head. (pxx, pxy, pyy) and (fx, fy): inertia and bias force with which everything behind acts on the rear
    # joint.
    pxx = x[0] * 0.0
    pxy = pxx
    pyy = pxx
    fx = pxx
    fy = pxx
    torque_behind = pxx
    for i in range(n - 1, -1, -1):
        c = work[i, 0]
        s = work[i, 1]
        rate = work[i, 2]
        # Viscous feet: force and moment about the module's centre follow from four moments of the stance feet.
        c_sum = moments[i, C_SUM]
        c_x = moments[i, C_X] - c_sum * travel
        c_y = moments[i, C_Y]
        c_xx = moments[i, C_XX] - 2.0 * travel * moments[i, C_X] + c_sum * travel * travel
        u = c * work[i, 3] + s * work[i, 4]  # velocity of the centre along and across the module
        w = c * work[i, 4] - s * work[i, 3]
        along = -(c_sum * (u - speed) - c_y * rate)
        across = -(c_sum * w + c_x * rate)
        turning = -(c_x * w - c_y * (u - speed) + c_xx * rate)
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
        work[i, 5] = hx
        work[i, 6] = hy
        work[i, 7] = j
        work[i, 8] = bt
        if i > 0:
            # Torque of spring and damper on this module; minus that on the module in front.
            torque = -stiffness[i - 1] * x[2 + i] - damping[i - 1] * x[n + 1 + i]
            work[i, 9] = torque
            torque_behind = torque
            inverse = 1.0 / j
            pxx = axx - hx * hx * inverse
            pxy = axy - hx * hy * inverse
            pyy = ayy - hy * hy * inverse
            fx = bx + hx * (torque - bt) * inverse
            fy = by + hy * (torque - bt) * inverse
        else:
            # Free base: [axx axy hx; axy ayy hy; hx hy j] [ax; ay; alpha] = -[bx; by; bt], by elimination of alpha.
            inverse = 1.0 / j
            sxx = axx - hx * hx * inverse
            sxy = axy - hx * hy * inverse
            syy = ayy - hy * hy * inverse
            gx = -bx + hx * bt * inverse
            gy = -by + hy * bt * inverse
            det = sxx * syy - sxy * sxy
            ax = (syy * gx - sxy * gy) / det
            ay = (sxx * gy - sxy * gx) / det
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
        c = work[i - 1, 0]
        s = work[i - 1, 1]
        rate = work[i - 1, 2]
        reach = half if i > 1 else 0.0
        rx = -(reach + half) * c
        ry = -(reach + half) * s
        ax += -alpha * ry - rate * rate * rx
        ay += alpha * rx - rate * rate * ry
        new = (work[i, 9] - work[i, 8] - work[i, 5] * ax - work[i, 6] * ay) / work[i, 7]
        out[2 + i] = x[n + 1 + i]
        out[n + 1 + i] = new - alpha
        alpha = new

    if x.size > 2 * n + 1:
        c = np.cos(x[2 * n + 3])
        s = np.sin(x[2 * n + 3])
        out[2 * n + 1] = c * x[0] - s * x[1]
        out[2 * n + 2] = s * x[0] + c * x[1]
        out[2 * n + 3] = x[2]
