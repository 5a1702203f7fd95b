"""Checks of arguments that all engines share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import ParameterError
from chilopod.record import LONGEST
from chilopod.robot import Robot

Array = NDArray[np.float64]


def rows_of(
    robots: Sequence[Robot],
    arguments: Mapping[str, tuple[ArrayLike | None, tuple[int, ...]]],
    seeds: Sequence[int] | None = None,
) -> tuple[int, dict[str, Array | None]]:
    """Arguments of ``start`` as arrays with one row a walk.

    Parameters
    ----------
    robots
        One, or one a walk.
    arguments
        By name: what was given, and the shape of one row. What is called ``friction`` must be positive.
    seeds
        One, or one a walk.

    Returns
    -------
    Number of walks, and the arrays, each its own copy; None for what was not given.

    Raises
    ------
    ParameterError
        If one has the wrong shape, is not finite, or their numbers do not agree.
    """
    if not robots:
        raise ParameterError("there are none", field="robots", allowed="at least one")
    if seeds is not None and min(seeds, default=-1) < 0:
        raise ParameterError("must be whole numbers, one a walk", field="seeds", allowed="0 or more")
    counts = {"robots": len(robots), "seeds": len(seeds) if seeds else 1}
    arrays: dict[str, Array | None] = {}
    for name, (argument, shape) in arguments.items():
        arrays[name] = None
        if argument is None:
            continue
        array = np.asarray(argument, dtype=np.float64)
        if array.shape[array.ndim - len(shape) :] != shape or array.ndim > len(shape) + 1 or array.size == 0:
            allowed = f"{shape} or (walks, {', '.join(map(str, shape))})"
            raise ParameterError("has the wrong shape", field=name, value=array.shape, allowed=allowed)
        if not np.isfinite(array).all():
            raise ParameterError("must be finite", field=name)
        if name == "friction" and not (array > 0.0).all():
            raise ParameterError("must be positive", field=name)
        arrays[name] = array if array.ndim > len(shape) else array[None]
        counts[name] = len(array) if array.ndim > len(shape) else 1
    count = max(counts.values())
    for name, each in counts.items():
        if each not in (1, count):
            raise ParameterError("has the wrong length", field=name, value=each, allowed=f"1 or {count}")
    for name, rows in arrays.items():
        if rows is not None:
            arrays[name] = np.array(np.broadcast_to(rows, (count, *rows.shape[1:])))
    return count, arrays


def check_time(until: float, now: float) -> None:
    """Refuse to walk back, and beyond all reason.

    Raises
    ------
    ParameterError
        If ``until`` is before ``now`` (s), or no such time.
    """
    if not now <= until <= LONGEST:
        problem = "has passed" if until < now else "is no time"
        raise ParameterError(
            problem, field="until", value=f"{until:g} s", allowed=f"{now:g} s or later, at most {LONGEST:g} s"
        )
