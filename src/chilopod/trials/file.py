"""The file of one record, with a checksum over all of its bytes."""

from __future__ import annotations

import errno
import io
import os
import stat
import zlib
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.errors import OutputError, in_words
from chilopod.trials.netcdf3 import Header, encode, header

_CHECKSUM = "checksum"

_BLANK = "0" * 8
# The attribute as it stands in a file: length of its name, name, type, length of its text, and then the text.
_BEFORE = b"\0\0\0\x08checksum\0\0\0\x02\0\0\0\x08"
_FRONT = 65_536  # bytes: more than dimensions and attributes of all but the largest robots
_LONGEST_HEADER = 2**24
_OUR_FAULT = (errno.EMFILE, errno.ENFILE, errno.ENOMEM)


class Unsound(ValueError):
    """There is something of that name, but it is not what was written; says in words what it is."""


def content_of(record: xr.Dataset) -> bytearray:
    """A record as it stands in its file.

    The checksum is a CRC-32 of all bytes, and a file says how long it is. What a disk or a transfer does to a file is
    found out: every change of up to 32 bits in a row for certain, anything else but for one in 4e9. Whoever forges a
    checksum is not.

    Raises
    ------
    OutputError
        If it holds what cannot be kept.
    """
    content = encode(record, {_CHECKSUM: _BLANK})
    at = content.index(_BEFORE) + len(_BEFORE)
    content[at : at + len(_BLANK)] = f"{zlib.crc32(content):08x}".encode()
    return content


def read_whole(path: Path) -> tuple[bytearray, Header]:
    """The bytes of a record's file, its checksum blanked, and what its header says.

    Nothing is read of what is no file, and not more than the front of one that has another length than it says.

    Raises
    ------
    FileNotFoundError
        If there is none.
    Unsound
        If it is damaged or was edited, is no file, or cannot be read.
    OutputError
        If this process has no more memory, or too many files open, to read it.
    """
    content, found = _read(path, whole=True)
    if not _as_written(content):
        raise Unsound("is damaged or was edited")
    return content, found


def record_of(content: bytes | bytearray) -> xr.Dataset:
    """What stands in the bytes of a file, as it was walked: of the same types, and with nothing about the file.

    Raises
    ------
    Unsound
        If nothing does: whoever wrote them set the checksum himself.
    """
    try:
        record = xr.load_dataset(io.BytesIO(content), engine="scipy").drop_encoding()
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError) as error:
        raise Unsound(f"cannot be read ({in_words(error)})") from None
    del record.attrs[_CHECKSUM]
    record.attrs = {name: value if isinstance(value, str) else float(value) for name, value in record.attrs.items()}
    # The file has integers of 32 bits only, and all text is read as objects.
    whole = {name: each.astype(np.int64) for name, each in record.data_vars.items() if each.dtype == np.int32}
    kinds = {np.dtype(np.int32): np.int64, np.dtype(object): str}
    wider = {name: each.astype(kinds[each.dtype]) for name, each in record.coords.items() if each.dtype in kinds}
    return record.assign(whole).assign_coords(wider)


def read_header(path: Path) -> Header:
    """What the header of a record's file says; whether the rest is whole is not looked at.

    Raises
    ------
    FileNotFoundError, Unsound, OutputError
        As for :func:`read_whole`.
    """
    return _read(path, whole=False)[1]


def _read(path: Path, *, whole: bool) -> tuple[bytearray, Header]:
    try:
        # A pipe of this name must not keep us waiting.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(handle, "rb", buffering=0) as file:
            seen = os.fstat(handle)
            if not stat.S_ISREG(seen.st_mode):
                raise Unsound("cannot be read (no file)")
            content = bytearray(file.read(_FRONT) or b"")
            found = _header_of(content)
            while found is None and len(content) < min(seen.st_size, _LONGEST_HEADER):
                content += _some(file, 3 * len(content))
                found = _header_of(content)
            if found is None or found.size != seen.st_size:
                raise Unsound("is damaged or was edited")
            while whole and len(content) < found.size:
                content += _some(file, found.size - len(content))
            return content, found
    except FileNotFoundError:
        if path.is_symlink():
            raise Unsound("leads nowhere") from None
        raise
    except MemoryError:
        raise OutputError("cannot be read for want of memory", source=str(path)) from None
    except OSError as error:
        if error.errno in _OUR_FAULT:
            raise OutputError(f"cannot be read ({error.strerror})", source=str(path)) from None
        raise Unsound(f"cannot be read ({error.strerror or error})") from None


def _some(file: io.FileIO, most: int) -> bytes:
    """At least one byte more; the system may give less than it was asked for."""
    more = file.read(most)
    if not more:
        raise Unsound("is damaged or was edited")
    return more


def _header_of(front: bytearray) -> Header | None:
    """None where it is none, or longer than this."""
    try:
        return header(bytes(front))
    except ValueError:
        return None


def _as_written(content: bytearray) -> bool:
    """Whether nothing has changed since it was written; the content's checksum is blanked."""
    at = content.find(_BEFORE) + len(_BEFORE)
    end = at + len(_BLANK)
    if at < len(_BEFORE) or end > len(content):
        return False
    said = bytes(content[at:end])
    content[at:end] = _BLANK.encode()
    return said == f"{zlib.crc32(content):08x}".encode()
