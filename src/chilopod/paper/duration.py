"""Duration of a report on this machine, before it is computed.

:data:`SECONDS` has the durations on two idle cores of one machine, drawing included. A few walks of the whole robot
measure the speed of this machine.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from chilopod.cores import cores
from chilopod.paper.registry import chosen
from chilopod.paper.section import Section, Size
from chilopod.robot import load_robot
from chilopod.trials import Trial, run

SECONDS: Final = {
    "mode": (1, 1),
    "exponents": (6, 3),
    "modules": (5, 2),
    "curved": (24, 15),
    "branch": (2, 2),
    "undulation": (12, 12),
    "turning": (5, 3),
    "robot-movies": (50, 25),
    "robot-walks": (200, 17),
    "robot-turning": (36, 11),
    "identification": (40, 14),
    "robot-strategies": (100, 10),
    "robot-spread": (340, 90),
    "robot-numerics": (25, 10),
    "robot-structures": (900, 300),
    "robot-why": (900, 90),
    "robot-why-sets": (560, 450),
    "courses": (200, 28),
    "courses-robust": (90, 20),
    "robot-courses": (1200, 250),
    "courses-movie": (10, 10),
    "scaling": (8, 4),
    "atlas": (40, 25),
}
"""Seconds of a full section and of a quick one, by its name; others take a moment."""

_WALKS: Final = 0.17  # s, of the walks of :func:`pace` on that machine
_ENDS: Final = 20.0  # s at the beginning and the end, in which one process has nothing to do
_TINY: Final = 0.2  # of what a quick one takes
_SHORT: Final = 30.0  # s, too short to measure anything for
_IN_FULL: Final = {
    Size.QUICK: "Without --quick it has all trials of the paper and one headline of every chapter beyond",
    Size.MAIN: "--all adds the other studies beyond the paper, and all their trials",
}


@dataclass(frozen=True)
class Plan:
    """Kind of a report, its expected duration here, and additions of a larger one, in words."""

    what: str
    expected: str
    larger: str = ""

    def words(self, taken: float | None = None) -> str:
        """All of it; of a report that is done, what it has taken (s) in place of the expected duration."""
        duration = f": {self.expected}" if taken is None else f"; it took {in_words(taken)}"
        return f"{self.what}{duration}.{self.larger}"


def plan(sections: Sequence[Section[Any]], size: Size, named: bool = False) -> Plan:
    """Plan of a report of a size; ``named`` for named sections."""
    what = f"{len(sections)} of all sections" if named else f"{size.value[0].upper()}{size.value[1:]}"
    own = seconds(sections, size)
    if own < _SHORT:
        return Plan(what, in_words(own))
    here = pace()
    expected = f"{in_words(here * own)} here, less where trials are kept"
    if named or size not in _IN_FULL:
        return Plan(what, expected)
    larger = list(Size)[list(Size).index(size) - 1]
    return Plan(what, expected, f" {_IN_FULL[size]}: {in_words(here * seconds(chosen(size=larger), larger))}.")


def seconds(sections: Sequence[Section[Any]], size: Size) -> float:
    """Duration of sections on the machine of :data:`SECONDS`, s; with two cores some are walked beside the others."""
    beside = alone = 0.0
    for each in sections:
        taken = SECONDS.get(each.name, (0, 0))[size.within(each) is not Size.FULL]
        beside, alone = (beside + taken, alone) if each.ahead else (beside, alone + taken)
    together = beside and alone and cores() > 1
    return (_TINY if size is Size.TINY else 1.0) * (max(beside, alone) + _ENDS if together else beside + alone)


def pace() -> float:
    """Time that a computation takes here over that on the machine of :data:`SECONDS`."""
    walk = Trial(load_robot("aoi2022"), 0.1, engine="twin", rate=10.0)
    run([walk])  # loads what is needed
    started = time.perf_counter()
    run([replace(walk, duration=10.0, seed=seed) for seed in range(2)])
    return (time.perf_counter() - started) / _WALKS


def in_words(value: float) -> str:
    """A duration (s) in words."""
    minutes = round(value / 60.0)
    if minutes < 2:
        return "about a minute" if value > 45.0 else "less than a minute"
    return f"about {minutes} minutes" if minutes < 100 else f"about {value / 3600.0:.1f} hours"
