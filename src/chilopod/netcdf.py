"""Datasets as netCDF-4: built in memory, because the library that writes them dies where a disk is full."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from chilopod.errors import ParameterError

if TYPE_CHECKING:
    import xarray as xr

_SEAL = b"\nchilopod, sha256 of all before this line: "
_DIGEST = 64


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
    """The bytes of a netCDF-4 file.

    Parameters
    ----------
    data
        The dataset.
    unlimited
        Dimensions that may grow.
    """
    return bytes(storable(data).to_netcdf(engine="h5netcdf", unlimited_dims=unlimited))


def sealed(content: bytes) -> bytes:
    """A netCDF-4 file with a checksum behind it, where readers do not look."""
    return content + _SEAL + hashlib.sha256(content).hexdigest().encode()


def unsealed(path: Path) -> bytes:
    """The netCDF-4 file that was :func:`sealed`.

    Raises
    ------
    ParameterError
        If there is no such file, or it is not as it was written.
    """
    try:
        # A pipe of this name must not keep us waiting.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(handle, "rb") as file:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise OSError("no regular file")
            content = file.read()
    except (OSError, ValueError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ParameterError(f"cannot be read ({reason})", source=str(path)) from None
    data = content[: -len(_SEAL) - _DIGEST]
    if sealed(data) != content:
        raise ParameterError("is damaged or was edited, or chilopod did not write it", source=str(path))
    return data
