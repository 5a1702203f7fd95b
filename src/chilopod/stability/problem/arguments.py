"""Arguments that searches share: checks by their names, systems of a family, and the budget."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable

import numpy as np

from chilopod.errors import ParameterError
from chilopod.flows.arguments import UserCode, UserError, checked_count, finite_array, positive
from chilopod.flows.deadline import Deadline, SpentError, over
from chilopod.stability.problem.capabilities import SystemLike

__all__ = ["Budget", "SpentError", "UserCode", "UserError"]

_FUNCTIONS = {
    "family": "family(value) -> the system at a value of the parameter",
    "family2": "family2(p, q) -> the system at values of two parameters",
    "progress": "progress(count, point)",
}
_COUNTS = {"budget": sys.maxsize, "points": sys.maxsize, "periods": 1000}  # with the largest
_LENGTHS = {"step", "longest", "precision"}
_SYSTEM = "a system from `from_rhs` or `from_map`, or a PeriodicSystem"


def check_arguments(**given: object) -> None:
    """Check arguments by their names: functions, whole numbers, positive numbers, and flags."""
    for field, value in given.items():
        if field in _FUNCTIONS:
            if not callable(value):
                raise ParameterError("must be a function", field=field, value=value, allowed=_FUNCTIONS[field])
        elif field in _COUNTS:
            if not (field == "points" and value is None):
                checked_count(field, value, _COUNTS[field])
        elif field in _LENGTHS:
            positive(field, value)
        elif not isinstance(value, bool | np.bool_):
            raise ParameterError("must be a truth value", field=field, value=value, allowed="True or False")


def check_system(system: object, field: str = "system", value: object = None) -> None:
    """Check that an argument is a system or, at a value of the parameter, that a family returned one."""
    if not all(hasattr(system, name) for name in ("dimension", "period", "symmetry", "flow")):
        said = "must be a system" if field == "system" else f"must return a system, not {type(system).__name__}"
        raise ParameterError(said, field=field, value=system if field == "system" else value, allowed=_SYSTEM)


def system_of(family: Callable[..., SystemLike], *values: float) -> SystemLike:
    """System of a family at values of its parameters; raises a ChilopodError if there is none."""
    value = values[0] if len(values) == 1 else values
    with UserCode("family", value):
        system = family(*values)
    check_system(system, "family", value)
    return system


def checked_interval(between: object) -> tuple[float, float]:
    """An interval as two finite numbers, the second of which is larger."""
    low, high = finite_array(between, (2,), "between").tolist()
    if not (low < high and np.isfinite(high - low)):
        raise ParameterError("must rise", field="between", value=between, allowed="(lower, higher), both finite")
    return low, high


def checked_box(between: object) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Intervals of both parameters, shape (2, 2)."""
    try:
        box = np.array([checked_interval(each) for each in between])  # type: ignore[attr-defined]
    except (TypeError, ParameterError):
        box = np.empty(0)
    if box.shape != (2, 2):
        allowed = "((p_low, p_high), (q_low, q_high))"
        raise ParameterError("must be two intervals", field="between", value=between, allowed=allowed)
    return box


_SPENT = "the flows (`budget`) were spent"


class Budget(Deadline):
    """Remaining flows over a return, and time, of a search.

    Inside a ``with`` block of the budget the time, s from now, also ends a running flow.
    """

    def __init__(self, allowed: float, seconds: float = math.inf) -> None:
        super().__init__(seconds)
        self.left = allowed  # remaining number of flows; never below zero

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
        self.left = max(self.left - count, 0)
