"""How work that takes a while says how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Called with the part done (0 to 1) and a few words."""


def silent(done: float, words: str) -> None:
    """A :data:`Progress` that shows nothing."""


def part(progress: Progress, first: float, last: float, what: str = "") -> Progress:
    """The progress of a part of the work, which goes from ``first`` to ``last`` of the whole; its words say of what."""
    return lambda done, words: progress(first + (last - first) * done, f"{what}: {words}" if what else words)
