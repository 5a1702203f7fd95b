"""Derivatives of smooth functions by extrapolated differences, each with an error.

Central differences at halved steps h are extrapolated to h = 0 (Richardson 1911; Stoer and Bulirsch, *Introduction to
Numerical Analysis*, section 3.5). The extrapolation allows all powers of h: second derivatives of a return map jump
where two feet change their order of touching down.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from chilopod.errors import AnalysisError, ChilopodError, ParameterError
from chilopod.frozen import Array

ROUND_OFF = 8.0 * 2.0**-52
"""Error of a value, relative to the values."""

_LEVELS = 4  # steps on each side
_STEP = 1e-3  # largest step, relative to the size of the argument
_SAFETY = 4.0  # factor on the last change of the extrapolation: switches within the steps slow its convergence


def derivative(
    function: Callable[[float], Array], at: float, size: float, round_off: float = ROUND_OFF
) -> tuple[Array, Array]:
    """Derivative of a function of one number at a place, and its error; both have the shape of the function's values.
    The ``size`` of the number sets the steps; ``round_off`` is the error of a value, relative to the values. Where the
    function raises a ParameterError on one side, as at the end of a range, the derivative is that towards the other
    side. AnalysisError if it cannot be evaluated on both sides."""
    steps = _STEP * size * 0.5 ** np.arange(_LEVELS)
    here = np.asarray(function(at), dtype=np.float64)
    sides: list[Array] = []
    for sign in (1.0, -1.0):
        try:
            sides.append(np.array([function(at + sign * step) for step in steps.tolist()], dtype=np.float64))
        except ParameterError:
            sides.append(np.empty(0))
        except ChilopodError as failure:
            raise AnalysisError(f"has no derivative at {at:.6g}: {failure}", field="robot") from None
    known = [values for values in sides if values.size]
    if not known:
        raise AnalysisError(f"has no derivative at {at:.6g}: neighbouring values are out of range", field="robot")
    above, below = (values if values.size else here for values in sides)
    slopes = (above - below) / (len(known) * steps.reshape(-1, *[1] * here.ndim))
    for power in range(1, _LEVELS):
        before, slopes = slopes, (2.0**power * slopes[1:] - slopes[:-1]) / (2.0**power - 1.0)
    noise = round_off * np.maximum(np.abs(here), max(float(np.abs(values).max()) for values in known))
    return slopes[0], _SAFETY * np.abs(slopes[0] - before[-1]) + noise * 2.0**_LEVELS / steps[-1]
