"""Shapes of arrays, compared before compiled code, which looks at no index, reads beyond them."""

from __future__ import annotations

from typing import Any

from chilopod.compiled import njit


@njit
def fit(rows: Any, pieces: Any, robots: Any, states: Any, step: Any, status: Any, record: Any) -> bool:
    """True if arguments of :func:`chilopod.planar.stretch.carry` have shapes that go together, and are not empty."""
    (count, joints), size = robots.lag.shape, pieces.widths.size
    return bool(
        0 < rows.size <= count
        and size > 0
        and pieces.begins.size == size
        and pieces.starts.size == size
        and pieces.interval.size == size
        and pieces.sample.size == size
        and pieces.contact.shape == (len(pieces.contact), joints + 1, 2)
        and pieces.stroke.shape == pieces.contact.shape
        and states.shape == (count, 2 * joints + 6)
        and record.shape[1:] == states.shape
        and step.size == count
        and status.size == count
        and robots.scalars.shape == (count, 4)
        and robots.feet.shape == (count, 2)
        and robots.yaw.shape == (count, 2)
        and robots.damping.shape == (count, joints)
        and robots.torque.shape == (count, joints)
        and robots.friction.shape == (count, joints + 1, 2)
        and robots.profile.shape == (7, count, joints)
    )
