"""Limits of a search."""

from __future__ import annotations

import math
from numbers import Real

from chilopod.errors import ParameterError
from chilopod.flows.arguments import UserCode, UserError
from chilopod.flows.deadline import Deadline, SpentError, over

__all__ = ["Budget", "SpentError", "UserCode", "UserError"]


class Budget(Deadline):
    """Remaining flows over a return, and time, of a search.

    Attributes
    ----------
    left
        Remaining number of flows; never below zero.

    Parameters
    ----------
    allowed
        Number of flows.
    seconds
        Time from now, s. Inside a ``with`` block of the budget it also ends a running flow.
    """

    def __init__(self, allowed: float, seconds: float = math.inf) -> None:
        super().__init__(seconds)
        given: object = allowed
        if isinstance(given, bool) or not (isinstance(given, Real) and allowed >= 0):
            raise ParameterError("must be a number", field="allowed", value=allowed, allowed="0 or more")
        self.left = allowed

    @property
    def spent(self) -> bool:
        """True if nothing is left."""
        return self.left <= 0 or self.late

    def take(self, count: int = 1) -> None:
        """Count flows before they are computed; a SpentError if too few are left."""
        if self.left <= 0:
            raise SpentError("the budget of flows is spent", field="budget")
        if self.late:
            raise over()
        self.left = max(self.left - count, 0)
