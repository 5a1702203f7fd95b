"""The decorators for compiled code, with the one cache rule numba does not have.

Numba keeps compiled functions on disk and recompiles a function when *its own file* changes; a function that calls one
from another file keeps running the old callee. So on import, compiled functions older than the newest of this
package's sources are dropped.
"""

from __future__ import annotations

import contextlib
import functools
import os
import time
from pathlib import Path
from typing import Any

import numba
from numba.core import event

from chilopod.errors import ParameterError

# Somebody else's wish to debug: as plain Python, what is compiled here would take hours, and its overloads do not run.
numba.config.DISABLE_JIT = False


class _Compiling(event.Listener):
    """Time that numba has spent compiling in this process, functions that are called by others within them."""

    def __init__(self) -> None:
        self._before, self._begun, self._depth = 0.0, 0.0, 0

    def on_start(self, event: Any) -> None:
        self._begun = self._begun if self._depth else time.monotonic()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        self._before += 0.0 if self._depth else time.monotonic() - self._begun

    def seconds(self) -> float:
        """So far, s; nothing for what was read from the cache."""
        return self._before + (time.monotonic() - self._begun if self._depth else 0.0)


COMPILING = _Compiling()
event.register("numba:compile", COMPILING)


def _drop_stale() -> None:
    package = Path(__file__).parent
    folders = ("", "planar/", "stability/taylor/", "stability/implicit/")
    sources = [source for folder in folders for source in package.glob(f"{folder}*.py")]
    newest = max(source.stat().st_mtime for source in sources)
    for index in package.rglob("*.nbi"):
        with contextlib.suppress(OSError):  # another process may have been quicker, or the folder is read-only
            if index.stat().st_mtime < newest:
                index.unlink()


def _check_cache() -> None:
    # Numba looks for a folder where a function is to be kept: beside its source, and in the user's own.
    try:
        numba.njit(cache=True)(_drop_stale)
    except RuntimeError:
        raise ParameterError(
            "there is no folder in which compiled code can be kept",
            field="NUMBA_CACHE_DIR",
            value=os.environ.get("NUMBA_CACHE_DIR"),
            allowed="one that can be written, in the environment",
        ) from None


_drop_stale()
_check_cache()

njit = functools.partial(numba.njit, cache=True, nogil=True)
"""``numba.njit`` with the compiled code kept on disk; other threads go on while it runs, to show that it does and to
answer Ctrl-C."""

fused_njit = functools.partial(numba.njit, cache=True, nogil=True, fastmath={"contract"})
"""The same where a product and a sum may become one instruction with one rounding: not for exact error terms."""

parallel_njit = functools.partial(numba.njit, cache=True, nogil=True, parallel=True)
"""The same for loops over ``prange``: one robot an iteration, so the answer does not depend on the number of
threads."""


@njit(inline="always")
def copy_into(target: Any, source: Any) -> None:
    """Copy an array of one dimension, or the start of it, over another.

    With ``target[:] = source`` numba compiles what would say that the sizes differ, formatted: seconds of it.
    """
    for i in range(target.size):
        target[i] = source[i]
