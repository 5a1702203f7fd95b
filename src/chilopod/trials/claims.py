"""Claims on trials of a folder, so that several processes walk different ones."""

from __future__ import annotations

import os
import struct
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Self

from chilopod.process import on_leave

NAME = ".chilopod-claims"
"""Name of the file whose bytes are locked; it exists while a process walks, and after a killed one."""

_NOT, _WITH_OTHERS, _ALONE = "F_UNLCK", "F_RDLCK", "F_WRLCK"  # how a byte is locked
_PRESENT = 0  # the byte that all processes in the folder share a lock of
_DIGITS = 15  # of a trial's name: which byte is its own, of 2**63
_TRIES, _PAUSE = 500, 2e-3  # s; a process that enters while the last one leaves tries again


class Claims:
    """Trials that this process walks in a folder.

    A claim is a lock of the operating system on one byte of an empty file in the folder; the trial's name determines
    the byte. It ends with its process, however that ends. On systems without such locks (Linux has them for open files)
    every claim succeeds; then work is doubled, without other harm. ``sweep`` is called at the end if no other process
    uses the folder: incomplete files in it then belong to killed processes.
    """

    def __init__(self, folder: Path, sweep: Callable[[], object]) -> None:
        self._path, self._sweep = folder / NAME, sweep
        self._handle: int | None = None

    def __enter__(self) -> Self:
        if sys.platform == "linux":
            with suppress(OSError):
                for _ in range(_TRIES):
                    if self._entered():
                        on_leave.append(self._leave)
                        break
                    time.sleep(_PAUSE)
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(ValueError):
            on_leave.remove(self._leave)
        self._leave()

    def _leave(self) -> None:
        if self._handle is not None:
            handle, self._handle = self._handle, None
            with suppress(OSError):
                _locked(handle, _NOT, _PRESENT)  # of two processes that leave at once one gets the lock
                if _locked(handle, _ALONE, _PRESENT) and _is(handle, self._path):
                    self._sweep()
                    self._path.unlink()
            os.close(handle)

    def take(self, name: str) -> bool:
        """Claim the trial of a file for this process; return False if another process has it."""
        with suppress(OSError):
            return self._handle is None or _locked(self._handle, _ALONE, _byte_of(name))
        return True

    def release(self, name: str) -> None:
        """Release a claimed trial for other processes."""
        with suppress(OSError):
            if self._handle is not None:
                _locked(self._handle, _NOT, _byte_of(name))

    def _entered(self) -> bool:
        """True on success; False if the last process is just leaving and removes the file."""
        was_there = self._path.exists()
        handle = _opened(self._path, os.O_CREAT)
        try:
            if _locked(handle, _WITH_OTHERS, _PRESENT) and _is(handle, self._path):
                self._handle = handle
        except OSError:  # no locks here
            if not was_there:
                self._path.unlink()
            raise
        finally:
            if self._handle is None:
                os.close(handle)
        return self._handle is not None


def nobody_in(folder: Path) -> bool:
    """True if no process is known to walk in a folder now."""
    with suppress(OSError):
        try:
            handle = _opened(folder / NAME)
        except FileNotFoundError:
            return True
        try:
            return _locked(handle, _ALONE, _PRESENT)
        finally:
            os.close(handle)
    return False


def _byte_of(name: str) -> int:
    return 1 + int(name.removesuffix(".nc")[-_DIGITS:], 16)


def _opened(path: Path, more: int = 0) -> int:
    # Neither what a link leads to nor a pipe.
    return os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | more, 0o666)


def _is(handle: int, path: Path) -> bool:
    """True if an open file still has that name."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat(follow_symlinks=False))
    except FileNotFoundError:
        return False


def _locked(handle: int, kind: str, byte: int) -> bool:
    """Lock or unlock a byte, unless another process has it."""
    if sys.platform != "linux":
        raise OSError("there are no such locks")
    import fcntl

    # Type, from where, first byte, how many, and the number of a process, which has to be 0.
    request = struct.pack("hhqqi", getattr(fcntl, kind), os.SEEK_SET, byte, 1, 0)
    try:
        # Those of an open file: threads exclude each other too, and none is lost when another file is closed.
        fcntl.fcntl(handle, fcntl.F_OFD_SETLK, request)
    except (BlockingIOError, PermissionError):
        return False
    return True
