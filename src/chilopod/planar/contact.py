"""Force of the stance feet of a module, in eight numbers.

A viscous foot pushes with minus its friction coefficient c times its velocity relative to the floor. Between two
switching instants every stance foot moves straight back at the speed v of the gait: its place in the frame of its
module (x ahead of the centre, y to the left of the axis) is ``p - v t d``, where the direction ``d`` is straight ahead,
``(1, 0)``, unless the leg's yaw turns it by ``e = d - (1, 0)``. Force and moment of all stance feet of a module then
depend on them only through eight sums, the *contact moments* at the start of the interval::

    [sum c,  sum c px,  sum c py,  sum c |p|^2,  sum c ex,  sum c ey,  sum c p.d,  sum c p x e]

With straight legs the fifth, sixth and eighth are zero, which keeps the straight walk straight to the last bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod.compiled import njit
from chilopod.frozen import Array

if TYPE_CHECKING:
    from chilopod.gait import Schedule


C_SUM, C_X, C_Y, C_PP, C_EX, C_EY, C_PD, C_PXE = range(8)
MOMENTS = 8


@njit
def sum_moments(
    contact: Any, stroke: Any, friction: Any, forward_offset: float, half_width: float, yaw: Any, out: Any
) -> None:
    """Contact moments of every module at one instant, into ``out``, shape (N, 8): N*s/m, N*s, N*s, N*m*s, N*s/m, N*s/m,
    N*s, N*s.

    Contact of each foot (1 or 0), its distance ahead of mid-stroke (m) and its friction (N*s/m) have shape (N, 2).
    Offset and half-width are the position of a foot at mid-stroke ahead of the centre and to the side of the axis of
    its module, m. ``yaw`` is that of the two legs of module 1 about their feet at mid-stroke, left positive, rad, shape
    (2,).
    """
    for i in range(contact.shape[0]):
        for column in range(MOMENTS):
            out[i, column] = 0.0
        for side in range(2):
            if not contact[i, side]:
                continue
            ex, ey = 0.0, 0.0
            if i == 0:
                ex, ey = -2.0 * np.sin(0.5 * yaw[side]) ** 2, np.sin(yaw[side])
            x = forward_offset + stroke[i, side] * (1.0 + ex)
            y = (half_width if side == 0 else -half_width) + stroke[i, side] * ey
            c = friction[i, side]
            out[i, C_SUM] += c
            out[i, C_X] += c * x
            out[i, C_Y] += c * y
            out[i, C_PP] += c * (x * x + y * y)
            out[i, C_EX] += c * ex
            out[i, C_EY] += c * ey
            out[i, C_PD] += c * (x * (1.0 + ex) + y * ey)
            out[i, C_PXE] += c * (x * ey - y * ex)


def contact_moments(forward_offset: float, half_width: float, friction: float, schedule: Schedule) -> Array:
    """Contact moments at the start of every interval of ``schedule``, all legs straight and all feet alike, shape
    (intervals, modules, 8); units as in :func:`sum_moments`."""
    intervals, modules, _ = schedule.contact.shape
    out = np.empty((intervals, modules, MOMENTS))
    each, straight = np.full((modules, 2), friction), np.zeros(2)
    for s in range(intervals):
        sum_moments(schedule.contact[s], schedule.stroke[s], each, forward_offset, half_width, straight, out[s])
    return out
