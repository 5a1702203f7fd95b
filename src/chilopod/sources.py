"""The sources of this package, as a digest: which code this is, whatever its version says."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path


@lru_cache
def digest(without: Sequence[str] = ()) -> str:
    """SHA-256 over the names and contents of all Python files of the package, in hexadecimal; computed once a process.

    Parameters
    ----------
    without
        Names of subpackages that do not count.
    """
    root, found = Path(__file__).parent, hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if name.partition("/")[0] not in without:
            content = path.read_bytes()
            found.update(f"{name}\0{len(content)}\0".encode())
            found.update(content)
    return found.hexdigest()
