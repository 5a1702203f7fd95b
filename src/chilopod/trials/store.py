"""A folder of records: what is in it is what it says, or it is not there."""

from __future__ import annotations

import io
import logging
import os
import stat
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import xarray as xr

from chilopod.errors import OutputError
from chilopod.output import check_folder, sync_folder, write_atomic
from chilopod.trials.netcdf3 import encode
from chilopod.trials.trial import Trial

_logger = logging.getLogger(__name__)

_CHECKSUM = "checksum"
_BLANK = "0" * 8
# The attribute as it stands in a file: length of its name, name, type, length of its text, and then the text.
_BEFORE = b"\0\0\0\x08checksum\0\0\0\x02\0\0\0\x08"
_FRONT = 65_536  # bytes: before all but dimensions


class Store:
    """A folder that keeps the records of trials, each in a netCDF-3 file of its own.

    Every file is there whole or not at all, has a name derived from all that makes its trial, holds that as text, and a
    checksum over all of its bytes. Many processes may use one folder at the same time: whoever walks the same trial
    writes the same file.

    Parameters
    ----------
    folder
        Made with the first record where there is none.
    tell
        Given a line about every file that is not what it should be; by default the logger of this module, which prints
        it on stderr if nobody has told it otherwise.

    Raises
    ------
    OutputError
        If files cannot be written into the folder.
    """

    def __init__(self, folder: str | Path, tell: Callable[[str], object] = _logger.warning) -> None:
        self.folder = check_folder(folder)
        self._tell = tell

    def read(self, trial: Trial) -> xr.Dataset | None:
        """The record of a trial; None if there is none.

        A file that is damaged, was edited, or holds another trial counts as none. It is moved aside: its name gets the
        ending ``.aside``.

        Raises
        ------
        ParameterError
            If the trial cannot be kept, see :meth:`chilopod.trials.Trial.check_findable`.
        OutputError
            If such a file cannot be moved.
        """
        trial.check_findable()
        path = self.folder / trial.file_name
        try:
            content = _content(path)
        except FileNotFoundError:
            return None
        except (OSError, MemoryError) as error:
            self._move_aside(path, f"cannot be read ({error})")
            return None
        if not _whole(content):
            self._move_aside(path, "is damaged or was edited")
            return None
        # What was written here can be read again.
        record = xr.load_dataset(io.BytesIO(content), engine="scipy")
        if record.attrs.get("trial") != trial.text:
            self._move_aside(path, "holds another trial")
            return None
        del record.attrs[_CHECKSUM]
        return record

    def write(self, trial: Trial, record: xr.Dataset) -> None:
        """Keep a record, for good once :meth:`sync` has been called.

        Raises
        ------
        ParameterError
            If the trial cannot be kept.
        OutputError
            If it is another trial's record, or the file cannot be written.
        """
        trial.check_findable()
        if record.attrs.get("trial") != trial.text:
            raise OutputError(
                "is that of another trial, or was walked by another version of chilopod or of the engine",
                field="record",
                allowed=f"a record for {trial.file_name}",
            )
        content = encode(record, {_CHECKSUM: _BLANK})
        at = content.index(_BEFORE) + len(_BEFORE)
        content[at : at + len(_BLANK)] = f"{zlib.crc32(content):08x}".encode()
        # Whoever deletes the folder while trials walk loses what was in it, not the walks to come: it is made again.
        write_atomic(self.folder / trial.file_name, content, durable=True)

    def sync(self) -> None:
        """Make sure that what has been written is there even after a power failure."""
        with suppress(FileNotFoundError):  # somebody deleted it
            sync_folder(self.folder)

    def _move_aside(self, path: Path, why: str) -> None:
        aside = path.with_name(f"{path.name}.aside")
        count = 1
        while os.path.lexists(aside):
            count += 1
            aside = path.with_name(f"{path.name}.aside{count}")
        try:
            path.rename(aside)
        except FileNotFoundError:
            return  # another process was faster
        except OSError as error:
            raise OutputError(f"{why}, and cannot be moved aside ({error.strerror})", source=str(path)) from None
        self._tell(f"{path} {why}: walked again, what was there is {aside.name}")


def _content(path: Path) -> bytearray:
    # A pipe of this name must not keep us waiting.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OSError("no file")
        return bytearray(file.read())


def _whole(content: bytearray) -> bool:
    """Whether nothing has changed since it was written; the content's checksum is blanked."""
    at = content.find(_BEFORE, 0, _FRONT) + len(_BEFORE)
    end = at + len(_BLANK)
    if at < len(_BEFORE) or end > len(content):
        return False
    said = bytes(content[at:end])
    content[at:end] = _BLANK.encode()
    return said == f"{zlib.crc32(content):08x}".encode()
