"""Small text files that users write by hand."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from chilopod.errors import ChilopodError

_LARGEST: Final = 1_000_000


def read_text(path: str | Path, kind: str, refused: type[ChilopodError], largest: int = _LARGEST) -> str:
    """Read a text file of at most so many bytes, with bounded time and memory for any path.

    Raises ``refused`` if the path is missing or not a regular file, or the file is too large, empty or not text;
    ``kind`` is the expected content, such as ``robot file``.
    """
    source = str(path)
    try:
        if os.path.isdir(path):
            raise refused(f"is a folder, not a {kind}", source=source)
        if os.path.exists(path) and not os.path.isfile(path):
            raise refused("is not a regular file", source=source)
        # Some virtual files of the system claim to be regular and block.
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            content = file.read(largest + 1) or b""
    except FileNotFoundError:
        raise refused("no such file", source=source) from None
    except (OSError, ValueError) as error:
        if isinstance(error, ChilopodError):
            raise
        raise refused(f"cannot be read ({getattr(error, 'strerror', None) or error})", source=source) from None
    if len(content) > largest:
        raise refused(f"too large for a {kind}", source=source, allowed=f"up to {largest} bytes")
    if not content.strip():
        raise refused("the file is empty", source=source)
    try:
        return content.decode("utf-8-sig")  # some editors of Windows begin with a byte order mark
    except UnicodeDecodeError:
        raise refused("is not a text file (UTF-8)", source=source) from None
