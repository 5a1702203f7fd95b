"""Showing that a long computation goes on: a bar on a terminal, now and then a plain line elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_SECONDS_BETWEEN_LINES = 5.0


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float, str], None]]:
    """Show progress on stderr while the block runs.

    Yields
    ------
    A function of a title, the part done (0 to 1), and a few words about the current step.
    """
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

        columns = (
            TextColumn("{task.description:<44}"),
            BarColumn(bar_width=24),
            TimeElapsedColumn(),
            TextColumn("{task.fields[words]}", style="dim"),
        )
        tasks: dict[str, TaskID] = {}
        with Progress(*columns, console=Console(stderr=True)) as bar:

            def draw(title: str, done: float, words: str) -> None:
                if title not in tasks:
                    tasks[title] = bar.add_task(title, total=1.0, words="")
                bar.update(tasks[title], completed=done, words=words)

            yield draw
        return

    last: dict[str, float] = {}

    def line(title: str, done: float, words: str) -> None:
        now = time.monotonic()
        if title not in last or done >= 1.0 or now - last[title] > _SECONDS_BETWEEN_LINES:
            last[title] = now
            print(f"{title}: {100 * done:3.0f} %  {words}", file=sys.stderr, flush=True)

    yield line
