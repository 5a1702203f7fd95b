"""How many cores there are for us."""

from __future__ import annotations

import os

_most: list[int] = []


def cores() -> int:
    """Those that this process may use; of the machine, where the system does not say."""
    here = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min([here, *_most])


def use_at_most(count: int) -> None:
    """Leave the other cores to others, from now on: in a worker process, which is one of several."""
    _most[:] = [max(1, count)]
