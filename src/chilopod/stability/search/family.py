"""A user's family of systems, asked for one value of its parameter at a time."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from chilopod.errors import AnalysisError, ParameterError, in_words
from chilopod.stability.problem.budget import UserCode, UserError
from chilopod.stability.problem.capabilities import Family, SystemLike, is_autonomous

_KEPT = 64  # systems: around a point the same one is asked for again and again


class AskedFamily:
    """The systems of a family, which have to be of one kind.

    Attributes
    ----------
    dimension
        Number of states; 0 as long as no system is known.
    timed
        True if the systems depend on time.
    """

    def __init__(self, family: Family) -> None:
        self.dimension, self.timed = 0, True
        self._family = family
        self._systems: dict[float, SystemLike] = {}
        self._refused: dict[str, tuple[str, set[float]]] = {}

    def __call__(self, value: float) -> SystemLike:
        """The system at a value of the parameter."""
        if value in self._systems:
            return self._systems[value]
        with self.asking(value):
            system = self._family(value)
        timed = not is_autonomous(system)
        if self.dimension == 0:
            self.dimension, self.timed = system.dimension, timed
        if system.dimension != self.dimension or timed is not self.timed:
            what = "dimension" if system.dimension != self.dimension else "kind of period"
            self._refuse(value, what, f"the family changes its {what}")
            raise AnalysisError(f"changes its {what} at {value:g}", field="family", allowed="systems of one kind")
        if len(self._systems) >= _KEPT:
            self._systems.pop(next(iter(self._systems)))
        self._systems[value] = system
        return system

    @contextlib.contextmanager
    def asking(self, value: float) -> Iterator[None]:
        """Context of calls of the user's functions: exceptions of theirs mean that there is no system."""
        try:
            with UserCode("family", value):
                yield
        except (UserError, ParameterError) as error:
            if not self.dimension:
                raise
            cause = error.__cause__ if isinstance(error, UserError) else error
            assert cause is not None
            self._refuse(value, type(cause).__name__, f"the family raised {in_words(cause)}")
            raise UserError(error.problem, field=error.field, value=error.value, allowed=error.allowed) from cause

    @property
    def remarks(self) -> list[str]:
        """Values at which there was no system, and why, a sentence each."""
        return [
            said + (f", and at {len(values) - 1} more values" if len(values) > 1 else "")
            for said, values in self._refused.values()
        ]

    def _refuse(self, value: float, kind: str, why: str) -> None:
        self._refused.setdefault(kind, (f"{why} at {value:.9g}", set()))[1].add(value)
