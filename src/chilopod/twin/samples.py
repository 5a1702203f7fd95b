"""Simulation steps of the samples of a record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Sampling:
    """Samples at the steps nearest to their times, from samples per second, 0 for none, and the timestep, s."""

    rate: float
    timestep: float

    def steps(self, samples: NDArray[np.intp]) -> NDArray[np.intp]:
        """Steps of samples, of their shape."""
        return np.rint(samples / (self.rate or 1.0) / self.timestep).astype(np.intp)

    def count(self, step: int) -> int:
        """Number of samples up to a step."""
        if self.rate == 0.0 or step < 0:
            return 0
        in_a_step = self.rate * self.timestep
        near = int(step * in_a_step) + np.arange(-2, 4 + int(in_a_step))
        return int(near[self.steps(near) <= step][-1]) + 1

    def between(self, after: int, up_to: int) -> NDArray[np.intp]:
        """Numbers of the samples after one step and up to another."""
        return np.arange(self.count(after), self.count(up_to))
