"""Streams and signals of the command-line process: output that may fail, and interrupts at any moment.

Only small modules of Python itself are imported here, because this module is loaded first.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
import time
from contextlib import contextmanager, suppress

TYPE_CHECKING = False  # that of typing, which takes longer to load than all this
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType
    from typing import Any, NoReturn, TextIO

    from _typeshed import ReadableBuffer

INTERRUPTED = 130

_ENDS = [each for each in signal.Signals if each.name in ("SIGINT", "SIGTERM", "SIGHUP")]  # not all systems have all

_PATIENCE = 1.0  # s after Ctrl-C until a message that work is still being stopped
_GRACE = 4.0  # s from then to the end of what was ended by another signal, which nobody repeats
_SHOW_CURSOR = b"\n\x1b[?25h"  # a progress bar hides it


class Stream(io.FileIO):
    """File whose writes never raise: text that cannot be written is lost, and ``failure`` keeps the first reason."""

    failure: OSError | None = None

    def write(self, data: ReadableBuffer) -> int:
        """Write text if possible, and return its length in any case."""
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
        return memoryview(data).nbytes


def hold_streams() -> Stream:
    """Replace stdout and stderr of this process by streams that never raise, even if closed or full.

    Returns
    -------
    The stream under stdout; :func:`unwritten` tells at the end if all of it was written.
    """
    for number, mode in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            # The next file that is opened would take its place, and what is meant for stderr would land in a result.
            # The system gives the lowest free number, which is this. Nothing can be written into our stdout then, as
            # if it were closed; output to a closed stderr is dropped.
            os.set_inheritable(os.open(os.devnull, mode), True)
    stdout, stderr = Stream(1, "wb", closefd=False), Stream(2, "wb", closefd=False)
    sys.stdout, sys.stderr = _text(stdout, sys.stdout), _text(stderr, sys.stderr)
    return stdout


def _text(stream: Stream, like: TextIO | Any) -> TextIO:
    # A robot's name may not fit the terminal's encoding; an escape is printed instead.
    return io.TextIOWrapper(
        io.BufferedWriter(stream),
        encoding=getattr(like, "encoding", None) or "utf-8",
        errors="backslashreplace",
        line_buffering=stream.isatty() or stream.fileno() == 2,
        write_through=bool(getattr(like, "write_through", False)),
    )


def unwritten(stdout: Stream) -> str | None:
    """Reason why output could not be written; None if all was written or its reader closed the pipe."""
    sys.stdout.flush()
    failure = stdout.failure
    if failure is None or failure.errno == errno.EPIPE:
        return None
    return failure.strerror or str(failure)


def answer_interrupts() -> None:
    """Let Ctrl-C, SIGTERM and SIGHUP end this process with one line and exit code 128 + signal at any moment.

    The signals raise KeyboardInterrupt, so that cleanup runs. During an import (where C code may change or lose the
    exception) and at a second Ctrl-C the process ends at once; files are complete or absent at any moment. If stopping
    takes more than a second, a line says so, and unless it was Ctrl-C, the process ends four seconds later.
    """
    # Ignored in the background of a script, or by nohup, they stay ignored.
    usual = (signal.default_int_handler, signal.SIG_DFL)
    heard = [each for each in _ENDS if signal.getsignal(each) in usual]
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
    """Ignore interrupts after the end of the work."""
    for each in _ENDS:
        signal.signal(each, signal.SIG_IGN)


@contextmanager
def deaf() -> Iterator[None]:
    """Block in which new processes ignore Ctrl-C, which this one obeys."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def exit_code() -> int:
    """Exit code of an interrupted process: 128 + the number of the signal, 130 after Ctrl-C."""
    return 128 + _pressed[0] if _pressed else INTERRUPTED


def leave(words: str = "error: interrupted\n") -> NoReturn:
    """End this process now, as interrupted."""
    with suppress(OSError):
        os.write(2, (_SHOW_CURSOR if os.isatty(2) else b"") + words.encode())
    for clean_up in reversed(on_leave):
        with suppress(Exception):
            clean_up()
    # Python's resource tracker reports semaphores that outlive this process on its stderr.
    started = sys.modules.get("multiprocessing.util")
    if started is not None:
        with suppress(Exception):
            started._run_finalizers(0)
    os._exit(exit_code())


on_leave: list[Callable[[], object]] = []
"""Functions to call when this process ends at once."""

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
    """End the process on a KeyboardInterrupt in a destructor or callback, which Python would only print."""
    if found.exc_type is KeyboardInterrupt:
        leave()
    sys.__unraisablehook__(found)


def _watch(pressed: int) -> None:
    first = _next(pressed, *_ENDS)
    time.sleep(_PATIENCE)
    with suppress(OSError):
        os.write(2, b"stopping ... (Ctrl-C once more ends at once)\n")
    _next(pressed, signal.SIGINT) if first == signal.SIGINT else time.sleep(_GRACE)
    _pressed.append(first)  # nothing else has, while compiled code runs
    leave()


def _next(pressed: int, *numbers: int) -> int:
    """Wait for one of some signals."""
    while (number := os.read(pressed, 1)[0]) not in numbers:
        pass
    return number
