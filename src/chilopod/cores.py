"""Number of processor cores that this process may use."""

from __future__ import annotations

import os

_most: list[int] = []


def cores() -> int:
    """Number of cores that this process may use; all cores of the machine if the system does not tell."""
    here = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min([here, *_most])


def use_at_most(count: int) -> None:
    """Limit this process to a number of cores from now on; for worker processes, which share a machine."""
    _most[:] = [max(1, count)]
