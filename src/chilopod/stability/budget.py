"""Limits of a search, and what becomes of exceptions of a user's functions."""

from __future__ import annotations

import math
import time

from chilopod.errors import AnalysisError, ChilopodError, in_words


class UserCode:
    """Context of a call of a user's function at a value of the parameter: whatever it raises becomes a
    :class:`UserError`, an AnalysisError of one line as where a family has no orbit."""

    def __init__(self, field: str, value: object) -> None:
        self._field, self._value = field, value

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, Exception) and not isinstance(error, ChilopodError):
            raise UserError(f"raised {in_words(error)}", field=self._field, value=self._value) from error


class UserError(AnalysisError):
    """A user's function raised an exception of its own."""


class SpentError(AnalysisError):
    """The budget of a search is spent."""


class Budget:
    """Flows over a return, and time, that a search may still take.

    Attributes
    ----------
    left
        Number of flows; never below zero.

    Parameters
    ----------
    allowed
        Number of flows.
    seconds
        Time from now on, s.
    """

    def __init__(self, allowed: float, seconds: float = math.inf) -> None:
        self.left = allowed
        self._ends = time.monotonic() + seconds

    @property
    def late(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() > self._ends

    @property
    def spent(self) -> bool:
        """Whether nothing is left."""
        return self.left <= 0 or self.late

    def take(self, count: int = 1) -> None:
        """Count some flows that are about to be computed.

        Raises
        ------
        SpentError
            If there is none left.
        """
        if self.left <= 0:
            raise SpentError("as many flows as were allowed are spent", field="budget")
        if self.late:
            raise SpentError("the time is over", field="seconds")
        self.left = max(self.left - count, 0)
