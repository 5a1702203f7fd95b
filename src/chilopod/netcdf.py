"""Datasets as netCDF-4, built in memory because the library crashes on a full disk, and checksums behind them."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING

from chilopod.errors import OutputError

if TYPE_CHECKING:
    import xarray as xr

_SEAL = b"\nchilopod, sha256 of all before this line: "
_LENGTH = len(_SEAL) + 64
_OUR_FAULT = (errno.EMFILE, errno.ENFILE, errno.ENOMEM)


class UnsoundError(ValueError):
    """Error of a file that differs from its written contents; the message names the difference."""


def storable(data: xr.Dataset) -> xr.Dataset:
    """The dataset with names that files can hold.

    A slash separates groups in netCDF; it becomes " per " and the name as it was stays as ``long_name``.
    """
    names = {str(name): str(name).replace("/", " per ") for name in data.variables if "/" in str(name)}
    renamed = data.rename(names)
    for name, new in names.items():
        renamed[new].attrs["long_name"] = name
    return renamed


def netcdf(data: xr.Dataset, unlimited: Iterable[str] = ()) -> bytes:
    """The bytes of a netCDF-4 file; ``unlimited`` names dimensions that may grow."""
    return bytes(storable(data).to_netcdf(engine="h5netcdf", unlimited_dims=unlimited))


def sealed(content: bytes) -> bytes:
    """Bytes of a netCDF file with a checksum appended, which readers of netCDF ignore."""
    return content + _SEAL + hashlib.sha256(content).hexdigest().encode()


@contextmanager
def sealed_file(path: Path) -> Iterator[IO[bytes]]:
    """Open file that ends with a seal; the seal is not yet checked.

    Raises FileNotFoundError if the file is missing, UnsoundError if it is not a regular file, cannot be read or has no
    seal, and OutputError if this process lacks memory or file handles to read it.
    """
    try:
        # A pipe of this name must not block.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(handle, "rb") as file:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise UnsoundError("cannot be read (no file)")
            size = file.seek(0, os.SEEK_END)
            file.seek(max(size - _LENGTH, 0))
            if not file.read(_LENGTH).startswith(_SEAL):
                raise UnsoundError("is damaged or was edited, or chilopod did not write it")
            file.seek(0)
            yield file
    except FileNotFoundError:
        if path.is_symlink():
            raise UnsoundError("is a link to a missing file") from None
        raise
    except MemoryError:
        raise OutputError("cannot be read: not enough memory", source=str(path)) from None
    except OSError as error:
        if error.errno in _OUR_FAULT:
            raise OutputError(f"cannot be read ({error.strerror})", source=str(path)) from None
        raise UnsoundError(f"cannot be read ({error.strerror or error})") from None


def unsealed(path: Path) -> bytes:
    """The netCDF file that was :func:`sealed`; errors as for :func:`sealed_file`, UnsoundError also if the seal is
    broken."""
    with sealed_file(path) as file:
        content = file.read()
    data = content[:-_LENGTH]
    if not _is_whole(data, content):
        raise UnsoundError("is damaged or was edited, or chilopod did not write it")
    return data


def _is_whole(data: bytes, content: bytes) -> bool:
    return sealed(data) == content
