"""How work that takes a while says how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Called with the part done (0 to 1) and a few words."""


def silent(done: float, words: str) -> None:
    """A :data:`Progress` that shows nothing."""
