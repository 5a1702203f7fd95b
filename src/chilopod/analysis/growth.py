"""Growth of the leading disturbance of the straight walk, of robots by the thousand."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chilopod import stability
from chilopod.cores import cores
from chilopod.errors import ChilopodError
from chilopod.frozen import Array, ComplexArray
from chilopod.labels import Labelled
from chilopod.planar import PlanarModel
from chilopod.planar.many import return_maps, shape
from chilopod.progress import Progress, silent
from chilopod.robot import Robot

_BATCH = 512  # robots at a time
_NEAR = 1e-4  # distance of a multiplier from the unit circle within which its own error bound decides


class Fate(Labelled):
    """Outcome of a small disturbance of the straight walk; each member's ``sentence`` describes it in words."""

    STRAIGHT = "straight", "every disturbance dies out"
    BENDS = "bends", "a bend to one side grows, cycle by cycle"
    UNDULATES = "undulates", "an undulation grows, at a frequency that is not the gait's"
    ALTERNATES = "alternates", "a bend grows that changes sides from one return of the gait to the next"
    UNDECIDED = "undecided", "the leading multiplier is nearer to the unit circle than its error bound"
    INVALID = "invalid", "there is no such robot"
    FAILED = "failed", "the computation failed"


FATES = tuple(Fate)
NEAR = "bound where a multiplier lies within 1e-4 of the unit circle; elsewhere NaN, and the sign is certain"
"""Meaning of the error of a growth rate."""
_FAILED = np.array([np.nan, np.nan, np.nan, -1, FATES.index(Fate.FAILED)])  # column of a computation that failed


class Growth(NamedTuple):
    """Leading disturbance of the straight walks of many robots, shape (robots,): growth rate, 1/s, negative if it dies
    out, NaN if the robot is invalid or the computation failed; angular frequency, rad/s, principal value over the
    period of the gait, 0 for a bend; bound on the error of the growth rate, 1/s, a :data:`NEAR`; number of multipliers
    outside the unit circle, -1 if invalid or failed; and index into :data:`FATES`."""

    growth: Array
    frequency: Array
    error: Array
    unstable: NDArray[np.int16]
    fate: NDArray[np.int8]


def growth_rates(robots: Iterable[Robot | ChilopodError], count: int, progress: Progress = silent) -> Growth:
    """Growth of the leading disturbance of every robot, in batches on all cores. Robots, or the error that says why
    there is none, are taken as they are needed; ``count`` is their number."""
    found: list[Array] = []
    given, waiting = iter(robots), deque[Future[Array]]()
    batches = iter(lambda: list(itertools.islice(given, _BATCH)), [])
    with ThreadPoolExecutor(cores()) as threads:
        for batch in batches:
            waiting.append(threads.submit(_batch, batch))
            while len(waiting) > 2 * cores():
                found.append(waiting.popleft().result())
                progress(len(found) * _BATCH / count, f"{len(found) * _BATCH} of {count} growth rates")
        found += [job.result() for job in waiting]
    growth, frequency, error, unstable, fate = np.concatenate(found, axis=1) if found else np.empty((5, 0))
    return Growth(growth, frequency, error, unstable.astype(np.int16), fate.astype(np.int8))


def _batch(robots: list[Robot | ChilopodError]) -> Array:
    """Rows growth, frequency, error, number of unstable multipliers, and fate."""
    out = np.full((5, len(robots)), np.nan)
    out[3:] = np.array([-1, FATES.index(Fate.INVALID)])[:, None]
    groups: dict[tuple[int, bool, int], list[int]] = {}
    for index, robot in enumerate(robots):
        if isinstance(robot, Robot):
            groups.setdefault(shape(robot), []).append(index)
    for (_, half, _), own in groups.items():
        out[:, own] = _leading([robots[index] for index in own], half)  # type: ignore[misc]
    return out


def _leading(robots: list[Robot], half: bool) -> Array:
    maps, errors = return_maps(robots)
    failed = np.isnan(errors)
    values = np.linalg.eigvals(np.where(failed[:, None, None], 0.0, maps)).astype(np.complex128)
    moduli = np.abs(values)
    # A leading pair of a defective matrix moves by the square root of the error.
    near = np.maximum(_NEAR, 10.0 * np.sqrt(errors * np.abs(maps).max(axis=(1, 2))))
    period = np.array([robot.gait.period for robot in robots])
    rows = _rows(values, period, half)
    for r in np.flatnonzero(~failed & (np.abs(moduli - 1.0).min(axis=1) < near)):
        rows[:, r] = _resolved(robots[r], half)
    rows[:, failed] = _FAILED[:, None]
    return rows


def growing(nu: ComplexArray, half: bool) -> NDArray[np.intp]:
    """Indices of the fates of modes that grow, by their multipliers of a return, which takes a period or half of it."""
    # A bend to one side is mirrored by the return of half a period.
    bends = nu.real < 0.0 if half else nu.real > 0.0
    real = np.where(bends, FATES.index(Fate.BENDS), FATES.index(Fate.ALTERNATES))
    return np.where(nu.imag != 0.0, FATES.index(Fate.UNDULATES), real)


def _rows(values: ComplexArray, period: Array, half: bool) -> Array:
    """Rows of :func:`_batch` of multipliers of a return, shape (robots, 2N+1)."""
    moduli = np.abs(values)
    nu = np.take_along_axis(values, moduli.argmax(axis=1)[:, None], axis=1)[:, 0]
    returns = 2 if half else 1
    with np.errstate(divide="ignore"):
        growth = returns * np.log(np.abs(nu)) / period
    fate = growing(nu, half)
    fate[growth < 0.0] = FATES.index(Fate.STRAIGHT)
    frequency = np.abs(np.angle(nu**returns)) / period
    return np.stack([growth, frequency, np.full(period.size, np.nan), (moduli > 1.0).sum(1), fate])


def _resolved(robot: Robot, half: bool) -> Array:
    """Column of :func:`_batch` of a robot with a multiplier near the unit circle, with its error bound."""
    try:
        found = stability.multipliers(PlanarModel(robot))
    except ChilopodError:
        return _FAILED
    nu = found.values if found.half_period is None else found.half_period
    period = robot.gait.period
    column = _rows(nu[None], np.array([period]), half)[:, 0]
    column[2] = found.error_bounds[0] / (period * math.exp(column[0] * period))
    if found.stable is None:
        column[4] = FATES.index(Fate.UNDECIDED)
    return column
