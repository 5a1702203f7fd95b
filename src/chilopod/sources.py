"""Identity of the installed sources of chilopod, beyond the version number."""

from __future__ import annotations

import functools
import hashlib
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

_PACKAGE = Path(__file__).parent


@functools.cache
def checkout() -> str:
    """Commit of the checkout in which this package lies or was built, such as ``g29a026a.dirty``; empty for a
    release."""
    with suppress(OSError):
        return (_PACKAGE / "checkout.txt").read_text(encoding="utf-8").strip()
    root = _PACKAGE.parent.parent
    if not (root / ".git").exists() or not (root / "src" / "chilopod").samefile(_PACKAGE):
        return ""
    import subprocess

    command = ["git", "-C", str(root), "describe", "--always", "--tags", "--match=v*", "--dirty=.dirty", "--abbrev=7"]
    try:
        # The question is not worth a lock on the repository, nor waiting.
        quiet = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
        done = subprocess.run(command, env=quiet, capture_output=True, text=True, check=True, timeout=5.0)
    except (OSError, subprocess.SubprocessError):
        return ""
    found = done.stdout.strip()
    return (
        ""
        if found.startswith("v") and not found.endswith(".dirty") and "-g" not in found
        else "g" + found.rpartition("-g")[2]
    )


@functools.lru_cache
def digest(without: Sequence[str] = ()) -> str:
    """SHA-256 over the names and contents of all Python files of the package, in hexadecimal, but for subpackages that
    do not count; computed once a process."""
    total = hashlib.sha256()
    for name in sorted(_AT_FIRST):
        if name.partition("/")[0] not in without:
            # Checkouts with other ends of lines are the same code.
            content = (_PACKAGE / name).read_bytes().replace(b"\r\n", b"\n")
            total.update(f"{name}\0{len(content)}\0".encode() + content)
    return total.hexdigest()


def edited(without: Sequence[str] = ()) -> bool:
    """True if a Python file that counts was changed, added or removed since this process began.

    The files are checked once a second at most.
    """
    changed = _changed(int(time.monotonic()))
    return any(name.partition("/")[0] not in without for name in changed)


@functools.lru_cache(maxsize=1)
def _changed(second: int) -> set[str]:
    return {name for name, _ in _stamps().items() ^ _AT_FIRST.items()}


def _stamps() -> dict[str, tuple[int, ...]]:
    found: dict[str, tuple[int, ...]] = {}
    for path in _PACKAGE.rglob("*.py"):
        with suppress(OSError):  # just being replaced
            state = path.stat()
            name = path.relative_to(_PACKAGE).as_posix()
            found[name] = (state.st_size, state.st_mtime_ns, state.st_ctime_ns)
    return found


_AT_FIRST = _stamps()
