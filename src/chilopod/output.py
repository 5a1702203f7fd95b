"""Writing results: a file is there whole or not at all, and a folder is known to be writable before work starts."""

from __future__ import annotations

import os
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from chilopod.errors import OutputError

if TYPE_CHECKING:
    import xarray as xr

_ASKING = threading.Lock()  # asking for the umask sets it for a moment, and threads write beside each other


def write_atomic(
    path: str | Path,
    content: str | bytes | bytearray,
    *,
    replace: bool = True,
    durable: bool = False,
    temporary: str = ".chilopod-",
) -> Path:
    """Write a file so that it never exists half-written.

    Parameters
    ----------
    path
        Where to; its folder must exist.
    content
        Text is written as UTF-8.
    replace
        Whether a file that is already there may be replaced.
    durable
        Whether it is to outlast a power failure; :func:`sync_folder` makes its name do so.
    temporary
        How its name begins until it is whole; such a file stays where a process is killed.

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
            raise _taken(path)
        # In the same folder, because a rename is atomic only within one file system.
        handle, unfinished = tempfile.mkstemp(prefix=temporary, dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
                if durable:
                    file.flush()
                    os.fsync(file.fileno())
            # mkstemp makes files private; what users write follows their umask.
            os.chmod(unfinished, 0o666 & ~_umask())
            os.replace(unfinished, path)
        except BaseException:
            Path(unfinished).unlink(missing_ok=True)
            raise
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise _refused(path, error) from None
    return path


def sync_folder(path: Path) -> None:
    """Make sure that the files of a folder keep their names after a power failure, where the system can do that."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # some file systems cannot
            os.fsync(handle)
    finally:
        os.close(handle)


def free_path(path: str | Path, force: bool = False) -> Path:
    """Make sure, before any work is done for it, that a file can be written; its folder is created.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not given, or the folder cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError("is a folder, not a file", source=str(path))
    if path.exists() and not force:
        raise _taken(path)
    prepare_folder(path.parent)
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


def storable(data: xr.Dataset) -> xr.Dataset:
    """The dataset with names that files can hold.

    A slash separates groups in netCDF; it becomes " per " and the name as it was stays as ``long_name``.
    """
    names = {str(name): str(name).replace("/", " per ") for name in data.variables if "/" in str(name)}
    renamed = data.rename(names)
    for name, new in names.items():
        renamed[new].attrs["long_name"] = name
    return renamed


def netcdf(data: xr.Dataset) -> bytes:
    """The bytes of a netCDF-4 file."""
    with tempfile.TemporaryDirectory(prefix="chilopod-") as folder:
        path = Path(folder) / "data.nc"
        storable(data).to_netcdf(path, engine="h5netcdf")
        return path.read_bytes()


def _taken(path: Path) -> OutputError:
    return OutputError("exists and is only replaced with --force", source=str(path))


def _refused(path: Path, error: OSError | ValueError) -> OutputError:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return OutputError(f"cannot be written ({reason or error})", source=str(path))


def _umask() -> int:
    with _ASKING:
        mask = os.umask(0)
        os.umask(mask)
    return mask
