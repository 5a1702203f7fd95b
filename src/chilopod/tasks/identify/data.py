"""Data for the identification of constants: results of a robot's walks, from the paper or the user."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from chilopod.engine.arguments import as_number
from chilopod.errors import ParameterError

Array = NDArray[np.float64]

_UNIT = 0.1  # that rounding may leave of the norm of a mode


@dataclass(frozen=True)
class CriticalMode:
    """Pitchfork in k1 of a robot: the data that the constants are fitted to.

    Attributes
    ----------
    k1, k1_tolerance, between
        Critical spring, its tolerance, and the interval in which it is located, N*mm/deg.
    components, component_tolerance
        Joint angles of the critical mode, front to rear, of unit norm and positive sum, shape (N-1,), and tolerance.
    """

    k1: float
    components: tuple[float, ...]
    k1_tolerance: float
    component_tolerance: float
    between: tuple[float, float]

    def __post_init__(self) -> None:
        for name in ("k1", "k1_tolerance", "component_tolerance"):
            value = as_number(name, getattr(self, name))
            if not 0.0 < value < math.inf:
                raise ParameterError("must be positive and finite", field=name, value=value)
        low, high = (as_number("between", each) for each in self.between)
        if not 0.0 < low < self.k1 < high < math.inf:
            raise ParameterError(
                "must hold k1", field="between", value=self.between, allowed="two rising springs, N*mm/deg"
            )
        mode = np.array([as_number("components", each) for each in self.components])
        if not (mode.size and abs(np.linalg.norm(mode) - 1.0) < _UNIT):
            raise ParameterError(
                "must have the norm 1", field="components", value=self.components, allowed="cosines, one for each joint"
            )
        # A mode is a direction: both signs are the same mode.
        object.__setattr__(self, "components", tuple((mode * np.sign(mode.sum() or 1.0)).tolist()))


@dataclass(frozen=True)
class BaseSeries:
    """Walks of a robot with several first springs, to which the constants are fitted.

    All springs are in N*mm/deg.

    Attributes
    ----------
    curved, straight
        Springs at which the robot curves, and at which it walks straight.
    radii, speeds
        Radius of the curve (m), and speed of module 1 along its way (m/s), at some springs.
    onset
        Spring at the onset of curves, by a square-root fit to the bend of joint 1 at the springs of ``curved``.
    law, shape
        Bends at the start of evaluations, roughly those of the data: all joints together ``law[0] * sqrt(1/k1 -
        law[1])`` rad, of which each joint has the share ``shape``, front to rear, (N-1,).
    tolerance
        Tolerance of radii, speeds and onset, relative.
    """

    curved: tuple[float, ...]
    straight: tuple[float, ...]
    radii: Mapping[float, float]
    onset: float
    law: tuple[float, float]
    shape: tuple[float, ...]
    speeds: Mapping[float, float] = field(default_factory=dict)
    tolerance: float = 0.05

    @property
    def springs(self) -> tuple[float, ...]:
        """Springs of all walks that an evaluation runs, rising."""
        return tuple(sorted({*self.curved, *self.straight, *self.radii, *self.speeds}))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each of the :func:`residuals`."""
        return (
            *(f"radius at {spring:g}" for spring in self.radii),
            *(f"speed at {spring:g}" for spring in self.speeds),
            "onset",
            *(f"straight at {spring:g}" for spring in self.straight),
            f"curved at {max(self.curved):g}",
            "steady",
        )

    def start(self, springs: Sequence[float]) -> Array:
        """Joint angles at the start of the walks, rad, shape (springs, N-1)."""
        bend = self.law[0] * np.sqrt(np.maximum(1.0 / np.array(springs) - self.law[1], 0.0))
        angles: Array = np.maximum(bend, 0.1)[:, None] * np.array(self.shape)
        return angles
