"""Comparison of a user's derivative with differences, once for each code: a wrong one gives wrong multipliers."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import ChilopodError, ParameterError
from chilopod.frozen import Array

_ROUNDING = 8.0 * float(np.finfo(float).eps)
_STEPS = 1e-5, 1e-7, 1e-9  # steps of differences, relative to each state
_CONTRADICTS = 1e-3  # least relative error of a derivative that is refused
_OWN = __name__.partition(".")[0]
_COMPARED: dict[int, object] = {}  # code by its identity: a family's functions share it


def _code(function: Any) -> object:
    """Code of a function, also of a partial one; the class of another callable object."""
    while isinstance(function, functools.partial):
        function = function.func
    return getattr(function, "__code__", type(function))


def is_new(function: Any) -> bool:
    """True if a user's function was not compared yet."""
    return id(_code(function)) not in _COMPARED


def compare(
    function: Any, mapped: Callable[[Array], Array], x: Array, state: Array, derivative: Array, field: str
) -> None:
    """Compare a function's derivative with differences: along one direction and, if these contradict it, entry by
    entry.

    Those to both sides differ by curvature, noise or a kink: a smaller error is not refused.
    """
    code = _code(function)
    _COMPARED[id(code)] = code  # first, as the comparison calls the function
    if str(getattr(function, "__module__", "")).partition(".")[0] == _OWN:
        return
    steps = np.where(x != 0.0, np.abs(x), float(np.abs(x).max()) or 1.0)

    def compared(shift: Array) -> tuple[NDArray[np.bool_], Array]:
        with np.errstate(all="ignore"):
            up, down = mapped(x + shift), mapped(x - shift)
            change = 0.5 * (up - down)
            uncertain = 4.0 * np.abs(up - 2.0 * state + down) + _ROUNDING * x.size * (np.abs(up) + np.abs(down))
            terms = np.abs(derivative) @ np.abs(shift) + np.abs(change)
            return np.abs(change - derivative @ shift) > uncertain + _CONTRADICTS * terms, change

    try:
        if not compared(_STEPS[0] * steps * np.cos(3.0 * np.arange(x.size) + 1.0))[0].any():
            return
        columns = [[compared(step * shift) for step in _STEPS] for shift in np.diag(steps)]
    except ChilopodError:  # an edge of the function's domain
        return
    for j, column in enumerate(columns):
        wrong = np.all([each for each, _ in column], axis=0)
        if wrong.any():
            del _COMPARED[id(code)]
            i = int(wrong.argmax())
            given, other = derivative[i, j], column[0][1][i] / (_STEPS[0] * steps[j])
            said = f"derivative entry ({i}, {j}) is {given:g}, but a difference gives {other:g}"
            raise ParameterError(said, field=field, value=x.tolist(), allowed="d state[i] / d x[j]")
