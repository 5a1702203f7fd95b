"""How much of everything a report computes."""

from __future__ import annotations

from enum import Enum
from typing import TypeVar

T = TypeVar("T")


class Size(Enum):
    """Size of a report."""

    FULL = "as much as the paper"
    QUICK = "coarser sweeps, fewer module counts, springs and repeats; what does not depend on chance is as exact"
    TINY = "every section, but hardly anything of it: walks of the whole robot are cut before they have settled"

    def of(self, full: T, quick: T, tiny: T) -> T:
        """The one of three that is this size's."""
        return {Size.FULL: full, Size.QUICK: quick, Size.TINY: tiny}[self]

    def cut(self, usual: T, tiny: T) -> T:
        """Value for a report that is not tiny; a tiny one has less of it."""
        return self.of(usual, usual, tiny)
