"""A record of many walks as a file that grows with every walk: memory holds one of them, however many there are."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

import numpy as np

from chilopod.errors import OutputError
from chilopod.netcdf import netcdf
from chilopod.output import check_room, spool, write_all

if TYPE_CHECKING:
    import xarray as xr

_LONGEST = 2**16  # samples of a chunk of the file
_ABOUT = 2**20  # bytes of all that is no number of a walk
_A_CHUNK = 200  # bytes that the file needs for knowing where a chunk is, at most


class RecordFile:
    """A netCDF-4 file of many walks of one duration and rate, written as their records come, in any order.

    Until :meth:`write` it has no name, and vanishes with this process. What fails meanwhile is said there, so that it
    does not stop the walks. Used as a context: it is gone when that is left.

    Parameters
    ----------
    path
        Path of the file.
    robots
        Number of walks.
    least
        Bytes that it will have, at least.

    Raises
    ------
    OutputError
        If there is no room for so many.
    """

    def __init__(self, path: Path, robots: int, least: float = 0.0) -> None:
        check_room(path, least)
        self._path, self._robots = path, robots
        self._failure: OutputError | None = None
        self._medium: _Medium | None = None
        self._file: Any = None
        self._stored: dict[str, tuple[Any, int]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._finish()
        if self._medium is not None:
            self._medium.file.close()

    def add(self, index: int, record: xr.Dataset) -> None:
        """Put in the record of one walk.

        Parameters
        ----------
        index
            Its ``robot`` in the file.
        record
            With one ``robot``, and otherwise like the others; the ``trial`` of the file is that of ``robot`` 0.
        """
        if self._failure is None and self._file is None:
            self._begin(record)
        if self._failure is not None:
            return
        if index == 0:
            self._file.attrs["trial"] = record.attrs["trial"]
        for name, (stored, axis) in self._stored.items():
            values = record.variables[name].values
            front = (slice(None),) * axis
            stored[(*front, slice(index, index + 1))] = values

    def write(self, *, replace: bool) -> list[Path]:
        """Give the file its name, see :func:`chilopod.output.write_all`.

        Raises
        ------
        OutputError
            If it cannot have it, and says where it is kept; or if there was no room for it.
        """
        self._finish()
        if self._failure is not None:
            raise self._failure
        if self._medium is None:
            return []
        return write_all([(self._path, self._medium.file)], replace=replace)

    def _begin(self, record: xr.Dataset) -> None:
        """Make the file from the first record, which holds all names, dimensions and attributes."""
        import h5py

        over = [variable for variable in record.variables.values() if "robot" in variable.dims]
        each = sum(variable.nbytes for variable in over)
        chunks = sum(-(-record.sizes["time"] // _LONGEST) if "time" in variable.dims else 1 for variable in over)
        try:
            self._medium = _Medium(spool(self._path, self._robots * (each + chunks * _A_CHUNK) + _ABOUT))
        except OutputError as error:
            self._failure = error
            return
        # A chunk of the file is of one robot: each record is written at a stretch.
        shaped = record.copy()
        for variable in shaped.variables.values():
            if "robot" in variable.dims:
                longest = {"robot": 1, "time": min(variable.sizes.get("time", 1), _LONGEST)}
                sizes = tuple(longest.get(str(dim), size) for dim, size in variable.sizes.items())
                variable.encoding = {"chunksizes": sizes}
        self._medium.write(netcdf(shaped, unlimited=["robot"]))
        self._failure = self._medium.failure(self._path)
        if self._failure is not None:
            return
        self._file = h5py.File(self._medium, "r+")
        for name, variable in record.variables.items():
            if "robot" in variable.dims:
                axis = variable.dims.index("robot")
                self._file[name].resize(self._robots, axis)
                self._stored[str(name)] = self._file[name], axis
        self._stored.pop("robot")[0][:] = np.arange(self._robots)

    def _finish(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        if self._medium is not None and self._failure is None:
            self._failure = self._medium.failure(self._path)
            self._medium.trim()


class _Medium:
    """File that HDF5 writes into: it never raises, because HDF5 dies of that; it remembers what failed."""

    def __init__(self, file: IO[bytes]) -> None:
        self.file = file
        self._handle = file.fileno()
        self._at = self._size = 0
        self._error: OSError | None = None

    def failure(self, path: Path) -> OutputError | None:
        """Failure of the file, if any."""
        if self._error is None:
            return None
        return OutputError(f"cannot be written ({self._error.strerror})", source=str(path))

    def trim(self) -> None:
        """Cut off room that was not needed."""
        with suppress(OSError):
            os.ftruncate(self._handle, self._size)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        pass

    def truncate(self, size: int | None = None) -> int:
        self._size = self._at if size is None else size
        return self._size

    def readinto(self, buffer: memoryview) -> int:
        length = min(len(buffer), max(self._size - self._at, 0))
        found = os.pread(self._handle, length, self._at)
        buffer[:length] = found.ljust(length, b"\0")
        self._at += length
        return length

    def read(self, size: int = -1) -> bytes:
        buffer = bytearray(max(self._size - self._at, 0) if size < 0 else size)
        return bytes(buffer[: self.readinto(memoryview(buffer))])

    def write(self, content: Any) -> int:
        rest = memoryview(content).cast("B")
        length = len(rest)
        try:
            while self._error is None and len(rest):
                done = os.pwrite(self._handle, rest, self._at + length - len(rest))
                rest = rest[done:]
        except OSError as error:
            self._error = error
        self._at += length
        self._size = max(self._size, self._at)
        return length
