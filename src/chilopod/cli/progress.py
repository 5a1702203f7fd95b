"""Showing that a long computation goes on: a bar on a terminal, now and then a plain line elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_UNTIL_BAR = 0.5  # s
_BETWEEN_LOOKS = 0.1  # s
_UNTIL_LINE = 2.0  # s: most commands have ended by then
_BETWEEN_LINES = 5.0  # s

_ONCE = "compiling, once on this machine"

_States = dict[str, tuple[float, str]]
"""By title: the part done, and words."""


@contextmanager
def progress_bar(doing: str) -> Iterator[Callable[[str, float, str], None]]:
    """Show progress on stderr while the block runs, if that takes a moment. The block gets a function to call with a
    title, the fraction done (0 to 1), and a few words about the current step."""
    states: _States = {}
    over = threading.Event()

    def tell(title: str, done: float, words: str) -> None:
        states[title] = done, words

    show = _bars if sys.stderr.isatty() else _lines
    showing = threading.Thread(target=show, args=(doing, states, over), name="progress", daemon=True)
    showing.start()
    try:
        yield tell
    finally:
        over.set()
        showing.join()


def _lines(doing: str, states: _States, over: threading.Event) -> None:
    begun, shown = time.monotonic(), _States()
    wait, said = _UNTIL_LINE, False
    while not over.wait(wait):
        wait, seconds = _BETWEEN_LINES, f"{time.monotonic() - begun:.0f} s"
        now = dict(states)
        if not said and _compiling():
            said = True
            print(f"{doing}: {_ONCE}", file=sys.stderr, flush=True)
        news = [title for title, state in now.items() if shown.get(title) != state] or list(now)[-1:]
        for title in news:
            done, words = now[title]
            print(f"{title}: {100 * done:3.0f} %  {words}, {seconds}", file=sys.stderr, flush=True)
        if not news:
            print(f"{doing}: {seconds}", file=sys.stderr, flush=True)
        shown = now


def _compiling() -> bool:
    """True if compiling has taken a while; asked of what is loaded, since a command may need no compiled code."""
    numba = sys.modules.get("chilopod.numba_internals")
    clock = getattr(numba, "COMPILING", None)  # another thread may be loading the module
    return numba is not None and clock is not None and bool(clock.seconds() > numba.NOTICED)


def _bars(doing: str, states: _States, over: threading.Event) -> None:
    if over.wait(_UNTIL_BAR):
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    title, words = TextColumn("{task.description:<44}"), TextColumn("{task.fields[words]}", style="dim")
    columns = title, BarColumn(bar_width=24), TimeElapsedColumn(), words
    tasks: dict[str, TaskID] = {}
    with Progress(*columns, console=Console(stderr=True)) as bar:
        alone = bar.add_task(doing, total=None, words="")
        last = False
        while not last:
            last = over.wait(_BETWEEN_LOOKS)
            for name, (done, said) in dict(states).items():
                if name not in tasks:
                    tasks[name] = bar.add_task(name, total=1.0, words="")
                bar.update(tasks[name], completed=done, words=said)
            bar.update(alone, visible=not tasks, words=_ONCE if _compiling() else "")
