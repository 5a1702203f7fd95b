"""Data for the identification of constants: results of a robot's walks, from the paper or the user."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Final, Self

import numpy as np
from pydantic import model_validator

from chilopod import units
from chilopod.errors import ParameterError
from chilopod.units import Description, Quantity

_STIFFNESS: Final = Quantity("N*m/rad", "N*mm/deg")
_UNIT: Final = 0.1  # that rounding may leave of the norm of a mode

TEMPLATE: Final = """\
# Data for `chilopod identify planar ROBOT --data FILE`: the spring k1 at which the straight walk of your robot loses
# its stability, and the shape of its bend there. These are the numbers of Aoi et al. (2022).
k1 = "12 N*mm/deg"
k1_tolerance = "0.5 N*mm/deg"     # largest error of k1
between = ["4 N*mm/deg", "40 N*mm/deg"]     # interval of k1 in which the walk loses its stability once
components = [0.64, 0.36, 0.48, 0.46, 0.16]     # joint angles front to rear, of unit norm; the sign is free
component_tolerance = 0.005     # largest error of each

# Or recorded walks in place of all these: joint angles over time, first column time, gaps empty. Any constants of the
# robot may be free, each in a range; settings are numbers of the robot in one walk.
# [free]
# "ground.friction" = ["100 N*s/m", "500 N*s/m"]
# "legs.forward_offset" = ["0 mm", "100 mm"]
# [[trajectory]]
# file = "walk.csv"     # names of columns such as: time [s], joint 1 [deg], joint 2 [deg]; or .nc of chilopod walk
# settings = ["springs.stiffness[0]=9 N*mm/deg"]
"""
"""Template of the file that :func:`load_data` reads."""


class CriticalMode(Description):
    """Pitchfork in k1 of a robot: the data that the constants are fitted to.

    Attributes
    ----------
    k1, k1_tolerance
        Critical spring and its tolerance, N*m/rad.
    between
        Interval in which it is located, N*m/rad.
    components, component_tolerance
        Joint angles of the critical mode, front to rear, of unit norm and positive sum, shape (N-1,), and tolerance.
    """

    k1: Annotated[float, _STIFFNESS]
    k1_tolerance: Annotated[float, _STIFFNESS]
    between: Annotated[tuple[float, ...], replace(_STIFFNESS, each=True)]
    components: Annotated[tuple[float, ...], Quantity("", "", at_least=-10.0, at_most=10.0, each=True)]
    component_tolerance: Annotated[float, Quantity("", "")]

    @model_validator(mode="after")
    def _is_a_critical_mode(self) -> Self:
        if not (len(self.between) == 2 and self.between[0] < self.k1 < self.between[1]):
            k1, *shown = (units.format(each, _STIFFNESS.display, digits=6) for each in (self.k1, *self.between))
            problem = f"must be two rising springs with k1 = {k1} between them"
            raise ParameterError(problem, field="between", value=shown, allowed="text with a unit; bare numbers are SI")
        mode = np.array(self.components)
        if abs(np.linalg.norm(mode) - 1.0) > _UNIT:
            raise ParameterError(
                "must have the norm 1", field="components", value=self.components, allowed="cosines, one for each joint"
            )
        # A mode is a direction: both signs are the same mode.
        object.__setattr__(self, "components", tuple((mode * np.sign(mode.sum() or 1.0)).tolist()))
        return self
