"""Other processes of a report: one walks the trials of the whole robot ahead of it, one draws its films."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from chilopod.cores import cores, use_at_most
from chilopod.paper.section import Context, Found, Section
from chilopod.process import deaf

T = TypeVar("T")
Ready = Callable[[Section[Any]], bool]


class Studio:
    """Process for work of many seconds in Python, such as films, during which this one gets on with its own.

    Its work must be importable, as must the main module of this process.
    """

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._over = False

    def begin(self) -> None:
        """Start the process if there is a second core; in the main thread, so that it ignores Ctrl-C."""
        if self._pool is None and cores() > 1:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(1, context, _settle)
            with deaf():
                self._pid: Future[int] = self._pool.submit(os.getpid)

    def do(self, work: Callable[[], T]) -> T:
        """Result of work, which is done here if the process has not begun or was killed.

        Raises BrokenProcessPool, CancelledError or RuntimeError after the end of the process.
        """
        if self._pool is None:
            return work()
        try:
            return self._pool.submit(work).result()
        except BrokenProcessPool:
            if self._over:
                raise
            return work()

    def end(self, at_once: bool = False) -> None:
        """End the process, after its work or at once."""
        self._over = True
        if self._pool is not None:
            if at_once and self._pid.done():
                with suppress(OSError, BrokenProcessPool):
                    os.kill(self._pid.result(), signal.SIGTERM)
            self._pool.shutdown(cancel_futures=at_once)


@contextmanager
def walked_ahead(sections: Sequence[Section[Any]], context: Context) -> Iterator[Ready]:
    """Walk the trials of sections that are ``ahead``, in their order and on one core, while the block runs.

    Their engine needs no compiled code, so that both cores are busy while this process compiles. The trials are kept in
    the folder of the context, where this process finds them and shares what is left of them. The block gets a function
    that tells whether all trials of a section have been walked; its first call begins the work. Nothing is walked ahead
    without a folder, locks of files, a second core, or other sections meanwhile.
    """
    asked = [section.name for section in sections if section.ahead]
    apart = 0 < len(asked) < len(sections) and context.folder is not None and cores() > 1
    if not apart or sys.platform != "linux":
        yield lambda section: False
        return
    spawn, done = multiprocessing.get_context("spawn"), set[str]()
    here, there = spawn.Pipe(duplex=False)
    process = spawn.Process(target=_walk, args=(there, asked, context), daemon=True, name="chilopod ahead")

    def ready(section: Section[Any]) -> bool:
        if process.pid is None:
            with deaf():
                process.start()
            there.close()
        with suppress(EOFError, OSError):  # it has ended
            while here.poll():
                done.add(here.recv())
        return section.name in done

    try:
        yield ready
    finally:
        if process.pid is not None:
            process.terminate()
            process.join(timeout=5.0)
        here.close()


def _walk(pipe: Connection, names: Sequence[str], context: Context) -> None:
    """Work of the process. The report itself meets every error once more, and tells it."""
    from chilopod.paper.registry import chosen

    _settle()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # its claims are released
    use_at_most(1)
    found = Found(context)
    for section in chosen(names):
        with suppress(Exception):
            found.add(section)
        with suppress(OSError):
            pipe.send(section.name)


def _settle() -> None:
    """Say nothing, and end with the parent."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    logging.disable()
    warnings.simplefilter("ignore")


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(0)
