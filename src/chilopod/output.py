"""Writing results: a file is there whole or not at all, and a folder is known to be writable before work starts."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from chilopod.errors import OutputError


def write_atomic(path: str | Path, content: str | bytes, *, replace: bool = True) -> Path:
    """Write a file so that it never exists half-written.

    Parameters
    ----------
    path
        Where to; its folder must exist.
    content
        Text is written as UTF-8.
    replace
        Whether a file that is already there may be replaced.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OutputError
        If the file exists and may not be replaced, or cannot be written; nothing is left behind.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise OutputError("is a folder, not a file", source=str(path))
        if not replace and path.exists():
            raise OutputError("exists and is not overwritten", source=str(path))
        # In the same folder, because a rename is atomic only within one file system.
        handle, temporary = tempfile.mkstemp(prefix=".chilopod-", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
            # mkstemp makes files private; what users write follows their umask.
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise _refused(path, error) from None
    return path


def prepare_folder(path: str | Path) -> Path:
    """Create a folder for results where there is none and make sure files can be written into it.

    Raises
    ------
    OutputError
        If that is not so.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except (OSError, ValueError) as error:
        raise _refused(path, error) from None
    return path


def _refused(path: Path, error: OSError | ValueError) -> OutputError:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return OutputError(f"cannot be written ({reason or error})", source=str(path))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
