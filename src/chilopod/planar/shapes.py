"""Whether arrays go together, asked before compiled code, which looks at no index, reads beyond them."""

from __future__ import annotations

from typing import Any

from chilopod.errors import ParameterError


def check_shapes(rows: Any, pieces: Any, robots: Any, states: Any, step: Any, status: Any, record: Any) -> None:
    """Refuse arguments of :func:`chilopod.planar.stretch.carry` that do not fit together, or are nothing.

    Raises
    ------
    ParameterError
        If anything does not.
    """
    begins, starts, widths, interval, sample, contact, stroke = pieces
    scalars, feet, damping, friction, profile, lag, torque, yaw = robots
    (count, joints), (size,) = lag.shape, widths.shape
    fits = (
        0 < rows.size <= count
        and size > 0
        and begins.shape == starts.shape == interval.shape == sample.shape == (size,)
        and contact.shape == stroke.shape == (len(contact), joints + 1, 2)
        and states.shape == record.shape[1:] == (count, 2 * joints + 6)
        and step.shape == status.shape == (count,)
        and scalars.shape == (count, 4)
        and feet.shape == yaw.shape == (count, 2)
        and damping.shape == torque.shape == (count, joints)
        and friction.shape == (count, joints + 1, 2)
        and profile.shape == (7, count, joints)
    )
    if not fits:
        raise ParameterError("do not fit together", field="states", value=states.shape, allowed="see carry()")
