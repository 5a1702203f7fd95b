"""What the stance feet of a module do to it, boiled down to four numbers.

A viscous foot at (X, Y) in the frame of its module pushes with minus ``friction`` times its velocity relative to the
floor, so the force and moment of all stance feet of a module depend on them only through four sums, the *contact
moments*::

    [sum c,  sum c X,  sum c Y,  sum c (X^2 + Y^2)]

with X measured ahead of the module's centre and Y to its left. Between two switching instants every stance foot moves
back at the same constant speed v, so X falls as X0 - v t and the moments at time t follow from those at the start of
the interval.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from chilopod.gait import Schedule

Array = NDArray[np.float64]


def contact_moments(forward_offset: float, half_width: float, friction: float, schedule: Schedule) -> Array:
    """Contact moments at the start of every interval of ``schedule``.

    Parameters
    ----------
    forward_offset, half_width
        Foot at mid-stroke, ahead of the module's centre and to the side of its axis, m.
    friction
        Of a foot, N*s/m.

    Returns
    -------
    Shape (intervals, modules, 4): N*s/m, N*s, N*s, N*m*s.
    """
    ahead = forward_offset + schedule.stroke
    side = half_width * np.array([1.0, -1.0])
    weight = friction * schedule.contact
    return np.stack(
        [
            weight.sum(-1),
            (weight * ahead).sum(-1),
            (weight * side).sum(-1),
            (weight * (ahead**2 + side**2)).sum(-1),
        ],
        axis=-1,
    )
