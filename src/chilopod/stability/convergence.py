"""Stopping rule for corrections of an orbit, with its tolerances (those of curves are in the tracer's table)."""

from __future__ import annotations

from typing import NamedTuple

_FALLING = 0.5  # least fall of the residual that is progress


class Rule(NamedTuple):
    """Stopping rule: the residual is round-off, or small and no longer halves, which is the equations' accuracy."""

    round_off: float  # residual, relative to the sizes of the unknowns, that is round-off
    settled: float  # residual below which it may stop falling

    def met(self, off: float, best: float) -> bool:
        """True if a residual ends the corrections, given the best earlier one."""
        return off <= self.round_off or (off <= self.settled and off >= _FALLING * best)


RETURN = Rule(8e-16, 1e-10)  # for a return: a flow may err by a thousand times its tolerance
NODES = Rule(1e-13, 1e-9)  # for any node of an orbit: with many nodes and long flows the residual is larger
