"""Memory that this process may still take."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_UNITS = ("bytes", "kB", "MB", "GB", "TB", "PB")
_CGROUPS = Path("/sys/fs/cgroup")
_CONTAINER = (
    ("memory.max", "memory.current", "memory.stat"),
    ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes", "memory/memory.stat"),
)
"""Files with the limit and the use of a container's memory: version 2 of control groups and version 1."""


def available() -> float:
    """Free bytes, the least of the machine's, the container's and the process's own limit; infinite if the system does
    not tell."""
    return min([float("inf"), *_limits()])


def in_words(size: float) -> str:
    """A number of bytes, such as ``2.4 GB``."""
    power = 0
    while size >= 999.5 and power < len(_UNITS) - 1:
        size, power = size / 1000.0, power + 1
    return f"{size:.3g} {_UNITS[power]}"


def _limits() -> Iterator[float]:
    with suppress(OSError, TypeError):
        found = re.search(r"MemAvailable: *([0-9]+) kB", Path("/proc/meminfo").read_text())
        yield 1024.0 * int(found[1])  # type: ignore[index]
    for most, used, details in _CONTAINER:
        with suppress(OSError, ValueError):  # there is none, or it is "max"
            # The system gives up its file cache on demand.
            cached = re.search(r"^(?:total_)?inactive_file ([0-9]+)$", (_CGROUPS / details).read_text(), re.MULTILINE)
            taken = int((_CGROUPS / used).read_text()) - int(cached[1] if cached else 0)
            yield float(int((_CGROUPS / most).read_text()) - taken)
    with suppress(ImportError, OSError, ValueError):
        import resource

        own = resource.getrlimit(resource.RLIMIT_AS)[0]
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        if own != resource.RLIM_INFINITY:
            yield float(own - pages * resource.getpagesize())
