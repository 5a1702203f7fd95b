"""A periodic system from a map."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import ParameterError
from chilopod.flows.arguments import LARGEST, UserCode, checked_count, numbers
from chilopod.frozen import Array
from chilopod.stability.problem.derivatives import compare, is_new
from chilopod.stability.problem.system import PeriodicSystem

_SHAKE = 2.0**-52
_OWN = 10.0  # factor on the difference of two independent errors for a bound on either
_ROUNDING = 8.0 * float(np.finfo(float).eps)


def from_map(
    image: Callable[[Array], tuple[ArrayLike, ArrayLike]],
    dimension: int,
    *,
    orbit: ArrayLike | None = None,
    spatial_symmetry: ArrayLike | None = None,
    scale: ArrayLike | None = None,
) -> PeriodicSystem:
    """Build a :class:`PeriodicSystem` of period 1 from a map, which is applied at every whole time.

    Parameters
    ----------
    image
        Function ``image(x)`` -> state after one iteration, shape (n,), and its derivative by x, shape (n, n); refused
        if that contradicts differences of the states at the first point.
    dimension
        Number of states n.
    orbit, spatial_symmetry, scale
        See :class:`PeriodicSystem`.
    """
    if not callable(image):
        raise ParameterError("must be a function", field="image", value=image, allowed="image(x)")
    n = checked_count("dimension", dimension, LARGEST)

    def applied(x: Array) -> tuple[Array, Array]:
        with UserCode("image"):
            pair: Any = image(x.copy())
        if not (isinstance(pair, tuple | list) and len(pair) == 2):
            said = "must return a pair"
            raise ParameterError(said, field="image", value=type(pair).__name__, allowed="(state, derivative)")
        return numbers(pair[0], (n,), "image"), numbers(pair[1], (n, n), "image")

    def iterated(x: Array, t0: float, t1: float) -> tuple[Array, Array, Array]:
        derivative, reach = np.eye(n), np.eye(n)
        for _ in range(math.ceil(t1) - math.ceil(t0)):
            start, (x, factor) = x, applied(x)
            if is_new(image):
                compare(image, lambda x: applied(x)[0], start, x, factor, "image")
            derivative, reach = factor @ derivative, np.abs(factor) @ reach
        return x, derivative, reach

    def flow_with_error(x: Array, t0: float, t1: float) -> tuple[Array, Array, Array]:
        state, derivative, reach = iterated(x, t0, t1)
        shaken = x * (1.0 + _SHAKE * np.sign(np.cos(3.0 * np.arange(n) + 1.0)))
        other = iterated(shaken, t0, t1)[1]
        rounding = _ROUNDING * n * max(1, math.ceil(t1) - math.ceil(t0)) * reach
        return state, derivative, _OWN * np.abs(other - derivative) + rounding

    return PeriodicSystem(
        n,
        1.0,
        lambda x, t0, t1: iterated(x, t0, t1)[:2],
        orbit=orbit,  # type: ignore[arg-type]  # checked and converted there, like the next two
        spatial_symmetry=spatial_symmetry,  # type: ignore[arg-type]
        scale=scale,  # type: ignore[arg-type]
        flow_with_error=flow_with_error,
    )
