"""A time limit that is checked during flows, and a budget of these."""

from __future__ import annotations

import contextlib
import math
import sys
import threading
import time
import warnings
from contextvars import ContextVar
from numbers import Real
from typing import Self

import numpy as np

from chilopod.errors import ChilopodError, ParameterError
from chilopod.frozen import Array

_LIMIT: ContextVar[Deadline | None] = ContextVar("limit", default=None)
_SAID: ContextVar[set[object] | None] = ContextVar("said", default=None)
MORE = 0.3
"""Time, s, after the limit of a search in which errors of known matrices are still computed."""
_PACKAGE = __name__.partition(".")[0]


class SpentError(ChilopodError, RuntimeError):
    """The budget or the time of a search is spent: an end of the whole search, unlike an :class:`AnalysisError`."""


class Deadline:
    """A time limit, s from now, infinite for none; within its context a flow ends at the limit or at that of an
    outer context, even inside an integration, and a message is shown once. Time that numba compiles does not count."""

    def __init__(self, seconds: float = math.inf) -> None:
        given: object = seconds
        if isinstance(given, bool) or not isinstance(given, Real) or not seconds >= 0.0:
            raise ParameterError("must be a number of seconds", field="seconds", value=seconds, allowed="0 or more")
        self._ends = _now() + (seconds if seconds < threading.TIMEOUT_MAX else math.inf)
        self._stop = np.zeros(1)
        self._said: set[object] = set()
        self._left = contextlib.ExitStack()
        self._timer: threading.Timer | None = None

    @property
    def late(self) -> bool:
        """True once the limit is reached."""
        return self._ends < math.inf and _now() > self._ends

    @property
    def remaining(self) -> float:
        """Time to the limit, s; never below zero."""
        return max(self._ends - _now(), 0.0)

    def prolong(self, seconds: float) -> None:
        """Extend the limit by some time, s."""
        self._ends += seconds
        self._stop[0] = 0.0

    def __enter__(self) -> Self:
        self._left.callback(_SAID.reset, _SAID.set(self._said if (outer := _SAID.get()) is None else outer))
        if self._ends < math.inf:  # else an outer limit holds
            if (outer_limit := _LIMIT.get()) is not None:
                self._ends = min(self._ends, outer_limit._ends)
            self._left.callback(_LIMIT.reset, _LIMIT.set(self))
            self._wait()
        return self

    def __exit__(self, *_: object) -> None:
        self._left.close()
        if self._timer is not None:
            self._timer.cancel()

    def _wait(self) -> None:
        if self.late:
            self._stop[0] = 1.0
            return
        self._timer = threading.Timer(max(self._ends - _now(), 0.0) + 1e-3, self._wait)
        self._timer.daemon = True
        self._timer.start()


_SPENT = "the flows (`budget`) were spent"


class Budget(Deadline):
    """Remaining flows over a return, and time, s from now, of a search; within its context that also ends a flow."""

    def __init__(self, allowed: float, seconds: float = math.inf) -> None:
        super().__init__(seconds)
        self.left = allowed  # remaining number of flows; never below zero
        self.taken = 0.0  # number of those so far

    @property
    def spent(self) -> str:
        """The limit that is reached, in words; empty before."""
        return "the time (`seconds`) was spent" if self.late else _SPENT if self.left <= 0 else ""

    def take(self, count: int = 1) -> None:
        """Count flows before they are computed; a SpentError if too few are left."""
        if self.left <= 0:
            raise SpentError(_SPENT)
        if self.late:
            raise over()
        self.taken += min(count, self.left)
        self.left = max(self.left - count, 0)


def stop() -> Array:
    """Flag for compiled code, shape (1,): not zero once the limit is reached; a SpentError if it is already."""
    check()
    found = _LIMIT.get()
    return np.zeros(1) if found is None else found._stop


def check(more: float = 0.0) -> None:
    """Raise a SpentError if the limit is reached, or was some time, s, ago."""
    found = _LIMIT.get()
    if found is not None and found._stop[0] != 0.0 and _now() > found._ends + more:
        raise over()


def is_first(what: object) -> bool:
    """True the first time within the outermost limit, as within a call of an analysis, and always outside of limits."""
    said = _SAID.get()
    if said is None:
        return True
    known = what in said
    said.add(what)
    return not known


def warn(message: str, category: type[Warning]) -> None:
    """Show a warning at the user's line that led to it, once within the outermost limit."""
    if not is_first(message):
        return
    level = 2
    with contextlib.suppress(ValueError):  # beyond the first frame
        while sys._getframe(level - 1).f_globals.get("__name__", "").startswith(f"{_PACKAGE}."):
            level += 1
    warnings.warn(message, category, stacklevel=level)


def over() -> SpentError:
    """The error of a flow that reached its time limit."""
    return SpentError("the time limit is reached", field="seconds")


def _now() -> float:
    compiler = sys.modules.get("chilopod.numba_internals")
    return time.monotonic() - (compiler.COMPILING.seconds() if compiler else 0.0)
