"""The floor as the planar model sees it."""

from __future__ import annotations

from typing import Annotated, Final

from chilopod.units import Description, Quantity

GRAVITY: Final = 9.81
"""Acceleration of free fall, m/s^2."""


class Ground(Description):
    """Viscous friction under every foot in stance: force = -friction * (foot velocity relative to the floor).

    Attributes
    ----------
    friction
        Friction coefficient of one foot, N*s/m, positive.
    """

    friction: Annotated[float, Quantity("N*s/m", "N*s/m")]
