"""Gait: times at which each foot stands, and its position along the body.

Phases are counted in cycles here: 0 is touch-down at the anterior extreme position (AEP), stance lasts while the phase
is below the duty factor, 1 is the next touch-down. Module i (0 = front) and side s (0 = left, 1 = right) have phase
``t/period + i*module_phase/(2 pi) + s*side_phase/(2 pi)``, modulo 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import ParameterError
from chilopod.frozen import read_only
from chilopod.units import Description, Quantity

# Phases such as 3 * 120/360 miss their integer by round-off; anything nearer than this (in cycles) is meant equal.
_SAME_PHASE: Final = 1e-12
_TURN: Final = 2.0 * math.pi
_PHASE: Final = Quantity("rad", "deg", at_least=-_TURN, at_most=_TURN)


@dataclass(frozen=True, slots=True, eq=False)
class Schedule:
    """Contact pattern between switching instants; nothing switches within a segment.

    Attributes
    ----------
    times
        (S+1,) s: start of each segment and end of the last, from 0 to the duration.
    contact
        (S, modules, 2) whether the foot stands, by segment, module from the front, and side (left, right).
    stroke
        (S, modules, 2) m: position of a standing foot ahead of mid-stroke at the start of the segment, see
        :meth:`Gait.stroke`; within the segment it moves back at :attr:`Gait.speed`. 0 for swing feet.

    All arrays are read-only.
    """

    times: NDArray[np.float64]
    contact: NDArray[np.bool_]
    stroke: NDArray[np.float64]


class Gait(Description):
    """Periodic motion of all feet relative to their modules.

    Attributes
    ----------
    stride
        Distance from AEP to PEP, m.
    stance, swing
        Durations of the two phases of a step, s.
    module_phase
        Lead of each module's legs over those of the module in front of it, rad, at most one turn either way.
    side_phase
        Lead of each right leg over the left leg of its module, rad, likewise.
    """

    stride: Annotated[float, Quantity("m", "cm")]
    stance: Annotated[float, Quantity("s", "s")]
    swing: Annotated[float, Quantity("s", "s")]
    module_phase: Annotated[float, _PHASE]
    side_phase: Annotated[float, _PHASE]

    @property
    def period(self) -> float:
        """Duration of a gait cycle, s."""
        return self.stance + self.swing

    @property
    def duty(self) -> float:
        """Fraction of the cycle in which a foot stands, between 0 and 1."""
        return self.stance / self.period

    @property
    def speed(self) -> float:
        """Speed at which standing feet move back, and of the straight walk, in which none of them slips, m/s."""
        return self.stride / self.stance

    @property
    def half_period_symmetric(self) -> bool:
        """True if the right legs repeat the motion of the left legs half a period later: side_phase is half a turn."""
        return abs((self.side_phase / _TURN) % 1.0 - 0.5) <= _SAME_PHASE

    def leg_phases(self, modules: int) -> NDArray[np.float64]:
        """Return the phase of every leg at time 0, in cycles, shape (modules, 2), in [0, 1)."""
        by_module = np.arange(modules)[:, None] * (self.module_phase / _TURN)
        return _wrapped(by_module + np.array([0.0, self.side_phase / _TURN]))

    def phases(self, times: ArrayLike, modules: int) -> NDArray[np.float64]:
        """Return the phase of every leg at `times` (s, any shape), in cycles, shape (..., modules, 2), in [0, 1)."""
        cycles = np.asarray(times, dtype=np.float64)[..., None, None] / self.period
        phases: NDArray[np.float64] = (cycles + self.leg_phases(modules)) % 1.0
        return phases

    def stands(self, phase: ArrayLike) -> NDArray[np.bool_]:
        """Return whether a foot stands at a phase (in cycles, in [0, 1)), of its shape."""
        stands: NDArray[np.bool_] = np.asarray(phase, dtype=np.float64) < self.duty
        return stands

    def stroke(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Return the distance of a foot ahead of mid-stroke at a phase (in cycles, in [0, 1)), m, of its shape.

        Standing it moves from stride/2 to -stride/2 at constant speed; it swings back as a half ellipse looks from
        above.
        """
        cycles = np.asarray(phase, dtype=np.float64)
        back, forward = 0.5 - cycles / self.duty, -0.5 * np.cos(self.swing_angle(cycles))
        return np.where(self.stands(cycles), back, forward) * self.stride

    def swing_angle(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Return the angle of a swinging foot along its half ellipse, from 0 at lift-off to pi at touch-down, rad."""
        angle: NDArray[np.float64] = np.pi * (np.asarray(phase, dtype=np.float64) - self.duty) / (1.0 - self.duty)
        return angle

    def schedule(self, modules: int, duration: float | None = None) -> Schedule:
        """Return the contact pattern from time 0 on.

        Parameters
        ----------
        modules
            Number of modules.
        duration
            Length of time to cover, s, positive; by default one period. Half a period serves the half-period map.

        Returns
        -------
        Schedule
            Shared between calls with the same arguments. Switches closer than 1e-12 of a period are one switch.
        """
        if modules < 1:
            raise ParameterError("must be positive", field="modules", value=modules)
        if duration is None:
            duration = self.period
        elif not 0.0 < duration < math.inf:
            raise ParameterError("must be positive and finite", field="duration", value=duration)
        return _schedule(self, modules, duration)


@lru_cache(maxsize=256)
def _schedule(gait: Gait, modules: int, duration: float) -> Schedule:
    phases = gait.leg_phases(modules)
    duty, cycles = gait.duty, duration / gait.period
    # In cycles: each leg touches down when its phase passes 1 and lifts off when it passes the duty factor.
    switches = np.concatenate((_wrapped(-phases).ravel(), _wrapped(duty - phases).ravel()))
    if cycles > 1.0:
        switches = (np.arange(math.ceil(cycles))[:, None] + switches).ravel()
    switches.sort()
    inside = switches[(switches > _SAME_PHASE) & (switches < cycles - _SAME_PHASE)]
    edges = np.concatenate(([0.0], inside[np.diff(inside, prepend=0.0) > _SAME_PHASE], [cycles]))
    half_lengths = 0.5 * np.diff(edges)
    # Asked in mid-segment, where round-off in the edges cannot change the answer.
    middle = (edges[:-1] + half_lengths)[:, None, None] + phases
    middle -= np.floor(middle)
    contact = gait.stands(middle)
    since_touch_down = np.maximum(middle - half_lengths[:, None, None], 0.0)
    since_touch_down[since_touch_down < _SAME_PHASE] = 0.0
    stroke = np.where(contact, gait.stroke(since_touch_down), 0.0)
    times = edges * gait.period
    times[-1] = duration
    return Schedule(read_only(times), read_only(contact), read_only(stroke))


def _wrapped(cycles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `cycles` modulo 1 in [0, 1), where less than round-off from an integer counts as that integer."""
    rest: NDArray[np.float64] = cycles - np.floor(cycles)
    rest[(rest < _SAME_PHASE) | (rest > 1.0 - _SAME_PHASE)] = 0.0
    return rest
