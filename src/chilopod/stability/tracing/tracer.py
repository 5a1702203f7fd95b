"""The tracer: steps along a curve until it ends.

What a curve is, the tracer does not know: orbits over a parameter, or critical orbits over two. A :class:`Traced` curve
takes a step, looks at what happens within it, and says whether the curve ends there; the tracer chooses the length of
the next step, and ends within its budget.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Protocol, TypeVar

from chilopod.errors import ChilopodError
from chilopod.stability.problem.budget import Budget
from chilopod.stability.tracing.ending import Ending

_SHORTEST = 1e-5  # step at which a curve is lost, relative to the longest
_GROWTH, _FALL = 1.5, 0.6
_RETRY = 0.5

Step = TypeVar("Step")


@dataclass(frozen=True)
class Pace:
    """How long steps are.

    Attributes
    ----------
    longest
        Longest step.
    few, many
        Corrections up to which steps grow, and above which they shrink.
    """

    longest: float
    few: int
    many: int


class Traced(Protocol[Step]):
    """A curve that can be followed."""

    def advance(self, size: float, count: int) -> tuple[Step, int]:
        """The step with number ``count``, of some size from where the curve has come to, with what happens within it,
        and how many corrections it took; raises a ChilopodError where a shorter one may succeed."""
        ...

    def arrive(self, step: Step, count: int) -> Ending | None:
        """Go on to the end of a step; why the curve ends there, if it does."""
        ...


def trace(
    curve: Traced[Step], size: float, pace: Pace, points: int | None, budget: Budget
) -> tuple[Ending, str, float]:
    """Follow a curve.

    Parameters
    ----------
    curve
        The curve, which keeps what is found.
    size
        First step.
    pace
        Length of steps.
    points
        Number of steps at most; None for any number.
    budget
        Flows and time that the curve may take.

    Returns
    -------
    Why it ends, what stood in the way if it was lost, and the step to go on with.
    """
    for count in itertools.count(1) if points is None else range(1, points + 1):
        shortened = False
        while True:
            if budget.spent:
                return Ending.BUDGET, "", size
            try:
                step, corrections = curve.advance(size, count)
                break
            except (ChilopodError, ArithmeticError, ValueError) as error:
                # A parameter may step out of what the systems can have, whatever these then raise.
                shortened = True
                size *= _RETRY
                if size < _SHORTEST * pace.longest and not budget.spent:
                    return Ending.LOST, str(error), size
        if not shortened:  # or an edge of what the system can have would be met again at once
            size *= _GROWTH if corrections <= pace.few else 1.0 if corrections <= pace.many else _FALL
        size = min(pace.longest, size)
        ending = curve.arrive(step, count)
        if ending is not None:
            return ending, "", size
    return Ending.ENOUGH_POINTS, "", size
