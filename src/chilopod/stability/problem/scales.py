"""Sizes of the states, from the orbit and the couplings of the states."""

from __future__ import annotations

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.balance import numerical_balance
from chilopod.frozen import Array
from chilopod.stability.problem.capabilities import SystemLike, checked_flow, given_scale

_PART = 1.0 / 16.0  # part of a return
_SWEEPS = 3


def check_finite(*results: Array) -> None:
    """Refuse results of a flow that are not finite."""
    if not all(np.isfinite(each).all() for each in results):
        raise AnalysisError("the flow is not finite over one return", field="flow")


def sizes(system: SystemLike, x: Array, duration: float) -> Array:
    """Large size of every state, shape (n,): the system's own, or the larger of its value and its change within a part
    of the return when the others are disturbed by their own sizes.

    So the coupling gives the size of a state that passes through zero or rests there. (At the end of the return
    strongly damped states would not depend on the others.) For an orbit that is zero throughout, only the ratios have a
    meaning.
    """
    given = given_scale(system)
    if given is not None:
        return given
    later, derivative = checked_flow(system, x, 0.0, _PART * duration)
    check_finite(later, derivative)
    size = np.maximum(np.abs(x), np.abs(later))
    if not size.any():
        if not (derivative - np.diag(np.diag(derivative))).any():  # a map has no parts
            derivative = checked_flow(system, x, 0.0, duration)[1]
            check_finite(derivative)
        return numerical_balance(derivative)
    coupling = np.abs(derivative)
    np.fill_diagonal(coupling, 0.0)
    for _ in range(_SWEEPS):
        size = np.maximum(size, (coupling * size).max(axis=1))
    return np.where(size > 0.0, size, size[size > 0.0].min())
