"""What is asked of a user's functions: how often, and what becomes of their exceptions."""

from __future__ import annotations

import time

from chilopod.errors import AnalysisError, ChilopodError, in_words


class Asking:
    """Around calls of a user's functions at a value of the parameter: whatever they raise becomes a :class:`UserError`,
    an AnalysisError of one line as where a family has no orbit."""

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
    """A search has evaluated as many return maps as it may."""


class ReturnBudget:
    """Return maps that may still be evaluated.

    Attributes
    ----------
    left
        How many; never below zero.
    """

    def __init__(self, allowed: int, seconds: float) -> None:
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
        """Count some that are about to be evaluated.

        Raises
        ------
        SpentError
            If there is none left.
        """
        if self.left <= 0:
            raise SpentError("as many return maps as were allowed were evaluated", field="budget")
        if self.late:
            raise SpentError("the time is over", field="seconds")
        self.left = max(self.left - count, 0)
