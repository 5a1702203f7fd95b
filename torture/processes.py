"""Commands in processes of their own: what a call in this one cannot show."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from in_process import Place, environment
from outcomes import Ending, FoundFault, Kind

LIMIT = 60.0  # s


def start(arguments: Sequence[str], place: Place, **options: Any) -> subprocess.Popen[bytes]:
    """Start a command in a group of its own, so that all that it starts can be ended with it."""
    command = [sys.executable, "-m", "chilopod", *arguments]
    chosen = {"stdin": subprocess.DEVNULL, "env": environment(place), "preexec_fn": _with_signals, **options}
    return subprocess.Popen(command, cwd=place.here, start_new_session=True, **chosen)


def ended(process: subprocess.Popen[bytes], limit: float = LIMIT) -> int:
    """The exit code, once it and all that it started is gone.

    Raises
    ------
    FoundFault
        If it does not end in time.
    """
    try:
        return process.wait(limit)
    except subprocess.TimeoutExpired:
        raise FoundFault(Kind.SILENT, f"not done after {limit:g} s") from None
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def commanded(
    arguments: Sequence[str],
    place: Place,
    meanwhile: Callable[[subprocess.Popen[bytes]], None] | None = None,
    limit: float = LIMIT,
    **options: Any,
) -> Ending:
    """How a command ends in a process of its own; what it prints goes into the files of the place, if nowhere else."""
    with place.out.open("wb") as out, place.err.open("wb") as err:
        process = start(arguments, place, **{"stdout": out, "stderr": err, **options})
        if meanwhile:
            meanwhile(process)
        code = ended(process, limit)
    return Ending(code, place.out.read_text(errors="replace"), place.err.read_text(errors="replace"))


def _with_signals() -> None:
    # The processes of the harness ignore it, and what they start would, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
