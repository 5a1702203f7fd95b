"""Where corrections of an orbit end: one rule, and its tolerances (those of curves are in the tracer's table)."""

from __future__ import annotations

from typing import NamedTuple

_FALLING = 0.5


class Rule(NamedTuple):
    """A stopping rule: what is left to correct is round-off, or it is small and no longer halves, which is all that the
    equations are good to.

    Attributes
    ----------
    round_off
        Residual, of the sizes of the unknowns, that is round-off.
    settled
        Residual below which it may stop falling.
    """

    round_off: float
    settled: float

    def met(self, off: float, best: float) -> bool:
        """True if a residual, after others of which the best is given, ends the corrections."""
        return off <= self.round_off or (off <= self.settled and off >= _FALLING * best)


RETURN = Rule(8e-16, 1e-10)
"""Residual of a return: a few units in the last place; a flow may err by a thousand times its tolerance."""
NODES = Rule(1e-13, 1e-9)
"""Residual at any of the nodes of an orbit, of which there are many, and whose flows are longer than a step."""
