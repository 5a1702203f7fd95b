"""Commands called in this process, with all that they print and all that they do to files."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import stat
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from chilopod.cli import main
from outcomes import Ending

_FONTS = os.environ.get("MPLCONFIGDIR") or str(Path.home() / ".cache" / "matplotlib")  # listing them takes seconds
HERE = "a/b/here"
"""Where commands run, below the folder of a case: deep enough for a stray ``..``."""


@dataclass(frozen=True)
class Place:
    """The folder of a case, and where what is printed meanwhile is kept, for all to see."""

    root: Path
    out: Path
    err: Path

    @property
    def here(self) -> Path:
        """Where the command runs."""
        return self.root / HERE

    @property
    def tmp(self) -> Path:
        """Where it has its temporary files."""
        return self.root / "tmp"

    @property
    def home(self) -> Path:
        """Where results may be kept that cannot be written elsewhere."""
        return self.root / "home"

    @property
    def tried(self) -> Path:
        """What is tried, in words."""
        return self.out.with_name("tried")

    @property
    def interrupted(self) -> Path:
        """There once the command was sent Ctrl-C."""
        return self.out.with_name("interrupted")


def new_place(home: Path) -> Place:
    """An empty place in a folder of this process."""
    root = home / "case"
    if root.exists():
        shutil.rmtree(root)
    place = Place(root, home / "out", home / "err")
    place.here.mkdir(parents=True)
    place.tmp.mkdir()
    place.home.mkdir()
    for told in (place.out, place.err, place.tried, place.interrupted):
        told.unlink(missing_ok=True)
    return place


def environment(place: Place, **more: str) -> dict[str, str]:
    """Variables with which nothing outside of a place is written."""
    own = {"TMPDIR": str(place.tmp), "HOME": str(place.home), "MPLCONFIGDIR": _FONTS}
    return {**os.environ, **own, **more}


def called(arguments: Sequence[str], place: Place, meanwhile: Callable[[], None] | None = None) -> Ending:
    """Call the command line in a place.

    Parameters
    ----------
    arguments
        As after ``chilopod``.
    place
        Where.
    meanwhile
        Done in a thread of its own while the command runs.
    """
    code, escaped = None, ""
    beside = threading.Thread(target=meanwhile) if meanwhile else None
    with _in(place), _captured(place), warnings.catch_warnings():
        warnings.simplefilter("always", RuntimeWarning)
        warnings.simplefilter("always", UserWarning)
        if beside:
            beside.start()
        interruptible = threading.current_thread() is threading.main_thread()
        if interruptible:
            former = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            code = main(list(arguments))
        except BaseException as error:
            frames = traceback.extract_tb(error.__traceback__)
            at = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
            escaped = f"{type(error).__name__}: {error}{at}"
        finally:
            if interruptible:
                signal.signal(signal.SIGINT, former)
    if beside:
        beside.join()
    return Ending(code, _text(place.out), _text(place.err), escaped)


def snapshot(root: Path) -> dict[str, object]:
    """All that is below a folder: kind, size and time of every file, kind of every folder, by its path."""
    found: dict[str, object] = {}
    for folder, folders, files in os.walk(root):
        below = os.path.relpath(folder, root)
        for name in (*folders, *files):
            about = os.lstat(os.path.join(folder, name))
            path = name if below == "." else f"{below}/{name}"
            kind = stat.S_IFMT(about.st_mode)
            found[path] = (
                kind if stat.S_ISDIR(about.st_mode) else (kind, about.st_size, about.st_mtime_ns, about.st_ino)
            )
    return found


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


@contextmanager
def _in(place: Place) -> Iterator[None]:
    former, variables, folder = os.getcwd(), dict(os.environ), tempfile.tempdir
    os.chdir(place.here)
    os.environ.update(environment(place))
    tempfile.tempdir = str(place.tmp)
    try:
        yield
    finally:
        os.chdir(former)
        tempfile.tempdir = folder
        os.environ.clear()
        os.environ.update(variables)


@contextmanager
def _captured(place: Place) -> Iterator[None]:
    """Whatever writes to stdout and stderr, native code included, writes into the files of the place."""
    streams, root = (sys.stdout, sys.stderr), logging.getLogger()
    handlers, root.handlers = root.handlers, []  # those of tests would take what is told on stderr
    for stream in streams:
        stream.flush()
    kept = [os.dup(number) for number in (1, 2)]
    for number, path in ((1, place.out), (2, place.err)):
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
        os.dup2(handle, number)
        os.close(handle)
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and not stream.closed:
                stream.flush()
        for number, handle in zip((1, 2), kept, strict=True):
            os.dup2(handle, number)
            os.close(handle)
        sys.stdout, sys.stderr = streams
        root.handlers = handlers
