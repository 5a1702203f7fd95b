"""Manners of the process of the command line: streams that may fail, an end at any moment.

Nothing is imported here but small modules of Python itself: this comes before everything else.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
import time
from contextlib import suppress

TYPE_CHECKING = False  # that of typing, which takes longer to load than all this
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType
    from typing import Any, NoReturn, TextIO

    from _typeshed import ReadableBuffer

INTERRUPTED = 130

_ENDS = ("SIGINT", "SIGTERM", "SIGHUP")  # not all systems have all of them

_PATIENCE = 1.0  # s after Ctrl-C until it is said that something is still being stopped
_SHOW_CURSOR = b"\n\x1b[?25h"  # a progress bar hides it


class Stream(io.FileIO):
    """A file that never fails whoever writes into it: what cannot be written is lost, and the first reason is kept as
    ``failure``."""

    failure: OSError | None = None

    def write(self, data: ReadableBuffer) -> int:
        """As of any file, or nothing at all; the number of bytes either way."""
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
        return memoryview(data).nbytes


def hold_streams() -> Stream:
    """Make stdout and stderr of this process such that printing never fails, closed or full as they may be.

    Returns
    -------
    What is under stdout, to be asked at the end whether all of it was written.
    """
    for number, mode in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            # The next file that is opened would take its place, and what is meant for stderr would land in a result.
            # The system gives the lowest free number, which is this. Nothing can be written into our stdout then, as
            # if it were closed; what goes to a stderr that is closed nobody wants to see.
            os.set_inheritable(os.open(os.devnull, mode), True)
    stdout, stderr = Stream(1, "wb", closefd=False), Stream(2, "wb", closefd=False)
    sys.stdout, sys.stderr = _text(stdout, sys.stdout), _text(stderr, sys.stderr)
    return stdout


def _text(stream: Stream, like: TextIO | Any) -> TextIO:
    # What a robot is called need not fit the terminal's encoding; better an escape than a crash.
    return io.TextIOWrapper(
        io.BufferedWriter(stream),
        encoding=getattr(like, "encoding", None) or "utf-8",
        errors="backslashreplace",
        line_buffering=stream.isatty() or stream.fileno() == 2,
        write_through=bool(getattr(like, "write_through", False)),
    )


def unwritten(stdout: Stream) -> str | None:
    """Why something that was printed could not be written; None if it was, or its reader has seen enough."""
    sys.stdout.flush()
    failure = stdout.failure
    if failure is None or failure.errno == errno.EPIPE:
        return None
    return failure.strerror or str(failure)


def answer_interrupts() -> None:
    """Let Ctrl-C, SIGTERM and SIGHUP end this process with one line and exit code 128 + signal, whatever it is doing.

    As anywhere in Python they become a KeyboardInterrupt, so that all is left in order. Only while something is being
    imported (which C code may turn into any other exception, or forget), and at a second Ctrl-C, the process ends on
    the spot: files are there whole or not at all at any moment. Where stopping takes more than a second, that is said.
    """
    # Ignored in the background of a script, or by nohup, they stay ignored.
    usual = (signal.default_int_handler, signal.SIG_DFL)
    heard = [each for each in signal.Signals if each.name in _ENDS and signal.getsignal(each) in usual]
    for each in heard:
        signal.signal(each, _interrupted)
    if not heard:
        return
    sys.unraisablehook = _unraisable
    if sys.platform != "win32":
        # While compiled code runs Python calls no handler, but it writes the signal's number into a pipe.
        pressed, press = os.pipe()
        os.set_blocking(press, False)
        signal.set_wakeup_fd(press, warn_on_full_buffer=False)
        threading.Thread(target=_watch, args=(pressed,), name="Ctrl-C", daemon=True).start()


def ignore_interrupts() -> None:
    """From the end of the work on there is nothing to stop."""
    for each in signal.Signals:
        if each.name in _ENDS:
            signal.signal(each, signal.SIG_IGN)


def exit_code() -> int:
    """Exit code of this process where it was interrupted: 128 + the number of the signal, 130 after Ctrl-C."""
    return 128 + _pressed[0] if _pressed else INTERRUPTED


def leave(words: str = "error: interrupted\n") -> NoReturn:
    """End this process now, as interrupted."""
    with suppress(OSError):
        os.write(2, (_SHOW_CURSOR if os.isatty(2) else b"") + words.encode())
    for clean_up in reversed(on_leave):
        with suppress(Exception):
            clean_up()
    # Semaphores that outlive this process are told of on its stderr, by the process that looks after them.
    started = sys.modules.get("multiprocessing.util")
    if started is not None:
        with suppress(Exception):
            started._run_finalizers(0)
    os._exit(exit_code())


on_leave: list[Callable[[], object]] = []
"""Functions to call where this process ends on the spot."""

_pressed: list[int] = []


def _interrupted(number: int, frame: FrameType | None) -> None:
    first = not _pressed
    _pressed.append(number)
    if _importing(frame) or (number == signal.SIGINT and not first):
        leave()
    if first:  # a terminal that is closed says so twice
        raise KeyboardInterrupt


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _unraisable(found: Any) -> None:
    """Where nothing can be raised (a destructor, a callback) Python would print a KeyboardInterrupt and go on."""
    if found.exc_type is KeyboardInterrupt:
        leave()
    sys.__unraisablehook__(found)


def _watch(pressed: int) -> None:
    _next(pressed, *(each for each in signal.Signals if each.name in _ENDS))
    time.sleep(_PATIENCE)
    with suppress(OSError):
        os.write(2, b"stopping ... (Ctrl-C once more ends at once)\n")
    _next(pressed, signal.SIGINT)
    leave()


def _next(pressed: int, *numbers: int) -> None:
    """Wait for one of some signals; others come the same way."""
    while os.read(pressed, 1)[0] not in numbers:
        pass
