"""A user's family of systems: one kind of system at every value, and remarks on values without one."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from chilopod.errors import AnalysisError, ParameterError, in_words
from chilopod.flows.arguments import UserCode, UserError
from chilopod.stability.problem.capabilities import Family, SystemLike, is_autonomous, system_of

_KEPT = 64  # cached systems: those around a point are used repeatedly


class CheckedFamily:
    """The systems of a family, which must be of one kind."""

    def __init__(self, family: Family) -> None:
        self.dimension = 0  # 0 until a system is known
        self.timed = True  # they depend on time
        self._family = family
        self._systems: dict[float, SystemLike] = {}
        self._refused: dict[str, tuple[str, set[float]]] = {}

    def __call__(self, value: float) -> SystemLike:
        """The system at a value of the parameter."""
        if value in self._systems:
            return self._systems[value]
        with self.calling(value):
            system = system_of(self._family, value)
        kind = system.dimension, not is_autonomous(system)
        if self.dimension == 0:
            self.dimension, self.timed = kind
        if kind != (self.dimension, self.timed):
            what = "dimension" if system.dimension != self.dimension else "kind of period"
            self._refuse(value, what, f"the family changes its {what}")
            raise AnalysisError(f"changes its {what} at {value:g}", field="family", allowed="systems of one kind")
        if len(self._systems) >= _KEPT:
            self._systems.pop(next(iter(self._systems)))
        self._systems[value] = system
        return system

    @contextlib.contextmanager
    def calling(self, value: float) -> Iterator[None]:
        """Context of calls of the user's functions: an exception means that the system does not exist."""
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
        """Remarks on values without a system, with the reason, a sentence each."""
        return [
            said + (f", and at {len(values) - 1} more values" if len(values) > 1 else "")
            for said, values in self._refused.values()
        ]

    def _refuse(self, value: float, kind: str, why: str) -> None:
        self._refused.setdefault(kind, (f"{why} at {value:.9g}", set()))[1].add(value)
