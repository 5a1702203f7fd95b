"""Record of many walks as a file that grows with every walk; memory holds one walk at a time."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

import numpy as np

from chilopod.errors import OutputError
from chilopod.netcdf import netcdf
from chilopod.output import check_room, spool, write_all

if TYPE_CHECKING:
    import xarray as xr

_LONGEST = 2**16  # samples of a chunk of the file
_ABOUT = 2**20  # bytes of everything but the numbers of walks
_A_CHUNK = 200  # bytes that the file needs for knowing where a chunk is, at most


class RecordFile:
    """netCDF-4 file of many walks of one duration and rate, written in the order of their records.

    Until :meth:`write` the file has no name and ends with this process or with the context. A failure before that is
    reported by :meth:`write`, so that it does not stop the walks. The constructor raises OutputError if the disk lacks
    room for the least size.
    """

    def __init__(self, path: Path, robots: int, least: float = 0.0) -> None:
        check_room(path, least)
        self._path, self._robots = path, robots
        self._failure: OutputError | None = None
        self._spooled: IO[bytes] | None = None
        self._file: Any = None
        self._stored: dict[str, tuple[Any, int]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._finish()
        if self._spooled is not None:
            self._spooled.close()

    def add(self, index: int, record: xr.Dataset) -> None:
        """Write the record of one walk, with one ``robot``, as robot ``index`` of the file; the ``trial`` of the file
        is that of robot 0."""
        if self._spooled is None and self._failure is None:
            self._begin(record)
        if self._failure is not None:
            return
        if index == 0:
            self._file.attrs["trial"] = record.attrs["trial"]
        for name, (stored, axis) in self._stored.items():
            stored[(*(slice(None),) * axis, slice(index, index + 1))] = record.variables[name].values
        self._failure = self._medium.failure(self._path)

    def write(self, *, replace: bool) -> list[Path]:
        """Give the file its name, see :func:`chilopod.output.write_all`; OutputError if the disk was full."""
        self._finish()
        if self._failure is not None:
            raise self._failure
        return [] if self._spooled is None else write_all([(self._path, self._spooled)], replace=replace)

    def _begin(self, record: xr.Dataset) -> None:
        """Create the file with the names, dimensions and attributes of the first record."""
        import h5py

        over = [variable for variable in record.variables.values() if "robot" in variable.dims]
        each = sum(variable.nbytes for variable in over)
        chunks = sum(-(-record.sizes["time"] // _LONGEST) if "time" in variable.dims else 1 for variable in over)
        size = self._robots * (each + chunks * _A_CHUNK) + _ABOUT
        try:
            self._spooled = spool(self._path, size)
        except OutputError as error:
            try:
                self._spooled = spool(Path.cwd() / self._path.name, size)  # where the file itself is kept then
            except OSError:  # or it was deleted
                self._failure = error
                return
        self._medium = _Medium(self._spooled.fileno(), "r+b", closefd=False)
        # A chunk of the file has one robot, so each record is written contiguously.
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
            self._failure = self._failure or self._medium.failure(self._path)


class _Medium(io.FileIO):
    """File that HDF5 writes into; it never raises, because HDF5 would crash, and keeps the first failure."""

    _error: OSError | None = None

    def failure(self, path: Path) -> OutputError | None:
        """Failure of the file, if any."""
        if self._error is None:
            return None
        return OutputError(f"cannot be written ({self._error.strerror})", source=str(path))

    def readinto(self, buffer: Any) -> int:
        # Bytes that could not be written read as zeros.
        found = super().readinto(buffer) or 0
        buffer[found:] = bytes(len(buffer) - found)
        return len(buffer)

    def write(self, content: Any) -> int:
        rest = memoryview(content).cast("B")
        length = len(rest)
        try:
            while self._error is None and len(rest):
                rest = rest[os.write(self.fileno(), rest) :]
        except OSError as error:
            self._error = error
        return length

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0
