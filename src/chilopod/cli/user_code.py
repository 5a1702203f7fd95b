"""Controllers and engines of users on the command line: search path, progress and share of the time."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from chilopod.engine import Controller

_SLOW = 0.5  # of the time of walks
_NOTICED = 1.0  # s


def own_controller(path: str | None) -> Controller | None:
    """The controller of ``--controller``, if any."""
    if path is None:
        return None
    from chilopod.engine import controller_named

    return controller_named(path)


@contextmanager
def own_code(show: Callable[[str, float, str], None]) -> Iterator[None]:
    """Find modules in the current folder too, after all others; show how far walks are that are under way; and say at
    the end if controllers took most of the time. Output of user code goes to stderr, because stdout has the result."""
    from chilopod.engine import watched

    here = os.getcwd()
    added = here not in sys.path and "" not in sys.path
    if added:
        sys.path.append(here)
    streams, stdout = (sys.stdout, sys.stderr), os.dup(1)
    try:
        # The streams of Python, and those of processes that it starts.
        streams[0].flush()
        os.dup2(2, 1)
        sys.stdout = sys.stderr
        with watched(lambda done, words: show("under way", done, words)) as spent:
            yield
    finally:
        sys.stdout, sys.stderr = streams
        os.dup2(stdout, 1)
        os.close(stdout)
        if added:
            sys.path.remove(here)
    if spent.share > _SLOW and spent.controller > _NOTICED:
        typer.echo(
            f"the controller took {100.0 * spent.share:.0f} % of the time of all walks, {spent.controller:.1f} s",
            err=True,
        )
