"""Ends of integrations, cuts of intervals, lengths of steps and sizes of states, shared by the flows."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgebal

from chilopod.errors import AnalysisError, ChilopodError
from chilopod.flows import deadline
from chilopod.flows.arguments import Slopes
from chilopod.frozen import Array

RESOLUTION = 4096  # number of grid points over the period; a pulse in time that the grid meets is resolved exactly
_FAST, _MARGIN = 0.02, 8  # change between two of these points that is fast, and points beside it
_STEPS_IN_FAST_PART = 16

REPEATED = 10.0
"""Factor on the difference of two computations with different steps for a bound on the error of either."""

DONE, NOT_FINITE, BUDGET, STALLED, SLIDES, CHATTERS, GRAZES, JUMPS, TIME_OVER, SHORT = range(10)
"""Ending of an integration."""

_REASONS = {
    NOT_FINITE: ("the motion diverges, or the right-hand side is not finite, at t = {t:g}", None),
    BUDGET: (
        "takes too many steps: the integration stopped at t = {t:g}",
        "method='implicit' if it is stiff and without events, or a shorter interval",
    ),
    STALLED: ("cannot be continued beyond t = {t:.17g}: a singularity, or rates beyond the resolution of time", None),
    SLIDES: (
        "slides along a switching surface from t = {t:g} on: the motion is pushed back from both sides",
        "a right-hand side that defines the sliding motion",
    ),
    CHATTERS: ("chatters (Zeno): crossings accumulate at t = {t:g}", "a guard or a reset that ends it"),
    JUMPS: ("a guard jumps through zero at t = {t:g}", "guards that pass zero continuously"),
    GRAZES: ("grazes a switching surface at t = {t:g}: there the flow has no derivative", None),
}


class TooManySteps(AnalysisError):
    """Steps are too many, as for a stiff right-hand side, or too short, where Taylor series divide 0 by 0."""


ZERO_BY_ZERO = "the right-hand side divides 0 by 0, which rounding spoils,"
"""Cause of the end of a Taylor series where the right-hand side is smooth, as x / (1 - exp(-x)) is at zero."""


def failure(status: int, t: float, cause: str = "") -> ChilopodError:
    """The error for an integration that stopped early at a time, with its cause in the right-hand side, if known."""
    if status == TIME_OVER:
        return deadline.over()
    reason, advice = (f"{cause} at t = {{t:g}}", None) if cause else _REASONS[status]
    kind = TooManySteps if status == BUDGET or cause == ZERO_BY_ZERO else AnalysisError
    return kind(reason.format(t=t), field="rhs", allowed=advice)


def pieces(edges: Array, period: float, t0: float, t1: float) -> list[tuple[float, float]]:
    """Cut [t0, t1] at times that recur every period; ``edges`` run from 0 to the period, or are empty."""
    if edges.size == 0:
        return [(t0, t1)] if t1 > t0 else []
    first, last = int(np.floor(t0 / period)), int(np.ceil(t1 / period))
    switches = [float(k * period + e) for k in range(first, last + 1) for e in edges[:-1]]
    inside = [t for t in switches if t0 + 1e-12 * period < t < t1 - 1e-12 * period]
    cuts = [t0, *inside, t1]
    return [(a, b) for a, b in zip(cuts, cuts[1:], strict=False) if b > a]


def fast_parts(slopes: Slopes, base: Array, edges: Array) -> Array:
    """Borders of the parts of the period, shape (parts, 2), in which a right-hand side at a fixed state changes by more
    than a fiftieth of its range in 1/4096 of the period without a switch: an integrator might step over that."""
    period = float(edges[-1])
    times = (np.arange(RESOLUTION) + 0.5) * (period / RESOLUTION)
    x = state_beside(base)
    samples = slopes(np.asarray(times, dtype=np.float64), np.repeat(x[:, None], RESOLUTION, axis=1))
    samples = np.where(np.isfinite(samples), samples, 0.0)
    span = np.ptp(samples, axis=1, keepdims=True)
    change = np.abs(np.diff(samples, axis=1)) / np.where(span > 0.0, span, 1.0)
    # Round-off of a constant is not a change.
    change[span[:, 0] <= 1e-12 * np.abs(samples).max(axis=1)] = 0.0
    change[:, np.clip(np.searchsorted(times, edges) - 1, 0, RESOLUTION - 2)] = 0.0
    near = np.convolve(change.max(axis=0) > _FAST, np.ones(2 * _MARGIN + 1), mode="same") > 0.0
    borders = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    return np.asarray(borders.reshape(-1, 2) * (period / RESOLUTION))


def state_beside(base: Array, turn: float = 0.0) -> Array:
    """State at about the distance of a state's own size."""
    return base + (float(np.abs(base).max()) or 1.0) * np.cos(3.0 * np.arange(base.size) + 1.0 + turn)


def longest_step(fast: Array, period: float, a: float, b: float) -> float:
    """Longest step from a to b; no border of the fast parts lies between them."""
    middle = (0.5 * (a + b)) % period
    inside = (fast[:, 0] < middle) & (middle < fast[:, 1])
    return (b - a) / _STEPS_IN_FAST_PART if inside.any() else np.inf


def numerical_balance(matrix: Array) -> Array:
    """Sizes d with rows and columns of ``matrix[i, j] * d[j] / d[i]`` of similar norms, for bounds on round-off."""
    return np.asarray(dgebal(matrix, scale=1, permute=0)[3]) if matrix.size else np.empty(0)
