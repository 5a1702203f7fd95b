"""Writing of results: files are complete or absent, replace others only on request, and no result is lost.

Every failure raises OutputError, in one line that names the file.
"""

from __future__ import annotations

import logging
import os
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from chilopod import memory
from chilopod.errors import OutputError

Content = str | bytes | bytearray | IO[bytes]
"""Content of a file: text, to be written as UTF-8, bytes, or another open file."""

_COPIED = 2**24  # bytes at a time
_logger = logging.getLogger(__name__)
_unwritten: set[Path] = set()  # folders of which it has been said that they cannot be written


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Block in which errors of the system become OutputErrors about a path."""
    try:
        yield
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        file = next((each for each in path.parents if each.is_file()), None)
        if file:
            raise OutputError("must be a folder, and is a file", source=str(file)) from None
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise OutputError(f"cannot be written ({reason or error})", source=str(path)) from None


def check_files(paths: Iterable[Path], *, replace: bool = False) -> None:
    """Check, before any work is done for them, that files can be written; nothing is created or changed.

    With ``replace`` existing regular files may be replaced.
    """
    folders: set[Path] = set()
    for path in map(Path, paths):
        with _refusing(path):
            _check_names(path)
            _check_replaceable(path, replace)
            if path.parent not in folders:
                _check_folder(path.parent)
        folders.add(path.parent)


def check_folder(path: str | Path) -> Path:
    """Check that a folder can be written into, or can be created; nothing is created."""
    path = Path(path)
    with _refusing(path):
        _check_folder(path)
    return path


def _check_folder(path: Path) -> None:
    _check_names(path)
    with tempfile.TemporaryFile(dir=_nearest(path)):
        pass


def check_room(path: Path, needed: float) -> None:
    """Check, before any work is done for it, that the disk has room (bytes) for a large file or a folder."""
    with _refusing(path):
        free = float(shutil.disk_usage(_nearest(path)).free)
    if needed > free:
        problem = f"takes {memory.in_words(needed)} or more, and there is room for {memory.in_words(free)}"
        raise OutputError(problem, source=str(path))


def write_atomic(
    path: str | Path, content: Content, *, replace: bool = True, durable: bool = False, temporary: str = ".chilopod-"
) -> Path:
    """Write a file so that it never exists half-written, and return its path; missing folders are made. Where it fails
    nothing is left behind.

    Parameters
    ----------
    path, content
        Path and content of the file.
    replace
        True if an existing regular file may be replaced.
    durable
        True if the content must survive a power failure; :func:`sync_folder` does the same for the name.
    temporary
        Prefix of the name while the file is incomplete; such a file remains if the process is killed.
    """
    path = Path(path)
    with _refusing(path):
        _check_replaceable(path, replace)
        with made_folder(path.parent):
            # In the same folder, because a rename is atomic only within one file system.
            unfinished = path.parent / f"{temporary}{os.urandom(8).hex()}"
            try:
                _fill(unfinished, content, durable)
                os.replace(unfinished, path)
            except BaseException:
                unfinished.unlink(missing_ok=True)
                raise
    return path


def write_all(files: Iterable[tuple[Path, Content]], *, replace: bool = True) -> list[Path]:
    """Write the files of a result, paths and contents, one after the other as they are given; return their paths.

    A file that cannot be written at its path is kept under another name in the same folder, or else in the current
    folder, and the error names that place, or the file if there is none.
    """
    written: list[Path] = []
    kept: list[Path] = []
    lost: list[Path] = []
    failure: OutputError | None = None
    for path, content in files:
        try:
            written.append(write_atomic(path, content, replace=replace))
        except OutputError as error:
            failure = failure or error
            elsewhere = _kept(path, content)
            kept += elsewhere
            lost += [] if elsewhere else [path]
    if failure is None:
        return written
    where = f"kept instead: {', '.join(map(str, kept))}" if kept else "no other place could be written"
    where += f"; lost: {', '.join(map(str, lost))}" if kept and lost else ""
    failure = OutputError(f"{failure.problem}; {where}", source=failure.source)
    failure.written = written
    raise failure


def keep(path: Path, content: Content, what: str) -> None:
    """Write a file that only saves time later. If that fails the work goes on, and one line says that ``what`` the file
    holds is not kept; another one if its folder could be written in between."""
    try:
        write_atomic(path, content)
        _unwritten.discard(path.parent)
    except OutputError as error:
        if path.parent not in _unwritten:
            _logger.warning("%s: %s are not kept: %s", path.parent, what, error.problem)
        _unwritten.add(path.parent)


def spool(path: Path, size: int = 0) -> IO[bytes]:
    """Unnamed temporary file on the same disk, for a large result under computation; it vanishes with this process.

    Room is set aside for twice the size (bytes): for the file, and for the copy that :func:`write_atomic` makes of it.
    """
    with _refusing(path), ExitStack() as unless_it_fails:
        file = unless_it_fails.enter_context(tempfile.TemporaryFile(dir=_nearest(path.parent)))
        if size and hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, 2 * size)
        unless_it_fails.pop_all()
    return file


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


@contextmanager
def made_folder(path: Path) -> Iterator[None]:
    """Create a folder that survives a power failure; if the block fails, folders that were created and are empty go
    again."""
    made = [each for each in (path, *path.parents) if not _is_there(each)]
    try:
        path.mkdir(parents=True, exist_ok=True)
        for each in made:
            with suppress(OSError):  # folders above may be unreadable
                sync_folder(each.parent)
        yield
    except BaseException:
        for each in made:
            with suppress(OSError):
                each.rmdir()
        raise


def _check_replaceable(path: Path, replace: bool) -> None:
    try:
        mode = os.lstat(path).st_mode
    except FileNotFoundError:
        return
    if stat.S_ISDIR(mode):
        raise OutputError("is a folder, not a file", source=str(path))
    if not stat.S_ISREG(mode):
        what = "a link, not a regular file," if stat.S_ISLNK(mode) else "not a regular file"
        raise OutputError(f"is {what} and is not replaced, even with --force", source=str(path))
    if not replace:
        raise OutputError("exists and is only replaced with --force", source=str(path))


def _check_names(path: Path) -> None:
    """Refuse names that are too long, which is found only where their folder is there."""
    here = _nearest(path)
    for part in path.parts[len(here.parts) :]:
        _is_there(here / part)


def _is_there(path: Path) -> bool:
    try:
        os.lstat(path)
    except FileNotFoundError:
        return False
    return True


def _nearest(folder: Path) -> Path:
    """The folder, or the nearest existing folder above it."""
    return next((each for each in (folder, *folder.parents) if _is_there(each)), folder)


def _fill(path: Path, content: Content, durable: bool) -> None:
    """Make a new file of this content."""
    with open(path, "xb") as file:
        if isinstance(content, str | bytes | bytearray):
            file.write(content.encode() if isinstance(content, str) else content)
        else:
            content.seek(0)
            shutil.copyfileobj(content, file, _COPIED)
        if durable:
            file.flush()
            os.fsync(file.fileno())


def _kept(path: Path, content: Content) -> list[Path]:
    """Other path at which a file could be written, or None."""
    for folder in (path.parent.resolve, Path.cwd):
        with suppress(OSError):
            return [write_atomic(_free(folder() / path.name), content, replace=False)]
    return []


def _free(path: Path) -> Path:
    """The path itself, or the path with a number, whichever is free."""
    free, number = path, 1
    while _is_there(free):
        number += 1
        free = path.with_stem(f"{path.stem}-{number}")
    return free
