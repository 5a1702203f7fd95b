"""Ends of integrations and cuts of intervals, shared by the flows."""

from __future__ import annotations

import numpy as np

from chilopod.errors import AnalysisError, ChilopodError
from chilopod.flows import deadline
from chilopod.frozen import Array

RESOLUTION = 4096  # number of grid points over the period; a pulse in time that the grid meets is resolved exactly

DONE, NOT_FINITE, BUDGET, STALLED, SLIDES, CHATTERS, GRAZES, TIME_OVER = range(8)
"""Ending of an integration."""

_REASONS = {
    NOT_FINITE: ("the motion diverges, or the right-hand side is not finite, at t = {t:g}", None),
    BUDGET: (
        "takes too many steps: the integration stopped at t = {t:g}",
        "method='implicit' if it is stiff, or a shorter interval",
    ),
    STALLED: ("cannot be continued beyond t = {t:.17g}: a singularity, or rates beyond the resolution of time", None),
    SLIDES: (
        "slides along a switching surface from t = {t:g} on: the motion is pushed back from both sides",
        "a right-hand side that defines the sliding motion",
    ),
    CHATTERS: ("chatters (Zeno): crossings accumulate at t = {t:g}", "a guard or a reset that ends it"),
    GRAZES: ("grazes a switching surface at t = {t:g}: there the flow has no derivative", None),
}


class TooManySteps(AnalysisError):
    """The budget of steps is spent, as for a stiff right-hand side."""


def failure(status: int, t: float, cause: str = "") -> ChilopodError:
    """The error for an integration that stopped early at a time, with its cause in the right-hand side, if known."""
    if status not in _REASONS:
        return deadline.over()
    reason, advice = (f"{cause} at t = {{t:g}}", None) if cause else _REASONS[status]
    return (TooManySteps if status == BUDGET else AnalysisError)(reason.format(t=t), field="rhs", allowed=advice)


def pieces(edges: Array, period: float, t0: float, t1: float) -> list[tuple[float, float]]:
    """Cut [t0, t1] at times that recur every period; ``edges`` run from 0 to the period, or are empty."""
    if edges.size == 0:
        return [(t0, t1)] if t1 > t0 else []
    first, last = int(np.floor(t0 / period)), int(np.ceil(t1 / period))
    switches = [float(k * period + e) for k in range(first, last + 1) for e in edges[:-1]]
    inside = [t for t in switches if t0 + 1e-12 * period < t < t1 - 1e-12 * period]
    cuts = [t0, *inside, t1]
    return [(a, b) for a, b in zip(cuts, cuts[1:], strict=False) if b > a]
