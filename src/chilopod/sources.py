"""The sources of chilopod as they lie here: which code it is, whatever its version number says."""

from __future__ import annotations

import functools
import hashlib
import time
from pathlib import Path

_PACKAGE = Path(__file__).parent


@functools.cache
def digest() -> str:
    """The SHA-256 of all ``*.py`` of the package, in hexadecimal; computed once a process."""
    total = hashlib.sha256()
    for name in sorted(path.relative_to(_PACKAGE).as_posix() for path in _AT_FIRST):
        # Checkouts with other ends of lines are the same code.
        content = (_PACKAGE / name).read_bytes().replace(b"\r\n", b"\n")
        total.update(f"{name} {len(content)}\n".encode() + content)
    return total.hexdigest()


def edited() -> bool:
    """Whether a source was changed, added or removed since the digest was computed: this process may run both.

    The sources are looked at once a second at most.
    """
    return _edited(int(time.monotonic()))


@functools.lru_cache(maxsize=1)
def _edited(second: int) -> bool:
    try:
        return _stamps() != _AT_FIRST
    except OSError:  # being replaced
        return True


def _stamps() -> dict[Path, tuple[int, int, int]]:
    states = {path: path.stat() for path in _PACKAGE.rglob("*.py")}
    return {path: (state.st_size, state.st_mtime_ns, state.st_ctime_ns) for path, state in states.items()}


_AT_FIRST = _stamps()
