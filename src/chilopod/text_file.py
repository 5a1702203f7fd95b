"""Small text files that users write by hand."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from chilopod.errors import ChilopodError

_LARGEST: Final = 1_000_000


def read_text(path: str | Path, kind: str, refused: type[ChilopodError]) -> str:
    """Read a file that may be anything, in no more time and memory than a text by hand takes.

    Raises ``refused`` if it is missing, a folder or anything else that is no regular file, too large, empty, or no
    text; ``kind`` says what was expected, such as ``robot file``.
    """
    source = str(path)
    try:
        if os.path.isdir(path):
            raise refused(f"is a folder, not a {kind}", source=source)
        if os.path.exists(path) and not os.path.isfile(path):
            raise refused("is not a regular file", source=source)
        # Some files that the system makes up call themselves regular, and keep waiting for news.
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            content = file.read(_LARGEST + 1) or b""
    except (OSError, ValueError) as error:
        if isinstance(error, ChilopodError):
            raise
        raise refused(f"cannot be read ({getattr(error, 'strerror', None) or error})", source=source) from None
    if len(content) > _LARGEST:
        raise refused(f"too large for a {kind}", source=source, allowed=f"up to {_LARGEST} bytes")
    if not content.strip():
        raise refused("the file is empty", source=source)
    try:
        return content.decode()
    except UnicodeDecodeError:
        raise refused("is not a text file (UTF-8)", source=source) from None
