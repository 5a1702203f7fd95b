"""Progress of long computations."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Function of the fraction done (0 to 1) and a few words."""


def silent(done: float, words: str) -> None:
    """:data:`Progress` that shows nothing."""


def part(progress: Progress, first: float, last: float, what: str = "") -> Progress:
    """Progress of a part of the work, from fraction ``first`` to ``last`` of the whole, with ``words`` that name the
    part."""
    return lambda done, words: progress(first + (last - first) * done, f"{what}: {words}" if what else words)
